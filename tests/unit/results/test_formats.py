"""The registry of result formats: names, remedies, and what is imported when."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli import columns
from lagcli.errors import FileError, UsageError
from lagcli.results import formats, info, read, write
from lagcli.results.formats import FORMATS, format_of
from lagcli.trajectory.trajectory import Trajectory

CRANK = Path(__file__).parents[3] / "models" / "slider_crank.yaml"


@pytest.mark.parametrize("suffix", formats.SUFFIXES)
def test_every_format_keeps_the_numbers(suffix: str, tmp_path: Path) -> None:
    run, path = lagcli.simulate(lagcli.load(CRANK), t_end=0.1), tmp_path / f"run{suffix.upper()}"
    assert suffix in format_of(path).suffixes
    write(run, path)
    back = read(path)
    assert all((getattr(back, name) == getattr(run, name)).all() for name in "qva")


#: Where the writer of each format takes the columns from, and its reader those that must be there.
WRITERS = {
    ".h5": ["results.hdf5.trajectories.SAMPLED", "results.hdf5.trajectories.QUANTITIES"],
    ".csv": ["results.csv.writer.SAMPLED"],
}
READERS = {".h5": "results.hdf5.structure.REQUIRED", ".csv": "results.csv.reader.REQUIRED"}


def write_without(column: str, suffix: str, folder: Path) -> tuple[Trajectory, Path]:
    """Write a run as a version of lagcli would that does not know a column."""
    run, path = lagcli.simulate(lagcli.load(CRANK), t_end=0.1), folder / f"run{suffix}"
    with pytest.MonkeyPatch.context() as before:
        for place in WRITERS[suffix]:
            known = columns.SAMPLED if place.endswith("SAMPLED") else columns.QUANTITIES
            before.setattr(f"lagcli.{place}", tuple(q for q in known if q.name != column))
        write(run, path)
    return run, path


@pytest.mark.parametrize("suffix", WRITERS)
@pytest.mark.parametrize("added", ["power_time", "residual_velocity"])
def test_a_column_that_was_added_after_the_file_was_written_is_nan(
    suffix: str, added: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run, path = write_without(added, suffix, tmp_path)
    monkeypatch.setattr(f"lagcli.{READERS[suffix]}", columns.REQUIRED - {added})
    back = read(path)
    assert getattr(back, added).shape == getattr(run, added).shape
    assert np.isnan(getattr(back, added)).all()
    for name in ("q", "v", "a", "multipliers", "energy_total", "residual_equation"):
        np.testing.assert_array_equal(getattr(back, name), getattr(run, name))
    for name, values in run.outputs.items():
        np.testing.assert_array_equal(back.outputs[name], values)
    assert info.describe(path)["sizes"]["samples"] == len(run.time)


@pytest.mark.parametrize("suffix", WRITERS)
def test_a_file_without_a_column_that_all_have_is_rejected(suffix: str, tmp_path: Path) -> None:
    _, path = write_without("power_time", suffix, tmp_path)
    with pytest.raises(FileError, match="cannot read"):
        read(path)


@pytest.mark.parametrize("name", ["run.txt", "run", "h5"])
def test_other_suffixes_are_rejected_with_those_that_there_are(name: str) -> None:
    with pytest.raises(UsageError) as caught:
        format_of(name)
    assert all(f"{f.suffixes[0]} ({f.title})" in str(caught.value) for f in FORMATS)


def test_a_format_without_sweeps_is_rejected_for_a_sweep(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(formats, "FORMATS", tuple(f._replace(sweeps="") for f in FORMATS))
    with pytest.raises(UsageError, match="HDF5 files cannot store sweeps"):
        lagcli.sweep(CRANK, ["m=1,2"], tmp_path / "s.h5")


def test_the_registry_imports_nothing_beyond_the_standard_library() -> None:
    code = "import sys, lagcli.results; sys.exit(bool({'numpy', 'h5py'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], check=False, timeout=60).returncode == 0
