"""Result files that this process, or another one, holds open are read all the same."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import h5py
import numpy as np
import pytest

import lagcli
from lagcli.errors import FileError

MODEL = """
coordinates: [x]
parameters: {k: 2}
T: x'^2/2
V: k*x^2/2
initial: {x: 1, x': 0}
simulation: {t_end: 1, samples: 11}
"""


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run, a sweep and an analysis."""
    folder, model = tmp_path_factory.mktemp("held"), lagcli.load_text(MODEL)
    lagcli.write(lagcli.simulate(model), folder / "run.h5")
    lagcli.sweep(model, vary=["k=1:2:1"], measures=["max(x)"], output=folder / "sweep.h5")
    lagcli.write(lagcli.modes(model, equilibrium=True), folder / "modes.h5")
    return folder


def check_readable(folder: Path) -> None:
    pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    assert lagcli.read(folder / "run.h5").q[0, 0] == 1
    assert len(lagcli.open(folder / "run.h5").time) == 11
    assert lagcli.open(folder / "sweep.h5").sizes["run"] == 2
    assert lagcli.open(folder / "modes.h5")["command"] == "modes"


@contextmanager
def held(folder: Path, **how: object) -> Iterator[list[h5py.File]]:
    files = [h5py.File(path, **how) for path in sorted(folder.glob("*.h5"))]
    try:
        yield files
    finally:
        for file in files:
            file.close()


@pytest.mark.parametrize("locking", [None, True, False, "best-effort"])
@pytest.mark.parametrize("driver", [None, "core"])
def test_a_file_that_h5py_holds_open(shared: Path, locking: object, driver: str | None) -> None:
    with held(shared, mode="r", locking=locking, driver=driver) as files:
        check_readable(shared)
        assert all(file["/"] for file in files)


def test_a_file_that_xarray_holds_open(shared: Path) -> None:
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    names = [shared / "run.h5", shared / "sweep.h5"]
    first, second = (xarray.open_dataset(x, engine="h5netcdf", phony_dims="access") for x in names)
    with closing(first), closing(second):
        check_readable(shared)
        assert np.isfinite(second["k"]).all()


def test_a_file_that_another_process_locks(shared: Path) -> None:
    hold = (
        "import h5py, sys; f = h5py.File(sys.argv[1], locking=True); print(1, flush=True); input()"
    )
    for setting in ("TRUE", "FALSE", "BEST_EFFORT"):
        environment = os.environ | {"HDF5_USE_FILE_LOCKING": setting}
        command = [sys.executable, "-c", hold, shared / "run.h5"]
        with subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment
        ) as process:
            assert process.stdout is not None
            assert process.stdout.readline() == b"1\n"
            check_readable(shared)
            process.communicate(b"\n")
        assert process.returncode == 0


@pytest.mark.parametrize("mode", ["r+", "a"])
def test_a_file_that_is_open_for_writing_is_named_so(tmp_path: Path, mode: str) -> None:
    path = tmp_path / "run.h5"
    lagcli.write(lagcli.simulate(lagcli.load_text(MODEL)), path)
    with h5py.File(path, mode), pytest.raises(FileError) as caught:
        lagcli.read(path)
    assert "a program has it open for writing" in str(caught.value)
    assert "damaged" not in str(caught.value)
    with pytest.raises(FileError, match="was changed by another program"):
        lagcli.read(path)


def test_a_file_and_folder_without_permission_to_write(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    lagcli.write(lagcli.simulate(lagcli.load_text(MODEL)), path)
    path.chmod(0o444)
    tmp_path.chmod(0o555)
    try:
        assert lagcli.read(path).q[0, 0] == 1
    finally:
        tmp_path.chmod(0o755)
