"""The event log of a run in CSV: a separate table, ``FILE.events.csv``.

Its first line after the header, of the kind ``start``, contains only the initial modes, of all
rows. ``modes`` and ``impulses`` of the other lines list what changes and what is not 0, as
``NAME=holds; NAME=open`` and ``NAME=NUMBER; NAME=NUMBER``.
"""

from __future__ import annotations

import csv
import hashlib
import io
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain, pairwise
from typing import Any

import numpy as np

from lagcli.arrays import Array
from lagcli.errors import FileError
from lagcli.files import check_readable, read_failure
from lagcli.prose import counted
from lagcli.results.csv.names import events_path
from lagcli.sparse_table import SparseTable
from lagcli.trajectory.event_log import MODES, NOTHING_RECORDED, EventLog, EventRecords

_FIXED = ("t", "name", "kind", "loss", "supplied", "work")
_START, _DTIME, _RECORDED = "start", "dt/d", "recorded."
_SPARSE = ("impulses", "modes")
_NEXT, _IS = "; ", "="
_SIDES = (".before", ".after")


def events_text(
    log: EventLog, t_start: float, coordinates: Sequence[str], constraints: Sequence[str]
) -> bytes:
    """Return the whole text of the table.

    Parameters
    ----------
    log : EventLog
    t_start : float
        Times, s; NaN if unknown.
    coordinates, constraints : sequence of str
    """
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    records = log.records
    recorded = (_RECORDED + name + side for name in records.columns for side in _SIDES)
    named = (_DTIME + name for name in log.parameters)
    table.writerow([*_header(coordinates), *named, *recorded])
    blank = ["nan"] * (3 + 3 * len(coordinates))
    nothing = [""] * (2 * len(records.columns))
    none = ["nan"] * len(log.parameters)
    start = _joined(log.rows, [MODES[mode] for mode in log.start])
    table.writerow([_number(t_start), "", _START, *blank, "", start, *none, *nothing])
    both = np.stack([records.before, records.after], axis=2)
    both = both.reshape(len(records.entry), 2 * len(records.columns))
    written = dict(zip(records.entry.tolist(), both.tolist(), strict=True))
    energies = np.column_stack([log.loss, log.supplied, log.work])
    numbers = np.hstack([energies, log.q, log.before, log.after])
    impulses = _texts(log.nonzero_impulses, constraints, _number)
    modes = _texts(log.mode_changes, log.rows, MODES.__getitem__)
    for i, (time, name, kind, values, *lists) in enumerate(
        zip(log.time.tolist(), log.names, log.kinds, numbers.tolist(), impulses, modes, strict=True)
    ):
        limits = map(_number, written[i]) if i in written else nothing
        first = [_number(time), name, kind, *map(_number, values), *lists]
        slopes = map(_number, log.dtime[i].tolist() if log.parameters else ())
        table.writerow([*first, *slopes, *limits])
    return text.getvalue().encode()


