"""Logs of runs from given entries."""

from __future__ import annotations

from collections.abc import Iterable

from lagcli.engine.event_entries import EntryCounts, EventEntries, EventEntry
from lagcli.engine.system import System


def log_of(system: System, entries: Iterable[EventEntry] = ()) -> EventEntries:
    """Return the log of a run of a System with these entries."""
    assert system.switching is not None
    sizes = (system.coordinates, system.constraints, system.switching.rows)
    log = EventEntries(EntryCounts(*map(len, sizes)))
    for entry in entries:
        log.append(entry)
    return log
