"""Lemke's algorithm for linear complementarity problems, with lexicographic pivoting.

Cottle, Pang & Stone, The Linear Complementarity Problem, 1992, sections 4.4 and 4.9.
"""

from __future__ import annotations

import numpy as np

from lagcli.arrays import Array

#: Pivots smaller than this part of the largest entry are rounding errors.
_PIVOT = 1e-11


def lemke(matrix: Array, vector: Array) -> Array | None:
    """Solve 0 ≤ z ⊥ M z + q ≥ 0.

    Parameters
    ----------
    matrix, vector : (n, n) and (n,) arrays
        M and q.

    Returns
    -------
    (n,) array or None
        z; None if the algorithm ends in a ray, which proves that there is no solution only for some
        classes of M, such as positive semidefinite matrices.
    """
    n = len(vector)
    if (vector >= 0).all():
        return np.zeros(n)
    # columns: w, z, z_0, right side; rows: basic variables. w − M z − 1 z_0 = q
    table = np.hstack([np.eye(n), -matrix, -np.ones((n, 1)), vector[:, None]])
    basis = np.arange(n)
    extra, right = 2 * n, 2 * n + 1
    # the covering vector enters for the lexicographically smallest (q, I)
    row = min(range(n), key=lambda i: (table[i, right], *table[i, :n]))
    entering = extra
    for _ in range(50 * (n + 1)):
        leaving = int(basis[row])
        _pivot(table, row, entering)
        basis[row] = entering
        if leaving == extra:
            z = np.zeros(2 * n + 1)
            z[basis] = table[:, right]
            return z[n:extra].clip(0)
        entering = leaving + n if leaving < n else leaving - n
        column = table[:, entering]
        candidates = np.flatnonzero(column > _PIVOT * max(1.0, float(np.abs(column).max())))
        if not len(candidates):
            return None
        ratios = table[np.ix_(candidates, np.array([right, *range(n)]))] / column[candidates, None]
        least = ratios[:, 0].min()
        tied = np.flatnonzero(ratios[:, 0] <= least + 1e-12 * max(1.0, abs(least)))
        ends = [k for k in tied if basis[candidates[k]] == extra]
        chosen = ends[0] if ends else min(tied, key=lambda k: tuple(ratios[k, 1:]))
        row = int(candidates[chosen])
    return None


def _pivot(table: Array, row: int, column: int) -> None:
    """Make a column a unit vector."""
    table[row] /= table[row, column]
    factors = table[:, column].copy()
    factors[row] = 0.0
    table -= factors[:, None] * table[row]
