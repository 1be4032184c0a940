"""Runs of the core by its binding, and models as data."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from lowered import lowered

import lagcli
from lagcli.engine.contract import IntegrationRequest
from lagcli.engine.integrate.model_data import model_data
from lagcli.engine.integrate.run import Integration
from lagcli.engine.system import State
from lagcli.settings.methods import METHODS
from lagcli.settings.settings import SettingsOverrides, resolve
from lagcli.simulations.simulation import Simulation, prepare

MODELS = Path(__file__).parents[2] / "models"


def pendulum(t_end: float = 5.0, samples: int = 51) -> Integration:
    """Return an integration that has not begun."""
    what = lowered(lagcli.load(MODELS / "pendulum_cartesian.yaml"))
    start = State(0.0, np.array([0.0, -1.0]), np.array([1.5, 0.0]), what.p)
    overrides = SettingsOverrides(t_end=t_end, method="DOP853", rtol=1e-10, atol=1e-12)
    request = IntegrationRequest(
        state=start,
        rank=1,
        settings=resolve(overrides),
        times=np.linspace(0.0, t_end, samples),
        atol=1e-12,
    )
    return Integration(what.system, request, lambda block: None, None)


def data_of(name: str, methods: tuple[str, ...] = tuple(METHODS), **settings: Any) -> bytes:
    """Return a shipped model as data; with other settings than its own.

    Parameters
    ----------
    name : str
        Of its file, from ``models`` on.
    """
    simulation = prepared(name, **settings)
    return model_data(simulation.system, simulation.request, methods)


def prepared(name: str, **settings: Any) -> Simulation:
    """Return a shipped model's simulation."""
    return prepare(lagcli.load(MODELS / f"{name}.yaml"), SettingsOverrides(**settings))
