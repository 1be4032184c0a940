"""The registry of result formats: names, remedies, and what is imported when."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import lagcli
from lagcli.errors import UsageError
from lagcli.results import formats, read, write
from lagcli.results.formats import FORMATS, format_of

CRANK = Path(__file__).parents[3] / "models" / "slider_crank.yaml"


@pytest.mark.parametrize("suffix", formats.SUFFIXES)
def test_every_format_keeps_the_numbers(suffix: str, tmp_path: Path) -> None:
    run, path = lagcli.simulate(lagcli.load(CRANK), t_end=0.1), tmp_path / f"run{suffix.upper()}"
    assert suffix in format_of(path).suffixes
    write(run, path)
    back = read(path)
    assert all((getattr(back, name) == getattr(run, name)).all() for name in "qva")


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
