"""The chain's equations as loops, written by hand for Numba: what its structure is worth.

Rod i: d_i = p_i − p_{i−1}; μ_i d_i is its pull. With M = m 1, the accelerations are
a_i = g + (μ_{i+1} d_{i+1} − μ_i d_i)/m, and d_i·(a_i − a_{i−1}) = −|ḋ_i|² is tridiagonal in μ.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

#: Unknowns of a body in the DAE's order: x, y, x', y', μ; a body knows its two neighbours.
BLOCK = 5
BANDWIDTH = 2 * BLOCK - 1


def rate(parameters: Mapping[str, float]) -> Any:
    """Return the compiled (t, y, out), y = (q, v)."""
    import numba

    m, g = parameters["m"], parameters["g"]

    @numba.njit(error_model="numpy")
    def rate(t, y, out):
        nq = len(y) // 2
        n = nq // 2
        dx, dy, pivot, pull = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
        for i in range(n):
            dx[i], dy[i] = y[2 * i], y[2 * i + 1]
            ux, uy = y[nq + 2 * i], y[nq + 2 * i + 1]
            if i > 0:
                dx[i] -= y[2 * i - 2]
                dy[i] -= y[2 * i - 1]
                ux -= y[nq + 2 * i - 2]
                uy -= y[nq + 2 * i - 1]
            pull[i] = m * (ux * ux + uy * uy)
            pivot[i] = (2.0 if i > 0 else 1.0) * (dx[i] * dx[i] + dy[i] * dy[i])
        pull[0] -= m * g * dy[0]
        for i in range(1, n):
            off = dx[i] * dx[i - 1] + dy[i] * dy[i - 1]
            pivot[i] -= off * off / pivot[i - 1]
            pull[i] += off * pull[i - 1] / pivot[i - 1]
        pull[n - 1] /= pivot[n - 1]
        for i in range(n - 2, -1, -1):
            off = dx[i] * dx[i + 1] + dy[i] * dy[i + 1]
            pull[i] = (pull[i] + off * pull[i + 1]) / pivot[i]
        for i in range(n):
            ax, ay = -pull[i] * dx[i], -pull[i] * dy[i]
            if i + 1 < n:
                ax += pull[i + 1] * dx[i + 1]
                ay += pull[i + 1] * dy[i + 1]
            out[2 * i], out[2 * i + 1] = y[nq + 2 * i], y[nq + 2 * i + 1]
            out[nq + 2 * i], out[nq + 2 * i + 1] = ax / m, ay / m - g

    return rate


def residual(parameters: Mapping[str, float]) -> Any:
    """Return the compiled (t, y, y', out) of the index-1 DAE, body by body."""
    import numba

    m, g = parameters["m"], parameters["g"]

    @numba.njit
    def residual(t, y, d, out):
        n = len(y) // 5
        for i in range(n):
            k = 5 * i
            dx, dy, ux, uy = y[k], y[k + 1], y[k + 2], y[k + 3]
            ax, ay = d[k + 2], d[k + 3]
            fx, fy = -y[k + 4] * dx, -y[k + 4] * dy
            if i > 0:
                dx -= y[k - 5]
                dy -= y[k - 4]
                ux -= y[k - 3]
                uy -= y[k - 2]
                ax -= d[k - 3]
                ay -= d[k - 2]
                fx, fy = -y[k + 4] * dx, -y[k + 4] * dy
            if i + 1 < n:
                fx += y[k + 9] * (y[k + 5] - y[k])
                fy += y[k + 9] * (y[k + 6] - y[k + 1])
            out[k] = d[k] - y[k + 2]
            out[k + 1] = d[k + 1] - y[k + 3]
            out[k + 2] = m * d[k + 2] - fx
            out[k + 3] = m * (d[k + 3] + g) - fy
            out[k + 4] = dx * ax + dy * ay + ux * ux + uy * uy

    return residual


def to_blocks(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the DAE's unknowns of a state, μ = 0."""
    blocks = np.zeros((len(q) // 2, BLOCK))
    blocks[:, :2] = q.reshape(-1, 2)
    blocks[:, 2:4] = v.reshape(-1, 2)
    return blocks.ravel()


def from_blocks(y: np.ndarray) -> np.ndarray:
    """Return q, (nt, nq), of the DAE's unknowns, (nt, 5 n)."""
    return y.reshape(len(y), -1, BLOCK)[:, :, :2].reshape(len(y), -1)
