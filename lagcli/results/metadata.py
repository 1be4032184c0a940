"""Metadata of a result file, as JSON values."""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from lagcli.arrays import Array
from lagcli.json_schema import check_json, published_schema
from lagcli.trajectory.samples import SCHEMA_VERSION, SIGN_CONVENTION, Record

#: The kind of the file, which distinguishes it from other lagcli files.
KIND = "trajectory"

#: Infinities in JSON.
_INFINITIES = ("inf", "-inf")

#: Fields of `Record` that are texts.
TEXTS = ("lagcli_version", "status", "message", "model_sha256", "model")

#: Fields of `Record` that are mappings; `to_metadata` converts them to JSON values.
MAPPINGS = (
    "units",
    "parameters",
    "options",
    "counts",
    "seconds",
    "initial_correction",
    "tolerances",
    "freedom",
    "conserved_formulas",
    "display",
)

#: The schema of lists of names.
NAMES: dict[str, Any] = {"type": "array", "items": {"type": "string"}}
#: The schema of ``display``, of which only ``given`` is printed; it is empty in older files.
DISPLAY: dict[str, Any] = {
    "type": "object",
    "properties": {
        "latex": {"type": "object", "additionalProperties": {"type": "string"}},
        "definitions": NAMES,
        "jumping": NAMES,
        "given": {"type": "object", "additionalProperties": {"type": "string"}},
        "given_units": {
            "type": "object",
            "additionalProperties": {
                "type": "object",
                "required": ["unit", "factor"],
                "properties": {
                    "unit": {"type": "string"},
                    "factor": {"type": "number", "exclusiveMinimum": 0},
                },
            },
        },
    },
}

#: The field of `Record` that is a list of texts.
WARNINGS = "warnings"


def to_metadata(record: Record) -> dict[str, Any]:
    """Return texts, and mappings of JSON values, in the order of the file.

    Numbers that JSON lacks become null (NaN) and ``"inf"``, ``"-inf"`` in numerical fields;
    `from_metadata` converts them back.

    Parameters
    ----------
    record : Record
        Record of the run.

    Returns
    -------
    dict
        Texts and mappings by name, including ``kind`` and ``schema_version``.
    """
    mappings: dict[str, Any] = {name: dict(getattr(record, name)) for name in MAPPINGS}
    for name in ("parameters", "seconds", "tolerances"):
        mappings[name] = {k: to_number(v) for k, v in mappings[name].items()}
    mappings["initial_correction"] = {
        k: [to_number(x) for x in pair] for k, pair in mappings["initial_correction"].items()
    }
    return {
        "kind": KIND,
        "schema_version": SCHEMA_VERSION,
        "sign_convention": SIGN_CONVENTION,
        **{name: storable(getattr(record, name)) for name in TEXTS},
        **mappings,
        WARNINGS: list(record.warnings),
    }


