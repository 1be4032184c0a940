"""Events of the state at times in closed form: a bouncing ball, a pendulum that passes a line."""

from __future__ import annotations

import json
import math
from pathlib import Path

import h5py
import numpy as np
import pytest
from known_events import METHODS
from scipy.special import ellipk, ellipkinc

import lagcli
from lagcli.cli.app import run as main

G = 9.81
RESTITUTION = 0.8
BALL = """
coordinates: [x, y]
parameters: {g: 9.81, e: 0.8}
T: (x'^2 + y'^2)/2
V: g*y
initial: {x: 0, y: 1, x': 1, y': 0}
"""
PENDULUM = """
coordinates: [x, y]
parameters: {g: 9.81}
T: (x'^2 + y'^2)/2
V: g*y
constraints: {rod: x^2 + y^2 = 1}
initial: {x: 1, y: 0, x': 0, y': 0}
"""
SETTINGS = {"t_end": 3.0, "samples": 31, "rtol": 1e-12, "atol": 1e-13}


def run(text: str, **settings: object) -> lagcli.Trajectory:
    model = lagcli.load_text(text)
    return lagcli.simulate(model, **{**SETTINGS, **settings})  # type: ignore[arg-type]


def times(found: lagcli.Trajectory, name: str) -> np.ndarray:
    assert found.events is not None
    pairs = zip(found.events.time, found.events.names, strict=True)
    return np.array([t for t, event in pairs if event == name])


@pytest.mark.parametrize("method", METHODS)
def test_a_velocity_that_is_turned_back_at_each_fall(method: str) -> None:
    found = run(BALL + "events: {hit: {when: y <= 0, set: {y': -e*y'}}}\n", method=method)
    assert found.status == "completed"
    # √(2/g), then flights of 2 e^k √(2/g)
    flight = math.sqrt(2 / G)
    hits = flight * (1 + 2 * np.cumsum([0, *(RESTITUTION**k for k in range(1, 20))]))
    hits = hits[hits < 3.0]
    assert len(hits) > 4
    np.testing.assert_allclose(times(found, "hit"), hits, rtol=0, atol=1e-10)
    # every sample lies on its own parabola
    before = np.concatenate([[0], hits])
    for t, (x, y) in zip(found.time, found.q, strict=True):
        k = int(np.searchsorted(hits, t))
        up = math.sqrt(2 * G) * RESTITUTION**k
        s = t - before[k]
        expected = 1 - G * t * t / 2 if k == 0 else up * s - G * s * s / 2
        assert x == pytest.approx(t, abs=1e-10)
        assert y == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_a_pendulum_passes_a_line(method: str) -> None:
    line = "events: {line: {when: x = 0.5, record: [x, y]}}\n"
    found = run(PENDULUM + line, method=method)
    # released at the horizontal, m = 1/2: sn(K − √g t) = √2 sin(θ/2)
    quarter, rate = ellipk(0.5), math.sqrt(G)
    turned = ellipkinc(math.asin(math.sqrt(2) * math.sin(math.pi / 12)), 0.5)
    period = 4 * quarter / rate
    passed = sorted(
        t
        for n in range(3)
        for t in (
            (quarter - turned) / rate + n * period,
            (3 * quarter + turned) / rate + n * period,
        )
        if t < 3.0
    )
    np.testing.assert_allclose(times(found, "line"), passed, rtol=0, atol=1e-10)
    assert found.events is not None
    for x, y in np.asarray(found.events.records.before):
        assert x == pytest.approx(0.5, abs=1e-10)
        assert x * x + y * y == pytest.approx(1, abs=1e-14)  # on the constraint
    assert found.status == "completed"
    # an event without an action does not change the motion
    plain = run(PENDULUM, method=method)
    np.testing.assert_allclose(found.q, plain.q, rtol=0, atol=1e-10)


