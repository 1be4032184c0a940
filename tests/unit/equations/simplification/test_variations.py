"""Virtual displacements from rates, and differences as they are written."""

from __future__ import annotations

from fractions import Fraction

from lagcli.equations.presentation.typeset import (
    Number,
    Product,
    Quotient,
    Root,
    Sum,
    Symbol,
    VirtualDisplacement,
)
from lagcli.equations.simplification.variations import differences, displaced, oriented

X, Y = Symbol("x"), Symbol("y")
U, V = Symbol("x", 1), Symbol("y", 1)
DX, DY = VirtualDisplacement(X), VirtualDisplacement(Y)
TWO = Number(Fraction(2))


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
