"""Labels at the ends of curves: near their ends, apart from each other, or not at all."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from lagcli.pictures.style import spread


def test_places_are_the_nearest_ones_that_are_apart() -> None:
    """Against least squares: gaps and the first place are nonnegative unknowns."""
    rng = np.random.default_rng(27)
    for _ in range(60):
        n, height, apart = int(rng.integers(1, 7)), 100.0, float(rng.uniform(1, 16))
        at = rng.uniform(0, height, n)
        places = spread(at, apart, height)
        if (n - 1) * apart > height:
            assert places is None
            continue
        order = np.argsort(at)
        sorted_places = places[order]
        assert (np.diff(sorted_places) >= apart - 1e-9).all()
        assert sorted_places[0] >= -1e-9
        assert sorted_places[-1] <= height + 1e-9
        # x_k = sum of k + 1 unknowns, plus k steps; the last unknown is what is left of the height
        lower = np.tril(np.ones((n, n)))
        weight = 1e5
        matrix = np.vstack([np.hstack([lower, np.zeros((n, 1))]), weight * np.ones((1, n + 1))])
        right = np.append(at[order] - apart * np.arange(n), weight * (height - apart * (n - 1)))
        best = lsq_linear(matrix, right, (0, np.inf), tol=1e-14)
        expected = np.cumsum(best.x[:-1]) + apart * np.arange(n)
        assert sorted_places == pytest.approx(expected, abs=1e-3)
