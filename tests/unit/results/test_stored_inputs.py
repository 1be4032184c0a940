"""The tables of inputs in result and sweep files."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

import lagcli
from lagcli.errors import FileError, UsageError
from lagcli.pictures.run_file import RunFile
from lagcli.results.info import describe, format_info

MODEL = """\
coordinates: {y: m}
parameters: {m: 1 kg, k: 100 N/m}
inputs:
  u: {file: road.csv, column: height, interpolation: cubic, extend: hold}
  pull: {times: [0, 1, 2], values: [0 N, 10 N, 0 N]}
T: m/2*y'^2
V: k/2*(y - u)^2
Q: {y: pull}
initial: {y: 0 m, y': 0 m/s}
outputs: {road: u}
simulation: {t_end: 2, samples: 21}
"""
CSV = "t,height [mm]\n0,0\n0.5,10\n1,-5\n"


@pytest.fixture
def model(tmp_path: Path) -> lagcli.Model:
    (tmp_path / "m.yaml").write_text(MODEL, encoding="utf-8")
    (tmp_path / "road.csv").write_text(CSV, encoding="utf-8")
    return lagcli.load(tmp_path / "m.yaml")


@pytest.mark.parametrize("suffix", [".h5", ".csv"])
def test_files_hold_the_tables(model: lagcli.Model, tmp_path: Path, suffix: str) -> None:
    """They are read back bit by bit, and the model is made of them without its files."""
    run = lagcli.simulate(model)
    path = tmp_path / f"run{suffix}"
    lagcli.write(run, path, **({"meta": True} if suffix == ".csv" else {}))
    (tmp_path / "road.csv").unlink()
    read = lagcli.read(path).inputs
    assert list(read) == ["pull", "u"] if suffix == ".h5" else ["u", "pull"]
    for name, table in model.data.items():
        np.testing.assert_array_equal(read[name].times, table.times)
        np.testing.assert_array_equal(read[name].values, table.values)
        assert (read[name].file, read[name].sha256) == (table.file, table.sha256)
    again = RunFile(str(path)).model
    assert again.data == model.data
    np.testing.assert_array_equal(lagcli.simulate(again).q, run.q)


def test_info_names_the_files(model: lagcli.Model, tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    lagcli.write(lagcli.simulate(model), path)
    info = describe(path)
    sha256 = model.data["u"].sha256
    assert info["inputs"]["u"] == {
        "file": "road.csv",
        "sha256": sha256,
        "unit": "mm",
        "rows": 3,
        "first": 0.0,
        "last": 1.0,
    }
    text = " ".join(format_info(info).split())
    assert f"u of road.csv (sha256 {sha256[:12]}…), 3 rows, 0 to 1 s" in text
    assert "pull of the model, 3 rows, 0 to 2 s" in text


def test_a_damaged_table_is_rejected(model: lagcli.Model, tmp_path: Path) -> None:
    """Times that do not increase, though the checksum is right."""
    from lagcli.results.hdf5.seal import seal

    path = tmp_path / "run.h5"
    lagcli.write(lagcli.simulate(model), path)
    content = path.read_bytes()
    with h5py.File(path) as file:
        place = file["inputs/u/time"].id.get_offset()
    damaged = bytearray(content[:-80])
    damaged[place + 8 : place + 16] = np.float64(-1).tobytes()
    path.write_bytes(damaged)
    with path.open("r+b") as opened:
        seal(opened)
    with pytest.raises(FileError, match="the table of u"):
        lagcli.read(path)


def test_rows_of_sweeps_have_the_inputs(model: lagcli.Model, tmp_path: Path) -> None:
    """Each row is the single run; the file is read once, and the tables are in the sweep file."""
    path = tmp_path / "sweep.h5"
    lagcli.sweep(model, ["k=50:150:50"], path, keep="trajectories", jobs=2)
    with h5py.File(path) as file:
        np.testing.assert_array_equal(file["inputs/u/value"][:], model.data["u"].values)
        for row, k in enumerate((50, 100, 150)):
            changed = lagcli.load(tmp_path / "m.yaml", set={"k": f"{k} N/m"})
            np.testing.assert_array_equal(file["q"][row], lagcli.simulate(changed).q)


def test_a_sweep_is_not_resumed_with_another_table(model: lagcli.Model, tmp_path: Path) -> None:
    path = tmp_path / "sweep.h5"
    what = (tmp_path / "m.yaml", ["k=50:150:50"], path)
    lagcli.sweep(*what, measures=["max(y)"])
    lagcli.sweep(*what, measures=["max(y)"], resume=True)
    (tmp_path / "road.csv").write_text(CSV.replace("-5", "-6"), encoding="utf-8")
    with pytest.raises(UsageError, match=r"to another sweep.*\n  u: "):
        lagcli.sweep(*what, measures=["max(y)"], resume=True)
