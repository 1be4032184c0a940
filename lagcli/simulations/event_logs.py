"""The event log of a run, and the recorded columns of its events."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from itertools import groupby

import numpy as np

from lagcli.arrays import Array, Indices
from lagcli.columns import SAMPLED, column_names
from lagcli.engine.contract import Block, OneSidedLimits, Outcome
from lagcli.engine.event_entries import OCCURRENCES, EventEntries
from lagcli.engine.switching.switching import EventRule
from lagcli.engine.system import System
from lagcli.simulations.derived import DerivedColumns
from lagcli.sparse_table import merged_changes
from lagcli.trajectory.event_log import NOTHING_RECORDED, EventLog, EventRecords
from lagcli.trajectory.samples import Samples

_EVENT, _REST, _REDUNDANT = (OCCURRENCES.index(x) for x in ("event", "rest", "redundant"))
#: Number of jumps that are evaluated at a time.
_JUMPS = 1000


def event_log(
    system: System,
    outcome: Outcome,
    derived: DerivedColumns | None = None,
    names: tuple[str, ...] = (),
) -> EventLog | None:
    """Return the log of a run; None for a System without switching.

    Parameters
    ----------
    system : System
    outcome : Outcome
    derived : DerivedColumns, optional
        The evaluator that completed the samples; without it, the log contains no recorded columns.
    names : tuple of n str, optional
        Parameters and initial values of the run's derivatives.
    """
    switching = system.switching
    if switching is None:
        return None
    entries = outcome.events
    assert entries is not None
    kinds, which = entries.integers("occurrence"), entries.integers("which")
    # a sequence of impacts ends slightly after the instant at which its limit is known
    time = _ended_by_what_follows(entries.part("time"), kinds, which)
    order = np.argsort(time, kind="stable")
    records = NOTHING_RECORDED
    if derived is not None and outcome.limits:
        place = np.argsort(order)
        rules = [switching.events[which[x.entry]] for x in outcome.limits]
        limits = [x._replace(entry=int(place[x.entry])) for x in outcome.limits]
        records = event_records(system, derived, limits, rules)
    named = [*system.constraints, *(rule.name for rule in switching.events)]
    number = which + len(system.constraints) * (kinds == _EVENT)
    start = np.array(outcome.modes, dtype=np.intp).reshape(len(switching.rows))
    changes = entries.changes
    # modes never go back: an entry that moves ahead of others shows what they have changed
    shown = np.searchsorted(np.maximum.accumulate(order), changes.row)
    vectors = ("q", "before", "after", "loss", "supplied", "work")
    return EventLog(
        rows=tuple(system.constraints[row.row] for row in switching.rows),
        start=start,
        time=time[order],
        names=tuple(named[i] for i in number[order].tolist()),
        kinds=tuple(OCCURRENCES[k] for k in kinds[order].tolist()),
        mode_changes=merged_changes(start, len(order), shown, changes.column, changes.value),
        nonzero_impulses=entries.impulses.taken(order),
        records=records,
        parameters=names,
        dtime=entries.part("dtime")[order] if names else np.empty((0, 0)),
        **{name: entries.part(name)[order] for name in vectors},
    )


def states_of_jumps(entries: EventEntries) -> Iterator[tuple[Array, Array, Array]]:
    """Yield t, q and v before and after the entries of a log that change the velocities."""
    before, after = entries.part("before"), entries.part("after")
    # the time of a contact that comes to rest is later than its state
    now = entries.integers("occurrence") != _REST
    jumps = np.flatnonzero(now & (before != after).any(axis=1))
    for first in range(0, len(jumps), _JUMPS):
        some = jumps[first : first + _JUMPS]
        for v in (before, after):
            yield entries.part("time")[some], entries.part("q")[some], v[some]


def _ended_by_what_follows(time: Array, kinds: Indices, which: Indices) -> Array:
    """Return the times of entries, with no contact at rest later than at its next change.

    A contact whose λ is not unique as it comes to rest is so from then on.
    """
    ended = time.copy()
    changes = np.flatnonzero((kinds != _EVENT) & (kinds != _REDUNDANT))
    changes = changes[np.argsort(which[changes], kind="stable")]
    rests = np.flatnonzero(kinds[changes[:-1]] == _REST)
    for i, following in zip(changes[rests[::-1]], changes[rests[::-1] + 1], strict=True):
        if which[i] == which[following]:
            ended[i] = min(ended[i], ended[following])
    at_rest: dict[int, float] = {}
    for k in np.flatnonzero((kinds == _REST) | (kinds == _REDUNDANT)):
        if kinds[k] == _REST:
            at_rest[which[k]] = ended[k]
        else:
            ended[k] = max(ended[k], at_rest.get(which[k], ended[k]))
    return ended


def event_records(
    system: System,
    derived: DerivedColumns,
    limits: Sequence[OneSidedLimits],
    rules: Sequence[EventRule],
) -> EventRecords:
    """Return the recorded columns of events.

    Parameters
    ----------
    system : System
    derived : DerivedColumns
        The evaluator that completed the samples of the run; it is not changed.
    limits : sequence of OneSidedLimits
        Limits of the events that record something.
    rules : sequence of EventRule
        Names of columns to record for each limit.
    """
    if not limits:
        return NOTHING_RECORDED
    left = _columns(system, derived, [(x.left, x.left_p) for x in limits])
    right = _columns(system, derived, [(x.right, x.right_p) for x in limits])
    every = tuple(name for name in left if name not in _TIMES)
    asked = [every if rule.record is None else rule.record for rule in rules]
    named = dict.fromkeys(name for names in asked for name in names)
    columns = tuple(sorted(named, key=[*left, *named].index))
    recorded = np.array([[name in names for name in columns] for names in map(set, asked)])
    nothing = np.zeros(len(limits))  # a constraint's force on a coordinate that it does not act on
    before, after = (
        np.where(
            recorded,
            np.column_stack([values.get(name, nothing) for name in columns]),
            np.nan,
        )
        for values in (left, right)
    )
    return EventRecords(
        columns=columns,
        entry=np.array([x.entry for x in limits], dtype=np.intp),
        before=before,
        after=after,
    )


#: Names of the time, which every entry has.
_TIMES = ("t", "time")


def _columns(
    system: System, derived: DerivedColumns, states: Sequence[tuple[Array, tuple[float, ...]]]
) -> dict[str, Array]:
    """Return all columns of sample rows, by name, with the parameters of each."""
    parts = []
    for p, group in groupby(states, key=lambda state: state[1]):
        own = copy.copy(derived)
        own.p = p
        with np.errstate(all="ignore"):  # NaN if a and lambda are unknown
            samples = own(Block.of_rows(np.array([x for x, _ in group]), system.sample_layout))
        parts.append(_named(samples))
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    return columns | {"time": columns["t"]}


def _named(samples: Samples) -> dict[str, Array]:
    """Return the columns of samples by their names in CSV files."""
    coordinates, constraints, terms = samples.coordinates, samples.constraints, samples.terms
    pairs = terms.names(coordinates, constraints)
    named: dict[str, Array] = {}
    for quantity in SAMPLED:
        names = column_names(quantity, coordinates, constraints, pairs, samples.conserved_names)
        values = getattr(samples, quantity.name).reshape(len(samples.time), len(names))
        named |= zip(map(str, names), values.T, strict=True)
    return named | dict(samples.outputs)
