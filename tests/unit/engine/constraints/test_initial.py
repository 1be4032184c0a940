"""The consistent initial state: what moves, what stays, and what is said when there is none."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import lagcli
from lagcli.engine.constraints.initial import ConsistentState
from lagcli.engine.lowering import lower
from lagcli.errors import LagcliError, ModelError, NumericalError
from lagcli.settings.settings import SettingsOverrides, resolve
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


def test_fixed_velocities_that_violate_name_what_to_free() -> None:
    text = refused(ModelError, ROD, "x: 0.6, y: {guess: 0.7}, x': 1, y': 1")
    assert "differentiated in time" in text
    assert "free one of x', y'" in text
    assert "residual 2.8" in text  # 2 (0.6 + 0.8)


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
