"""The slider-crank with and without the constraint used in T: the same motion, another λ.

If L is changed by h·F, where h = 0 is a holonomic constraint, the λ of h changes by −F and nothing
else does.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lagcli
from lagcli.trajectory.trajectory import Trajectory

MODELS = Path(__file__).parents[2] / "models"
FOUND = Path(__file__).parents[1] / "found"
NAMES = ("slider_crank", "slider_crank_textbook")


def run(name: str, times: list[float] | np.ndarray, **overrides: dict[str, object]) -> Trajectory:
    model = lagcli.load(MODELS / f"{name}.yaml", **overrides)
    trajectory = lagcli.simulate(model, times=times, rtol=1e-12, atol=1e-12)
    assert trajectory.status == "completed", trajectory.message
    return trajectory


@cache
def turns(name: str) -> Trajectory:
    """Simulate two turns of the crank."""
    return run(name, np.linspace(0, 1, 101))


def test_same_motion_and_lambda_differs_by_what_multiplies_the_constraint() -> None:
    whole, short = map(turns, NAMES)
    # 1e-12 per step leaves the angles good to 1e-10, and their rates of 10 rad/s to 1e-9
    np.testing.assert_allclose(short.q, whole.q, rtol=0, atol=1e-9)
    np.testing.assert_allclose(short.v, whole.v, rtol=0, atol=1e-8)
    phi, (phi_1, psi_1) = whole.q[:, 0], whole.v.T
    p = whole.parameters
    gap = p["m"] * (p["r"] * np.sin(phi) * (phi_1 + psi_1) * psi_1 + p["g"])
    assert np.abs(gap).max() > 1  # N: the two λ do differ
    difference = (whole.multipliers - short.multipliers)[:, 0]
    np.testing.assert_allclose(difference, gap, rtol=0, atol=1e-9 * np.abs(gap).max())


def test_models_state_the_same_guide_force() -> None:
    whole, short = turns(NAMES[0]).multipliers[:, 0], turns(NAMES[1]).outputs["guide_force"]
    np.testing.assert_allclose(short, whole, rtol=0, atol=1e-9 * np.abs(whole).max())


def test_lambda_is_the_rods_vertical_force_and_the_weight() -> None:
    trajectory = turns("slider_crank")
    p, psi = trajectory.parameters, trajectory.q[:, 1]
    # Newton for B in the vertical: guide + rod - m g = 0; the rod pulls B along (-cos, sin) psi
    rod = trajectory.outputs["rod_tension"] * np.sin(psi)
    expected = p["m"] * p["g"] - rod
    np.testing.assert_allclose(trajectory.multipliers[:, 0], expected, rtol=0, atol=1e-10)


@pytest.mark.parametrize("load", [0.0, 20.0])
def test_at_rest_the_guide_carries_the_weight_of_b_and_what_the_rod_presses_down(
    load: float,
) -> None:
    """A force F on B towards O and a torque on the crank hold the mechanism, by statics.

    The rod pushes back with F/cos(psi), and so presses B onto the guide with F tan(psi); virtual
    work gives the torque.
    """
    text = (MODELS / "slider_crank.yaml").read_text(encoding="utf-8")
    phi, m, r, l, g = 0.4, 1.0, 0.1, 0.3, 9.81
    psi = np.arcsin(r * np.sin(phi) / l)
    tau = m * g * r * np.cos(phi) - load * r * (np.sin(phi) + np.cos(phi) * np.tan(psi))
    text = text.replace("x_B: -c*x_B'", "x_B: -F")
    model = lagcli.load_text(
        text.replace("  g: 9.81 m/s^2", f"  g: 9.81 m/s^2\n  F: {load} N"),
        set={"tau": float(tau)},
        set_initial={"phi": phi, "phi'": 0},
    )
    trajectory = lagcli.simulate(model, times=[0.0, 0.05], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(trajectory.v, 0, atol=1e-11)
    np.testing.assert_allclose(trajectory.multipliers, m * g + load * np.tan(psi), atol=1e-10)


@pytest.mark.parametrize(
    ("name", "multiplier"),
    [("slider_crank", 0.9290966542 + 1.3 * 9.81), ("slider_crank_textbook", 0.4841497890)],
)
def test_numbers_of_one_state(name: str, multiplier: float) -> None:
    """One state on the constraint, worked out by computer algebra to ten decimals."""
    trajectory = run(
        name,
        [0.0],
        set={"m": 1.3, "r": 0.4, "l": 1.1, "g": 9.81},
        set_initial={"phi": 0.7, "phi'": 1.9},
    )
    np.testing.assert_allclose(trajectory.a[0], [-12.6144246424, -4.4074911865], atol=1e-9)
    assert trajectory.multipliers[0, 0] == pytest.approx(multiplier, abs=1e-9)


def fall_of_two_masses_on_rods(times: np.ndarray) -> np.ndarray:
    """Return the height of B without the guide, by Newton's law and the tensions of both rods."""
    r, l, gravity, phi, rate = 0.1, 0.3, np.array([0.0, -9.81]), 0.5, 12.0

    def rates(_: float, state: np.ndarray) -> np.ndarray:
        a, b, v_a, v_b = state.reshape(4, 2)
        rod, turning = b - a, v_b - v_a
        # a·a″ = −v_a² and rod·(b″ − a″) = −(v_b − v_a)²; forces per mass and length
        inner, outer = np.linalg.solve(
            [[a @ a, -a @ rod], [-a @ rod, 2 * rod @ rod]],
            [-v_a @ v_a - gravity @ a, -turning @ turning],
        )
        return np.concatenate([v_a, v_b, gravity + inner * a - outer * rod, gravity + outer * rod])

    psi = np.arcsin(r * np.sin(phi) / l)
    a, v_a = (
        r * np.array([np.cos(phi), np.sin(phi)]),
        r * rate * np.array([-np.sin(phi), np.cos(phi)]),
    )
    along = np.array([np.cos(psi), -np.sin(psi)])
    v_b = [v_a[0] - v_a[1] * np.tan(psi), 0.0]
    start = np.concatenate([a, a + l * along, v_a, v_b])
    run = solve_ivp(rates, (0, times[-1]), start, "DOP853", times, rtol=1e-12, atol=1e-13)
    return run.y[3]


