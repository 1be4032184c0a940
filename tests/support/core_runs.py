"""Runs of the core by its binding, and what they are made from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from lowered import lowered

import lagcli
from lagcli.engine.contract import IntegrationRequest
from lagcli.engine.core.model_data import model_data
from lagcli.engine.core.run import Integrator
from lagcli.engine.integrate.prepared import prepare
from lagcli.engine.integrate.run import Integration
from lagcli.engine.system import State
from lagcli.settings.settings import SettingsOverrides, resolve

MODELS = Path(__file__).parents[2] / "models"


def pendulum() -> Recorded:
    """Return an integration that has not begun, to t = 5 s with 51 samples."""
    what = lowered(lagcli.load(MODELS / "pendulum_cartesian.yaml"))
    start = State(0.0, np.array([0.0, -1.0]), np.array([1.5, 0.0]), what.p)
    overrides = SettingsOverrides(t_end=5.0, method="DOP853", rtol=1e-10, atol=1e-12)
    request = IntegrationRequest(
        state=start,
        rank=1,
        settings=resolve(overrides),
        times=np.linspace(0.0, 5.0, 51),
        atol=1e-12,
    )
    return Recorded(what.system, request, lambda block: None, None)


class Recorded(Integration):
    """An integration that keeps what its core is made from."""

    def integrator(self, constraint: Any, settings: dict[str, Any]) -> Integrator:
        self.constraint, self.given = constraint, settings
        return super().integrator(constraint, settings)


def data_of(integration: Recorded, solution: str) -> bytes:
    """Return the model of an integration as data; solved "densely", "unrolled" or "in a loop"."""
    system, used = integration.system, integration.in_use
    if solution == "unrolled":
        assert used.unrolled
        return model_data(
            system,
            integration.constraint,
            used.dynamics,
            integration.given,
            used.elimination,
            unrolled=True,
        )
    plain = prepare(system, None, None)
    plan = used.elimination if solution == "in a loop" else None
    return model_data(system, plain.constraint, plain.dynamics, integration.given, plan)
