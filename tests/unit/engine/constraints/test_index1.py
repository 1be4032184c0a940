"""The index-1 form: accelerations, multipliers and power against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from lowered import lowered
from pendulum_by_hand import G, pendulum_system

import lagcli
from lagcli.engine.constraints.index1 import Index1
from lagcli.engine.evaluator import Evaluator

Q, V = np.array([0.6, -0.8]), np.array([0.8, 0.6]) * 2.0  # on the circle, at 2 rad/s


def motion() -> Index1:
    return Index1(Evaluator(pendulum_system(), (G,)), 1)


def of(text: str, rank: int) -> Index1:
    """Return the motion of two free masses of 1 under constraints."""
    system, p = lowered(
        lagcli.load_text(f"""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: {G}*y
constraints: {text}
initial: {{x: {{guess: 1}}, y: {{guess: 0}}, x': {{guess: 0}}, y': {{guess: 0}}}}
""")
    )
    return Index1(Evaluator(system, p), rank)


def test_a_pendulum_by_hand() -> None:
    a, multipliers, power = motion().accelerations(0.0, Q, V)
    # along the rod −v²/l, across it gravity's part
    along, across = Q, np.array([0.8, 0.6])
    np.testing.assert_allclose(a, -4.0 * along - G * 0.6 * across, rtol=1e-14)
    # 2 λ is the force on the mass along the rod
    np.testing.assert_allclose(2 * multipliers, (a - [0.0, -G]) @ along, rtol=1e-14)
    assert power == pytest.approx(0.0, abs=1e-14)


def test_the_rate_is_that_of_positions_velocities_and_work() -> None:
    system = motion()
    a, _, power = system.accelerations(0.0, Q, V)
    rate = system.rate(0.0, np.concatenate([Q, V, [123.0]]))
    np.testing.assert_array_equal(rate, [*V, *a, power])


def test_a_driven_constraint_does_work() -> None:
    # y = t²/2 lifts the mass: λ = 1 + g, and the power is λ y'
    lift = of('{lift: "y = t^2/2"}', 1)
    a, multipliers, power = lift.accelerations(2.0, np.array([0.0, 2.0]), np.array([5.0, 2.0]))
    np.testing.assert_allclose(a, [0.0, 1.0], atol=1e-14)
    np.testing.assert_allclose(multipliers, [1.0 + G])
    # gravity's is in the potential
    assert power == pytest.approx((1.0 + G) * 2.0)


def test_redundant_constraints_share_the_multiplier() -> None:
    twice = of('{rod: "x^2 + y^2 = 1", again: "2*x^2 + 2*y^2 = 2"}', 1)
    twice.measure(0.0, Q, V)
    a, multipliers, _ = twice.accelerations(0.0, Q, V)
    expected, single, _ = motion().accelerations(0.0, Q, V)
    np.testing.assert_allclose(a, expected, rtol=1e-13)
    # of least norm: along the gradients, 1 to 2
    np.testing.assert_allclose(multipliers, single * [0.2, 0.4], rtol=1e-13)


def test_contradictions_are_found_where_constraints_hold() -> None:
    start = np.array([0.0, 0.0]), np.array([1.0, 0.0])
    both = of('{one: "x = sin(t)", two: "x = sin(t)"}', 1)
    both.measure(0.0, *start)
    assert both.contradicting(0.0, *start) is None
    apart = of('{one: "x = sin(t)", two: "x = t + t^2"}', 1)
    apart.measure(0.0, *start)
    assert apart.contradicting(0.0, *start) in (0, 1)


@pytest.mark.parametrize(("defect", "found"), [(1e-7, False), (1e-4, True)])
def test_contradictions_are_judged_by_the_accelerations(defect: float, found: bool) -> None:
    """Gravity's is 9.81: defects up to 1e-6 of it may be rounding in what is differentiated."""
    start = np.array([0.0, 0.0]), np.array([1.0, 0.0])
    both = of(f'{{one: "x = sin(t)", two: "x = sin(t) + {defect}*t^2"}}', 1)
    both.measure(0.0, *start)
    assert (both.contradicting(0.0, *start) is not None) is found


def test_lengths_are_the_largest_so_far() -> None:
    system = motion()
    for size in (1.0, 3.0, 0.1):
        system.measure(0.0, size * Q, V)
    np.testing.assert_allclose(system.lengths, [6.0])
    np.testing.assert_allclose(system.sizes, [1.0, 1.0])


def test_undefined_accelerations_are_nan() -> None:
    system = motion()
    origin = np.zeros(2)
    a, multipliers, power = system.accelerations(0.5, origin, V)
    assert np.isnan([*a, *multipliers, power]).all()
