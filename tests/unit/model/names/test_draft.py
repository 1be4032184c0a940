"""Reading of entries, fields and expressions of a model file, and their errors."""

from __future__ import annotations

import math

import pytest
import symengine as se

from lagcli.errors import ModelError
from lagcli.model.diagnostics import Diagnostics
from lagcli.model.expression.constants import constant
from lagcli.model.loader import load_text
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


def test_a_colon_without_a_space_is_named() -> None:
    made = draft("outputs:\n  height:y\n")
    assert made.entries("outputs") is None
    (found,) = made.report.sorted()
    assert (found.help or "").startswith("write a space after `height:`, as in\noutputs:\n")


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


def parameter(text: str) -> float:
    given = f"coordinates: [x]\nparameters: {{n: 2, n2: 2, p: {text}}}"
    model = f"{given}\nT: p*x'^2\ninitial: {{x: 0, x': 0}}"
    return load_text(model).parameter_values["p"]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("7 mm", 0.007),  # 7 · 0.001 is 0.007 in doubles by luck only
        ("3.3 cm", 0.033),
        ("1.1e3 mm", 1.1),
        ("{value: 3*n, unit: mm}", 0.006),
        ("-0.3 km", -300.0),
        ("−0.3 km", -300.0),
        ("180 deg", math.pi),
        ("72 km/h", 20.0),
        (".5e-3 kg", 0.0005),
    ],
)
def test_quantities_are_the_nearest_doubles(text: str, value: float) -> None:
    assert parameter(text) == value


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0x1F", "is not a number"),
        ("2 n", "write a product as `2*n`"),
        ("2 smoot", "smoot"),
        ("2 n2", "write a product as `2*n2`"),  # a parameter, not a power of a unit
        ("2 N-m", "write a product of units as `N*m`"),
        ("20 °C", "293.15 K"),
        ("{value: 2 m, unit: m}", "two units"),
        ("1e308 km", "not a real, finite number"),
        ("{value: sqrt(-n), unit: m}", "not a real number"),
    ],
)
def test_what_is_no_quantity_is_rejected(text: str, message: str) -> None:
    with pytest.raises(ModelError) as caught:
        parameter(text)
    assert message in str(caught.value.diagnostics[0].render())


def test_whole_numbers_stay_whole() -> None:
    assert constant(3.0) == se.Integer(3)
    assert constant(0.5) == se.RealDouble(0.5)
    assert isinstance(constant(1e300), se.RealDouble)
