"""Motions driven by tables, against closed forms and SciPy's splines."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import lagcli
from lagcli.settings.methods import METHODS

K, M = 90.0, 2.5
OMEGA = math.sqrt(K / M)
KNOTS = [0.0, 0.3, 0.75, 1.0, 1.6, 2.0]
FORCES = [0.0, 40.0, -25.0, -25.0, 10.0, 0.0]
OSCILLATOR = f"""
coordinates: {{y: m}}
parameters: {{m: {M} kg, k: {K} N/m}}
inputs:
  pull: {{times: {KNOTS}, values: {FORCES}, unit: N, interpolation: KIND}}
T: m/2*y'^2
V: k/2*y^2
Q: {{y: pull}}
initial: {{y: 0.1, y': -1}}
outputs: {{force: pull}}
simulation: {{t_end: 2, rtol: 1e-12}}
"""


def oscillation(t: np.ndarray, slopes: list[float]) -> np.ndarray:
    """Return y of m ÿ + k y = F, F linear between the knots, piece by piece."""
    found = np.empty(len(t))
    y, v = 0.1, -1.0
    for i, (begin, end) in enumerate(pairwise(KNOTS)):
        slope, force = slopes[i], FORCES[i]

        def moved(
            s: np.ndarray | float, y: float = y, v: float = v, f: float = force, b: float = slope
        ) -> tuple[np.ndarray | float, np.ndarray | float]:
            c, d = y - f / K, (v - b / K) / OMEGA
            cos, sin = np.cos(OMEGA * s), np.sin(OMEGA * s)
            return c * cos + d * sin + (f + b * s) / K, OMEGA * (d * cos - c * sin) + b / K

        mine = (t >= begin) & (t <= end)
        found[mine] = moved(t[mine] - begin)[0]
        y, v = (float(x) for x in moved(end - begin))
    return found


def rises() -> list[float]:
    return (np.diff(FORCES) / np.diff(KNOTS)).tolist()


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("kind", "slopes"), [("linear", rises), ("step", lambda: [0.0] * 5)], ids=["linear", "step"]
)
def test_a_driven_oscillator(method: str, kind: str, slopes: Callable[[], list[float]]) -> None:
    """Kinks and jumps of the force cost no accuracy: the steps end there."""
    # implicit methods of order 5 need far more steps for the last digits
    rtol = 1e-12 if method in ("DOP853", "Taylor") else 1e-9
    model = lagcli.load_text(OSCILLATOR.replace("KIND", kind))
    run = lagcli.simulate(model, method=method, rtol=rtol, samples=201)
    assert run.status == "completed", run.message
    expected = oscillation(run.time, slopes())
    bound = 1e-9 if rtol == 1e-12 else 1e-7
    np.testing.assert_allclose(run.q[:, 0], expected, rtol=0, atol=bound * 0.5)
    scale = np.abs(run.energy_total).max()
    assert np.abs(run.energy_balance).max() < bound * scale
    # at a knot, forces and accelerations are those of what follows
    assert np.abs(run.residual_equation).max() < 1e-13
    force = np.array(FORCES)[np.searchsorted(KNOTS, run.time, side="right") - 1]
    if kind == "step":
        np.testing.assert_array_equal(run.outputs["force"], force)


@pytest.mark.parametrize("method", ["DOP853", "Taylor", "Rodas5P", "Radau"])
def test_the_error_follows_the_tolerance(method: str) -> None:
    """By a factor of 10³ in rtol it falls at least by 10²: the knots do not limit the order."""
    errors = []
    for rtol in (1e-4, 1e-7, 1e-10):
        model = lagcli.load_text(OSCILLATOR.replace("KIND", "linear"))
        run = lagcli.simulate(model, method=method, rtol=rtol, samples=101)
        errors.append(np.abs(run.q[:, 0] - oscillation(run.time, rises())).max())
    assert errors[0] > 1e-8
    assert errors[1] < 1e-2 * errors[0]
    assert errors[2] < 1e-2 * errors[1]
    assert errors[2] < 1e-8


ROAD = (np.linspace(0.0, 4.0, 21), 0.05 * np.sin(np.linspace(0.0, 4.0, 21) ** 2))
WHEEL = """
coordinates: {x: m, y: m}
parameters: {m: 3 kg, g: 9.81 m/s^2, a: 1.5}
inputs:
  road: {times: TIMES, values: VALUES, unit: m, interpolation: cubic, extend: EXTEND}
definitions: {height: a*road}
T: m/2*(x'^2 + y'^2)
V: m*g*y
constraints: {ground: y = height + x/10}
initial: {x: 0, x': 1, y: {guess: 0}, y': {guess: 0}}
outputs: {rate: height', bend: road''}
simulation: {t_end: 4, samples: 161, rtol: 1e-12}
"""


@pytest.mark.parametrize(("extend", "ends"), [("null", "not-a-knot"), ("hold", "clamped")])
def test_the_force_of_a_moving_constraint(extend: str, ends: str) -> None:
    """λ = m (g + a ü)/1.01 and ẍ = −(g + a ü)/10.1, with ü of SciPy's spline."""
    times, values = ROAD
    text = WHEEL.replace("TIMES", str(times.tolist())).replace("VALUES", str(values.tolist()))
    text = text.replace(", extend: EXTEND", "" if extend == "null" else f", extend: {extend}")
    run = lagcli.simulate(lagcli.load_text(text))
    spline = CubicSpline(times, values, bc_type=ends)
    t = run.time[:-1]  # at the end, a spline that is held has no curvature any more
    acceleration = 9.81 + 1.5 * spline(t, 2)
    np.testing.assert_allclose(run.multipliers[:-1, 0], 3 * acceleration / 1.01, rtol=1e-10)
    np.testing.assert_allclose(run.outputs["rate"][:-1], 1.5 * spline(t, 1), rtol=0, atol=1e-12)
    np.testing.assert_allclose(run.outputs["bend"][:-1], spline(t, 2), rtol=0, atol=1e-11)
    np.testing.assert_allclose(
        run.q[:, 1], 1.5 * spline(run.time) + run.q[:, 0] / 10, rtol=0, atol=1e-13
    )
    # x by two integrals of the spline, which are exact
    x = t - (9.81 * t**2 / 2 + 1.5 * (spline(t) - spline(0) - spline(0, 1) * t)) / 10.1
    np.testing.assert_allclose(run.q[:-1, 0], x, rtol=0, atol=1e-9)


def test_a_periodic_force_over_many_periods() -> None:
    """A square wave of period 0.2 s on a free mass: x by exact sums."""
    text = """
coordinates: [x]
inputs:
  wave: {times: [0, 0.1, 0.2], values: [1, -1, 1], interpolation: step, extend: periodic}
T: x'^2/2
Q: {x: wave}
initial: {x: 0, x': 0}
simulation: {t_end: 100, samples: 501}
"""
    run = lagcli.simulate(lagcli.load_text(text))
    # each period adds 0.01 to x, and its velocity is zero again at the end
    whole = np.arange(len(run.time)) % 1 == 0
    np.testing.assert_allclose(run.q[whole, 0], run.time[whole] / 0.2 * 0.01, rtol=0, atol=1e-10)
    assert run.counts["steps"] >= 999


def test_the_road_of_the_shipped_car_is_the_documented_one() -> None:
    """The rows of car_on_road.csv are the formula in car_on_road.yaml, to their 0.1 mm."""

    def height(s: np.ndarray) -> np.ndarray:
        hump = np.where((s > 5) & (s < 11), 55 * (1 - np.cos(2 * np.pi * (s - 5) / 6)), 0)
        waves = 3 * np.sin(2 * np.pi * s / 7) + 2 * np.sin(2 * np.pi * s / 2.9)
        return (hump + np.clip(s / 3, 0, 1) ** 2 * waves) / 1000

    data = lagcli.load("car_on_road").data
    for name, behind in (("u_f", 0.0), ("u_r", 2.6)):
        s = 10 * np.array(data[name].times) - behind
        np.testing.assert_allclose(data[name].values, height(s), rtol=0, atol=5.1e-5)


def test_derivatives_with_respect_to_parameters() -> None:
    """∂y/∂k of the driven oscillator, against central differences of the closed form."""
    model = lagcli.load_text(OSCILLATOR.replace("KIND", "linear"))
    run = lagcli.simulate(model, sensitivity="k", samples=41)
    around = []
    for k in (K * (1 - 1e-5), K * (1 + 1e-5)):
        changed = lagcli.load_text(OSCILLATOR.replace("KIND", "linear"), set={"k": f"{k!r} N/m"})
        around.append(lagcli.simulate(changed, samples=41).q[:, 0])
    slope = (around[1] - around[0]) / (2e-5 * K)
    assert run.dq is not None
    np.testing.assert_allclose(run.dq[:, 0, 0], slope, rtol=0, atol=1e-6 * np.abs(slope).max())


@pytest.mark.parametrize("method", METHODS)
def test_a_road_under_a_spring_balances_its_energy(method: str) -> None:
    """V depends on a linear input: the power of its motion is counted on either side of a kink."""
    text = OSCILLATOR.replace("KIND", "linear").replace("k/2*y^2", "k/2*(y - c*pull)^2")
    text = text.replace("parameters: {", "parameters: {c: 2 mm/N, ")
    run = lagcli.simulate(lagcli.load_text(text), method=method, rtol=1e-9)
    assert run.status == "completed"
    assert np.abs(run.energy_balance).max() < 1e-7 * np.abs(run.energy_total).max()


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("ulps", [1, 4, 20])
def test_a_run_that_ends_within_rounding_of_a_knot(method: str, ulps: int) -> None:
    """What is left beyond the knot is one step, with functions of time that limit steps, too."""
    model = lagcli.load_text("""
coordinates: [x]
inputs: {u: {times: [0, 0.5, 1, 2], values: [1, 3, -2, 0], interpolation: step}}
T: x'^2/2
Q: {x: "u + sign(sin(2*pi*t/0.8))"}
initial: {x: 0, x': 0}
""")
    run = lagcli.simulate(model, method=method, t_end=1.0 + ulps * math.ulp(1.0), samples=2)
    assert run.status == "completed", run.message
    # the force is 2 to 0.4 s, 0 to 0.5 s, 2 to 0.8 s, 4 to 1 s
    assert run.v[-1, 0] == pytest.approx(2 * 0.4 + 2 * 0.3 + 4 * 0.2, abs=1e-9)


@pytest.mark.parametrize(
    ("force", "end"),
    [
        ("cbrt(t)", 9 / 28 * 2 ** (7 / 3)),
        ("if(t < 1, sqrt(1 - t), 0)", 2 / 3 + 2 / 5),
        ("if(t < 1, (1 - t)^1.5, 0)", 2 / 5 + 2 / 7),
        ("max(0, t - 1)^1.5", 4 / 35),
        ("sqrt(max(0, t - 1))", 4 / 15),
        ("if(t > 1, acosh(t), 0)", 9 / 4 * math.acosh(2) - 1.5 * math.sqrt(3)),
    ],
)
def test_functions_without_a_value_in_another_branch_do_not_limit_steps(
    force: str, end: float
) -> None:
    model = lagcli.load_text(
        f"""
coordinates: [x]
T: x'^2/2
V: 0
Q: {{x: "{force}"}}
initial: {{x: 0, x': 0}}
simulation: {{t_end: 2, samples: 3, max_steps: 200}}
"""
    )
    run = lagcli.simulate(model)
    assert run.status == "completed", run.message
    assert run.q[-1, 0] == pytest.approx(end, rel=1e-8)


@pytest.mark.parametrize(
    ("method", "rtol", "x", "y", "places"),
    [
        (
            "Rodas5P",
            1e-9,
            "0.2*(1 - cos(3.4*t))",
            "0.2*sin(3.4*t)^3",
            lambda t: (0.2 * (1 - math.cos(3.4 * t)), 0.2 * math.sin(3.4 * t) ** 3),
        ),
        (
            "DOP853",
            1e-11,
            "0.29*(1 - cos(6.1*t))",
            "0.29*sin(6.1*t)^2",
            lambda t: (0.29 * (1 - math.cos(6.1 * t)), 0.29 * math.sin(6.1 * t) ** 2),
        ),
        (
            "Rodas5P",
            1e-9,
            "0.23*t^2",
            "0.23*(1 - cos(4.2*t))",
            lambda t: (0.23 * t**2, 0.23 * (1 - math.cos(4.2 * t))),
        ),
        (
            "Rodas5P",
            1e-11,
            "0.5*t^4",
            "0.5*(exp(-7.5*t) - 1 + 7.5*t)",
            lambda t: (0.5 * t**4, 0.5 * (math.exp(-7.5 * t) - 1 + 7.5 * t)),
        ),
    ],
)
def test_supports_that_start_softly_do_not_jump(
    method: str, rtol: float, x: str, y: str, places: Callable[[float], tuple[float, float]]
) -> None:
    """In 1 - cos, terms cancel: its error is large beside positions just after the start."""
    model = lagcli.load_text(
        "coordinates: [x, y, z]\nT: (x'^2 + y'^2 + z'^2)/2\nV: 60*(z - x)^2 + 20*(y - z)^2\n"
        f'constraints: {{a: "x = {x}", b: "y = {y}"}}\n'
        "initial: {x: {guess: 0}, x': {guess: 0}, y: {guess: 0}, y': {guess: 0}, z: 0, z': 0}\n"
    )
    run = lagcli.simulate(model, t_end=1, samples=5, rtol=rtol, method=method)
    assert run.status == "completed", run.message

    def rates(t: float, state: np.ndarray) -> list[float]:
        x_t, y_t = places(t)
        return [state[1], 120 * (x_t - state[0]) + 40 * (y_t - state[0])]

    expected = solve_ivp(rates, (0, 1), [0, 0], "DOP853", run.time, rtol=1e-11, atol=1e-13)
    assert run.q[:, 2] == pytest.approx(expected.y[0], abs=1e-8)
