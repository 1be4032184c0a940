"""The log of a run from the entries of an engine."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.engine.contract import OneSidedLimits, Outcome
from lagcli.engine.event_entries import EventEntry
from lagcli.engine.lowering.lower import lower
from lagcli.equations.derivation.lagrange import derive
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.derived import DerivedColumns
from lagcli.simulations.event_logs import event_log, event_records
from lagcli.simulations.simulation import prepare
from lagcli.trajectory.event_log import NOTHING_RECORDED, EventLog
from lagcli.trajectory.trajectory import Trajectory
from tests.support.event_logs import log_of
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
        Outcome("stopped-by-event", events=log_of(system, entries), modes=(0, 0)),
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
    outcome = Outcome("completed", events=log_of(system, entries), modes=(0, 0))
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
    outcome = Outcome("completed", events=log_of(system, entries), modes=(0, 0), limits=limits)
    log = event_log(system, outcome, DerivedColumns(system, (2.0, 9.81)))
    assert log is not None
    log.check()
    assert log.kinds == ("impact", "event", "rest")
    assert log.records.entry.tolist() == [1]


@pytest.mark.parametrize("seed", range(5))
def test_random_logs(seed: int) -> None:
    """Each rest ends by the next change of its row, and the log is in the order of time."""
    random = np.random.default_rng(seed)
    system = lower(derive(lagcli.load_text(BALL)))
    entries = []
    for time in np.cumsum(random.exponential(size=60)).tolist():
        kind = str(random.choice(["impact", "rest", "rest", "opens", "event"]))
        which = 0 if kind == "event" else int(random.integers(1, 3))
        late = random.exponential(2.0) * (kind == "rest")
        entries.append(entry(kind, which, time=time + late, modes=random.integers(0, 4, 2)))
    log = event_log(system, Outcome("completed", events=log_of(system, entries), modes=(0, 0)))
    assert log is not None
    log.check()
    ended = []
    for i, x in enumerate(entries):
        later = [
            y.time
            for y in entries[i + 1 :]
            if (y.which, y.occurrence != "event") == (x.which, True)
        ]
        rests = x.occurrence == "rest"
        ended.append(x._replace(time=min([x.time, *later])) if rests else x)
    ordered = sorted(range(60), key=lambda i: ended[i].time)
    names = (*system.constraints, "late")
    assert log.time.tolist() == [ended[i].time for i in ordered]
    assert log.kinds == tuple(entries[i].occurrence for i in ordered)
    number = [3 if entries[i].occurrence == "event" else entries[i].which for i in ordered]
    assert log.names == tuple(names[i] for i in number)
    latest = [max(ordered[: k + 1]) for k in range(60)]
    assert log.modes.tolist() == [entries[i].modes.tolist() for i in latest]


def test_a_run_without_events_has_an_empty_log() -> None:
    system = lower(derive(lagcli.load_text(BALL)))
    log = event_log(system, Outcome("completed", events=log_of(system), modes=(0, 0)))
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


RECORDED_BALL = """
coordinates: {x: m, y: m}
parameters: {m: 2 kg, g: 10 m/s^2, e: 0.5, k: 3 N/m}
T: m/2*(x'^2 + y'^2)
V: m*g*y + k/2*x^2
constraints:
  floor: {expr: y >= 0, restitution: e}
