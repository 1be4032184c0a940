"""The consistent initial state: what moves, what stays, and what is said when there is none."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from lowered import lowered
from trees import ROPE

import lagcli
from lagcli.arrays import Array
from lagcli.engine.constraints.initial import (
    ConsistentState,
    Spin,
    almost_dependent,
    along,
    coordinate_reach,
    dependent_sets,
    free_directions,
    next_to_singular,
    rates_of_spin,
    spin_derivative,
    spin_of,
    with_given_spins,
)
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.lowering.lower import lower
from lagcli.engine.system import State
from lagcli.errors import LagcliError, ModelError, NumericalError
from lagcli.settings.settings import SettingsOverrides, resolve
from lagcli.simulations import simulation
from lagcli.simulations.start import find_start

ROD = "rod: x^2 + y^2 = 1"

#: A start is on the constraints to rounding error.
CLOSE = 1e-13


def start(
    constraints: str,
    initial: str,
    T: str = "(x'^2 + y'^2)/2",
    coordinates: str = "[x, y]",
    **settings: Any,
) -> ConsistentState:
    """Find the start of a model in a few words."""
    rows = "".join(f"  {line}\n" for line in constraints.split("; ") if line)
    text = (
        f"name: start\ncoordinates: {coordinates}\nT: {T}\n"
        + (f"constraints:\n{rows}" if rows else "")
        + f"initial: {{{initial}}}\n"
    )
    model = lagcli.load_text(text)
    equations = lagcli.derive(model)
    t_start = resolve(SettingsOverrides(**settings), model.settings).t_start
    return find_start(equations, lower(equations), t_start)


def free(**guesses: float) -> str:
    """Return initial entries that are all free; velocities are guessed as zero."""
    return ", ".join(f"{n}: {{guess: {x}}}, {n}': {{guess: 0}}" for n, x in guesses.items())


def test_fixed_values_stay_and_guesses_move() -> None:
    found = start(ROD, "x: 0.6, y: {guess: 0.7}, x': 4, y': {guess: 1}")
    assert found.state.q[0] == 0.6
    assert found.state.v[0] == 4
    np.testing.assert_allclose([found.state.q[1], found.state.v[1]], [0.8, -3], rtol=CLOSE)
    assert found.moved == {
        "y": (0.7, pytest.approx(0.8)),
        "y'": (1.0, pytest.approx(-3)),
    }
    assert found.rank == 1


def test_consistent_guesses_do_not_move() -> None:
    found = start(ROD, "x: {guess: 0.6}, y: {guess: 0.8}, x': {guess: 4}, y': {guess: -3}")
    assert found.moved == {}


@pytest.mark.parametrize(("guess", "root"), [(0.1, 0.8), (-0.1, -0.8), (3, 0.8), (-40, -0.8)])
def test_branch_is_the_one_nearest_the_guess(guess: float, root: float) -> None:
    found = start(ROD, f"x: 0.6, y: {{guess: {guess}}}, x': 0, y': {{guess: 0}}")
    assert found.state.q[1] == pytest.approx(root, rel=CLOSE)


def test_change_is_least_in_the_metric_of_the_mass() -> None:
    found = start("sum: x + y = 4", free(x=0, y=0), T="3*x'^2/2 + y'^2/2")
    np.testing.assert_allclose(found.state.q, [1, 3], rtol=CLOSE)  # the light one moves more
    found = start(
        "sum: x + y = 4",
        "x: {guess: 1}, y: {guess: 3}, x': {guess: 4}, y': {guess: 0}",
        T="3*x'^2/2 + y'^2/2",
    )
    np.testing.assert_allclose(found.state.v, [3, -3], rtol=CLOSE)


@pytest.mark.parametrize("guess", [1e3, 1e6, -1e4])
def test_guess_far_away_is_damped(guess: float) -> None:
    found = start(ROD, free(x=guess, y=1))
    np.testing.assert_allclose(found.state.q @ found.state.q, 1, rtol=CLOSE)


def test_newton_would_diverge_without_damping() -> None:
    # full Newton steps on atan run away from guesses beyond 1.39
    found = start("c: atan(x) = 0", free(x=3, y=0))
    assert found.state.q[0] == pytest.approx(0, abs=1e-12)


def test_singular_guess_is_left() -> None:
    # at the origin the rod's gradient vanishes and no direction is better than another
    found = start(ROD, free(x=0, y=0))
    np.testing.assert_allclose(found.state.q @ found.state.q, 1, rtol=CLOSE)
    found = start(ROD, "x: 0, y: {guess: 0}, x': 0, y': {guess: 0}")
    assert abs(found.state.q[1]) == pytest.approx(1, rel=CLOSE)


def test_rheonomic_start_is_that_of_its_time() -> None:
    found = start("drive: x = sin(2*t)", free(x=0, y=0), t_start=0.7)
    np.testing.assert_allclose(found.state.q[0], math.sin(1.4), rtol=CLOSE)
    np.testing.assert_allclose(found.state.v[0], 2 * math.cos(1.4), rtol=CLOSE)


def test_nonholonomic_start_moves_velocities_alone() -> None:
    initial = "x: 1, y: 2, x': 1, y': {guess: 0}"
    found = start("blade: y' = x*x' + 3", initial)
    np.testing.assert_allclose(found.state.v, [1, 4], rtol=CLOSE)
    assert list(found.moved) == ["y'"]


def test_redundant_constraints_are_met_and_counted() -> None:
    found = start(f"{ROD}; again: 3*x^2 = 3 - 3*y^2", free(x=1, y=1))
    np.testing.assert_allclose(found.state.q, [0.5**0.5] * 2, rtol=CLOSE)
    assert found.rank == 1


def test_values_written_with_ten_digits_are_accepted() -> None:
    found = start(ROD, "x: 0.7071067812, y: 0.7071067812, x': 0, y': 0")
    assert list(found.state.q) == [0.7071067812] * 2
    with pytest.raises(ModelError):
        start(ROD, "x: 0.70710678, y: 0.70710678, x': 0, y': 0")


# no start


def refused(kind: type[LagcliError], *arguments: Any, **options: Any) -> str:
    with pytest.raises(kind) as caught:
        start(*arguments, **options)
    return str(caught.value)


def test_fixed_values_that_violate_name_what_to_free() -> None:
    text = refused(ModelError, ROD, "x: 0.6, y: 0.7, x': 0, y': 0")
    assert "error[inconsistent-start]" in text
    assert "`rod`" in text
    assert "residual -0.15" in text  # 0.36 + 0.49 − 1
    assert "free one of x, y, for instance `x: {guess: 0.6}`" in text
    with pytest.raises(ModelError) as caught:
        start(ROD, "x: 0.6, y: 0.7, x': 0, y': 0")
    assert caught.value.exit_status == 2


def test_fixed_value_out_of_reach_of_the_free_ones() -> None:
    # no y reaches the rod from x = 2; the search ends at its nearest point
    text = refused(ModelError, ROD, "x: 2, y: {guess: 0.5}, x': 0, y': {guess: 0}")
    assert "free x, for instance `x: {guess: 2}`" in text


def test_fixed_values_beside_guesses_that_find_nothing_name_what_to_free() -> None:
    # two circles of radius 1 meet at y = 0.866: the search ends between two errors
    text = refused(
        NumericalError,
        "left: sqrt(x^2 + y^2) = 1; right: 5*((x - 1)^2 + y^2) = 5",
        "x: {guess: 0.4}, y: 0.7, x': {guess: 0}, y': {guess: 0}",
    )
    assert "give guesses nearer to a solution, or free y; check" in text


def test_values_that_other_constraints_hold_are_not_to_be_freed() -> None:
    text = refused(ModelError, f"{ROD}; slot: x = 2", "x: 2, y: {guess: 1}, x': 0, y': {guess: 0}")
    assert "error[contradicting-constraints]" in text
    text = refused(ModelError, f"{ROD}; slot: x' = 3", "x: 1, y: 0, x': 3, y': {guess: 0}")
    assert "free" not in text


def test_fixed_velocities_that_violate_name_what_to_free() -> None:
    text = refused(ModelError, ROD, "x: 0.6, y: {guess: 0.7}, x': 1, y': 1")
    assert "differentiated in time" in text
    assert "free one of x', y'" in text
    assert "residual 2.8" in text  # 2 (0.6 + 0.8)


def test_members_of_families_are_named_together() -> None:
    text = """
    coordinates: [x[1..30], y[1..30]]
    T: sum(x[i]'^2 + y[i]'^2, i = 1..30)
    constraints: {rod[i = 1..30]: x[i]^2 + y[i]^2 = 1}
    initial: {x[i = 1..30]: 0.6, y[i = 1..30]: 0.8 + 0.01*i, x[1..30]': 0, y[1..30]': 0}
    """
    model = lagcli.load_text(text)
    with pytest.raises(ModelError) as caught:
        lagcli.simulate(model)
    message = str(caught.value)
    assert "violate the constraints `rod[1..30]`" in message
    assert "free one of x[1..30], y[1..30], for instance" in message
    assert "rod[30]: residual" in message
    assert "rod[20]:" not in message
    assert "and 20 with less" in message
    velocities = text.replace(" + 0.01*i", "").replace("x[1..30]': 0", "x[1..30]': 1")
    with pytest.raises(ModelError, match=r"free one of x\[1..30\]', y\[1..30\]'"):
        lagcli.simulate(lagcli.load_text(velocities))


def test_light_end_of_a_rope_does_not_close_a_wide_gap_alone() -> None:
    # the lightest links would move far, by steps of least M-weighted length
    n = 36
    equations = lagcli.derive(lagcli.load_text(ROPE, set={"N": n, "r": 0.6}))
    q = find_start(equations, lower(equations), 0.0).state.q
    assert np.cos(q).sum() / n == pytest.approx(0.6, abs=1e-14)
    assert np.sin(q).sum() / n == pytest.approx(0.0, abs=1e-14)


def test_constraints_that_contradict_each_other() -> None:
    text = refused(ModelError, "one: x = 1; two: x = 2", free(x=0, y=0))
    assert "error[contradicting-constraints]" in text
    assert "`one`" in text
    assert "`two`" in text


def test_constraints_that_contradict_each_other_in_velocities() -> None:
    # both positions hold at t = 0
    text = refused(ModelError, "one: x = t; two: x = 2*t", free(x=0, y=0))
    assert "differentiated in time" in text
    assert "contradict" in text
    text = refused(ModelError, "one: x' = 1; two: x' = y' + 2; three: y' = 0", free(x=0, y=0))
    assert "contradict" in text


def test_no_finite_value_at_the_start_names_the_expression() -> None:
    text = refused(NumericalError, "c: sqrt(x) = y", free(x=-1, y=0))
    assert "`sqrt(x)` in constraint `c` has no finite value at x = -1" in text


@pytest.mark.parametrize(
    ("T", "constraint", "names"),
    [
        ("x'^2/2", "", "`T` gives `y` no inertia"),
        ("x'^2/2", "c: x = 1", "`T` gives `y` no inertia"),
        ("(x' + y')^2/2", "", "`T` gives a motion of `x`, `y` no inertia"),
    ],
)
def test_coordinate_without_inertia_is_named(T: str, constraint: str, names: str) -> None:
    assert names in refused(NumericalError, constraint, free(x=1, y=0), T=T)


def test_coordinate_without_inertia_may_be_held_by_a_constraint() -> None:
    found = start("c: y = x^2", free(x=2, y=3), T="x'^2/2")
    assert found.state.q[1] == pytest.approx(found.state.q[0] ** 2, rel=CLOSE)


def product(a: Array, b: Array) -> Array:
    """Return the product of two quaternions, by scalar and vector parts."""
    vector = a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    return np.concatenate([[a[0] * b[0] - a[1:] @ b[1:]], vector])


def test_rates_of_spin_are_quaternion_products() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        (e, de, drates), omega = rng.normal(size=(3, 4)), rng.normal(size=3)
        rates = product(e, np.concatenate([[0], omega])) / 2
        assert rates_of_spin(e) @ omega == pytest.approx(rates, abs=1e-14)
        assert spin_of(e, rates) == pytest.approx(omega, abs=1e-13)
        drates, h = rng.normal(size=4), 1e-5
        difference = spin_of(e + h * de, rates + h * drates) - spin_of(
            e - h * de, rates - h * drates
        )
        assert spin_derivative(e, rates, de, drates) == pytest.approx(
            difference / (2 * h), abs=1e-7 * (1 + np.abs(difference).max() / h)
        )


def test_free_directions_and_given_spins() -> None:
    one = Spin("e", (1, 2, 3, 4), (False, True, False))
    q = np.array([5.0, 1, 0, 0, 0])
    free = free_directions([one], np.array([False] + 4 * [True]), q)
    expected = np.zeros((5, 3))
    expected[[0, 2, 4], [0, 1, 2]] = 1, 0.5, 0.5
    np.testing.assert_array_equal(free, expected)
    turned = np.array([5.0, 0, 1, 0, 0])
    v = with_given_spins([one], q, np.array([7.0, 0, 1, 2, 3]), turned)
    assert v == pytest.approx([7, *(rates_of_spin(turned[1:]) @ np.array([2.0, 4, 6]))])
    assert one.labels() == ("omega(e).x", "omega(e).y", "omega(e).z")


def test_rounding_errors_along_directions_are_zero() -> None:
    """The row of |e| = 1 would otherwise be one more row of full length."""
    e = np.array([0.1, 0.2, 0.3, 0.4]) / np.sqrt(0.3)
    assert not along(2 * e[None], rates_of_spin(e)).any()
    assert along(np.array([[1.0, 0, 0, 0]]), rates_of_spin(e)) == pytest.approx(-e[None, 1:] / 2)


def sets(constraints: str, rank: int) -> list[tuple[list[int], int]]:
    """Return the sets of linear constraints on four coordinates."""
    names = "wxyz"
    initial = ", ".join(f"{n}: {{guess: 1}}, {n}': {{guess: 0}}" for n in names)
    system, p = lowered(
        lagcli.load_text(f"""
