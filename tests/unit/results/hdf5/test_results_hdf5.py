"""HDF5 files hold a run bit for bit, and open in other programs as they are."""

from __future__ import annotations

import dataclasses
import errno
import io
import json
import tempfile
import time
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array
from trajectories import MODEL, assert_same, make, random_trajectories

import lagcli
from lagcli.cli.app import run as run_command
from lagcli.column_units import NOT_STATED
from lagcli.columns import QUANTITIES, SCALARS
from lagcli.errors import FileError, UsageError
from lagcli.results import read, write
from lagcli.results.formats import open_reader
from lagcli.results.hdf5 import seal
from lagcli.results.hdf5.container import Sink, set_text
from lagcli.trajectory.samples import SIGN_CONVENTION, Terms
from lagcli.trajectory.trajectory import Trajectory

# What results.md of the design and the docstring of Trajectory promise, by axes.
LAYOUT = {
    ("time",): " ".join(["time", *(quantity.name for quantity in SCALARS)]),
    ("coordinate",): "coordinate",
    ("constraint",): "constraint scale_position scale_velocity",
    ("time", "coordinate"): "q v a constraint_force",
    ("time", "constraint"): "multipliers residual_position residual_velocity",
    ("time", "term"): "constraint_force_by",
    ("term",): "term term_constraint term_coordinate",
    ("time", "conserved_quantity"): "conserved",
    ("conserved_quantity",): "conserved_quantity",
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
    write(trajectory, folder / "run.h5")
    return folder / "run.h5"


@pytest.mark.parametrize("size", SIZES)
def test_a_run_comes_back(tmp_path: Path, size: str) -> None:
    run = make(**SIZES[size])
    assert_same(run, read(_written(tmp_path, run)))


@settings(deadline=None, max_examples=40)
@given(run=random_trajectories(st.floats()))
def test_any_run_comes_back(run: Trajectory) -> None:
    with tempfile.TemporaryDirectory() as folder:
        assert_same(run, read(_written(Path(folder), run)))


def test_bits_of_nan_and_signed_zero_come_back(tmp_path: Path) -> None:
    odd = np.array([0x7FF8000000000123, 0xFFF8000000000000, 1 << 63, 1, 0x7FF0000000000000])
    run = make(5, energy_total=odd.astype(np.uint64).view(np.float64))
    assert_same(run, read(_written(tmp_path, run)))


@pytest.mark.parametrize("size", SIZES)
def test_every_dataset_has_axes_unit_and_description(tmp_path: Path, size: str) -> None:
    run = make(**SIZES[size])
    with h5py.File(_written(tmp_path, run)) as root:
        expected = {name: axes for axes, names in LAYOUT.items() for name in names.split()}
        expected |= {f"outputs/{name}": ("time",) for name in run.outputs}
        if "phi" in run.coordinates:
            expected["coordinate_unit"] = expected["force_unit"] = ("coordinate",)
        found = {}
        for group in (root, root["outputs"]):
            for name, dataset in group.items():
                if isinstance(dataset, h5py.Dataset):
                    assert isinstance(dataset.attrs["units"], bytes), name
                    assert "vlen" not in repr(dataset.dtype.metadata), name
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
        attributes = {name: value.decode() for name, value in root.attrs.items()}
    assert attributes["status"] == "completed"
    assert attributes["message"] == "reached t_end"
    assert attributes["model"] == MODEL
    assert attributes["model_sha256"] == run.model_sha256
    assert attributes["sign_convention"] == SIGN_CONVENTION
    assert attributes["lagcli_version"] == "0.1.0"
    assert attributes["schema_version"] == "3"
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
            "term": len(run.terms.constraint),
            "conserved_quantity": len(run.conserved_names),
        }
        assert data["constraint_force_by"].dims == ("time", "term")
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
    assert_same(run, read(path))
    with xr.open_dataset(path, engine="h5netcdf", group="outputs") as data:
        np.testing.assert_array_equal(data["constraint"], run.outputs["constraint"])


