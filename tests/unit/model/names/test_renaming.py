"""Expressions for successive indices are those that building each one gives."""

from __future__ import annotations

import pytest

from lagcli.model.expression.grammar import parse
from lagcli.model.loader import load_text
from lagcli.model.names.building import ExpressionTemplate, build
from lagcli.model.names.scope import Scope

MODEL = load_text(
    "coordinates: [x[1..6]]\nparameters: {k: 1}\nT: sum(x[i]'^2, i = 1..6)/2\n"
    "initial: {x[1..6]: 0, x[1..6]': 0}\n"
)


@pytest.mark.parametrize(
    ("text", "built"),
    [
        ("k*(x[i] - x[i + 1])^2", 1),  # all others are renamed
        ("x[i]*x[4]", 3),  # for i = 4 two symbols become one, which no renaming gives or undoes
        ("i*x[i]", 5),  # the index is a number, too
        ("x[i] + x[6 - i]", 3),  # equal members at i = 3
    ],
)
def test_renamed_expressions_are_those_built_again(text: str, built: int) -> None:
    scope = Scope(MODEL.names, "it", indices=("i",))
    count = 0

    def counted(tree):
        nonlocal count
        count += 1
        return build(tree, scope)

    scope.values["i"] = 1
    template = ExpressionTemplate(parse(text), scope, counted)
    for i in range(1, 6):
        scope.values["i"] = i
        assert template.value().value == build(parse(text), scope).value
    assert count == built
