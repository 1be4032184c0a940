"""Checks of JSON values against the schemas in ``docs/schemas``.

The schemas say what commands print and what files contain. They are JSON Schemas (draft 7), checked
by the package jsonschema, with two keywords of our own for objects and arrays:

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
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # slow to import; needed only where a file is read
    from jsonschema.protocols import Validator

_PACKAGE = Path(__file__).parent
#: Folders in an installed package, and in a checkout.
_FOLDERS = (_PACKAGE / "schemas", _PACKAGE.parent / "docs" / "schemas")
_LONGEST = 200  # characters of a message


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
    ValueError
        The value does not have the schema.
    """
    from jsonschema.exceptions import best_match

    error = best_match(_validator()(schema).iter_errors(value))
    if error is not None:
        while error.context:  # no option fits: the mismatch in the one that fits best
            error = max(error.context, key=lambda other: len(other.absolute_path))
        message = error.message
        if len(message) > _LONGEST:  # it begins with the value
            message = f"{message[: _LONGEST // 2]} … {message[-_LONGEST // 2 :]}"
        raise ValueError(f"{name}{error.json_path.removeprefix('$')}: {message}")


@cache
def _validator() -> type[Validator]:
    """Return jsonschema's validator of draft 7, extended."""
    from jsonschema import Draft7Validator, ValidationError, validators

    known = Draft7Validator.VALIDATORS

    def items(validator: Validator, schema: Any, value: Any, whole: Any) -> Iterator[Any]:
        # quick, because most values of files are numbers
        if schema != {"type": "number"} or not isinstance(value, list) or not _all_numbers(value):
            yield from known["items"](validator, schema, value, whole) or ()

    def other_keys(validator: Validator, schema: Any, value: Any, whole: Any) -> Iterator[Any]:
        if schema is not False:
            yield from known["additionalProperties"](validator, schema, value, whole) or ()

    def same(measure: Callable[[Any], Any], said: str) -> Any:
        def check(_: Validator, lists: list[list[str]], value: Any, whole: Any) -> Iterator[Any]:
            for paths in lists:
                parts = [part for path in paths for part in _at(value, path.split("."))]
                for at, part in parts[1:]:
                    found, wanted = measure(part), measure(parts[0][1])
                    if found != wanted:
                        first = ".".join(map(str, parts[0][0]))
                        both = f"has {said} {found}, but {first} has {wanted}"
                        yield ValidationError(both, path=at)

        return check

    own = {
        "items": items,
        "additionalProperties": other_keys,
        "oneOf": known["anyOf"],  # with other keys, a value may have several
        "sameLength": same(len, "length"),
        "sameKeys": same(lambda part: ", ".join(sorted(part)) or "none", "keys"),
    }
    types = Draft7Validator.TYPE_CHECKER.redefine_many(
        {
            "number": lambda _, x: _is_number(x),
            "integer": lambda _, x: isinstance(x, int) and _is_number(x),
        }
    )
    extended: type[Validator] = validators.extend(Draft7Validator, own, type_checker=types)
    return extended


def _at(value: Any, steps: list[str]) -> Iterator[tuple[tuple[str | int, ...], Any]]:
    """Yield places and values at a path; none where an optional key is missing or null."""
    if not steps:
        if isinstance(value, list | dict):
            yield (), value
        return
    step, *rest = steps
    parts = dict(enumerate(value)) if isinstance(value, list) else value
    if isinstance(parts, dict):
        for key in parts if step == "*" else [step] if step in parts else []:
            yield from (((key, *at), x) for at, x in _at(parts[key], rest))


def _is_number(value: Any) -> bool:
    """Return whether a value is a finite number; integers that no float can hold are none."""
    return not isinstance(value, bool) and isinstance(value, int | float) and _all_numbers([value])


def _all_numbers(values: list[Any]) -> bool:
    try:
        return {*map(type, values)} <= {int, float} and all(map(math.isfinite, values))
    except OverflowError:
        return False
