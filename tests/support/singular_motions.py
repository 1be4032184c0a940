"""Random models that meet a singular configuration, or pass one closely, at a known time."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from lagcli.arrays import Array


def losing_rank(
    rng: np.random.Generator, rows: int | None = None, miss: float = 0.0
) -> tuple[str, float]:
    """Return a model with constraints B(t) q = 0 at rest, and the time at which B loses rank.

    B = P diag(1, …, 1, o + sin(ω(t − s))) Q with random P and Q of full rank, many of whose entries
    may be zero. The parameter o is 0; from 1 on, B keeps its rank. With `miss`, the sine is
    √(sin² + 2 miss), as where two branches of a motion miss each other by this. There are `rows`
    constraints, by default one to four.
    """
    rows = rows or int(rng.integers(1, 5))
    columns = rows + int(rng.integers(0, 4))
    part = float(rng.choice([1.0, 0.5, 0.35]))

    def matrix(size: tuple[int, int]) -> Array:
        while True:
            found = rng.normal(size=size).round(3) * (rng.random(size) < part)
            if np.linalg.svd(found, compute_uv=False)[-1] > 0.15:
                return np.asarray(found)

    p, q = matrix((rows, rows)), matrix((rows, columns))
    constant, moving = p[:, :-1] @ q[:-1], np.outer(p[:, -1], q[-1])
    rate, time = (round(float(rng.uniform(*ends)), 4) for ends in ((0.3, 3.0), (0.2, 0.9)))
    masses = (10 ** rng.uniform(-1, 1, columns)).round(4)
    sine = f"sin({rate}*(t - s))"
    sine = f"sqrt({sine}^2 + {2 * miss!r})" if miss else sine
    lines = [
        f"  c{i}: "
        + " + ".join(
            f"({constant[i, j]:.9f} + {moving[i, j]:.9f}*(o + {sine}))*q{j}"
            for j in range(columns)
            if abs(constant[i, j]) > 1e-9 or moving[i, j]
        )
        + " = 0\n"
        for i in range(rows)
    ]
    text = (
        f"parameters: {{o: 0, s: {time}}}\n"
        f"coordinates: [{', '.join(f'q{j}' for j in range(columns))}]\n"
        f"T: {' + '.join(f'''{m}*q{j}'^2/2''' for j, m in enumerate(masses))}\n"
        f"constraints:\n{''.join(lines)}"
        f"initial: {{{', '.join(f'''q{j}: 0, q{j}': 0''' for j in range(columns))}}}\n"
    )
    return text, time


def beside_an_oscillator(text: str, rate: float) -> str:
    """Return a model of `losing_rank` with an oscillator, which meets no constraint: its angular
    frequency limits the steps."""
    for key, more in (
        ("coordinates: [", "u, "),
        ("T: ", "u'^2/2 + "),
        ("initial: {", "u: 1, u': 0, "),
    ):
        text = text.replace(key, key + more)
    return text.replace("constraints:", f"V: ({rate}*u)^2/2\nconstraints:")


class Passage(NamedTuple):
    """A linkage that passes a position in which it is straight, or nearly.

    Parameters
    ----------
    text : str
    time, end : float
        The time of that position; one after it.
    name : str
        A coordinate ...
    exact : callable
        ... and t → its value.
    """

    text: str
    time: float
    end: float
    name: str
    exact: Callable[[Array], Array]


def folding_crank(rng: np.random.Generator, short: float) -> Passage:
    """Return a slider-crank whose crank is shorter than its rod by a part of it.

    At φ = π/2, the slider turns back within an angle of about √(2 short), or, with equal lengths, B
    loses rank.
    """
    rod = round(float(rng.uniform(0.3, 3)), 3)
    crank, rate = rod * (1 - short), round(float(rng.uniform(0.3, 5)), 3)
    angle = round(float(rng.uniform(-1.2, 1.2)), 3)
    mass = rng.uniform(0.1, 2, 2).round(3)

    def slider(t: Array) -> Array:
        phi = angle + rate * t
        return crank * np.cos(phi) + np.sqrt(rod**2 - (crank * np.sin(phi)) ** 2)

    time = (math.pi / 2 - angle) / rate
    x = float(slider(np.array(0.0)))
    text = f"""
