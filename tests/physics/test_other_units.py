"""What a run gives does not depend on how small or large the numbers are, in any method."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from random_cases import some
from scipy.integrate import solve_ivp

import lagcli
from lagcli.engine.integrate.batch import Finished, prepare_batch, run_batch, suits_batch
from lagcli.model.model import Model
from lagcli.model.reading import shipped_model
from lagcli.settings.methods import METHODS
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.simulation import prepare
from lagcli.trajectory.trajectory import Trajectory

ROOT = Path(__file__).parents[2]
FOUND = ROOT / "tests" / "found"
#: At 1e-9, eight digits.
DIGITS = 1e-8


def completed(model: Model, **options: Any) -> Trajectory:
    trajectory = lagcli.simulate(model, **options)
    assert trajectory.status == "completed", trajectory.message
    return trajectory


def difference(found: np.ndarray, expected: np.ndarray) -> float:
    """Return the largest difference by the size of each column."""
    size = np.abs(expected).max(axis=0)
    return float((np.abs(found - expected).max(axis=0) / np.where(size > 0, size, 1.0)).max())


def test_nanometres_have_as_many_digits_as_metres() -> None:
    run = completed(lagcli.load(FOUND / "mems_duffing.yaml"))
    w, a = 2 * math.pi * 1e3, 20e-9
    assert difference(run.q[:, 0], a * np.cos(w * run.time)) < DIGITS
    assert difference(run.v[:, 0], -a * w * np.sin(w * run.time)) < DIGITS


@pytest.mark.parametrize("method", ["auto", "Taylor", "Rodas5P"])
def test_small_currents_have_all_digits(method: str) -> None:
    model = lagcli.load(FOUND / "condenser_microphone.yaml")
    run = completed(model, method=method, t_end=5e-3, samples=51)
    p = model.parameter_values
    x0, q0, t0 = 1e-6, p["E"] * p["epsA"] / p["s"], 1e-3

    def rate(t: float, y: np.ndarray) -> list[float]:
        x, q, u, i = y[0] * x0, y[1] * q0, y[2] * x0 / t0, y[3] * q0 / t0
        drive = p["F"] * math.sin(p["w"] * t * t0)
        a = (drive - p["k"] * x - p["b"] * u + q * q / (2 * p["epsA"])) / p["m"]
        j = (p["E"] - (p["s"] - x) * q / p["epsA"] - p["R"] * i) / p["L"]
        return [y[2], y[3], a * t0 * t0 / x0, j * t0 * t0 / q0]

    scaled_run = solve_ivp(
        rate, (0, 5), [0, 1, 0, 0], "LSODA", run.time / t0, rtol=1e-12, atol=1e-15
    )
    scales = np.array([x0, q0, x0 / t0, q0 / t0])
    assert difference(np.hstack([run.q, run.v]) / scales, scaled_run.y.T) < DIGITS


def scaled(path: Path, length: float, mass: float, time: float) -> tuple[Model, np.ndarray]:
    """Return a model in other units, and the factors of its coordinates."""
    names = {"m": length, "cm": length, "mm": length, "kg": mass, "g": mass, "s": time}
    names |= {"rad": 1.0, "deg": 1.0, "N": mass * length / time**2, "Hz": 1 / time}
    names |= {"J": mass * length**2 / time**2, "W": mass * length**2 / time**3}

    def factor(unit: str | None) -> float:
        return float(eval(unit.replace("^", "**"), {}, names)) if unit else 1.0

    plain = lagcli.load(path)
    factors = np.array([factor(c.unit) for c in plain.coordinates])
    # those that are functions of others follow
    values = {
        n: p.value * factor(p.unit)
        for n, p in plain.parameters.items()
        if p.unit or not _computed(p.text)
    }
    text = {n: f"{x!r} {_si(plain.parameters[n].unit)}".strip() for n, x in values.items()}
    initial = {}
    for c, f in zip(plain.coordinates, factors, strict=True):
        for entry, name, more in (
            (plain.initial_positions, c.name, f),
            (plain.initial_velocities, f"{c.name}'", f / time),
        ):
            found = entry[c.name]
            value = repr(float(found.value * more))
            initial[name] = value if found.fixed else f"{{guess: {value}}}"
    return lagcli.load(path, set=text, set_initial=initial), factors


def _computed(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return True
    return False


def _si(unit: str | None) -> str:
    from lagcli.model.expression.units import si_notation

    return si_notation(unit) if unit else ""


SHIPPED = [
    "andrews_squeezer",
    "bead_on_rotating_hoop",
    "double_pendulum_cartesian",
    "four_bar",
    "heavy_top",
    "knife_edge_incline",
    "particle_on_sphere",
    "pendulum_cartesian",
    "rolling_disk",
    "slider_crank",
]
#: Powers of two: rounding differs only where the order of elimination does.
SCALES: list[Mapping[str, float]] = [
    {"length": 2.0**-20, "mass": 1.0, "time": 1.0},
    {"length": 2.0**20, "mass": 2.0**-20, "time": 2.0**20},
    {"length": 2.0**-20, "mass": 2.0**20, "time": 2.0**-20},
]


def in_other_units(name: str, factors: Mapping[str, float]) -> tuple[Trajectory, Trajectory]:
    """Run a model, and in other units; return both, the second in the units of the first."""
    path = shipped_model(name)
    plain = lagcli.load(path)
    t_end = 0.2 * (plain.settings.t_end or 10.0)
    ours = completed(plain, t_end=t_end, samples=11)
    model, of_coordinates = scaled(path, **factors)
    other = completed(model, t_end=t_end * factors["time"], samples=11)
    q, v = other.q / of_coordinates, other.v / of_coordinates * factors["time"]
    return ours, replace(other, q=q, v=v)


@pytest.mark.parametrize("factors", some(SCALES, 1), ids=["length", "larger", "smaller"])
@pytest.mark.parametrize("name", SHIPPED)
def test_a_model_in_other_units_takes_the_same_steps(
    name: str, factors: Mapping[str, float]
) -> None:
    ours, other = in_other_units(name, factors)
    assert abs(other.counts["steps"] - ours.counts["steps"]) <= 3
    assert difference(other.q, ours.q) < DIGITS
    assert difference(other.v, ours.v) < 10 * DIGITS  # velocities of these models change fast


@pytest.mark.parametrize("name", ["bead_on_rotating_hoop", "particle_on_sphere", "rolling_disk"])
def test_rounding_in_other_units_costs_little(name: str) -> None:
    """What constraints hold at rest has rounding there, below which no step is rejected."""
    ours, other = in_other_units(name, {"length": 1e-6, "mass": 1e6, "time": 1e-6})
    assert other.counts["rejected"] <= ours.counts["rejected"] + 1  # an error next to the tolerance
    assert other.counts["steps"] < ours.counts["steps"] + 10
    assert difference(other.q, ours.q) < DIGITS
    assert difference(other.v, ours.v) < DIGITS


STEP = lagcli.load_text("""
name: a load that is applied later
coordinates: [x, y]
parameters: {m: 1, k: 100, F: 2}
T: m/2*x'^2 + m/2*y'^2
V: k/2*x^2 + k/2*y^2
Q: {x: "if(t < 1, 0, F)", y: "F*sin(3*t)"}
initial: {x: 0, x': 0, y: 0, y': 0}
simulation: {t_end: 3, samples: 31}
""")


@pytest.mark.parametrize("method", METHODS)
def test_what_is_at_rest_is_driven_later(method: str) -> None:
    run = completed(STEP, method=method, max_steps=20_000, rtol=1e-7)
    late = np.clip(run.time - 1, 0, None)
    x = 0.02 * (1 - np.cos(10 * late))
    y = 2 / 91 * (np.sin(3 * run.time) - 0.3 * np.sin(10 * run.time))
    assert difference(run.q, np.column_stack([x, y])) < 1e-5


@pytest.mark.parametrize("method", METHODS)
def test_rest_stays_at_rest(method: str) -> None:
    model = lagcli.load_text("""
