"""Adjustment of the values that an event does not set."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lowered import lowered

import lagcli
from lagcli.arrays import Array
from lagcli.engine.constraints.adjustment import (
    ClosedContact,
    Deviation,
    adjusted,
    adjusted_positions,
    adjusted_velocities,
    held_during,
    impulse_of,
    nearest_position,
)
from lagcli.engine.constraints.initial import NoConsistentState
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.switching.switching import EventRule, RowMode
from lagcli.engine.system import System
from lagcli.simulations import simulation

MODEL = """
coordinates: [x, y, z]
T: (x'^2 + 2*y'^2 + 4*z'^2)/2
V: 0
constraints:
  line: x + y + z = 3
  floor: z >= 1
  roof: y <= 5
  pin: {expr: x = y, active: false}
  rub: {expr: y' = 0, limit: 2}
events: {go: {when: t >= 9, engage: pin}}
initial: {x: 1, y: 1, z: 1, x': 0, y': 0, z': 0}
"""
EXACT = np.zeros(3)
FREE = np.zeros((2, 3), dtype=bool)


def system() -> System:
    return simulation.prepare(lagcli.load_text(MODEL)).system


def evaluator() -> Evaluator:
    return Evaluator(system(), ())


def rows_of(**fields: object) -> tuple[list[int], list[int], dict[int, ClosedContact]]:
    switching = system().switching
    assert switching is not None
    rule = EventRule("e", **fields)  # type: ignore[arg-type]
    modes = [RowMode.HOLDS, RowMode.OPEN, RowMode.OPEN, RowMode.HOLDS]
    found = held_during(switching, rule, 5, [True, True, False, True], modes, lambda k: 1e-9)
    return list(found.positions), list(found.velocities), dict(found.contacts)


def test_rows_that_hold_during_an_event() -> None:
    floor = {1: ClosedContact(1, 1e-9)}
    assert rows_of() == ([0], [0], floor)
    assert rows_of(engage=(3,)) == ([0], [0], floor)
    # velocities that are set hold on what is engaged with them
    assert rows_of(engage=(3,), targets=(("v", 0),)) == ([0], [0, 3], floor)
    assert rows_of(release=(1,)) == ([0], [0], {})


def test_the_nearest_position_in_the_metric_of_mass() -> None:
    start, v = np.array([1.0, 1.0, 2.0]), np.zeros(3)
    found = adjusted_positions(evaluator(), 0.0, start, v, FREE[0], [0], {})
    # -1 divided by 1 : 1/2 : 1/4
    np.testing.assert_allclose(found, start - np.array([4, 2, 1]) / 7, atol=1e-14)
    fixed = np.array([True, False, False])
    found = adjusted_positions(evaluator(), 0.0, start, v, fixed, [0], {})
    np.testing.assert_allclose(found, start - np.array([0, 2, 1]) / 3, atol=1e-14)
    closed = {1: ClosedContact(1, 1e-9)}
    low = np.array([1.0, 1.0, 1.0 + 1 / 7])
    found = adjusted_positions(evaluator(), 0.0, np.array([1.0, 2, 1]), v, FREE[0], [0], closed)
    np.testing.assert_allclose(found, [1 - 2 / 3, 2 - 1 / 3, 1], atol=1e-14)
    found = adjusted_positions(evaluator(), 0.0, low, v, FREE[0], [0], closed)
    assert found[2] > 1  # it opens
    with pytest.raises(NoConsistentState):
        adjusted_positions(evaluator(), 0.0, start, v, np.ones(3, dtype=bool), [0], {})


def test_contacts_push_and_do_not_pull() -> None:
    q, closed = np.array([1.0, 1.0, 1.0]), {1: ClosedContact(1, 1e-9)}
    up = adjusted_velocities(
        evaluator(), 0.0, q, np.array([-7.0, 0, 0]), FREE[1], [0], closed, EXACT
    )
    np.testing.assert_allclose(up.v, [-3, 2, 1], atol=1e-14)
    np.testing.assert_allclose(up.impulse, [4, 0, 0, 0, 0], atol=1e-13)
    down = adjusted_velocities(
        evaluator(), 0.0, q, np.array([3.0, 0, 0]), FREE[1], [0], closed, EXACT
    )
    np.testing.assert_allclose(down.v, [1, -1, 0], atol=1e-14)
    np.testing.assert_allclose(down.impulse, [-2, 2, 0, 0, 0], atol=1e-13)
    # a fixed velocity into the floor: an impact follows, which is none of this
    fixed = np.array([False, False, True])
    into = adjusted_velocities(
        evaluator(), 0.0, q, np.array([0, 0, -3.0]), fixed, [0], closed, EXACT
    )
    np.testing.assert_allclose(into.v, [2, 1, -3], atol=1e-14)
    np.testing.assert_allclose(into.impulse, [2, 0, 0, 0, 0], atol=1e-13)


def test_a_contact_away_from_its_surface_takes_no_part() -> None:
    q = np.array([0.5, 1.0, 1.5])
    closed = {1: ClosedContact(1, 1e-9), 2: ClosedContact(-1, 1e-9)}
    fixed = FREE.copy()
    fixed[0, 2] = True
    switching = system().switching
    assert switching is not None
    held = held_during(
        switching, EventRule("e"), 5, [True] * 4, [RowMode.HOLDS] * 4, lambda k: 1e-9
    )
    found = adjusted(evaluator(), 0.0, q, np.array([0, 0, -1.0]), fixed, held, EXACT)
    assert held.contacts == closed
    assert found.v[2] < 0
    assert found.impulse[1] == 0


def test_the_impulse_of_redundant_rows_is_of_least_norm() -> None:
    text = "coordinates: [x]\nT: x'^2/2\nV: 0\nconstraints: {a: x = 1, b: 2*x = 2}\n"
    text += "initial: {x: 1, x': 0}\n"
    known = Evaluator(simulation.prepare(lagcli.load_text(text)).system, ())
    q, change, free = np.ones(1), np.array([5.0]), np.ones(1, dtype=bool)
    found = impulse_of(known, 0.0, q, change, change, [0, 1], free)
    np.testing.assert_allclose(found, [1, 2], atol=1e-14)
    found = impulse_of(known, 0.0, q, change, change, [0, 1], free, np.array([5.0]))
    np.testing.assert_allclose(found, [0, 0], atol=1e-14)
    assert not impulse_of(known, 0.0, q, change, change, [], free).any()


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
