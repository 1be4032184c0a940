"""HDF5 files hold a run bit for bit, and open in other programs as they are."""

from __future__ import annotations

import dataclasses
import errno
import io
import json
import tempfile
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from trajectories import MODEL, assert_same, make, random_trajectories

from lagcli.errors import FileError
from lagcli.results.hdf5 import read_hdf5, write_hdf5
from lagcli.results.hdf5_file import Sink
from lagcli.results.layout import MIXED, NOT_STATED, QUANTITIES
from lagcli.samples import SIGN_CONVENTION
from lagcli.trajectory import Trajectory

# What results.md of the design and the docstring of Trajectory promise, by axes.
LAYOUT = {
    ("time",): (
        "time energy_kinetic energy_potential energy_total power_applied power_constraint "
        "power_time energy_balance residual_equation"
    ),
    ("coordinate",): "coordinate",
    ("constraint",): "constraint scale_position scale_velocity",
    ("time", "coordinate"): "q v a constraint_force",
    ("time", "constraint"): "multipliers residual_position residual_velocity",
    ("time", "constraint", "coordinate"): "constraint_force_by",
}

SIZES: dict[str, dict[str, Any]] = {
    "a run": {},
    "no constraint": {"constraints": ()},
    "one sample": {"nt": 1},
    "no sample": {"nt": 0},
    "no output": {"outputs": ()},
    "one of each": {"nt": 1, "coordinates": ("x",), "outputs": ("f",)},
}


def _written(folder: Path, trajectory: Trajectory) -> Path:
    write_hdf5(trajectory, folder / "run.h5")
    return folder / "run.h5"


@pytest.mark.parametrize("size", SIZES)
def test_a_run_comes_back(tmp_path: Path, size: str) -> None:
    run = make(**SIZES[size])
    assert_same(run, read_hdf5(_written(tmp_path, run)))


@settings(deadline=None, max_examples=40)
@given(run=random_trajectories(st.floats()))
def test_any_run_comes_back(run: Trajectory) -> None:
    with tempfile.TemporaryDirectory() as folder:
        assert_same(run, read_hdf5(_written(Path(folder), run)))


def test_bits_of_nan_and_signed_zero_come_back(tmp_path: Path) -> None:
    odd = np.array([0x7FF8000000000123, 0xFFF8000000000000, 1 << 63, 1, 0x7FF0000000000000])
    run = make(5, energy_total=odd.astype(np.uint64).view(np.float64))
    assert_same(run, read_hdf5(_written(tmp_path, run)))


@pytest.mark.parametrize("size", SIZES)
def test_every_dataset_has_axes_unit_and_description(tmp_path: Path, size: str) -> None:
    run = make(**SIZES[size])
    with h5py.File(_written(tmp_path, run)) as root:
        expected = {name: axes for axes, names in LAYOUT.items() for name in names.split()}
        expected |= {f"outputs/{name}": ("time",) for name in run.outputs}
        if "phi" in run.coordinates:
            expected["coordinate_unit"] = ("coordinate",)
        found = {}
        for group in (root, root["outputs"]):
            for name, dataset in group.items():
                if isinstance(dataset, h5py.Dataset):
                    assert isinstance(dataset.attrs["units"], str), name
                    assert dataset.attrs["long_name"], name
                    assert dataset.attrs.get("NAME", name.encode()) == name.encode()  # netCDF-4
                    found[dataset.name[1:]] = (
                        (name,)
                        if dataset.is_scale
                        else tuple(Path(d[0].name).name for d in dataset.dims)
                    )
        assert found == expected


def test_the_layout_names_every_field_of_a_trajectory() -> None:
    names = {quantity.name for quantity in QUANTITIES}
    arrays = {f.name for f in dataclasses.fields(Trajectory) if f.type == "Array"}
    assert names == arrays | {"constraint_force"}


