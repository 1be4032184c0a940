"""Stiff methods against closed forms, SciPy's Radau at tight tolerance, and DOP853."""

from __future__ import annotations

import math
import subprocess
import sys
import time
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from growth import assert_growth
from oracle import Motion, motion
from scipy.linalg import expm
from shipped import PATHS, every_model

import lagcli
from lagcli.errors import UsageError
from lagcli.model.model import Model
from lagcli.trajectory.trajectory import Trajectory

MODELS = sorted((Path(__file__).parents[2] / "models").glob("*.yaml"))
STIFF = ("Rodas5P", "Radau")


def completed(model: Model, **options: Any) -> Trajectory:
    trajectory = lagcli.simulate(model, **options)
    assert trajectory.status == "completed", trajectory.message
    return trajectory


def chain(n: int, k: float = 1e6, c: float = 1e3, hanging: bool = False) -> Model:
    """Return masses joined by rods and, every second, by a stiff spring and damper."""
    names, terms, springs, dampers, rods, initial = [], [], [], [], [], []
    for i in range(n):
        x, y = f"x{i}", f"y{i}"
        names += [x, y]
        terms.append(f"{x}'^2 + {y}'^2")
        dx, dy = (f"({x} - x{i - 1})", f"({y} - y{i - 1})") if i else (x, y)
        vx, vy = (f"({x}' - x{i - 1}')", f"({y}' - y{i - 1}')") if i else (f"{x}'", f"{y}'")
        if i % 2:
            springs.append(f"(sqrt({dx}^2 + {dy}^2) - 1)^2")
            dampers.append(f"({dx}*{vx} + {dy}*{vy})^2/({dx}^2 + {dy}^2)")
        else:
            rods.append(f"  r{i}: {dx}^2 + {dy}^2 = 1")
        at = (0, -i - 1) if hanging else (i + 1, 0)
        initial.append(f"{x}: {at[0]}, {y}: {at[1]}, {x}': 0, {y}': 0")
    newline = "\n"
    return lagcli.load_text(f"""
coordinates: [{", ".join(names)}]
T: ({" + ".join(terms)})/2
V: 9.81*({" + ".join(f"y{i}" for i in range(n))}) + {k}/2*({" + ".join(springs)})
D: {c}/2*({" + ".join(dampers)})
constraints:
{newline.join(rods)}
initial: {{{", ".join(initial)}}}
""")


SLIDER = lagcli.load_text("""
name: crank and slider, which drives a mass by a stiff spring and damper
coordinates: [theta, phi, x, s]
T: 0.36*theta'^2/2 + 0.755*x'^2/2 + s'^2/2 + phi'^2/4
V: 1e6/2*(s - x)^2 + 0.981*sin(theta)
D: 1e3/2*(s' - x')^2
constraints:
  along: cos(theta) + 2*cos(phi) = x
  across: sin(theta) = 2*sin(phi)
initial:
  theta: 0.5
  phi: {guess: 0.24}
  x: {guess: 2.8}
  s: 2.8202
  theta': 6
  phi': {guess: 0}
  x': {guess: 0}
  s': -3
""")


# order


WIRE = lagcli.load_text("""
name: bead on a wire that turns
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 0
constraints: {wire: x*sin(t) = y*cos(t)}
initial: {x: 1, y: 0, x': 0, y': 1}
""")
#: Linear, so that Newton's iteration has no error.
DRIVEN = lagcli.load_text("""
name: two oscillators at a prescribed distance
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 2*x^2 + 2*y^2
constraints: {distance: x - y = sin(t)}
initial: {x: 0.5, y: 0.5, x': 0.5, y': -0.5}
""")


def solution(model: Model, t: float) -> list[float]:
    if model is WIRE:
        return [math.cosh(t) * math.cos(t), math.cosh(t) * math.sin(t)]
    return [(math.cos(2 * t) + sign * math.sin(t)) / 2 for sign in (1, -1)]


def error(model: Model, method: str, h: float, time: float) -> float:
    times = (time,) if time == 1.0 else (time, 1.0)
    # the tolerance leaves the size of the steps to h
    trajectory = completed(model, method=method, rtol=0.01, atol=0.01, max_step=h, times=times)
    return float(np.abs(trajectory.q[0] - solution(model, time)).max())


