"""Serialization of row results."""

from __future__ import annotations

import json
import operator
import struct
from typing import Any

import numpy as np

from lagcli.sweeps.row_results import MISSING, Results

_LENGTH = struct.Struct("<Q")  # bytes of the JSON text at the beginning


def encode(results: Results) -> bytes:
    """Return results as bytes: sizes and messages as JSON, then the arrays."""
    n, nt, columns = results.kept.shape
    said = {str(i): text for i, text in enumerate(results.messages) if text}
    sizes = [n, results.measures.shape[1], nt, columns]
    head = json.dumps({"sizes": sizes, "messages": said}).encode()
    arrays = [
        np.ascontiguousarray(results.numbers, "<i8"),
        np.ascontiguousarray(results.status, "<i1"),
        np.ascontiguousarray(results.counts, "<i8"),
        np.ascontiguousarray(results.measures, "<f8"),
        np.ascontiguousarray(results.kept, "<f8"),
    ]
    return b"".join([_LENGTH.pack(len(head)), head, *(a.tobytes() for a in arrays)])


def decode(record: bytes, rows: int, measures: int) -> Results:
    """Return the results in a record, given the numbers of rows and measures.

    Raises
    ------
    ValueError
        The bytes are not such a record.
    """
    try:
        (length,) = _LENGTH.unpack_from(record)
        head = json.loads(record[_LENGTH.size : _LENGTH.size + length])
        n, width, nt, columns = map(operator.index, head["sizes"])
        messages = [str(head["messages"].get(str(i), "")) for i in range(min(n, rows))]
    except (struct.error, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError("the record has no sizes or messages") from error
    if min(n, nt, columns) < 0 or width != measures:
        raise ValueError("the record's sizes do not fit")
    place = _LENGTH.size + length

    def array(kind: str, *shape: int) -> Any:
        nonlocal place
        found = np.frombuffer(record, kind, int(np.prod(shape)), place).reshape(shape)
        place += found.nbytes
        return found

    found = Results(
        array("<i8", n),
        array("<i1", n),
        messages,
        array("<i8", n, 3),
        array("<f8", n, width),
        array("<f8", n, nt, columns),
    )
    if place != len(record) or n > rows:
        raise ValueError("the record's sizes do not fit")
    if not ((found.numbers >= 0) & (found.numbers < rows)).all():
        raise ValueError("the record holds rows that the sweep does not have")
    if not ((found.status >= 0) & (found.status < MISSING)).all():
        raise ValueError("the record holds an unknown status")
    return found
