"""The event log of a run in CSV: a separate table, ``FILE.events.csv``.

Its first line after the header, of the kind ``start``, contains only the initial modes.
"""

from __future__ import annotations

import csv
import hashlib
import io
import os
from collections.abc import Sequence
from itertools import chain
from typing import Any

import numpy as np

from lagcli.arrays import Array
from lagcli.errors import FileError
from lagcli.files import check_readable, read_failure
from lagcli.prose import counted
from lagcli.results.csv.names import events_path
from lagcli.trajectory.event_log import MODES, NOTHING_RECORDED, EventLog, EventRecords

_FIXED = ("t", "name", "kind", "loss", "supplied", "work")
_START, _MODE, _DTIME, _RECORDED = "start", "mode.", "dt/d", "recorded."
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
    modes = (_MODE + row for row in log.rows)
    recorded = (_RECORDED + name + side for name in records.columns for side in _SIDES)
    named = (_DTIME + name for name in log.parameters)
    table.writerow([*_header(coordinates, constraints), *modes, *named, *recorded])
    blank = ["nan"] * (3 + 3 * len(coordinates) + len(constraints))
    nothing = [""] * (2 * len(records.columns))
    none = ["nan"] * len(log.parameters)
    table.writerow([_number(t_start), "", _START, *blank, *_words(log.start), *none, *nothing])
    both = np.stack([records.before, records.after], axis=2)
    both = both.reshape(len(records.entry), 2 * len(records.columns))
    written = dict(zip(records.entry.tolist(), both.tolist(), strict=True))
    energies = np.column_stack([log.loss, log.supplied, log.work])
    numbers = np.hstack([energies, log.q, log.before, log.after, log.impulse])
    for i, (time, name, kind, values, after) in enumerate(
        zip(log.time.tolist(), log.names, log.kinds, numbers.tolist(), log.modes, strict=True)
    ):
        limits = map(_number, written[i]) if i in written else nothing
        start = [_number(time), name, kind, *map(_number, values), *_words(after)]
        slopes = map(_number, log.dtime[i].tolist() if log.parameters else ())
        table.writerow([*start, *slopes, *limits])
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


def _header(coordinates: Sequence[str], constraints: Sequence[str]) -> list[str]:
    velocities = [f"{q}_dot" for q in coordinates]
    return [
        *(*_FIXED, *coordinates),
        *(f"{v}.before" for v in velocities),
        *(f"{v}.after" for v in velocities),
        *(f"impulse.{c}" for c in constraints),
    ]


def _log(
    header: list[str],
    lines: list[list[str]],
    coordinates: Sequence[str],
    constraints: Sequence[str],
) -> EventLog:
    known = _header(coordinates, constraints)
    rest = [x for x in header[len(known) :] if x.startswith(_MODE)]
    named = [x for x in header[len(known) + len(rest) :] if x.startswith(_DTIME)]
    recorded = header[len(known) + len(rest) + len(named) :]
    columns = [x.removeprefix(_RECORDED).removesuffix(_SIDES[0]) for x in recorded[::2]]
    sides = [_RECORDED + name + side for name in columns for side in _SIDES]
    if header != [*known, *rest, *named, *sides]:
        raise ValueError("its columns are not those of this model")
    for number, line in enumerate(lines, 2):
        if len(line) != len(header):
            found = counted(len(line), "value")
            raise ValueError(f"line {number} has {found} for {len(header)} columns")
    if not lines or lines[0][2] != _START:
        raise ValueError("it has no modes at the start")
    entries = lines[1:]
    nq, nc = len(coordinates), len(constraints)
    values = _numbers(chain.from_iterable([x[0], *x[3 : len(known)]] for x in entries))
    values = values.reshape(len(entries), 4 + 3 * nq + nc)
    first = len(known) + len(rest)
    modes = np.array([_places(x[len(known) : first]) for x in lines], dtype=np.intp)
    modes = modes.reshape(len(lines), len(rest))
    last = first + len(named)
    dtime = _numbers(chain.from_iterable(x[first:last] for x in entries))
    time, loss, supplied, work = values[:, :4].T.copy()
    q, before, after, impulse = np.split(values[:, 4:], [nq, 2 * nq, 3 * nq], axis=1)
    log = EventLog(
        rows=tuple(x.removeprefix(_MODE) for x in rest),
        start=modes[0],
        time=time,
        names=tuple(x[1] for x in entries),
        kinds=tuple(x[2] for x in entries),
        q=np.ascontiguousarray(q),
        before=np.ascontiguousarray(before),
        after=np.ascontiguousarray(after),
        impulse=np.ascontiguousarray(impulse),
        loss=loss,
        supplied=supplied,
        work=work,
        modes=modes[1:],
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


def _words(modes: Any) -> list[str]:
    return [MODES[mode] for mode in modes]


def _places(words: Sequence[str]) -> list[int]:
    for word in words:
        if word not in MODES:
            raise ValueError(f"{word!r} is not a mode")
    return [MODES.index(word) for word in words]