def height_of_b(text: str, times: np.ndarray) -> np.ndarray:
    """Simulate a model from the start that has B at O's height and moving along it."""
    phi, rate = 0.5, 12.0
    psi = np.arcsin(np.sin(phi) / 3)
    start = {"psi": float(psi), "psi'": float(rate * np.cos(phi) / (3 * np.cos(psi)))}
    model = lagcli.load_text(f"{text}\noutputs: {{height: y_B}}\n", set_initial=start)
    trajectory = lagcli.simulate(model, times=times, rtol=1e-11, atol=1e-12)
    assert trajectory.status == "completed", trajectory.message
    return trajectory.outputs["height"]


def test_without_the_guide_the_shipped_model_falls() -> None:
    """T and V do not use the constraint: what remains is a double pendulum.

    With the weight of B in V but without m/2 y_B'^2 in T (`cut_shipped`), it fell far too fast.
    """
    times = np.linspace(0, 0.084, 8)
    expected = fall_of_two_masses_on_rods(times)
    assert expected[-1] == pytest.approx(-0.0323, abs=1e-4)
    shipped = (MODELS / "slider_crank.yaml").read_text(encoding="utf-8")
    cut = re.sub(r"(?ms)^(constraints|outputs|view):.*?\n(?=\S|\Z)", "", shipped)
    right, wrong = ((FOUND / f"cut_{x}.yaml").read_text("utf-8") for x in ("right", "shipped"))
    for model in (cut, right):
        np.testing.assert_allclose(height_of_b(model, times), expected, atol=1e-10)
    assert height_of_b(wrong, times)[-1] < 6 * expected[-1]
