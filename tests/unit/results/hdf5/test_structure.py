"""Parts of HDF5 files that are read, and those that are rejected before anything is read."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest

from lagcli.results.hdf5.structure import (
    group,
    is_texts,
    numbers,
    read_texts,
    text_attribute,
    texts,
)


@pytest.fixture
def file(tmp_path: Path) -> Iterator[h5py.File]:
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["x"] = np.ones(3)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["x"] = np.arange(3.0)
        file["n"] = np.arange(3)
        file["names"] = np.array([b"a", b"bc"])
        file["table"] = np.array([[b"a"]])
        file["nothing"] = h5py.Empty("f8")
        file.create_group("part")
        file["soft"] = h5py.SoftLink("/x")
        file["outside"] = h5py.ExternalLink("other.h5", "x")
        raw = tmp_path / "raw"
        raw.write_bytes(bytes(24))
        file.create_dataset("raw", (3,), "f8", external=[(str(raw), 0, 24)])
        layout = h5py.VirtualLayout((3,), "f8")
        layout[:] = h5py.VirtualSource(str(tmp_path / "other.h5"), "x", (3,))
        file.create_virtual_dataset("view", layout)
        file.create_dataset("huge", (10**9,), "f8", chunks=(1000,), compression="gzip")
        file.create_dataset("lzf", data=np.ones(1000), compression="lzf")
        file.attrs["title"] = np.bytes_("word")
        file.attrs["free"] = "word"
        file.flush()
        yield file


def test_what_lies_in_the_file_is_read(file: h5py.File) -> None:
    assert numbers(file, "x")[()].tolist() == [0.0, 1.0, 2.0]
    assert numbers(file, "n", "<i8")[()].tolist() == [0, 1, 2]
    assert read_texts(file, "names") == ("a", "bc")
    assert is_texts(file, "names")
    assert not is_texts(file, "x")
    assert group(file, "part").name == "/part"
    assert text_attribute(file, "title") == "word"
    assert text_attribute(file, "none") is None


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("missing", "missing is missing"),
        ("part", "part is not a dataset"),
        ("n", "n holds int64 and not float64"),
        ("nothing", "nothing is empty"),
        ("soft", "soft is a soft link, which is not followed"),
        ("outside", "outside is an external link, which is not followed"),
        ("raw", "raw lies in another file"),
        ("view", "view is a view of other datasets"),
        ("huge", "huge declares 8000000000 bytes"),
        ("lzf", "lzf has filters that lagcli does not use"),
    ],
)
def test_numbers_that_are_rejected(file: h5py.File, name: str, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        numbers(file, name)


def test_texts_that_are_rejected(file: h5py.File) -> None:
    with pytest.raises(ValueError, match="x is not a group"):
        group(file, "x")
    with pytest.raises(ValueError, match="holds float64 and not texts"):
        texts(file, "x")
    with pytest.raises(ValueError, match="not one axis"):
        read_texts(file, "table")
    with pytest.raises(ValueError, match="free is not a text of a fixed length"):
        text_attribute(file, "free")
