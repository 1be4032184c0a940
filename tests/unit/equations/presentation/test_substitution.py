"""Substitution in formulas that keeps their structure."""

from __future__ import annotations

from fractions import Fraction

import pytest

from lagcli.equations.presentation.substitution import substituted
from lagcli.equations.presentation.typeset import (
    ONE,
    Call,
    Node,
    Number,
    Power,
    Product,
    Quotient,
    Root,
    Sum,
    Symbol,
)

X, Y, Z = map(Symbol, "xyz")
TWO, THREE = Number(Fraction(2)), Number(Fraction(3))


def number(value: int) -> Number:
    return Number(Fraction(value))


@pytest.mark.parametrize(
    ("formula", "value", "expected"),
    [
        (Sum(((1, X), (-1, Y))), Z, Sum(((1, Z), (-1, Y)))),
        (Sum(((1, X), (-1, Y))), Sum(((1, Y), (1, Z))), Sum(((1, Y), (1, Z), (-1, Y)))),
        (Product((X, Y)), TWO, Product((TWO, Y))),
        (Quotient(ONE, X), Y, Quotient(ONE, Y)),
        (Power(X, TWO), THREE, number(9)),
        (Power(X, TWO), Sum(((-1, Y),)), Power(Y, TWO)),  # (−y)² is y²
        (Power(X, THREE), Sum(((-1, Y),)), Power(Sum(((-1, Y),)), THREE)),
        (Power(X, number(-1)), number(0), Power(number(0), number(-1))),  # no division by zero
        (Root(X, 3), Y, Root(Y, 3)),
        (Call("sin", (X,)), Y, Call("sin", (Y,))),
        (Y, Z, Y),
    ],
)
def test_a_symbol_gives_way_to_a_formula(formula: Node, value: Node, expected: Node) -> None:
    assert substituted(formula, {X: value}) == expected


def test_products_whose_factors_become_quotients_are_arranged_again() -> None:
    quotient = Quotient(Y, Z)
    assert substituted(Product((TWO, X)), {X: quotient}) is None
    assert substituted(Sum(((1, Y), (1, Product((TWO, Power(X, TWO)))))), {X: quotient}) is None
    # by itself it may become one
    assert substituted(Sum(((1, X), (1, Y))), {X: quotient}) == Sum(((1, quotient), (1, Y)))
