"""Conversion of values to JSON's types."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any


def json_values(value: Any, of_array: Callable[[Any], Any] | None = None) -> Any:
    """Return a value in JSON's own types.

    Parameters
    ----------
    value : mappings, sequences, NumPy arrays and numbers, texts
        Numbers that are not finite become null.
    of_array : callable, optional
        Function that converts an array; by default to a list of its numbers.
    """
    if hasattr(value, "tolist"):
        if of_array is not None and value.ndim:
            return of_array(value)
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): json_values(item, of_array) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        # most items are numbers of arrays, which need no more than this
        return [
            x if type(x) is float and math.isfinite(x) else json_values(x, of_array) for x in value
        ]
    return None if isinstance(value, float) and not math.isfinite(value) else value