@pytest.mark.parametrize(
    ("units", "expected"),
    [
        (
            {"phi": "rad", "psi": "rad"},
            {"q": "rad", "v": "rad/s", "a": "rad/s^2", "constraint_force": "N*m"},
        ),
        ({"phi": "kg*m", "psi": "kg*m"}, {"v": "kg*m/s", "constraint_force": "J/(kg*m)"}),
        ({"phi": "", "psi": ""}, {"q": "1", "v": "1/s", "constraint_force": "J"}),
        (
            {"phi": "rad", "psi": "m"},
            {
                **{"q": "see coordinate_unit", "v": "see coordinate_unit"},
                **{"constraint_force": "see force_unit", "constraint_force_by": "see force_unit"},
            },
        ),
        ({}, {"q": NOT_STATED, "v": NOT_STATED, "constraint_force": NOT_STATED}),
    ],
)
def test_units(tmp_path: Path, units: dict[str, str], expected: dict[str, str]) -> None:
    with h5py.File(_written(tmp_path, make(units=units))) as root:
        for name, unit in {**expected, "time": "s", "energy_kinetic": "J"}.items():
            assert root[name].attrs["units"].decode() == unit, name
        assert ("coordinate_unit" in root) == bool(units)
        if units:
            found = [u.decode() for u in root["coordinate_unit"][()]]
            assert found == [u or "1" for u in units.values()]


def test_units_of_outputs(tmp_path: Path) -> None:
    with h5py.File(_written(tmp_path, make())) as root:
        assert root["outputs/rod_force"].attrs["units"] == b"N"
        assert root["outputs/a_first"].attrs["units"].decode() == NOT_STATED


def test_a_model_of_a_megabyte_comes_back(tmp_path: Path) -> None:
    run = make(model="φ: r·sin(ψ)\r\n" * 80_000)
    assert len(run.model.encode()) > 1 << 20
    path = _written(tmp_path, run)
    assert_same(run, read(path))
    with xr.open_dataset(path, engine="h5netcdf") as data:
        assert data.attrs["model"] == run.model


def test_values_that_json_lacks_are_no_obstacle(tmp_path: Path) -> None:
    run = make(
        options={"path": Path("in/data.csv"), "n": np.int64(3), "times": np.array([0.5, 1.0])},
        counts={"steps": np.int64(7)},
        parameters={"m": np.float64(2), "limit": np.inf, "unknown": np.nan},
    )
    back = read(_written(tmp_path, run))
    assert back.options == {"path": str(Path("in/data.csv")), "n": 3, "times": [0.5, 1.0]}
    assert back.counts == {"steps": 7}
    assert repr(back.parameters) == "{'m': 2.0, 'limit': inf, 'unknown': nan}"


def test_outputs_of_a_family_share_a_dataset(tmp_path: Path) -> None:
    members = tuple(f"tension[{i},{j}]" for i in range(3) for j in range(2))
    run = make(outputs=("first", *members, "last"), units=dict.fromkeys(members, "N"))
    path = _written(tmp_path, run)
    assert_same(run, read(path))
    with xr.open_dataset(path, engine="h5netcdf", group="outputs") as data:
        assert list(data.data_vars) == ["first", "tension", "last"]
        assert data["tension"].attrs["units"] == "N"
        found = data["tension"].sel(member_of_tension="tension[2,0]")
        np.testing.assert_array_equal(found, run.outputs["tension[2,0]"])
    with open_reader(path) as file:
        (columns,) = file.columns(["outputs/tension[1,1]", "outputs/last"])
    for name, values in columns.items():
        np.testing.assert_array_equal(values, run.outputs[name.removeprefix("outputs/")])


@pytest.mark.parametrize(
    "outputs", [("e", "e[1]", "e[2]"), ("e[1]", "x", "e[2]"), ("e[1]", "member_of_e"), ("e[1]",)]
)
def test_odd_names_of_outputs(tmp_path: Path, outputs: tuple[str, ...]) -> None:
    run = make(outputs=outputs)
    assert_same(run, read(_written(tmp_path, run)))


def test_many_outputs_take_little_time(tmp_path: Path) -> None:
    """One dataset for each output took over two minutes for these."""
    names = tuple(f"{family}[{i}]" for family in "abcdefghi" for i in range(10_000))
    run = make(2, outputs=names)
    began = time.process_time()
    path = _written(tmp_path, run)
    with open_reader(path) as file:
        assert file.outputs == names
    assert time.process_time() - began < 5


