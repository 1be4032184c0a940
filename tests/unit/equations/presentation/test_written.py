"""Formulas as the author wrote them."""

from __future__ import annotations

from fractions import Fraction

import pytest

import lagcli
from lagcli.equations.presentation.written import (
    differentiated_in,
    named_in,
    scope_of,
    sides_built,
    written,
)
from lagcli.equations.typesetting import nodes as t
from lagcli.model.expression.grammar import parse
from lagcli.model.names.expansion import expand

MODEL = lagcli.load_text("""
coordinates: [x, y, "p[1..2]"]
parameters: {m: 2, l: 3}
definitions: {a: x^2, b: a' + y, r: "[x, y]", "c[i = 1..2]": i*p[i]}
T: x'^2 + y'^2 + sum(p[i]'^2, i = 1..2)
constraints: {rod: x^2 = b - y}
initial: {x: 0, y: 0, "p[i = 1..2]": 0, x': 0, y': {guess: 0}, "p[i = 1..2]'": 0}
""")
X, Y, M, P = map(t.Symbol, ("x", "y", "m", "p[1]"))
TWO = t.Number(Fraction(2))


@pytest.mark.parametrize(
    ("text", "formula"),
    [
        ("x + y - m", t.Sum(((1, X), (1, Y), (-1, M)))),  # the order stays
        ("y*x/m", t.Quotient(t.Product((Y, X)), M)),
        ("x/4", t.Product((t.Number(Fraction(1, 4)), X))),
        ("sqrt(x)", t.Root(X)),
        ("x^(1/2)", t.Root(X)),
        ("cbrt(x)", t.Root(X, 3)),
        ("x_dot", t.Symbol("x", 1)),
        ("fabs(x)", t.Call("abs", (X,))),
        ("2^3*x", t.Product((t.Number(Fraction(8)), X))),
        ("pi", t.Symbol("pi", kind="constant")),
        ("lambda.rod", t.Symbol("rod", kind="multiplier")),
        ("sum(i*p[i], i = 1..2)", t.Sum(((1, P), (1, t.Product((TWO, t.Symbol("p[2]"))))))),
        ("if(x > 0, x, y)", t.Cases(t.Relation(X, ">", t.ZERO), X, Y)),
        ("r.x", t.Component(t.Symbol("r"), "x")),
    ],
)
def test_trees_become_formulas(text: str, formula: t.Node) -> None:
    tree = expand(parse(text), scope_of(MODEL).names)
    assert written(tree, MODEL) == formula


def test_parameters_may_be_replaced_by_their_values() -> None:
    found = written(parse("m*x + l"), MODEL, {"m": 2})
    assert found == t.Sum(((1, t.Product((TWO, X))), (1, t.Symbol("l"))))


def test_definitions_come_in_the_order_of_use() -> None:
    assert named_in(parse("b + sum(c[i], i = 1..2)"), MODEL) == ("a", "b", "c[1]", "c[2]")
    assert named_in(parse("x*m"), MODEL) == ()
    assert differentiated_in(parse("b"), MODEL) == {"a"}
    assert differentiated_in(parse("a"), MODEL) == set()


def test_sides_have_definitions_expanded() -> None:
    (rod,) = MODEL.constraints
    left, right = sides_built(rod, MODEL)
    assert str(left) == "x**2"
    assert "2*x" in str(right)


def test_what_vanishes_for_the_indices_of_a_member_is_left_out() -> None:
    texts = ("x + (i - 1)*m", "(i - 1)*l + p[i]", "i - 1", "(i - 1)*x")
    first = [written(parse(text), MODEL, indices={"i": 1}) for text in texts]
    assert first == [X, P, t.ZERO, t.ZERO]
