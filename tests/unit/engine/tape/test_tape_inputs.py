"""Known functions of time: pieces between knots, and cubic splines."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from lagcli.engine.tape.inputs import InputFunctions, interpolated, spline_slopes

TIMES = np.array([0.0, 1.0, 2.0, 4.0])
VALUES = np.array([0.0, 1.0, -1.0, 0.0])


def values(interpolation: str, extend: str | None, t: list[float] | np.ndarray) -> np.ndarray:
    at = np.asarray(t, dtype=float)
    origin, *coefficients = interpolated("u", TIMES, VALUES, interpolation, extend).pieces(at).T
    return sum(c * (at - origin) ** k for k, c in enumerate(coefficients))


def test_steps_hold_from_each_time_on() -> None:
    assert values("step", None, [0, 0.9, 1, 1.9, 2, 3.9, 4]).tolist() == [0, 0, 1, 1, -1, -1, 0]


def test_lines() -> None:
    t = np.linspace(0, 4, 41)
    np.testing.assert_allclose(
        values("linear", None, t), np.interp(t, TIMES, VALUES), rtol=0, atol=1e-15
    )


@pytest.mark.parametrize(
    ("extend", "ends"), [(None, "not-a-knot"), ("hold", "clamped"), ("periodic", "periodic")]
)
def test_splines_are_those_of_scipy(extend: str | None, ends: str) -> None:
    t = np.linspace(0, 4, 401)
    expected = CubicSpline(TIMES, VALUES, bc_type=ends)(t)
    np.testing.assert_allclose(values("cubic", extend, t), expected, rtol=0, atol=1e-14)


def test_outside() -> None:
    assert np.isnan(values("linear", None, [-0.1, 4.1])).all()
    assert values("linear", "hold", [-5, 9]).tolist() == [0, 0]
    assert values("step", "hold", [-5, 9]).tolist() == [0, 0]
    t = np.array([-7.5, 0.5, 8.5, 4000.5])
    np.testing.assert_allclose(values("linear", "periodic", t), 0.5, rtol=1e-12)
    np.testing.assert_allclose(
        values("step", "periodic", [-3.0, 1.0, 5.0, 401.0]), 1.0, rtol=0, atol=0
    )


def test_a_period_that_is_no_binary_fraction() -> None:
    """The knots of the hundredth period are found where they are computed to be."""
    times = np.array([0.1, 0.2, 0.4])
    square = interpolated("u", times, np.array([1.0, -1.0, 1.0]), "step", "periodic")
    breaks = square.breaks(0.1, 300.0)
    assert len(breaks) == 1999
    signs = square.pieces(breaks)[:, 1]
    np.testing.assert_array_equal(signs, np.resize([-1.0, 1.0], len(breaks)))


def test_a_knot_within_rounding_of_the_end_is_there() -> None:
    times = np.array([0.3, 0.4, 0.3 + 1 / 3])
    f = interpolated("u", times, np.array([0.0, 1.0, 0.0]), "step", "periodic")
    for k in range(-50, 50):
        end = float(Fraction(3, 10) + Fraction(k, 3))
        breaks = f.breaks(end - 0.5, end)
        assert breaks[-1] == end
        assert f.pieces(np.array([end]))[0, 1] == 0.0
        assert f.pieces(np.array([end - 1e-12]))[0, 1] == 1.0


def test_breaks_of_several_functions_are_merged() -> None:
    one = interpolated("u", np.array([0.0, 0.3, 1.0]), np.zeros(3), "linear", None)
    other = interpolated("w", np.array([0.0, 0.1 + 0.2, 1.0]), np.zeros(3), "linear", None)
    both = InputFunctions((one, other))
    assert both.breaks(0.0, 0.9).tolist() == [0.3]  # 0.1 + 0.2 is the next number
    assert both.breaks(0.0, 0.9, [0.5]).tolist() == [0.3, 0.5]
    pieces = both.pieces(np.array([0.3]))[0]
    assert pieces[0] == 0.3  # of each, the piece that begins there
    assert pieces[3] == 0.1 + 0.2


def test_knots_at_the_start_are_no_breaks() -> None:
    one = interpolated("u", TIMES, VALUES, "linear", None)
    assert one.breaks(1.0, 4.0).tolist() == [2.0]
    held = interpolated("u", TIMES, VALUES, "linear", "hold")
    assert held.breaks(-1.0, 4.0).tolist() == [0.0, 1.0, 2.0, 4.0]


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
