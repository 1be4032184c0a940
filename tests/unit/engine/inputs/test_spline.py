"""Slopes of splines, against SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from lagcli.engine.inputs.spline import spline_slopes


@pytest.mark.parametrize("ends", ["not-a-knot", "clamped", "periodic"])
@pytest.mark.parametrize("count", [2, 3, 4, 5, 6, 1000])
def test_slopes_are_those_of_scipy(count: int, ends: str) -> None:
    random = np.random.default_rng(count)
    times, values = np.cumsum(random.uniform(0.01, 1, count)), random.normal(size=count)
    if ends == "periodic":
        values[-1] = values[0]
    expected = CubicSpline(times, values, bc_type=ends)(times, 1)
    # both solve the same system; its condition is below 10
    found = spline_slopes(times, values, ends)  # type: ignore[arg-type]
    largest = np.abs(np.diff(values) / np.diff(times)).max()
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13 * max(1.0, largest))


def test_a_spline_reproduces_a_cubic() -> None:
    """With not-a-knot ends, whatever the distances of the knots."""
    times = np.array([-1.0, 0.1, 0.2, 3.0, 3.5])
    cubic = np.polynomial.Polynomial([1.0, -2.0, 0.5, 0.25])
    found = spline_slopes(times, cubic(times), "not-a-knot")
    np.testing.assert_allclose(found, cubic.deriv()(times), rtol=1e-13)
