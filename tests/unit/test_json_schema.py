"""Checks of JSON values against schemas."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import fastjsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lagcli.json_schema import check_json, published_schema

SCHEMAS = sorted((Path(__file__).parents[2] / "docs" / "schemas").glob("*.json"))
#: What the check knows; the others are for readers.
KNOWN = {
    *("type", "const", "enum", "required", "properties", "additionalProperties", "items"),
    *("minItems", "maxItems", "minimum", "exclusiveMinimum", "maxProperties"),
    *("oneOf", "anyOf", "$ref", "definitions", "sameLength", "sameKeys"),
    *("$schema", "title", "description", "analysisFile"),
}


def keywords(schema: Mapping[str, Any]) -> set[str]:
    """Return the keywords of a schema and of its parts."""
    found = set(schema)
    parts: list[Any] = [*schema.get("oneOf", []), *schema.get("anyOf", [])]
    for name in ("properties", "definitions"):
        parts += schema.get(name, {}).values()
    parts += [schema[x] for x in ("items", "additionalProperties") if x in schema]
    for part in parts:
        if isinstance(part, dict):
            found |= keywords(part)
    return found


@pytest.mark.parametrize("path", SCHEMAS, ids=lambda path: path.stem)
def test_every_keyword_of_the_schemas_is_checked(path: Path) -> None:
    assert keywords(published_schema(path.stem)) <= KNOWN


@pytest.mark.parametrize(
    ("schema", "value", "said"),
    [
        ({"type": "number"}, math.nan, "a: nan is not of type 'number'"),
        ({"type": "number"}, True, "a: True is not of type 'number'"),
        ({"type": "number"}, 10**400, "0 is not of type 'number'"),
        ({"type": ["integer", "null"]}, 1.0, "a: 1.0 is not of type 'integer', 'null'"),
        ({"enum": ["x", None]}, "y", "a: 'y' is not one of ['x', None]"),
        ({"const": 1}, True, "a: 1 was expected"),
        ({"items": {"type": "string"}}, ["x", 1], "a[1]: 1 is not of type 'string'"),
        ({"minItems": 2, "maxItems": 2}, [1], "a: [1] is too short"),
        ({"minItems": 1}, [], "a: [] should be non-empty"),
        ({"minimum": 0}, -1, "a: -1 is less than the minimum of 0"),
        ({"exclusiveMinimum": 0}, 0, "a: 0 is less than or equal to the minimum of 0"),
        ({"maxProperties": 0}, {"x": 1}, "a: {'x': 1} is expected to be empty"),
        ({"required": ["x"]}, {}, "a: 'x' is a required property"),
        ({"properties": {"x": {"type": "null"}}}, {"x": 1}, "a.x: 1 is not of type 'null'"),
        ({"additionalProperties": {"type": "null"}}, {"y": 1}, "a.y: 1 is not of type 'null'"),
        (
            {"oneOf": [{"required": ["x"]}, {"properties": {"y": {"type": "null"}}}]},
            {"y": 1},
            "a.y: 1 is not of type 'null'",
        ),
        (
            {"sameLength": [["x", "y.*", "z.*.u"]]},
            {"x": [1], "y": {"b": [2]}, "z": [{"u": [1, 2]}]},
            "a.z[0].u: has length 2, but x has 1",
        ),
        (
            {"sameKeys": [["x", "y.*"]]},
            {"x": {"b": 1}, "y": [{"b": 1}, {}]},
            "a.y[1]: has keys none, but x has b",
        ),
    ],
)
def test_mismatches_are_named(schema: Any, value: Any, said: str) -> None:
    with pytest.raises(ValueError, match=re.escape(said)):
        check_json(value, schema, "a")


def test_what_fits() -> None:
    schema = {
        "definitions": {"one": {"type": "array", "items": {"type": "number"}}},
        "sameLength": [["x", "y"]],
        "properties": {"x": {"$ref": "#/definitions/one"}, "y": {"anyOf": [{"type": "array"}]}},
        "additionalProperties": False,
    }
    check_json({"x": [1, 2.5], "y": ["a", None], "of a newer version": 1}, schema, "a")
    check_json({}, schema, "a")
    with pytest.raises(KeyError):
        published_schema("absent")


SCALARS = st.none() | st.booleans() | st.integers(-2, 3) | st.sampled_from([0.5, 1.5, "", "a", "b"])
VALUES = st.recursive(
    SCALARS,
    lambda x: st.lists(x, max_size=3) | st.dictionaries(st.sampled_from("ab"), x, max_size=2),
    max_leaves=6,
)
SIMPLE = st.fixed_dictionaries(
    {},
    optional={
        "type": st.sampled_from(["null", "boolean", "number", "string", "array", "object"]),
        "enum": st.lists(st.sampled_from(["a", "b", None]), min_size=1, max_size=2, unique=True),
        "minItems": st.integers(0, 2),
        "maxItems": st.integers(0, 2),
        "minimum": st.integers(-1, 2),
        "required": st.lists(st.sampled_from("ab"), max_size=2, unique=True),
        "maxProperties": st.integers(0, 2),
    },
)
NESTED = st.recursive(
    SIMPLE,
    lambda x: st.fixed_dictionaries(
        {},
        optional={
            "items": x,
            "properties": st.dictionaries(st.sampled_from("ab"), x, max_size=2),
            "additionalProperties": x,
            "anyOf": st.lists(x, min_size=1, max_size=2),
        },
    ),
    max_leaves=4,
)


@given(NESTED, VALUES)
@settings(max_examples=300, deadline=None)
def test_verdicts_are_those_of_another_program(schema: dict[str, Any], value: Any) -> None:
    try:
        fastjsonschema.validate(json.loads(json.dumps(schema)), value)
        expected = True
    except fastjsonschema.JsonSchemaValueException:
        expected = False
    try:
        check_json(value, schema, "a")
        found = True
    except ValueError:
        found = False
    assert found == expected
