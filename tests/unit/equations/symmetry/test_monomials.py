"""Sums of monomials: what vanishes identically has none."""

from __future__ import annotations

from fractions import Fraction

import pytest
import symengine as se

from lagcli.equations.symmetry.monomials import Monomials, rational, symbolic

x, y, a, b, t = se.symbols("x y a b t")


def terms(expression: se.Basic, **values: float) -> list[object]:
    write = Monomials(values)
    return list(write.terms(write.exponential(expression)))


@pytest.mark.parametrize(
    "zero",
    [
        se.sin(x) ** 2 + se.cos(x) ** 2 - 1,
        se.cos(x - y) - se.cos(x) * se.cos(y) - se.sin(x) * se.sin(y),
        se.sin(2 * x) - 2 * se.sin(x) * se.cos(x),
        se.cos(x / 2) ** 2 - (1 + se.cos(x)) / 2,
        se.sin(a * t + x) - se.sin(a * t) * se.cos(x) - se.cos(a * t) * se.sin(x),
        (x + y) ** 3 / se.sqrt(x**2 + y**2) - (x + y) * (x + y) ** 2 / se.sqrt(x**2 + y**2),
        (x**2 + 1) / (x**2 + y**2) - 1 / (x**2 + y**2) - x**2 / (x**2 + y**2),
    ],
)
def test_identities_have_no_terms(zero: se.Basic) -> None:
    assert terms(zero) == []


@pytest.mark.parametrize(
    "other", [se.sin(x) ** 2 - 1, se.cos(x - y) - se.cos(x + y), se.sin(x) - x, a * x - b * x]
)
def test_others_have_some(other: se.Basic) -> None:
    assert terms(other)


def test_values_of_parameters_are_put_in_exactly() -> None:
    assert terms(a * x - 3 * b * x, a=0.3, b=0.1) == []
    assert terms(x * se.Integer(0) + a, a=0.25) == [(se.Integer(1), Fraction(1, 4), 0)]


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (0.1, Fraction(1, 10)),
        (0.4 * 0.0225 / 12, Fraction(3, 4000)),  # rounded on the way
        (1 / 3, Fraction(1, 3)),
        (4.41e-7, Fraction(441, 10**9)),
        (-2.0, Fraction(-2)),
        (0.0, Fraction(0)),
    ],
)
def test_doubles_denote_simple_numbers(value: float, expected: Fraction) -> None:
    assert rational(value) == expected
    assert symbolic(expected) == se.Rational(expected.numerator, expected.denominator)
