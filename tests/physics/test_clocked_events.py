"""Events with clocks: their instants, and sampled controllers against their recurrences."""

from __future__ import annotations

import csv
import io
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from random_cases import some
from scipy.linalg import expm

import lagcli
from lagcli.errors import LagcliError
from lagcli.trajectory.trajectory import Trajectory

METHODS = ("DOP853", "Taylor", "Radau", "Rodas5P")

#: A free particle; conditions of its place are conditions of time.
PARTICLE = """\
coordinates: [x]
parameters: {{n: 0, T: 0.01, u: 0, F: 0}}
T: x'^2/2
Q: {{x: F}}
initial: {{x: 0, x': 1}}
outputs: {{count: n, held: u}}
events:
  tick: {{{clock}, set: {{n: n + 1}}}}
{more}
"""


def run(
    clock: str, more: str = "", *, set: dict[str, Any] | None = None, **options: Any
) -> Trajectory:
    text = PARTICLE.format(clock=clock, more=more)
    found = lagcli.simulate(lagcli.load_text(text, set=set or {}), **{"samples": 2, **options})
    assert found.status == "completed", found.message
    assert found.events is not None
    return found


def times(found: Trajectory, name: str = "tick") -> list[float]:
    assert found.events is not None
    pairs = zip(found.events.names, found.events.time, strict=True)
    return [float(t) for n, t in pairs if n == name]


@pytest.mark.parametrize("method", some(METHODS, 1))
def test_500_of_500(method: str) -> None:
    found = run("every: 10 ms, offset: 2 ms, times: 500", t_end=6, method=method)
    assert times(found) == [float(Fraction(1 + 5 * k, 500)) for k in range(500)]
    assert found.outputs["count"].tolist() == [0, 500]


@pytest.mark.parametrize(
    ("clock", "span", "expected"),
    [
        ("every: 0.1", (0, 1), [k / 10 for k in range(11)]),  # at the start, and at the end
        ("every: 0.1, offset: 0.05", (0, 1), [(1 + 2 * k) / 20 for k in range(10)]),
        ("every: 1/3", (0, 2), [k / 3 for k in range(7)]),
        ("every: 0.1, offset: 0.25", (0, 0.5), [0.25, 0.35, 0.45]),
        ("every: 0.3, offset: -0.1", (0, 1), [0.2, 0.5, 0.8]),
        ("every: 0.1", (0.35, 0.8), [0.4, 0.5, 0.6, 0.7, 0.8]),
        ("every: 0.1", (-0.35, 0.25), [0, 0.1, 0.2]),  # not before the offset
        ("every: 0.1", (0.3, 0.5), [0.3, 0.4, 0.5]),
        ("every: 0.1", (0.1 + 0.2, 0.7 - 0.2), [0.1 + 0.2, 0.4, 0.7 - 0.2]),  # to rounding errors
        ("every: 0.5 s, offset: 1e6 s", (1e6, 1e6 + 1), [1e6, 1e6 + 0.5, 1e6 + 1]),
        ("every: 2 ps", (0, 1e-11), [k * 1e-12 for k in (0, 2, 4, 6, 8, 10)]),
        ("every: 10 d, times: 2", (3e6, 9e6), [3456000, 4320000]),
        ("every: 2*T, offset: T/4", (0, 0.05), [0.0025, 0.0225, 0.0425]),
        ("every: 10", (0, 5), [0]),
        ("every: 1, offset: 6", (0, 5), []),
    ],
)
def test_instants(clock: str, span: tuple[float, float], expected: list[float]) -> None:
    found = run(clock, t_start=span[0], t_end=span[1])
    assert times(found) == expected
    assert found.outputs["count"][-1] == len(expected)


def test_a_period_set_from_outside() -> None:
    assert times(run("every: T", set={"T": 0.25}, t_end=1)) == [0, 0.25, 0.5, 0.75, 1]


def test_samples_at_ticks_follow_them() -> None:
    """Also where the times of samples differ from k/10 by rounding errors."""
    grid = np.cumsum(np.full(30, 0.1))
    assert (grid != np.arange(1, 31) / 10).any()
    found = run("every: 0.1", times=grid.tolist(), samples=None, t_end=3.05)
    assert found.outputs["count"].tolist() == [k + 2 for k in range(30)]


def test_clocks_at_one_instant_are_in_the_order_of_the_file() -> None:
    more = """\
  double: {every: 0.2, offset: 0.1, set: {n: 2*n}}
  slow: {every: 0.3, offset: 0.3, set: {n: n + 1000}}
"""
    found = run("every: 0.1, offset: 0.1", more, t_end=0.35)
    assert found.events is not None
    assert found.events.names == ("tick", "double", "tick", "tick", "double", "slow")
    assert found.events.time.tolist() == [0.1, 0.1, 0.2, 0.3, 0.3, 0.3]
    assert found.outputs["count"][-1] == 1008