name: at rest
coordinates: [x, y]
parameters: {m: 1, g: 9.81, l: 1}
T: m/2*x'^2 + m/2*y'^2
V: m*g*y
constraints: {rod: x^2 + y^2 = l^2}
initial: {x: 0, x': 0, y: -1, y': 0}
""")
    run = completed(model, method=method, samples=3)
    assert run.counts["steps"] < 50
    assert np.abs(run.q - [0, -1]).max() < 1e-15


def test_a_hanging_mass_costs_little() -> None:
    """Rounding of the forces that balance is not resolved."""
    model = lagcli.load_text("""
name: hanging
coordinates: [x, z]
parameters: {m: 1, k: 100, g: 9.81, l0: 0.3}
T: m/2*x'^2 + m/2*z'^2
V: k/2*(sqrt(x^2 + z^2) - l0)^2 - m*g*x
initial: {x: 0.3981, x': 0, z: 0, z': 0}
""")
    assert completed(model, samples=3).counts["steps"] < 500


def test_a_run_in_lanes_has_its_own_sizes() -> None:
    """Amplitudes of 1 and of 1e-9, side by side, each with all its digits."""
    model = lagcli.load_text("""
name: oscillator
coordinates: [x]
parameters: {w: 3}
T: x'^2/2
V: w^2*x^2/2
initial: {x: 1, x': 0}
""")
    simulation = prepare(model, SettingsOverrides(t_end=5, samples=11))
    request = simulation.request
    request = request._replace(prepared=prepare_batch(simulation.system, request))
    assert suits_batch(simulation.system, request)
    sizes = np.array([1.0, 1e-9, 1e6, 1e-3, 1.0, 1e-9, 1e3, 1e-12, 5.0, 1e-7])
    found: dict[int, tuple[np.ndarray, int]] = {}

    def take(finished: Finished) -> None:
        for row, samples, run in zip(*finished, strict=True):
            found[int(row)] = samples, run.steps

    run_batch(
        simulation.system,
        request,
        np.full((10, 1), 3.0),
        sizes[:, None],
        np.zeros((10, 1)),
        take,
    )
    for row, size in enumerate(sizes):
        samples, steps = found[row]
        assert difference(samples[:, 1], size * np.cos(3 * samples[:, 0])) < DIGITS
        assert abs(steps - found[0][1]) <= 2


def test_given_tolerances_stay_what_they_are() -> None:
    model = lagcli.load(FOUND / "mems_duffing.yaml")
    assert set(completed(model, atol=1e-12).tolerances.values()) == {1e-12}
    text = model.text.replace("t_end: 20 ms", "t_end: 20 ms, atol: {x: 1 pm}")
    found = completed(lagcli.load_text(text)).tolerances
    assert found["x"] == 1e-12
    # 0.1 rtol times the largest velocity
    assert found["x'"] == pytest.approx(1e-10 * 20e-9 * 2 * math.pi * 1e3, rel=1e-3)


@pytest.mark.parametrize(("length", "time"), [(1e6, 1e12), (1.0, 1e10), (1e-9, 1e-6)])
def test_bouncing_ball_in_other_units(length: float, time: float) -> None:
    """The number of impacts and the time of rest, t1 (1 + e)/(1 − e), do not depend on units."""
    text = """
coordinates: [y]
parameters: {{m: 2, g: {g!r}, e: 0.8, h: {h!r}}}
T: m/2*y'^2
V: m*g*y
constraints: {{floor: {{expr: y >= 0, restitution: e}}}}
initial: {{y: h, y': 0}}
"""
    model = lagcli.load_text(text.format(g=9.81 * length / time**2, h=length))
    found = lagcli.simulate(model, t_end=5 * time, samples=11)
    assert found.events is not None
    assert found.events.kinds == ("impact",) * 47 + ("rest",)
    assert found.events.time[-1] / time == pytest.approx(9 * (2 / 9.81) ** 0.5, rel=1e-9)
