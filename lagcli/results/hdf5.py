"""Trajectories in HDF5, laid out so that xarray and plain h5py find axes, units and names."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from types import TracebackType
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from lagcli.errors import FileError
from lagcli.results.atomic import abandon
from lagcli.results.hdf5_file import (
    add_array,
    add_growing,
    add_texts,
    append,
    attach_axes,
    make_axis,
    new_file,
    set_text,
)
from lagcli.results.layout import NOT_STATED, QUANTITIES, unit
from lagcli.results.metadata import (
    KIND,
    MAPPINGS,
    TEXTS,
    WARNINGS,
    from_metadata,
    to_json,
    to_metadata,
)
from lagcli.results.reasons import check_readable
from lagcli.samples import SCHEMA_VERSION, Array, Record, Samples

if TYPE_CHECKING:
    from lagcli.trajectory import Trajectory

#: Bytes of samples that wait to be written together. A run of fewer is written in one piece, which
#: takes the least time and room; a longer one in chunks.
_HELD = 1 << 23

#: Numbers that the chunks of all datasets hold together.
_CHUNK = 1 << 16

# In a long run, and above this many values, an array of which at most a quarter is not zero is
# compressed: a chain of 500 bodies has 250 000 terms of constraint force per sample, and 0.4 % of
# them are not zero.
_LARGE = 1 << 18

#: Bytes of each dataset that are looked at together.
_SLAB = 1 << 23

#: The quantities that have a value at each sample.
_BY_TIME = tuple(quantity for quantity in QUANTITIES if quantity.axes[0] == "time")
_AXES = {quantity.name: quantity.axes for quantity in QUANTITIES}

_OUTPUTS = "outputs/"

#: Attributes that files of earlier versions lack.
_LATER = ("tolerances", "freedom", WARNINGS)


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
    with Hdf5Writer(path, force) as writer:
        writer.append(trajectory)
        writer.finish(trajectory)


class Hdf5Writer:
    """Writes a run to an HDF5 file as its samples come; see `lagcli.results.formats.Writer`.

    Parameters
    ----------
    path : str or path
        The file.
    force : bool
        Replace an existing file.
    """

    def __init__(self, path: str | os.PathLike[str], force: bool = False):
        self._path, self._force = os.fspath(path), force
        self._opened = ExitStack()
        self._root: h5py.File | None = None
        self._held: list[Samples] = []
        self._held_bytes = 0
        self._written = 0  # samples
        self._datasets: dict[str, Any] = {}

    def __enter__(self) -> Hdf5Writer:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        abandon(self._opened, error)

    def append(self, samples: Samples) -> None:
        """Take the next samples."""
        self._held.append(samples)
        self._held_bytes += sum(values.nbytes for values in _columns(samples).values())
        if len(self._held) > 1 and self._held_bytes > _HELD:
            self._write_held(growing=True)

    def finish(self, record: Record) -> None:
        """Write what is still to be written, and give the file its name."""
        if self._held:
            self._write_held(growing=bool(self._written))
        self._describe(record)
        self._opened.close()

    def _begin(self, first: Samples) -> None:
        self._coordinates, self._constraints = first.coordinates, first.constraints
        self._shapes = {name: values.shape[1:] for name, values in _columns(first).items()}
        self._rows = max(1, _CHUNK // sum(map(math.prod, self._shapes.values())))
        self._root, self._sink = self._opened.enter_context(new_file(self._path, self._force))
        # the model's order of outputs, not the alphabet
        self._root.create_group("outputs", track_order=True)

    def _write_held(self, growing: bool) -> None:
        """Write the samples that wait, into datasets that grow or in one piece."""
        if self._root is None:
            self._begin(self._held[0])
        held = [_columns(samples) for samples in self._held]
        for name, shape in self._shapes.items():
            if math.prod(shape) == 0:
                continue  # HDF5 has no chunks without numbers
            values = np.concatenate([columns[name] for columns in held])
            if name not in self._datasets:
                large = growing or values.size > _LARGE
                sparse = large and 4 * int(np.count_nonzero(values)) <= values.size
                if not growing and not sparse:
                    self._datasets[name] = add_array(self._root, name, values)
                    continue
                self._datasets[name] = add_growing(self._root, name, shape, self._rows, sparse)
            append(self._datasets[name], self._written, values)
        self._written += sum(len(samples.time) for samples in self._held)
        self._held, self._held_bytes = [], 0
        self._sink.check()

    def _describe(self, record: Record) -> None:
        """Write everything but the samples."""
        root, datasets = self._root, self._datasets
        assert root is not None
        for name, value in to_metadata(record).items():
            set_text(root["/"].id, name, value if isinstance(value, str) else to_json(value))
        for name, shape in self._shapes.items():
            if name not in datasets:
                datasets[name] = add_array(root, name, np.empty((self._written, *shape)))
        for name in ("scale_position", "scale_velocity"):
            datasets[name] = add_array(root, name, getattr(record, name))

        axes = {
            "time": datasets["time"],
            "coordinate": add_texts(root, "coordinate", self._coordinates),
            "constraint": add_texts(root, "constraint", self._constraints),
        }
        for name, axis in axes.items():
            make_axis(axis, name)
        _say(axes["coordinate"], "names of the coordinates", "none")
        _say(axes["constraint"], "names of the constraints", "none")
        for quantity in QUANTITIES:
            dataset = datasets[quantity.name]
            if quantity.name not in axes:
                attach_axes(dataset, [axes[axis] for axis in quantity.axes])
            _say(dataset, quantity.long_name, unit(quantity, self._coordinates, record.units))

        units = [record.units.get(name, NOT_STATED) for name in self._coordinates]
        if any(u != NOT_STATED for u in units):
            dataset = add_texts(root, "coordinate_unit", units)
            attach_axes(dataset, [axes["coordinate"]])
            _say(dataset, "units of the coordinates", "none")

        for place in self._shapes:
            if place.startswith(_OUTPUTS):
                name = place.removeprefix(_OUTPUTS)
                attach_axes(datasets[place], [axes["time"]])
                _say(datasets[place], name, record.units.get(name, NOT_STATED))


def _columns(samples: Samples) -> dict[str, Array]:
    """Return the datasets that have a value at each sample, by their place in the file."""
    columns = {quantity.name: getattr(samples, quantity.name) for quantity in _BY_TIME}
    return columns | {_OUTPUTS + name: values for name, values in samples.outputs.items()}


def _say(dataset: Any, long_name: str, units: str) -> None:
    """Write the two attributes that every dataset has."""
    set_text(dataset, "long_name", long_name)
    set_text(dataset, "units", units)


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
    with open_hdf5(path) as file:
        return file.trajectory()


@contextmanager
def open_hdf5(path: str | os.PathLike[str]) -> Iterator[Hdf5Reader]:
    """Open an HDF5 file, to look at some of its columns; raises, then and later, as `read_hdf5`."""
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
            yield Hdf5Reader(root)
    except (OSError, RuntimeError, KeyError, ValueError, TypeError, AttributeError) as error:
        # HDF5 reports damage by any of these, depending on where it lies.
        reason = str(error).strip("'\"")
        raise FileError(
            f"cannot read {path}: the file is cut short or damaged ({reason}); "
            "copy it again, or run the simulation again"
        ) from error


class Hdf5Reader:
    """An open file; see `lagcli.results.formats.Reader`. Damage raises whatever HDF5 raises."""

    def __init__(self, root: h5py.File):
        self._root = root
        self.coordinates, self.constraints = (
            tuple(root[name].asstr()[()].tolist()) for name in ("coordinate", "constraint")
        )
        self.outputs = tuple(root["outputs"])
        self._length = {
            "time": root["time"].shape[0],
            "coordinate": len(self.coordinates),
            "constraint": len(self.constraints),
        }
        metadata = {name: root.attrs[name] for name in TEXTS}
        metadata |= {
            name: json.loads(root.attrs[name])
            for name in (*MAPPINGS, WARNINGS)
            if name in root.attrs or name not in _LATER
        }
        self.record = Record(
            scale_position=self._array("scale_position"),
            scale_velocity=self._array("scale_velocity"),
            **from_metadata(metadata),
        )

    def count(self) -> int:
        """Return the number of samples."""
        return int(self._length["time"])

    def columns(self, names: Sequence[str]) -> Iterator[Mapping[str, Array]]:
        """Yield columns of consecutive samples, by name."""
        lengths = self._length
        sizes = [math.prod(lengths[a] for a in _AXES[n][1:]) for n in names if n in _AXES]
        rows = max(1, _SLAB // (8 * max(1, *sizes)))
        for start in range(0, self._length["time"], rows):
            yield {name: self._array(name, slice(start, start + rows)) for name in names}

    def trajectory(self) -> Trajectory:
        """Return all of it."""
        from lagcli.trajectory import Trajectory

        arrays: dict[str, Any] = {q.name: self._array(q.name) for q in _BY_TIME}
        del arrays["constraint_force"]  # the sum of constraint_force_by
        return Trajectory(
            coordinates=self.coordinates,
            constraints=self.constraints,
            outputs={
                name: np.asarray(self._root["outputs"][name][()], dtype=np.float64)
                for name in self.outputs
            },
            **arrays,
            **vars(self.record),
        )

    def _array(self, name: str, rows: slice = slice(None)) -> Array:
        """Return some rows of a quantity, or all, if it has the shape that it should have."""
        dataset = self._root[name]
        axes = ("time",) if name.startswith(_OUTPUTS) else _AXES[name]
        expected = tuple(self._length[axis] for axis in axes)
        if dataset.shape != expected:
            raise ValueError(f"{name} has shape {dataset.shape}, not {expected}")
        return np.asarray(dataset[rows], dtype=np.float64)


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