@pytest.mark.parametrize("method", METHODS)
def test_conditions_that_become_true_at_ticks(method: str) -> None:
    more = """\
  time: {when: t >= 0.3}
  place: {when: x = 0.3}
  action: {when: x + n >= 3.25, set: {u: 1}}
"""
    found = run("every: 0.1, offset: 0.1", more, t_end=0.35, method=method)
    assert found.events is not None
    assert sorted(found.events.names) == ["action", "place", "tick", "tick", "tick", "time"]
    assert times(found) == [0.1, 0.2, 0.3]
    np.testing.assert_allclose(found.events.time[2:], 0.3, rtol=1e-14)


def test_ticks_at_the_rows_of_an_input() -> None:
    """The force of the table acts from its row on, and the tick happens once."""
    table = (
        "inputs:\n  f: {times: [0, 0.1, 0.2, 0.3], values: [0, 3, -1, 5], interpolation: step}\n"
    )
    text = PARTICLE.format(clock="every: 0.1, offset: 0.1", more="").replace("F}", "f}")
    for method in METHODS:
        found = lagcli.simulate(lagcli.load_text(table + text), t_end=0.3, method=method, samples=4)
        assert times(found) == [0.1, 0.2, 0.3]
        np.testing.assert_allclose(found.v[:, 0], [1, 1, 1.3, 1.2], rtol=1e-13)


def test_stop_and_record() -> None:
    text = PARTICLE.format(clock="every: 0.1, stop: true, offset: 0.7, record: [x]", more="")
    found = lagcli.simulate(lagcli.load_text(text), t_end=3)
    assert found.status == "stopped-by-event"
    assert times(found) == [0.7]
    assert found.events is not None
    assert found.events.records.before.tolist() == [[pytest.approx(0.7, rel=1e-14)]]


def test_a_tick_at_the_start_that_stops() -> None:
    text = PARTICLE.format(clock="every: 0.1, stop: true", more="")
    found = lagcli.simulate(lagcli.load_text(text), t_end=3)
    assert (found.status, found.time.tolist()) == ("stopped-by-event", [0.0])


#: A mass on a spring, on a slope in two coordinates, whose controller samples; per s of the slope.
PLANT = """\
coordinates: [x, y]
parameters: {k: 40, c: 0.3, g: 9.81, u: 0, kp: 30, kd: 7, T: 0.05}
definitions: {s: (3*x + 4*y)/5}
T: (x'^2 + y'^2)/2
V: k/2*(s - 1)^2 + g*y
D: c/2*s'^2
Q: {s: u}
constraints: {slope: 4*x = 3*y}
initial: {x: 0.6, y: 0.8, x': 0.3, y': 0.4}
events:
  sample: {every: T, set: {u: -kp*(s - 1) - kd*s'}, record: false}
"""


@pytest.mark.parametrize("formulation", ["projection", "index1"])
@pytest.mark.parametrize("method", METHODS)
def test_a_sampled_controller_obeys_its_recurrence(method: str, formulation: str) -> None:
    found = lagcli.simulate(
        lagcli.load_text(PLANT),
        t_end=5,
        samples=101,
        rtol=1e-11,
        method=method,
        formulation=formulation,
    )
    assert found.status == "completed"
    # exact between samples: z' = A z with z = (s − 1, s', u, 1), sampled when u changes
    a = np.array([[0, 1, 0, 0], [-40, -0.3, 1, -9.81 * 0.8], [0, 0, 0, 0], [0, 0, 0, 0]])
    step, z = expm(a * 0.05), np.array([0, 0.5, 0, 1])
    expected = []
    for _ in range(101):
        expected.append(z[0] + 1)
        z[2] = -30 * z[0] - 7 * z[1]
        z = step @ z
    s = (3 * found.q[:, 0] + 4 * found.q[:, 1]) / 5
    np.testing.assert_allclose(s, expected, atol=2e-9)


def test_derivatives_of_a_sampled_motion() -> None:
    """By the gains and by the stiffness, against differences of the exact recurrence."""
    names = ("kp", "kd", "k")
    model = lagcli.load_text(PLANT)
    found = lagcli.simulate(model, t_end=5, samples=101, rtol=1e-11, sensitivity=names)
    assert found.status == "completed"

    def motion(kp: float, kd: float, k: float) -> np.ndarray:
        a = np.zeros((4, 4))
        a[:2] = [0, 1, 0, 0], [-k, -0.3, 1, -9.81 * 0.8]
        step, z, states = expm(a * 0.05), np.array([0, 0.5, 0, 1]), []
        for _ in range(101):
            states.append(z[0])
            z[2] = -kp * z[0] - kd * z[1]
            z = step @ z
        return np.array(states)

    values = np.array([30.0, 7.0, 40.0])
    for i, name in enumerate(found.sensitivity):
        assert name == names[i]
        h = np.eye(3)[i] * values[i] * 1e-4
        # fourth order: an error of 1e-12 and of rounding 1e-11
        near, far = (motion(*(values + m * h)) - motion(*(values - m * h)) for m in (1, 2))
        expected = (8 * near - far) / (12 * h[i])
        slope = (3 * found.dq[:, 0, i] + 4 * found.dq[:, 1, i]) / 5
        np.testing.assert_allclose(slope, expected, atol=1e-8 * np.abs(expected).max() + 1e-10)


