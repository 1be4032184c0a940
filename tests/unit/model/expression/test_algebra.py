"""What expressions are in some of their symbols: affine, kinked, zero, and how long."""

from __future__ import annotations

import math

import pytest
import symengine as se

from lagcli.model.expression.algebra import (
    cancel,
    count_operations,
    count_terms,
    expand_terms,
    is_zero,
    kinked_in,
    nonlinear_in,
)
from lagcli.model.expression.functions import apply, parts_of

X, Y, V, W = se.symbols("x y v w")
CASES = se.Piecewise((V, se.Lt(X, 0)), (2 * V, se.true))


@pytest.mark.parametrize(
    ("expression", "symbol"),
    [
        (3 * V + se.sin(X) * W + X**2, None),
        ((V + 1) ** 2 - V**2, None),  # affine after all
        ((V + W) ** 2 - (V - W) ** 2 - 4 * V * W, None),
        (CASES, None),  # x decides, not v
        (V**2, V),
        (V * W, W),
        (se.sin(V), V),
        (X * Y, None),
        (se.floor(W) * X, W),
        (se.Piecewise((X, se.Lt(V, 0)), (Y, se.true)), V),
    ],
)
def test_affine_or_not(expression: se.Basic, symbol: se.Basic | None) -> None:
    assert nonlinear_in(expression, (V, W)) == symbol


def test_an_expansion_of_too_many_terms_counts_as_not_affine() -> None:
    names = se.symbols("a0:40")
    power = (sum(names) + V) ** 12
    assert nonlinear_in(power - power.subs({V: V + 0}) + V * power, (V,)) == V


def test_kinks_are_where_symbols_decide() -> None:
    assert kinked_in(apply("abs", X) + V, (V, X)) == X
    assert kinked_in(CASES, (V,)) is None
    assert kinked_in(CASES, (V, X)) == X


def test_written_out_reaches_cases_and_denominators() -> None:
    assert expand_terms((X + 1) * (X - 1)) == X**2 - 1
    inside = se.Piecewise(((X + 1) ** 2, se.Lt(X, 0)), (X * (X + 2), se.true))
    found = expand_terms(Y * inside)
    expected = se.Piecewise((1 + 2 * X + X**2, se.Lt(X, 0)), (X**2 + 2 * X, se.true))
    assert found == Y * expected
    # equal denominators stay equal, however they came
    below = (X + Y) ** 2 + 1
    assert expand_terms(X * (Y + 1) / below - X * Y / below - X / below) == 0


@pytest.mark.parametrize(
    "expression",
    [(X + Y) ** 5, (X + Y + V + W) ** 3, (X + Y) * (V + W + 1), X * Y, X + 1, se.sin(X + Y)],
)
def test_terms_are_counted_like_those_of_the_expansion(expression: se.Basic) -> None:
    expanded = se.expand(expression)
    terms = len(expanded.args) if isinstance(expanded, se.Add) else 1
    assert count_terms(expression) == terms
    assert count_terms(((X + Y) ** 2 + V) ** 2) >= 6  # a bound where terms are equal


def test_operations_are_counted_as_often_as_they_are_written() -> None:
    # x + y: three nodes, whatever else has them
    assert count_operations([X + Y]) == 3
    assert count_operations([X + Y, X + Y]) == 6
    deep = X
    for _ in range(100):
        deep = se.sin(deep)
    assert count_operations([deep]) == 101
    # shared parts are written out each time
    assert count_operations([se.sin(X + Y) * se.cos(X + Y)]) == 1 + 2 * 4


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        (se.sin(X) ** 2 + se.cos(X) ** 2 - 1, True),
        ((X + Y) ** 2 - X**2 - 2 * X * Y - Y**2, True),
        (se.sin(X) ** 2 + se.cos(X) ** 2 - 1 + 1e-9 * X, False),
        (apply("abs", X) - X, False),  # zero at the points that are tried, not elsewhere
        (se.floor(X), False),
        (se.log(-X), False),
        (se.Integer(0), True),
        (se.Symbol("z") - math.pi, False),
    ],
)
def test_zero_or_not(expression: se.Basic, expected: bool) -> None:
    assert is_zero(expression) is expected


def test_large_terms_cancel_without_overflow() -> None:
    assert cancel([1.5e308, 1.5e308, -1.5e308, -1.5e308], 1e-12)
    assert not cancel([1.5e308, 1.5e308], 1e-12)
    assert not cancel([math.inf, -math.inf], 1e-12)
    assert cancel([0.0, 0.0], 1e-12)
    assert cancel([], 1e-12)
    assert not is_zero(1e308 * X + 1.1e308 * X**2)


def test_parts_of_expressions() -> None:
    x, y = se.symbols("x y")
    case = se.Piecewise((se.sin(x), x > se.floor(y)), (se.sin(se.cos(x)), True))
    expression = se.exp(case) * se.sin(x) + 2.5 * y**3
    assert parts_of(expression, se.sin) == {se.sin(x), se.sin(se.cos(x))}
    assert parts_of(expression, se.cos, se.floor) == {se.cos(x), se.floor(y)}
    assert parts_of(expression, se.Piecewise) == {case}
    assert parts_of(expression, se.RealDouble) == {se.RealDouble(2.5)}
    assert parts_of(x, se.Symbol) == {x}
    assert parts_of(x, se.sin) == set()


def test_parts_of_an_expression_that_repeats_itself() -> None:
    """2^200 parts, of which 400 are different."""
    x = expression = se.Symbol("x")
    for _ in range(200):
        expression = se.sin(expression) + se.cos(expression)
    assert len(parts_of(expression, se.sin, se.cos)) == 400
    assert parts_of(expression, se.Symbol) == {x}
