"""The event log of a run: rows of numbers, of the core and of the model's events."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Literal, NamedTuple, get_args, overload

import numpy as np

from lagcli.arrays import Array, Indices
from lagcli.engine.layout import Layout, part

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


#: The parts of a row that are one number.
_SCALARS = [name for name, part in EntryLayout.parts().items() if part == ("1",)]
_FIRST_ROWS = 64


class EventEntries(Sequence[EventEntry]):
    """Entries of a log, in order: one array of rows. Records of entries are made when asked for.

    Parameters
    ----------
    counts : EntryCounts
    """

    def __init__(self, counts: EntryCounts):
        self.layout = entry_layout(counts)
        self._rows, self._count = np.empty((0, self.layout.size)), 0

    def add(self, rows: Array) -> None:
        """Append rows, which are copied."""
        if not len(rows):
            return
        count = self._count + len(rows)
        if count > len(self._rows):
            more = np.empty((max(count, 2 * len(self._rows), _FIRST_ROWS), self.layout.size))
            more[: self._count] = self.rows
            self._rows = more
        self._rows[self._count : count] = rows
        self._count = count

    def append(self, entry: EventEntry) -> None:
        """Append an entry."""
        self.add(np.empty((1, self.layout.size)))
        self[-1] = entry

    @property
    def rows(self) -> Array:
        """All rows, (ne, width)."""
        return self._rows[: self._count]

    def part(self, name: str) -> Array:
        """Return a part of all rows, as `EntryLayout` names it: (ne,) if it is one number."""
        place = getattr(self.layout, name)
        return self.rows[:, place.start if name in _SCALARS else place]

    def integers(self, name: str, first: int = 0) -> Indices:
        """Return a part of the entries from a first one on, as integers."""
        return self.part(name)[first:].astype(np.intp)

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, place: int) -> EventEntry: ...
    @overload
    def __getitem__(self, place: slice) -> list[EventEntry]: ...
    def __getitem__(self, place: int | slice) -> EventEntry | list[EventEntry]:
        if isinstance(place, slice):
            return [self[i] for i in range(len(self))[place]]
        values = self.layout.split(self.rows[place])
        values |= {name: float(values[name][0]) for name in _SCALARS}
        return EventEntry(
            **values
            | {
                "occurrence": OCCURRENCES[int(values["occurrence"])],
                "which": int(values["which"]),
                "modes": values["modes"].astype(np.intp),
            }
        )

    def __setitem__(self, place: int, entry: EventEntry) -> None:
        row = self.rows[place]
        values = entry._asdict() | {"occurrence": OCCURRENCES.index(entry.occurrence)}
        for name, value in values.items():
            row[getattr(self.layout, name)] = value
