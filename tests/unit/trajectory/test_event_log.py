"""The log of contacts and events: modes at samples, counts, and sequences that came to rest."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from trajectories import make_log, make_with_log

from lagcli.engine.switching.switching import RowMode
from lagcli.sparse_table import SparseTable, changes_of
from lagcli.trajectory.event_log import KINDS, MODES, EventLog, Rest, event_sentences


def test_modes_and_kinds_are_those_of_the_engine() -> None:
    from typing import get_args

    from lagcli.engine.event_entries import Occurrence

    assert tuple(mode.name.lower() for mode in RowMode) == MODES
    assert set(KINDS) == set(get_args(Occurrence))


def test_modes_at_a_sample_are_those_after_what_happens_there() -> None:
    log = dataclasses.replace(
        make_log(entries=((0.1, "floor", "closes"), (0.2, "floor", "impact"))),
        start=np.array([0, 0]),
        mode_changes=changes_of(np.array([0, 0]), np.array([[1, 2], [0, 0]])),
    )
    found = log.modes_at(np.array([0.0, 0.1, 0.15, 0.2, 1.0]))
    assert found.tolist() == [[0, 0], [1, 2], [1, 2], [0, 0], [0, 0]]
    nothing = make_log(entries=())
    assert nothing.modes_at(np.array([0.0, 1.0])).tolist() == [[0, 0], [0, 0]]


def test_modes_of_a_trajectory() -> None:
    run = make_with_log()
    assert run.modes is not None
    assert run.modes.shape == (5, 2)
    assert dataclasses.replace(run, events=None).modes is None


def test_rests_count_the_impacts_since_the_contact_last_rested() -> None:
    entries = [(0.1, "floor", "impact"), (0.2, "floor", "impact"), (0.3, "floor", "rest")]
    entries += [(0.5, "floor", "opens"), (0.7, "floor", "impact"), (0.8, "floor", "rest")]
    log = make_log(entries=tuple(entries))
    assert log.rests() == [Rest("floor", 0.3, 2), Rest("floor", 0.8, 1)]
    # contacts that strike in turn open each other
    turns = [(0.1 * k, name, kind) for k, (name, kind) in enumerate(
        [("a", "impact"), ("b", "impact"), ("a", "opens"), ("a", "impact"), ("b", "opens"),
         ("a", "rest"), ("b", "rest")]
    )]  # fmt: skip
    assert [x.impacts for x in make_log(entries=tuple(turns)).rests()] == [2, 1]
    assert str(Rest("floor", 4.06371276890123, 132)) == (
        "`floor` came to rest at t = 4.0637127689 s after 132 impacts"
    )
    assert str(log.rests()[1]).endswith("after 1 impact")
    assert log.counts() == {"floor": {"impact": 3, "rest": 2, "opens": 1}}
    assert log.instants("floor", "impact").tolist() == [0.1, 0.2, 0.7]


def test_sentences() -> None:
    log = dataclasses.replace(
        make_log(), loss=np.full(6, 0.5), supplied=np.zeros(6), work=np.array([0.0] * 5 + [2.0])
    )
    counts, note, _, recorded, energy = event_sentences(log.to_mapping())
    assert counts == "floor: impact 2, rest 1; floor.slip: impact 1, slips 1; kick: event 1"
    assert note == "note: `floor` came to rest at t = 0.25 s after 2 impacts"
    assert recorded.startswith("`kick` recorded at t = 0.4 s: y_dot = ")
    assert " → " in recorded
    assert energy == "impacts dissipated 3 J, events did work 2 J"
    assert event_sentences(make_log(entries=()).to_mapping()) == [
        "no changes of contacts, no events"
    ]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"time": np.array([0.2, 0.1] + [0.3] * 4)}, "decrease"),
        ({"time": np.array([0.1] * 5 + [np.nan])}, "finite"),
        ({"kinds": ("impact",) * 5 + ("crash",)}, "'crash'"),
        ({"start": np.array([0, 4])}, "mode"),
        ({"mode_changes": SparseTable.of(np.full((6, 2), -1))}, "mode"),
        ({"mode_changes": SparseTable.of(np.full((6, 3), 1))}, "shape"),
        ({"nonzero_impulses": SparseTable.of(np.full((6, 3), 1e308))}, "impulse of the events"),
        ({"rows": ("floor", "floor")}, "twice"),
        ({"work": np.full(6, 1e308)}, "work of the events, or its sum, is infinite"),
        ({"loss": np.array([0.0] * 5 + [-np.inf])}, "loss of the events"),
    ],
)
def test_a_log_without_sense_is_rejected(change: dict[str, object], message: str) -> None:
    make_log().check()
    log: EventLog = dataclasses.replace(make_log(), **change)
    with pytest.raises(ValueError, match=message):
        log.check()


def test_long_lists_of_contacts_at_rest_are_cut() -> None:
    found = make_log().to_mapping()
    found["rests"] = [{"name": "floor", "time": float(k), "impacts": 1} for k in range(3000)]
    notes = [text for text in event_sentences(found) if text.startswith("note: ")]
    assert len(notes) == 9
    assert notes[-1] == "note: contacts came to rest 2992 more times"


def test_what_holds_at_the_end() -> None:
    log = make_log(entries=((0.1, "floor", "closes"), (0.2, "floor.slip", "slips")))
    for modes, said in (
        ([1, 3], "at the end: floor holds, floor.slip slips"),
        ([1, 0], "at the end: floor holds, 1 open"),
        ([0, 0], "at the end: all open"),
    ):
        changes = changes_of(log.start, np.array([[1, 1], modes]))
        found = dataclasses.replace(log, mode_changes=changes).to_mapping()
        assert said in event_sentences(found)
    assert found["at_end"] == {"floor": "open", "floor.slip": "open"}
    nothing = dataclasses.replace(make_log(entries=()), start=np.array([1, 2]))
    assert nothing.to_mapping()["at_end"] == {"floor": "holds", "floor.slip": "forward"}


def test_recorded_columns() -> None:
    entries = ((0.1, "kick", "event"), (0.2, "floor", "impact"), (0.3, "kick", "event"))
    log = make_log(entries=entries)
    records = log.records
    before, after = log.recorded("lambda.guide")
    assert np.isnan(before).tolist() == [False, True, False]
    assert before[2] == records.before[1, 1]
    assert after[0] == records.after[0, 1]
    assert list(records.of(1)) == ["lambda.guide"]  # the second records no more
    with pytest.raises(KeyError):
        log.recorded("x")
    found = log.to_mapping()["recorded"]["kick"]
    assert (found["times"], found["columns"], found["last"]["time"]) == (2, 1, 0.3)
    assert found["last"]["values"] == {"lambda.guide": [before[2], after[2]]}
    assert "`kick` recorded 1 column 2 times" in event_sentences(log.to_mapping())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"entry": np.array([6])}, "that do not exist"),
        ({"entry": np.array([-1])}, "that do not exist"),
        ({"before": np.zeros((2, 2))}, "columns differ in number"),
        ({"columns": ("y_dot", "y_dot")}, "twice"),
    ],
)
def test_records_without_sense_are_rejected(change: dict[str, object], message: str) -> None:
    log = make_log()
    log = dataclasses.replace(log, records=dataclasses.replace(log.records, **change))
    with pytest.raises(ValueError, match=message):
        log.check()


def test_xarray() -> None:
    pytest.importorskip("xarray")
    run = make_with_log()
    dataset = run.to_xarray()
    assert dataset["mode"].sel(row="floor").dims == ("time",)
    assert dataset["mode"].values.tolist() == run.modes.tolist()
    assert dataset["event_impulse"].sel(constraint="floor").values.tolist() == (
        run.events.impulse[:, 1].tolist()
    )
    assert dataset["event_name"].values.tolist() == list(run.events.names)
    assert run.events is not None
    assert dataset["recorded_after"].sel(column="y_dot").values.tolist() == (
        run.events.records.after[:, 0].tolist()
    )
    assert dataset["recorded_time"].values.tolist() == [0.4]
    assert "mode" not in dataclasses.replace(run, events=None).to_xarray()
