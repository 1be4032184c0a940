"""The log of a run from the entries of an engine."""

from __future__ import annotations

import numpy as np

import lagcli
from lagcli.engine.contract import EventEntry, OneSidedLimits, Outcome
from lagcli.engine.lowering import lower
from lagcli.equations.derivation.lagrange import derive
from lagcli.simulations.derived import DerivedColumns
from lagcli.simulations.switching.event_logs import event_log
from tests.support.switching_models import BALL


def entry(occurrence: str, which: int, **changes: object) -> EventEntry:
    nothing, v = np.zeros(3), np.array([0.0, -1.0])
    given = EventEntry(
        0.5, occurrence, which, np.array([0.0, 0.0]), v, -0.8 * v, nothing, 0.0, 0.0, 0.0, [0, 0]
    )
    return given._replace(**changes)


def test_entries_become_a_log() -> None:
    system = lower(derive(lagcli.load_text(BALL)))
    assert system.constraints == ("wall", "floor", "floor.slip")
    entries = [
        entry("impact", 1, impulse=np.array([0.0, 3.6, 0.0]), loss=0.36),
        entry("sticks", 2, time=0.6, modes=[1, 1]),
        entry("event", 0, time=1.0, work=2.0, modes=[1, 1]),
    ]
    log = event_log(
        system,
        Outcome("stopped-by-event", events=entries, modes=(0, 0)),
        DerivedColumns(system, ()),
    )
    assert log is not None
    log.check()
    assert log.rows == ("floor", "floor.slip")
    assert log.names == ("floor", "floor.slip", "late")
    assert log.kinds == ("impact", "sticks", "event")
    assert log.time.tolist() == [0.5, 0.6, 1.0]
    assert log.after[0].tolist() == [0.0, 0.8]
    assert log.impulse[0].tolist() == [0.0, 3.6, 0.0]
    assert (log.loss.sum(), log.work.sum()) == (0.36, 2.0)
    assert log.modes.tolist() == [[0, 0], [1, 1], [1, 1]]


def test_a_rest_ends_by_the_next_change_and_changes_no_later_modes() -> None:
    """A ball whose bounces would end at 0.7 is thrown at 0.6; another mode changes at 0.55."""
    system = lower(derive(lagcli.load_text(BALL)))
    entries = [
        entry("impact", 1, modes=[1, 0]),
        entry("rest", 1, time=0.7, modes=[1, 0]),
        entry("sticks", 2, time=0.55, modes=[1, 1]),
        entry("opens", 1, time=0.6, modes=[0, 0]),
    ]
    outcome = Outcome("completed", events=entries, modes=(0, 0))
    log = event_log(system, outcome)
    assert log is not None
    log.check()
    assert log.kinds == ("impact", "sticks", "rest", "opens")
    assert log.time.tolist() == [0.5, 0.55, 0.6, 0.6]
    assert log.modes.tolist() == [[1, 0], [1, 1], [1, 1], [0, 0]]


def test_entries_are_in_the_order_of_time() -> None:
    """A sequence of impacts ends later than the instant at which an event answers its last one."""
    system = lower(derive(lagcli.load_text(BALL)))
    entries = [entry("impact", 1), entry("rest", 1, time=0.5 + 1e-9), entry("event", 0)]
    row = np.zeros(system.sample_layout.size)
    limits = [OneSidedLimits(2, row, row, (2.0, 9.81), (2.0, 9.81))]
    outcome = Outcome("completed", events=entries, modes=(0, 0), limits=limits)
    log = event_log(system, outcome, DerivedColumns(system, (2.0, 9.81)))
    assert log is not None
    log.check()
    assert log.kinds == ("impact", "event", "rest")
    assert log.records.entry.tolist() == [1]


def test_a_run_without_events_has_an_empty_log() -> None:
    system = lower(derive(lagcli.load_text(BALL)))
    log = event_log(system, Outcome("completed", modes=(0, 0)))
    assert log is not None
    assert (len(log), log.q.shape, log.impulse.shape, log.modes.shape) == (
        0,
        (0, 2),
        (0, 3),
        (0, 2),
    )


def test_a_model_without_contacts_has_none() -> None:
    system = lower(derive(lagcli.load("slider_crank")))
    assert event_log(system, Outcome("completed")) is None
