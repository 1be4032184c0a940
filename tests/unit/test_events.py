"""Events of the compiled engine: located on the dense output, and what may follow them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.special import ellipk, ellipkinc

import lagcli
from lagcli.engine import compiled_engine
from lagcli.engine.run import Block, Event, Reaction, Request, Run
from lagcli.engine.system import System, compile_system
from lagcli.engine.tape import Op, Tape
from lagcli.equations.lagrange import derive

G = 9.81
METHODS = ("DOP853", "Taylor", "Rodas5P", "Radau")


def system(text: str, events: Tape) -> System:
    return replace(compile_system(derive(lagcli.load_text(text))), events=events)


BALL = system(
    """
coordinates: [x, y]
parameters: {g: 9.81}
T: (x'^2 + y'^2)/2
V: g*y
initial: {x: 0, y: 1, x': 1, y': 0}
""",
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

    run: Run
    time: np.ndarray
    q: np.ndarray


def run(
    what: System,
    q: list[float],
    v: list[float],
    on_event: Callable[[Event], Reaction],
    **changes: Any,
) -> Found:
    request = Request(
        q=np.array(q),
        v=np.array(v),
        rank=len(what.constraints),
        t_start=0.0,
        t_end=3.0,
        times=np.linspace(0, 3, 31),
        rtol=1e-12,
        atol=1e-13,
        method="DOP853",
        formulation="projection",
        alpha=None,
        beta=None,
        max_step=math.inf,
        max_steps=10**6,
        timeout=None,
        through_singular=False,
        on_event=on_event,
    )
    blocks: list[Block] = []
    ended = compiled_engine.run(what, replace(request, **changes), blocks.append)
    columns = zip(*((b.time, b.q) for b in blocks), strict=True)
    return Found(ended, *map(np.concatenate, columns))


@pytest.mark.parametrize("method", METHODS)
def test_bouncing_ball(method: str) -> None:
    restitution = 0.8
    hits: list[Event] = []

    def bounce(event: Event) -> Reaction:
        if event.number:
            return "go on"
        assert event.direction == -1
        hits.append(event)
        return event.q, event.v * [1, -restitution]

    found = run(BALL, [0, 1], [1, 0], bounce, method=method)
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


@pytest.mark.parametrize("method", METHODS)
def test_pendulum_passes_a_line(method: str) -> None:
    events: list[Event] = []

    def watch(event: Event) -> Reaction:
        events.append(event)
        return "go on"

    found = run(PENDULUM, [1, 0], [0, 0], watch, method=method)
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


def test_events_do_not_change_the_motion() -> None:
    options: dict[str, Any] = {"q": [1, 0], "v": [0, 0]}
    watched = run(PENDULUM, on_event=lambda event: "go on", **options)
    plain = run(replace(PENDULUM, events=None), on_event=lambda event: "stop", **options)
    np.testing.assert_array_equal(watched.q, plain.q)
    assert watched.run.steps == plain.run.steps


def test_several_events_in_one_step() -> None:
    seen: list[Event] = []

    def record(event: Event) -> Reaction:
        seen.append(event)
        return "go on" if event.number else "stop"

    # a free flight is exact whatever its step: sin(10 x) changes sign at x = k π/10
    found = run(BALL, [0.05, 1], [1, 0], record, max_step=math.inf)
    crossings = [e for e in seen if e.number == 1]
    expected = np.arange(1, 3) * math.pi / 10 - 0.05
    expected = expected[expected < math.sqrt(2 / G)]
    np.testing.assert_allclose([e.time for e in crossings], expected, rtol=0, atol=1e-10)
    assert [e.direction for e in crossings] == [-1, 1][: len(expected)]
    assert seen[-1].number == 0
    # stopped at the ground: the samples end there
    assert found.run.status == "completed"
    assert found.time[-1] <= math.sqrt(2 / G) < found.time[-1] + 0.1


def test_samples_come_in_blocks_with_events() -> None:
    bounced = run(
        BALL,
        [0, 1],
        [1, 0],
        lambda e: "go on" if e.number else (e.q, e.v * [1, -1]),
        times=np.linspace(0, 3, 20_001),
    )
    assert len(bounced.time) == 20_001
    assert (np.diff(bounced.time) > 0).all()
    assert bounced.q[:, 1].min() > -1e-12