def test_constraint_forces_are_stored_sparse(tmp_path: Path) -> None:
    names = tuple(f"c{i}" for i in range(60))
    terms = Terms.of(((i, i) for i in range(60)), (60, 60))
    run = make(200, names, names, terms=terms)
    path = _written(tmp_path, run)
    assert path.stat().st_size < 1.2 * run.nbytes
    assert_same(run, read(path))
    expected = np.zeros((200, 60))
    expected[:, 7] = run.constraint_force_by[:, 7]
    np.testing.assert_array_equal(run.constraint_force_of("c7"), expected)
    np.testing.assert_array_equal(run.constraint_force, run.constraint_force_by)
    with pytest.raises(UsageError, match="there is no constraint 'x'; the constraints are c0, c1"):
        run.constraint_force_of("x")
    with xr.open_dataset(path, engine="h5netcdf") as data:
        of_one = data["constraint_force_by"].where(data["term_constraint"] == 7, drop=True)
        assert of_one["term"].values.tolist() == ["c7.c7"]
        matrix = csr_array(
            (data["constraint_force_by"][3], (data["term_constraint"], data["term_coordinate"])),
            shape=(60, 60),
        )
        np.testing.assert_array_equal(matrix.sum(axis=0), run.constraint_force[3])


@settings(deadline=None)
@given(
    st.sets(st.tuples(st.integers(0, 3), st.integers(0, 4))),
    st.integers(0, 2**32 - 1),
)
def test_sparse_and_dense_constraint_forces(pairs: set[tuple[int, int]], seed: int) -> None:
    terms = Terms.of(sorted(pairs), (4, 5))
    terms.check()
    values = np.random.default_rng(seed).normal(size=(3, len(pairs)))
    dense = np.zeros((3, 4, 5))
    dense[:, terms.constraint, terms.coordinate] = values
    np.testing.assert_array_equal(terms.total(values), dense.sum(axis=1))
    for i in range(4):
        np.testing.assert_array_equal(terms.dense(values, i), dense[:, i])
        assert terms.acting(i).keys() == {j for k, j in pairs if k == i}
        for j in range(5):
            np.testing.assert_array_equal(terms.column(values, i, j), dense[:, i, j])


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


def _unsealed(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: -seal.LENGTH])


def _other_bit(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[data.index(b"reached t_end")] ^= 1
    path.write_bytes(data)


def _appended(path: Path) -> None:
    with h5py.File(path, "a") as root:
        root.attrs["note"] = "mine"


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (_cut, "cut short"),
        (_text, "not an HDF5 file"),
        (_empty, "it is empty"),
        (_missing, "there is no such file"),
        (_folder, "it is a folder"),
        (_foreign, "the checksum at its end is missing"),
        (_unsealed, "the checksum at its end is missing"),
        (_other_bit, "its checksum does not fit"),
        (_appended, "changed by another program"),
    ],
)
def test_what_is_no_run_is_reported(tmp_path: Path, spoil: Any, reason: str) -> None:
    path = _written(tmp_path, make())
    spoil(path)
    with pytest.raises(FileError, match=reason) as caught:
        read(path)
    assert str(path) in str(caught.value)


def _set(name: str, text: str) -> Any:
    def change(root: h5py.File) -> None:
        del root.attrs[name]
        set_text(root["/"].id, name, text)

    return change


def _replaced(name: str, **new: Any) -> Any:
    def change(root: h5py.File) -> None:
        del root[name]
        if new:
            root.create_dataset(name, **new)

    return change


def _linked(link: Any) -> Any:
    def change(root: h5py.File) -> None:
        root.move("q", "other")
        root["q"] = link

    return change


def _external(root: h5py.File) -> None:
    shape = root["time"].shape
    del root["time"]
    passwords = [("/etc/passwd", 0, h5py.h5f.UNLIMITED)]
    root.create_dataset("time", shape, "<f8", external=passwords)


def _virtual(root: h5py.File) -> None:
    shape = root["q"].shape
    del root["q"]
    layout = h5py.VirtualLayout(shape, "<f8")
    layout[:] = h5py.VirtualSource("/tmp/other.h5", "q", shape)
    root.create_virtual_dataset("q", layout)


def _unknown_attribute(root: h5py.File) -> None:
    del root.attrs["kind"]
    root.attrs["kind"] = ["trajectory", "sweep"]


