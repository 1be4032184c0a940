"""Frames: JSON with arrays in it, as one binary message.

A frame is the length of its header in bytes (32 bits, little-endian), the header (JSON in UTF-8,
with blanks at its end so that both are a multiple of 8 bytes), and the numbers of all arrays (64
bits, little-endian). In the header an array stands as ``{"$array": [first, count]}``.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np

from lagcli.trajectory.samples import Array


def encode(value: Mapping[str, Any]) -> bytes:
    """Return a frame.

    Parameters
    ----------
    value : mapping
        JSON values and one-dimensional arrays. A number that is not finite is null, but in arrays.
    """
    arrays: list[Array] = []
    text = json.dumps(_plain(value, arrays, [0]), ensure_ascii=False, allow_nan=False)
    header = text.encode(errors="replace")  # a message of a page may hold halves of characters
    header += b" " * (-(4 + len(header)) % 8)
    body = b"".join(np.ascontiguousarray(a, dtype="<f8").tobytes() for a in arrays)
    return struct.pack("<I", len(header)) + header + body


def _plain(value: Any, arrays: list[Array], place: list[int]) -> Any:
    """Return a value as JSON; put its arrays into a list."""
    if isinstance(value, np.ndarray):
        first, count = place[0], len(value)
        arrays.append(value)
        place[0] += count
        return {"$array": [first, count]}
    if isinstance(value, Mapping):
        return {str(k): _plain(v, arrays, place) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v, arrays, place) for v in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
