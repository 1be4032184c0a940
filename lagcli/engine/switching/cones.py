"""Forces of least norm within cones.

Lawson & Hanson, Solving Least Squares Problems, 1974, chapter 23: least distance programming.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from lagcli.arrays import Array

#: If the residual is below this, relative to the right side 1, the inequalities are infeasible.
_INFEASIBLE = 1e-11


def least_norm_within(start: Array, free: Array, rows: Array, bounds: Array) -> Array | None:
    """Return the x = start + free z of least norm with rows z ≥ bounds, or None.

    Parameters
    ----------
    start : (n,) array
    free : (n, k) array
        Independent columns.
    rows, bounds : (m, k) and (m,) arrays
    """
    q, r = np.linalg.qr(free)
    inverse = np.linalg.inv(r)
    across = q.T @ start  # w = r z + across is the variable part of x
    g = rows @ inverse
    w = _least_distance(g, bounds + g @ across)
    return None if w is None else start + free @ (inverse @ (w - across))


def _least_distance(matrix: Array, bounds: Array) -> Array | None:
    """Return the w of least norm with matrix w ≥ bounds, or None."""
    if (bounds <= 0).all():
        return np.zeros(matrix.shape[1])
    scale = float(np.abs(bounds).max())
    stacked = np.vstack([matrix.T, bounds / scale])
    goal = np.zeros(len(stacked))
    goal[-1] = 1.0
    try:
        factors, _ = nnls(stacked, goal)
    except RuntimeError:  # no convergence
        return None
    residual = stacked @ factors - goal
    if -residual[-1] <= _INFEASIBLE:
        return None
    return np.asarray(-residual[:-1] / residual[-1] * scale)
