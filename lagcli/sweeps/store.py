"""Sweep files: HDF5 with one entry per row along the axis ``run``; written whole, and read."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from lagcli.errors import FileError
from lagcli.model.model import Model
from lagcli.results.hdf5_file import make_axis, new_file
from lagcli.results.layout import QUANTITIES, unit
from lagcli.results.reasons import check_readable
from lagcli.samples import SIGN_CONVENTION
from lagcli.sweeps.layout import COUNTS, KIND, SCHEMA_VERSION, Column, kept_layout
from lagcli.sweeps.ledger import runs_of
from lagcli.sweeps.rows import STATUSES, Results
from lagcli.sweeps.spec import Spec
from lagcli.version import __version__

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

_TEXT = h5py.string_dtype("utf-8")
_QUANTITIES = {q.name: q for q in QUANTITIES}
#: Rows that are looked at together.
SLAB = 1 << 14


def write_sweep(
    path: str,
    spec: Spec,
    model: Model,
    times: Array,
    columns: list[Column],
    measures: list[Column],
    results: Iterable[Results],
    facts: Mapping[str, Any],
    force: bool = False,
) -> None:
    """Write a sweep file, whole or not at all.

    Parameters
    ----------
    path : str
    spec : Spec
    model : Model
        With the values that no row changes.
    times : (nt,) array
        Of kept samples, s.
    columns, measures : lists of Column
    results : iterable of Results
        Of all rows; later ones of a row replace earlier ones.
    facts : mapping
        Root attributes beside those that follow from the others; what is no text is JSON.
    force : bool

    Raises
    ------
    FileError
        The file exists and ``force`` is false, or it cannot be written.
    """
    with new_file(path, force) as (root, sink):
        writer = _Writer(root, spec.plan.length)
        writer.attributes(spec, model, columns, measures, facts)
        writer.row_columns(measures)
        if spec.keep == "trajectories":
            writer.kept_columns(model, times)
        for found in results:
            writer.enter(found)
            sink.check()
        writer.varied(spec, columns)
        sink.check()


class _Writer:
    def __init__(self, root: h5py.File, length: int):
        self.root, self.length = root, length
        self.axis = root.create_dataset("run", (length,), "<i8")
        make_axis(self.axis.id, "run")
        self.axis.attrs["long_name"] = "number of the row, from 0"
        self.kept: list[tuple[h5py.Dataset, int]] = []

    def attributes(
        self,
        spec: Spec,
        model: Model,
        columns: list[Column],
        measures: list[Column],
        facts: Mapping[str, Any],
    ) -> None:
        values = {
            "kind": KIND,
            "schema_version": SCHEMA_VERSION,
            "lagcli_version": __version__,
            "sign_convention": SIGN_CONVENTION,
            "model": spec.text,
            "model_sha256": model.sha256,
            "model_path": spec.path,
            "parameters": model.parameter_values,
            "sweep": spec.described(),
            "columns": [c.as_json() for c in columns],
            "measures": [c.as_json() for c in measures],
            **facts,
        }
        for name, value in values.items():
            self.root.attrs[name] = value if isinstance(value, str) else json.dumps(value)

    def add(
        self, name: str, kind: Any, column: tuple[str, str], *axes: h5py.Dataset
    ) -> h5py.Dataset:
        """Make a dataset with a unit and a long name, along ``run`` and other axes."""
        shape = (self.length, *(len(axis) for axis in axes))
        dataset = self.root.create_dataset(name, shape, kind)
        for i, axis in enumerate((self.axis, *axes)):
            dataset.dims[i].attach_scale(axis)
        unit_, said = column
        if unit_:
            dataset.attrs["units"] = unit_
        dataset.attrs["long_name"] = said
        return dataset

    def row_columns(self, measures: list[Column]) -> None:
        self.status = self.add("status", "i1", ("", "what became of the row"))
        self.status.attrs["flag_values"] = np.arange(3, dtype="i1")
        self.status.attrs["flag_meanings"] = " ".join(STATUSES[:3])
        self.message = self.add("message", _TEXT, ("", "why the row failed, or what was noticed"))
        self.counts = [self.add(name, "<i8", ("1", f"{name} of the run")) for name in COUNTS]
        self.measures = [self.add(c.dataset, "<f8", (c.unit, c.long_name)) for c in measures]

    def kept_columns(self, model: Model, times: Array) -> None:
        root = self.root
        root.create_group("outputs", track_order=True)
        time = root.create_dataset("time", data=times)
        time.attrs["units"], time.attrs["long_name"] = "s", "time"
        scales = {"time": time}
        for name, names in (
            ("coordinate", model.coordinate_names),
            ("constraint", model.constraint_names),
        ):
            scales[name] = root.create_dataset(name, data=np.asarray(names, dtype=_TEXT))
        for name, scale in scales.items():
            make_axis(scale.id, name)
        units = {c.name: c.unit for c in model.coordinates if c.unit}
        for name, axes, width in kept_layout(model):
            if name.startswith("outputs/"):
                said = name.removeprefix("outputs/"), model.output_units.get(name[8:], "")
                column = (said[1] or "not stated", f"output {said[0]}")
            else:
                quantity = _QUANTITIES[name]
                column = unit(quantity, model.coordinate_names, units), quantity.long_name
            if width:
                added = self.add(name, "<f8", column, *(scales[axis] for axis in axes))
                self.kept.append((added, width))

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
            messages = [results.messages[i] for i in mine]
            if any(messages) or any(self.message[rows]):
                self.message[rows] = messages
            first = 0
            for dataset, width in self.kept:
                values = results.kept[mine, :, first : first + width]
                dataset[rows] = values if dataset.ndim == 3 else values[:, :, 0]
                first += width

    def varied(self, spec: Spec, columns: list[Column]) -> None:
        """Write the varied values, which are functions of the plan."""
        datasets = [self.add(c.dataset, "<f8", (c.unit, c.long_name)) for c in columns]
        for start in range(0, self.length, SLAB):
            numbers = np.arange(start, min(start + SLAB, self.length))
            self.axis[start : start + SLAB] = numbers
            for dataset, values in zip(datasets, spec.plan.rows(numbers).T, strict=True):
                dataset[start : start + SLAB] = values


class SweepFile:
    """An open sweep file.

    Attributes
    ----------
    length : int
        The number of rows.
    columns, measures : lists of Column
        The varied quantities, and the measures.
    facts : dict
        The root attributes; what is JSON is read.
    root : h5py.File
    """

    def __init__(self, root: h5py.File):
        self.root = root
        self.length = len(root["run"])
        self.facts = {name: _value(value) for name, value in root.attrs.items()}
        self.columns = [Column(**x) for x in self.facts["columns"]]
        self.measures = [Column(**x) for x in self.facts["measures"]]

    @property
    def kept(self) -> bool:
        """Whether the samples of each row are there."""
        return "time" in self.root

    def read(self, dataset: str, rows: slice = slice(None)) -> Any:
        """Return some rows of a dataset, or all."""
        return self.root[dataset][rows]

    def messages(self, rows: slice = slice(None)) -> list[str]:
        """Return the messages of some rows, or all."""
        return [x.decode() for x in self.root["message"][rows].tolist()]

    def results(self) -> Iterator[Results]:
        """Yield the results of all rows, some at a time."""
        names = [c.dataset for c in self.measures]
        kept = [name for name in _kept_names(self.root) if self.kept]
        per_row = sum(int(np.prod(self.root[name].shape[1:])) for name in kept)
        slab = max(1, min(SLAB, (1 << 22) // max(1, per_row)))
        for start in range(0, self.length, slab):
            rows = slice(start, min(start + slab, self.length))
            n = rows.stop - start
            measures = np.empty((n, len(names)))
            for i, name in enumerate(names):
                measures[:, i] = self.read(name, rows)
            samples = np.empty((n, 0, 0))
            if kept:
                parts = [self.read(name, rows) for name in kept]
                samples = np.concatenate([x if x.ndim == 3 else x[..., None] for x in parts], 2)
            yield Results(
                np.arange(start, rows.stop),
                self.read("status", rows),
                self.messages(rows),
                np.column_stack([self.read(name, rows) for name in COUNTS]),
                measures,
                samples,
            )


def _kept_names(root: h5py.File) -> list[str]:
    """Return the datasets of kept trajectories, in their order."""
    names = ["q", "v", "a", "multipliers", "constraint_force"]
    names += ["energy_kinetic", "energy_potential", "energy_total", "energy_balance"]
    outputs = [f"outputs/{name}" for name in root.get("outputs", ())]
    return [name for name in names if name in root] + outputs


def _value(value: Any) -> Any:
    if not isinstance(value, str) or value[:1] not in ("{", "["):
        return value
    try:
        return json.loads(value)
    except ValueError:
        return value  # the model's text may begin with a brace


@contextmanager
def open_sweep(path: str | os.PathLike[str]) -> Iterator[SweepFile]:
    """Open a sweep file for reading.

    Raises
    ------
    FileError
        The file is missing, damaged, or not a sweep.
    """
    path = os.fspath(path)
    check_readable(path)
    if not is_sweep(path):
        raise FileError(f"cannot read {path}: it is no sweep file; name one of lagcli sweep")
    try:
        with h5py.File(path, "r", locking=False) as root:
            version = root.attrs.get("schema_version")
            if version != SCHEMA_VERSION:
                raise FileError(
                    f"cannot read {path}: its layout has version {version}, and this lagcli knows"
                    f" {SCHEMA_VERSION}; read it with lagcli {root.attrs.get('lagcli_version')}"
                )
            yield SweepFile(root)
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
        reason = str(error).strip("'\"")
        raise FileError(
            f"cannot read {path}: the file is cut short or damaged ({reason}); copy it again, or"
            " run the sweep again"
        ) from error


def is_sweep(path: str) -> bool:
    """Return whether a file is a sweep file, as far as its beginning says."""
    try:
        if not h5py.is_hdf5(path):
            return False
        with h5py.File(path, "r", locking=False) as root:
            return bool(root.attrs.get("kind") == KIND)
    except OSError:
        return False
