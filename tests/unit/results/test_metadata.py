"""Metadata of results as JSON values."""

from __future__ import annotations

import hashlib
import json
import math
from pathlib import Path

import numpy as np
import pytest

from lagcli.results.metadata import (
    check_model,
    check_times,
    from_metadata,
    from_number,
    model_name,
    model_title,
    storable,
    to_json,
    to_number,
)


@pytest.mark.parametrize("value", [0.1, -0.0, math.inf, -math.inf, 5e-324])
def test_numbers_come_back(value: float) -> None:
    stored = json.loads(json.dumps(to_number(value)))
    assert math.copysign(1.0, from_number(stored)) == math.copysign(1.0, value)
    assert from_number(stored) == value


def test_nan_is_null_and_other_values_are_no_numbers() -> None:
    assert to_number(math.nan) is None
    assert math.isnan(from_number(None))
    for wrong in (True, "1.0", "nan", [1.0]):
        with pytest.raises(ValueError, match="is not a number"):
            from_number(wrong)  # type: ignore[arg-type]


def test_values_outside_json_become_text_and_characters_storable() -> None:
    found = json.loads(to_json({"a": np.arange(2), "path": Path("x"), "λ": np.float64(0.5)}))
    assert found == {"a": [0, 1], "path": "x", "λ": 0.5}
    assert storable("a\0b\udcff") == "a�b?"


def test_times_are_finite_and_do_not_decrease() -> None:
    check_times(np.array([0.0, 1.0, 1.0]), after=0.0)  # an instant has two samples
    check_times(np.array([]), after=3.0)
    for time, after in (([1.0, 0.0], -math.inf), ([0.0, math.nan], -math.inf), ([1.0], 2.0)):
        with pytest.raises(ValueError, match="time"):
            check_times(np.array(time), after)


@pytest.mark.parametrize("display", [[], {"latex": ["x"]}, {"definitions": [1]}, {"jumping": "x"}])
def test_what_pictures_need_has_its_types(display: object) -> None:
    assert from_metadata({"display": {"latex": {"x": "y"}}})["display"] == {"latex": {"x": "y"}}
    with pytest.raises(ValueError, match="display"):
        from_metadata({"display": display})


def test_a_model_has_the_digest_beside_it() -> None:
    text = "T: 0"
    check_model(text, hashlib.sha256(text.encode()).hexdigest())
    check_model("", "")
    for wrong in (("T: 1", hashlib.sha256(text.encode()).hexdigest()), (text, "")):
        with pytest.raises(ValueError, match="digest"):
            check_model(*wrong)


@pytest.mark.parametrize(
    ("text", "name", "title"),
    [
        ("name: arm # short\ntitle: 'An arm'\n", "arm", "An arm"),
        ("T: 0\nname: arm\r\n", "arm", "arm"),
        (" name: arm\n", None, None),
        ("name:\n", None, None),
    ],
)
def test_names_are_read_without_yaml(text: str, name: str | None, title: str | None) -> None:
    assert (model_name(text), model_title(text)) == (name, title)
