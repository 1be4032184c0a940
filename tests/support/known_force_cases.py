"""Cases with known motions: forces with jumps and kinks; blocks that stick, slip and lift off."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
from known_conditions import Random, level_roots, number
from known_events import METHODS, Case
from scipy.optimize import brentq

from lagcli.arrays import Array

#: Nodes and weights that integrate a smooth force between two of its jumps to rounding.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)


def _end_of_motion(
    force: Callable[[Array], Array], edges: Array, w: float, start: tuple[float, float]
) -> tuple[float, float]:
    """Return x and x' at the last edge, for x'' + w² x = force, smooth between the edges."""
    end = edges[-1]
    longest = 0.5 / max(w, 1e-300)
    pieces = [
        np.linspace(a, b, max(2, min(2000, math.ceil((b - a) / longest) + 1)))
        for a, b in pairwise(edges)
    ]
    low = np.concatenate([p[:-1] for p in pieces])
    high = np.concatenate([p[1:] for p in pieces])
    t = (low + high)[:, None] / 2 + (high - low)[:, None] / 2 * _NODES
    weighted = force(t) * (high - low)[:, None] / 2 * _WEIGHTS
    past = end - t
    x0, v0 = start
    if w == 0:
        return x0 + v0 * end + float((weighted * past).sum()), v0 + float(weighted.sum())
    turn = w * end
    x = (
        x0 * math.cos(turn)
        + v0 / w * math.sin(turn)
        + float((weighted * np.sin(w * past)).sum()) / w
    )
    v = v0 * math.cos(turn) - x0 * w * math.sin(turn) + float((weighted * np.cos(w * past)).sum())
    return x, v


def _wave(
    random: Random, period: float, count: float
) -> tuple[str, Callable[[Array], Array], Array, str]:
    """Return a force of time from −1 to 1: text, values, jumps and kinks, and inputs."""
    W = math.tau / period
    duty = 10 ** random.uniform(-2.5, -0.1)
    level = math.cos(math.pi * duty)  # sin exceeds it for this part of a period
    p = repr(period)
    s, y = f"sin(2*pi*t/{p})", f"t/{p}"

    def wave(t: Array) -> Array:
        return np.asarray(np.sin(W * t))

    def part(t: Array) -> Array:
        return np.asarray(t / period - np.floor(t / period))

    def crossings(c: float) -> Array:
        return level_roots(math.tau * count, 0.0, c) * count * period

    whole = np.arange(int(count) + 2) * period
    c = number(level)
    pulses = crossings(level)
    both = np.concatenate([whole, whole + duty * period])
    zeros = np.arange(2 * int(count) + 4) * period / 2
    rows = np.sort(np.array([random.uniform(0.02, 0.98) for _ in range(4)]))
    values = [random.uniform(-1, 1) for _ in range(5)]
    grid = np.array([0.0, *rows, 1.0]) * period
    steps = ", ".join(map(repr, grid.tolist()))
    held = ", ".join(map(repr, [*values, values[0]]))
    knots = (whole[:, None] + grid[:-1]).ravel()
    tables = {
        kind: f"inputs:\n  u: {{times: [{steps}], values: [{held}], interpolation: {kind},"
        " extend: periodic}\n"
        for kind in ("step", "linear")
    }
    table = np.array(values)
    choices: list[tuple[str, Callable[[Array], Array], Array, str]] = [
        (f"if({s} > {c}, 1, 0)", lambda t: np.where(wave(t) > level, 1.0, 0.0), pulses, ""),
        (f"step({s} - {c})", lambda t: np.where(wave(t) > level, 1.0, 0.0), pulses, ""),
        (f"(1 + sign({s} - {c}))/2", lambda t: np.where(wave(t) > level, 1.0, 0.0), pulses, ""),
        (f"max({s} - {c}, 0)", lambda t: np.maximum(wave(t) - level, 0), pulses, ""),
        (f"sign({s})", lambda t: np.sign(wave(t)), zeros, ""),
        (f"abs({s})", lambda t: np.abs(wave(t)), zeros, ""),
        (f"{y} - floor({y})", part, whole, ""),
        (
            f"if({y} - floor({y}) < {duty!r}, 1, 0)",
            lambda t: np.where(part(t) < duty, 1.0, 0.0),
            both,
            "",
        ),
        (
            f"floor({y} + {1 - duty!r}) - floor({y})",
            lambda t: np.where(part(t) >= duty, 1.0, 0.0),
            both,
            "",
        ),
        (
            f"abs(2*({y} - floor({y} + 0.5)))",
            lambda t: np.abs(2 * (t / period - np.floor(t / period + 0.5))),
            zeros,
            "",
        ),
        (
            "u",
            lambda t: table[np.searchsorted(grid[1:-1], t % period, side="right")],
            knots,
            tables["step"],
        ),
        ("u", lambda t: np.interp(t % period, grid, [*values, values[0]]), knots, tables["linear"]),
    ]
    return random.choice(choices)


