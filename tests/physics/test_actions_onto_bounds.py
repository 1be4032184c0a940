"""Actions that leave a free body on, before or beyond the bounds of events, against exact rules.

The body moves with x' = −1, 0 or 1, which actions set at known times, as they set x. Thus the
values of all conditions are linear between these times.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

import lagcli

END = 5.89
CLOSE = 1e-9


class Watched(NamedTuple):
    """The condition ``x sign bound`` or ``x' sign bound``."""

    name: str
    of: str
    sign: str
    bound: int


class Action(NamedTuple):
    """What is set at a time; None is left as it is."""

    time: float
    x: int | None
    v: int | None


def side(value: float) -> int:
    """Return the sign of a value, but for rounding."""
    return int(value > CLOSE) - int(value < -CLOSE)


def instants(condition: Watched, x: float, v: float, actions: list[Action]) -> list[float]:
    """Return when a condition happens.

    The bound is no side: a function that rests there keeps the side from which it came, and one of
    ``=`` that begins or has just happened there has none.
    """
    of_x, way = condition.of == "x", {">=": 1, "<=": -1, "=": 0}[condition.sign]
    found: list[float] = []

    def value() -> float:
        return (x if of_x else v) - condition.bound

    def leaves() -> int:
        return side(value()) or (side(v) if of_x else 0)

    now = leaves()  # 0: without a side
    if way and now == 0:
        now = way  # it holds at the start
    t = 0.0
    for action in [*actions, Action(END, None, None)]:
        reached = t - value() / v if of_x and v else np.inf
        happens = False
        if t + CLOSE < reached <= action.time + CLOSE:
            at_action = abs(reached - action.time) < CLOSE
            happens = now != side(v) and way in (0, side(v))
            if happens:
                found.append(reached)
            if happens or not at_action:
                now = side(v)
            happens &= at_action
        x, t = x + v * (action.time - t), action.time
        rests = now == 0 and side(value()) == 0
        x, v = (x if action.x is None else action.x), (v if action.v is None else action.v)
        after = leaves()
        if after == 0:
            now = 0 if way == 0 and (happens or rests) else now
            continue
        if after != now and not happens and not rests and way in (0, after):
            found.append(t)
        now = after
    return found


@pytest.mark.parametrize("offset", [0.0, 0.37])
@pytest.mark.parametrize("seed", range(12))
def test_events_are_those_of_the_rules(seed: int, offset: float) -> None:
    rng = np.random.default_rng(seed)

    def choice(*values: object) -> object:
        return values[rng.integers(len(values))]

    x, v = int(rng.integers(-1, 3)), int(rng.integers(-1, 2))
    actions = [
        Action(
            k + offset,
            choice(None, int(rng.integers(-1, 3))),  # type: ignore[arg-type]
            int(rng.integers(-1, 2)),
        )
        for k in range(1, 6)
        if rng.random() < 0.6
    ]
    conditions = [
        Watched(f"e{k}", of, str(choice(">=", "<=", "=")), int(rng.integers(2)) if of == "x" else 0)
        for k, of in enumerate(["x", "x", "x'", str(choice("x", "x'"))])
    ]
    events = [f'  {c.name}: {{when: "{c.of} {c.sign} {c.bound}"}}' for c in conditions]
    for k, a in enumerate(actions):
        values = ([] if a.x is None else [f"x: {a.x}"]) + [f"x': {a.v}"]
        events.append(f"  a{k}: {{every: 100, offset: {a.time}, set: {{{', '.join(values)}}}}}")
    model = lagcli.load_text(
        "coordinates: [x]\nT: x'^2/2\nevents:\n"
        + "\n".join(events)
        + f"\ninitial: {{x: {x}, x': {v}}}\n"
    )
    run = lagcli.simulate(model, t_end=END, samples=2)
    assert run.status == "completed"
    assert run.events is not None
    for c in conditions:
        times = run.events.time[[name == c.name for name in run.events.names]]
        expected = instants(c, x, v, actions)
        assert times == pytest.approx(expected, abs=1e-6), (c, x, v, actions)