coordinates: [w, x, y, z]
T: (w'^2 + 100*x'^2 + y'^2 + z'^2)/2
constraints: {constraints}
initial: {{{initial}}}
""")
    )
    state = State(0.0, np.array([0.5, 1.0, 2.0, 3.0]), np.zeros(4), p)
    return dependent_sets(system, state, rank, range(len(system.constraints)))


def test_constraints_are_grouped_by_what_they_depend_on() -> None:
    found = sets(
        "{a: x = 1, b: y = 2, c: 1000*x = 1000, d: w = 0.5, e: y + z = 5, f: z = 3}", rank=4
    )
    assert found == [([0, 2], 1), ([1, 4, 5], 1)]  # d stands alone


def test_a_set_may_have_more_than_one_too_many() -> None:
    assert sets("{a: x + y = 3, b: 2*x + 2*y = 6, c: x = 1, d: y = 2}", rank=2) == [
        ([0, 1, 2, 3], 2)
    ]


def test_independent_constraints_have_none() -> None:
    assert sets("{a: x = 1, b: x + y = 3}", rank=2) == []


#: Constraints that touch at x = 0, where both have the gradient of y.
TOUCHING = """
coordinates: [q0, q1, q2]
parameters: {l: 0.728, reach: 0.9}
definitions:
  x: l*(sin(q0) + sin(q1) + sin(q2))
  y: -l*(cos(q0) + cos(q1) + cos(q2))
