"""The event log of a run, and the recorded columns of its events."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Sequence
from itertools import groupby

import numpy as np

from lagcli.arrays import Array
from lagcli.columns import SAMPLED, column_names
from lagcli.engine.contract import Block, EventEntry, OneSidedLimits, Outcome
from lagcli.engine.switching.switching import EventRule
from lagcli.engine.system import System
from lagcli.simulations.derived import DerivedColumns
from lagcli.trajectory.event_log import NOTHING_RECORDED, EventLog, EventRecords
from lagcli.trajectory.samples import Samples


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
    # a sequence of impacts ends slightly after the instant at which its limit is known
    unordered = _ended_by_what_follows(outcome.events)
    order = sorted(range(len(unordered)), key=lambda i: unordered[i].time)
    entries, count = [unordered[i] for i in order], len(order)
    latest = itertools.accumulate(order, max)
    records = NOTHING_RECORDED
    if derived is not None and outcome.limits:
        place = {entry: i for i, entry in enumerate(order)}
        limits = [x._replace(entry=place[x.entry]) for x in outcome.limits]
        rules = [switching.events[entries[x.entry].which] for x in limits]
        records = event_records(system, derived, limits, rules)
    nq, nc, ns = len(system.coordinates), len(system.constraints), len(switching.rows)
    return EventLog(
        rows=tuple(system.constraints[row.row] for row in switching.rows),
        start=np.array(outcome.modes, dtype=np.intp).reshape(ns),
        time=np.array([e.time for e in entries], dtype=float),
        names=tuple(
            switching.events[e.which].name
            if e.occurrence == "event"
            else system.constraints[e.which]
            for e in entries
        ),
        kinds=tuple(e.occurrence for e in entries),
        q=np.array([e.q for e in entries], dtype=float).reshape(count, nq),
        before=np.array([e.before for e in entries], dtype=float).reshape(count, nq),
        after=np.array([e.after for e in entries], dtype=float).reshape(count, nq),
        impulse=np.array([e.impulse for e in entries], dtype=float).reshape(count, nc),
        loss=np.array([e.loss for e in entries], dtype=float),
        supplied=np.array([e.supplied for e in entries], dtype=float),
        work=np.array([e.work for e in entries], dtype=float),
        modes=np.array([unordered[i].modes for i in latest], dtype=np.intp).reshape(count, ns),
        records=records,
        parameters=names,
        dtime=_dtime(outcome, order) if names else np.empty((0, 0)),
    )


def _ended_by_what_follows(entries: Sequence[EventEntry]) -> list[EventEntry]:
    """Return the entries, with no contact at rest later than at its next change."""
    ended, following = list(entries), dict[int, float]()
    for i in reversed(range(len(ended))):
        entry = ended[i]
        if entry.occurrence == "rest":
            time = min(entry.time, following.get(entry.which, entry.time))
            ended[i] = entry._replace(time=time)
        if entry.occurrence != "event":
            following[entry.which] = ended[i].time
    return ended


def _dtime(outcome: Outcome, order: Sequence[int]) -> Array:
    """Return derivatives of the times of entries, in a given order."""
    assert outcome.event_changes is not None
    return outcome.event_changes[np.array(order, dtype=np.intp)]


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
