"""The event log of a run: contacts, events, and the resulting modes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from lagcli.arrays import Array, Indices
from lagcli.prose import counted
from lagcli.sparse_table import SparseTable, modes_after

#: Modes of switched rows, numbered as `lagcli.engine.switching.switching.RowMode`.
MODES = ("open", "holds", "forward", "backward")
#: Kinds of entries.
KINDS = (
    *("closes", "opens", "slips", "sticks", "impact", "rest"),
    *("not unique", "redundant", "two motions", "no motion", "jams"),
    *("releases", "engages", "event"),
)

#: Largest number of recorded columns of an event whose last values are listed.
_LISTED = 8


class Rest(NamedTuple):
    """The end of a sequence of impacts that has a limit in time.

    Parameters
    ----------
    name : str
        Name of the constraint.
    time : float
        s.
    impacts : int
        Number of impacts since the contact last came to rest, or since the initial time.
    """

    name: str
    time: float
    impacts: int

    def __str__(self) -> str:
        impacts = counted(self.impacts, "impact")
        return f"`{self.name}` came to rest at t = {self.time:.11g} s after {impacts}"


#: Kinds of entries about forces and motions that are not unique, or do not exist, as sentences.
_UNDETERMINED = {
    "not unique": (
        "more than one motion after the impact at {names} at t = {time:.9g} s satisfies the law;"
        " the listed one was taken"
    ),
    "redundant": (
        "from t = {time:.9g} s on, the forces of {names} are not unique (the motion is): those of"
        " least norm within their laws were taken"
    ),
    "two motions": (
        "at t = {time:.9g} s the motion at {names} is not unique; none was taken, and the run ends"
    ),
    "no motion": "at t = {time:.9g} s no motion at {names} satisfies its laws, and the run ends",
    "jams": (
        "at t = {time:.9g} s the force of {names} grows without bound while it slides, and the run"
        " ends"
    ),
}


class Undetermined(NamedTuple):
    """An instant at which forces or the motion are not unique, or do not exist.

    Parameters
    ----------
    time : float
        s.
    kind : str
    names : tuple of str
        Names of the constraints.
    """

    time: float
    kind: str
    names: tuple[str, ...]

    def __str__(self) -> str:
        names = [f"`{name}`" for name in self.names[:_LISTED]]
        if len(self.names) > _LISTED:
            names.append(f"{len(self.names) - _LISTED} more")
        return _UNDETERMINED[self.kind].format(time=self.time, names=", ".join(names))


@dataclass(frozen=True, kw_only=True, eq=False)
class EventRecords:
    """Columns of results at the instants of events, before and after.

    nr entries of the log with recorded columns, nn columns.

    Parameters
    ----------
    columns : tuple of nn str
        Names as in CSV files.
    entry : (nr,) array of int
        Indices of the log entries, increasing.
    before, after : (nr, nn) arrays
        One-sided limits at the instant: before and after it. NaN if the entry does not record the
        column, or if there is no limit: accelerations and forces before the initial time.
    """

    columns: tuple[str, ...]
    entry: Indices
    before: Array
    after: Array

    def check(self, entries: int) -> None:
        """Raise ValueError unless they are consistent with a number of log entries."""
        shape = (len(self.entry), len(self.columns))
        if len(set(self.columns)) < len(self.columns):
            raise ValueError("a column is recorded twice")
        if any(x.shape != shape for x in (self.before, self.after)):
            raise ValueError("recorded values and columns differ in number")
        if len(self.entry) and (
            self.entry[0] < 0 or self.entry[-1] >= entries or (np.diff(self.entry) <= 0).any()
        ):
            raise ValueError("recorded columns refer to entries that do not exist")

    def of(self, place: int) -> dict[str, tuple[float, float]]:
        """Return the recorded values of an entry: before and after, by column."""
        both = zip(self.before[place].tolist(), self.after[place].tolist(), strict=True)
        known = ~np.isnan(self.before[place]) | ~np.isnan(self.after[place])
        named = zip(self.columns, both, known.tolist(), strict=True)
        return {column: values for column, values, recorded in named if recorded}


NOTHING_RECORDED = EventRecords(
    columns=(),
    entry=np.empty(0, dtype=np.intp),
    before=np.empty((0, 0)),
    after=np.empty((0, 0)),
)


@dataclass(frozen=True, kw_only=True, eq=False)
class EventLog:
    """Log of contacts and events during a run, in order.

    ne entries, one for each row and instant; nq coordinates, nc constraints, ns switched rows.

    Parameters
    ----------
    rows : tuple of ns str
        The switched constraints.
    start : (ns,) array of int
        Their initial modes, indices into `MODES`.
    time : (ne,) array
        s.
    names : tuple of ne str
        Name of the constraint; for kind "event", name of the event.
    kinds : tuple of ne str
        One of `KINDS`. "rest" ends a sequence of impacts that has a limit in time, its ``time``;
        its ``loss`` is that of the impacts before this time that are not listed. "not unique": an
        impact has more than one solution, of which one was taken. "redundant": from here on, λ is
        not unique, and that of least norm is taken. "two motions", "no motion" and "jams": the run
        ends, since the motion is not unique, does not exist, or needs a force without bound.
    q, before, after : (ne, nq) arrays
        The coordinates, and the velocities before and after the instant.
    nonzero_impulses : SparseTable
        (ne, nc): the impulses of all constraints at the instant other than 0, J s per unit of the
        constraint.
    loss : (ne,) array
        Energy absorbed by the entry's own impulse, −Λ (γ⁻ + γ⁺)/2 including its friction, J; for
        "rest", energy that the remaining impacts absorb besides friction.
    supplied : (ne,) array
        Energy supplied by the impulses of moving constraints, J.
    work : (ne,) array
        Work of the event's actions, and energy lost by velocities when it engages a constraint, J.
    mode_changes : SparseTable
        (ne, ns): the modes of the switched rows after the entry that differ from those before.
    records : EventRecords
        Recorded columns of events.
    parameters : tuple of n str
        Parameters and initial values of the run's derivatives.
    dtime : (ne, n) array
        Derivatives of the times with respect to these; NaN if undefined.
    """

    rows: tuple[str, ...]
    start: Indices
    time: Array
    names: tuple[str, ...]
    kinds: tuple[str, ...]
    q: Array
    before: Array
    after: Array
    nonzero_impulses: SparseTable
    loss: Array
    supplied: Array
    work: Array
    mode_changes: SparseTable
    records: EventRecords = NOTHING_RECORDED
    parameters: tuple[str, ...] = ()
    dtime: Array = field(default_factory=lambda: np.empty((0, 0)))

    def __len__(self) -> int:
        return len(self.time)

    @cached_property
    def modes(self) -> Indices:
        """Modes of the switched rows after each entry, (ne, ns): made when asked for."""
        return modes_after(self.start, self.mode_changes, np.arange(1, len(self) + 1))

    @cached_property
    def impulse(self) -> Array:
        """Impulses of all constraints at each entry, (ne, nc), J s per unit of the constraint; 0
        without an impact. The array is made when asked for."""
        return np.asarray(self.nonzero_impulses.dense())

    def check(self) -> None:
        """Raise ValueError unless times are in order, and kinds and modes are known."""
        if not np.isfinite(self.time).all() or (np.diff(self.time) < 0.0).any():
            raise ValueError("the times of events are not finite, or decrease")
        unknown = set(self.kinds) - set(KINDS)
        if unknown:
            raise ValueError(f"there is an event of the kind {min(unknown)!r}")
        if len(set(self.rows)) < len(self.rows):
            raise ValueError("a row switches twice")
        for what, rows, width in (
            ("modes", self.mode_changes, len(self.rows)),
            ("impulses", self.nonzero_impulses, self.nonzero_impulses.shape[1]),
        ):
            if rows.shape != (len(self), width):
                raise ValueError(f"{what} of events have the shape {rows.shape}")
            rows.check(f"{what} of events")
        for modes in (self.start, self.mode_changes.value):
            if modes.size and not 0 <= modes.min() <= modes.max() < len(MODES):
                raise ValueError("there is an unknown mode")
        self.records.check(len(self))
        if self.parameters and self.dtime.shape != (len(self), len(self.parameters)):
            raise ValueError("there is not one derivative of each time by each parameter")
        amounts = {name: getattr(self, name) for name in ("loss", "supplied", "work")}
        with np.errstate(over="ignore"):
            sums = {name: np.abs(values).sum() for name, values in amounts.items()}
            sums["impulse"] = self._sums(np.abs(self.nonzero_impulses.value))
        for name, total in sums.items():
            if np.isinf(total).any():
                raise ValueError(f"{name} of the events, or its sum, is infinite")

    def recorded(self, column: str) -> tuple[Array, Array]:
        """Return a recorded column, right before and right after each entry.

        Parameters
        ----------
        column : str
            Name of the column as in CSV files.

        Returns
        -------
        before, after : (ne,) arrays
            NaN if the entry does not record the column.

        Raises
        ------
        KeyError
            No event records the column.
        """
        records = self.records
        if column not in records.columns:
            raise KeyError(column)
        place, sides = records.columns.index(column), np.full((2, len(self)), np.nan)
        sides[:, records.entry] = records.before[:, place], records.after[:, place]
        return sides[0], sides[1]

    def modes_at(self, time: Array) -> Indices:
        """Return the modes right after given times.

        Parameters
        ----------
        time : (nt,) array
            s.

        Returns
        -------
        (nt, ns) array of int
            Indices into `MODES`.
        """
        return modes_after(
            self.start, self.mode_changes, np.searchsorted(self.time, time, side="right")
        )

    def mode(self, entry: int, row: int) -> int:
        """Return the mode of a row after an entry."""
        entries, modes = self.mode_changes.of_column(row)
        seen = int(np.searchsorted(entries, entry, side="right"))
        return int(modes[seen - 1] if seen else self.start[row])

    def counts(self) -> dict[str, dict[str, int]]:
        """Return the number of entries by name and kind, in the order of first occurrence."""
        counts: dict[str, dict[str, int]] = {}
        for (name, kind), count in Counter(zip(self.names, self.kinds, strict=True)).items():
            counts.setdefault(name, {})[kind] = count
        return counts

    def rests(self) -> list[Rest]:
        """Return the sequences of impacts that came to rest."""
        rests, impacts = [], Counter[str]()
        for time, name, kind in zip(self.time.tolist(), self.names, self.kinds, strict=True):
            if kind == "impact":
                impacts[name] += 1
            elif kind == "rest":
                rests.append(Rest(name, time, impacts.pop(name, 0)))
        return rests

    def undetermined(self) -> list[Undetermined]:
        """Return the instants at which forces or motions are not unique, or do not exist."""
        names_at: dict[tuple[float, str], list[str]] = {}
        for time, name, kind in zip(self.time.tolist(), self.names, self.kinds, strict=True):
            if kind in _UNDETERMINED:
                names_at.setdefault((time, kind), []).append(name)
        return [Undetermined(time, kind, tuple(names)) for (time, kind), names in names_at.items()]

    def total_impulse(self) -> Array:
        """Return the sum of the impulses of each constraint, (nc,).

        All entries of one impact contain its impulses, which are counted once.
        """
        counted_once = self._impacts()[self.nonzero_impulses.row]
        return self._sums(np.where(counted_once, self.nonzero_impulses.value, 0.0))

    def _sums(self, values: Array) -> Array:
        """Return the sums of values at the places of the impulses, (nc,)."""
        sums = np.zeros(self.nonzero_impulses.shape[1])
        np.add.at(sums, self.nonzero_impulses.column, values)
        return sums

    def _impacts(self) -> Array:
        """Return a mask of the first entry of each impact."""
        starts, values = np.array(self.nonzero_impulses.starts()), self.nonzero_impulses.value
        count, column = np.diff(starts), self.nonzero_impulses.column
        first = np.ones(len(self), dtype=bool)
        for i in np.flatnonzero((np.diff(self.time) == 0.0) & (count[1:] == count[:-1])).tolist():
            one, other = (slice(*starts[k : k + 2]) for k in (i, i + 1))
            first[i + 1] = not (
                np.array_equal(column[one], column[other])
                and np.array_equal(values[one], values[other])
            )
        return first

    def struck(self, constraint: int) -> tuple[Array, Array]:
        """Return the times and the values of the impulses of a constraint other than zero."""
        entries, values = self.nonzero_impulses.of_column(constraint)
        first = self._impacts()[entries]
        return self.time[entries[first]], values[first]

    def named_at(self, time: float) -> str:
        """Return what happens at an instant of the log: name and kind, or several names."""
        (places,) = np.nonzero(self.time == time)
        names = list(dict.fromkeys(self.names[i] for i in places))
        kinds = {self.kinds[i] for i in places}
        if len(names) == 1 and len(kinds) == 1 and kinds != {"event"}:
            return f"{names[0]} {kinds.pop()}"
        return ", ".join(names)

    def impulses(self, constraints: Sequence[str]) -> dict[str, dict[str, float]]:
        """Return the ranges of the impulses of the constraints that have some.

        Parameters
        ----------
        constraints : sequence of nc str
            Names, in the model's order.

        Returns
        -------
        dict of str to dict
            ``min``, ``max`` and their times ``t_min``, ``t_max``, s; ``sum``, and the ``count``
            of impulses other than zero.
        """
        first = self._impacts()[self.nonzero_impulses.row]
        order = np.argsort(self.nonzero_impulses.column[first], kind="stable")
        time, column, every = (
            x[first][order]
            for x in (
                self.time[self.nonzero_impulses.row],
                self.nonzero_impulses.column,
                self.nonzero_impulses.value,
            )
        )
        ranges = {}
        for k in np.unique(column).tolist():
            mine = slice(*np.searchsorted(column, (k, k + 1)))
            at, values = time[mine], every[mine]
            low, high = int(values.argmin()), int(values.argmax())
            ranges[constraints[k]] = {
                "min": float(values[low]),
                "t_min": float(at[low]),
                "max": float(values[high]),
                "t_max": float(at[high]),
                "sum": float(values.sum()),
                "count": len(values),
            }
        return ranges

    def to_mapping(self) -> dict[str, Any]:
        """Return a summary of the log as JSON values.

        ``entries``, their number; ``counts`` by name and kind; ``rests`` (name, time, impacts);
        ``undetermined`` (time, kind, names);
        ``loss``, ``supplied`` and ``work``, the sums; ``at_end``, the mode of each row that
        switches, of `MODES`; ``recorded`` by event: how many ``times``,
        how many ``columns``, and the ``last`` time and values, as {``time``, ``values``: column →
        [before, after]}, None for NaN; ``last`` is None where the columns are more than 8;
        ``dtime``, the derivatives of the times of all entries, None of a run without derivatives.
        """
        return {
            "entries": len(self),
            "counts": self.counts(),
            "rests": [rest._asdict() for rest in self.rests()],
            "undetermined": [x._asdict() | {"names": list(x.names)} for x in self.undetermined()],
            "loss": float(self.loss.sum()),
            "supplied": float(self.supplied.sum()),
            "work": float(self.work.sum()),
            "at_end": dict(zip(self.rows, self._words_at_end(), strict=True)),
            "recorded": self._last_records(),
            "dtime": self._time_derivatives() if self.parameters else None,
        }

    def _time_derivatives(self) -> list[dict[str, Any]]:
        """Return ``time``, ``name``, ``kind`` and ``dtime`` by parameter, None for NaN."""
        entries = zip(self.time.tolist(), self.names, self.kinds, self.dtime.tolist(), strict=True)
        return [
            {
                "time": time,
                "name": name,
                "kind": kind,
                "dtime": {
                    parameter: None if np.isnan(x) else x
                    for parameter, x in zip(self.parameters, slopes, strict=True)
                },
            }
            for time, name, kind, slopes in entries
        ]

    def _words_at_end(self) -> list[str]:
        (last,) = modes_after(self.start, self.mode_changes, np.array([len(self)]))
        return [MODES[mode] for mode in last]

    def _last_records(self) -> dict[str, Any]:
        names = [self.names[entry] for entry in self.records.entry.tolist()]
        times, records = Counter(names), dict[str, Any]()
        for name, place in {name: place for place, name in enumerate(names)}.items():
            values = {
                column: [None if np.isnan(x) else x for x in both]
                for column, both in self.records.of(place).items()
            }
            last = {"time": float(self.time[self.records.entry[place]]), "values": values}
            records[name] = {
                "times": times[name],
                "columns": len(values),
                "last": last if len(values) <= _LISTED else None,
            }
        return records

    def instants(self, name: str, kind: str) -> Array:
        """Return the times of entries of a name and kind, s."""
        chosen = [
            i for i, of in enumerate(zip(self.names, self.kinds, strict=True)) if of == (name, kind)
        ]
        return np.asarray(self.time[chosen])


def event_sentences(log: Mapping[str, Any]) -> list[str]:
    """Return sentences on contacts and events, from `EventLog.to_mapping`.

    Counts by constraint and event, notes on sequences of impacts that came to rest, and energies.
    """
    if not log["entries"]:
        return ["no changes of contacts, no events"]
    counts = (
        f"{name}: " + ", ".join(f"{kind} {count}" for kind, count in kinds.items())
        for name, kinds in log["counts"].items()
    )
    sentences = ["; ".join(counts)]
    rests = [f"note: {Rest(**rest)}" for rest in log["rests"]]
    sentences += rests[:_LISTED]
    if len(rests) > _LISTED:
        more = counted(len(rests) - _LISTED, "more time")
        sentences.append(f"note: contacts came to rest {more}")
    sentences += _undetermined(log["undetermined"])
    sentences += _at_end(log["at_end"])
    few = ((name, of) for name, of in log["recorded"].items() if of["last"] is not None)
    sentences += [_recorded(name, of) for name, of in few]
    energy = [
        f"{what} {log[name]:.6g} J"
        for name, what in (
            ("loss", "impacts dissipated"),
            ("supplied", "moving constraints supplied"),
            ("work", "events did work"),
        )
        if log[name]
    ]
    return sentences + [", ".join(energy)] * bool(energy)


def _undetermined(instants: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return notes on forces and motions that are not unique, or do not exist, first by kind."""
    sentences = []
    for kind in dict.fromkeys(each["kind"] for each in instants):
        times = [each for each in instants if each["kind"] == kind]
        note = f"note: {Undetermined(**times[0])}"
        more = len(times) - 1
        sentences.append(note + (f"; {counted(more, 'more time')}" if more else ""))
    return sentences


def _at_end(modes: Mapping[str, str]) -> list[str]:
    """Return the clause on active, slipping and open rows at the end of a run."""
    if not modes:
        return []
    words = {"holds": "holds", "forward": "slips", "backward": "slips"}
    acting = [f"{name} {words[mode]}" for name, mode in modes.items() if mode in words]
    shown = acting[:_LISTED]
    if len(acting) > _LISTED:
        shown.append(f"and {len(acting) - _LISTED} more")
    rest = len(modes) - len(acting)
    if rest:
        shown.append(f"{rest} open" if acting else "all open")
    return ["at the end: " + ", ".join(shown)]


def _recorded(name: str, record: Mapping[str, Any]) -> str:
    times, count, last = record["times"], record["columns"], record["last"]
    if times > 1:
        return f"`{name}` recorded {counted(count, 'column')} {times} times"
    values = (f"{column} = {_jump(*both)}" for column, both in last["values"].items())
    return f"`{name}` recorded at t = {last['time']:.9g} s: " + ", ".join(values)


def _jump(before: float | None, after: float | None) -> str:
    """Return the two limits of a number, or one if they are equal."""
    shown = ["nan" if x is None else f"{x:.6g}" for x in (before, after)]
    return " → ".join(dict.fromkeys(shown))