def _pulses_case(seed: int) -> Case:
    """Waves of 1 to 200 periods, on a free particle or an oscillator."""
    random = Random(seed, 200)
    method = random.choice([*METHODS, "auto"])
    length = random.choice([1e-6, 1.0, 20.0, 1e7])
    count = math.exp(random.uniform(0, math.log(200)))
    period = length / count
    text, force, jumps, inputs = _wave(random, period, count)
    w = random.choice([0.0, math.tau * random.uniform(0.1, 4) / length, math.tau / period * 0.37])
    jumps = jumps[(jumps > 0) & (jumps < length)]
    edges = np.unique(np.concatenate([[0.0], jumps, [length]]))
    size = 1 / length**2
    start = (random.uniform(-1, 1), random.uniform(-1, 1) / length)

    def scaled(t: Array) -> Array:
        return size * force(t)

    x, v = _end_of_motion(scaled, edges, w, start)
    body = (
        f"coordinates: [x]\nparameters: {{F: {size!r}, k: {w * w!r}}}\n{inputs}"
        "T: x'^2/2\nV: k*x^2/2\n"
        f'Q: {{x: "F*({text})"}}\ninitial: {{x: {start[0]!r}, x\': {start[1]!r}}}\n'
    )
    options = {"method": method, "t_end": length, "samples": random.choice([2, 11]), "rtol": 1e-10}
    # an error of a velocity moves x by as much as the run is long
    options["atol"] = 1e-14 / max(1.0, length)
    rate = max(w, 1 / length)
    # the missing pulse of a run changes x by 1/200 of this or more, times its duty cycle
    end = {"x": (x, 1e-7 * (1 + abs(x))), "x'": (v, 1e-7 * (1 + abs(x)) * rate + 1e-7 * abs(v))}
    return Case("pulses", seed, body, options, end=end)


