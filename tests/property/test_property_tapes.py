"""Tapes of random expressions against SymEngine's own arithmetic (MPFR, 200 bits)."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Sequence
from typing import Any

import pytest
import symengine as se
from hypothesis import example, given, settings
from hypothesis import strategies as st
from tape_values import VARIABLES, applied, batch, exactly, value

from lagcli.functions import FUNCTIONS
from lagcli.model.expression.constants import cases, relation

X, Y, Z = VARIABLES

#: Two ways to evaluate an expression round differently at every operation; a few dozen operations
#: that do not cancel stay within this.
CLOSE = 1e-11

NUMBERS = st.fractions(-5, 5, max_denominator=12).map(lambda f: se.Rational(*f.as_integer_ratio()))


EXPONENTS = st.sampled_from([2, 3, -1, -2, 7, (1, 2), (-1, 2), (3, 2), (-5, 2), (1, 3), (-7, 5)])


def power(base: se.Basic, exponent: int | tuple[int, int]) -> se.Basic:
    return base ** (se.Integer(exponent) if isinstance(exponent, int) else se.Rational(*exponent))


def either(a: se.Basic, b: se.Basic, c: se.Basic, d: se.Basic) -> se.Basic:
    return cases(se.And(relation("<", a, b), se.Not(relation(">=", c, d))), a * b, c - d)


def any_of(a: se.Basic, b: se.Basic, c: se.Basic, d: se.Basic) -> se.Basic:
    return cases(se.Or(relation("<=", a, b), relation("!=", c, d)), a, d)


def made(function: Callable[..., se.Basic], arguments: Sequence[Any]) -> se.Basic:
    """Return an expression; where numbers folded to none (1/0 < x), a plain one."""
    try:
        return function(*arguments)
    except (RuntimeError, ValueError):  # the loader reports both
        return X + Y


def compound(inner: st.SearchStrategy) -> st.SearchStrategy:
    two = st.lists(inner, min_size=2, max_size=2)
    some = st.lists(inner, min_size=2, max_size=3)
    four = st.lists(inner, min_size=4, max_size=4)
    return st.one_of(
        *(st.builds(made, st.just(f), some) for f in (se.Add, se.Mul)),
        st.builds(made, st.just(operator.sub), two),
        st.builds(made, st.just(power), st.tuples(inner, EXPONENTS)),
        st.builds(
            lambda name, xs: made(applied, [name, *xs]), st.sampled_from(sorted(FUNCTIONS)), some
        ),
        *(st.builds(made, st.just(f), four) for f in (either, any_of)),
    )


EXPRESSIONS = st.recursive(
    st.one_of(st.sampled_from(VARIABLES), NUMBERS, st.just(se.pi)), compound, max_leaves=8
)


POINTS = st.tuples(*[st.integers(-40, 40).map(lambda k: (k + 0.5) / 16)] * 3)


def shaken(expression: se.Basic, part: float) -> se.Basic:
    """Return an expression whose functions give values that are off by a part of them.

    Cases and conditions stay.
    """
    if (
        not expression.args
        or not hasattr(expression, "func")
        or isinstance(expression, se.Piecewise)
    ):
        return expression
    found = expression.func(*[shaken(x, part) for x in expression.args])
    return found * (1 + part) if isinstance(expression, se.Function) else found


@settings(max_examples=70, deadline=None)
@given(EXPRESSIONS, POINTS)
@example(se.acos(se.erf(se.Integer(5))), (1.0, 1.0, 1.0))  # erf(5) is next to 1
def test_random_expressions_against_symengine(
    expression: se.Basic, point: tuple[float, float, float]
) -> None:
    found = value(expression, *point)
    expected = exactly(expression, point)
    if not (math.isfinite(expected) and math.isfinite(found)):
        return  # what is undefined is the subject of its own tests
    # a value at a jump may fall on either side, and differences of large terms lose digits:
    # the reach of rounding is seen by moving the point, and the values of functions, by rounding
    near = [value(expression, *(x * (1 + s * 2e-16) for x in point)) for s in (-1, 1)]
    near += [value(shaken(expression, s * 2.3e-16), *point) for s in (-1, 1)]
    wobble = max(abs(found - x) for x in near)
    if not wobble < 1e-6 * (1 + abs(found)):
        return
    assert found == pytest.approx(expected, rel=CLOSE, abs=CLOSE + 1e5 * wobble)


@settings(max_examples=70, deadline=None)
@given(EXPRESSIONS, st.lists(POINTS, min_size=1, max_size=4))
def test_interpreters_agree(expression: se.Basic, points: list[tuple[float, ...]]) -> None:
    many = batch(expression, *points)
    for found, point in zip(many, points, strict=True):
        one = value(expression, *point)
        near = [value(expression, *(x * (1 + s * 2e-16) for x in point)) for s in (-1, 1)]
        wobble = max(abs(one - x) for x in near)
        if math.isfinite(one) and wobble < 1e-6 * (1 + abs(one)):
            # libm and NumPy differ in the last digit of a function
            assert found == pytest.approx(one, rel=CLOSE, abs=CLOSE + 1e5 * wobble)
        elif not math.isfinite(one) and not any(map(math.isfinite, near)):
            assert not math.isfinite(found)
