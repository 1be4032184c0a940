"""Trajectories in HDF5, with axes, units and names for xarray and plain h5py."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from lagcli.arrays import Array
from lagcli.column_units import NOT_STATED, UNIT_DATASETS, shared_unit, unit, units_along
from lagcli.columns import ARRAYS, BY_NAME, DERIVATIVES, QUANTITIES, SAMPLED
from lagcli.errors import FileError
from lagcli.results.atomic import FileWriter, check_writable
from lagcli.results.hdf5.container import (
    add_array,
    add_growing,
    add_indices,
    add_texts,
    append,
    attach_axes,
    make_axis,
    new_file,
    set_text,
)
from lagcli.results.hdf5.outputs import OutputDatasets, OutputFamily, output_families
from lagcli.results.hdf5.structure import numbers, read_quantity, read_texts, text_attribute
from lagcli.results.metadata import (
    KIND,
    MAPPINGS,
    TEXTS,
    WARNINGS,
    check_times,
    from_metadata,
    to_json,
    to_metadata,
)
from lagcli.trajectory.samples import InputTable, Record, Samples, Terms

if TYPE_CHECKING:
    from lagcli.results.hdf5.opening import Opened
    from lagcli.trajectory.event_log import EventLog
    from lagcli.trajectory.trajectory import Trajectory

#: Size of the buffer of samples, bytes. A shorter run is written at once, which is fastest and
#: smallest; a longer one in chunks.
_HELD = 1 << 23

#: Total number of values in the chunks of all datasets.
_CHUNK = 1 << 19

# In a long run, and above this number of values, an array with at most a quarter of nonzeros is
# compressed: columns such as the power of forces that a model does not have.
_LARGE = 1 << 18

#: Number of bytes of each dataset that are read at once.
_SLAB = 1 << 23

_OUTPUTS = "outputs/"
_PARAMETER = "parameter"

#: The group of the event log.
_EVENTS = "events"

#: The axis of the conserved quantities.
_CONSERVED = "conserved_quantity"


def check_hdf5_target(path: str, force: bool = False, meta: bool = False) -> None:
    """Raise FileError if `Hdf5Writer` could not write there now."""
    check_writable(path, force)


class Hdf5Writer(FileWriter):
    """Writes a run to an HDF5 file during the run; see `lagcli.results.formats.Writer`.

    Parameters
    ----------
    path : str
        The file.
    force : bool
        Replace an existing file.
    meta : bool
        Has no effect: the file always contains the record of the run.

    Notes
    -----
    Mappings (parameters, options, counts, …) are JSON in root attributes. Tuples among the options
    are read as lists.
    """

    def __init__(self, path: str, force: bool = False, meta: bool = False):
        super().__init__()
        self._path, self._force = path, force
        self._root: h5py.File | None = None
        self._held: list[Samples] = []
        self._held_bytes = 0
        self._written = 0  # samples
        self._datasets: dict[str, Any] = {}

    def append(self, samples: Samples) -> None:
        """Write the next samples."""
        self._held.append(samples)
        self._held_bytes += samples.nbytes
        if len(self._held) > 1 and self._held_bytes > _HELD:
            self._write_held(growing=True)

    def finish(self, record: Record) -> None:
        """Write the remaining data, and give the file its name."""
        if self._held:
            self._write_held(growing=bool(self._written))
        self._describe(record)
        self.opened.close()

    def _begin(self, first: Samples) -> None:
        self._coordinates, self._constraints = first.coordinates, first.constraints
        self._conserved = first.conserved_names
        self._terms, self._families = first.terms, output_families(first.outputs)
        self._parameters = first.sensitivity
        columns = _columns(first, self._families)
        self._shapes = {name: values.shape[1:] for name, values in columns.items()}
        self._rows = max(1, _CHUNK // sum(map(math.prod, self._shapes.values())))
        self._root, self._sink = self.opened.enter_context(new_file(self._path, self._force))
        # the model's order of outputs, not the alphabet
        self._root.create_group("outputs", track_order=True)

    def _write_held(self, growing: bool) -> None:
        """Write the buffered samples, to resizable datasets or at once."""
        if self._root is None:
            self._begin(self._held[0])
        held = [_columns(samples, self._families) for samples in self._held]
        for name, shape in self._shapes.items():
            if math.prod(shape) == 0:
                continue  # HDF5 has no empty chunks
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
        if record.inputs:
            from lagcli.results.hdf5.inputs import write_inputs

            write_inputs(root, record.inputs)
        for name, shape in self._shapes.items():
            if name not in datasets:
                datasets[name] = add_array(root, name, np.empty((self._written, *shape)))
        for name in ("scale_position", "scale_velocity"):
            datasets[name] = add_array(root, name, getattr(record, name))

        terms = self._terms
        names = terms.names(self._coordinates, self._constraints)
        axes = {
            "time": datasets["time"],
            "coordinate": add_texts(root, "coordinate", self._coordinates),
            "constraint": add_texts(root, "constraint", self._constraints),
            "term": add_texts(root, "term", list(map(".".join, names))),
            _CONSERVED: add_texts(root, _CONSERVED, self._conserved),
        }
        if self._parameters:
            axes[_PARAMETER] = add_texts(root, _PARAMETER, self._parameters)
            _say(axes[_PARAMETER], "parameters and initial values of the derivatives", "none")
        for name, axis in axes.items():
            make_axis(axis, name)
        _say(axes["coordinate"], "names of the coordinates", "none")
        _say(axes["constraint"], "names of the constraints", "none")
        _say(axes["term"], "constraint and coordinate of each constraint_force_by", "none")
        _say(axes[_CONSERVED], "names of the conserved quantities", "none")
        for name, places in (("constraint", terms.constraint), ("coordinate", terms.coordinate)):
            dataset = add_indices(root, f"term_{name}", places)
            attach_axes(dataset, [axes["term"]])
            _say(dataset, f"number of the {name} of each term, from 0", "1")
        both = (self._coordinates, self._constraints)
        for quantity in QUANTITIES:
            dataset = datasets[quantity.name]
            if quantity.name not in axes:
                attach_axes(dataset, [axes[axis] for axis in quantity.axes])
            stated = unit(quantity, *both, record.units, self._conserved)
            _say(dataset, quantity.description, stated)

        for quantity in DERIVATIVES if self._parameters else ():
            attach_axes(datasets[quantity.name], [axes[axis] for axis in quantity.axes])
            _say(datasets[quantity.name], quantity.description, quantity.unit)

        for name, axis, array in UNIT_DATASETS:
            quantity = BY_NAME[array]
            units = units_along(quantity, *both, record.units, self._conserved)
            if any(units):
                dataset = add_texts(root, name, [u or NOT_STATED for u in units])
                attach_axes(dataset, [axes[axis]])
                _say(dataset, f"units of the {quantity.description}", "none")

        if record.events is not None:
            from lagcli.results.hdf5.event_group import write_events

            write_events(root, record.events, root["time"][()], axes)

        for family in self._families:
            dataset, along = datasets[_OUTPUTS + family.dataset], [axes["time"]]
            if family.axis:
                along.append(add_texts(root["outputs"], family.axis, family.members))
                make_axis(along[1], family.axis)
                _say(along[1], f"names of the members of {family.dataset}", "none")
            attach_axes(dataset, along)
            _say(dataset, family.dataset, shared_unit(family.members, record.units))


def _columns(samples: Samples, families: Sequence[OutputFamily]) -> dict[str, Array]:
    """Return the datasets with a value at each sample, by their path in the file."""
    sampled = (*SAMPLED, *(DERIVATIVES if samples.sensitivity else ()))
    columns = {quantity.name: getattr(samples, quantity.name) for quantity in sampled}
    for family in families:
        values = [samples.outputs[name] for name in family.members]
        together = np.stack(values, axis=1) if family.axis else values[0]
        columns[_OUTPUTS + family.dataset] = together
    return columns


def _say(dataset: Any, long_name: str, units: str) -> None:
    """Write the two attributes of every dataset."""
    set_text(dataset, "long_name", long_name)
    set_text(dataset, "units", units)


@contextmanager
def open_hdf5(path: str) -> Iterator[Hdf5Reader]:
    """Open an HDF5 file; raises the errors of `lagcli.results.formats.read`, also later."""
    from lagcli.results.hdf5.opening import not_of_lagcli, open_verified

    with open_verified(path) as opened:
        if opened.kind != KIND:
            if not opened.kind:
                raise not_of_lagcli(path)
            what = f"a {opened.kind}"
            if "content" in opened.root.attrs:  # an analysis file
                what = f"the result of lagcli {opened.kind}"
            raise FileError(
                f"cannot read {path}: it contains {what}, not a {KIND}; `lagcli info {path}`"
                " describes it, and in Python lagcli.open reads it"
            )
        yield Hdf5Reader(opened)


class Hdf5Reader:
    """An open file; see `lagcli.results.formats.Reader`. Damage raises the errors of HDF5.

    A column that is missing in the file and not in `lagcli.columns.REQUIRED` is NaN.
    """

    def __init__(self, opened: Opened):
        self._root = opened.root
        self.coordinates, self.constraints = (
            read_texts(self._root, name) for name in ("coordinate", "constraint")
        )
        # older files have none
        self.conserved_names = (
            read_texts(self._root, _CONSERVED) if _CONSERVED in self._root else ()
        )
        self._outputs = OutputDatasets(self._root, lead=1)
        self.outputs = self._outputs.names
        self.sensitivity = read_texts(self._root, _PARAMETER) if _PARAMETER in self._root else ()
        self._length = {
            "time": numbers(self._root, "time").shape[0],
            "coordinate": len(self.coordinates),
            "constraint": len(self.constraints),
            _CONSERVED: len(self.conserved_names),
            _PARAMETER: len(self.sensitivity),
        }
        check_times(self._array("time"))
        self.terms = self._read_terms()
        self._length["term"] = len(self.terms.constraint)
        metadata: dict[str, Any] = {n: text_attribute(self._root, n) for n in TEXTS}
        for name in (*MAPPINGS, WARNINGS):
            text = text_attribute(self._root, name)
            if text is not None:
                metadata[name] = json.loads(text)
        self.record = Record(
            scale_position=self._array("scale_position"),
            scale_velocity=self._array("scale_velocity"),
            inputs=self._read_inputs(),
            events=self._read_events(),
            **from_metadata(metadata),
        )
        rates = (f"{q}'" for q in self.coordinates)
        known = {*self.record.parameters, *self.coordinates, *rates}
        if unknown := [name for name in self.sensitivity if name not in known]:
            raise ValueError(f"{_PARAMETER} has {unknown[0]}, which parameters has not")

    def _read_inputs(self) -> dict[str, InputTable]:
        from lagcli.results.hdf5.inputs import read_inputs

        return read_inputs(self._root)

    def _read_events(self) -> EventLog | None:
        if _EVENTS not in self._root:
            return None
        from lagcli.results.hdf5.event_group import read_events

        counts = len(self.coordinates), len(self.constraints)
        return read_events(self._root, *counts, self.sensitivity)

    def _read_terms(self) -> Terms:
        constraint, coordinate = (
            np.asarray(numbers(self._root, f"term_{name}", "<i4")[()], dtype=np.intp)
            for name in ("constraint", "coordinate")
        )
        terms = Terms(constraint, coordinate, (len(self.constraints), len(self.coordinates)))
        terms.check()
        return terms

    def count(self) -> int:
        """Return the number of samples."""
        return int(self._length["time"])

    def columns(self, names: Sequence[str]) -> Iterator[Mapping[str, Array]]:
        """Yield columns of consecutive samples, by name."""
        lengths = self._length
        sizes = [math.prod(lengths[a] for a in ARRAYS[n].axes[1:]) for n in names if n in ARRAYS]
        rows = max(1, _SLAB // (8 * max([1, *sizes])))
        for start in range(0, self._length["time"], rows):
            yield {name: self._array(name, slice(start, start + rows)) for name in names}

    def trajectory(self) -> Trajectory:
        """Return the whole trajectory."""
        from lagcli.trajectory.trajectory import Trajectory

        arrays: dict[str, Any] = {q.name: self._array(q.name) for q in SAMPLED}
        del arrays["constraint_force"]  # the sum of constraint_force_by
        if self.sensitivity:
            arrays |= {q.name: self._array(q.name) for q in DERIVATIVES}
        return Trajectory(
            coordinates=self.coordinates,
            constraints=self.constraints,
            terms=self.terms,
            conserved_names=self.conserved_names,
            outputs=self._outputs.all(self._length["time"]),
            sensitivity=self.sensitivity,
            **arrays,
            **vars(self.record),
        )

    def _array(self, name: str, rows: slice = slice(None)) -> Array:
        """Return some rows of a quantity, or all, if it has the expected shape."""
        if name.startswith(_OUTPUTS):
            output = name.removeprefix(_OUTPUTS)
            if (shape := self._outputs.shape(output)) != (self._length["time"],):
                raise ValueError(f"{name} has shape {shape}, not {(self._length['time'],)}")
            return self._outputs.read(output, rows)
        return read_quantity(self._root, ARRAYS[name], self._length, rows)
