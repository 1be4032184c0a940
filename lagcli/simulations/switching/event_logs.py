"""The event log of a run, from the engine's outcome."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.contract import EventEntry, Outcome
from lagcli.engine.system import System
from lagcli.simulations.derived import DerivedColumns
from lagcli.trajectory.event_log import NOTHING_RECORDED, EventLog


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
    found = _ended_by_what_follows(outcome.events)
    order = sorted(range(len(found)), key=lambda i: found[i].time)
    entries, count = [found[i] for i in order], len(order)
    latest = itertools.accumulate(order, max)
    records = NOTHING_RECORDED
    if derived is not None and outcome.limits:
        from lagcli.simulations.switching.event_records import event_records

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
        modes=np.array([found[i].modes for i in latest], dtype=np.intp).reshape(count, ns),
        records=records,
        parameters=names,
        dtime=_dtime(outcome, order) if names else np.empty((0, 0)),
    )


def _ended_by_what_follows(entries: Sequence[EventEntry]) -> list[EventEntry]:
    """Return the entries, with no contact at rest later than at its next change."""
    found, following = list(entries), dict[int, float]()
    for i in reversed(range(len(found))):
        entry = found[i]
        if entry.occurrence == "rest":
            time = min(entry.time, following.get(entry.which, entry.time))
            found[i] = entry._replace(time=time)
        if entry.occurrence != "event":
            following[entry.which] = found[i].time
    return found


def _dtime(outcome: Outcome, order: Sequence[int]) -> Array:
    """Return derivatives of the times of entries, in a given order."""
    assert outcome.event_changes is not None
    return outcome.event_changes[np.array(order, dtype=np.intp)]