@pytest.mark.parametrize("inside", [0.0, 0.37])
@pytest.mark.parametrize(
    ("model", "method"), [(WIRE, "Rodas5P"), (DRIVEN, "Rodas5P"), (DRIVEN, "Radau")]
)
def test_order_on_a_moving_constraint(model: Model, method: str, inside: float) -> None:
    # small enough that the first step is not shorter, large enough for errors above rounding
    fine = model is not DRIVEN or method == "Radau"
    sizes = (0.05, 0.025, 0.0125) if fine else (0.1, 0.05, 0.025)
    found = [error(model, method, h, 1 - inside * h) for h in sizes]
    orders = np.diff(np.log(found)) / np.diff(np.log(sizes))
    assert orders[-1] > 5 - 0.4, (found, orders)


# closed forms


@pytest.mark.parametrize("method", [*STIFF, "auto"])
@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8])
def test_overdamped_oscillator(method: str, rtol: float) -> None:
    k, c = 1e6, 2e4
    model = lagcli.load_text(f"""
coordinates: [x]
T: x'^2/2
V: {k}/2*x^2
D: {c}/2*x'^2
initial: {{x: 1, x': 0}}
""")
    trajectory = completed(model, method=method, t_end=0.1, samples=21, rtol=rtol, atol=rtol)
    root = math.sqrt(c * c / 4 - k)
    slow, fast = -k / (c / 2 + root), -c / 2 - root
    t = trajectory.time
    x = (fast * np.exp(slow * t) - slow * np.exp(fast * t)) / (fast - slow)
    np.testing.assert_allclose(trajectory.q[:, 0], x, rtol=0, atol=10 * rtol)
    # an explicit method needs h < 6.1/|fast|: three hundred steps and more
    if rtol > 1e-8 and method != "auto":
        assert trajectory.counts["steps"] < 200
    # energy and work balance, dissipation included
    assert np.abs(trajectory.energy_balance - trajectory.energy_balance[0]).max() <= 20 * rtol * k


@pytest.mark.parametrize("seed", range(6))
def test_samples_between_radaus_steps(seed: int) -> None:
    """Two masses on a stiff spring and damper, driven: the exponential of the linear system."""
    rng = np.random.default_rng(seed)
    k, c = 10 ** rng.uniform(1, 6), 10 ** rng.uniform(2, 5)
    masses, frequency, rtol = rng.uniform(0.5, 2, 2), rng.uniform(1, 8), 10 ** rng.uniform(-10, -6)
    model = lagcli.load_text(f"""
coordinates: [x, y]
T: {masses[0]}*x'^2/2 + {masses[1]}*y'^2/2
V: {k}/2*(x - y)^2 + 5*x^2 + 2*y^2
D: {c}/2*(x' - y')^2
Q: {{x: "3*sin({frequency}*t)"}}
initial: {{x: 1, y: 1, x': 0, y': 0}}
""")
    trajectory = completed(model, method="Radau", t_end=2, samples=101, rtol=rtol, atol=rtol)
    couple = np.array([[1, -1], [-1, 1]])
    system = np.zeros((6, 6))  # of x, y, x', y', sin and cos
    system[:2, 2:4] = np.eye(2)
    system[2:4, :2] = -(k * couple + np.diag([10, 4])) / masses[:, None]
    system[2:4, 2:4] = -c * couple / masses[:, None]
    system[2, 4], system[4, 5], system[5, 4] = 3 / masses[0], frequency, -frequency
    states = [np.array([1.0, 1, 0, 0, 0, 1])]
    for _ in trajectory.time[1:]:
        states.append(expm(system * 0.02) @ states[-1])
    exact = np.array(states)
    assert np.abs(trajectory.q - exact[:, :2]).max() <= rtol
    assert np.abs(trajectory.v - exact[:, 2:4]).max() <= 5 * rtol


@pytest.mark.parametrize("method", [*STIFF, "auto"])
def test_van_der_pol(method: str) -> None:
    model = lagcli.load_text("""
coordinates: [x]
T: x'^2/2
V: x^2/2
Q: {x: "1000*(1 - x^2)*x'"}
initial: {x: 2, x': 0}
""")
    trajectory = completed(
        model, method=method, t_end=2000, samples=2, rtol=1e-7, atol=1e-9, max_steps=10_000
    )
    # x at t = 2 in slow time, ε = 1e-6: Hairer & Wanner, IV.10, give y(2) = 1.706167732170483
    # with the start (2, −0.66); this one joins it after a boundary layer of 1e-6, in which x
    # moves by 0.66e-6
    assert trajectory.q[-1, 0] == pytest.approx(1.706167732, abs=2e-6)


# references


SHORT: dict[str, Any] = {"t_end": 0.2, "samples": 5}


