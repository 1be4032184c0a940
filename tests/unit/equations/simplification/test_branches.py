"""Cases recognized as the functions that they were written as."""

from __future__ import annotations

import pytest
import symengine as se

from lagcli.equations.presentation.typeset import (
    Call,
    Cases,
    Logical,
    Node,
    Number,
    Relation,
    Symbol,
)
from lagcli.equations.simplification.branches import cases_node, condition_node
from lagcli.model.expression.functions import apply

X, Y, Z = se.symbols("x y z")


def arrange(e: se.Basic) -> Node:
    """Return a number or a name; sums are not of interest here."""
    return Number(int(e)) if isinstance(e, se.Integer) else Symbol(str(e))


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("abs", (X,)),
        ("sign", (X,)),
        ("step", (X,)),
        ("cbrt", (X,)),
        ("min", (X, Y)),
        ("max", (X, Y)),
        ("min", (X, Y, Z)),
        ("max", (X, Y, Z)),
    ],
)
def test_functions_are_called_by_their_names(name: str, arguments: tuple[se.Basic, ...]) -> None:
    found = cases_node(apply(name, *arguments), arrange)
    assert isinstance(found, Call)
    assert found.function == name
    assert sorted(map(str, found.arguments)) == sorted(str(arrange(a)) for a in arguments)


def test_other_cases_stay_cases() -> None:
    condition = se.And(se.Lt(X, 2), se.Ne(Y, 1))
    found = cases_node(se.Piecewise((X, condition), (Z, se.true)), arrange)
    assert isinstance(found, Cases)
    almost = se.Piecewise((X, se.Le(0, X)), (-2 * X, se.true))  # |x|, but for the slope
    assert isinstance(cases_node(almost, arrange), Cases)


@pytest.mark.parametrize(
    ("condition", "expected"),
    [
        (se.Lt(X, Y), Relation(arrange(X), "<", arrange(Y))),
        (se.Le(X, 2), Relation(arrange(X), "<=", Number(2))),
        (se.Ge(X, 2), Relation(arrange(X), ">=", Number(2))),  # SymEngine has 2 <= x
        (se.Eq(X, 2), Relation(arrange(X), "==", Number(2))),
    ],
)
def test_conditions_have_their_variable_on_the_left(condition: se.Basic, expected: Node) -> None:
    assert condition_node(condition, arrange) == expected


def test_joined_conditions_come_in_one_order() -> None:
    one, other = se.Lt(X, 0), se.Lt(Y, 0)
    found = condition_node(se.Or(other, one), arrange)
    assert found == Logical("or", tuple(Relation(arrange(s), "<", Number(0)) for s in (X, Y)))
