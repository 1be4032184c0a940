"""Coordinates that symmetry keeps at rest up to rounding; motions that are tiny beside others."""

from __future__ import annotations

import math
import random
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lagcli
from lagcli.arrays import Array
from lagcli.engine.integrate.batch import Finished, prepare_batch, run_batch, suits_batch
from lagcli.model.model import Model
from lagcli.model.reading import shipped_model
from lagcli.settings.methods import METHODS
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.simulation import prepare
from lagcli.trajectory.trajectory import Trajectory

FOUND = Path(__file__).parents[1] / "found"
#: At rtol 1e-9, with the errors of some hundred steps.
DIGITS = 3e-8
#: What rounding errors may add up to, of a motion of size one.
ROUNDING = 1e-12


def completed(model: Model, **options: object) -> Trajectory:
    run = lagcli.simulate(model, max_steps=30_000, **options)  # type: ignore[arg-type]
    assert run.status == "completed", run.message
    return run


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", ["noise_pitch", "noise_pitch_nounits"])
def test_a_balanced_beam_does_not_pitch(name: str, method: str) -> None:
    run = completed(lagcli.load(FOUND / f"{name}.yaml"), method=method)
    np.testing.assert_allclose(run.q[:, 0], np.sin(2 * run.time) / 2, rtol=0, atol=DIGITS)
    assert np.abs(run.q[:, 1]).max() < ROUNDING
    assert run.counts["steps"] < (150 if method in ("auto", "DOP853", "Taylor") else 3000)


CARS = [
    (1.2, 1.3, 25000),
    (1.4, 1.3, 21000),
    (1.1, 1.6, 26000),
    (1.1, 1.7, 26000),
    (1.2, 1.5, 26000),
]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("front", "rear", "stiffness"), CARS)
def test_a_balanced_car_does_not_pitch(
    front: float, rear: float, stiffness: float, method: str
) -> None:
    values = {"lf": f"{front} m", "lr": f"{rear} m", "kf": f"{stiffness} N/m", "kr": "kf*lf/lr"}
    model = lagcli.load(FOUND / "half_car.yaml", set={**values, "cf": "0", "cr": "0"})
    run = completed(model, method=method)
    k = stiffness * (1 + front / rear)
    expected = 0.05 * np.cos(math.sqrt(k / 1200) * run.time)
    np.testing.assert_allclose(run.q[:, 0], expected, rtol=0, atol=0.05 * DIGITS)
    assert np.abs(run.q[:, 1]).max() < ROUNDING
    disturbed = completed(
        lagcli.load(
            FOUND / "half_car.yaml",
            set={**values, "cf": "0", "cr": "0"},
            set_initial={"th": "1e-6"},
        ),
        method=method,
    )
    assert run.counts["steps"] <= 2 * disturbed.counts["steps"]


@pytest.mark.parametrize(
    ("front", "rear", "stiffness", "height"),
    [(1.4, 1.3, 21000, 0.02), (1.1, 1.5, 26000, -0.1), (1.2, 1.7, 26000, 0.03)],
)
def test_a_balanced_car_with_large_angles_does_not_pitch(
    front: float, rear: float, stiffness: float, height: float
) -> None:
    values = {"lf": f"{front} m", "lr": f"{rear} m", "kf": f"{stiffness} N/m"}
    run = completed(lagcli.load(FOUND / "nl.yaml", set=values, set_initial={"y": f"{height} m"}))
    k = stiffness * (1 + front / rear)
    rest = -1200 * 9.81 / k
    expected = rest + (height - rest) * np.cos(math.sqrt(k / 1200) * run.time)
    np.testing.assert_allclose(run.q[:, 0], expected, rtol=0, atol=DIGITS)
    assert run.counts["steps"] < 200


@pytest.mark.parametrize(("name", "steps"), [("noise_motor", 100), ("induction_motor", 5000)])
def test_motors_start(name: str, steps: int) -> None:
    """As many steps as with another angle at the start, with the same motion."""
    path = FOUND / f"{name}.yaml"
    run = completed(lagcli.load(path), method="DOP853")
    turned = completed(lagcli.load(path, set_initial={"th": "1e-6"}), method="DOP853")
    assert run.counts["steps"] <= min(steps, 2 * turned.counts["steps"])
    np.testing.assert_allclose(run.q[-1, -1], turned.q[-1, -1] - 1e-6, rtol=DIGITS)


@pytest.mark.parametrize(
    ("name", "t_end"), [("toggle", 2.0), ("toggle_m", 2.0), ("atol_block", 0.2)]
)
def test_tolerances_are_smaller_than_the_motion(name: str, t_end: float) -> None:
    run = completed(lagcli.load(FOUND / f"{name}.yaml"), t_end=t_end)
    sizes = dict(zip(run.coordinates, np.abs(run.q).max(axis=0), strict=True))
    sizes |= {f"{c}'": v for c, v in zip(run.coordinates, np.abs(run.v).max(axis=0), strict=True)}
    for entry, tolerance in run.tolerances.items():
        assert tolerance < max(1e-6 * sizes[entry], 1e-12), (entry, tolerance)


