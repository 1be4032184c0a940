"""Derivatives of accelerations and multipliers in a mode, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.lowering import lower
from lagcli.engine.sensitivity.changes import Change, DirectionalSystem, PerturbedState
from lagcli.engine.sensitivity.modal_tangent import MotionChange, motion_change, solve
from lagcli.engine.switching.reference.modal import ModalMotion
from lagcli.engine.switching.reference.tapes import SwitchingTapes
from lagcli.engine.switching.switching import RowMode

MODEL = """
coordinates: [x, y]
parameters: {m: 2, mu: 0.3, g: 10, F: 7}
T: m*(x'^2 + y'^2)/2
V: m*g*y
Q: {x: F, y: "F*y + F*lambda.floor/50"}
constraints: {floor: {expr: y >= 0, friction: mu*(1 + x^2), slip: x'}}
initial: {x: 0.5, y: 0, x': 1, y': 0}
"""


def found(modes: list[RowMode], rows: list[int]) -> MotionChange:
    system = lower(lagcli.derive(lagcli.load_text(MODEL)))
    evaluator = Evaluator(system, (2.0, 0.3, 10.0, 7.0))
    motion = ModalMotion(evaluator, SwitchingTapes(system), rows, np.array(modes), len(rows))
    q, v = np.array([0.5, 0.0]), np.array([1.0, 0.0])
    motion.measure(0.0, q, v)
    directions = np.eye(8)  # x, y, x', y', m, mu, g, F
    change = Change(np.zeros(8), directions[:2], directions[2:4], directions[4:])
    at = PerturbedState(DirectionalSystem(system, None), motion, 0.0, q, v, change)
    return motion_change(at)


def test_a_block_that_slips() -> None:
    # λ (1 + F/50) = m g, λ_slip = −μ (1 + x²) λ, m x'' = F + λ_slip
    x, m, mu, g, F = 0.5, 2.0, 0.3, 10.0, 7.0
    at = found([RowMode.HOLDS, RowMode.FORWARD], [0])
    share, rough = 1 + F / 50, mu * (1 + x * x)
    normal = m * g / share
    np.testing.assert_allclose(at.multipliers, [normal, -rough * normal], rtol=1e-13)
    dn = np.array([0, -F / share, 0, 0, g / share, 0, m / share, -normal / share / 50])
    np.testing.assert_allclose(at.dmultipliers[0], dn, atol=1e-12)
    drough = np.array([2 * mu * x, 0, 0, 0, 0, 1 + x * x, 0, 0])
    np.testing.assert_allclose(at.dmultipliers[1], -rough * dn - drough * normal, atol=1e-12)
    dm, dF = np.eye(8)[4], np.eye(8)[7]
    expected = (dF + at.dmultipliers[1]) / m - (F - rough * normal) / m**2 * dm
    np.testing.assert_allclose(at.da[0], expected, atol=1e-12)
    np.testing.assert_allclose(at.da[1], 0.0, atol=1e-12)


def test_open_rows_have_no_force_and_rows_that_stick_no_acceleration() -> None:
    flies = found([RowMode.OPEN, RowMode.OPEN], [])
    np.testing.assert_array_equal(flies.dmultipliers, 0.0)
    np.testing.assert_allclose(flies.da[1], [0, 3.5, 0, 0, 0, 0, -1, 0], atol=1e-13)
    sticks = found([RowMode.HOLDS, RowMode.HOLDS], [0, 1])
    np.testing.assert_allclose(sticks.da, 0.0, atol=1e-12)
    np.testing.assert_allclose(sticks.dmultipliers[1], -np.eye(8)[7], atol=1e-12)


def test_redundant_rows_share_forces_by_least_norm() -> None:
    matrix = np.array([[1.0, -1, -1], [1, 0, 0], [1, 0, 0]])
    x = solve(matrix, np.array([[2.0, np.nan], [0, 0], [0, 0]]), redundant=True)
    np.testing.assert_allclose(x[:, 0], [0, -1, -1], atol=1e-12)
    assert np.isnan(x[:, 1]).any()
    regular = solve(np.array([[1e-8, -1.0], [1.0, 0.0]]), np.array([[3.0], [2.0]]), redundant=False)
    assert regular[:, 0].tolist() == [pytest.approx(2.0), pytest.approx(-3 + 2e-8)]