T: (q0'^2 + q1'^2 + q2'^2)/2
V: 9.81*y
constraints: {low: y + q0^2*0.3 = -3*l*0.9, circle: x^2 + y^2 = (3*reach*l)^2}
initial: {q0: {guess: -0.573}, q1: {guess: 0.123}, q2: {guess: -0.415},
          q0': {guess: -0.559}, q1': {guess: -0.959}, q2': {guess: 0.212}}
simulation: {t_end: 1.0e-4, samples: 3}
"""


def test_a_start_next_to_a_singular_configuration_is_named() -> None:
    """Guesses converge slowly to the point where the constraints touch; λ is −5e13 there."""
    run = lagcli.simulate(lagcli.load_text(TOUCHING), max_steps=5)
    (warning,) = (x for x in run.warnings if "singular" in x)
    assert "next to a singular configuration" in warning
    assert "the constraints `low`, `circle` are dependent" in warning
    assert np.abs(run.multipliers[0]).max() > 1e6


@pytest.mark.parametrize("reach", [0.91, 0.95, 0.99])
def test_other_starts_are_not_named(reach: float) -> None:
    found = simulation.prepare(lagcli.load_text(TOUCHING, set={"reach": reach}))
    assert next_to_singular(found.system, found.start) == []
    assert lagcli.check(found.model).rank.near_singular == ()


def test_the_distance_decides() -> None:
    """Two rods in line, from x = −1 by y = 0 to x = 1: B falls with the height h of the joint."""
    text = """
coordinates: [x, y, u]
T: (x'^2 + y'^2 + u'^2)/2
V: 9.81*y
constraints: {left: (x + 1)^2 + y^2 = 1 + h^2, right: (u - x)^2 + y^2 = 1 + h^2, end: u = 1}
parameters: {h: 0.1}
initial: {x: {guess: 0}, y: {guess: h}, u: {guess: 1}, x': {guess: 0}, y': {guess: 0}, u': 0}
"""
    for height, names in ((1e-1, ()), (1e-2, ()), (1e-7, ("left", "right", "end"))):
        found = simulation.prepare(lagcli.load_text(text, set={"h": height}))
        start = found.start
        assert almost_dependent(found.system, start.state, start.rank) == names
    assert almost_dependent(found.system, start.state, 0) == ()


def test_the_reach_of_coordinates_is_theirs_or_that_of_the_largest() -> None:
    text = "coordinates: [x, y]\nT: x'^2/2 + 50*y'^2\nV: 0\ninitial: {x: 4, y: 0, x': 0, y': 0}\n"
    found = simulation.prepare(lagcli.load_text(text))
    reach = coordinate_reach(Evaluator(found.system, ()), found.start.state)
    assert reach == pytest.approx([4, 0.4])


def test_rounding_errors_are_no_adjustments() -> None:
    model = lagcli.load_text(
        "coordinates: [x, y, s, f]\nT: (x'^2 + y'^2 + s'^2 + f'^2)/2\nconstraints:\n"
        "  left: y - 0.2*sin(s) = 0\n  right: y + 0.2*sin(s) = 0\n"
        "  rod: (x - 0.3*cos(f))^2 + (y - 0.3*sin(f))^2 = 1\n"
        "initial: {f: 0.5, f': 3, x: {guess: 1.2}, x': {guess: 0}, y: {guess: 0}, y': {guess: 0},"
        " s: {guess: 0}, s': {guess: 0}}\n"
    )
    found = lagcli.check(model).start
    assert set(found.moved) == {"x", "x'"}  # not s, from 0 to some 1e-44
    tiny = lagcli.load_text(
        "coordinates: [x]\nT: x'^2/2\nconstraints: {at: x = 1e-12}\n"
        "initial: {x: {guess: 0}, x': {guess: 0}}\n"
    )
    assert set(lagcli.check(tiny).start.moved) == {"x"}


@pytest.mark.parametrize("speed", [5e-324, -3e-320, 1e-310, 1e-300])
@pytest.mark.parametrize("factor", [1.0, 2.0, -0.25])
def test_the_smallest_guesses_of_velocities(speed: float, factor: float) -> None:
    """Their products have rounding errors as large as they are."""
    model = lagcli.load_text(f"""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 9.81*y
constraints: {{rod: {factor}*(x^2 + y^2) = {factor}}}
initial:
  x: 0.5403023058681398
  y: {{guess: -0.8414709848078965}}
  x': {{guess: {speed}}}
  y': {{guess: 0}}
""")
    start = simulation.prepare(model).start.state
    assert abs(start.v).max() <= abs(speed)
    assert start.q @ start.v == pytest.approx(0, abs=1e-10 * abs(speed) + 1e-307)
