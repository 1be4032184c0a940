"""Sweep files: HDF5 with one entry per row along the axis ``run``."""

from __future__ import annotations

import csv
import io
import json
import math
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from copy import copy
from functools import cached_property
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from lagcli.arrays import Array
from lagcli.column_units import shared_unit, unit
from lagcli.errors import FileError
from lagcli.json_schema import check_json
from lagcli.model.model import Model
from lagcli.model.result_units import result_display, result_units
from lagcli.results.atomic import whole_file
from lagcli.results.csv.writer import check_csv_target
from lagcli.results.hdf5.container import add_texts, make_axis, new_file, set_text
from lagcli.results.hdf5.inputs import read_inputs, write_inputs
from lagcli.results.hdf5.opening import Opened, open_verified
from lagcli.results.hdf5.outputs import OutputDatasets, output_families
from lagcli.results.hdf5.structure import numbers, read_texts, text_attribute, texts
from lagcli.results.metadata import (
    DISPLAY,
    NAMES,
    check_described,
    check_model,
    check_times,
    storable,
    to_json,
)
from lagcli.simulations.inputs import input_tables
from lagcli.sweeps.columns import COUNTS, KEPT, KIND, Column, kept_layout
from lagcli.sweeps.row_results import STATUSES, Results, runs_of
from lagcli.trajectory.samples import SCHEMA_VERSION, SIGN_CONVENTION
from lagcli.version import __version__

if TYPE_CHECKING:
    from lagcli.sweeps.validate import PreparedSweep


#: Initial length of messages, and size of a chunk of them, bytes.
_SHORT, _MESSAGES = 64, 1 << 16
#: Number of rows that are read at once.
SLAB = 1 << 14
_OUTPUTS = "outputs/"
#: The axis besides the rows and the times of each array of stored samples; empty if it has none.
_KEPT = {quantity.name: quantity.along for quantity in KEPT}
#: The root attributes that are read: texts, and JSON.
_TEXTS = ("lagcli_version", "model", "model_sha256", "model_path")
_JSON = (
    *("sweep", "parameters", "options", "rows", "failures", "seconds"),
    *("columns", "measures"),
)
#: Attributes that plots use, JSON; older files have none.
_DRAWN = ("units", "display")


def write_sweep(
    path: str,
    prepared: PreparedSweep,
    results: Iterable[Results],
    facts: Mapping[str, Any],
    force: bool,
) -> None:
    """Write a sweep file atomically.

    Parameters
    ----------
    path : str
    prepared : PreparedSweep
    results : iterable of Results
        Results of all rows; later ones of a row replace earlier ones.
    facts : mapping
        Root attributes besides the derived ones; values other than texts are written as JSON.
    force : bool

    Raises
    ------
    FileError
        The file exists and ``force`` is false, or it cannot be written.
    """
    with new_file(path, force) as (root, sink):
        writer = _SweepWriter(root, prepared.spec.plan.length)
        writer.attributes(prepared, facts)
        writer.row_columns(prepared.measures)
        if prepared.spec.keep == "trajectories":
            writer.kept_columns(prepared.model, prepared.times)
        for chunk in results:
            writer.enter(chunk)
            sink.check()
        writer.varied(prepared)
        writer.describe_message()
        sink.check()