def events_digest(path: str) -> str | None:
    """Return the SHA-256 of the event table of a CSV file; None if there is none."""
    table = events_path(path)
    if not os.path.lexists(table):
        return None
    check_readable(table)
    try:
        with open(table, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise read_failure(table, error) from error


def read_event_table(
    path: str, coordinates: Sequence[str], constraints: Sequence[str]
) -> EventLog | None:
    """Return the log of a run; None if there is no table.

    Parameters
    ----------
    path : str
        The CSV file of the samples.
    coordinates, constraints : sequence of str
        Their names.

    Raises
    ------
    FileError
        The table cannot be read, is not an event table, or belongs to another model.
    """
    table = events_path(path)
    if not os.path.lexists(table):
        return None
    check_readable(table)
    try:
        with open(table, encoding="utf-8-sig", newline="") as file:
            header, *lines = csv.reader(file, strict=True)
        return _log(header, lines, coordinates, constraints)
    except OSError as error:
        raise read_failure(table, error) from error
    except (UnicodeDecodeError, csv.Error, ValueError) as error:
        raise FileError(
            f"cannot read {table}: it is not the event table of {path} ({error}); copy it"
            " again, or remove it to read only the samples"
        ) from error


def _header(coordinates: Sequence[str]) -> list[str]:
    velocities = [f"{q}_dot" for q in coordinates]
    return [
        *(*_FIXED, *coordinates),
        *(f"{v}.before" for v in velocities),
        *(f"{v}.after" for v in velocities),
        *_SPARSE,
    ]


def _log(
    header: list[str],
    lines: list[list[str]],
    coordinates: Sequence[str],
    constraints: Sequence[str],
) -> EventLog:
    known = _header(coordinates)
    named = [x for x in header[len(known) :] if x.startswith(_DTIME)]
    recorded = header[len(known) + len(named) :]
    columns = [x.removeprefix(_RECORDED).removesuffix(_SIDES[0]) for x in recorded[::2]]
    sides = [_RECORDED + name + side for name in columns for side in _SIDES]
    if header != [*known, *named, *sides]:
        raise ValueError("its columns are not those of this model")
    for number, line in enumerate(lines, 2):
        if len(line) != len(header):
            found = counted(len(line), "value")
            raise ValueError(f"line {number} has {found} for {len(header)} columns")
    if not lines or lines[0][2] != _START:
        raise ValueError("it has no modes at the start")
    entries, nq, first = lines[1:], len(coordinates), len(known)
    values = _numbers(
        chain.from_iterable([x[0], *x[3 : first - len(_SPARSE)]] for x in entries)
    ).reshape(len(entries), 4 + 3 * nq)
    impulses, modes = (known.index(name) for name in _SPARSE)
    start = [_split(item) for item in _items(lines[0][modes])]
    rows = tuple(name for name, _ in start)
    last = first + len(named)
    dtime = _numbers(chain.from_iterable(x[first:last] for x in entries))
    time, loss, supplied, work = values[:, :4].T.copy()
    q, before, after = np.split(values[:, 4:], 3, axis=1)
    log = EventLog(
        rows=rows,
        start=np.array([_mode(word) for _, word in start], dtype=np.intp),
        time=time,
        names=tuple(x[1] for x in entries),
        kinds=tuple(x[2] for x in entries),
        q=np.ascontiguousarray(q),
        before=np.ascontiguousarray(before),
        after=np.ascontiguousarray(after),
        nonzero_impulses=_sparse([x[impulses] for x in entries], constraints, float, np.float64),
        loss=loss,
        supplied=supplied,
        work=work,
        mode_changes=_sparse([x[modes] for x in entries], rows, _mode, np.intp),
        records=_records(columns, [x[last:] for x in entries]),
        parameters=tuple(x.removeprefix(_DTIME) for x in named),
        dtime=dtime.reshape(len(entries), len(named)) if named else np.empty((0, 0)),
    )
    log.check()
    return log


def _records(columns: list[str], lines: list[list[str]]) -> EventRecords:
    """Return the recorded columns of each line, empty where nothing is recorded."""
    if not columns:
        return NOTHING_RECORDED
    places = [i for i, line in enumerate(lines) if any(line)]
    both = _numbers(chain.from_iterable(lines[i] for i in places))
    both = both.reshape(len(places), len(columns), 2)
    return EventRecords(
        columns=tuple(columns),
        entry=np.array(places, dtype=np.intp),
        before=both[:, :, 0].copy(),
        after=both[:, :, 1].copy(),
    )


def _number(value: float) -> str:
    return f"{value:.17g}"


def _numbers(texts: Any) -> Array:
    return np.array([float(x) for x in texts], dtype=np.float64)


def _mode(word: str) -> int:
    if word not in MODES:
        raise ValueError(f"{word!r} is not a mode")
    return MODES.index(word)


def _joined(names: Iterable[str], values: Iterable[str]) -> str:
    return _NEXT.join(name + _IS + value for name, value in zip(names, values, strict=True))


def _items(text: str) -> list[str]:
    return text.split(_NEXT) if text else []


def _split(item: str) -> tuple[str, str]:
    name, between, value = item.rpartition(_IS)
    if not between:
        raise ValueError(f"{item!r} is not a name and a value")
    return name, value


def _texts(rows: SparseTable, names: Sequence[str], written: Callable[[Any], str]) -> Iterator[str]:
    """Yield the text of each row."""
    columns, values, starts = rows.column.tolist(), rows.value.tolist(), rows.starts()
    for first, last in pairwise(starts):
        own = slice(first, last)
        yield _joined((names[k] for k in columns[own]), map(written, values[own]))


def _sparse(
    texts: Sequence[str], names: Sequence[str], read: Callable[[str], Any], kind: type
) -> SparseTable:
    """Return the rows of texts, whose names are those of the columns."""
    place = {name: k for k, name in enumerate(names)}
    found = [(i, *_split(item)) for i, text in enumerate(texts) for item in _items(text)]
    unknown = [name for _, name, _ in found if name not in place]
    if unknown:
        raise ValueError(f"{unknown[0]!r} is not a name of this model")
    return SparseTable(
        (len(texts), len(names)),
        np.array([i for i, *_ in found], dtype=np.intp),
        np.array([place[name] for _, name, _ in found], dtype=np.intp),
        np.array([read(value) for *_, value in found], dtype=kind),
    )
