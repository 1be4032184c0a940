"""Files of analyses."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from lagcli.errors import FileError
from lagcli.results.formats import kind_of
from lagcli.results.hdf5.analysis_file import read_analysis, write_analysis

POINT = {
    **{"name": "the start", "steady": True, "time": 0.0, "q": {"φ": 0.1}, "v": {"φ": 0.0}},
    **{"multipliers": {}, "contacts": []},
}
CONTENT = {
    **{"command": "modes", "model": "péndulo", "operating_point": POINT, "undamped": True},
    **{"degrees_of_freedom": 1, "modes": [], "notes": []},
}


def test_content_and_arrays_come_back(tmp_path: Path) -> None:
    path = str(tmp_path / "a.h5")
    # a content that is larger than what attributes of old HDF5 files may hold
    content = {**CONTENT, "long": [0.1] * 200_000}
    write_analysis(path, content, {"a": np.arange(6.0).reshape(2, 3)}, {"model": "x: 1"}, {})
    assert read_analysis(path) == content
    assert read_analysis(path, "modes") == content
    assert kind_of(path) == "modes"
    with h5py.File(path) as root:
        assert root["a"][1, 2] == 5.0
        assert root.attrs["model"] == b"x: 1"


def test_numbers_that_json_lacks_are_null(tmp_path: Path) -> None:
    path = str(tmp_path / "a.h5")
    write_analysis(path, {**CONTENT, "x": [float("nan"), 1.0]}, {}, {}, {})
    assert read_analysis(path)["x"] == [None, 1.0]


def test_contents_that_are_not_those_of_the_command_are_rejected(tmp_path: Path) -> None:
    cases = [
        ({**CONTENT, "notes": None}, "content.notes: None is not of type 'array'"),
        (
            {**CONTENT, "operating_point": {**POINT, "v": {}}},
            "point.v: has keys none, but .* has φ",
        ),
        ({**CONTENT, "command": "../check"}, r'kind is "?\'../check\'.*this version does not have'),
    ]
    for i, (content, said) in enumerate(cases):
        path = str(tmp_path / f"{i}.h5")
        write_analysis(path, content, {}, {}, {})
        with pytest.raises(FileError, match=rf"{i}\.h5: .*{said}"):
            read_analysis(path)


def test_other_files_and_damage_are_rejected(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    write_analysis(str(path), CONTENT, {}, {}, {})
    with pytest.raises(FileError, match="not a file of lagcli equilibrium"):
        read_analysis(path, "equilibrium")
    with pytest.raises(FileError, match="exists"):
        write_analysis(str(path), CONTENT, {}, {}, {})
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    with pytest.raises(FileError, match=r"damaged|changed"):
        read_analysis(path)
