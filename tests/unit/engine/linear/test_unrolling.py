"""The unrolled elimination: each part of its outputs against NumPy."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from kkt_systems import eliminated, hand_written, whole

from lagcli.engine.layout import UnrolledLayout
from lagcli.engine.linear.elimination import order_at
from lagcli.engine.linear.unrolling import unroll
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.operations import Op

MASS = np.array([[4.0, 1.0, 0.0], [1.0, 3.0, 0.5], [0.0, 0.5, 2.0]])
JACOBIAN = np.array([[1.0, -2.0, 0.0], [0.0, 1.0, 1.0]])
RHS = np.array([1.0, 2.0, -1.0, 0.5, 3.0])
V = np.array([0.3, -0.7, 1.1])


def outputs() -> tuple[UnrolledLayout, list[float], np.ndarray]:
    """Return the layout, the outputs, and the other right side that was given."""
    system, p = hand_written(MASS, JACOBIAN, RHS)
    tape = unroll(system, order_at(system, [p]))
    other = np.array([0.2, -1.0, 0.4, 2.0, -3.0])
    moved = np.array([5.0, 7.0])
    found = ScalarTape(tape)((0.0, 0.0, 0.0, 0.0, *V, *p, *other, *moved))
    return UnrolledLayout(system.counts), found, other


def solved(rhs: np.ndarray) -> np.ndarray:
    """Return a and λ by NumPy."""
    x = np.linalg.solve(whole(MASS, JACOBIAN), rhs)
    return np.concatenate([x[:3], -x[3:]])


def test_the_outputs_of_the_dynamics_come_first() -> None:
    layout, found, _ = outputs()
    np.testing.assert_array_equal(found[layout.mass_matrix], MASS[MASS != 0])
    np.testing.assert_array_equal(found[layout.forcing], RHS[:3])
    np.testing.assert_array_equal(found[layout.jacobian], JACOBIAN[JACOBIAN != 0])
    np.testing.assert_array_equal(found[layout.rhs], RHS[3:])


def test_accelerations_multipliers_and_the_power_of_all_forces() -> None:
    layout, found, _ = outputs()
    expected = solved(RHS)
    np.testing.assert_allclose(found[layout.solution], expected, rtol=1e-12)
    # the applied forces have none in this System
    np.testing.assert_allclose(found[layout.total_power], [expected[3:] @ JACOBIAN @ V], rtol=1e-12)


def test_what_is_asked_for_apart() -> None:
    layout, found, other = outputs()
    *kept, first, second = found[layout.cancellation][: -len(RHS) - len(V)]
    assert (first, second) == (5.0, 2.0)  # squares of the lengths of B's rows
    assert kept
    assert all(0 < x <= 2 for x in kept)  # 2 where nothing is taken off; 0 where nothing is left
    np.testing.assert_allclose(found[-8:-3], solved(other), rtol=1e-12)
    expected = solved(np.array([0.0, 0.0, 0.0, 5.0, 7.0]))
    np.testing.assert_allclose(found[-3:], expected[:3], rtol=1e-12)


def test_pivots_that_cancel_keep_little() -> None:
    """A pivot of 1e-6 that 1 was taken off: twice its part of the terms."""
    mass = np.array([[1.0, 1.0], [1.0, 1.0 + 1e-6]])
    system, p = hand_written(mass, np.empty((0, 2)), np.zeros(2))
    tape = unroll(system, order_at(system, [p]))
    found = ScalarTape(tape)((*[0.0] * 5, *p, 0.0, 0.0))
    (kept,) = found[UnrolledLayout(system.counts).cancellation][:-4]
    assert kept == pytest.approx(2e-6 / (1 + 1e-6), rel=1e-9)


def test_structural_zeros_cost_nothing() -> None:
    """Masses without constraints."""
    system, p = hand_written(np.diag([2.0, 4.0, 8.0]), np.empty((0, 3)), np.ones(3))
    tape = unroll(system, order_at(system, [p]))
    kinds = Counter(Op(op) for op, *_ in tape.code)
    # a division for each mass, and a product for each unknown of both right sides
    assert (kinds[Op.DIV], kinds[Op.MUL]) == (3, 6)
    assert not kinds[Op.ADD] + kinds[Op.SUB]


def test_a_coordinate_without_inertia_is_eliminated_with_its_constraint() -> None:
    mass, jacobian = np.diag([2.0, 0.0]), np.array([[0.0, 3.0]])
    rhs = np.array([4.0, 5.0, 6.0])
    case = hand_written(mass, jacobian, rhs)
    plan = order_at(case.system, [(2.0, 4.0, 5.0, 3.0, 6.0, 0.0)])
    assert any(plan.paired)
    for x in eliminated(case, plan, rhs)[0]:
        np.testing.assert_allclose(x, [2.0, 2.0, 5.0 / 3.0])


def test_what_touches_nothing_ends_no_long_elimination() -> None:
    """Free masses beside three with two constraints: a round of pivots without neighbours."""
    mass, jacobian = np.eye(250), np.zeros((2, 250))
    jacobian[:, :3] = [[3.0, 4.0, 5.0], [1.0, -2.0, 1.0]]
    rhs = np.arange(1.0, 253.0)
    case = system, p = hand_written(mass, jacobian, rhs)
    plan = order_at(system, [p])
    for x in eliminated(case, plan, rhs)[0]:
        np.testing.assert_allclose(x, np.linalg.solve(whole(mass, jacobian), rhs), rtol=1e-12)


def test_a_pair_that_touches_all_others_ends_no_round() -> None:
    """A pivot of order two whose neighbours are all that is left."""
    mass, jacobian = np.diag([0.01, 0.01]), np.array([[1.0, 2.0]])
    rhs = np.array([4.0, 5.0, 6.0])
    case = system, p = hand_written(mass, jacobian, rhs)
    plan = order_at(system, [p])
    for x in eliminated(case, plan, rhs)[0]:
        np.testing.assert_allclose(x, np.linalg.solve(whole(mass, jacobian), rhs), rtol=1e-12)
