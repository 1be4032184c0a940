"""Pulses, and forces and drives that begin and end smoothly, as exp(−1/z) does beside its pole.

The equations are integrated by SciPy, in short steps, with functions written here.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from random_cases import seeds
from scipy.integrate import solve_ivp

import lagcli

Force = Callable[[float, float, float, float, float, float], float]
METHODS = ("auto", "DOP853", "Taylor", "Radau", "Rodas5P")
BUMP = "exp(-1/(1 - ({s})^2))"
STEP = "if({z} <= 0, 0, if({z} >= 1, 1, exp(-1/({z}))/(exp(-1/({z})) + exp(-1/(1 - {z})))))"


def begins(z: float) -> float:
    """Return exp(−1/z), 0 below 0."""
    return math.exp(-1 / z) if z > 1 / 700 else 0.0


def slope(z: float) -> float:
    """Return d exp(−1/z)/dz."""
    return begins(z) / z**2 if z > 1 / 700 else 0.0


def changes(z: float) -> float:
    """Return the smooth function that is 0 below 0 and 1 above 1."""
    return 0.0 if z <= 0 else 1.0 if z >= 1 else begins(z) / (begins(z) + begins(1 - z))


#: The model's V or Q, and the force that it stands for, of t, x, x', c, w and a.
FORCES: dict[str, tuple[str, Force]] = {
    "pulse": (
        f"Q: {{x: 'a*if(abs(t - c) < w, {BUMP.format(s='(t - c)/w')}, 0)'}}",
        lambda t, x, v, c, w, a: a * begins(1 - ((t - c) / w) ** 2),
    ),
    "two conditions": (
        f"Q: {{x: 'if(t > c - w and t < c + w, a*{BUMP.format(s='(t - c)/w')}, 0)'}}",
        lambda t, x, v, c, w, a: a * begins(1 - ((t - c) / w) ** 2),
    ),
    "onset": (
        "Q: {x: 'a*if(t > c, exp(-w/(t - c)), 0)'}",
        lambda t, x, v, c, w, a: a * begins((t - c) / w),
    ),
    "step": (
        f"Q: {{x: 'a*{STEP.format(z='(t - c)/w')}'}}",
        lambda t, x, v, c, w, a: a * changes((t - c) / w),
    ),
    "end of an oscillation": (
        "Q: {x: 'a*sin(2*t)*if(t < c, exp(-1), "
        f"if(t < c + w, {BUMP.format(s='(t - c)/w')}, 0))'}}",
        lambda t, x, v, c, w, a: a * math.sin(2 * t) * begins(1 - (max(t - c, 0) / w) ** 2),
    ),
    "hill": (
        f"V: 'if(abs(x - 0.2) < w, a*{BUMP.format(s='(x - 0.2)/w')}, 0)'",
        lambda t, x, v, c, w, a: a * slope(1 - ((x - 0.2) / w) ** 2) * 2 * (x - 0.2) / w**2,
    ),
    "brake": (
        "Q: {x: \"-if(x' > 0.3, a^2*exp(-w/(x' - 0.3)), 0)\"}",
        lambda t, x, v, c, w, a: -(a**2) * begins((v - 0.3) / w),
    ),
    "region of states": (
        "Q: {x: \"a*if(x^2 + x'^2 < w^2, exp(-1/(1 - (x^2 + x'^2)/w^2)), 0)\"}",
        lambda t, x, v, c, w, a: a * begins(1 - (x * x + v * v) / w**2),
    ),
}


@pytest.mark.parametrize("seed", seeds(2, 4))
@pytest.mark.parametrize("kind", FORCES)
def test_a_particle(kind: str, seed: int) -> None:
    rng = np.random.default_rng([seed, *kind.encode()])
    c, w, a = rng.uniform(0.5, 4), 10 ** rng.uniform(-1.5, 0.5), rng.uniform(-5, 5)
    written, force = FORCES[kind]
    potential = "V: x^2\n" if not written.startswith("V") else ""
    k = 2.0 if potential else 0.0
    text = (
        f"coordinates: [x]\nparameters: {{c: {c}, w: {w}, a: {a}}}\nT: x'^2/2\n{potential}"
        f"{written}\ninitial: {{x: -0.5, x': 0.8}}\n"
    )
    method = METHODS[int(rng.integers(len(METHODS)))]
    found = lagcli.simulate(lagcli.load_text(text), method=method, t_end=5.0, samples=11)
    assert found.status == "completed", found.message
    assert found.counts["steps"] < 1000
    exact = solve_ivp(
        lambda t, y: [y[1], force(t, y[0], y[1], c, w, a) - k * y[0]],
        (0, 5),
        [-0.5, 0.8],
        "DOP853",
        t_eval=found.time,
        max_step=w / 10,
        rtol=1e-12,
        atol=1e-13,
    )
    assert found.q[:, 0] == pytest.approx(exact.y[0], abs=1e-7)
    assert found.v[:, 0] == pytest.approx(exact.y[1], abs=1e-7)


@pytest.mark.parametrize("method", METHODS)
def test_a_drive(method: str) -> None:
    """A spring hangs on a slider that is moved from one place to another."""
    text = f"""
