"""Trajectories in HDF5, laid out so that xarray and plain h5py find axes, units and names."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from typing import Any, BinaryIO

import h5py
import numpy as np

from lagcli.errors import FileError
from lagcli.results.atomic import whole_file
from lagcli.results.layout import NOT_STATED, QUANTITIES, unit
from lagcli.results.metadata import KIND, MAPPINGS, TEXTS, from_metadata, to_json, to_metadata
from lagcli.results.reasons import check_readable
from lagcli.trajectory import SCHEMA_VERSION, Array, Trajectory

_TEXT = h5py.string_dtype("utf-8")

# Above this many values, an array of which at most a quarter is not zero is compressed: a chain
# of 500 bodies has 250 000 terms of constraint force per sample, and 0.4 % of them are not zero.
_LARGE = 1 << 18


def write_hdf5(trajectory: Trajectory, path: str | os.PathLike[str], force: bool = False) -> None:
    """Write a trajectory to an HDF5 file, whole or not at all.

    Parameters
    ----------
    trajectory : Trajectory
        The run; nt, nq, nc and the number of outputs may be 0.
    path : str or path
        The file.
    force : bool
        Replace an existing file.

    Raises
    ------
    FileError
        The file exists and ``force`` is false, or it cannot be written.

    Notes
    -----
    Mappings (parameters, options, counts, …) are JSON in root attributes. Tuples among the
    options come back as lists.
    """
    with whole_file(os.fspath(path), force) as file:
        sink = _Sink(file)
        try:
            # The format of 2008 (HDF5 1.8): its checksums notice damage in all but the numbers.
            with h5py.File(sink, "w", libver="v108") as root:
                _fill(root, trajectory)
        finally:
            if sink.failure is not None:
                raise sink.failure


def read_hdf5(path: str | os.PathLike[str]) -> Trajectory:
    """Read the trajectory of an HDF5 file.

    Parameters
    ----------
    path : str or path
        A file that `write_hdf5` wrote.

    Returns
    -------
    Trajectory
        With the same bits in every array.

    Raises
    ------
    FileError
        The file is missing or unreadable, is not HDF5, is cut short or damaged, or is not a
        trajectory of lagcli in a layout that this version knows.
    """
    path = os.fspath(path)
    check_readable(path)
    if not h5py.is_hdf5(path):
        raise FileError(
            f"cannot read {path}: it is not an HDF5 file; name a result file of lagcli simulate"
        )
    try:
        # A file under its final name is whole and stays so: no lock is needed, and some network
        # file systems have none.
        with h5py.File(path, "r", locking=False) as root:
            _check_origin(path, root)
            return _trajectory(root)
    except (OSError, RuntimeError, KeyError, ValueError, TypeError, AttributeError) as error:
        # HDF5 reports damage by any of these, depending on where it lies.
        reason = str(error).strip("'\"")
        raise FileError(
            f"cannot read {path}: the file is cut short or damaged ({reason}); "
            "copy it again, or run the simulation again"
        ) from error


class _Sink:
    """A binary file for HDF5 that keeps the first failure to itself until HDF5 is done.

    The HDF5 library does not recover when a disk fills up under it (with h5py 3.10 the process
    crashes). So it never hears of it, and what it writes after a failure is dropped.
    """

    def __init__(self, file: BinaryIO):
        self.file = file
        self.failure: BaseException | None = None
        self.position = 0
        self.size = 0

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        self.position = offset + (self.size if whence == os.SEEK_END else 0)
        return self.position

    def tell(self) -> int:
        return self.position

    def read(self, size: int) -> bytes:
        return bytes(self._attempt(lambda: self.file.read(size)) or b"").ljust(size, b"\0")

    def write(self, data: memoryview) -> int:
        self._attempt(lambda: self.file.write(data))
        self.size = max(self.size, self.position + len(data))
        return len(data)

    def truncate(self, size: int) -> int:
        self._attempt(lambda: self.file.truncate(size))
        self.size = size
        return size

    def flush(self) -> None:
        """Leave it to `whole_file`, which syncs once."""

    def _attempt(self, action: Callable[[], Any]) -> Any:
        """Do the action at the position, unless something failed before."""
        if self.failure is None:
            try:
                self.file.seek(self.position)
                return action()
            except BaseException as error:  # Ctrl-C among them
                self.failure = error
        return None


def _fill(root: h5py.File, trajectory: Trajectory) -> None:
    """Write all of a trajectory into an open file."""
    for name, value in to_metadata(trajectory).items():
        root.attrs[name] = value if isinstance(value, str) else to_json(value)
    axes = {}
    for name, values in (
        ("time", trajectory.time),
        ("coordinate", trajectory.coordinates),
        ("constraint", trajectory.constraints),
    ):
        data = np.asarray(values, dtype=np.float64 if name == "time" else _TEXT)
        axes[name] = root.create_dataset(name, data=data)
        axes[name].make_scale(name)
    _describe(axes["coordinate"], "names of the coordinates", "none")
    _describe(axes["constraint"], "names of the constraints", "none")

    for quantity in QUANTITIES:
        dataset = axes.get(quantity.name)
        if dataset is None:
            dataset = _dataset(root, quantity.name, getattr(trajectory, quantity.name))
            for dimension, axis in zip(dataset.dims, quantity.axes, strict=True):
                dimension.attach_scale(axes[axis])
        _describe(dataset, quantity.long_name, unit(quantity, trajectory))

    units = [trajectory.units.get(name, NOT_STATED) for name in trajectory.coordinates]
    if any(u != NOT_STATED for u in units):
        dataset = root.create_dataset("coordinate_unit", data=np.asarray(units, dtype=_TEXT))
        dataset.dims[0].attach_scale(axes["coordinate"])
        _describe(dataset, "units of the coordinates", "none")

    outputs = root.create_group("outputs", track_order=True)  # the model's order, not the alphabet
    for name, values in trajectory.outputs.items():
        dataset = _dataset(outputs, name, values)
        dataset.dims[0].attach_scale(axes["time"])
        _describe(dataset, name, trajectory.units.get(name, NOT_STATED))


def _dataset(group: h5py.Group, name: str, values: Array) -> h5py.Dataset:
    """Write one array, compressed if that is sure to pay."""
    values = np.asarray(values, dtype=np.float64)
    sparse = values.size > _LARGE and np.count_nonzero(values) <= values.size // 4
    how = {"compression": "gzip", "compression_opts": 1, "shuffle": True} if sparse else {}
    return group.create_dataset(name, data=values, **how)


def _describe(dataset: h5py.Dataset, long_name: str, units: str) -> None:
    """Write the two attributes that every dataset has."""
    dataset.attrs["long_name"] = long_name
    dataset.attrs["units"] = units


def _check_origin(path: str, root: h5py.File) -> None:
    """Raise unless the open file is a trajectory in a layout that this version knows."""
    version, kind = root.attrs.get("schema_version"), root.attrs.get("kind")
    if "lagcli_version" not in root.attrs or version is None or kind is None:
        raise FileError(
            f"cannot read {path}: it is an HDF5 file, but not one of lagcli; "
            "name a result file of lagcli simulate"
        )
    if kind != KIND:
        raise FileError(f"cannot read {path}: it holds a {kind} and not one {KIND}")
    if version != SCHEMA_VERSION:
        raise FileError(
            f"cannot read {path}: its layout has version {version}, and this lagcli knows "
            f"{SCHEMA_VERSION}; read it with lagcli {root.attrs['lagcli_version']}"
        )


def _trajectory(root: h5py.File) -> Trajectory:
    """Return the trajectory of an open file; raise whatever HDF5 raises on damage."""
    coordinates, constraints = (
        tuple(root[name].asstr()[()].tolist()) for name in ("coordinate", "constraint")
    )
    length = {
        "time": root["time"].shape[0],
        "coordinate": len(coordinates),
        "constraint": len(constraints),
    }
    arrays: dict[str, Any] = {}
    for quantity in QUANTITIES:
        if quantity.name == "constraint_force":
            continue  # the sum of constraint_force_by
        values = np.asarray(root[quantity.name][()], dtype=np.float64)
        expected = tuple(length[axis] for axis in quantity.axes)
        if values.shape != expected:
            raise ValueError(f"{quantity.name} has shape {values.shape}, not {expected}")
        arrays[quantity.name] = values
    metadata = {name: root.attrs[name] for name in TEXTS}
    metadata |= {name: json.loads(root.attrs[name]) for name in MAPPINGS}
    return Trajectory(
        coordinates=coordinates,
        constraints=constraints,
        outputs={n: np.asarray(d[()], dtype=np.float64) for n, d in root["outputs"].items()},
        **arrays,
        **from_metadata(metadata),
    )