def _springs_case(seed: int) -> Case:
    """A mass between two springs, or on a spring of two stiffnesses: 1 to 200 periods."""
    random = Random(seed, 201)
    method = random.choice(METHODS)
    explicit = method in ("DOP853", "Taylor")
    periods = math.exp(random.uniform(0, math.log(200 if explicit else 10)))
    v = random.uniform(0.5, 2)
    if random.random() < 0.5:
        a, b = 10 ** random.uniform(0, 2), 10 ** random.uniform(0, 2)
        one, two = math.pi / a, math.pi / b
        force = f"-if(x > 0, {a * a!r}, {b * b!r})*x"
        period = one + two

        def state(s: float) -> tuple[float, float]:
            if s < one:
                return v / a * math.sin(a * s), v * math.cos(a * s)
            return -v / b * math.sin(b * (s - one)), -v * math.cos(b * (s - one))
    else:
        a, gap = 10 ** random.uniform(0, 3), 10 ** random.uniform(-3, 0.5)
        flight, contact = 2 * gap / v, math.pi / a
        force = f"-{a * a!r}*(max(x - {gap!r}, 0) + min(x + {gap!r}, 0))"
        period = 2 * (flight + contact)

        def state(s: float) -> tuple[float, float]:
            sign = 1.0
            s += flight / 2  # from the left end of the gap
            if s >= period / 2:
                s -= period / 2
                sign = -1.0
            if s >= period / 2:
                s -= period / 2
                sign = 1.0
            if s < flight:
                return sign * (-gap + v * s), sign * v
            s -= flight
            return sign * (gap + v / a * math.sin(a * s)), sign * v * math.cos(a * s)

    t_end = periods * period
    x, last = state(t_end % period)
    body = f"coordinates: [x]\nT: x'^2/2\nQ: {{x: \"{force}\"}}\ninitial: {{x: 0, x': {v!r}}}\n"
    fastest = max(a, b) if "if(" in force else a
    options = {"method": method, "t_end": t_end, "samples": 2, "rtol": 1e-11 if explicit else 1e-9}
    error = (1e-7 if explicit else 1e-5) * (1 + fastest * t_end / 100)
    end = {"x": (x, error * v), "x'": (last, error * v * fastest)}
    return Case("springs", seed, body, options, end=end)


# a block that a harmonic force moves, held by dry friction or by a plane


def _stick_slip(
    force: float, w: float, t_end: float
) -> tuple[Array, Array, Callable[[Array], Array]]:
    """Return when a block of mass 1 with friction 1 slips and sticks, and its velocity.

    The force is force·sin(w t). A slip begins as it passes 1, and ends as the velocity vanishes.
    """
    slips, sticks, pieces = [], [], []
    half, k = math.pi / w, 0
    lead = math.asin(1 / force) / w
    t = 0.0
    while True:
        # the first time from t at which |force| passes 1
        begin = k * half + lead
        while begin < t:
            k += 1
            begin = k * half + lead
        if begin >= t_end:
            break
        sign = 1.0 if k % 2 == 0 else -1.0

        def velocity(s: float, begin: float = begin, sign: float = sign) -> float:
            return -force / w * (math.cos(w * s) - math.cos(w * begin)) - sign * (s - begin)

        # the velocity grows until the force falls to 1, and vanishes before the next peak
        peak = (k + 1) * half - lead
        end = brentq(velocity, peak, begin + 2 * half, xtol=1e-15 * t_end, rtol=1e-15)
        if abs(force * math.sin(w * end)) > 0.999:
            raise ValueError("slips on in the other direction")
        slips.append(begin)
        pieces.append((begin, end, sign))
        if end < t_end:
            sticks.append(end)
        t, k = end, k + 1

    def at(times: Array) -> Array:
        found = np.zeros_like(times)
        for begin, end, sign in pieces:
            inside = (times > begin) & (times < end)
            s = times[inside]
            found[inside] = -force / w * (np.cos(w * s) - np.cos(w * begin)) - sign * (s - begin)
        return found

    return np.array(slips), np.array(sticks), at


def _stick_case(seed: int) -> Case:
    """Stick-slip under a harmonic force, between 1.001 and 1.6 of the limit."""
    random = Random(seed, 202)
    w = 10 ** random.uniform(-2, 3)
    force = 1 + 10 ** random.uniform(-3, -0.22)
    periods = random.uniform(0.6, 30)
    t_end = periods * math.tau / w
    try:
        slips, sticks, velocity = _stick_slip(force, w, t_end)
    except ValueError:
        return _stick_case(seed + 10**6)
    last = np.concatenate([slips, sticks])
    if len(last) and (t_end - last.max()) * w < 1e-3:
        return _stick_case(seed + 10**6)
    body = (
        f"coordinates: [x]\nparameters: {{F: {force!r}, w: {w!r}}}\nT: x'^2/2\n"
        "Q: {x: F*sin(w*t)}\n"
        "constraints:\n  s: {expr: x' = 0, limit: 1}\ninitial: {x: 0, x': 0}\n"
    )
    method = random.choice(METHODS)
    options: dict[str, Any] = {"method": method, "t_end": t_end, "samples": 1001}
    return Case(
        "stick-slip",
        seed,
        body,
        options,
        {"s slips": slips, "s sticks": sticks},
        dict.fromkeys(["s slips", "s sticks"], 1e-6 / w),
        bounds={"s": (-1 - 1e-9, 1 + 1e-9)},
        samples={"x'": (velocity, 1e-6 / w)},
    )


