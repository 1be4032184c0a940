"""The limits of the motion at the instants of events."""

from __future__ import annotations

import numpy as np

from lagcli.engine.contract import EventEntry, Occurrence
from lagcli.engine.switching.recorded_instants import RecordedInstants
from lagcli.engine.switching.switching import EventRule

LEFT, RIGHT = np.array([1.0, 2.0]), np.array([1.0, 3.0])


def entry(what: Occurrence, which: int) -> EventEntry:
    nothing = np.zeros(1)
    modes = np.zeros(1, dtype=np.intp)
    return EventEntry(1.0, what, which, nothing, nothing, nothing, nothing, 0.0, 0.0, 0.0, modes)


def test_entries_of_one_instant_have_its_limits() -> None:
    instants = RecordedInstants([EventRule("all"), EventRule("none", record=())])
    assert instants.records
    assert not instants.open
    instants.begin(LEFT, (1.0,))
    assert instants.open
    instants.add(4, [entry("impact", 0), entry("event", 0), entry("event", 1)])
    instants.add(7, [entry("event", 0)])
    instants.end(RIGHT, (2.0,))
    assert not instants.open
    assert [x.entry for x in instants.limits] == [5, 7]
    for found in instants.limits:
        assert found.left is LEFT
        assert found.right is RIGHT
        assert (found.left_p, found.right_p) == ((1.0,), (2.0,))


def test_an_instant_without_end_has_a_limit_from_the_left_alone() -> None:
    instants = RecordedInstants([EventRule("all")])
    instants.begin(LEFT, ())
    instants.add(0, [entry("event", 0)])
    instants.end(None, ())
    assert instants.limits[0].right[0] == 1.0
    assert np.isnan(instants.limits[0].right[1])


def test_events_that_record_nothing() -> None:
    assert not RecordedInstants([EventRule("none", record=())]).records
