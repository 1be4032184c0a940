"""The sidecar of a CSV file: JSON with the metadata that CSV cannot represent."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lagcli.errors import FileError
from lagcli.files import check_readable, read_failure
from lagcli.results.csv.event_table import events_digest, read_event_table
from lagcli.results.csv.names import events_path, sidecar_path
from lagcli.results.metadata import (
    KIND,
    from_metadata,
    from_number,
    storable,
    to_json,
    to_metadata,
    to_number,
)
from lagcli.trajectory.samples import SCHEMA_VERSION, InputTable, Record

#: Fields of a table that are text.
_OF_TABLES = ("unit", "file", "sha256")

_REMEDY = "remove it to read only the CSV file"


def sidecar_text(record: Record, contents: Mapping[str, Any]) -> bytes:
    """Return the whole text of a sidecar.

    Parameters
    ----------
    record : Record
        Record of the run.
    contents : mapping
        Description of the CSV file: ``csv_sha256``, which associates the two files, ``samples``
        (their number), and the names of ``coordinates``, ``constraints``, ``outputs``.

    Returns
    -------
    bytes
        JSON in UTF-8: the result of `to_metadata`, the description, and the scales of the
        constraints (null for NaN).
    """
    metadata = to_metadata(record)
    model = metadata.pop("model")
    about: dict[str, Any] = {
        **metadata,
        **contents,
        "scale_position": [to_number(x) for x in record.scale_position],
        "scale_velocity": [to_number(x) for x in record.scale_velocity],
        **({"inputs": _listed(record.inputs)} if record.inputs else {}),
        "model": model,  # last, because it is long
    }
    about["sidecar_sha256"] = _digest(json.loads(to_json(about)))
    return (to_json(about, indent=1) + "\n").encode()


def _digest(about: Mapping[str, Any]) -> str:
    """Return the digest of a sidecar's contents, independent of whitespace and line ends."""
    others = {name: value for name, value in about.items() if name != "sidecar_sha256"}
    return hashlib.sha256(json.dumps(others, sort_keys=True).encode()).hexdigest()


def read_sidecar(path: str, coordinates: Sequence[str], constraints: Sequence[str]) -> Record:
    """Return the metadata of a CSV file from its sidecar and its event table.

    Parameters
    ----------
    path : str
        The CSV file.
    coordinates, constraints : sequence of str
        Their names.

    Returns
    -------
    Record
        Without a sidecar, texts and mappings are empty, and scales are NaN.

    Raises
    ------
    FileError
        The sidecar or the event table cannot be read, is invalid, or belongs to another CSV file.
    """
    events, nc = read_event_table(path, coordinates, constraints), len(constraints)
    sidecar = sidecar_path(path)
    if not os.path.lexists(sidecar):
        unknown = np.full(nc, np.nan)
        return Record(
            scale_position=unknown,
            scale_velocity=unknown.copy(),
            events=events,
            **from_metadata({}),
        )
    check_readable(sidecar)
    try:
        with open(sidecar, encoding="utf-8") as file:
            about = json.load(file, object_pairs_hook=_without_duplicates)
        with open(path, "rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise read_failure(sidecar, error) from error
    except (ValueError, RecursionError) as error:
        raise FileError(f"cannot read {sidecar}: it is not JSON ({error}); {_REMEDY}") from error
    if not isinstance(about, Mapping) or about.get("kind") != KIND:
        raise FileError(f"cannot read {sidecar}: it is not the sidecar of a trajectory; {_REMEDY}")
    if about.get("schema_version") != SCHEMA_VERSION:
        raise FileError(
            f"cannot read {sidecar}: its layout has version {about.get('schema_version')}, and "
            f"this lagcli supports {SCHEMA_VERSION}; {_REMEDY}"
        )
    if about.get("sidecar_sha256") != _digest(about):
        raise FileError(
            f"cannot read {sidecar}: it was changed after lagcli wrote it (its checksum does not"
            f" fit); {_REMEDY}"
        )
    if about.get("csv_sha256") != digest:
        raise FileError(
            f"cannot read {path}: its sidecar {sidecar} is of another run, or one of the two "
            "was changed; remove the sidecar to read only the CSV file"
        )
    if about.get("events_sha256") != events_digest(path):
        raise FileError(
            f"cannot read {path}: its event table {events_path(path)}, is of another"
            " run, was changed, or is missing; copy it again, or remove both it and the sidecar to"
            " read only the CSV file"
        )
    try:
        scales: dict[str, Any] = {
            name: np.array([from_number(x) for x in about[name]], dtype=np.float64)
            for name in ("scale_position", "scale_velocity")
        }
        for name, values in scales.items():
            if values.shape != (nc,):
                raise ValueError(f"{name} has {len(values)} values for {nc} constraints")
        inputs = {name: _table(name, x) for name, x in about.get("inputs", {}).items()}
        return Record(events=events, inputs=inputs, **scales, **from_metadata(about))
    except (LookupError, ValueError, TypeError, ArithmeticError) as error:
        raise FileError(f"cannot read {sidecar}: it is damaged ({error!r}); {_REMEDY}") from error


def _listed(inputs: Mapping[str, InputTable]) -> dict[str, Any]:
    """Return the tables of inputs as JSON values."""
    return {
        name: {
            **{x: storable(getattr(table, x)) for x in _OF_TABLES},
            "times": table.times.tolist(),
            "values": table.values.tolist(),
        }
        for name, table in inputs.items()
    }


def _table(name: str, given: Mapping[str, Any]) -> InputTable:
    """Invert `_listed`.

    Raises
    ------
    LookupError, TypeError, ValueError
        The value is not a table.
    """
    times, values = (np.array(given[x], dtype=np.float64) for x in ("times", "values"))
    table = InputTable(times, values, **{x: str(given[x]) for x in _OF_TABLES})
    table.check(name)
    return table


def _without_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return a JSON object; reject duplicate names."""
    mapping = dict(pairs)
    if len(mapping) < len(pairs):
        raise ValueError("a name occurs twice")
    return mapping
