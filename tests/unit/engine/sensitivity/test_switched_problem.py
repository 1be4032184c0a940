"""Runs that switch, with derivatives, by one problem."""

from __future__ import annotations

import numpy as np

import lagcli
from lagcli.engine.contract import Block, IntegrationRequest
from lagcli.engine.lowering import lower
from lagcli.engine.sensitivity.integration import Derivatives
from lagcli.engine.sensitivity.start import StartDerivatives
from lagcli.engine.sensitivity.switched_problem import SwitchedProblem
from lagcli.engine.state import State
from lagcli.settings.settings import SettingsOverrides, resolve

BALL = """
coordinates: [y]
parameters: {g: 10}
T: y'^2/2
V: g*y
constraints: {floor: {expr: y >= 0, restitution: 0.5}}
initial: {y: 1, y': 0}
"""


def test_one_problem_has_many_runs() -> None:
    model = lagcli.load_text(BALL)
    system = lower(lagcli.derive(model))
    settings = resolve(SettingsOverrides(t_end=0.7, method="Taylor"), model.settings)
    problem = SwitchedProblem(system, ("g",), np.array([10.0]))
    blocks: list[tuple[Block, Derivatives]] = []
    for g in (10.0, 5.0):
        times = np.array([0.0, 0.2, 0.7])
        request = IntegrationRequest(
            State(0.0, np.ones(1), np.zeros(1), (g,)),
            0,
            settings,
            times,
            0.0,
        )
        blocks.clear()
        nothing = StartDerivatives(np.zeros((1, 1)), np.zeros((1, 1)))
        run = problem.integrate(request, nothing, np.array([[10.0]]), lambda *x: blocks.append(x))
        assert run.status == "completed"
        assert run.methods == ("DOP853",)
        ((block, found),) = blocks
        np.testing.assert_allclose(found.q[1], -(0.2**2) / 2, rtol=1e-8)
        if run.events:
            fall = (2 / g) ** 0.5
            assert run.event_changes is not None
            # with respect to g / 10, over 10
            np.testing.assert_allclose(run.event_changes[0], -fall / (2 * g), rtol=1e-8)
        assert len(block.time) == 3
