"""What a result file says about its run besides the numbers, as JSON values."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from typing import Any

from lagcli.samples import SCHEMA_VERSION, SIGN_CONVENTION, Record

#: What kind of file it is, so that a reader can tell it from other files of lagcli.
KIND = "trajectory"

#: Fields of `Record` that are text.
TEXTS = ("lagcli_version", "status", "message", "model_sha256", "model")

#: Fields of `Record` that are mappings; `to_metadata` makes JSON values of theirs.
MAPPINGS = (
    "units",
    "parameters",
    "options",
    "counts",
    "seconds",
    "initial_correction",
    "tolerances",
    "freedom",
)

#: The field of `Record` that is a list of texts.
WARNINGS = "warnings"


def to_metadata(record: Record) -> dict[str, Any]:
    """Return texts, and mappings of JSON values, in the order of the file.

    Numbers that JSON lacks become null (NaN) and ``"inf"``, ``"-inf"`` where a number is sure to
    be meant; `from_metadata` reads them back.

    Parameters
    ----------
    record : Record
        Of the run.

    Returns
    -------
    dict
        Text or mapping by name, ``kind`` and ``schema_version`` among them.
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
        **{name: _storable(getattr(record, name)) for name in TEXTS},
        **mappings,
        WARNINGS: list(record.warnings),
    }


def from_metadata(metadata: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of `Record` that metadata hold.

    Parameters
    ----------
    metadata : mapping
        As `to_metadata` returns it; missing entries are empty.

    Returns
    -------
    dict
        Keyword arguments for `Record`.

    Raises
    ------
    ValueError, TypeError, AttributeError
        A value is not of the kind that `to_metadata` writes.
    """
    fields: dict[str, Any] = {name: str(metadata.get(name, "")) for name in TEXTS}
    fields[WARNINGS] = tuple(str(x) for x in metadata.get(WARNINGS, ()))
    for name in ("parameters", "seconds", "tolerances"):
        fields[name] = {k: from_number(v) for k, v in metadata.get(name, {}).items()}
    for name in ("units", "options", "counts", "freedom"):
        fields[name] = dict(metadata.get(name, {}))
    fields["initial_correction"] = {
        k: (from_number(before), from_number(after))
        for k, (before, after) in metadata.get("initial_correction", {}).items()
    }
    return fields


def to_json(value: object, indent: int | None = None) -> str:
    """Return JSON text; what JSON has no word for (a path, a date) becomes its text.

    Parameters
    ----------
    value : object
        Tuples become lists, NumPy numbers and arrays become numbers and lists.
    indent : int, optional
        Spaces by level; on one line without.

    Returns
    -------
    str
        Non-ASCII characters stand as they are.
    """
    return _storable(json.dumps(value, ensure_ascii=False, indent=indent, default=_plain))


def _storable(text: str) -> str:
    """Return the text without what UTF-8 or HDF5 refuse: no run is lost over an odd file name."""
    # The bytes of a file name that are not UTF-8 are lone surrogates in Python; HDF5 ends a text
    # at NUL. A model file has neither.
    return text.encode("utf-8", "replace").decode("utf-8").replace("\0", "�")


def _plain(value: Any) -> object:
    """Return a NumPy value as Python's, and anything else as text: no run is lost over it."""
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
    """Return the float that `to_number` made a JSON value of.

    Parameters
    ----------
    value : float, str or None
        A JSON value.

    Returns
    -------
    float
        Of the same bits, except that every NaN becomes the one of Python.

    Raises
    ------
    ValueError, TypeError
        It is no number.
    """
    return math.nan if value is None else float(value)


def model_name(text: str) -> str | None:
    """Return the model's ``name:`` if it stands on a line of its own, without reading YAML."""
    found = re.search(r"^name:[ \t]+(\S.*?)[ \t]*(?:[ \t]#.*)?\r?$", text, re.MULTILINE)
    if found is None:
        return None
    name = found[1]
    quoted = len(name) >= 2 and name[0] == name[-1] and name[0] in "\"'"
    return name[1:-1] if quoted else name