class _SweepWriter:
    def __init__(self, root: h5py.File, length: int):
        self.root, self.length = root, length
        self.axis = root.create_dataset("run", (length,), "<i8")
        make_axis(self.axis.id, "run")
        set_text(self.axis.id, "long_name", "index of the row, from 0")
        self.kept: list[tuple[h5py.Dataset, int]] = []

    def attributes(self, prepared: PreparedSweep, facts: Mapping[str, Any]) -> None:
        spec, model = prepared.spec, prepared.model
        values = {
            "kind": KIND,
            "schema_version": SCHEMA_VERSION,
            "lagcli_version": __version__,
            "sign_convention": SIGN_CONVENTION,
            "model": spec.text,
            "model_sha256": model.sha256,
            "model_path": spec.path,
            "parameters": model.declared_values,
            "units": result_units(model),
            "display": {
                **result_display(model),
                "coordinates": model.coordinate_names,
                "constraints": model.constraint_names,
            },
            "sweep": spec.described(),
            "options": prepared.options,
            "columns": [c._asdict() for c in prepared.columns],
            "measures": [c._asdict() for c in prepared.measures],
            **facts,
        }
        write_inputs(self.root, input_tables(model))
        for name, value in values.items():
            set_text(self.root["/"].id, name, value if isinstance(value, str) else to_json(value))

    def add(
        self, name: str, kind: Any, column: tuple[str, str], *axes: h5py.Dataset
    ) -> h5py.Dataset:
        """Create a dataset with a unit and a long name, along ``run`` and other axes."""
        shape = (self.length, *(len(axis) for axis in axes))
        dataset = self.root.create_dataset(name, shape, kind)
        for i, axis in enumerate((self.axis, *axes)):
            dataset.dims[i].attach_scale(axis)
        unit_, said = column
        if unit_:
            set_text(dataset.id, "units", unit_)
        set_text(dataset.id, "long_name", said)
        return dataset

    def add_message(self, length: int) -> None:
        """Create the dataset of messages, with their maximum length in bytes."""
        before = self.root.get("message")
        kind = h5py.string_dtype("utf-8", length)
        rows = max(1, min(self.length, _MESSAGES // length))
        added = self.root.create_dataset(
            "message_longer", (self.length,), kind, chunks=(rows,), compression=1
        )
        # empty texts are stored too: missing data counts as damage
        for start in range(0, self.length, rows):
            part = slice(start, min(start + rows, self.length))
            added[part] = b"" if before is None else before[part]
        if before is not None:
            del self.root["message"]
        self.root.move("message_longer", "message")
        self.message, self.longest = added, length

    def describe_message(self) -> None:
        """Complete the dataset of messages, whose length is only known at the end."""
        self.message.dims[0].attach_scale(self.axis)
        set_text(self.message.id, "long_name", "why the row failed, or notes")
        set_text(self.message.id, "_Encoding", "utf-8")

    def row_columns(self, measures: list[Column]) -> None:
        self.status = self.add("status", "i1", ("", "status of the row"))
        self.status.attrs["flag_values"] = np.arange(3, dtype="i1")
        set_text(self.status.id, "flag_meanings", " ".join(STATUSES[:3]))
        self.add_message(_SHORT)
        self.counts = [self.add(name, "<i8", ("1", f"{name} of the run")) for name in COUNTS]
        self.measures = [self.add(c.dataset, "<f8", (c.unit, c.long_name)) for c in measures]

    def kept_columns(self, model: Model, times: Array) -> None:
        root = self.root
        root.create_group("outputs", track_order=True)
        time = root.create_dataset("time", data=times)
        set_text(time.id, "units", "s")
        set_text(time.id, "long_name", "time")
        scales = {"time": time}
        for name, names in (
            ("coordinate", model.coordinate_names),
            ("constraint", model.constraint_names),
        ):
            scales[name] = h5py.Dataset(add_texts(root, name, names))
        for name, scale in scales.items():
            make_axis(scale.id, name)
        units = result_units(model)
        for quantity, width in kept_layout(model):
            stated = unit(quantity, model.coordinate_names, model.constraint_names, units)
            column = stated, quantity.description
            if width:
                axes = [scales[axis] for axis in quantity.axes]
                added = self.add(quantity.name, "<f8", column, *axes)
                self.kept.append((added, width))
        for family in output_families(model.outputs):
            along = [time]
            if family.axis:
                along.append(h5py.Dataset(add_texts(root["outputs"], family.axis, family.members)))
                make_axis(along[1].id, family.axis)
            column = (
                shared_unit(family.members, units),
                f"output {family.dataset}",
            )
            added = self.add(f"outputs/{family.dataset}", "<f8", column, *along)
            self.kept.append((added, len(family.members)))

    def enter(self, results: Results) -> None:
        """Write the results of some rows."""
        order = np.argsort(results.numbers, kind="stable")
        for places, rows in runs_of(results.numbers[order]):
            mine = order[places]
            self.status[rows] = results.status[mine]
            for i, dataset in enumerate(self.counts):
                dataset[rows] = results.counts[mine, i]
            for i, dataset in enumerate(self.measures):
                dataset[rows] = results.measures[mine, i]
            messages = [storable(results.messages[i]).encode() for i in mine]
            longest = max(map(len, messages), default=0)
            if longest > self.longest:
                self.add_message(max(longest, 2 * self.longest))
            if longest or any(self.message[rows]):
                self.message[rows] = np.array(messages, dtype=self.message.dtype)
            first = 0
            for dataset, width in self.kept:
                values = results.kept[mine, :, first : first + width]
                dataset[rows] = values if dataset.ndim == 3 else values[:, :, 0]
                first += width

    def varied(self, prepared: PreparedSweep) -> None:
        """Write the varied values, which are functions of the plan."""
        datasets = [self.add(c.dataset, "<f8", (c.unit, c.long_name)) for c in prepared.columns]
        for start in range(0, self.length, SLAB):
            numbers = np.arange(start, min(start + SLAB, self.length))
            self.axis[start : start + SLAB] = numbers
            for dataset, values in zip(datasets, prepared.spec.plan.rows(numbers).T, strict=True):
                dataset[start : start + SLAB] = values


class SweepFile:
    """An open sweep file.

    Attributes
    ----------
    length : int
        The number of rows.
    columns, measures : lists of Column
        The varied quantities, and the measures.
    outputs : tuple of str
        The outputs with stored samples.
    facts : dict
        The root attributes; JSON is parsed.
    inputs : dict of str to InputTable
        The tables of the model's inputs.
    root : h5py.File
    """

    def __init__(self, opened: Opened):
        self.root = opened.root
        self.length = len(numbers(self.root, "run", "<i8"))
        self.facts = {name: self._fact(name) for name in self.root.attrs}
        _check_facts(self.facts)
        for name in _DRAWN:
            self.facts.setdefault(name, {})
        check_model(self.facts["model"], self.facts["model_sha256"])
        self.inputs = read_inputs(self.root)
        self.columns, self.measures = (
            [Column(**{name: column[name] for name in Column._fields}) for column in self.facts[x]]
            for x in ("columns", "measures")
        )
        self._varied = {column.dataset for column in self.columns}
        self.kept = "time" in self.root  # whether the samples of each row are stored
        self.outputs: tuple[str, ...] = ()
        if self.kept:
            check_times(self.times)
            self._outputs = OutputDatasets(self.root, lead=2)
            self.outputs = self._outputs.names
        status = self.read("status")
        if ((status < 0) | (status >= len(STATUSES))).any():
            raise ValueError("status has undefined values")

    def again(self, opened: Opened) -> SweepFile:
        """Return the same file, open once more: its attributes have been read and checked."""
        file = copy(self)
        file.root = opened.root
        if file.kept:
            file._outputs = self._outputs.within(opened.root)
        return file

    @cached_property
    def times(self) -> Array:
        """The times of the stored samples, s."""
        return np.asarray(numbers(self.root, "time")[()], dtype=np.float64)

    @property
    def fields(self) -> set[str]:
        """The names of the datasets, without those of outputs."""
        return {name for name in self.root if name != "outputs"}

    def names(self, axis: str) -> tuple[str, ...]:
        """Return the names of the coordinates or constraints."""
        return read_texts(self.root, axis)

    def read(self, dataset: str, rows: int | slice = slice(None)) -> Any:
        """Return some rows of a dataset, or all."""
        if dataset.startswith(_OUTPUTS):
            name = dataset.removeprefix(_OUTPUTS)
            self._check_shape(dataset, self._outputs.shape(name))
            return self._outputs.read(name, rows)
        kind = "i1" if dataset == "status" else "<i8" if dataset in COUNTS else "<f8"
        stored = numbers(self.root, dataset, kind)
        self._check_shape(dataset, stored.shape)
        values = stored[rows]
        if dataset in self._varied and not np.isfinite(values).all():
            raise ValueError(f"{dataset} has varied values that are not finite")
        return values

    def _check_shape(self, name: str, shape: tuple[int, ...]) -> None:
        lengths = [self.length]
        if name.startswith(_OUTPUTS) or name in _KEPT:
            lengths.append(len(self.times))
        if along := _KEPT.get(name):
            lengths.append(len(self.names(along)))
        if list(shape) != lengths:
            raise ValueError(f"{name} has shape {shape}, and not {tuple(lengths)}")

    def messages(self, rows: slice = slice(None)) -> list[str]:
        """Return the messages of some rows, or all."""
        dataset = texts(self.root, "message")
        self._check_shape("message", dataset.shape)
        return [x.decode() for x in dataset[rows].tolist()]

    def results(self) -> Iterator[Results]:
        """Yield the results of all rows, in blocks."""
        names = [c.dataset for c in self.measures]
        kept = self._kept_names()
        slab = SLAB
        if kept:
            per_row = sum(math.prod(numbers(self.root, name).shape[1:]) for name in kept)
            slab = max(1, min(SLAB, (1 << 22) // max(1, per_row)))
        for start in range(0, self.length, slab):
            rows = slice(start, min(start + slab, self.length))
            n = rows.stop - start
            measures = np.empty((n, len(names)))
            for i, name in enumerate(names):
                measures[:, i] = self.read(name, rows)
            samples = np.empty((n, 0, 0))
            if kept:
                parts = [numbers(self.root, name)[rows] for name in kept]
                samples = np.concatenate([x if x.ndim == 3 else x[..., None] for x in parts], 2)
            yield Results(
                np.arange(start, rows.stop),
                self.read("status", rows),
                self.messages(rows),
                np.column_stack([self.read(name, rows) for name in COUNTS]),
                measures,
                samples,
            )

    def _kept_names(self) -> list[str]:
        """Return the datasets of stored trajectories, in order."""
        if not self.kept:
            return []
        outputs = [_OUTPUTS + family.dataset for family in self._outputs.families]
        return [q.name for q in KEPT if q.name in self.root] + outputs

    def _fact(self, name: str) -> Any:
        """Return a root attribute, parsed if it is JSON."""
        text = text_attribute(self.root, name)
        assert text is not None
        return json.loads(text) if name in (*_JSON, *_DRAWN) else text


#: What the attributes have that ``lagcli info --json`` prints in another form.
_TEXT = {"type": "string"}
_TEXTS_BY_NAME = {"type": "object", "additionalProperties": _TEXT}
_COLUMNS = {
    "type": "array",
    "items": {
        "type": "object",
        "required": list(Column._fields),
        "properties": dict.fromkeys(Column._fields, _TEXT),
    },
}
_SCHEMA = {
    "type": "object",
    "required": [*_TEXTS, *_JSON],
    "properties": {
        "model": _TEXT,
        "units": _TEXTS_BY_NAME,
        "display": {
            **DISPLAY,
            "required": ["latex", "definitions", "coordinates", "constraints"],
            "properties": {**DISPLAY["properties"], "coordinates": NAMES, "constraints": NAMES},
        },
        "columns": _COLUMNS,
        "measures": _COLUMNS,
        "sweep": {
            "type": "object",
            "required": ["plan", "set", "set_initial"],
            "properties": {
                "plan": {"type": "object", "required": ["vary", "sample", "zip"]},
                "set": _TEXTS_BY_NAME,
                "set_initial": _TEXTS_BY_NAME,
            },
        },
    },
}


def _check_facts(facts: dict[str, Any]) -> None:
    """Raise ValueError unless the root attributes are those of a sweep."""
    check_json(facts, _SCHEMA, "attributes")
    described = {name: x for name, x in facts.items() if name not in ("columns", "measures")}
    check_described(KIND, described)
    plan = facts["sweep"]["plan"]
    check_described(KIND, {name: plan[name] for name in ("vary", "sample", "zip")})


@contextmanager
def open_sweep(path: str | os.PathLike[str]) -> Iterator[SweepFile]:
    """Open a sweep file for reading.

    Raises
    ------
    FileError
        The file is missing, damaged, or not a sweep.
    """
    path = os.fspath(path)
    with open_verified(path) as opened:
        if opened.kind != KIND:
            raise FileError(
                f"cannot read {path}: it is not a sweep file; name one that lagcli sweep wrote"
            )
        yield SweepFile(opened)


def export_csv(
    path: str | os.PathLike[str], output: str | os.PathLike[str], force: bool = False
) -> None:
    """Write varied values, measures and statuses of a sweep file as CSV.

    Parameters
    ----------
    path : str or path
        A sweep file, ``.h5``.
    output : str or path
        The CSV file; its columns are ``run``, the varied quantities, the measures, ``status`` and
        ``message``. Numbers have 17 digits; NaN is ``nan``.
    force : bool
        Replace an existing file.

    Raises
    ------
    FileError
        One of the files cannot be read or written, or exists already.
    """
    output = os.fspath(output)
    check_csv_target(output, force)
    with open_sweep(path) as file, whole_file(output, force) as target:
        columns = [*file.columns, *file.measures]
        write = csv.writer(text := io.StringIO(), lineterminator="\n").writerow
        write(["run", *(c.dataset for c in columns), "status", "message"])
        for start in range(0, file.length, SLAB):
            rows = slice(start, min(start + SLAB, file.length))
            numbers = [file.read(c.dataset, rows).tolist() for c in columns]
            statuses = [STATUSES[s] for s in file.read("status", rows).tolist()]
            lines = zip(
                range(rows.start, rows.stop), *numbers, statuses, file.messages(rows), strict=True
            )
            for line in lines:
                write(line)
            target.write(text.getvalue().encode())
            text.seek(0)
            text.truncate()
        if not file.length:
            target.write(text.getvalue().encode())
