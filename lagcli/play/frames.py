"""Frames: JSON with arrays in one binary message.

A frame is the length of its header in bytes (32 bits, little-endian), the header (JSON in UTF-8,
with blanks at its end so that both are a multiple of 8 bytes), and the numbers of all arrays (64
bits, little-endian). In the header an array stands as ``{"$array": [first, count]}``.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np

from lagcli.arrays import Array
from lagcli.json_values import json_values


def encode(value: Mapping[str, Any]) -> bytes:
    """Return a frame.

    Parameters
    ----------
    value : mapping
        JSON values and one-dimensional arrays. Outside of arrays, numbers that are not finite
        become null.
    """
    arrays: list[Array] = []

    def place(array: Array) -> dict[str, list[int]]:
        arrays.append(array)
        return {"$array": [sum(map(len, arrays[:-1])), len(array)]}

    text = json.dumps(json_values(value, place), ensure_ascii=False, allow_nan=False)
    header = text.encode(errors="replace")  # a message of a page may contain lone surrogates
    header += b" " * (-(4 + len(header)) % 8)
    body = b"".join(np.ascontiguousarray(a, dtype="<f8").tobytes() for a in arrays)
    return struct.pack("<I", len(header)) + header + body
