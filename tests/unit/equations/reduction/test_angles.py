"""Equations in the sine and cosine of one angle."""

from __future__ import annotations

import pytest
import symengine as se

from lagcli.equations.reduction.angles import Angle, angle_of

U, A, B = map(se.Symbol, "uab")
SINE, COSINE = se.Symbol("s"), se.Symbol("c")


def test_the_angle_is_the_only_argument_or_the_unknown() -> None:
    both = angle_of([se.sin(U + A), B * se.cos(U + A)], U)
    assert both is not None
    assert both.expression == U + A
    assert se.expand(both.solved(B) - (B - A)) == 0
    several = angle_of([se.sin(U + A) + se.cos(2 * U)], U)
    assert several is not None
    assert several.expression == U
    assert angle_of([se.sin(3 * U)], U) is None
    assert angle_of([se.sin(A) + U], U) is None


def test_an_angle_that_falls_with_the_unknown_is_solved() -> None:
    falling = Angle(U, A - U)
    assert se.expand(falling.solved(B) - (A - B)) == 0


@pytest.mark.parametrize(
    "expression",
    [se.sin(U + A), se.cos(A - U), se.sin(2 * U + B), se.cos(-2 * U), se.sin(U) * se.cos(U + A)],
)
def test_addition_theorems_keep_the_value(expression: se.Basic) -> None:
    angle = Angle(U, U)
    opened = angle.replaced(expression, SINE, COSINE)
    assert U not in opened.free_symbols
    values = {U: 0.7, A: 0.3, B: -1.1}
    there = {**values, SINE: se.sin(se.RealDouble(0.7)), COSINE: se.cos(se.RealDouble(0.7))}
    # a few roundings
    assert float(opened.subs(there)) == pytest.approx(float(expression.subs(values)), abs=1e-14)


def test_linear_parts_are_found_where_there_are_some() -> None:
    angle = Angle(U, U)
    found = angle.linear_parts(3 * se.cos(U) - A * se.sin(U) + B)
    assert found is not None
    assert [se.expand(x) for x in found] == [3, -A, B]
    # sin² + cos² is one
    squares = angle.linear_parts((se.cos(U) + A) ** 2 + se.sin(U) ** 2)
    assert squares is not None
    assert [se.expand(x) for x in squares] == [2 * A, 0, 1 + A**2]
    assert angle.linear_parts(se.sin(U) * se.cos(U)) is None
