"""Nearest position: on the constraints, by small steps, with contacts that are not violated."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lowered import lowered

import lagcli
from lagcli.arrays import Array
from lagcli.engine.constraints.nearest import Deviation, nearest_position
from lagcli.engine.evaluator import Evaluator


def of(constraints: str, coordinates: str = "x, y") -> Evaluator:
    names = coordinates.split(", ")
    kinetic = " + ".join(f"{name}'^2/2" for name in names)
    initial = ", ".join(f"{name}: {{guess: 1}}, {name}': {{guess: 0}}" for name in names)
    text = f"""
coordinates: [{coordinates}]
T: {kinetic}
constraints: {constraints}
initial: {{{initial}}}
"""
    system, p = lowered(lagcli.load_text(text))
    return Evaluator(system, p)


def towards(target: list[float]) -> Deviation:

    return lambda q: (q[:2] - np.array(target), np.eye(2, len(q)))


def itself(q: Array) -> Array:
    return q


def nearest(evaluator: Evaluator, q: list[float], target: list[float]) -> Array:
    start = np.array(q)
    found = nearest_position(evaluator, 0.0, start, 0 * start, towards(target), itself, 1.0)
    assert found is not None
    return found


@pytest.mark.parametrize("angle", [0.1, 1.0, 2.5, -3.0])
def test_a_pendulum_points_at_the_target(angle: float) -> None:
    direction = np.array([math.cos(angle), math.sin(angle)])
    found = nearest(of('{rod: "x^2 + y^2 = 1"}'), [1, 0], [1.7 * direction[0], 1.7 * direction[1]])
    # the distance from a circle is flat: the place is known to the root of the distance
    np.testing.assert_allclose(found, direction, atol=2e-3)
    assert found @ found == pytest.approx(1, abs=1e-13)


def test_what_can_be_reached_is_reached() -> None:
    rods = "{rod: x^2 + y^2 = 1, link: (z - x)^2 + y^2 = 4}"
    found = nearest(of(rods, "x, y, z"), [1, 0, 3], [math.cos(0.7), math.sin(0.7)])
    np.testing.assert_allclose(found[:2], [math.cos(0.7), math.sin(0.7)], atol=1e-6)
    assert found[2] == pytest.approx(found[0] + math.sqrt(4 - found[1] ** 2), abs=1e-12)


def test_redundant_constraints_are_as_good_as_one() -> None:
    found = nearest(of('{one: "y = 2*x", two: "2*y = 4*x"}'), [0, 0], [3, 1])
    np.testing.assert_allclose(found, [1, 2], atol=1e-6)  # the foot of the perpendicular


def test_without_constraints_the_target_is_reached() -> None:
    np.testing.assert_allclose(nearest(of("{}"), [5, 5], [-2, 1]), [-2, 1], atol=1e-6)


def test_a_contact_closes_and_the_body_slides_along_it() -> None:
    floor = of('{floor: "y >= 0"}')
    np.testing.assert_allclose(nearest(floor, [0, 1], [2, -1]), [2, 0], atol=1e-6)
    # and it leaves it again
    np.testing.assert_allclose(nearest(floor, [2, 0], [1, 3]), [1, 3], atol=1e-6)
    ceiling = of('{ceiling: "y <= x"}')
    np.testing.assert_allclose(nearest(ceiling, [0, -1], [0, 2]), [1, 1], atol=1e-6)


def test_at_a_dead_point_the_mechanism_does_not_go_round() -> None:
    """Of x = cos(a) the slope vanishes at a = 0: a step by it alone would be many turns."""
    evaluator = of('{slider: "x = cos(a)"}', "x, a")

    def deviation(q: Array) -> tuple[Array, Array]:
        return q[:1] - 0.9, np.array([[1.0, 0.0]])

    def places(q: Array) -> Array:
        return np.array([q[0], math.cos(q[1]), math.sin(q[1])])

    start = np.array([math.cos(1e-3), 1e-3])
    found = nearest_position(evaluator, 0.0, start, 0 * start, deviation, places, 1.0)
    assert found is not None
    np.testing.assert_allclose(found, [0.9, math.acos(0.9)], atol=1e-5)


def test_where_nothing_satisfies_the_constraints_there_is_no_position() -> None:
    start = np.array([0.3, 0.0])
    never = of('{never: "x^2 + 1 = 0"}')
    assert nearest_position(never, 0.0, start, 0 * start, towards([1, 1]), itself, 1.0) is None