MACHINE = """
coordinates: {{y: m, th: rad}}
parameters: {{m: {m} kg, J: {J} kg*m^2, k1: {k} N/m, a1: {a} m, a2: {b} m, k2: k1*a1/a2}}
T: m/2*y'^2 + J/2*th'^2
V: k1/2*(y + a1*{s})^2 + k2/2*(y - a2*{s})^2
initial: {{y: 0, th: 0, y': {v}, th': 0}}
simulation: {{t_end: 10, samples: 51}}
"""


def table(seed: int) -> tuple[Model, float, float]:
    """Return a table on two balanced springs, its rate and its speed at the start."""
    r = random.Random(seed)
    a, b, k = (round(r.uniform(*x), 2) for x in ((0.05, 0.4), (0.05, 0.4), (1, 9)))
    m, inertia, v = (round(r.uniform(*x), 2) for x in ((0.5, 3), (0.01, 0.2), (0.5, 2)))
    s = r.choice(["th", "sin(th)"])
    text = MACHINE.format(m=m, J=inertia, k=k, a=a, b=b, v=v, s=s)
    return lagcli.load_text(text), math.sqrt(k * (1 + a / b) / m), v


@pytest.mark.parametrize("seed", range(20))
def test_random_tables_do_not_turn(seed: int) -> None:
    model, rate, v = table(seed)
    run = completed(model)
    np.testing.assert_allclose(
        run.q[:, 0], v / rate * np.sin(rate * run.time), rtol=0, atol=v / rate * DIGITS
    )
    assert np.abs(run.q[:, 1]).max() < ROUNDING
    assert run.counts["steps"] < 60 * rate


def test_lanes_do_not_turn_either() -> None:
    model, rate, v = table(3)
    simulation = prepare(model, SettingsOverrides())
    request = simulation.request
    request = request._replace(prepared=prepare_batch(simulation.system, request))
    assert suits_batch(simulation.system, request)
    found = {}

    def take(finished: Finished) -> None:
        for row, samples, run in zip(*finished, strict=True):
            found[int(row)] = samples, run.steps

    speeds = v * (1 + 0.01 * np.arange(10))
    velocities = np.column_stack([speeds, np.zeros(10)])
    run_batch(
        simulation.system,
        request,
        np.tile(request.state.p, (10, 1)),
        np.zeros((10, 2)),
        velocities,
        take,
    )
    for row, speed in enumerate(speeds):
        samples, steps = found[row]
        expected = speed / rate * np.sin(rate * samples[:, 0])
        np.testing.assert_allclose(samples[:, 1], expected, rtol=0, atol=speed / rate * DIGITS)
        assert np.abs(samples[:, 2]).max() < ROUNDING
        assert steps < 60 * rate


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("size", [1e-6, 1e-9, 1e-12])
def test_tiny_motions_beside_large_ones_have_all_digits(size: float, method: str) -> None:
    """What has the same unit says nothing of the size of a motion."""
    model = lagcli.load_text(f"""
coordinates: {{a: rad, th: rad, up: rad, x: m, z: m}}
T: (a'^2 + th'^2 + up'^2 + x'^2 + z'^2)/2
V: -1000*a - 9.61*cos(th) - up^2/2 + x^2/2 + 9.61*z^2/2
initial: {{a: 0, a': 0, th: {size}, th': 0, up: {size}, up': 0, x: 1e6, x': 0, z: {size}, z': 0}}
simulation: {{t_end: 5, samples: 51}}
""")
    run = completed(model, method=method)
    swing = np.cos(3.1 * run.time)
    for column, expected in ((1, swing), (2, np.cosh(run.time)), (4, swing)):
        np.testing.assert_allclose(
            run.q[:, column] / size, expected, rtol=0, atol=DIGITS * np.abs(expected).max()
        )


def test_what_a_chain_passes_on_needs_no_digits_at_first() -> None:
    """The last body begins as t^16: a relative error of it does not fall with the step."""
    names = [f"x{i}" for i in range(8)]
    springs = "+".join(f"({a}-{b})^2/2" for a, b in pairwise(names))
    start = ", ".join(f"{x}: 0, {x}': {int(x == 'x0')}" for x in names)
    model = lagcli.load_text(f"""
coordinates: [{", ".join(names)}, th]
T: {" + ".join(f"{x}'^2/2" for x in names)} + th'^2/2
V: {springs} + ({names[-1]} - th)^2/2
initial: {{{start}, th: 0, th': 0}}
simulation: {{t_end: 20, samples: 21}}
""")
    run = completed(model, method="DOP853")
    assert run.counts["steps"] < 250
    stiffness = 2 * np.eye(9) - np.eye(9, k=1) - np.eye(9, k=-1)
    stiffness[0, 0] = stiffness[-1, -1] = 1
    squares, modes = np.linalg.eigh(stiffness)
    rates = np.sqrt(np.abs(squares))
    parts = np.array([np.sin(w * run.time) / w if w > 1e-6 else run.time for w in rates])
    expected = (modes @ (modes[0][:, None] * parts)).T
    np.testing.assert_allclose(run.q, expected, rtol=0, atol=DIGITS * np.abs(expected).max())


