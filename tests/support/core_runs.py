"""A run of the core by its binding: the pendulum in Cartesian coordinates."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from lowered import lowered

import lagcli
from lagcli.engine.contract import IntegrationRequest
from lagcli.engine.integrate.run import Integration
from lagcli.engine.system import State
from lagcli.settings.settings import SettingsOverrides, resolve

MODEL = Path(__file__).parents[2] / "models" / "pendulum_cartesian.yaml"


def pendulum() -> Integration:
    """Return an integration that has not begun, to t = 5 s with 51 samples."""
    what = lowered(lagcli.load(MODEL))
    start = State(0.0, np.array([0.0, -1.0]), np.array([1.5, 0.0]), what.p)
    overrides = SettingsOverrides(t_end=5.0, method="DOP853", rtol=1e-10, atol=1e-12)
    request = IntegrationRequest(
        state=start,
        rank=1,
        settings=resolve(overrides),
        times=np.linspace(0.0, 5.0, 51),
        atol=1e-12,
    )
    return Integration(what.system, request, lambda block: None, None)