outputs: {height: y + x}
events:
  hit: {when: floor impacts, record: [y', lambda.floor, height, energy_total, y_ddot]}
  stiffer: {when: t >= 0.7, set: {k: 2*k}}
  quiet: {when: t >= 0.75, record: false, set: {x': 0}}
  end: {when: t >= 1.2, stop: true, record: [y]}
initial: {x: 1, y: 1, x': 0, y': 0}
simulation: {t_end: 2, times: [0, 0.7, 0.8, 1.2, 1.5, 2]}
"""

ROD = """
coordinates: {x: m, y: m}
parameters: {m: 2 kg, g: 10 m/s^2, l: 5 m}
T: m/2*(x'^2 + y'^2)
V: m*g*y
constraints:
  rod: x^2 + y^2 = l^2
events:
  cut: {when: t >= 0.5, release: rod}
  tie: {when: x' >= 100, engage: rod}
initial: {x: 0, y: -5, x': 2, y': 0}
simulation: {t_end: 1, samples: 3}
"""


def run(text: str) -> tuple[Trajectory, EventLog]:
    settings = SettingsOverrides(rtol=1e-11)
    found = lagcli.simulate(lagcli.load_text(text), settings)
    assert found.events is not None
    found.events.check()
    return found, found.events


def values(log: EventLog, column: str, event: str) -> tuple[np.ndarray, np.ndarray]:
    """Return a column before and after the instants of an event."""
    of = [name == event for name in log.names]
    before, after = log.recorded(column)
    return before[of], after[of]


def test_a_ball_that_bounces() -> None:
    """Speeds halve at t = √(2h/g), 2 of these and 5/2 of these, and energy is lost with them."""
    found, log = run(RECORDED_BALL)
    fall = np.sqrt(0.2)
    np.testing.assert_allclose(
        log.time[[n == "hit" for n in log.names]], fall * np.array([1, 2, 2.5]), rtol=1e-9
    )
    before, after = values(log, "y_dot", "hit")
    speeds = 10 * fall * 0.5 ** np.arange(4)
    np.testing.assert_allclose(before, -speeds[:3], rtol=1e-9)
    np.testing.assert_allclose(after, speeds[1:], rtol=1e-9)
    before, after = values(log, "energy_total", "hit")
    np.testing.assert_allclose(before - after, 0.75 * speeds[:3] ** 2, rtol=1e-9)
    assert values(log, "lambda.floor", "hit")[0].tolist() == [0, 0, 0]
    assert values(log, "y_ddot", "hit")[1] == pytest.approx([-10] * 3)
    before, after = values(log, "height", "hit")
    omega = np.sqrt(1.5)
    assert before[0] == after[0] == pytest.approx(np.cos(omega * fall), rel=1e-9)
    assert found.status == "stopped-by-event"
    assert found.time[-1] == 1.2


def test_an_event_without_the_key_records_all_columns() -> None:
    _, log = run(RECORDED_BALL)
    records = log.records
    kept = {log.names[entry]: records.of(i) for i, entry in enumerate(records.entry)}
    assert set(kept) == {"hit", "stiffer", "end"}
    assert list(kept["end"]) == ["y"]
    assert {"x", "x_dot", "x_ddot", "lambda.floor", "Qc.floor.y", "energy_total", "height"} <= set(
        kept["stiffer"]
    )
    # k = 3 N/m becomes 6 N/m: a and V double at the same x
    before, after = kept["stiffer"]["x_ddot"]
    x = kept["stiffer"]["x"][0]
    assert (before, after) == (pytest.approx(-1.5 * x), pytest.approx(-3 * x))
    before, after = kept["stiffer"]["energy_potential"]
    assert after - before == pytest.approx(1.5 * x**2, rel=1e-9)


def test_columns_follow_parameters_that_events_set() -> None:
    """The energies of samples after `set` are those of the new values."""
    found, log = run(RECORDED_BALL)
    assert np.abs(found.energy_balance).max() < 1e-8 * 21.5
    np.testing.assert_allclose(
        np.diff(values(log, "energy_total", "stiffer"), axis=0).ravel(),
        log.work[[n == "stiffer" for n in log.names]],
        rtol=1e-12,
    )


def test_a_sample_at_the_instant_is_the_limit_from_the_right() -> None:
    found, log = run(RECORDED_BALL)
    at = int(np.flatnonzero(found.time == 0.7)[0])
    assert values(log, "x_ddot", "stiffer")[1] == pytest.approx(found.a[at, :1], rel=1e-12)


def test_a_rod_that_is_cut() -> None:
    """λ = −m (g cos θ + v²/l)/(2 l) before it is cut, 0 after; no impulse."""
    _, log = run(ROD)
    before, after = values(log, "lambda.rod", "cut")
    y, vx, vy = (values(log, name, "cut")[0] for name in ("y", "x_dot", "y_dot"))
    assert before == pytest.approx((10 * y / 5 - (vx**2 + vy**2) / 5) / 5, rel=1e-9)
    assert after.tolist() == [0]
    assert values(log, "y_ddot", "cut")[1] == pytest.approx([-10])
    assert values(log, "x_dot", "cut")[1] == pytest.approx(vx, rel=1e-13)
    (cut,) = (i for i, name in enumerate(log.names) if name == "cut")
    assert log.modes[cut].tolist() == [0]  # right after the instant


JUMP = """
coordinates: {y: m}
parameters: {m: 1 kg, g: 10 m/s^2, n: 0}
T: m/2*y'^2
V: m*g*y
constraints:
  floor: {expr: y >= 0, restitution: 0}
events:
  jump: {when: t >= 0.5, record: false, set: {y': 1}}
  count: {when: floor opens, record: false, set: {n: n + 1}}
initial: {y: 0, y': 0}
simulation: {t_end: 0.6, samples: 3}
"""


def test_modes_of_an_event_are_those_after_all_that_its_instant_does() -> None:
    """A contact opens by the first event, and the second one answers it at the same instant."""
    _, log = run(JUMP)
    assert log.names == ("jump", "floor", "count")
    assert log.modes.tolist() == [[0], [0], [0]]


def test_an_impact_at_the_start_has_no_forces_before() -> None:
    text = RECORDED_BALL.replace("y: 1,", "y: 0,").replace("y': 0}", "y': -1}")
    _, log = run(text)
    before, after = values(log, "y_dot", "hit")
    assert (before[0], after[0]) == (-1, 0.5)
    before, after = values(log, "y_ddot", "hit")
    assert np.isnan(before[0])
    assert after[0] == pytest.approx(-10)


def test_records_go_round_in_every_format(tmp_path: Path) -> None:
    found, log = run(RECORDED_BALL)
    for name in ("run.h5", "run.csv"):
        lagcli.write(found, tmp_path / name)
        read = lagcli.read(tmp_path / name).events
        assert read is not None
        for column in log.records.columns:
            np.testing.assert_array_equal(read.recorded(column), log.recorded(column))


def test_without_instants_nothing_is_recorded() -> None:
    run = prepare(lagcli.load_text(RECORDED_BALL))
    derived = DerivedColumns(run.system, run.start.state.p, run.monitor)
    assert event_records(run.system, derived, [], []) is NOTHING_RECORDED
