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

CRANK = Path(__file__).parents[3] / "models" / "slider_crank.yaml"


@pytest.mark.parametrize("suffix", formats.SUFFIXES)
def test_every_format_keeps_the_numbers(suffix: str, tmp_path: Path) -> None:
    run, path = lagcli.simulate(lagcli.load(CRANK), t_end=0.1), tmp_path / f"run{suffix.upper()}"
    assert suffix in format_of(path).suffixes
    write(run, path)
    back = read(path)
    assert all((getattr(back, name) == getattr(run, name)).all() for name in "qva")


#: Where the writer of each format takes the columns from.
WRITERS = {
    ".h5": (
        "lagcli.results.hdf5.trajectories.SAMPLED",
        "lagcli.results.hdf5.trajectories.QUANTITIES",
    ),
    ".csv": ("lagcli.results.csv.writer.SAMPLED",),
}


@pytest.mark.parametrize("suffix", WRITERS)
@pytest.mark.parametrize("lacking", ["power_time", "residual_velocity"])
def test_a_file_without_a_column_that_was_added_later_is_read(
    suffix: str, lacking: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run, path = lagcli.simulate(lagcli.load(CRANK), t_end=0.1), tmp_path / f"run{suffix}"
    with monkeypatch.context() as before:
        for place in WRITERS[suffix]:
            kept = [q for q in columns.QUANTITIES if q.name != lacking]
            if place.endswith("SAMPLED"):
                kept = [q for q in kept if "time" in q.axes]
            before.setattr(place, tuple(kept))
        write(run, path)
    back = read(path)
    assert getattr(back, lacking).shape == getattr(run, lacking).shape
    assert np.isnan(getattr(back, lacking)).all()
    for name in ("q", "v", "a", "multipliers", "energy_total", "residual_equation"):
        np.testing.assert_array_equal(getattr(back, name), getattr(run, name))
    for name, values in run.outputs.items():
        np.testing.assert_array_equal(back.outputs[name], values)
    assert info.describe(path)["sizes"]["samples"] == len(run.time)


@pytest.mark.parametrize("suffix", WRITERS)
def test_a_file_without_a_column_that_every_file_has_is_refused(
    suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run, path = lagcli.simulate(lagcli.load(CRANK), t_end=0.1), tmp_path / f"run{suffix}"
    with monkeypatch.context() as before:
        for place in WRITERS[suffix]:
            kept = [q for q in columns.QUANTITIES if q.name != "a"]
            if place.endswith("SAMPLED"):
                kept = [q for q in kept if "time" in q.axes]
            before.setattr(place, tuple(kept))
        write(run, path)
    with pytest.raises(FileError, match="cannot read"):
        read(path)


@pytest.mark.parametrize("name", ["run.txt", "run", "h5"])
def test_other_suffixes_are_refused_with_those_that_there_are(name: str) -> None:
    with pytest.raises(UsageError) as caught:
        format_of(name)
    assert all(f"{f.suffixes[0]} ({f.title})" in str(caught.value) for f in FORMATS)


def test_a_format_without_sweeps_is_refused_for_a_sweep(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(formats, "FORMATS", tuple(f._replace(sweeps="") for f in FORMATS))
    with pytest.raises(UsageError, match="HDF5 files hold no sweeps"):
        lagcli.sweep(CRANK, ["m=1,2"], tmp_path / "s.h5")


def test_the_registry_imports_nothing_beyond_the_standard_library() -> None:
    code = "import sys, lagcli.results; sys.exit(bool({'numpy', 'h5py'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], check=False, timeout=60).returncode == 0