@pytest.mark.parametrize("method", METHODS)
def test_what_balances_beside_what_moves_stays_at_rest(method: str) -> None:
    run = completed(lagcli.load(FOUND / "spin_pend.yaml"), method=method)
    np.testing.assert_allclose(run.q[:, 0], np.sin(2 * run.time) / 2, rtol=0, atol=DIGITS)
    np.testing.assert_allclose(run.q[:, 2], run.time, rtol=0, atol=DIGITS * run.time[-1])
    assert np.abs(run.q[:, 1]).max() < ROUNDING


@pytest.mark.parametrize("method", METHODS)
def test_a_cart_with_symmetric_pendulums_stays_at_rest(method: str) -> None:
    run = completed(lagcli.load(FOUND / "sym_pend.yaml"), method=method)
    swing = solve_ivp(
        lambda t, y: (y[1], -9.81 / 0.7 * math.sin(y[0])),
        (0, 5), (0.5, 0), "DOP853", run.time, rtol=1e-12, atol=1e-14,
    ).y[0]  # fmt: skip
    np.testing.assert_allclose(run.q[:, 1], swing, rtol=0, atol=DIGITS)
    np.testing.assert_allclose(run.q[:, 2], -swing, rtol=0, atol=DIGITS)
    assert np.abs(run.q[:, 0]).max() < ROUNDING


@pytest.mark.parametrize("method", ["DOP853", "Radau", "auto"])
@pytest.mark.parametrize("stiffness", [1e6, 1e7])
def test_stiff_springs_feel_the_rounding_of_positions(stiffness: float, method: str) -> None:
    """Masses in a row fall, and their springs pull along it. A position of 1 m is known to 1e-16 m,
    with which the stiffest springs change the velocities by more than these have been so far."""
    n = 20
    spring = "sqrt((x[i] - x[i-1])^2 + (y[i] - y[i-1])^2) - 0.1"
    model = lagcli.load_text(f"""
parameters: {{N: {n}, k: {stiffness}}}
coordinates: {{"x[1..N]": , "y[1..N]": }}
definitions: {{"x[0]": 0, "y[0]": 0}}
T: sum(x[i]'^2 + y[i]'^2, i = 1..N)/2
V: sum(9.81*y[i] + k/2*({spring})^2, i = 1..N)
initial: {{"x[i = 1..N]": 0.1*i, "x[1..N]'": 0, "y[1..N]": 0, "y[1..N]'": 0}}
simulation: {{t_end: 0.02, samples: 3}}
""")
    run = completed(model, method=method)
    assert run.counts["steps"] < 3000

    def rates(t: float, state: Array) -> Array:
        """The rates of positions and of velocities, as complex numbers."""
        z, v = state.reshape(2, n)
        arms = np.diff(z, prepend=0)
        pull = stiffness * (np.abs(arms) - 0.1) * arms / np.abs(arms)
        return np.concatenate([v, np.append(pull[1:], 0) - pull - 9.81j])

    start = np.zeros(2 * n, dtype=complex)
    start[:n] = 0.1 * np.arange(1, n + 1)
    exact = solve_ivp(rates, (0, 0.02), start, "DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
    for found, expected in ((run.q[-1], exact[:n]), (run.v[-1], exact[n:])):
        scale = np.abs(expected).max()
        np.testing.assert_allclose(
            found, [*expected.real, *expected.imag], rtol=0, atol=DIGITS * scale
        )


def test_a_stopped_run_names_what_limits_its_steps() -> None:
    model = lagcli.load(shipped_model("four_bar"))
    run = lagcli.simulate(model, method="DOP853", max_steps=300)
    assert run.status == "failed"
    assert "--max-steps allows more; the error of `theta_" in run.message
    assert "whose absolute tolerance is " in run.message


def test_a_run_that_diverges_says_so() -> None:
    model = lagcli.load_text("""
coordinates: [x]
T: x'^2/2
V: -x^4
initial: {x: 1, x': 0}
simulation: {t_end: 5, samples: 11}
""")
    run = lagcli.simulate(model)
    assert run.status == "failed"
    assert "it seems to grow beyond all bounds in a finite time" in run.message
    # x'^2 = 2 (x^4 - 1): the time to infinity is that of Gamma(1/4)^2/(4 sqrt(pi)) by sqrt(2)
    assert run.time[-1] < math.gamma(0.25) ** 2 / (4 * math.sqrt(math.pi)) / math.sqrt(2) + 1e-6
