"""Cases with known events: bodies that impacts or friction bring to rest, and kicks move again."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from known_conditions import Random
from known_events import METHODS, Case
from scipy.optimize import brentq

from lagcli.arrays import Array

_LAWS = ("newton", "poisson", "sequential")
#: Relative error of an instant, times the length of the run.
_SLACK = 1e-8


def _events(conditions: dict[str, str], period: float, first: float, impulse: str) -> str:
    """Return the events of the conditions, which have no action, and of the kicks."""
    clock = f"every: {period!r}, offset: {first!r}"
    lines = [f"  kick: {{{clock}, impulse: {{{impulse}}}, record: false}}"]
    lines += [f'  {name}: {{when: "{when}", record: false}}' for name, when in conditions.items()]
    return "events:\n" + "\n".join(lines) + "\n"


def _options(random: Random, end: float) -> dict[str, Any]:
    """Return random settings."""
    method, impacts = random.choice(METHODS), random.choice(_LAWS)
    return {"method": method, "impacts": impacts, "t_end": end, "samples": 5}


def _turns(kicks: Array, turns: Array) -> dict[str, Array]:
    """Return when a velocity rises through zero, falls through it, and does either."""
    return {"rises": kicks, "falls": turns, "either": np.sort(np.concatenate([kicks, turns]))}


def _sides(velocity: str, name: str = "", way: float = 1.0) -> dict[str, str]:
    """Return the conditions on a velocity, which has the sign `way` after kicks."""
    up, down = (">=", "<=") if way > 0 else ("<=", ">=")
    compared = {"rises": up, "falls": down, "either": "="}
    return {f"{name}{side}": f"{velocity} {sign} 0" for side, sign in compared.items()}


def _landing_case(seed: int) -> Case:
    """A body falls on a plane, perhaps along a rail, rests, and is kicked up a few times."""
    random = Random(seed, 301)
    mass, length, time = (10 ** random.uniform(-p, p) for p in (3, 3, 2))
    g = random.uniform(1, 9) * length / time**2
    height = random.uniform(0.1, 1) * length
    period = random.uniform(1, 2) * time
    first = math.sqrt(2 * height / g) + random.uniform(0.5, 1) * time
    count = 1 + random.integer(4)
    rise = random.uniform(0.05, 0.35) * period
    place = random.choice(["axis", "plane", "rail"])
    angle = math.pi / 2 if place == "axis" else random.uniform(0.1, 1.4)
    c, s = (0.0, 1.0) if place == "axis" else (math.cos(angle), math.sin(angle))
    sides = _sides(f"({c!r}*x' + {s!r}*y')") | _sides("y'", "y_")
    if place != "axis":
        sides |= _sides("x'", "x_")
    kick = mass * g * rise
    body = (
        f"coordinates: [x, y]\nT: {mass!r}*(x'^2 + y'^2)/2\n"
        f"Q: {{x: {-mass * g * c!r}, y: {-mass * g * s!r}}}\nconstraints:\n"
        f"  floor: {{expr: {c!r}*x + {s!r}*y >= 0, restitution: 0}}\n"
        + (f"  rail: {s!r}*x - {c!r}*y = 0\n" if place == "rail" else "")
        + f"initial: {{x: {height * c!r}, y: {height * s!r}, x': 0, y': 0}}\n"
        + _events(sides, period, first, f"x: {kick * c!r}, y: {kick * s!r}")
    )
    end = first + (count - 1e-3) * period
    kicks = first + period * np.arange(count)
    known = _turns(kicks, kicks + rise)
    events = {name: known[name.rpartition("_")[2]] for name in sides}
    options = _options(random, end)
    return Case("landing", seed, body, options, events, dict.fromkeys(events, _SLACK * end))


def _moving_floor_case(seed: int) -> Case:
    """A body falls on a floor that oscillates and keeps it, and is kicked up a few times."""
    random = Random(seed, 302)
    mass, length, time = (10 ** random.uniform(-p, p) for p in (3, 3, 2))
    g = random.uniform(1, 9) * length / time**2
    height, amplitude = random.uniform(0.1, 1) * length, random.uniform(0.01, 0.1) * length
    w = random.uniform(0.2, 0.8) * math.sqrt(g / amplitude)
    period = random.uniform(1, 2) * time
    first = math.sqrt(2 * (height + amplitude) / g) + random.uniform(1, 2) * time
    count = 1 + random.integer(4)
    speed = random.uniform(0.05, 0.15) * (g - amplitude * w**2) * period
    kicks = first + period * np.arange(count)

    def turn(kick: float) -> float:
        """The time at which the body has the floor's velocity again."""

        def relative(t: float) -> float:
            return speed - g * (t - kick) - amplitude * w * (math.cos(w * t) - math.cos(w * kick))

        latest = kick + 2 * speed / (g - amplitude * w**2)
        return float(brentq(relative, kick, latest, xtol=1e-14 * time))

    sides = _sides(f"(x' - {amplitude * w!r}*cos({w!r}*t))")
    body = (
        f"coordinates: [x]\nT: {mass!r}*x'^2/2\nQ: {{x: {-mass * g!r}}}\nconstraints:\n"
        f"  floor: {{expr: 'x >= {amplitude!r}*sin({w!r}*t)', restitution: 0}}\n"
        f"initial: {{x: {height!r}, x': 0}}\n"
    ) + _events(sides, period, first, f"x: {mass * speed!r}")
    end = first + (count - 1e-3) * period
    events = _turns(kicks, np.array([turn(float(kick)) for kick in kicks]))
    options = _options(random, end)
    return Case("moving floor", seed, body, options, events, dict.fromkeys(events, _SLACK * end))


def _stop_case(seed: int) -> Case:
    """A block slides until a limit, or friction on a floor, stops it, and is pushed again."""
    random = Random(seed, 303)
    mass, length, time = (10 ** random.uniform(-p, p) for p in (3, 3, 2))
    slowing = random.uniform(1, 9) * length / time**2
    period = random.uniform(1, 2) * time
    count = 1 + random.integer(4)
    starts = period * np.arange(count + 1)
    first, push = (random.uniform(0.1, 0.9) * period for _ in range(2))
    if random.choice([True, False]):
        body = (
            f"coordinates: [x]\nT: {mass!r}*x'^2/2\nconstraints:\n"
            f'  stick: {{expr: "x\' = 0", limit: {mass * slowing!r}}}\n'
            f"initial: {{x: 0, x': {slowing * first!r}}}\n"
        )
    else:
        mu = random.uniform(0.1, 1)
        body = (
            f"coordinates: [x, y]\nT: {mass!r}*(x'^2 + y'^2)/2\n"
            f"Q: {{y: {-mass * slowing / mu!r}}}\nconstraints:\n"
            f"  floor: {{expr: y >= 0, restitution: 0, friction: {mu!r}, slip: x'}}\n"
            f"initial: {{x: 0, y: 0, y': 0, x': {slowing * first!r}}}\n"
        )
    sides = _sides("x'")
    body += _events(sides, period, period, f"x: {mass * slowing * push!r}")
    end = (count + 1 - 1e-3) * period
    stops = starts + np.array([first, *[push] * count])
    # from zero on, it does not change its sign
    events = _turns(starts[1:], stops) | {"rises": np.empty(0)}
    options = _options(random, end)
    return Case("stop", seed, body, options, events, dict.fromkeys(events, _SLACK * end))


#: Cases by kind, as functions of a seed.
REST_CASES: dict[str, Callable[[int], Case]] = {
    "landing": _landing_case,
    "moving floor": _moving_floor_case,
    "stop": _stop_case,
}