def _flights(force: float, w: float, t_end: float) -> tuple[Array, Array, Callable[[Array], Array]]:
    """Return when a block of weight 1 under force·sin(w t) lifts off and lands, and its height.

    It lands without a rebound, where the force is below the weight, so that it rests then.
    """
    lift, land, pieces = [], [], []
    lead, period = math.asin(1 / force) / w, math.tau / w
    t = 0.0
    while True:
        k = max(0, math.ceil((t - lead) / period))
        begin = k * period + lead
        if begin >= t_end:
            break

        def height(s: float, begin: float = begin) -> float:
            past = s - begin
            swing = math.sin(w * s) - math.sin(w * begin) - w * past * math.cos(w * begin)
            return -force / w**2 * swing - past * past / 2

        # from where the velocity is largest on, the height is sampled for its first zero
        grid = np.linspace(math.pi / w - lead + k * period, begin + 20 * period, 4001)
        values = [height(s) for s in grid]
        below = next(i for i, h in enumerate(values) if h < 0)
        end = brentq(height, grid[below - 1], grid[below], xtol=1e-15 * t_end, rtol=1e-15)
        if force * math.sin(w * end) > 0.99 or below == 0:
            raise ValueError("lifts off as it lands")
        lift.append(begin)
        pieces.append((begin, end))
        if end < t_end:
            land.append(end)
        t = end

    def at(times: Array) -> Array:
        found = np.zeros_like(times)
        for begin, end in pieces:
            inside = (times > begin) & (times < end)
            past = times[inside] - begin
            swing = np.sin(w * times[inside]) - math.sin(w * begin) - w * past * math.cos(w * begin)
            found[inside] = -force / w**2 * swing - past * past / 2
        return found

    return np.array(lift), np.array(land), at


def _lift_case(seed: int) -> Case:
    """A block on a plane that a harmonic force lifts, between 1.001 and 4 of its weight."""
    random = Random(seed, 203)
    w = 10 ** random.uniform(-2, 3)
    force = 1 + 10 ** random.uniform(-3, 0.5)
    periods = random.uniform(0.6, 30)
    t_end = periods * math.tau / w
    try:
        lift, land, height = _flights(force, w, t_end)
    except ValueError:
        return _lift_case(seed + 10**6)
    last = np.concatenate([lift, land])
    if len(last) and (t_end - last.max()) * w < 1e-3:
        return _lift_case(seed + 10**6)
    body = (
        f"coordinates: [y]\nparameters: {{F: {force!r}, w: {w!r}}}\nT: y'^2/2\nV: y\n"
        "Q: {y: F*sin(w*t)}\nconstraints:\n  s: {expr: y >= 0, restitution: 0}\n"
        "initial: {y: 0, y': 0}\n"
    )
    options: dict[str, Any] = {
        "method": random.choice(METHODS),
        "t_end": t_end,
        "samples": 1001,
        "atol": 1e-12 / max(w, 1) ** 2,
    }
    return Case(
        "lift-off",
        seed,
        body,
        options,
        {"s opens": lift, "s closes": land},
        dict.fromkeys(["s opens", "s closes"], 1e-6 / w),
        bounds={"s": (-1e-9, math.inf)},
        samples={"y": (height, 1e-6 / w**2)},
    )


#: Cases by kind, as functions of a seed.
FORCE_CASES: dict[str, Callable[[int], Case]] = {
    "pulses": _pulses_case,
    "springs": _springs_case,
    "stick-slip": _stick_case,
    "lift-off": _lift_case,
}
