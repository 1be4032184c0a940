"""Logs of runs: rows of numbers, and the records of their entries."""

from __future__ import annotations

import numpy as np
import pytest

from lagcli.engine.event_entries import (
    OCCURRENCES,
    EntryCounts,
    EventEntries,
    EventEntry,
    entry_layout,
)

COUNTS = EntryCounts(nq=2, nc=3, ns=1, n=2)
WIDTH = 6 + 1 + 3 * 2 + 3 + 2


def random_entry(random: np.random.Generator) -> EventEntry:
    vectors = [random.standard_normal(n) for n in (2, 2, 2, 3)]
    kind = OCCURRENCES[random.integers(len(OCCURRENCES))]
    numbers = random.standard_normal(3).tolist()
    modes, dtime = random.integers(0, 4, 1), random.standard_normal(2)
    return EventEntry(
        random.random(), kind, int(random.integers(9)), *vectors, *numbers, modes, dtime
    )


def same(found: EventEntry, given: EventEntry) -> bool:
    return all(np.array_equal(a, b) for a, b in zip(found, given, strict=True))


def test_entries_come_back_as_they_were_given() -> None:
    random = np.random.default_rng(1)
    given = [random_entry(random) for _ in range(200)]
    log = EventEntries(COUNTS)
    for entry in given:
        log.append(entry)
    assert len(log) == 200
    assert all(map(same, log, given))
    assert all(map(same, log[-3:], given[-3:]))
    assert same(log[-1], given[-1])
    with pytest.raises(IndexError):
        log[200]
    assert log.part("time").tolist() == [x.time for x in given]
    assert log.part("work").tolist() == [x.work for x in given]
    np.testing.assert_array_equal(log.impulses.dense(), [x.impulse for x in given])
    np.testing.assert_array_equal(log.part("dtime"), [x.dtime for x in given])
    kinds = [OCCURRENCES[k] for k in log.integers("occurrence", 150).tolist()]
    assert kinds == [x.occurrence for x in given[150:]]
    np.testing.assert_array_equal(log.modes(), [x.modes for x in given])
    np.testing.assert_array_equal(log.modes(150), [x.modes for x in given[150:]])


def test_rows_are_copied_in_the_order_of_the_core() -> None:
    """Numbers of the entry, modes, q, velocities before and after, impulse, dtime."""
    log, block = EventEntries(COUNTS), np.arange(2.0 * WIDTH).reshape(2, WIDTH)
    block[:, 1] = 4, 5
    log.add(block[:0])
    log.add(block)
    block[:] = np.nan
    first, second = log
    assert (first.time, first.occurrence, first.which) == (0, "impact", 2)
    assert (first.loss, first.supplied, first.work) == (3, 4, 5)
    parts = (first.modes, first.q, first.before, first.after, first.impulse, first.dtime)
    assert [x.tolist() for x in parts] == [
        *([6], [7, 8], [9, 10], [11, 12], [13, 14, 15], [16, 17]),
    ]
    assert (second.time, second.occurrence) == (WIDTH, "rest")


def test_an_entry_is_corrected() -> None:
    random = np.random.default_rng(2)
    log = EventEntries(COUNTS)
    for _ in range(3):
        log.append(random_entry(random))
    given = [log[0], log[1]._replace(work=3.0, after=np.array([1.0, 2.0])), log[2]]
    log.correct(1, work=3.0, after=np.array([1.0, 2.0]))
    assert all(map(same, log, given))


@pytest.mark.parametrize("seed", range(20))
def test_modes_are_replaced_as_in_a_list(seed: int) -> None:
    """Random sequences of new entries, and of new modes of some of the last ones."""
    random = np.random.default_rng(seed)
    counts = EntryCounts(nq=1, nc=4, ns=5)
    log, expected = EventEntries(counts), np.empty((0, 5), dtype=int)
    impulses = np.empty((0, 4))
    for _ in range(12):
        size = int(random.integers(1, 400))
        rows = random.standard_normal((size, log.layout.size))
        few = random.random((size, 5)) < 0.01
        now = expected[-1] if len(expected) else np.zeros(5)
        for i, row in enumerate(rows):
            now = np.where(few[i], random.integers(0, 4, 5), now)
            row[log.layout.modes] = now
            row[log.layout.impulse] *= random.random(4) < 0.3
        log.add(rows)
        expected = np.vstack([expected, rows[:, log.layout.modes].astype(int)])
        impulses = np.vstack([impulses, rows[:, log.layout.impulse]])
        first = len(log) - int(random.integers(0, 9))
        places = first + np.flatnonzero(random.random(len(log) - first) < 0.5)
        modes = random.integers(0, 4, 5)
        log.replace_modes(places, modes)
        expected[places] = modes
    np.testing.assert_array_equal(log.modes(), expected)
    np.testing.assert_array_equal(log.impulses.dense(), impulses)
    assert len(log.changes.value) < 0.1 * expected.size
    for i in random.integers(0, len(log), 5).tolist():
        np.testing.assert_array_equal(log[i].modes, expected[i])
        np.testing.assert_array_equal(log[i].impulse, impulses[i])


def test_derivatives_of_the_time_are_unknown_where_none_are_given() -> None:
    log = EventEntries(COUNTS)
    log.append(random_entry(np.random.default_rng(3))._replace(dtime=np.nan))
    assert np.isnan(log[0].dtime).all()
    assert log[0].dtime.shape == (2,)


def test_layouts() -> None:
    assert entry_layout(COUNTS) is entry_layout(EntryCounts(2, 3, 1, 2))
    assert entry_layout(COUNTS).size == WIDTH
    nothing = EventEntries(EntryCounts())
    assert len(nothing) == 0
    assert list(nothing) == []