def test_root_attributes(tmp_path: Path) -> None:
    run = make()
    with h5py.File(_written(tmp_path, run)) as root:
        attributes = dict(root.attrs)
    assert attributes["status"] == "completed"
    assert attributes["message"] == "reached t_end"
    assert attributes["model"] == MODEL
    assert attributes["model_sha256"] == run.model_sha256
    assert attributes["sign_convention"] == SIGN_CONVENTION
    assert attributes["lagcli_version"] == "0.1.0"
    assert attributes["schema_version"] == "1"
    for name in ("parameters", "options", "counts", "seconds", "units"):
        assert json.loads(attributes[name]) == getattr(run, name)
    assert json.loads(attributes["initial_correction"])["psi"] == [0.1, 0.16057]


@pytest.mark.parametrize("size", SIZES)
def test_xarray_opens_it_as_it_is(tmp_path: Path, size: str) -> None:
    run = make(**SIZES[size])
    path = _written(tmp_path, run)
    with xr.open_dataset(path, engine="h5netcdf") as data:
        assert dict(data.sizes) == {
            "time": len(run.time),
            "coordinate": len(run.coordinates),
            "constraint": len(run.constraints),
        }
        assert data["constraint_force_by"].dims == ("time", "constraint", "coordinate")
        assert data["constraint"].values.tolist() == list(run.constraints)
        for name in run.coordinates:
            column = run.coordinates.index(name)
            np.testing.assert_array_equal(data["q"].sel(coordinate=name), run.q[:, column])
        assert data["energy_total"].attrs == {"long_name": "total energy", "units": "J"}
        np.testing.assert_array_equal(data["constraint_force"], run.constraint_force)
    with xr.open_dataset(path, engine="h5netcdf", group="outputs") as data:
        assert list(data.data_vars) == list(run.outputs)
        for name, values in run.outputs.items():
            assert data[name].dims == ("time",)
            np.testing.assert_array_equal(data[name], values)


def test_an_output_may_have_the_name_of_an_axis(tmp_path: Path) -> None:
    run = make(outputs=("time", "constraint"))
    path = _written(tmp_path, run)
    assert_same(run, read_hdf5(path))
    with xr.open_dataset(path, engine="h5netcdf", group="outputs") as data:
        np.testing.assert_array_equal(data["constraint"], run.outputs["constraint"])


@pytest.mark.parametrize(
    ("units", "expected"),
    [
        (
            {"phi": "rad", "psi": "rad"},
            {"q": "rad", "v": "rad/s", "a": "rad/s^2", "constraint_force": "J/rad"},
        ),
        ({"phi": "kg*m", "psi": "kg*m"}, {"v": "kg*m/s", "constraint_force": "J/(kg*m)"}),
        ({"phi": "", "psi": ""}, {"q": "1", "v": "1/s", "constraint_force": "J/1"}),
        ({"phi": "rad", "psi": "m"}, {"q": MIXED, "v": MIXED, "constraint_force": MIXED}),
        ({}, {"q": NOT_STATED, "v": NOT_STATED, "constraint_force": NOT_STATED}),
    ],
)
def test_units(tmp_path: Path, units: dict[str, str], expected: dict[str, str]) -> None:
    with h5py.File(_written(tmp_path, make(units=units))) as root:
        for name, unit in {**expected, "time": "s", "energy_kinetic": "J"}.items():
            assert root[name].attrs["units"] == unit, name
        assert ("coordinate_unit" in root) == bool(units)
        if units:
            assert root["coordinate_unit"].asstr()[()].tolist() == list(units.values())


def test_units_of_outputs(tmp_path: Path) -> None:
    with h5py.File(_written(tmp_path, make())) as root:
        assert root["outputs/rod_force"].attrs["units"] == "N"
        assert root["outputs/a_first"].attrs["units"] == NOT_STATED


def test_a_model_of_a_megabyte_comes_back(tmp_path: Path) -> None:
    run = make(model="φ: r·sin(ψ)\r\n" * 80_000)
    assert len(run.model.encode()) > 1 << 20
    path = _written(tmp_path, run)
    assert_same(run, read_hdf5(path))
    with xr.open_dataset(path, engine="h5netcdf") as data:
        assert data.attrs["model"] == run.model