parameters: {{l: {rod}, r: {crank!r}, w: {rate}, a: {angle}}}
coordinates: [bx, by, x]
T: ({mass[0]}*(bx'^2 + by'^2) + {mass[1]}*x'^2)/2
V: x
constraints:
  rod: (x - bx)^2 + by^2 = l^2
  bx: bx = r*cos(a + w*t)
  by: by = r*sin(a + w*t)
initial:
  bx: {{guess: {crank * math.cos(angle)}}}
  by: {{guess: {crank * math.sin(angle)}}}
  x: {{guess: {x!r}}}
  bx': {{guess: 0}}
  by': {{guess: 0}}
  x': {{guess: 0}}
"""
    return Passage(text, time, time + 0.5 / rate, "x", slider)


def straight_four_bar(rng: np.random.Generator, short: float) -> Passage:
    """Return a four-bar linkage with angles as coordinates, whose rods can be in line, or nearly.

    Crank and frame together are as long as coupler and rocker, or shorter by a part of them.
    """
    while True:
        a, b, c = (float(x) for x in rng.uniform(0.4, 2.0, 3))
        frame = b + c - a
        if frame > 0.3 and abs(a - frame) > 1.1 * abs(b - c) + 0.1:
            break
    crank = a - short * (b + c)
    rate, before = round(float(rng.uniform(0.3, 5)), 3), round(float(rng.uniform(0.2, 1.0)), 3)
    angle = math.pi - before

    def both(t: Array) -> tuple[Array, Array]:
        phi = angle + rate * t
        # from the crank's pin to the rocker's bearing
        x, y = frame - crank * np.cos(phi), -crank * np.sin(phi)
        far = np.hypot(x, y)
        to, at = np.arctan2(y, x), np.arccos((far**2 + b**2 - c**2) / (2 * b * far))
        beta = to + at
        return beta, np.arctan2(b * np.sin(beta) - y, b * np.cos(beta) - x)

    beta, gamma = (float(x) for x in both(np.array(0.0)))
    mass = rng.uniform(0.1, 2, 3).round(3)
    text = f"""
parameters: {{a: {crank!r}, b: {b!r}, c: {c!r}, d: {frame!r}, w: {rate}, p: {angle!r}}}
coordinates: [phi, be, ga]
T: ({mass[0]}*phi'^2 + {mass[1]}*be'^2 + {mass[2]}*ga'^2)/2
constraints:
  across: a*cos(phi) + b*cos(be) = d + c*cos(ga)
  up: a*sin(phi) + b*sin(be) = c*sin(ga)
  drive: phi = p + w*t
initial:
  phi: {{guess: {angle!r}}}
  be: {{guess: {beta!r}}}
  ga: {{guess: {gamma!r}}}
  phi': {{guess: 0}}
  be': {{guess: 0}}
  ga': {{guess: 0}}
"""
    return Passage(text, before / rate, (before + 0.15) / rate, "be", lambda t: both(t)[0])


def swinging_crank(rng: np.random.Generator, beside: int) -> Passage:
    """Return a slider-crank with equal lengths in free motion, beside as many pendulums.

    It passes φ = π/2, where B loses rank, with the momentum of its branch x = 2 l cos φ: as one
    equation in φ, T = (m l² + 4 M l² sin²φ) φ'²/2 and V = m g l sin φ.
    """
    length, m, slider = (float(x) for x in rng.uniform(0.3, 2, 3).round(3))
    angle, rate, g = float(rng.uniform(0.3, 1.2)), float(rng.uniform(5, 8)), 9.81

    def slope(_: float, y: Array) -> list[float]:
        phi, speed = y
        inertia = length**2 * (m + 4 * slider * math.sin(phi) ** 2)
        change = 4 * slider * length**2 * math.sin(2 * phi) * speed
        force = -m * g * length * math.cos(phi) - change * speed / 2
        return [speed, force / inertia]

    def upright(_: float, y: Array) -> float:
        return float(y[0]) - math.pi / 2

    exact = solve_ivp(
        slope, (0, 3), [angle, rate], "DOP853",
        rtol=1e-12, atol=1e-13, events=upright, dense_output=True,
    )  # fmt: skip
    time, x, y = float(exact.t_events[0][0]), math.cos(angle), math.sin(angle)
    text = f"""
parameters: {{l: {length}, N: {beside}, w: {rate!r}, g: {g}}}
coordinates: [a, b, x, u[1..N], v[1..N]]
T: ({m}*(a'^2 + b'^2) + {slider}*x'^2)/2 + sum(u[i]'^2 + v[i]'^2, i = 1..N)/2
V: {m}*g*b + sum(g*v[i], i = 1..N)
constraints:
  crank: a^2 + b^2 = l^2
  rod: (x - a)^2 + b^2 = l^2
  thread[i = 1..N]: u[i]^2 + v[i]^2 = 1
initial:
  a: {{guess: {length * x!r}}}
  b: {{guess: {length * y!r}}}
  x: {2 * length * x!r}
  a': {{guess: {-length * y * rate!r}}}
  b': {{guess: {length * x * rate!r}}}
  x': {-2 * length * y * rate!r}
  u[i = 1..N]: sin(0.5 + i/N)
  v[i = 1..N]: {{guess: "-cos(0.5 + i/N)"}}
  u[1..N]': 0
  v[1..N]': {{guess: 0}}
"""
    return Passage(text, time, time + 0.2, "x", lambda t: 2 * length * np.cos(exact.sol(t)[0]))


def turning_velocity(rng: np.random.Generator, short: float) -> tuple[str, float]:
    """Return a particle of constant speed u, and the time at which its velocity has a direction.

    Its component in this direction is (1 - short) u cos(w (t - s)). At t = s, the velocity has the
    direction, and B, which depends on it, loses rank; or it comes close to it and turns back.
    """
    u, w, s = (round(float(rng.uniform(*ends)), 4) for ends in ((0.3, 3), (0.2, 1), (0.2, 1.5)))
    toward, mass = round(float(rng.uniform(0, 6)), 4), rng.uniform(0.1, 2, 2).round(3)
    angle = toward + math.acos((1 - short) * math.cos(w * s))
    text = f"""
parameters: {{u: {u}, w: {w}, s: {s}, k: {1 - short!r}, a: {toward}}}
coordinates: [x, y]
T: ({mass[0]}*x'^2 + {mass[1]}*y'^2)/2
constraints:
  speed: x'^2 + y'^2 = u^2
  along: x'*cos(a) + y'*sin(a) = k*u*cos(w*(t - s))
initial:
  x: 0
  y: 0
  x': {{guess: {u * math.cos(angle)!r}}}
  y': {{guess: {u * math.sin(angle)!r}}}
"""
    return text, s


def stated_time(message: str) -> float:
    """Return the time that a message about a singular configuration states."""
    found = re.search(r"singular configuration at t = (\S+) s", message)
    assert found is not None, message
    return float(found[1])


def stated_accuracy(message: str) -> float:
    """Return the accuracy of this time that the message states, or means by the digits alone."""
    found = re.search(r"\(to within (\S+) s", message)
    return float(found[1]) if found else 1e-6 * abs(stated_time(message))
