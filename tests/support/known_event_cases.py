"""Cases with known events: of time, of states, with actions, several at once, and at both ends."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from known_conditions import (
    FUNCTIONS,
    Random,
    Unsuitable,
    apart,
    level_roots,
    number,
    random_function,
)
from known_events import METHODS, Case
from scipy.special import ellipj, ellipk, ellipkinc

from lagcli.arrays import Array

#: Lengths of runs, s: picoseconds, microseconds, seconds, months and 30 years.
_LENGTHS = (5e-12, 2e-6, 1.0, 1.0, 7.0, 7.0, 20.0, 3e6, 1e9)


class _Place(NamedTuple):
    """A model without events, and the variable z of its conditions, which grows from 0 to 1.

    Parameters
    ----------
    lines : str
        The model's coordinates, energies, constraints and initial values.
    z : str
    velocity : str
        A velocity that is constant.
    rounding : float
        Error of z.
    constrained : bool
    """

    lines: str
    z: str
    velocity: str
    rounding: float
    constrained: bool = False


def _of_time(start: float, length: float, _random: Random) -> _Place:
    offset = "t" if start == 0 else f"(t - {start!r})"
    lines = "coordinates: [x]\nT: x'^2/2\ninitial: {x: 0.25, x': 0.5}\n"
    return _Place(lines, f"({offset}/{length!r})", "x'", 2.3e-16 * (start / length + 1))


def _particle(_start: float, length: float, random: Random) -> _Place:
    x, way = random.uniform(-2, 2), random.uniform(0.3, 30) * random.choice([-1, 1])
    lines = f"coordinates: [x]\nT: 1.7*x'^2/2\ninitial: {{x: {x!r}, x': {way / length!r}}}\n"
    return _Place(lines, f"((x - {number(x)})/{number(way)})", "x'", 3e-13)


def _projectile(_start: float, length: float, random: Random) -> _Place:
    x, way = random.uniform(-2, 2), random.uniform(0.3, 30)
    lines = (
        "coordinates: [y, x]\nT: (x'^2 + y'^2)/2\n"
        f"V: {9.81 / length**2!r}*y\n"
        f"initial: {{x: {x!r}, y: 1, x': {way / length!r}, y': {3 / length!r}}}\n"
    )
    return _Place(lines, f"((x - {number(x)})/{way!r})", "x'", 3e-13)


def _slope(_start: float, length: float, random: Random) -> _Place:
    """A particle on a straight line, in two coordinates."""
    k, way = random.uniform(0.3, 2), random.uniform(0.3, 3)
    lines = (
        f"coordinates: [x, y]\nT: (x'^2 + y'^2)/2\nconstraints: {{line: y = {k!r}*x}}\n"
        f"initial: {{x: 0, y: 0, x': {way / length!r}, y': {k * way / length!r}}}\n"
    )
    return _Place(lines, f"(y/{k * way!r})", "x'", 3e-12, True)


def _wheel(_start: float, length: float, random: Random) -> _Place:
    """A wheel that rolls, with a velocity constraint."""
    r, way = random.uniform(0.1, 2), random.uniform(0.3, 3)
    lines = (
        f"coordinates: [x, phi]\nT: x'^2/2 + 0.2*phi'^2\nconstraints: {{roll: x' = {r!r}*phi'}}\n"
        f"initial: {{x: 0, phi: 0, x': {way / length!r}, phi': {way / r / length!r}}}\n"
    )
    return _Place(lines, f"(phi/{way / r!r})", "x'", 3e-12, True)


_PLACES = (_of_time, _of_time, _particle, _particle, _projectile, _slope, _wheel)


def _options(random: Random, start: float, length: float, constrained: bool) -> dict[str, Any]:
    """Return random settings: the method, the formulation, and the number of samples."""
    method = random.choice([*METHODS, "auto"])
    options: dict[str, Any] = {"method": method, "t_end": start + length}
    if start:
        options["t_start"] = start
    if constrained:
        formulations = ["projection", "index1"]
        if method == "DOP853":
            formulations.append("baumgarte")
        options["formulation"] = random.choice(formulations)
        options["rtol"] = 1e-11
    options["samples"] = int(random.choice([2, 2, 11, 200]))
    return options


def _way(random: Random) -> str:
    return random.choice(["=", "=", ">=", "<=", ">", "<"])


def _kept(signs: Array, way: str) -> Array:
    """Return which of the sign changes are events of a condition ``f WAY 0``."""
    rising = signs[1:] > signs[:-1]
    if way == "=":
        return np.ones(len(rising), dtype=bool)
    return rising if way[0] == ">" else ~rising


def _known_function(seed: int, name: str) -> Case:
    random = Random(seed, list(FUNCTIONS).index(name))
    start = random.choice([0.0, 0.0, 0.0, 1e6])
    length = random.choice(_LENGTHS) if not start else random.uniform(1, 20)
    make = _PLACES[random.integer(len(_PLACES))]
    place = make(start, length, random)
    fine = make is _of_time and not start
    while True:
        function = random_function(name, random, fine)
        shift = place.rounding + (function.slack() if len(function.roots) else 0)
        gaps = np.diff(function.roots)
        # what rounding may merge is not a case, and roots within 1e-12 count as one instant
        closest = 20 * float(np.max(shift)) + 2e-12 * (1 + start / length)
        if not len(gaps) or gaps.min() > closest:
            break
    way = _way(random)
    if name == "tangent" and way == "=":
        way = ">="
    signs = function.signs()
    assert (signs[1:] == -signs[:-1]).all(), (name, function, signs)
    roots = function.roots[_kept(signs, way)]
    slack = np.broadcast_to(np.asarray(shift), function.roots.shape)[_kept(signs, way)]
    text = function.text.format(z="z")
    condition = f"{text} {way} 0"
    if random.random() < 0.3:
        condition = f"0 {way.translate(str.maketrans('<>', '><'))} {text}"
    entry, outputs, end = {"when": f'"{condition}"'}, "", {}
    kind = random.integer(5)
    limit = None
    if kind == 0 and len(roots) > 1:
        limit = 1 + random.integer(len(roots) - 1)
        entry["times"] = str(limit)
    if kind in (1, 2):
        entry["set"] = "{n: n + 1}"
        outputs = "parameters: {n: 0}\noutputs: {count: n}\n"
        end["count"] = (float(len(roots)), 0.0)
    if kind == 3:
        entry["record"] = random.choice(["false", f"[{place.velocity}]"])
    if kind == 4 and make is _of_time:
        entry["impulse"] = f"{{x: {0.25 / length!r}}}"
        v = 0.5 + 0.25 / length * len(roots)
        x = 0.25 + 0.5 * length + 0.25 * float((1 - roots).sum())
        end["x'"], end["x"] = (v, 1e-11 * v), (x, 1e-9 * (1 + abs(x)))
    if kind == 2 and len(roots) > 1 and random.random() < 0.5:
        limit = 1 + random.integer(len(roots) - 1)
        entry["times"] = str(limit)
        end["count"] = (float(limit), 0.0)
    written = ", ".join(f"{k}: {x}" for k, x in entry.items())
    body = f"definitions:\n  z: {place.z}\n{place.lines}{outputs}events:\n  e: {{{written}}}\n"
    roots, slack = roots[:limit], slack[:limit]
    times = start + length * roots
    return Case(
        kind=f"{name} of t" if make is _of_time else f"{name} of a state",
        seed=seed,
        text=body,
        options=_options(random, start, length, place.constrained),
        events={"e": times},
        slack={"e": length * (1e-9 + slack) + 4 * np.spacing(times)},
        end=end,
    )


# events of motions that are not linear in time


def _oscillator(random: Random) -> tuple[float, float, float, float, str, dict[str, Any]]:
    """Return w, amplitude, phase, the error of phases, the lines of an oscillator, its options."""
    options: dict[str, Any] = {"method": random.choice(METHODS)}
    explicit = options["method"] in ("DOP853", "Taylor")
    periods = math.exp(random.uniform(0, math.log(200 if explicit else 8)))
    length = random.choice([2e-6, 1.0, 20.0, 1e8])
    w = math.tau * periods / length
    amplitude, phase = random.uniform(0.5, 2), random.uniform(0, 6)
    options |= {"t_end": length, "rtol": 1e-12 if explicit else 1e-9, "samples": 2}
    x, v = amplitude * math.sin(phase), amplitude * w * math.cos(phase)
    lines = (
        f"coordinates: [x]\nparameters: {{w: {w!r}}}\nT: x'^2/2\nV: w^2*x^2/2\n"
        f"initial: {{x: {x!r}, x': {v!r}}}\n"
    )
    return w, amplitude, phase, 1e-9 if explicit else 1e-6, lines, options


def _oscillator_case(seed: int) -> Case:
    random = Random(seed, 100)
    w, amplitude, phase, error, lines, options = _oscillator(random)
    length = options["t_end"]
    y = w * length  # the angle runs from phase to phase + y
    what = random.integer(7)
    level = random.uniform(-0.97, 0.97)
    a = repr(amplitude)
    if what == 0:
        text, angle = f"x - {number(amplitude * level)}", (1.0, phase, level)
    elif what == 1:
        text, angle = f"x' - {number(amplitude * w * level)}", (1.0, phase + math.pi / 2, level)
    elif what == 2:
        text, angle = f"x'' - {number(amplitude * w * w * level)}", (1.0, phase + math.pi, level)
    elif what == 3:
        text, angle = f"x*x'/w - {number(amplitude**2 / 2 * level)}", (2.0, 2 * phase, level)
    elif what == 4:
        n = 2 + random.integer(4)
        before, last = "1", f"x/{a}"
        for k in range(n - 1):
            product = f"2*(x/{a})*({last})"
            before, last = last, f"{product} - {'1' if k == 0 else f'({before})'}"
        # T_n(sin u) = cos(n (pi/2 - u)) = sin(n u + (1 - n) pi/2) … up to its sign
        text, angle = last, (float(n), n * phase - n * math.pi / 2 + math.pi / 2, 0.0)
    elif what == 5:
        margin = 10 ** random.uniform(-6 if error < 1e-8 else -3, -2)
        text, angle = f"x - {number(amplitude * (1 - margin))}", (1.0, phase, 1 - margin)
    else:
        margin = 10 ** random.uniform(-5, -1)
        energy = (amplitude * w) ** 2
        text = f"x'^2 + w^2*x^2 - {energy * (1 + margin)!r}"
        angle = None
    if angle is None:
        roots = np.empty(0)
        slack = np.empty(0)
    else:
        factor, offset, level = angle
        try:
            roots = apart(level_roots(factor * y, offset, level), 1e-9, 1e-3 / y)
        except Unsuitable:
            return _oscillator_case(seed + 10**6)
        steep = np.sqrt(1 - level * level)
        slack = np.full(len(roots), error * (1 + 1 / steep))
    way = _way(random)
    if angle is not None:
        edges = np.concatenate([[0.0], roots, [1.0]])
        middle = (edges[1:] + edges[:-1]) / 2
        signs = np.sign(np.sin(factor * y * middle + offset) - level)
        kept = _kept(signs, way)
        roots, slack = roots[kept], slack[kept]
    entry = f'when: "{text} {way} 0", set: {{n: n + 1}}'
    body = lines.replace("{w:", "{n: 0, w:") + f"outputs: {{count: n}}\nevents:\n  e: {{{entry}}}\n"
    return Case(
        "oscillator",
        seed,
        body,
        options,
        {"e": length * roots},
        {"e": length * slack},
        {"count": (float(len(roots)), 0.0)},
    )


def _pendulum_case(seed: int) -> Case:
    """A pendulum, by its angle or in Cartesian coordinates, with elliptic functions."""
    random = Random(seed, 101)
    method = random.choice(["DOP853", "Taylor"])
    g, length = random.uniform(1, 20), random.uniform(0.3, 2)
    start = random.uniform(0.2, 3.0)
    k2 = math.sin(start / 2) ** 2
    w = math.sqrt(g / length)
    quarter = ellipk(k2)
    period = 4 * quarter / w
    t_end = period * random.uniform(0.6, 30)
    level = random.uniform(-0.9, 0.9) * start if random.random() < 0.7 else 0.0

    def angle(t: Array) -> Array:
        sn = ellipj(w * t + quarter, k2)[0]
        return np.asarray(2 * np.arcsin(math.sqrt(k2) * sn))

    u = float(ellipkinc(math.asin(math.sin(level / 2) / math.sin(start / 2)), k2))
    first = (quarter - u) / w
    k = np.arange(int(t_end / period) + 2)
    roots = np.sort(np.concatenate([k * period + first, (k + 1) * period - first]))
    roots = roots[roots < t_end]
    if len(roots) and t_end - roots[-1] < 1e-4 * period:
        return _pendulum_case(seed + 10**6)
    if random.random() < 0.5:
        lines = (
            f"coordinates: [phi]\nparameters: {{n: 0, g: {g!r}, l: {length!r}}}\n"
            f"T: l^2*phi'^2/2\nV: -g*l*cos(phi)\ninitial: {{phi: {start!r}, phi': 0}}\n"
        )
        f = f"phi - {number(level)}"
        options: dict[str, Any] = {}
    else:
        lines = (
            f"coordinates: [x, y]\nparameters: {{n: 0, g: {g!r}, l: {length!r}}}\n"
            "T: (x'^2 + y'^2)/2\nV: g*y\nconstraints: {rod: x^2 + y^2 = l^2}\n"
            f"initial: {{x: {length * math.sin(start)!r}, y: {-length * math.cos(start)!r},"
            " x': 0, y': 0}\n"
        )
        level = 0.0 if abs(start) > 1.5 else level
        f = f"x - {number(length * math.sin(level))}"
        if level == 0.0:
            roots = (np.arange(int(t_end / period * 2) + 2) + 0.5) * period / 2
            roots = roots[roots < t_end]
            if len(roots) and t_end - roots[-1] < 1e-4 * period:
                return _pendulum_case(seed + 10**6)
        options = {"formulation": random.choice(["projection", "index1"])}
    way = _way(random)
    edges = np.concatenate([[0.0], roots, [t_end]])
    kept = _kept(np.sign(angle((edges[1:] + edges[:-1]) / 2) - level), way)
    body = f"{lines}outputs: {{count: n}}\nevents:\n  e: {{when: {f} {way} 0, set: {{n: n + 1}}}}\n"
    return Case(
        "pendulum",
        seed,
        body,
        {**options, "method": method, "t_end": t_end, "rtol": 1e-12, "samples": 2},
        {"e": roots[kept]},
        {"e": 1e-7 * period},
        {"count": (float(kept.sum()), 0.0)},
    )


def _multiplier_case(seed: int) -> Case:
    """A condition on the force of a drive x = a sin(w t): λ = m x'' + k x."""
    random = Random(seed, 102)
    method = random.choice(METHODS)
    periods = math.exp(random.uniform(0, math.log(100 if method in ("DOP853", "Taylor") else 8)))
    length = random.choice([1e-3, 1.0, 50.0])
    w, phase, level = math.tau * periods / length, random.uniform(0, 6), random.uniform(-0.95, 0.95)
    a, k = random.uniform(0.1, 2), random.uniform(0.0, 0.5) * w * w
    size = a * (k - w * w)
    way = _way(random)
    try:
        roots = apart(level_roots(w * length, phase, level), 1e-9, 1e-3 / periods)
    except Unsuitable:
        return _multiplier_case(seed + 10**6)
    edges = np.concatenate([[0.0], roots, [1.0]])
    signs = np.sign(size * (np.sin(w * length * (edges[1:] + edges[:-1]) / 2 + phase) - level))
    roots = roots[_kept(signs, way)]
    body = (
        f"coordinates: [x, y]\nparameters: {{n: 0, a: {a!r}, w: {w!r}, p: {phase!r}, k: {k!r}}}\n"
        "T: (x'^2 + y'^2)/2\nV: k*x^2/2\nconstraints: {drive: x = a*sin(w*t + p)}\n"
        f"initial: {{y: 0, y': {1 / length!r}, x: {a * math.sin(phase)!r},"
        f" x': {a * w * math.cos(phase)!r}}}\noutputs: {{count: n}}\n"
        f"events:\n  e: {{when: lambda.drive {way} {number(size * level)}, set: {{n: n + 1}}}}\n"
    )
    options = {"method": method, "t_end": length, "samples": 2}
    if method != "DOP853" or random.random() < 0.5:
        options["formulation"] = "projection"
    return Case(
        "multiplier",
        seed,
        body,
        options,
        {"e": length * roots},
        {"e": length * 1e-7},
        {"count": (float(len(roots)), 0.0)},
    )


def _bounce_case(seed: int) -> Case:
    """A ball that an event throws back, with a coefficient of restitution."""
    random = Random(seed, 103)
    h, e, g = random.uniform(0.5, 5), random.uniform(0.5, 1.0), 9.81
    if random.random() < 0.2:
        e = 1.0
    roots, v = [math.sqrt(2 * h / g)], math.sqrt(2 * g * h) * e
    while len(roots) < 40 and v > 0.02:
        roots.append(roots[-1] + 2 * v / g)
        v *= e
    t_end = roots[-1] + v / g
    way = random.choice(["<=", "<", "="]) if e == 1.0 else random.choice(["<=", "<"])
    other = f"0 {'=' if way == '=' else '>='} y"  # the same, seen from the other side
    when = other if random.random() < 0.3 else f"y {way} 0"
    body = (
        f"coordinates: [y]\nparameters: {{e: {e!r}, g: {g!r}}}\nT: y'^2/2\nV: g*y\n"
        f"initial: {{y: {h!r}, y': 0}}\nevents:\n  hit: {{when: {when}, set: {{y': -e*y'}}}}\n"
    )
    options = {"method": random.choice(METHODS), "t_end": t_end, "samples": 2}
    return Case("bounce", seed, body, options, {"hit": np.array(roots)}, {"hit": 1e-7 * t_end})


def _wrap_case(seed: int) -> Case:
    """A particle that an event sets back, or between two walls; both directions or one."""
    random = Random(seed, 104)
    length = random.choice([1e-6, 1.0, 20.0, 1e8])
    count = math.exp(random.uniform(0.1, math.log(200)))
    way, v = random.uniform(0.3, 3), 0.0
    v = way * count / length
    k = np.arange(1, int(count) + 1)
    if count - k[-1] < 1e-3:
        return _wrap_case(seed + 10**6)
    roots = k * length / count
    sign = random.choice([-1, 1])
    if random.random() < 0.5:
        relation, end = ">=" if sign > 0 else "<=", number(sign * way)
        body = (
            f"coordinates: [x]\nparameters: {{L: {way!r}}}\nT: x'^2/2\n"
            f"initial: {{x: 0, x': {sign * v!r}}}\n"
            f"events:\n  e: {{when: x {relation} {end}, set: {{x: x - {end}}}}}\n"
        )
        events = {"e": roots}
    else:
        both = random.random() < 0.5
        low, high = ("=", "=") if both else ("<=", ">=")
        body = (
            f"coordinates: [x]\nparameters: {{L: {way!r}}}\nT: x'^2/2\n"
            f"initial: {{x: 0.5*L, x': {sign * v!r}}}\nevents:\n"
            f"  left: {{when: x {low} 0, set: {{x': -x'}}}}\n"
            f"  right: {{when: x {high} L, set: {{x': -x'}}}}\n"
        )
        hits = (k - 0.5) * length / count
        first, second = ("right", "left") if sign > 0 else ("left", "right")
        events = {first: hits[::2], second: hits[1::2]}
        if count - (k[-1] + 0.5) > 0:
            events[first if len(k) % 2 == 0 else second] = np.append(
                events[first if len(k) % 2 == 0 else second], (k[-1] + 0.5) * length / count
            )
        if abs(count - int(count) - 0.5) < 1e-3:
            return _wrap_case(seed + 10**6)
    options = {"method": random.choice(METHODS), "t_end": length, "samples": 2}
    return Case("wrap", seed, body, options, events, dict.fromkeys(events, 1e-9 * length))


def _kick_case(seed: int) -> Case:
    """A free particle that a periodic event kicks or slows down."""
    random = Random(seed, 105)
    length, count = random.choice([1e-6, 6.5, 100.0]), float(np.exp(random.uniform(0.7, 5.3)))
    period = length / count
    level = random.uniform(-0.9, 0.9)
    relation = random.choice([">=", "<=", "="])
    both = level_roots(math.tau * count, 0.0, level)
    both = both[(both > 0) & (both < 1)]
    if not len(both) or min(both[0], 1 - both[-1]) < 1e-4 / count:
        return _kick_case(seed + 10**6)
    rising = np.cos(math.tau * count * both) > 0
    roots = both if relation == "=" else both[rising] if relation == ">=" else both[~rising]
    p = repr(period)
    when = f"sin(2*pi*t/{p}) {relation} {number(level)}"
    v, x, last = 1.0, 0.0, 0.0
    kick = random.random() < 0.5
    for z in roots:
        x += v * (z - last)
        v, last = (v + 0.5 if kick else 0.98 * v), z
    x += v * (1 - last)
    action = f"impulse: {{x: {0.5 / length!r}}}" if kick else "set: {x': 0.98*x'}"
    body = (
        f"coordinates: [x]\nT: x'^2/2\ninitial: {{x: 0, x': {1 / length!r}}}\n"
        f"events:\n  kick: {{when: {when}, {action}}}\n"
    )
    end = {"x": (x, 1e-8 * (1 + x)), "x'": (v / length, 1e-10 * (1 + v) / length)}
    options = {"method": random.choice(METHODS), "t_end": length, "samples": 2}
    return Case("kick", seed, body, options, {"kick": length * roots}, {"kick": 1e-9 * length}, end)


def _together_case(seed: int) -> Case:
    """Several events at the same instants, in states and time."""
    random = Random(seed, 106)
    length = random.choice([1e-6, 1.0, 8.0, 1e8])
    way = random.uniform(0.3, 3)
    name = random.choice(["cubic", "chebyshev", "sine", "product"])
    function = random_function(name, random, False)
    if len(function.roots) > 1 and np.diff(function.roots).min() < 1e-6:
        return _together_case(seed + 10**6)
    kept = _kept(function.signs(), ">=")
    of_state = function.text.format(z=f"(x/{way!r})")
    of_time = function.text.format(z=f"(t/{length!r})")
    body = (
        f"coordinates: [x]\nparameters: {{n: 0}}\nT: x'^2/2\n"
        f"initial: {{x: 0, x': {way / length!r}}}\noutputs: {{count: n}}\nevents:\n"
        f'  a: {{when: "{of_state} >= 0", set: {{n: n + 1}}}}\n'
        f'  b: {{when: "{of_time} >= 0", set: {{n: n + 100}}}}\n'
        f'  c: {{when: "{of_state} = 0", set: {{n: n + 10000}}}}\n'
        f'  d: {{when: "3*({of_time}) <= 0", set: {{n: n + 1000000}}}}\n'
    )
    roots = length * function.roots
    slack = length * (1e-9 + function.slack())
    rising, falling = roots[kept], roots[~kept]
    events = {"a": rising, "b": rising, "c": roots, "d": falling}
    room = {"a": slack[kept], "b": slack[kept], "c": slack, "d": slack[~kept]}
    count = 101.0 * len(rising) + 1e4 * len(roots) + 1e6 * len(falling)
    options = {"method": random.choice(METHODS), "t_end": length, "samples": 2}
    return Case("together", seed, body, options, events, room, {"count": (count, 0.0)})


def _compound_case(seed: int) -> Case:
    """Conditions joined by `and`, `or` and `not`."""
    random = Random(seed, 107)
    length = random.choice([1e-6, 1.0, 8.0])
    w, v = (math.tau * math.exp(random.uniform(0, math.log(50))) for _ in range(2))
    p, q = random.uniform(0, 6), random.uniform(0, 6)
    a, b = random.uniform(-0.9, 0.9), random.uniform(-0.9, 0.9)
    both = np.concatenate([level_roots(w, p, a), level_roots(v, q, b)])
    try:
        both = apart(both, 1e-6)
    except Unsuitable:
        return _compound_case(seed + 10**6)
    edges = np.concatenate([[0.0], both, [1.0]])
    middle = (edges[1:] + edges[:-1]) / 2
    one, two = np.sin(w * middle + p) > a, np.sin(v * middle + q) > b
    z = f"t/{length!r}" if random.random() < 0.5 else "x"
    first = f"sin({w!r}*{z} + {p!r}) > {number(a)}"
    second = f"sin({v!r}*{z} + {q!r}) > {number(b)}"
    text, truth = [
        (f"{first} and {second}", one & two),
        (f"{first} or {second}", one | two),
        (f"not {first} and {second}", ~one & two),
        (f"not ({first} or {second})", ~(one | two)),
    ][random.integer(4)]
    roots = both[truth[1:] & ~truth[:-1]]
    body = (
        "coordinates: [x]\nparameters: {n: 0}\nT: x'^2/2\n"
        f"initial: {{x: 0, x': {1 / length!r}}}\n"
        f'outputs: {{count: n}}\nevents:\n  e: {{when: "{text}", set: {{n: n + 1}}}}\n'
    )
    options = {"method": random.choice(METHODS), "t_end": length, "samples": 2}
    end = {"count": (float(len(roots)), 0.0)}
    slack = length * (1e-9 + 1e-12)
    return Case("compound", seed, body, options, {"e": length * roots}, {"e": slack}, end)


def _ends_case(seed: int) -> Case:
    """Conditions that are zero exactly at the start, and exactly at the end.

    A root at the start is no event: the condition holds there, or it becomes false. One at the
    end is.
    """
    random = Random(seed, 108)
    length = random.choice([0.5, 1.0, 2.0, 8.0, 1024.0])
    a = random.choice([0.25, 0.5, 0.75]) * length
    sign = random.choice([-1, 1])
    way = _way(random)
    of_state = random.random() < 0.5
    s = "x" if of_state else "t"
    at = random.integer(3)
    factors = {0: [0.0, a], 1: [a, length], 2: [0.0, a, length]}[int(at)]
    text = f"{number(sign)}*" + "*".join(f"({s} - {r!r})" if r else s for r in factors)
    inner = [r for r in factors if r > 0]
    # signs within the run, and what follows the end
    beyond = np.array([0.5 * inner[0], *(np.array(inner[1:]) + inner[:-1]) / 2, inner[-1] + 1])
    values = sign * np.prod([beyond - r for r in factors], axis=0)
    roots = np.array(inner)[_kept(np.sign(values), way)]
    body = (
        "coordinates: [x]\nparameters: {n: 0}\nT: x'^2/2\ninitial: {x: 0, x': 1}\n"
        f"outputs: {{count: n}}\nevents:\n  e: {{when: {text} {way} 0, set: {{n: n + 1}}}}\n"
    )
    options = {"method": random.choice(METHODS), "t_end": length, "samples": 2}
    count = {"count": (float(len(roots)), 0.0)}
    slack = 1e-9 * length
    return Case("ends", seed, body, options, {"e": roots}, {"e": slack}, count)


def _distance_case(seed: int) -> Case:
    """The distance of two free particles, down to a near touch."""
    random = Random(seed, 109)
    p, u = random.array(-3, 3, (2, 3)), random.array(-2, 2, (2, 3))
    dp, du = p[0] - p[1], u[0] - u[1]
    speed = float(du @ du)
    nearest = -float(dp @ du) / speed
    least = math.sqrt(max(float(dp @ dp) - float(dp @ du) ** 2 / speed, 0.0))
    radius = least + 10 ** random.uniform(-6, 0.5)
    half = math.sqrt((radius**2 - least**2) / speed)
    both = np.array([nearest - half, nearest + half])
    length = max(1.0, abs(nearest) + 1.5 * half)
    inside = (both > 0) & (both < length)
    if np.abs(both).min() < 1e-4 or np.abs(both - length).min() < 1e-4:
        return _distance_case(seed + 10**6)
    way = _way(random)
    wanted = {"=": [True, True], "<": [True, False], ">": [False, True]}[way[0]]
    roots = both[inside & np.array(wanted)]
    names = ["x1", "y1", "z1", "x2", "y2", "z2"]
    initial = ", ".join(
        f"{n}{prime}: {float(x)!r}"
        for prime, table in (("", p), ("'", u))
        for n, x in zip(names, table.ravel(), strict=True)
    )
    squares = " + ".join(f"{n}'^2" for n in names)
    body = (
        f"coordinates: [{', '.join(names)}]\nT: ({squares})/2\ninitial: {{{initial}}}\nevents:\n"
        f"  near: {{when: sqrt((x1 - x2)^2 + (y1 - y2)^2 + (z1 - z2)^2) {way} {radius!r}}}\n"
    )
    options = {"method": random.choice(METHODS), "t_end": length, "samples": 2}
    slack = 1e-9 * length + 1e-13 * radius / (speed * half)
    return Case("distance", seed, body, options, {"near": roots}, {"near": slack})


def _height_case(seed: int) -> Case:
    """A height that a projectile passes twice, down to its last 1e-6."""
    random = Random(seed, 110)
    v, g = random.uniform(3, 15), 9.81
    top = v * v / (2 * g)
    level = top * (1 - 10 ** random.uniform(-6, -0.05))
    half = math.sqrt(2 * (top - level) / g)
    both = np.array([v / g - half, v / g + half])
    way = _way(random)
    roots = both[np.array({"=": [True, True], ">": [True, False], "<": [False, True]}[way[0]])]
    body = (
        f"coordinates: [x, y]\nT: (x'^2 + y'^2)/2\nV: {g}*y\n"
        f"initial: {{x: 0, y: 0, x': 1, y': {v!r}}}\nevents:\n  e: {{when: y {way} {level!r}}}\n"
    )
    options = {"method": random.choice(METHODS), "t_end": 2.2 * v / g, "samples": 2}
    return Case("height", seed, body, options, {"e": roots}, {"e": 1e-9 + 1e-13 / half})


def _case_of(name: str) -> Callable[[int], Case]:
    return lambda seed: _known_function(seed, name)


#: Cases by kind, as functions of a seed.
EVENT_CASES: dict[str, Callable[[int], Case]] = {
    **{name: _case_of(name) for name in FUNCTIONS},
    "oscillator": _oscillator_case,
    "pendulum": _pendulum_case,
    "multiplier": _multiplier_case,
    "bounce": _bounce_case,
    "wrap": _wrap_case,
    "kick": _kick_case,
    "together": _together_case,
    "compound": _compound_case,
    "ends": _ends_case,
    "distance": _distance_case,
    "height": _height_case,
}
