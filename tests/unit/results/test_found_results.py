"""Damaged and crafted result files, and files of layout 1, as the commands meet them."""

from __future__ import annotations

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

import lagcli
from lagcli.cli.app import run
from lagcli.errors import FileError
from lagcli.results.hdf5 import opening
from lagcli.sweeps.file.store import open_sweep

FOUND = Path(__file__).parents[2] / "found"
HOSTILE = {
    "checksum": "damaged",
    "time-nan": "time has values that are not finite",
    "external-storage": r"energy_kinetic lies in another file \(external storage\)",
    "declares-1e9-samples": "time declares 8000000000 bytes, and the file holds 0",
    "heap-freespace": "the free space of a heap of texts is wrong",
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files_are_rejected(name: str) -> None:
    with pytest.raises(FileError, match=HOSTILE[name]):
        lagcli.read(FOUND / "hostile" / f"{name}.h5")


def test_every_command_rejects_a_hostile_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = str(FOUND / "hostile" / "external-storage.h5")
    page = str(tmp_path / "x.html")
    for command in (
        ["info", file],
        ["info", file, "--json"],
        ["plot", file, "-o", str(tmp_path / "x.svg")],
        ["animate", file, "-o", page],
        ["report", file, "-o", page],
        ["export-csv", file, "-o", str(tmp_path / "x.csv")],
    ):
        assert run(command) == 4, command
        assert "external storage" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["run", "sweep"])
def test_layout_1_is_read(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(FOUND / "layout1")
    assert run(["info", f"{name}.h5"]) == 0
    assert capsys.readouterr().out == Path(f"{name}.txt").read_text(encoding="utf-8")


def test_numbers_of_layout_1_are_kept() -> None:
    trajectory = lagcli.read(FOUND / "layout1" / "run.h5")
    with h5py.File(FOUND / "layout1" / "run.h5") as root:
        forces = root["constraint_force_by"][()]
        np.testing.assert_array_equal(trajectory.constraint_force_of("guide"), forces[:, 0])
        for name in ("time", "q", "a", "multipliers", "residual_velocity", "scale_position"):
            np.testing.assert_array_equal(getattr(trajectory, name), root[name])
        for name, values in trajectory.outputs.items():
            np.testing.assert_array_equal(values, root["outputs"][name])
    with open_sweep(FOUND / "layout1" / "sweep.h5") as sweep:
        (results,) = sweep.results()
        with h5py.File(FOUND / "layout1" / "sweep.h5") as root:
            np.testing.assert_array_equal(results.kept[:, :, :2], root["q"])
            assert sweep.messages() == root["message"].asstr()[()].tolist()
            outputs = [root["outputs"][name] for name in sweep.outputs]
            np.testing.assert_array_equal(
                results.kept[:, :, -len(outputs) :].T, [x[()].T for x in outputs]
            )


def test_a_process_that_does_not_end_is_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copy(FOUND / "layout1" / "run.h5", tmp_path / "run.h5")
    monkeypatch.setattr(opening, "_SECONDS", 0.0)
    monkeypatch.setattr(opening, "_RATE", 1 << 30)
    with pytest.raises(FileError, match="does not end within 0 s"):
        lagcli.read(tmp_path / "run.h5")


def test_a_process_that_crashes_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copy(FOUND / "layout1" / "run.h5", tmp_path / "run.h5")
    monkeypatch.setattr(opening.sys, "executable", "/bin/false")
    with pytest.raises(FileError, match="ended with status 1"):
        lagcli.read(tmp_path / "run.h5")
