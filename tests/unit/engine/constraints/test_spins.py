"""Angular velocities as initial values of quaternions."""

from __future__ import annotations

import numpy as np
import pytest

from lagcli.arrays import Array
from lagcli.engine.constraints.spins import (
    Spin,
    along,
    free_directions,
    rates_of_spin,
    spin_derivative,
    spin_of,
    with_given_spins,
)


def product(a: Array, b: Array) -> Array:
    """Return the product of two quaternions, by scalar and vector parts."""
    vector = a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    return np.concatenate([[a[0] * b[0] - a[1:] @ b[1:]], vector])


def test_rates_of_spin_are_quaternion_products() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        (e, de, drates), omega = rng.normal(size=(3, 4)), rng.normal(size=3)
        rates = product(e, np.concatenate([[0], omega])) / 2
        assert rates_of_spin(e) @ omega == pytest.approx(rates, abs=1e-14)
        assert spin_of(e, rates) == pytest.approx(omega, abs=1e-13)
        drates, h = rng.normal(size=4), 1e-5
        difference = spin_of(e + h * de, rates + h * drates) - spin_of(
            e - h * de, rates - h * drates
        )
        assert spin_derivative(e, rates, de, drates) == pytest.approx(
            difference / (2 * h), abs=1e-7 * (1 + np.abs(difference).max() / h)
        )


def test_free_directions_and_given_spins() -> None:
    one = Spin("e", (1, 2, 3, 4), (False, True, False))
    q = np.array([5.0, 1, 0, 0, 0])
    free = free_directions([one], np.array([False] + 4 * [True]), q)
    expected = np.zeros((5, 3))
    expected[[0, 2, 4], [0, 1, 2]] = 1, 0.5, 0.5
    np.testing.assert_array_equal(free, expected)
    turned = np.array([5.0, 0, 1, 0, 0])
    v = with_given_spins([one], q, np.array([7.0, 0, 1, 2, 3]), turned)
    assert v == pytest.approx([7, *(rates_of_spin(turned[1:]) @ np.array([2.0, 4, 6]))])
    assert one.labels() == ("omega(e).x", "omega(e).y", "omega(e).z")


def test_rounding_errors_along_directions_are_zero() -> None:
    """The row of |e| = 1 would otherwise be one more row of full length."""
    e = np.array([0.1, 0.2, 0.3, 0.4]) / np.sqrt(0.3)
    assert not along(2 * e[None], rates_of_spin(e)).any()
    assert along(np.array([[1.0, 0, 0, 0]]), rates_of_spin(e)) == pytest.approx(-e[None, 1:] / 2)
