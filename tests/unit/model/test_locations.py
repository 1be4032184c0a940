"""Where the expressions of a loaded model stand in its text."""

from __future__ import annotations

import pytest

from lagcli.model.expression.grammar import parse
from lagcli.model.loader import load_text
from lagcli.model.locations import ExpressionLocations, declarations_in, lines_of

TEXT = """\
coordinates: [x, y, "p[1..2]"]
definitions:
  r: [x, y]
  "b[i = 1..2]": p[i]^2
  "b[0]": 0
T: x'^2 + y'^2 + sum(p[i]'^2, i = 1..2)
Q: {x: -x}
constraints:
  floor: {expr: y >= 0, friction: {static: 0.4, kinetic: 0.2}, slip: x'}
initial: {x: 0, y: 1, "p[i = 1..2]": 0, x': 0, y': 0, "p[i = 1..2]'": 0}
"""
PLACES = ExpressionLocations(load_text(TEXT, "m.yaml"))


@pytest.mark.parametrize(
    ("block", "name", "line", "marked"),
    [
        ("T", None, 6, "x'^2 + y'^2 + sum(p[i]'^2, i = 1..2)"),
        ("Q", "x", 7, "-x"),
        ("definitions", "r", 3, "[x, y]"),
        ("definitions", "r.x", 3, "[x, y]"),
        ("definitions", "b[0]", 5, "0"),
        ("definitions", "b[2]", 4, "p[i]^2"),
        ("constraints", "floor", 9, "y >= 0"),
        ("constraints", "floor.slip", 9, "x'"),
        ("constraints", "floor.friction.kinetic", 9, "0.2"),
    ],
)
def test_entries(block: str, name: str | None, line: int, marked: str) -> None:
    found = PLACES.location(PLACES.entry(block, name))
    assert found is not None
    assert found.line == line
    start = found.column - 1
    assert found.text[start : start + found.length] == marked


def test_what_is_not_in_the_text_has_no_place() -> None:
    assert PLACES.entry("D") is None
    assert PLACES.location(PLACES.entry("definitions", "none")) is None


def test_parts_of_an_expression() -> None:
    node = PLACES.entry("constraints", "floor")
    part = parse("y >= 0").operands[0]  # type: ignore[attr-defined]
    found = PLACES.location(node, part)
    assert found is not None
    assert found.text[found.column - 1] == "y"
    assert PLACES.text(node, part) == "y"
    assert PLACES.at("constraints", PLACES.entry("constraints", "floor").location) is not None  # type: ignore[union-attr]


NAMES = """
coordinates: [x, "y[1..2]"]
parameters: {m: 1}
T: m/2*(x'^2 + y[1]'^2 + y[2]'^2)
constraints:
  rod[i = 1..2]: x + y[i] = 1
events:
  end: {when: x >= 2, stop: true}
initial: {x: 1, "y[1..2]": 0, x': 0, "y[1..2]'": 0}
"""


def test_names_of_a_message_are_found_in_the_file() -> None:
    model = load_text(NAMES, "a.yaml")
    assert declarations_in(model, "`rod[2]` and `end`, but not `m`, rod[1] or `--set`") == [
        "`rod[2]` is declared in a.yaml:6",
        "`end` is declared in a.yaml:8",
    ]
    assert declarations_in(model, "`end` fails; `end` is on line 7 of the model") == []
    assert declarations_in(model, "`x`, `x`: `y[1]`") == [
        "`x` is declared in a.yaml:2",
        "`y[1]` is declared in a.yaml:2",
    ]


def test_members_of_a_family_have_one_line() -> None:
    model = load_text(NAMES, "a.yaml")
    assert lines_of(model, ["rod[1]", "rod[2]"]) == [6]
    assert lines_of(model, ["rod[1]", "x"]) == [2, 6]
    assert lines_of(model, ["other"]) == []
