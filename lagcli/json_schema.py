"""Checks of JSON values against the schemas in ``docs/schemas``.

The schemas say what commands print and what files contain. They are JSON Schemas (draft 7), of
which this module knows the keywords that they use, and two of its own for objects and arrays:

``sameLength``
    Lists of paths. The arrays and objects at the paths of one list have equal lengths.
``sameKeys``
    Lists of paths. The objects at the paths of one list have equal keys, in any order.

A path is a sequence of keys and indices, separated by dots, where ``*`` is each of them.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

_PACKAGE = Path(__file__).parent
#: Folders in an installed package, and in a checkout.
_FOLDERS = (_PACKAGE / "schemas", _PACKAGE.parent / "docs" / "schemas")
_SHOWN = 60  # characters of a value in a message


class SchemaMismatch(ValueError):
    """A value does not have its schema.

    Parameters
    ----------
    place : str
        Where, as in ``content.modes[0].kind``.
    what : str
        What is wrong there.
    depth : int
        Number of steps from the outermost value.
    """

    def __init__(self, place: str, what: str, depth: int):
        super().__init__(f"{place} {what}")
        self.depth = depth


@cache
def published_schema(name: str) -> Mapping[str, Any]:
    """Return the schema of a command's JSON by the command's name.

    Raises
    ------
    KeyError
        There is none.
    """
    for folder in _FOLDERS:
        if (path := folder / f"{name}.json").is_file():
            schema: Mapping[str, Any] = json.loads(path.read_text(encoding="utf-8"))
            return schema
    raise KeyError(f"there is no schema of {name}")


def check_json(value: Any, schema: Mapping[str, Any], name: str) -> None:
    """Raise an error unless a value has a schema.

    Keys that the schema does not have are allowed, because newer versions may write them.

    Parameters
    ----------
    value : JSON value
    schema : mapping
    name : str
        What the value is, for messages.

    Raises
    ------
    SchemaMismatch
        The value does not have the schema.
    """
    _check(value, schema, schema.get("definitions", {}), name, 0)


def _check(
    value: Any, schema: Mapping[str, Any], definitions: Mapping[str, Any], place: str, depth: int
) -> None:
    if "$ref" in schema:
        schema = definitions[schema["$ref"].removeprefix("#/definitions/")]

    def fail(what: str) -> SchemaMismatch:
        return SchemaMismatch(place, what, depth)

    if "type" in schema:
        kinds = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
        if not any(_TYPES[kind](value) for kind in kinds):
            raise fail(f"is {_shown(value)} and not {' or '.join(_NAMES[kind] for kind in kinds)}")
    if "const" in schema and not _equal(value, schema["const"]):
        raise fail(f"is {_shown(value)} and not {_shown(schema['const'])}")
    if "enum" in schema and not any(_equal(value, x) for x in schema["enum"]):
        raise fail(f"is {_shown(value)} and none of {', '.join(map(_shown, schema['enum']))}")
    if _TYPES["number"](value):
        if value < schema.get("minimum", -math.inf):
            raise fail(f"is {_shown(value)} and less than {schema['minimum']}")
        if value <= schema.get("exclusiveMinimum", -math.inf):
            raise fail(f"is {_shown(value)} and not greater than {schema['exclusiveMinimum']}")
    elif isinstance(value, list):
        _check_items(value, schema, definitions, place, depth)
    elif isinstance(value, dict):
        _check_entries(value, schema, definitions, place, depth)
    for options in (schema[x] for x in ("oneOf", "anyOf") if x in schema):
        _check_options(value, options, definitions, place, depth)
    for what, measure in _MEASURES.items():
        for paths in schema.get(what, ()):
            _check_equal(value, paths, what, measure, place, depth)


def _check_items(
    value: list[Any],
    schema: Mapping[str, Any],
    definitions: Mapping[str, Any],
    place: str,
    depth: int,
) -> None:
    least, most = schema.get("minItems", 0), schema.get("maxItems", math.inf)
    if not least <= len(value) <= most:
        bound = f"{least}" if least == most else f"{least} to {most}" if most < math.inf else ""
        wanted = f"{bound or f'at least {least}'}"
        raise SchemaMismatch(place, f"has length {len(value)} and not {wanted}", depth)
    items = schema.get("items", {})
    if items.get("type") == "number" and len(items) == 1 and _all_numbers(value):
        return
    for i, item in enumerate(value):
        _check(item, items, definitions, f"{place}[{i}]", depth + 1)


def _check_entries(
    value: dict[str, Any],
    schema: Mapping[str, Any],
    definitions: Mapping[str, Any],
    place: str,
    depth: int,
) -> None:
    for key in schema.get("required", ()):
        if key not in value:
            raise SchemaMismatch(place, f"has no {key}", depth)
    if len(value) > schema.get("maxProperties", math.inf):
        raise SchemaMismatch(place, f"has {len(value)} keys", depth)
    known, others = schema.get("properties", {}), schema.get("additionalProperties", True)
    for key, item in value.items():
        if key in known:
            _check(item, known[key], definitions, f"{place}.{key}", depth + 1)
        elif isinstance(others, dict):
            _check(item, others, definitions, f"{place}.{key}", depth + 1)


def _check_options(
    value: Any, options: list[Any], definitions: Mapping[str, Any], place: str, depth: int
) -> None:
    """Raise the mismatch with the option that fits best unless one of them fits."""
    failures = []
    for option in options:
        try:
            return _check(value, option, definitions, place, depth)
        except SchemaMismatch as error:
            failures.append(error)
    raise max(reversed(failures), key=lambda error: error.depth)


def _check_equal(
    value: Any, paths: list[str], what: str, measure: Any, place: str, depth: int
) -> None:
    """Raise an error unless the values at some paths have the same length, or the same keys."""
    first: tuple[str, Any] | None = None
    for path in paths:
        for at, part in _at(value, path.split("."), place):
            measured = measure(part)
            if first is None:
                first = at, measured
            elif measured != first[1]:
                there = f"{first[0]} has {_said(what, first[1])}"
                raise SchemaMismatch(at, f"has {_said(what, measured)}, but {there}", depth)


def _at(value: Any, steps: list[str], place: str) -> Iterator[tuple[str, Any]]:
    """Yield places and values at a path; none where an optional key is missing or null."""
    if not steps:
        if isinstance(value, list | dict):
            yield place, value
        return
    step, *rest = steps
    if isinstance(value, list):
        chosen = enumerate(value) if step == "*" else []
        for i, item in chosen:
            yield from _at(item, rest, f"{place}[{i}]")
    elif isinstance(value, dict):
        for key in value if step == "*" else [step] if step in value else []:
            yield from _at(value[key], rest, f"{place}.{key}")


def _said(what: str, measured: Any) -> str:
    if what == "sameLength":
        return f"length {measured}"
    names = ", ".join(sorted(measured))
    return f"keys {_cut(names)}" if names else "no keys"


def _is_number(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer that no float can hold
        return False


def _all_numbers(values: list[Any]) -> bool:
    """Return whether all values are finite numbers; quick, because most values of files are."""
    try:
        return {*map(type, values)} <= {int, float} and all(map(math.isfinite, values))
    except OverflowError:
        return False


def _equal(value: Any, other: Any) -> bool:
    return type(value) is type(other) and bool(value == other)


def _shown(value: Any) -> str:
    """Return a value as JSON, shortened."""
    return _cut(repr(value) if isinstance(value, float) else json.dumps(value, ensure_ascii=False))


def _cut(text: str) -> str:
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}…"


_TYPES: dict[str, Callable[[Any], bool]] = {
    "null": lambda x: x is None,
    "boolean": lambda x: isinstance(x, bool),
    "integer": lambda x: isinstance(x, int) and _is_number(x),
    "number": _is_number,
    "string": lambda x: isinstance(x, str),
    "array": lambda x: isinstance(x, list),
    "object": lambda x: isinstance(x, dict),
}
_NAMES = {
    "null": "null",
    "boolean": "true or false",
    "integer": "an integer",
    "number": "a finite number",
    "string": "a text",
    "array": "an array",
    "object": "an object",
}
_MEASURES = {"sameLength": len, "sameKeys": frozenset}
