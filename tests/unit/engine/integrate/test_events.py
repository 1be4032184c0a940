"""Events of both engines: located on the dense output, and what may follow them."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from integration_requests import changed
from lowered import Lowered, lowered
from scipy.special import ellipk, ellipkinc

import lagcli
from lagcli.cli.app import run as main
from lagcli.engine.contract import Block, Event, IntegrationRequest, Outcome, Reaction
from lagcli.engine.integrate import compiled_engine, scipy_engine
from lagcli.engine.integrate.events import EventCrossing, EventSearch
from lagcli.engine.state import State
from lagcli.engine.tape.operations import Op
from lagcli.engine.tape.tape import Tape
from lagcli.settings.methods import methods_of
from lagcli.settings.resolve import resolve
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations import simulation

G = 9.81
ENGINES = {"compiled": compiled_engine.run, "scipy": scipy_engine.run}
METHODS = [
    *(("compiled", method) for method in methods_of("compiled")),
    ("scipy", "DOP853"),  # the others of SciPy take long at this tolerance
]
both_engines = pytest.mark.parametrize("engine", ENGINES)


def system(text: str, events: Tape) -> Lowered:
    case = lowered(lagcli.load_text(text))
    return case._replace(system=replace(case.system, events=events))


BALL_TEXT = """
coordinates: [x, y]
parameters: {g: 9.81}
T: (x'^2 + y'^2)/2
V: g*y
initial: {x: 0, y: 1, x': 1, y': 0}
"""
BALL = system(
    BALL_TEXT,
    # t x y u v g → y, and sin(10 x)
    Tape(6, (10.0,), ((Op.MUL, 7, 6, 1, 0), (Op.SIN, 8, 7, 0, 0)), (2, 8), 1),
)
PENDULUM = system(
    """