def from_metadata(metadata: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of `Record` from metadata.

    Parameters
    ----------
    metadata : mapping
        Result of `to_metadata`; missing entries are empty.

    Returns
    -------
    dict
        Keyword arguments for `Record`.

    Raises
    ------
    ValueError
        A value has a type that `to_metadata` does not write, or the digest of the model's text does
        not match.
    """
    empty = {**dict.fromkeys(TEXTS, ""), **{name: {} for name in MAPPINGS}, WARNINGS: []}
    fields = {name: metadata.get(name, default) for name, default in empty.items()}
    check_described("trajectory", fields)
    of_type(str, fields["model"], "model")
    for name, formula in of_type(dict, fields["conserved_formulas"], "conserved_formulas").items():
        of_type(str, formula, f"conserved_formulas.{name}")
    check_json(fields["display"], DISPLAY, "display")
    for name in ("parameters", "seconds", "tolerances"):
        fields[name] = {k: from_number(v) for k, v in fields[name].items()}
    correction = fields["initial_correction"].items()
    fields["initial_correction"] = {k: (from_number(a), from_number(b)) for k, (a, b) in correction}
    fields[WARNINGS] = tuple(fields[WARNINGS])
    check_model(fields["model"], fields.pop("model_sha256"))
    return fields


def check_described(kind: str, attributes: Mapping[str, Any]) -> None:
    """Check attributes of a file that ``lagcli info --json`` prints unchanged.

    Parameters
    ----------
    kind : str
        The kind of the file, ``trajectory`` or ``sweep``.
    attributes : mapping
        Parsed attributes by name; those that are not printed are not checked.

    Raises
    ------
    ValueError
        A value does not have the schema that ``docs/schemas/info.json`` gives.
    """
    options = published_schema("info")["oneOf"]
    properties = next(x for x in options if x["properties"]["kind"].get("const") == kind)[
        "properties"
    ]
    for name, value in attributes.items():
        check_json(value, properties.get(name, {}), name)


def check_times(time: Array, after: float = -math.inf) -> None:
    """Raise ValueError unless sample times, s, are finite and do not decrease."""
    if not np.isfinite(time).all():
        raise ValueError("time has values that are not finite")
    if len(time) and (time[0] < after or (time[1:] < time[:-1]).any()):
        raise ValueError("time decreases")


def check_model(text: str, sha256: str) -> None:
    """Raise ValueError if the digest of a model's text does not match."""
    if (text or sha256) and hashlib.sha256(text.encode()).hexdigest() != sha256:
        raise ValueError("the model's text does not have the digest model_sha256")


def shortened(value: object) -> str:
    """Return a value for a message, in at most about 60 characters."""
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:60]}…"


def of_type(kind: type | tuple[type, ...], value: Any, name: str) -> Any:
    """Return the value, which must be of a type; True is not a number."""
    if not isinstance(value, kind) or isinstance(value, bool):
        raise ValueError(f"{name} is {shortened(value)}")
    return value


def to_json(value: object, indent: int | None = None) -> str:
    """Return JSON text; values outside JSON (a path, a date) become text.

    Parameters
    ----------
    value : object
        Tuples become lists, NumPy numbers and arrays become numbers and lists.
    indent : int, optional
        Indentation; one line by default.

    Returns
    -------
    str
        Non-ASCII characters are not escaped.
    """
    return storable(json.dumps(value, ensure_ascii=False, indent=indent, default=_plain))


def storable(text: str) -> str:
    """Return the text without characters that UTF-8 or HDF5 cannot store."""
    # The bytes of a file name that are not UTF-8 are lone surrogates in Python; HDF5 ends a text
    # at NUL. A model file has neither.
    return text.encode("utf-8", "replace").decode("utf-8").replace("\0", "�")


def _plain(value: Any) -> object:
    """Return a NumPy value as Python's, and any other object as text, so that no run is lost."""
    return value.tolist() if hasattr(value, "tolist") else str(value)


def to_number(value: float) -> float | str | None:
    """Return a float as a JSON value.

    Parameters
    ----------
    value : float
        Any.

    Returns
    -------
    float, str or None
        None for NaN, ``"inf"`` or ``"-inf"`` for the infinities.
    """
    value = float(value)
    if math.isnan(value):
        return None
    return str(value) if math.isinf(value) else value


def from_number(value: float | str | None) -> float:
    """Invert `to_number`.

    Parameters
    ----------
    value : float, str or None
        A JSON value.

    Returns
    -------
    float
        The same bits, with every NaN replaced by Python's.

    Raises
    ------
    ValueError
        It is not a number.
    """
    if value is None:
        return math.nan
    if isinstance(value, bool) or not (isinstance(value, int | float) or value in _INFINITIES):
        raise ValueError(f"{shortened(value)} is not a number")
    return float(value)


def model_name(text: str) -> str | None:
    """Return the model's ``name:`` if it stands on its own line, without reading YAML."""
    return _stated(text, "name")


def model_title(text: str) -> str | None:
    """Return the model's ``title:``, or else its name, without reading YAML."""
    return _stated(text, "title") or _stated(text, "name")


def _stated(text: str, key: str) -> str | None:
    match = re.search(rf"^{key}:[ \t]+(\S.*?)[ \t]*(?:[ \t]#.*)?\r?$", text, re.MULTILINE)
    if match is None:
        return None
    name = match[1]
    quoted = len(name) >= 2 and name[0] == name[-1] and name[0] in "\"'"
    return name[1:-1] if quoted else name