def test_several_events_in_one_step_and_a_stop() -> None:
    # a free flight is exact whatever its step: sin(10 x) changes sign at x = k π/10
    events = "events: {wave: {when: sin(10*x) = 0}, ground: {when: y <= 0, stop: true}}\n"
    found = run(BALL.replace("x: 0,", "x: 0.05,") + events)
    crossings = np.arange(1, 3) * math.pi / 10 - 0.05
    crossings = crossings[crossings < math.sqrt(2 / G)]
    np.testing.assert_allclose(times(found, "wave"), crossings, rtol=0, atol=1e-10)
    assert found.status == "stopped-by-event"
    assert found.message == f"`ground` stopped the run at t = {math.sqrt(2 / G):.9g} s"
    assert found.time[-1] <= math.sqrt(2 / G) < found.time[-1] + 0.1


def test_samples_in_several_blocks_with_events() -> None:
    hit = "events: {hit: {when: y <= 0, set: {y': -y'}}}\n"
    found = run(BALL + hit, samples=20_001)
    assert len(found.time) == 20_001
    assert (np.diff(found.time) > 0).all()
    assert found.q[:, 1].min() > -1e-12


def test_a_pendulum_that_is_turned_back_at_a_wall() -> None:
    """The bob is turned back at x = 1/2 twice; at the third time, the run stops."""
    wall = (
        "events:\n  wall: {when: x <= 0.5, set: {x': -x', y': -y'}, times: 2}\n"
        "  end: {when: x <= 0.5 and t > 1.5, stop: true}\n"
    )
    # back and forth between the horizontal and the wall: T, 3 T and 5 T
    rate = math.sqrt(G)
    fall = (ellipk(0.5) - ellipkinc(math.asin(math.sqrt(2) * math.sin(math.pi / 12)), 0.5)) / rate
    assert 3 * fall < 1.5 < 5 * fall
    found = run(PENDULUM + wall)
    np.testing.assert_allclose(times(found, "wall"), [fall, 3 * fall], rtol=0, atol=1e-10)
    np.testing.assert_allclose(times(found, "end"), [5 * fall], rtol=0, atol=1e-10)
    assert found.status == "stopped-by-event"
    assert found.time[-1] == pytest.approx(math.floor(50 * fall) / 10)


def test_a_stop_is_reported_to_the_user(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "ball.yaml").write_text(BALL + "events: {ground: {when: y <= 0, stop: true}}\n")
    options = ["simulate", str(tmp_path / "ball.yaml"), "--t-end", "3"]
    said = "`ground` stopped the run at t = 0.451523641 s"
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
    answer = json.loads(capsys.readouterr().out)
    assert (answer["status"], answer["message"]) == ("stopped-by-event", said)
    assert main(["info", str(tmp_path / "run.h5")]) == 0
    assert "stopped-by-event" in capsys.readouterr().out
    ran = lagcli.simulate(lagcli.load(tmp_path / "ball.yaml"), t_end=3)
    assert (ran.status, ran.message) == ("stopped-by-event", said)
    report, animation = tmp_path / "r.html", tmp_path / "a.html"
    assert main(["report", str(tmp_path / "run.h5"), "-o", str(report), "-q"]) == 0
    assert "The run was stopped by an event." in report.read_text(encoding="utf-8")
    assert main(["animate", str(tmp_path / "run.h5"), "-o", str(animation), "-q"]) == 0
    assert f"the run was stopped by an event: {said}" in capsys.readouterr().err


def test_events_after_the_last_sample_time(tmp_path: Path) -> None:
    """A given end later than the last sample time is the end of the run, also of rows of sweeps."""
    model = lagcli.load_text("""\
coordinates: [x]
T: x'^2/2
initial: {x: 0, x': 1}
events: {there: {when: x >= 3}}
simulation: {times: [0, 1, 2]}
""")
    for t_end, expected in ((None, []), (5.0, [3.0])):
        run = lagcli.simulate(model, t_end=t_end)
        assert run.time.tolist() == [0, 1, 2]
        assert run.events is not None
        assert run.events.time.tolist() == pytest.approx(expected)
    measures = {"n": "count(there)", "x": "final(x)", "later": "at(x, 4)"}
    lagcli.sweep(model, ["x'=1,2"], tmp_path / "s.h5", measures=measures, t_end=5.0)
    with h5py.File(tmp_path / "s.h5") as file:
        found = {name: file[name][:].tolist() for name in measures}
    expected = {"n": [1, 1], "x": pytest.approx([2, 4]), "later": pytest.approx([4, 8])}
    assert found == expected