coordinates: [x, y]
parameters: {g: 9.81}
T: (x'^2 + y'^2)/2
V: g*y
constraints: {rod: x^2 + y^2 = 1}
initial: {x: 1, y: 0, x': 0, y': 0}
""",
    # t x y u v g → x − 1/2
    Tape(6, (0.5,), ((Op.SUB, 7, 1, 6, 0),), (7,), 1),
)


class Found(NamedTuple):
    """How a run ended, and its samples."""

    run: Outcome
    time: np.ndarray
    q: np.ndarray


def run(
    what: Lowered,
    q: list[float],
    v: list[float],
    on_event: Callable[[Event], Reaction],
    engine: str = "compiled",
    **changes: Any,
) -> Found:
    request = IntegrationRequest(
        state=State(0.0, np.array(q), np.array(v), what.p),
        rank=len(what.system.constraints),
        settings=resolve(SettingsOverrides(t_end=3.0, rtol=1e-12, method="DOP853")),
        times=np.linspace(0, 3, 31),
        atol=1e-13,
        on_event=on_event,
    )
    blocks: list[Block] = []
    ended = ENGINES[engine](what.system, changed(request, **changes), blocks.append)
    columns = zip(*((b.time, b.q) for b in blocks), strict=True)
    return Found(ended, *map(np.concatenate, columns))


@pytest.mark.parametrize(("engine", "method"), METHODS)
def test_bouncing_ball(engine: str, method: str) -> None:
    restitution = 0.8
    hits: list[Event] = []

    def bounce(event: Event) -> Reaction:
        if event.number:
            return "go on"
        assert event.direction == -1
        hits.append(event)
        return event.q, event.v * [1, -restitution]

    found = run(BALL, [0, 1], [1, 0], bounce, engine, method=method)
    assert found.run.status == "completed"
    # √(2/g), then flights of 2 e^k √(2/g)
    flight = math.sqrt(2 / G)
    times = flight * (1 + 2 * np.cumsum([0, *(restitution**k for k in range(1, 20))]))
    times = times[times < 3.0]
    assert len(hits) == len(times) > 4
    np.testing.assert_allclose([e.time for e in hits], times, rtol=0, atol=1e-10)
    for k, event in enumerate(hits):
        np.testing.assert_allclose(event.q, [event.time, 0], atol=1e-10)
        assert event.v[1] == pytest.approx(-math.sqrt(2 * G) * restitution**k, rel=1e-10)
    # every sample lies on its own parabola
    assert len(found.time) == 31
    before = np.concatenate([[0], times])
    for t, (_, y) in zip(found.time, found.q, strict=True):
        k = int(np.searchsorted(times, t))
        up = math.sqrt(2 * G) * restitution**k
        s = t - before[k]
        expected = 1 - G * t * t / 2 if k == 0 else up * s - G * s * s / 2
        assert y == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(("engine", "method"), METHODS)
def test_pendulum_passes_a_line(engine: str, method: str) -> None:
    events: list[Event] = []

    def watch(event: Event) -> Reaction:
        events.append(event)
        return "go on"

    found = run(PENDULUM, [1, 0], [0, 0], watch, engine, method=method)
    # released at the horizontal, m = 1/2: sn(K − √g t) = √2 sin(θ/2)
    K, rate = ellipk(0.5), math.sqrt(G)
    turned = ellipkinc(math.asin(math.sqrt(2) * math.sin(math.pi / 12)), 0.5)
    period = 4 * K / rate
    times = sorted(
        t
        for n in range(3)
        for t in ((K - turned) / rate + n * period, (3 * K + turned) / rate + n * period)
        if t < 3.0
    )
    np.testing.assert_allclose([e.time for e in events], times, rtol=0, atol=1e-10)
    assert [e.direction for e in events] == [-1, 1, -1][: len(events)]
    for event in events:
        assert event.q[0] == pytest.approx(0.5, abs=1e-10)
        assert event.q @ event.q == pytest.approx(1, abs=1e-14)  # on the constraint
    assert found.run.status == "completed"
    assert len(found.time) == 31


@both_engines
def test_events_do_not_change_the_motion(engine: str) -> None:
    options: dict[str, Any] = {"q": [1, 0], "v": [0, 0], "engine": engine}
    watched = run(PENDULUM, on_event=lambda event: "go on", **options)
    plain = run(
        PENDULUM._replace(system=replace(PENDULUM.system, events=None)),
        on_event=lambda event: "stop",
        **options,
    )
    np.testing.assert_array_equal(watched.q, plain.q)
    assert watched.run.steps == plain.run.steps


@both_engines
def test_several_events_in_one_step(engine: str) -> None:
    seen: list[Event] = []

    def record(event: Event) -> Reaction:
        seen.append(event)
        return "go on" if event.number else "stop"

    # a free flight is exact whatever its step: sin(10 x) changes sign at x = k π/10
    found = run(BALL, [0.05, 1], [1, 0], record, engine, max_step=math.inf)
    crossings = [e for e in seen if e.number == 1]
    expected = np.arange(1, 3) * math.pi / 10 - 0.05
    expected = expected[expected < math.sqrt(2 / G)]
    np.testing.assert_allclose([e.time for e in crossings], expected, rtol=0, atol=1e-10)
    assert [e.direction for e in crossings] == [-1, 1][: len(expected)]
    assert seen[-1].number == 0
    # stopped at the ground: the samples end there
    assert found.run.status == "stopped-by-event"
    assert found.run.message == f"event 0 stopped the run at t = {math.sqrt(2 / G):.9g} s"
    assert found.time[-1] <= math.sqrt(2 / G) < found.time[-1] + 0.1


@both_engines
def test_samples_come_in_blocks_with_events(engine: str) -> None:
    count = 20_001 if engine == "compiled" else 2_001
    bounced = run(
        BALL,
        [0, 1],
        [1, 0],
        lambda e: "go on" if e.number else (e.q, e.v * [1, -1]),
        engine,
        times=np.linspace(0, 3, count),
        block_rows=500,
    )
    assert len(bounced.time) == count
    assert (np.diff(bounced.time) > 0).all()
    assert bounced.q[:, 1].min() > -1e-12


@both_engines
def test_both_engines_meet_the_same_events(engine: str) -> None:
    """A pendulum whose bob is turned back at a wall, where x = 1/2, twice; then it is let go."""
    events: list[Event] = []

    def turn_back(event: Event) -> Reaction:
        events.append(event)
        return "stop" if len(events) == 3 else (event.q, -event.v)

    found = run(PENDULUM, [1, 0], [0, 0], turn_back, engine)
    # back and forth between the horizontal and the wall: T, 3 T and 5 T
    rate = math.sqrt(G)
    fall = (ellipk(0.5) - ellipkinc(math.asin(math.sqrt(2) * math.sin(math.pi / 12)), 0.5)) / rate
    np.testing.assert_allclose(
        [e.time for e in events], [fall, 3 * fall, 5 * fall], rtol=0, atol=1e-10
    )
    assert [e.direction for e in events] == [-1, -1, -1]
    assert found.run.status == "stopped-by-event"
    assert found.time[-1] == pytest.approx(math.floor(50 * fall) / 10)


@both_engines
def test_a_stop_is_reported_to_the_user(
    engine: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The model language has no events yet: the ball's are given to the simulation."""
    prepare = simulation.prepare

    def with_events(*arguments: Any) -> simulation.Simulation:
        made = prepare(*arguments)
        return replace(
            made,
            system=replace(made.system, events=BALL.system.events),
            on_event=lambda event: "go on" if event.number else "stop",
        )

    monkeypatch.setattr(simulation, "prepare", with_events)
    (tmp_path / "ball.yaml").write_text(BALL_TEXT)
    options = ["simulate", str(tmp_path / "ball.yaml"), "--engine", engine, "--t-end", "3"]
    said = "event 0 stopped the run at t = 0.451523641 s"
    for suffix in ("h5", "csv"):
        path = tmp_path / f"run.{suffix}"
        assert main([*options, "-o", str(path), "--meta"][: None if suffix == "csv" else -1]) == 0
        out = capsys.readouterr().out
        assert out.startswith("ball: stopped-by-event, t = 0 to 0.45 s,")
        assert said in out
        read = lagcli.read(path)
        assert (read.status, read.message) == ("stopped-by-event", said)
        assert 0.45 <= read.time[-1] <= 0.451523641
    assert main([*options, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["status"], found["message"]) == ("stopped-by-event", said)
    assert main(["info", str(tmp_path / "run.h5")]) == 0
    assert "stopped-by-event" in capsys.readouterr().out
    ran = lagcli.simulate(lagcli.load(tmp_path / "ball.yaml"), t_end=3, engine=engine)
    assert (ran.status, ran.message) == ("stopped-by-event", said)
    report, animation = tmp_path / "r.html", tmp_path / "a.html"
    assert main(["report", str(tmp_path / "run.h5"), "-o", str(report), "-q"]) == 0
    assert "The run was stopped by an event." in report.read_text(encoding="utf-8")
    assert main(["animate", str(tmp_path / "run.h5"), "-o", str(animation), "-q"]) == 0
    assert f"the run was stopped by an event: {said}" in capsys.readouterr().err


# the reference engine's search, along a path that is given


def path(t: float) -> np.ndarray:
    """Return x, y, u, v and W: x falls through zero at 0.3 and rises at 0.7."""
    return np.array([10 * (t - 0.3) * (t - 0.7), 0.0, 0.0, 0.0, 0.0])


def search(*outputs: int) -> EventSearch:
    """Return a search, begun at 0, for sign changes of inputs t x y u v."""
    tape = Tape(5, (), (), outputs)
    found = EventSearch(replace(BALL.system, events=tape), ())
    found.start(0.0, path(0.0))
    return found


def test_sign_changes_come_one_after_the_other() -> None:
    events = search(1)
    falling, rising = events.first(path, 0.0, 1.0, 1.0), events.first(path, 0.0, 1.0, 1.0)
    assert (falling, rising) == (
        EventCrossing(0, -1, pytest.approx(0.3, rel=1e-13)),
        EventCrossing(0, 1, pytest.approx(0.7, rel=1e-13)),
    )
    assert events.first(path, 0.0, 1.0, 1.0) is None
    # the time returned has the new sign already
    assert path(falling.time)[0] <= 0.0 <= path(rising.time)[0]


def test_a_step_is_searched_up_to_where_it_is_valid() -> None:
    events = search(1)
    assert events.first(path, 0.0, 1.0, 0.25) is None
    assert events.first(path, 0.0, 1.0, 0.5) is not None
    assert events.first(path, 0.0, 1.0, 0.5) is None


def test_the_first_of_several_functions_is_returned_first() -> None:
    # both within one part of the step
    events = search(2, 1)

    def close(t: float) -> np.ndarray:
        return np.array([t - 0.51, 0.52 - t, 0.0, 0.0, 0.0])

    events.start(0.5, close(0.5))
    found = [events.first(close, 0.5, 1.0, 1.0) for _ in range(3)]
    assert [crossing and crossing.number for crossing in found] == [1, 0, None]


def test_what_has_just_happened_does_not_happen_again() -> None:
    events = search(1)
    crossing = events.first(path, 0.0, 1.0, 1.0)
    assert crossing is not None

    def bounced(t: float) -> np.ndarray:
        return np.array([1e-17 + (t - crossing.time), 0.0, 0.0, 0.0, 0.0])

    # it lies on the old side by rounding, and leaves to the new one
    events.start(crossing.time, -bounced(crossing.time))
    assert events.first(bounced, crossing.time, 0.5, 0.5) is None


def test_without_functions_nothing_happens() -> None:
    events = EventSearch(replace(BALL.system, events=None), ())
    events.start(0.0, path(0.0))
    assert events.first(path, 0.0, 1.0, 1.0) is None
