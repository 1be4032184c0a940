"""Changes of a pendulum's state on its linearized constraint."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.lowering import lower
from lagcli.engine.sensitivity.changes import Change, DirectionalSystem, PerturbedState
from lagcli.engine.sensitivity.linearized_constraints import (
    positions_on,
    velocities_on,
    velocity_changes,
)
from lagcli.engine.switching.reference.modal import ModalMotion
from lagcli.engine.switching.reference.tapes import SwitchingTapes
from lagcli.engine.switching.switching import RowMode

PENDULUM = """
coordinates: [x, y]
parameters: {g: 10, l: 2}
T: (x'^2 + y'^2)/2
V: g*y
constraints: {rod: x^2 + y^2 = l^2}
events: {cut: {when: t >= 1, release: rod}}
initial: {x: l, y: 0, x': 0, y': {guess: 0}}
"""


def test_changes_are_brought_onto_the_linearized_constraints() -> None:
    system = lower(lagcli.derive(lagcli.load_text(PENDULUM)))
    q, v = np.array([1.2, -1.6]), np.array([0.8, 0.6])
    evaluator, modes = Evaluator(system, (10.0, 2.0)), np.array([RowMode.HOLDS])
    motion = ModalMotion(evaluator, SwitchingTapes(system), [0], modes, 1)
    by_l = np.array([[0.0], [1.0]])
    change = Change(np.zeros(1), np.array([[0.3], [0.1]]), np.array([[0.2], [-0.5]]), by_l)
    at = PerturbedState(DirectionalSystem(system, None), motion, 0.0, q, v, change)
    assert positions_on(at, []) is change
    change = positions_on(at, [0])
    # x δx + y δy = l δl, by a change along the rod
    assert q @ change.q[:, 0] == pytest.approx(2.0)
    moved = change.q[:, 0] - [0.3, 0.1]
    assert moved[0] * q[1] == pytest.approx(moved[1] * q[0])
    change = velocities_on(at._replace(change=change), [0])
    assert v @ change.q[:, 0] + q @ change.v[:, 0] == pytest.approx(0.0, abs=1e-14)
    np.testing.assert_allclose(velocity_changes(at._replace(change=change)), 0.0, atol=1e-14)
