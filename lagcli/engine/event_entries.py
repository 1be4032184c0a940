"""The event log of a run: rows of numbers, of the core and of the model's events."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, get_args, overload

import numpy as np

from lagcli.arrays import Array, Indices
from lagcli.engine.layout import Layout, part
from lagcli.sparse_table import SparseTable, changes_of, modes_after

if TYPE_CHECKING:
    from lagcli.engine.switching.switching import ContactChange

#: Kinds of log entries. "rest" ends a sequence of impacts that has a limit in time; "not unique":
#: an impact has more than one solution; "redundant": from here on, a force is not unique, since
#: other rows can bear parts of it; "two motions", "no motion" and "jams" end a run; "event" is one
#: of the model's events. Rows store their numbers, of which the core has the first:
#: lag_occurrence in core/lagcore.h.
Occurrence = Literal[
    "closes",
    "opens",
    "slips",
    "sticks",
    "impact",
    "rest",
    "not unique",
    "redundant",
    "event",
    "releases",
    "engages",
    "two motions",
    "no motion",
    "jams",
]
OCCURRENCES: tuple[Occurrence, ...] = get_args(Occurrence)
#: Kinds of log entries by the changes of a contact named in events.
CHANGES: dict[Occurrence, ContactChange] = {
    "closes": "closes",
    "rest": "closes",
    "opens": "opens",
    "slips": "slips",
    "sticks": "sticks",
    "impact": "impacts",
}


class EventEntry(NamedTuple):
    """Change of one row, or occurrence of one of the model's events, at an instant.

    Parameters
    ----------
    time : float
        s.
    occurrence : Occurrence
    which : int
        An index in ``System.constraints``; for "event", in ``Switching.events``.
    q : (nq,) array
    before, after : (nq,) arrays
        The velocities.
    impulse : (nc,) array
        Impulse of all constraints at that instant; 0 without an impact.
    loss : float
        Energy absorbed by this row's impulse, −Λ (γ⁻ + γ⁺)/2 including its friction; for "rest",
        energy that the remaining impacts absorb besides friction; J.
    supplied : float
        Energy supplied by the impulses of moving constraints; J.
    work : float
        Work of the event's actions, and the energy lost by velocities when it engages a constraint;
        J.
    modes : (ns,) array of int
        `RowMode` of each switched row after the instant.
    dtime : (n,) array, optional
        Derivatives of the time, in the directions of a run that computes them.
    """

    time: float
    occurrence: Occurrence
    which: int
    q: Array
    before: Array
    after: Array
    impulse: Array
    loss: float
    supplied: float
    work: float
    modes: Indices
    dtime: Array | float = np.nan


class EntryCounts(NamedTuple):
    """Numbers of coordinates, constraints, switched rows, and directions of derivatives."""

    nq: int = 0
    nc: int = 0
    ns: int = 0
    n: int = 0


class EntryLayout(Layout):
    """Layout of a row, as core/switching/log.c writes it."""

    time = part("1")
    occurrence = part("1")
    which = part("1")
    loss = part("1")
    supplied = part("1")
    work = part("1")
    modes = part("ns")
    q = part("nq")
    before = part("nq")
    after = part("nq")
    impulse = part("nc")
    dtime = part("n")


@lru_cache(maxsize=8)
def entry_layout(counts: EntryCounts) -> EntryLayout:
    """Return the layout of rows; cached for many runs."""
    return EntryLayout(counts)


class KeptLayout(Layout):
    """Layout of the parts of a row that `EventEntries` keeps as they are."""

    time = part("1")
    occurrence = part("1")
    which = part("1")
    loss = part("1")
    supplied = part("1")
    work = part("1")
    q = part("nq")
    before = part("nq")
    after = part("nq")
    dtime = part("n")


#: The parts of a row that are one number.
_SCALARS = [name for name, part in KeptLayout.parts().items() if part == ("1",)]
_FIRST_ROWS = 64
#: Stands for the modes before the first entry, which the log does not have.
_UNKNOWN = -1
#: Largest number of rows that are converted at a time.
_AT_ONCE = 256


class _Growing:
    """Array that grows at its end."""

    def __init__(self, width: tuple[int, ...], dtype: type):
        self._all: Any = np.empty((0, *width), dtype=dtype)
        self.count = 0

    def add(self, values: Any) -> None:
        """Append values, which are copied."""
        count = self.count + len(values)
        if count > len(self._all):
            size = max(count, 2 * len(self._all), _FIRST_ROWS)
            more = np.empty((size, *self._all.shape[1:]), dtype=self._all.dtype)
            more[: self.count] = self.values
            self._all = more
        self._all[self.count : count] = values
        self.count = count

    @property
    def values(self) -> Any:
        """All values."""
        return self._all[: self.count]


class _GrowingRows:
    """Sparse rows that grow at their end."""

    def __init__(self, width: int, dtype: type):
        self.width = width
        self._row, self._column = _Growing((), np.intp), _Growing((), np.intp)
        self._value = _Growing((), dtype)

    def add(self, rows: SparseTable, first: int) -> None:
        """Append rows, the first of which has a given number."""
        self._row.add(rows.row + first)
        self._column.add(rows.column)
        self._value.add(rows.value)

    def end(self, count: int) -> None:
        """Keep only a number of rows."""
        kept = int(np.searchsorted(self._row.values, count))
        for grown in (self._row, self._column, self._value):
            grown.count = kept

    def rows(self, count: int) -> SparseTable:
        """Return the array of a number of rows."""
        parts = (x.values for x in (self._row, self._column, self._value))
        return SparseTable((count, self.width), *parts)

    def of_row(self, row: int) -> tuple[Indices, Any]:
        """Return the columns and the values of a row."""
        first, last = np.searchsorted(self._row.values, (row, row + 1))
        return self._column.values[first:last], self._value.values[first:last]


class EventEntries(Sequence[EventEntry]):
    """Entries of a log, in order: arrays, of which impulses and changes of modes are sparse.

    Records of entries are made when asked for.

    Parameters
    ----------
    counts : EntryCounts
    """

    def __init__(self, counts: EntryCounts):
        self.layout = entry_layout(counts)
        self._kept = KeptLayout(counts)
        self._rows = _Growing((self._kept.size,), np.float64)
        self._changes = _GrowingRows(counts.ns, np.intp)
        self._impulses = _GrowingRows(counts.nc, np.float64)
        self._modes = np.full(counts.ns, _UNKNOWN)  # after the last entry
        self._unknown = self._modes.copy()

    def add(self, rows: Array) -> None:
        """Append rows of `EntryLayout`, which are copied."""
        layout, kept = self.layout, self._kept
        for first in range(0, len(rows), _AT_ONCE):
            some, count = rows[first : first + _AT_ONCE], len(self)
            own = np.empty((len(some), kept.size))
            for name in KeptLayout.parts():
                own[:, getattr(kept, name)] = some[:, getattr(layout, name)]
            self._rows.add(own)
            self._impulses.add(SparseTable.of(some[:, layout.impulse]), count)
            self._add_modes(some[:, layout.modes].astype(np.intp), count)

    def _add_modes(self, modes: Indices, first: int) -> None:
        self._changes.add(changes_of(self._modes, modes), first)
        self._modes = modes[-1].copy()

    def append(self, entry: EventEntry) -> None:
        """Append an entry."""
        row = np.empty((1, self.layout.size))
        for name, value in _numbers_of(entry).items():
            row[:, getattr(self.layout, name)] = value
        self.add(row)

    @property
    def impulses(self) -> SparseTable:
        """Impulses of all entries, (ne, nc)."""
        return self._impulses.rows(len(self))

    @property
    def changes(self) -> SparseTable:
        """New modes, (ne, ns): at the first entry those of all rows."""
        return self._changes.rows(len(self))

    def modes(self, first: int = 0) -> Indices:
        """Return the modes after the entries from a first one on, (ne - first, ns)."""
        return modes_after(self._unknown, self.changes, np.arange(first + 1, len(self) + 1))

    def replace_modes(self, places: Indices, modes: Indices) -> None:
        """Change the modes after some entries, by increasing place; in time proportional to the
        number of entries from the first of them on."""
        if not len(places):
            return
        first = int(places[0])
        rows = modes_after(self._unknown, self.changes, np.arange(first, len(self) + 1))
        self._modes, rows = rows[0], rows[1:]
        rows[places - first] = modes
        self._changes.end(first)
        self._add_modes(rows, first)

    def part(self, name: str) -> Array:
        """Return a part of all rows, as `KeptLayout` names it: (ne,) if it is one number."""
        place = getattr(self._kept, name)
        rows: Array = self._rows.values
        return rows[:, place.start if name in _SCALARS else place]

    def integers(self, name: str, first: int = 0) -> Indices:
        """Return a part of the entries from a first one on, as integers."""
        return self.part(name)[first:].astype(np.intp)

    def __len__(self) -> int:
        return self._rows.count

    @overload
    def __getitem__(self, place: int) -> EventEntry: ...
    @overload
    def __getitem__(self, place: slice) -> list[EventEntry]: ...
    def __getitem__(self, place: int | slice) -> EventEntry | list[EventEntry]:
        if isinstance(place, slice):
            return [self[i] for i in range(len(self))[place]]
        number = range(len(self))[place]
        values: dict[str, Any] = self._kept.split(self._rows.values[number])
        values |= {name: float(values[name][0]) for name in _SCALARS}
        impulse = np.zeros(self._impulses.width)
        column, found = self._impulses.of_row(number)
        impulse[column] = found
        (modes,) = modes_after(self._unknown, self.changes, np.array([number + 1]))
        return EventEntry(
            **values
            | {
                "occurrence": OCCURRENCES[int(values["occurrence"])],
                "which": int(values["which"]),
                "impulse": impulse,
                "modes": modes,
            }
        )

    def correct(self, place: int, *, work: float, after: Array) -> None:
        """Change the work and the velocities after an entry."""
        self.part("work")[place] = work
        self.part("after")[place] = after


def _numbers_of(entry: EventEntry) -> dict[str, Any]:
    return entry._asdict() | {"occurrence": OCCURRENCES.index(entry.occurrence)}
