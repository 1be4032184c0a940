"""Lemke's algorithm."""

import numpy as np
import pytest

from tests.support.lemke import lemke


@pytest.mark.parametrize("n", [1, 5, 40])
def test_positive_definite_problems(n: int) -> None:
    rng = np.random.default_rng(n)
    for _ in range(10):
        root = rng.standard_normal((n, n))
        matrix, vector = root @ root.T + np.eye(n), rng.standard_normal(n)
        z = lemke(matrix, vector)
        assert z is not None
        w = matrix @ z + vector
        assert np.abs(np.minimum(z, w)).max() < 1e-9 * n


def test_ties_do_not_cycle() -> None:
    """A degenerate problem: many rows are the same, and lexicographic order decides."""
    matrix = np.ones((6, 6))
    z = lemke(matrix, -np.ones(6))
    assert z is not None
    np.testing.assert_allclose(matrix @ z, 1.0)


def test_a_ray_where_there_is_no_solution() -> None:
    assert lemke(np.array([[-1.0]]), np.array([-1.0])) is None
    assert lemke(np.zeros((2, 2)), np.array([1.0, -1.0])) is None
