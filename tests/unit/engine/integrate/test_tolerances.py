"""Sizes of the state and the tolerances that follow from them, on an oscillator by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from lowered import lowered
from pendulum_by_hand import request

import lagcli
from lagcli.engine.constraints.index1 import Index1
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.integrate.tolerances import Sizes
from lagcli.engine.state import State

RTOL = 1e-6


def oscillator(
    q: float, v: float, frequency: float = 3.0, mass: float = 2.0, **changes: Any
) -> tuple[Sizes, np.ndarray]:
    """Return the sizes of m q'' = −m w² q from a start, and the state there."""
    system, p = lowered(
        lagcli.load_text(f"""
coordinates: [q]
parameters: {{m: {mass!r}, w: {frequency!r}}}
T: m*q'^2/2
V: m*w^2*q^2/2
initial: {{q: 1, q': 0}}
""")
    )
    state = State(0.0, np.array([q]), np.array([v]), p)
    changes = {"atol": 0.0, "rtol": RTOL, "times": np.array([1.0]), "t_end": 1.0, **changes}
    made = request(**changes)._replace(state=state, rank=0)
    return Sizes(Index1(Evaluator(system, p), 0), made, state.y), state.y


def test_given_tolerances_are_kept() -> None:
    sizes, y = oscillator(5.0, 0.0, atol=1e-4)
    np.testing.assert_array_equal(sizes.tolerances, [1e-4] * 3)
    sizes.update(0.1, 100 * y, 0.1)
    np.testing.assert_array_equal(sizes.tolerances, [1e-4] * 3)


def test_tolerances_are_a_tenth_of_the_relative_one_of_the_sizes() -> None:
    sizes, _ = oscillator(5.0, -4.0)
    np.testing.assert_allclose(sizes.tolerances[:2], 0.1 * RTOL * np.array([5.0, 4.0]), rtol=1e-4)


def test_sizes_are_the_largest_so_far() -> None:
    sizes, _ = oscillator(5.0, -4.0)
    sizes.update(0.1, np.array([-7.0, 1.0, 0.0]), 0.1)
    np.testing.assert_allclose(sizes.size[:2], [7.0, 4.0])
    np.testing.assert_allclose(sizes.largest(), [7.0])
    # the work's is the largest kinetic energy: m v²/2
    sizes.update(0.2, np.array([1.0, 6.0, 0.0]), 0.1)
    assert sizes.size[-1] == pytest.approx(2.0 * 36.0 / 2)
    assert sizes.tolerances[-1] == pytest.approx(0.1 * RTOL * 36.0, rel=1e-4)


def test_accelerations_are_judged_by_their_terms() -> None:
    """Where forces cancel, as at rest at the end of a spring, each of them counts."""
    system, p = lowered(
        lagcli.load_text("""
coordinates: [q]
T: q'^2/2
V: 9*q^2/2 - 45*q
initial: {q: 5, q': 0}
""")
    )
    state = State(0.0, np.array([5.0]), np.zeros(1), p)
    made = request(atol=0.0)._replace(state=state, rank=0)
    motion = Index1(Evaluator(system, p), 0)
    assert motion.rate(0.0, state.y)[1] == 0.0
    assert 20.0 < Sizes(motion, made, state.y).acceleration_terms[0] <= 45.0


def test_kinds_share_what_is_largest() -> None:
    system, p = lowered(
        lagcli.load_text("""
coordinates: [x, y, phi]
T: (x'^2 + y'^2 + phi'^2)/2
V: 50*x^2
initial: {x: 2, y: 0, phi: 0, x': 0, y': 0, phi': 0}
""")
    )
    state = State(0.0, np.array([2.0, 1e-3, 7.0]), np.zeros(3), p)
    made = request(atol=0.0, kinds=(0, 0, 1))._replace(state=state, rank=0)
    sizes = Sizes(Index1(Evaluator(system, p), 0), made, state.y)
    np.testing.assert_allclose(sizes.largest(), [2.0, 2.0, 7.0])
    np.testing.assert_allclose(sizes.acceleration_terms, [200.0, 200.0, 0.0], rtol=1e-6)


def test_a_coordinate_that_rests_until_later_has_a_size() -> None:
    system, p = lowered(
        lagcli.load_text("""
coordinates: [x]
T: x'^2/2
Q: {x: "if(t > 1, 6, 0)"}
initial: {x: 0, x': 0}
""")
    )
    state = State(0.0, np.zeros(1), np.zeros(1), p)
    made = request(atol=0.0)._replace(state=state, rank=0)
    sizes = Sizes(Index1(Evaluator(system, p), 0), made, state.y)
    np.testing.assert_array_equal(sizes.future_acceleration, [6.0])
    assert (sizes.tolerances > 0).all()


def test_the_first_step_has_no_units() -> None:
    """Lengths times 1e3, masses times 1e6, and then times over 1e2, change it as they must."""
    sizes, y = oscillator(5.0, -4.0)
    first = sizes.first_step(0.0, y, 8.0)
    assert 0 < first < 1 / 3.0  # less than a radian of the oscillation
    sizes, y = oscillator(5e3, -4e3, mass=2e6)
    assert sizes.first_step(0.0, y, 8.0) == pytest.approx(first, rel=1e-9)
    short = {"t_end": 0.01, "times": np.array([0.01])}
    sizes, y = oscillator(5.0, -4e2, frequency=3e2, **short)
    assert sizes.first_step(0.0, y, 8.0) == pytest.approx(first / 1e2, rel=1e-9)


def test_the_first_step_stays_within_limits() -> None:
    sizes, y = oscillator(5.0, -4.0, max_step=1e-5)
    assert sizes.first_step(0.0, y, 8.0) == 1e-5
    sizes, y = oscillator(5.0, -4.0)
    assert sizes.first_step(1.0 - 1e-6, y, 8.0) <= 1.0000001e-6


def test_the_first_step_follows_the_tolerance_and_the_order() -> None:
    steps = {}
    for rtol in (1e-4, 1e-8):
        sizes, y = oscillator(5.0, -4.0, rtol=rtol)
        steps[rtol] = sizes.first_step(0.0, y, 4.0)
    assert steps[1e-4] / steps[1e-8] == pytest.approx(10.0, rel=1e-9)  # 1e4 to the 1/4