def test_no_derivatives_by_the_period() -> None:
    with pytest.raises(LagcliError, match="the clock of event `sample` depends on it"):
        lagcli.simulate(lagcli.load_text(PLANT), t_end=1, sensitivity=("T",))


@pytest.mark.parametrize("period", [0.02, 0.1, 0.12])
def test_the_sampled_pendulum(period: float) -> None:
    """Small angles: the recurrence in the model's comment, with its eigenvalues' growth."""
    changes = {"T_s": f"{period} s", "phi_0": "1e-4 rad"}
    count = 12
    found = lagcli.simulate(
        lagcli.load("sampled_pendulum", set=changes),
        times=[k * period for k in range(count)],
        samples=None,
        t_end=count * period,
        rtol=1e-11,
    )
    w, w2 = np.sqrt(9.81 / 0.5), 9.81 / 0.5
    c, s = np.cosh(w * period), np.sinh(w * period)
    free = np.array([[c, s / w], [w * s, c]])
    gain = np.array([c - 1, w * s]) / (0.25 * w2)
    closed = free - np.outer(gain, [20, 4])
    states = [np.array([1e-4, 0.0])]
    for _ in range(count - 1):
        states.append(closed @ states[-1])
    np.testing.assert_allclose(found.outputs["angle"], np.array(states)[:, 0], atol=1e-11)


def test_the_longest_stable_period_of_the_pendulum() -> None:
    """128.35 ms, as the model's comment says: the angle decays below it, and grows above."""
    for period, grows in (("127.5 ms", False), ("129.5 ms", True)):
        changes = {"T_s": period, "phi_0": "1e-4 rad"}
        model = lagcli.load("sampled_pendulum", set=changes)
        angle = np.abs(lagcli.simulate(model, t_end=12, samples=1201).outputs["angle"])
        assert (angle[-200:].max() > angle[400:600].max()) == grows


def test_a_sweep_over_the_period(tmp_path: Path) -> None:
    model = lagcli.load_text(PARTICLE.format(clock="every: T", more=""))
    file = tmp_path / "sweep.csv"
    lagcli.sweep(model, ["T=0.1,0.25,0.3,-1"], file, measures={"n": "count(tick)"}, t_end=1)
    text = file.read_text(encoding="utf-8")
    rows = list(csv.DictReader(io.StringIO(text)))
    assert [row["n"] for row in rows[:3]] == ["11.0", "5.0", "4.0"]
    assert "is -1 s, but must be positive" in str(rows[3])


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ("{every: 0, stop: true}", "is 0 s, but must be positive"),
        ("{every: -1 ms, stop: true}", "is -0.001 s, but must be positive"),
        ("{every: 1e-18, stop: true}", "is below the rounding errors of times near"),
        ("{every: 3 m, stop: true}", "is in m, but must be a time"),
        ("{every: x, stop: true}", "cannot depend on coordinates"),
        ("{every: t, stop: true}", "cannot depend on time"),
        ("{every: sqrt(T - 1), stop: true}", "is nan s, but must be positive"),
        ("{every: T, when: t >= 1, stop: true}", "has both `when` and `every`"),
        ("{when: t >= 1, offset: 1, stop: true}", "has an `offset`, but no `every`"),
        ("{stop: true}", "has no `when`"),
        ("{every: T, set: {T: 2*T}}", "sets `T`, but the clock of event `e` depends on it"),
        ("{every: , stop: true}", "has no value"),
        ("{every: [1, 2], stop: true}", "not a list"),
    ],
)
def test_errors(entry: str, said: str) -> None:
    text = "coordinates: [x]\nparameters: {T: 0.1}\nT: x'^2/2\ninitial: {x: 0, x': 1}\n"
    with pytest.raises(LagcliError) as error:
        lagcli.simulate(lagcli.load_text(f"{text}events:\n  e: {entry}\n"))
    assert said in str(error.value)
    assert "<text>:6:" in str(error.value)


@pytest.mark.parametrize("period", ["1 ms", "0.1 ms", "20 us"])
def test_short_periods_far_from_zero(period: str) -> None:
    """Ticks 160 roundings of the time apart, at 1e9 s: the same motion as from 0."""
    text = f"""\
coordinates: [x]
T: x'^2/2
V: 50*x^2
initial: {{x: 1, x': 0}}
events: {{tick: {{every: {period}, set: {{x': "0.99*x'"}}}}}}
"""
    model = lagcli.load_text(text)
    runs = [lagcli.simulate(model, t_start=t, t_end=t + 2.0**-7, samples=3) for t in (0.0, 1e9)]
    assert [run.status for run in runs] == ["completed", "completed"]
    logs = [run.events for run in runs]
    assert logs[0] is not None
    assert logs[1] is not None
    assert len(logs[0]) == len(logs[1])
    np.testing.assert_allclose(logs[1].time - 1e9, logs[0].time, rtol=0, atol=2e-7)
    # times are rounded to 1.2e-7 s, in which x' changes by 1.2e-5
    np.testing.assert_allclose(runs[1].q, runs[0].q, rtol=0, atol=1e-6)
    np.testing.assert_allclose(runs[1].v, runs[0].v, rtol=0, atol=3e-5)
