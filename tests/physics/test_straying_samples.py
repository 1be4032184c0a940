"""Samples between the steps of DOP853, whose dense output strays near the limit of stability.

The motion is integrated by SciPy in short steps, with forces written here.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lagcli
from lagcli.arrays import Array

FOUND = Path(__file__).parents[1] / "found" / "straying_samples.yaml"
#: What samples may be off by, relative to the largest number of the state so far: the ends of the
#: steps are off by 1.3e-7 at 2.68 s, before the motion contracts. Samples were off by 5e-6.
ERROR = 2e-7


def slope(t: float, state: list[float]) -> list[float]:
    x, y, u, v = state
    a = -0.52 * x + 1.972 * math.hypot(x, y)
    return [u, v, a, -0.52 * y + 0.755 * v * v + 1.301 * u - 1.292 * max(0, u + 0.105) ** 2]


@pytest.fixture(scope="module")
def reference() -> tuple[Array, Array]:
    """Times and states, (4, 301)."""
    times = np.linspace(0, 4.23, 301)
    start = [0.55, -0.92, 0.13, -0.13]
    exact = solve_ivp(
        slope, (0, 4.23), start, "DOP853", t_eval=times, rtol=3e-14, atol=1e-15, max_step=2e-3
    )
    return times, exact.y


@pytest.mark.parametrize("samples", [31, 301])
def test_they_are_as_accurate_as_the_steps(reference: tuple[Array, Array], samples: int) -> None:
    found = lagcli.simulate(lagcli.load(FOUND), method="DOP853", samples=samples)
    exact = reference[1][:, :: 300 // (samples - 1)]
    size = np.maximum.accumulate(np.abs(exact).max(axis=0))
    error = np.abs(np.hstack([found.q, found.v]).T - exact).max(axis=0) / size
    assert error.max() < ERROR


def test_the_steps_do_not_depend_on_them() -> None:
    few, many = (lagcli.simulate(lagcli.load(FOUND), method="DOP853", samples=n) for n in (2, 301))
    assert few.counts["steps"] == many.counts["steps"]
    np.testing.assert_array_equal(few.v[-1], many.v[-1])


def test_samples_of_a_stable_motion_take_no_steps() -> None:
    """No evaluations beside the three of the dense output of each step, and one of each sample."""
    text = "coordinates: [x]\nT: x'^2/2\nV: x^2/2\ninitial: {x: 1, x': 0}\n"
    few, many = (
        lagcli.simulate(lagcli.load_text(text), method="DOP853", t_end=50.0, samples=n)
        for n in (2, 1001)
    )
    most = 3 * many.counts["steps"] + 999
    assert many.counts["evaluations"] <= few.counts["evaluations"] + most