@cache
def reference_of(name: str) -> tuple[Model, Motion]:
    """Return a model with its motion by the oracle, at tight tolerances."""
    model = chain(3) if name == "chain" else SLIDER
    return model, motion(model, method="Radau", rtol=1e-11, atol=1e-11, **SHORT)


@pytest.mark.parametrize("method", [*STIFF, "auto"])
@pytest.mark.parametrize("rtol", [1e-5, 1e-7])
@pytest.mark.parametrize("name", ["chain", "slider"])
def test_errors_are_at_the_tolerance(name: str, rtol: float, method: str) -> None:
    model, reference = reference_of(name)
    trajectory = completed(model, method=method, rtol=rtol, atol=rtol, **SHORT)
    size = max(1.0, np.abs(reference.v).max())
    np.testing.assert_allclose(trajectory.q, reference.q, rtol=0, atol=5 * rtol)
    np.testing.assert_allclose(trajectory.v, reference.v, rtol=0, atol=20 * rtol * size)
    assert np.nanmax(np.abs(trajectory.residual_position / trajectory.scale_position)) <= 1e-12
    assert np.abs(trajectory.residual_velocity / trajectory.scale_velocity).max() <= 1e-12


@pytest.mark.parametrize("method", STIFF)
@pytest.mark.parametrize("name", every_model(smooth=True))
def test_stiff_methods_agree_with_dop853_on_every_shipped_model(name: str, method: str) -> None:
    model = lagcli.load(PATHS[name])
    end = (model.settings.t_start or 0.0) + 0.05 * model.settings.t_end
    options: dict[str, Any] = {"t_end": end, "samples": 6}
    reference = completed(model, method="DOP853", rtol=1e-11, atol=1e-12, **options)
    trajectory = completed(model, method=method, rtol=1e-9, atol=1e-10, **options)
    for name in ("q", "v", "multipliers"):
        one, other = getattr(trajectory, name), getattr(reference, name)
        scale = np.abs(other).max(axis=0, initial=0.0).max(initial=0.0)
        # 1e-9 per step, over some ten steps; λ is as good as v, and grows with the stiffness
        np.testing.assert_allclose(one, other, rtol=0, atol=2e-6 * (scale + 1e-3), err_msg=name)


@pytest.mark.parametrize("method", STIFF)
def test_redundant_constraints(method: str) -> None:
    model = lagcli.load_text("""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 9.81*y
constraints: {rod: x^2 + y^2 = 1, again: 3*(x^2 + y^2) = 3}
initial: {x: 1, y: 0, x': 0, y': 0}
""")
    options: dict[str, Any] = {"t_end": 2, "samples": 21}
    reference = completed(model, method="DOP853", rtol=1e-11, atol=1e-12, **options)
    trajectory = completed(model, method=method, rtol=1e-9, atol=1e-10, **options)
    np.testing.assert_allclose(trajectory.q, reference.q, rtol=0, atol=1e-7)
    np.testing.assert_allclose(trajectory.multipliers, reference.multipliers, rtol=0, atol=1e-5)


# what auto does


@pytest.mark.parametrize(("rtol", "method"), [(1e-3, "Rodas5P"), (1e-6, "Radau")])
def test_auto_says_what_it_did(rtol: float, method: str) -> None:
    trajectory = completed(chain(2, c=1e5), t_end=1, samples=11, rtol=rtol, atol=rtol)
    assert trajectory.options["method"] == f"DOP853, {method}"
    assert f"stiff: continued with {method} at t = " in trajectory.message
    assert trajectory.counts["steps"] < 500


def test_auto_stays_explicit_where_nothing_is_stiff() -> None:
    for path in MODELS:
        model = lagcli.load(path)
        trajectory = lagcli.simulate(model, samples=3)
        assert trajectory.options["method"] == "DOP853", path.stem


def test_index1_drifts_with_stiff_methods_too() -> None:
    pendulum = lagcli.load_text("""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 9.81*y
constraints: {rod: x^2 + y^2 = 1}
initial: {x: 1, y: 0, x': 0, y': 0}
""")
    for method in STIFF:
        options: dict[str, Any] = {"method": method, "rtol": 1e-5, "atol": 1e-5, "t_end": 4}
        free = completed(pendulum, formulation="index1", **options)
        assert np.abs(free.residual_position).max() > 1e-7
        with pytest.raises(UsageError, match="Baumgarte"):
            lagcli.simulate(pendulum, formulation="baumgarte", **options)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["Rodas5P", "Radau"])
