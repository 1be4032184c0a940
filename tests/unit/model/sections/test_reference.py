"""The key `reference` of model files."""

from __future__ import annotations

import pytest

import lagcli
from lagcli.errors import ModelError

TEXT = "coordinates: [x]\nT: x'^2/2\nV: 0\ninitial: {x: 0, x': 1}\nreference: "


def test_a_reference_is_read() -> None:
    assert lagcli.load_text(TEXT + "Newton 1687").reference == "Newton 1687"
    with pytest.raises(ModelError, match="`reference`"):
        lagcli.load_text(TEXT + "[1]")