def test_values_that_json_lacks_are_no_obstacle(tmp_path: Path) -> None:
    run = make(
        options={"path": Path("in/data.csv"), "n": np.int64(3), "times": np.array([0.5, 1.0])},
        counts={"steps": np.int64(7)},
        parameters={"m": np.float64(2), "limit": np.inf, "unknown": np.nan},
    )
    back = read_hdf5(_written(tmp_path, run))
    assert back.options == {"path": str(Path("in/data.csv")), "n": 3, "times": [0.5, 1.0]}
    assert back.counts == {"steps": 7}
    assert repr(back.parameters) == "{'m': 2.0, 'limit': inf, 'unknown': nan}"


def test_sparse_constraint_forces_take_little_room(tmp_path: Path) -> None:
    names = tuple(f"c{i}" for i in range(60))
    forces = np.zeros((200, 60, 60))
    forces[:, range(60), range(60)] = np.random.default_rng(1).normal(size=(200, 60))
    run = make(200, names, names, constraint_force_by=forces)
    path = _written(tmp_path, run)
    others = sum(getattr(run, q.name).nbytes for q in QUANTITIES) - forces.nbytes
    assert path.stat().st_size - others < forces.nbytes / 10
    assert_same(run, read_hdf5(path))


@pytest.mark.parametrize("failure", [OSError(errno.ENOSPC, "full"), KeyboardInterrupt()])
def test_hdf5_never_hears_of_a_failure(failure: BaseException) -> None:
    """Old versions of it crash the process."""

    class Disk(io.BytesIO):
        room = 5000

        def write(self, data: Any) -> int:
            self.room -= len(data)
            if self.room < 0:
                raise failure
            return super().write(data)

    sink = Sink(Disk())
    with h5py.File(sink, "w") as root:
        root["x"] = np.arange(10_000.0)
        root["y"] = np.arange(10_000.0)
        root.attrs["z"] = "z" * 100_000
    assert sink.failure is failure


def _cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def _text(path: Path) -> None:
    path.write_text("name: pendulum\n")


def _empty(path: Path) -> None:
    path.write_bytes(b"")


def _missing(path: Path) -> None:
    path.unlink()


def _folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


def _foreign(path: Path) -> None:
    with h5py.File(path, "w") as root:
        root["q"] = [1.0]


def _newer(path: Path) -> None:
    with h5py.File(path, "a") as root:
        root.attrs["schema_version"] = "99"


def _sweep(path: Path) -> None:
    with h5py.File(path, "a") as root:
        root.attrs["kind"] = "sweep"


def _incomplete(path: Path) -> None:
    with h5py.File(path, "a") as root:
        del root["energy_total"]


def _misshapen(path: Path) -> None:
    with h5py.File(path, "a") as root:
        del root["energy_total"]
        root["energy_total"] = [1.0]


def _bad_json(path: Path) -> None:
    with h5py.File(path, "a") as root:
        root.attrs["parameters"] = "{"


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (_cut, "cut short or damaged"),
        (_text, "not an HDF5 file"),
        (_empty, "it is empty"),
        (_missing, "there is no such file"),
        (_folder, "it is a folder"),
        (_foreign, "not one of lagcli"),
        (_newer, "layout has version 99.* knows 1"),
        (_sweep, "holds a sweep and not one trajectory"),
        (_incomplete, "energy_total"),
        (_misshapen, r"energy_total has shape \(1,\), not \(5,\)"),
        (_bad_json, "damaged"),
    ],
)
def test_what_is_no_run_is_said(tmp_path: Path, spoil: Any, reason: str) -> None:
    path = _written(tmp_path, make())
    spoil(path)
    with pytest.raises(FileError, match=reason) as caught:
        read_hdf5(path)
    assert str(path) in str(caught.value)


def test_every_cut_is_noticed(tmp_path: Path) -> None:
    path = _written(tmp_path, make())
    whole = path.read_bytes()
    for size in range(0, len(whole), 97):
        path.write_bytes(whole[:size])
        with pytest.raises(FileError):
            read_hdf5(path)
