"""Substitution in formulas, and the arrangement of differentiated constraints."""

from __future__ import annotations

from fractions import Fraction

import pytest

from lagcli.equations.typesetting.nodes import (
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
    VirtualDisplacement,
)
from lagcli.equations.typesetting.rewriting import differences, displaced, oriented, substituted

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


U, V = Symbol("x", 1), Symbol("y", 1)
DX, DY = VirtualDisplacement(X), VirtualDisplacement(Y)


def minus(a, b) -> Sum:
    return Sum(((1, a), (-1, b)))


def test_displacements_stand_at_the_end_of_their_products() -> None:
    found = displaced(Sum(((1, Product((TWO, U, X))), (-1, V))))
    assert found == Sum(((1, Product((TWO, X, DX))), (-1, DY)))
    whole = displaced(Product((minus(U, V), minus(X, Y))))
    assert whole == Product((minus(X, Y), minus(DX, DY)))


def test_velocities_in_fractions_and_roots_have_no_displacement() -> None:
    assert displaced(Quotient(U, X)) is None
    assert displaced(Sum(((1, X), (1, Root(U))))) is None
    assert displaced(Product((Quotient(X, Y), U))) == Product((Quotient(X, Y), DX))


def test_differences_are_turned_in_pairs() -> None:
    written = differences([Product((TWO, minus(Y, X)))])
    assert written == {minus(Y, X)}
    product = Product((minus(X, Y), minus(U, V)))
    assert oriented(product, written) == Product((minus(Y, X), minus(V, U)))
    # alone it would change the sign
    alone = Product((TWO, minus(X, Y)))
    assert oriented(alone, written) == alone
    assert oriented(product, frozenset()) is product
