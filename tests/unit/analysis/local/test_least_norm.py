"""Least norm under inequalities."""

import numpy as np
import pytest

from lagcli.analysis.local.active_set import least_norm_within


def test_nearest_point_of_a_half_plane() -> None:
    x = least_norm_within(np.zeros(2), np.eye(2), np.array([[1.0, 1.0]]), np.array([2.0]))
    np.testing.assert_allclose(x, [1, 1], atol=1e-12)


def test_a_share_that_is_bounded() -> None:
    """x_1 + x_2 = 4 with x_1 at most 1: 1 and 3."""
    free = np.array([[1.0], [-1.0]])
    x = least_norm_within(np.array([2.0, 2.0]), free, np.array([[-1.0]]), np.array([1.0]))
    np.testing.assert_allclose(x, [1, 3], atol=1e-12)


def test_contradicting_bounds() -> None:
    rows, bounds = np.array([[1.0], [-1.0]]), np.array([1.0, 1.0])
    assert least_norm_within(np.zeros(1), np.eye(1), rows, bounds) is None


@pytest.mark.parametrize("seed", range(5))
def test_no_other_point_is_nearer(seed: int) -> None:
    rng = np.random.default_rng(seed)
    start, free = rng.standard_normal(5), rng.standard_normal((5, 3))
    rows = rng.standard_normal((4, 3))
    bounds = rows @ rng.standard_normal(3)
    x = least_norm_within(start, free, rows, bounds)
    assert x is not None
    for _ in range(2000):
        z = rng.standard_normal(3) * 3
        if (rows @ z >= bounds).all():
            assert np.linalg.norm(start + free @ z) >= np.linalg.norm(x) - 1e-9