def test_cost_grows_like_the_number_of_bodies(method: str) -> None:
    def seconds(n: int) -> float:
        """Return the time that a second of the motion takes, once it is under way."""
        stamps: list[tuple[float, float]] = []
        completed(
            models[n],
            method=method,
            rtol=1e-5,
            atol=1e-5,
            t_end=0.1,
            samples=2,
            max_step=1e-3,
            progress=lambda t: stamps.append((t, time.process_time())),
        )
        (t0, first), (t1, last) = stamps[0], stamps[-1]
        return (last - first) / (t1 - t0)

    models = {n: chain(n, hanging=True) for n in (20, 160)}
    # eight times as long; square growth would be sixty-four
    assert_growth(seconds, (20, 160), factor=30)


def test_the_summary_says_what_auto_did(tmp_path: Path) -> None:
    file = tmp_path / "spring.yaml"
    file.write_text("""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 9.81*y + 1e8/2*(sqrt(x^2 + y^2) - 1)^2
D: 1e5/2*(x*x' + y*y')^2
initial: {x: 1, y: 0, x': 0, y': 0}
""")
    done = subprocess.run(
        [sys.executable, "-m", "lagcli", "simulate", str(file), "--rtol", "1e-6", "--t-end", "1"],
        capture_output=True,
        text=True,
        encoding="utf-8",
        check=True,
    )
    assert "DOP853, Radau with projection" in done.stdout
    assert "Radau from t = " in done.stdout
    assert "the motion is stiff: continued with Radau at t = " in done.stdout
    assert max(map(len, done.stdout.splitlines())) <= 100


# a beam of 40 links: fast, but not stiff

BEAM = lagcli.load(Path(__file__).parents[1] / "found" / "beam40.yaml")


@pytest.mark.slow
def test_beam_is_not_tried_with_an_implicit_method() -> None:
    """Accuracy limits its steps as much as stability: a trial would cost and gain nothing."""
    runs = [  # the path is examined after 2000 steps
        lagcli.simulate(BEAM, samples=2, max_steps=2100, method=method)
        for method in ("auto", "DOP853")
    ]
    assert runs[0].counts == runs[1].counts
    np.testing.assert_array_equal(runs[0].q, runs[1].q)


def test_beam_against_published_values() -> None:
    """The first step, whose end is anywhere, counted as one with rounding errors of that size."""
    trajectory = completed(BEAM, samples=2)
    q, v = trajectory.q[-1], trajectory.v[-1]
    links = np.array([1, 10, 20, 40]) - 1
    expected = [-0.5792366591285007e-2, -0.9119134654647947e-1]
    expected += [-0.1483595472463012, -0.1767201761075488]
    np.testing.assert_allclose(q[links], expected, rtol=0, atol=1e-8)
    expected = [0.3747362681329794e-1, 0.5987609702624270, 1.186724615113034]
    np.testing.assert_allclose(v[links[[0, 1, 3]]], expected, rtol=0, atol=1e-7)


@pytest.mark.parametrize(("rtol", "error"), [(1e-8, 2e-6), (1e-10, 4e-8), (1e-12, 4e-9)])
def test_errors_of_radau_follow_the_tolerance(rtol, error):
    """Two masses turn about each other on a stiff, damped spring. What rounding errors need of the
    tolerances is not multiplied by what the order of Radau's estimate allows."""
    k, rate = 8e6, 2.0
    length = k / (k - rate**2 / 2)  # of a spring of length 1 at rest
    model = lagcli.load_text(f"""
    coordinates: [x1, y1, x2, y2]
    definitions: {{s: sqrt((x2 - x1)^2 + (y2 - y1)^2)}}
    T: (x1'^2 + y1'^2 + x2'^2 + y2'^2)/2
    V: {k}/2*(s - 1)^2
    D: 1000*s'^2
    initial: {{x1: {-length / 2!r}, y1: 0, x2: {length / 2!r}, y2: 0,
              x1': 0.3, y1': {-rate * length / 2!r}, x2': 0.3, y2': {rate * length / 2!r}}}
    """)
    run = lagcli.simulate(model, method="Radau", rtol=rtol, t_end=3, samples=61)
    angle = rate * run.time
    along = length / 2 * np.array([np.cos(angle), np.sin(angle)])
    across = rate * np.array([-along[1], along[0]])
    moved, speed = np.array([0.3 * run.time, 0 * angle]), np.array([[0.3], [0.0]])
    np.testing.assert_allclose(run.q.T, [*(moved - along), *(moved + along)], rtol=0, atol=error)
    np.testing.assert_allclose(run.v.T, [*(speed - across), *(speed + across)], rtol=0, atol=error)
