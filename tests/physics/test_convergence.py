"""Errors fall with the tolerance, and drift grows as theory says."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.special import ellipj, ellipk

import lagcli
from lagcli.trajectory.trajectory import Trajectory

MODEL = lagcli.load(
    Path(__file__).parents[2] / "models" / "pendulum_cartesian.yaml", set={"theta_0": 1.5}
)


def run(rtol: float, method: str, t_end: float = 4, **options: str) -> Trajectory:
    trajectory = lagcli.simulate(
        MODEL, rtol=rtol, atol=rtol, method=method, t_end=t_end, samples=21, **options
    )
    assert trajectory.status == "completed", trajectory.message
    return trajectory


def errors(trajectory: Trajectory) -> tuple[float, float]:
    """Return the largest errors of q and of λ, by Jacobi's elliptic functions."""
    p = trajectory.parameters
    k2 = math.sin(p["theta_0"] / 2) ** 2
    sn, _, _, _ = ellipj(ellipk(k2) - math.sqrt(p["g"] / p["l"]) * trajectory.time, k2)
    theta = 2 * np.arcsin(math.sqrt(k2) * sn)
    q = p["l"] * np.column_stack([np.sin(theta), -np.cos(theta)])
    tension = p["m"] * p["g"] * (3 * np.cos(theta) - 2 * math.cos(p["theta_0"]))
    multipliers = -tension / (2 * p["l"])
    return (
        float(np.abs(trajectory.q - q).max()),
        float(np.abs(trajectory.multipliers[:, 0] - multipliers).max()),
    )


@pytest.mark.parametrize(
    ("method", "tolerances"),
    [
        ("DOP853", (1e-5, 1e-7, 1e-9, 1e-11)),
        ("Taylor", (1e-5, 1e-7, 1e-9, 1e-11)),
        ("Radau", (1e-5, 1e-7)),  # the steps at 1e-4 are few, and its errors small by chance
    ],
)
def test_error_falls_with_the_tolerance(method: str, tolerances: tuple[float, ...]) -> None:
    found = np.array([errors(run(rtol, method)) for rtol in tolerances])
    # per step the tolerance; over two periods some hundreds of it, λ with g in front
    assert (found[:, 0] < 500 * np.array(tolerances)).all(), found
    assert (found[:, 1] < 10_000 * np.array(tolerances)).all(), found
    # a hundredth of the tolerance gives a tenth of the error at the very least
    assert (found[1:] < 0.1 * found[:-1]).all(), found


def test_multipliers_are_as_good_as_the_state() -> None:
    # λ is a function of the state: its error is that of q and v, times derivatives of order g
    for rtol in (1e-6, 1e-9):
        q, multipliers = errors(run(rtol, "DOP853"))
        assert multipliers < 100 * q


def test_order_of_the_drift() -> None:
    # φ̈ = 0 up to the local errors: φ grows at least like t, ψ does not fall
    runs = [run(1e-5, "DOP853", t, formulation="index1") for t in (2, 8)]
    position = [np.abs(r.residual_position).max() for r in runs]
    assert 3 < position[1] / position[0] < 100  # between t and t³
    # and it is of the order of the local errors, so that it falls with the tolerance
    tight = run(1e-7, "DOP853", 8, formulation="index1")
    assert np.abs(tight.residual_position).max() < 0.1 * position[1]
    kept = run(1e-5, "DOP853", 8)
    assert np.abs(kept.residual_position).max() < 1e-9 * position[1]


@pytest.mark.parametrize("start", [1e6, -1e9])
@pytest.mark.parametrize("method", ["DOP853", "Taylor", "Radau", "Rodas5P"])
def test_runs_far_from_the_origin_of_time_are_as_accurate(start: float, method: str) -> None:
    model = lagcli.load_text("coordinates: [x]\nT: x'^2/2\nV: 50*x^2\ninitial: {x: 1, x': 0}\n")
    found = lagcli.simulate(
        model, t_start=start, t_end=start + 20, samples=101, rtol=1e-12, method=method
    )
    # times minus the start are exact; the rounding of the time of one step would be 1e-7 s at 1e9 s
    expected = np.cos(10 * (found.time - start))
    np.testing.assert_allclose(found.q[:, 0], expected, rtol=0, atol=1e-9)