FORGED: dict[str, tuple[Any, str]] = {
    "newer": (_set("schema_version", "99"), "layout has version 99.* supports 3"),
    "kind": (_set("kind", "sweep"), "contains a sweep, not a trajectory"),
    "kinds": (_unknown_attribute, "attribute kind is not a text"),
    "model": (_set("model", "T: 0"), "does not have the digest model_sha256"),
    "JSON": (_set("parameters", "{"), "damaged"),
    "number": (_set("parameters", '{"m": [1]}'), r"parameters.m: \[1\] is not of type"),
    "count": (_set("counts", '{"steps": true}'), "counts.steps: True is not of type"),
    "list": (_set("options", "[]"), r"options: \[\] is not of type"),
    "start": (_set("initial_correction", '{"x": [1]}'), "initial_correction"),
    "status": (_set("status", "done"), "status: 'done' is not one of"),
    "missing": (_replaced("energy_total"), "energy_total is missing"),
    "shape": (
        _replaced("energy_total", data=np.array([1.0])),
        r"energy_total has shape \(1,\), not \(5,\)",
    ),
    "scalar time": (_replaced("time", data=1.0), "damaged"),
    "time of NaN": (_replaced("time", data=np.full(5, np.nan)), "values that are not finite"),
    "time back": (_replaced("time", data=np.arange(5.0)[::-1]), "time decreases"),
    "strings": (_replaced("q", data=np.full((5, 2), b"1.0")), "q holds .S3 and not float64"),
    "texts": (_replaced("coordinate", data=np.arange(2.0)), "holds float64 and not texts"),
    "heap": (
        _replaced("coordinate", data=["phi", "psi"], dtype=h5py.string_dtype()),
        "holds object and not texts",
    ),
    "large": (_replaced("q", shape=(10**9, 2), dtype="<f8"), "q declares 16000000000 bytes"),
    "soft link": (_linked(h5py.SoftLink("/other")), "q is a soft link"),
    "external link": (_linked(h5py.ExternalLink("/tmp/x.h5", "/q")), "q is an external link"),
    "external storage": (_external, "time lies in another file"),
    "virtual": (_virtual, "q is a view of other datasets"),
    "group": (lambda root: (_replaced("q")(root), root.create_group("q")), "q is not a dataset"),
    "terms": (_replaced("term_coordinate", data=np.array([1, 0], "<i4")), "not in order"),
    "far terms": (_replaced("term_coordinate", data=np.array([1, 9], "<i4")), "do not exist"),
}


@pytest.mark.parametrize("name", FORGED)
def test_a_file_with_a_right_checksum_is_still_checked(tmp_path: Path, name: str) -> None:
    change, reason = FORGED[name]
    path = _written(tmp_path, make())
    with h5py.File(path, "a") as root:
        change(root)
    with path.open("r+b") as file:
        seal.seal(file)
    with pytest.raises(FileError, match=reason) as caught:
        read(path)
    assert str(path) in str(caught.value)


def test_every_command_rejects_a_crafted_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = lagcli.load(Path(__file__).parents[4] / "models" / "slider_crank.yaml")
    path = _written(tmp_path, lagcli.simulate(model, samples=3))
    with h5py.File(path, "a") as root:
        _external(root)
    with path.open("r+b") as file:
        seal.seal(file)
    page = str(tmp_path / "x.html")
    for command in (
        ["info", path],
        ["info", path, "--json"],
        ["plot", path, "-o", str(tmp_path / "x.svg")],
        ["animate", path, "-o", page],
        ["report", path, "-o", page],
    ):
        assert run_command([str(x) for x in command]) == 4, command
        assert "external storage" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [path]


def test_derivatives_are_by_parameters_or_initial_values(tmp_path: Path) -> None:
    model = lagcli.load(Path(__file__).parents[4] / "models" / "slider_crank.yaml")
    run = lagcli.simulate(model, samples=3, sensitivity=["l", "phi'"])
    path = _written(tmp_path, run)
    assert read(path).sensitivity == ("l", "phi'")
    with h5py.File(path, "a") as root:
        values = {k: v for k, v in run.parameters.items() if k != "l"}
        _set("parameters", json.dumps(values))(root)
    with path.open("r+b") as file:
        seal.seal(file)
    with pytest.raises(FileError, match="parameter has l, which parameters has not"):
        read(path)


def test_every_cut_is_noticed(tmp_path: Path) -> None:
    path = _written(tmp_path, make())
    whole = path.read_bytes()
    for size in range(0, len(whole) - seal.LENGTH, 97):
        path.write_bytes(whole[:size])
        with pytest.raises(FileError):
            read(path)
