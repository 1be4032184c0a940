"""Values that JSON cannot have."""

from __future__ import annotations

import json
import math

import numpy as np

from lagcli.json_values import json_values


def test_what_is_written_is_strict_json_and_reads_back() -> None:
    value = {
        1: np.float64(0.1),
        "list": (np.int64(3), math.nan, -math.inf, None, True),
        "array": np.array([[1.0, np.nan], [0.5, 2.0]]),
    }
    text = json.dumps(json_values(value), allow_nan=False)
    assert json.loads(text) == {
        "1": 0.1,
        "list": [3, None, None, None, True],
        "array": [[1.0, None], [0.5, 2.0]],
    }


def test_arrays_may_be_written_elsewhere_but_not_single_numbers() -> None:
    value = {"a": np.arange(3), "b": np.float64(2.0)}
    assert json_values(value, of_array=len) == {"a": 3, "b": 2.0}
