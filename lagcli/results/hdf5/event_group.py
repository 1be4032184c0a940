"""The event log of a run in HDF5: the group ``events``, absent without contacts and events."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import h5py
import numpy as np
from h5py import h5d

from lagcli.arrays import Array, Indices
from lagcli.results.hdf5.container import (
    add_array,
    add_indices,
    add_texts,
    attach_axes,
    make_axis,
    set_text,
)
from lagcli.results.hdf5.structure import group, numbers, read_texts
from lagcli.sparse_table import SparseTable
from lagcli.trajectory.event_log import MODES, NOTHING_RECORDED, EventLog, EventRecords

GROUP, _DTIME = "events", "dtime"
_MODES = ", ".join(f"{number} {name}" for number, name in enumerate(MODES))

#: Numerical arrays: dataset, field of `EventLog`, axis after that of events, description, unit.
_ARRAYS = (
    ("time", "time", "", "times of contacts and events", "s"),
    ("q", "q", "coordinate", "coordinates there", "those of the coordinates"),
    ("velocity_before", "before", "coordinate", "velocities before", "per second"),
    ("velocity_after", "after", "coordinate", "velocities after", "per second"),
    ("loss", "loss", "", "energy that the impulse of the row takes", "J"),
    ("supplied", "supplied", "", "energy that moving constraints supply", "J"),
    ("work", "work", "", "work of the event's actions", "J"),
)


def write_events(
    root: h5py.Group, log: EventLog, time: Array, axes: Mapping[str, h5d.DatasetID]
) -> None:
    """Write a log, and the modes at each sample derived from it.

    Parameters
    ----------
    root : h5py.Group
        Root group of the file.
    log : EventLog
    time : (nt,) array
        Times of the samples, s.
    axes : mapping of str to dataset
        Axes of the file: ``time``, ``coordinate``, ``constraint``, and ``parameter`` if it exists.
    """
    place = root.create_group(GROUP)

    def described(dataset: Any, along: list[Any], what: str, unit: str) -> None:
        attach_axes(dataset, along)
        set_text(dataset, "long_name", what)
        set_text(dataset, "units", unit)

    datasets = {name: add_array(place, name, getattr(log, f)) for name, f, *_ in _ARRAYS}
    event, row = datasets["time"], add_texts(place, "row", log.rows)
    make_axis(event, "event")
    make_axis(row, "row")
    described(row, [], "names of the constraints that switch", "none")
    for name, _, axis, what, unit in _ARRAYS:
        along = [] if name == "time" else [event, *([axes[axis]] if axis else [])]
        described(datasets[name], along, what, unit)
    for name, texts, what in (
        ("name", log.names, "constraints and events to which something happened"),
        ("kind", log.kinds, "what happened"),
    ):
        described(add_texts(place, name, texts), [event], what, "none")
    for name, modes, along in (
        ("mode_at_start", log.start, [row]),
        ("mode", log.modes_at(time), [axes["time"], row]),
    ):
        described(add_indices(place, name, modes), along, f"modes of the rows: {_MODES}", "1")

    _write_sparse(
        place, "change", "row", log.mode_changes, add_indices, f"new modes: {_MODES}", "1"
    )
    _write_sparse(
        *(place, "impulse", "constraint", log.nonzero_impulses, add_array),
        *("impulses of constraints other than 0", "J*s per unit"),
    )
    if log.parameters:
        slopes = add_array(place, _DTIME, log.dtime)
        described(slopes, [event, axes["parameter"]], "derivatives of the times", "s per unit")
    if log.records.columns:
        _write_records(place, log)


def _write_sparse(
    place: h5py.Group,
    name: str,
    column: str,
    rows: SparseTable,
    add: Callable[[h5py.Group, str, Any], h5d.DatasetID],
    what: str,
    unit: str,
) -> None:
    """Write ``NAME``, the numbers, and ``NAME_entry`` and ``NAME_COLUMN``, their places."""
    entry = add_indices(place, f"{name}_entry", rows.row)
    make_axis(entry, name)
    for dataset, title, of in (
        (entry, "number of the entry, from 0", "1"),
        (add_indices(place, f"{name}_{column}", rows.column), f"number of the {column}", "1"),
        (add(place, name, rows.value), what, unit),
    ):
        set_text(dataset, "long_name", title)
        set_text(dataset, "units", of)
        if dataset is not entry:
            attach_axes(dataset, [entry])


def _write_records(place: h5py.Group, log: EventLog) -> None:
    """Write the columns recorded by events."""
    records = log.records
    column = add_texts(place, "column", records.columns)
    entry = add_indices(place, "recorded_entry", records.entry)
    make_axis(column, "column")
    make_axis(entry, "recorded")
    for dataset, what, unit in (
        (column, "columns that events record", "none"),
        (entry, "number of the entry that records, from 0", "1"),
        *(
            (add_array(place, f"recorded_{side}", getattr(records, side)), what, "those of columns")
            for side, what in (
                ("before", "columns right before the event"),
                ("after", "columns right after the event"),
            )
        ),
    ):
        set_text(dataset, "long_name", what)
        set_text(dataset, "units", unit)
        if dataset not in (column, entry):
            attach_axes(dataset, [entry, column])


def read_events(
    root: h5py.Group, coordinates: int, constraints: int, parameters: tuple[str, ...] = ()
) -> EventLog:
    """Return the log of a file with given numbers of coordinates and constraints.

    ``parameters`` are those of the derivatives.

    Raises
    ------
    ValueError
        The group is not a log.
    """
    place = group(root, GROUP)
    rows, names, kinds = (read_texts(place, name) for name in ("row", "name", "kind"))
    count = len(names)
    width = {"": (), "coordinate": (coordinates,)}
    arrays: dict[str, Any] = {}
    for name, field, axis, *_ in _ARRAYS:
        dataset, shape = numbers(place, name), (count, *width[axis])
        if dataset.shape != shape:
            raise ValueError(f"{GROUP}/{name} has shape {dataset.shape}, not {shape}")
        arrays[field] = np.asarray(dataset[()], dtype=np.float64)
    if len(kinds) != count:
        raise ValueError(f"{GROUP} has {count} names and {len(kinds)} kinds")
    log = EventLog(
        rows=rows,
        start=_modes(place, "mode_at_start", (len(rows),)),
        names=names,
        kinds=kinds,
        mode_changes=_sparse(place, "change", "row", (count, len(rows)), "<i4"),
        nonzero_impulses=_sparse(place, "impulse", "constraint", (count, constraints), "<f8"),
        records=_records(place) if "column" in place else NOTHING_RECORDED,
        parameters=parameters if _DTIME in place else (),
        dtime=numbers(place, _DTIME)[()] if _DTIME in place else np.empty((0, 0)),
        **arrays,
    )
    log.check()
    return log


def _records(place: h5py.Group) -> EventRecords:
    columns = read_texts(place, "column")
    entry = np.asarray(numbers(place, "recorded_entry", "<i4")[()], dtype=np.intp)
    sides = {}
    for side in ("before", "after"):
        dataset = numbers(place, f"recorded_{side}")
        if dataset.shape != (*entry.shape, len(columns)):
            raise ValueError(f"{GROUP}/recorded_{side} has shape {dataset.shape}")
        sides[side] = np.asarray(dataset[()], dtype=np.float64)
    return EventRecords(columns=columns, entry=entry, **sides)


def _sparse(
    place: h5py.Group, name: str, column: str, shape: tuple[int, int], kind: str
) -> SparseTable:
    value = numbers(place, name, kind)[()]
    if value.ndim != 1:
        raise ValueError(f"{GROUP}/{name} has shape {value.shape} and not one axis")
    places = list[Indices]()
    for part in (f"{name}_entry", f"{name}_{column}"):
        dataset = numbers(place, part, "<i4")
        if dataset.shape != value.shape:
            raise ValueError(f"{GROUP}/{part} has shape {dataset.shape}, and {name} {value.shape}")
        places.append(np.asarray(dataset[()], dtype=np.intp))
    entry, of = places
    return SparseTable(shape, entry, of, value.astype(np.intp if kind == "<i4" else np.float64))


def _modes(place: h5py.Group, name: str, shape: tuple[int, ...]) -> Indices:
    dataset = numbers(place, name, "<i4")
    if dataset.shape != shape:
        raise ValueError(f"{GROUP}/{name} has shape {dataset.shape}, not {shape}")
    return np.asarray(dataset[()], dtype=np.intp)
