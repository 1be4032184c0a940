"""Adjustment of the values that an event does not set."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lowered import lowered

import lagcli
from lagcli.arrays import Array, Flags
from lagcli.engine.constraints.adjustment import (
    Adjustment,
    Deviation,
    adjusted,
    held_during,
    nearest_position,
)
from lagcli.engine.constraints.initial import NoConsistentState
from lagcli.engine.core.start_search import HeldRows
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


def rows_of(**fields: object) -> tuple[list[int], list[int], dict[int, int]]:
    switching = system().switching
    assert switching is not None
    rule = EventRule("e", **fields)  # type: ignore[arg-type]
    modes = [RowMode.HOLDS, RowMode.OPEN, RowMode.OPEN, RowMode.HOLDS]
    found = held_during(switching, rule, 5, [True, True, False, True], modes, lambda k: 1e-9)
    positions, velocities = (
        np.flatnonzero(x).tolist() for x in (found.positions, found.velocities)
    )
    np.testing.assert_array_equal(found.no_gap, 1e-9 * np.abs(found.sign))
    return positions, velocities, {int(k): int(found.sign[k]) for k in np.flatnonzero(found.sign)}


def test_rows_that_hold_during_an_event() -> None:
    floor = {1: 1}
    assert rows_of() == ([0], [0], floor)
    assert rows_of(engage=(3,)) == ([0], [0], floor)
    # velocities that are set hold on what is engaged with them
    assert rows_of(engage=(3,), targets=(("v", 0),)) == ([0], [0, 3], floor)
    assert rows_of(release=(1,)) == ([0], [0], {})


def held(*rows: int, closed: dict[int, int] | None = None, count: int = 5) -> HeldRows:
    holds, sign = np.zeros((2, count), dtype=np.int32)
    holds[list(rows)] = 1
    for row, side in (closed or {}).items():
        sign[row] = side
    return HeldRows(holds, holds, sign, 1e-9 * np.abs(sign))


def moved(q: list[float], v: list[float], rows: HeldRows, fixed: Flags = FREE) -> Adjustment:
    return adjusted(evaluator(), 0.0, np.array(q), np.array(v), fixed, rows, EXACT)


def fixed_values(*places: tuple[int, int]) -> Flags:
    fixed = FREE.copy()
    for place in places:
        fixed[place] = True
    return fixed


def test_the_nearest_position_in_the_metric_of_mass() -> None:
    start, still = [1.0, 1.0, 2.0], [0.0] * 3
    found = moved(start, still, held(0)).q
    # -1 divided by 1 : 1/2 : 1/4
    np.testing.assert_allclose(found, start - np.array([4, 2, 1]) / 7, atol=1e-14)
    found = moved(start, still, held(0), fixed_values((0, 0))).q
    np.testing.assert_allclose(found, start - np.array([0, 2, 1]) / 3, atol=1e-14)
    closed = held(0, closed={1: 1})
    found = moved([1.0, 2, 1], still, closed).q
    np.testing.assert_allclose(found, [1 - 2 / 3, 2 - 1 / 3, 1], atol=1e-14)
    found = moved([1.0, 1.0, 1.0 + 1 / 7], still, closed).q
    assert found[2] > 1  # it opens
    with pytest.raises(NoConsistentState) as caught:
        moved(start, still, held(0), fixed_values((0, 0), (0, 1), (0, 2)))
    assert caught.value.level == "position"


def test_velocities_that_contradict_the_constraints() -> None:
    fixed = fixed_values((1, 0), (1, 1), (1, 2))
    with pytest.raises(NoConsistentState) as caught:
        moved([1.0, 1.0, 1.0], [1.0, 0, 0], held(0), fixed)
    assert caught.value.level == "velocity"
    # by no more than their errors
    allowed = adjusted(
        evaluator(), 0.0, np.ones(3), np.array([1.0, 0, 0]), fixed, held(0), np.full(3, 0.5)
    )
    np.testing.assert_array_equal(allowed.v, [1, 0, 0])


def test_contacts_push_and_do_not_pull() -> None:
    q, closed = [1.0, 1.0, 1.0], held(0, closed={1: 1})
    up = moved(q, [-7.0, 0, 0], closed)
    np.testing.assert_allclose(up.v, [-3, 2, 1], atol=1e-14)
    np.testing.assert_allclose(up.impulse, [4, 0, 0, 0, 0], atol=1e-13)
    down = moved(q, [3.0, 0, 0], closed)
    np.testing.assert_allclose(down.v, [1, -1, 0], atol=1e-14)
    np.testing.assert_allclose(down.impulse, [-2, 2, 0, 0, 0], atol=1e-13)
    # a fixed velocity into the floor: an impact follows, which is none of this
    into = moved(q, [0, 0, -3.0], closed, fixed_values((1, 2)))
    np.testing.assert_allclose(into.v, [2, 1, -3], atol=1e-14)
    np.testing.assert_allclose(into.impulse, [2, 0, 0, 0, 0], atol=1e-13)


def test_a_contact_away_from_its_surface_takes_no_part() -> None:
    closed = held(0, closed={1: 1, 2: -1})
    found = moved([0.5, 1.0, 1.5], [0, 0, -1.0], closed, fixed_values((0, 2)))
    assert found.v[2] < 0
    assert found.impulse[1] == 0


def test_the_impulse_of_redundant_rows_is_of_least_norm() -> None:
    text = "coordinates: [x]\nT: x'^2/2\nV: 0\nconstraints: {a: x = 1, b: 2*x = 2}\n"
    text += "initial: {x: 1, x': 0}\n"
    known = Evaluator(simulation.prepare(lagcli.load_text(text)).system, ())
    for rows, expected in (((0, 1), [-1.0, -2.0]), ((0,), [-5.0, 0.0]), ((), [0.0, 0.0])):
        free = np.zeros((2, 1), dtype=bool)
        given = held(*rows, count=2)
        found = adjusted(known, 0.0, np.ones(1), np.array([5.0]), free, given, np.zeros(1))
        np.testing.assert_allclose(found.impulse, expected, atol=1e-14)


@pytest.mark.parametrize("seed", range(60))
def test_random_impulses(seed: int) -> None:
    """M Δv = BᵀΛ of free velocities, B v = 0, Λ of least norm: the solution of dense algebra."""
    random = np.random.default_rng(seed)
    n, m = int(random.integers(2, 7)), int(random.integers(1, 5))
    rows = random.normal(size=(m, n)) * 10.0 ** random.uniform(-2, 2, (m, 1))
    if m > 2 and seed % 2:
        rows[1] = rows[0] * random.normal() + rows[2]
    mass = np.diag(10.0 ** random.uniform(-3, 3, n))
    names = [f"q{i}" for i in range(n)]
    kinetic = " + ".join(f"{float(mass[i, i])!r}*{x}'^2/2" for i, x in enumerate(names))
    sums = [
        " + ".join(f"({b!r})*{x}" for b, x in zip(row, names, strict=True)) for row in rows.tolist()
    ]
    constraints = ", ".join(f"c{k}: '{total} = 0'" for k, total in enumerate(sums))
    initial = ", ".join(f"{x}: {{guess: 0}}, {x}': {{guess: 0}}" for x in names)
    text = f"coordinates: [{', '.join(names)}]\nT: {kinetic}\nconstraints: {{{constraints}}}\n"
    system, p = lowered(lagcli.load_text(f"{text}initial: {{{initial}}}\n"))
    free, v = np.ones(n, bool), random.normal(size=n)
    free[: int(random.integers(0, max(1, n - m)))] = False
    fixed = np.array([np.zeros(n, bool), ~free])
    found = adjusted(
        Evaluator(system, p), 0.0, np.zeros(n), v, fixed, held(*range(m), count=m), np.zeros(n)
    )
    b = rows[:, free]
    inverse = np.diag(1 / np.diag(mass)[free])
    root = np.sqrt(inverse)
    # in units in which all masses are 1, and all rows have length 1
    unit = b @ root / np.linalg.norm(b @ root, axis=1)[:, None]
    psi = rows @ v / np.linalg.norm(b @ root, axis=1)
    change = np.zeros(n)
    change[free] = -root @ np.linalg.pinv(unit, rcond=1e-8) @ psi
    np.testing.assert_allclose(found.v, v + change, atol=1e-9 * np.abs(change).max() + 1e-14)
    impulse = np.linalg.lstsq(root @ b.T, root @ (mass @ change)[free], rcond=1e-13)[0]
    np.testing.assert_allclose(
        found.impulse @ b, impulse @ b, atol=1e-9 * np.abs(impulse @ b).max()
    )
    if np.linalg.matrix_rank(unit, 1e-8) < m:
        _, values, right = np.linalg.svd(b.T)
        idle = right[np.sum(values > 1e-12 * values[0]) :]
        # how redundant rows share it is known to the rounding errors of rows that count as none
        assert np.abs(idle @ found.impulse).max() <= 1e-7 * np.abs(found.impulse).max()
    else:
        np.testing.assert_allclose(found.impulse, impulse, atol=1e-8 * np.abs(impulse).max())


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
