"""Cubic splines: slopes at the knots of a twice continuously differentiable interpolant.

With h_i = t_{i+1} − t_i and d_i = (y_{i+1} − y_i)/h_i, continuity of the second derivative is

    h_i s_{i−1} + 2 (h_{i−1} + h_i) s_i + h_{i−1} s_{i+1} = 3 (h_i d_{i−1} + h_{i−1} d_i)

(de Boor, A Practical Guide to Splines, IV). The end conditions complete the tridiagonal system.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from lagcli.arrays import Array

Ends = Literal["not-a-knot", "clamped", "periodic"]


def spline_slopes(times: Array, values: Array, ends: Ends) -> Array:
    """Return the slopes of the spline at its knots.

    Parameters
    ----------
    times : (n,) array
        Increasing; n ≥ 2.
    values : (n,) array
    ends : str
        "not-a-knot": the third derivative is continuous at the second and the last but one knot
        (three knots give a parabola, two a line). "clamped": the slopes at the ends are zero.
        "periodic": the last value equals the first.

    Returns
    -------
    (n,) array
    """
    h = np.diff(times)
    d = np.diff(values) / h
    if ends == "periodic":
        return _periodic(h, d)
    n = len(times)
    if ends == "not-a-knot" and n == 2:
        return np.array([d[0], d[0]])
    if ends == "not-a-knot" and n == 3:
        bend = (d[1] - d[0]) / (h[0] + h[1])
        return np.array([d[0] - bend * h[0], d[0] + bend * h[0], d[1] + bend * h[1]])
    lower, diagonal, upper, right = (np.zeros(n) for _ in range(4))
    lower[1:-1], upper[1:-1] = h[1:], h[:-1]
    diagonal[1:-1] = 2 * (h[:-1] + h[1:])
    right[1:-1] = 3 * (h[1:] * d[:-1] + h[:-1] * d[1:])
    if ends == "clamped":
        diagonal[0] = diagonal[-1] = 1.0
    else:
        diagonal[0], upper[0] = h[1], h[0] + h[1]
        right[0] = ((h[0] + 2 * upper[0]) * h[1] * d[0] + h[0] ** 2 * d[1]) / upper[0]
        diagonal[-1], lower[-1] = h[-2], h[-1] + h[-2]
        right[-1] = (h[-1] ** 2 * d[-2] + (2 * lower[-1] + h[-1]) * h[-2] * d[-1]) / lower[-1]
    return _tridiagonal(lower, diagonal, upper, right)


def _periodic(h: Array, d: Array) -> Array:
    """Return the slopes of a periodic spline: a cyclic system, by the Sherman–Morrison formula."""
    if len(h) == 1:
        return np.zeros(2)
    before, h_before = np.roll(d, 1), np.roll(h, 1)
    lower, upper, diagonal = h.copy(), h_before.copy(), 2 * (h + h_before)
    right = 3 * (h * before + h_before * d)
    if len(h) == 2:  # both neighbours of a knot are the same
        matrix = np.array([[diagonal[0], lower[0] + upper[0]], [lower[1] + upper[1], diagonal[1]]])
        found = np.linalg.solve(matrix, right)
        return np.append(found, found[0])
    corner_low, corner_high = upper[-1], lower[0]  # row n − 1, column 0; row 0, column n − 1
    gamma = -diagonal[0]
    diagonal[0] -= gamma
    diagonal[-1] -= corner_low * corner_high / gamma
    u = np.zeros(len(h))
    u[0], u[-1] = gamma, corner_low
    x, z = _tridiagonal(lower, diagonal, upper, right), _tridiagonal(lower, diagonal, upper, u)
    ratio = corner_high / gamma
    found = x - z * (x[0] + ratio * x[-1]) / (1.0 + z[0] + ratio * z[-1])
    return np.append(found, found[0])


def _tridiagonal(lower: Array, diagonal: Array, upper: Array, right: Array) -> Array:
    """Solve a tridiagonal system by elimination without pivoting.

    The rows of splines are diagonally dominant, including those at the ends.
    """
    a, b, c, r = lower.tolist(), diagonal.tolist(), upper.tolist(), right.tolist()
    for i in range(1, len(b)):
        factor = a[i] / b[i - 1]
        b[i] -= factor * c[i - 1]
        r[i] -= factor * r[i - 1]
    r[-1] /= b[-1]
    for i in range(len(b) - 2, -1, -1):
        r[i] = (r[i] - c[i] * r[i + 1]) / b[i]
    return np.array(r)
