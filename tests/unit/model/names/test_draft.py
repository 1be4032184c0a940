"""Reading of entries, fields and expressions of a model file, and their errors."""

from __future__ import annotations

import pytest

from lagcli.model.diagnostics import Diagnostics
from lagcli.model.names.draft import Draft
from lagcli.model.yaml.composing import compose
from lagcli.model.yaml.source import Source


def draft(text: str) -> Draft:
    source = Source(text, "m.yaml")
    root, found = compose(source)
    made = Draft(source, root, Diagnostics(found))
    made.names.coordinates.update(x=None, y=None)
    return made


def messages(made: Draft) -> list[str]:
    return [d.message for d in made.report.sorted()]


def test_entries_of_a_mapping_and_of_nothing() -> None:
    made = draft("Q: {x: 1, y: 2}\nV:\noutputs: 3\n")
    assert [name for name, _, _ in made.entries("Q") or []] == ["x", "y"]
    assert made.entries("V") == made.entries("none") == []
    assert made.entries("outputs") is None
    assert messages(made) == ["`outputs` must be a mapping of names, not `3`"]


def test_fields_are_those_that_are_known() -> None:
    made = draft("q: {unit: m, descriptionn: x, z: 1}\n")
    fields = made.fields(made.get("q"), "`q`", ("unit", "description"))  # type: ignore[arg-type]
    assert list(fields) == ["unit"]
    first, second = made.report.sorted()
    assert (first.message, first.help) == (
        "`q` has no field `descriptionn`",
        "did you mean `description`?",
    )
    assert second.help == "its fields are `unit`, `description`"


def test_an_expression_stands_alone_or_under_expr() -> None:
    made = draft("a: x + 1\nb: {expr: x + 2}\nc: {unit: m}\n")
    found = {}
    for name, key, node in made.root:
        value, _ = made.expression_node(key, node, f"`{name}`", ("expr", "unit"))
        found[name] = None if value is None else made.text(value, name)
    assert found == {"a": "x + 1", "b": "x + 2", "c": None}
    (missing,) = made.report.sorted()
    assert missing.message == "`c` has no `expr`"
    assert missing.help == "write `c: expression`, or `c: {expr: expression}`"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: {b: 1}", "`a` must be an expression, not"),
        ("a: ~", "`a` is empty"),
        ("a: x +", "the expression ends"),
        ("a: q", "`q`"),
        ("a: [x, y]", "must be a scalar, not a vector"),
    ],
)
def test_what_is_no_scalar_expression(text: str, message: str) -> None:
    made = draft(text)
    parsed = made.parse(made.get("a"), "`a`")  # type: ignore[arg-type]
    if parsed is not None:
        assert made.scalar(parsed, "`a`") is None
    assert message in str(messages(made))


def test_an_expression_becomes_a_value() -> None:
    made = draft("a: 2*x*y\n")
    parsed = made.parse(made.get("a"), "`a`")  # type: ignore[arg-type]
    assert parsed is not None
    assert str(made.scalar(parsed, "`a`")) == "2*x*y"
    assert messages(made) == []