coordinates: [x, y]
parameters: {{c: 1.3, w: 0.4}}
T: (x'^2 + y'^2)/2
V: 4*(y - x)^2
constraints: {{drive: "x = 2*{STEP.format(z="(t - c)/w")}"}}
initial: {{x: {{guess: 0}}, x': {{guess: 0}}, y: 0.1, y': 0}}
"""
    found = lagcli.simulate(lagcli.load_text(text), method=method, t_end=4.0, samples=9)
    assert found.status == "completed", found.message
    assert found.counts["steps"] < 1000
    exact = solve_ivp(
        lambda t, y: [y[1], 8 * (2 * changes((t - 1.3) / 0.4) - y[0])],
        (0, 4),
        [0.1, 0.0],
        "DOP853",
        t_eval=found.time,
        max_step=0.02,
        rtol=1e-12,
        atol=1e-13,
    )
    assert found.q[:, 1] == pytest.approx(exact.y[0], abs=1e-7)


@pytest.mark.parametrize("t_end", [1 + 1e-8, 1.0001, 1.001, 1.01, 1.1])
def test_a_run_that_ends_soon_after_the_begin(t_end: float) -> None:
    """Where exp(−1/z) is too small for a floating-point number, and where it is tiny."""
    text = """
coordinates: [x]
T: x'^2/2
Q: {x: "if(t > 1, exp(-1/(t - 1)), 0)"}
initial: {x: 0, x': 1}
"""
    found = lagcli.simulate(lagcli.load_text(text), t_end=t_end, samples=2)
    assert found.status == "completed", found.message
    assert found.counts["steps"] < 200
    assert found.q[-1, 0] == pytest.approx(t_end, abs=1e-8)


#: Functions of z = (t − c)/w and their integrals over all z.
PULSES = {
    "exp(-z^2)": math.sqrt(math.pi),
    "1/cosh(z)^2": 2.0,
    "exp(-abs(z))": 2.0,
    "(1 + z^2)^(-1.5)": 2.0,
    "1/(exp(z) + exp(-z))": math.pi / 2,
    "1/(1 + exp(-z)) - 1/(1 + exp(1 - z))": 1.0,
}


@pytest.mark.parametrize("moving", [0.0, 1.0])
@pytest.mark.parametrize("width", [1e-2, 1e-3, 1e-5])
@pytest.mark.parametrize("pulse", PULSES)
def test_a_short_pulse(pulse: str, width: float, moving: float) -> None:
    """It is seen, and the rest of the run, where its parts overflow, takes few steps."""
    rng = np.random.default_rng([*pulse.encode(), int(1 / width)])
    centre = rng.uniform(2, 8)
    force = pulse.replace("z", f"((t - {centre})/{width})")
    text = f"""
coordinates: [x]
T: x'^2/2
Q: {{x: "({force})/{width}"}}
initial: {{x: 0, x': {moving}}}
"""
    method = ("auto", "DOP853", "Taylor")[int(rng.integers(3))]
    found = lagcli.simulate(lagcli.load_text(text), method=method, t_end=10.0, samples=4)
    assert found.status == "completed", found.message
    tail = width**2 if "1.5" in pulse else 0.0  # outside the run
    assert found.v[-1, 0] - moving == pytest.approx(PULSES[pulse], abs=1e-7 + tail)
    assert found.counts["steps"] < 3000


@pytest.mark.parametrize("method", METHODS)
def test_powers_of_a_sine(method: str) -> None:
    """Between its pulses all of its low derivatives vanish."""
    n = 60
    text = f"coordinates: [x]\nT: x'^2/2\nQ: {{x: sin(t)^{n}}}\ninitial: {{x: 0, x': 0}}\n"
    found = lagcli.simulate(lagcli.load_text(text), method=method, t_end=3 * math.pi, samples=4)
    one = math.pi * math.prod((2 * k - 1) / (2 * k) for k in range(1, n // 2 + 1))
    assert found.v[:, 0] == pytest.approx([0, one, 2 * one, 3 * one], abs=1e-8)
