"""The linear algebra of one state: accelerations and multipliers, projection, rank.

B is judged by its scaled rows, so that the unit in which a constraint is written does not decide
its rank. A row's scale is its length, or the length that it had along the run: a row that vanishes
in a singular configuration must be seen to vanish.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Singular values of the row-scaled B below this are taken for zero. Directions weaker than this
#: would carry an error of 1e-16/1e-8 into the accelerations.
RANK_TOLERANCE = 1e-8


class SingularSystem(ArithmeticError):
    """The equations do not determine the accelerations."""


class Decomposition(NamedTuple):
    """Singular value decomposition of the row-scaled B, cut at its rank."""

    scale: Array  # (nc,) lengths of the rows
    left: Array  # (nc, rank)
    values: Array  # (min(nc, nq),) all singular values
    right: Array  # (nq, rank)
    null: Array  # (nq, nq − rank)
    dependent: Array  # (nc, nc − rank): combinations of scaled rows that vanish

    @property
    def rank(self) -> int:
        """Numerical rank of B."""
        return self.left.shape[1]


def row_scale(jacobian: Array) -> Array:
    """Return the lengths of B's rows; 1 for a row of zeros."""
    length: Array = np.sqrt(np.einsum("ij,ij->i", jacobian, jacobian))
    if not length.all():
        length[length == 0.0] = 1.0
    return length


def decompose(
    jacobian: Array,
    rank: int | None = None,
    tolerance: float = RANK_TOLERANCE,
    scale: Array | None = None,
) -> Decomposition:
    """Decompose B; the rank is counted by the tolerance where it is not given."""
    if scale is None:
        scale = row_scale(jacobian)
    u, s, vt = np.linalg.svd(jacobian / scale[:, None])
    if rank is None:
        rank = int((s > tolerance).sum())
    return Decomposition(scale, u[:, :rank], s, vt[:rank].T, vt[rank:].T, u[:, rank:])


def count_rank(
    jacobian: Array, tolerance: float = RANK_TOLERANCE, scale: Array | None = None
) -> int:
    """Return the numerical rank of the row-scaled B."""
    values = singular_values(jacobian, row_scale(jacobian) if scale is None else scale)
    return int((values > tolerance).sum())


def singular_values(jacobian: Array, scale: Array) -> Array:
    """Return the singular values of the row-scaled B, largest first."""
    return np.asarray(np.linalg.svd(jacobian / scale[:, None], compute_uv=False), dtype=float)


def solve_regular(mass: Array, forcing: Array, jacobian: Array, rhs: Array) -> tuple[Array, Array]:
    """Solve [[M, Bᵀ], [B, 0]] [a; −λ] = [f; γ] for B of full rank.

    One step of iterative refinement.

    Returns
    -------
    a : (nq,) array
    multipliers : (nc,) array

    Raises
    ------
    SingularSystem
        The matrix is singular to working precision.
    """
    nq, n = len(forcing), len(forcing) + len(rhs)
    # rows of B are brought to M's magnitude, so that pivoting compares like with like
    weight = (mass.max() or 1.0) / row_scale(jacobian)  # M's largest entry is on its diagonal
    matrix = np.zeros((n, n))
    matrix[:nq, :nq] = mass
    scaled = jacobian * weight[:, None]
    matrix[nq:, :nq] = scaled
    matrix[:nq, nq:] = scaled.T
    right = np.empty(n)
    right[:nq] = forcing
    right[nq:] = rhs * weight
    try:
        x = np.asarray(np.linalg.solve(matrix, right), dtype=np.float64)
        x += np.linalg.solve(matrix, right - matrix @ x)
    except np.linalg.LinAlgError:
        raise SingularSystem from None
    return x[:nq], -x[nq:] * weight


def solve_redundant(
    mass: Array, forcing: Array, jacobian: Array, rhs: Array, d: Decomposition
) -> tuple[Array, Array]:
    """Solve the same system for B of deficient rank, by the null space of B.

    a and Bᵀλ are unique; λ is the one of least norm.

    Raises
    ------
    SingularSystem
        M is singular on the null space of B.
    """
    particular = d.right @ ((d.left.T @ (rhs / d.scale)) / d.values[: d.rank])
    a = particular
    if d.null.shape[1]:
        reduced = d.null.T @ mass @ d.null
        try:
            z = np.linalg.solve(reduced, d.null.T @ (forcing - mass @ particular))
        except np.linalg.LinAlgError:
            raise SingularSystem from None
        a = particular + d.null @ z
    reaction = mass @ a - forcing
    multipliers = d.left @ ((d.right.T @ reaction) / d.values[: d.rank]) / d.scale
    if d.dependent.shape[1]:
        free, _ = np.linalg.qr(d.dependent / d.scale[:, None])
        multipliers = multipliers - free @ (free.T @ multipliers)
    return a, multipliers


def least_change(jacobian: Array, residual: Array, mass: Array | None, rank: int | None) -> Array:
    """Return the smallest δ with B δ = −residual.

    Parameters
    ----------
    jacobian : (n, nq) array
    residual : (n,) array
    mass : (nq, nq) array or None
        Smallness is δᵀMδ; with None, or where M or B do not allow it, it is measured with the
        diagonal of M, or plainly.
    rank : int or None
        Rank to use; None: full rank if the numbers allow it, otherwise counted.
    """
    n, nq = jacobian.shape
    if n == 0:
        return np.zeros(nq)
    if mass is not None and rank in (None, n):
        try:
            delta, _ = solve_regular(mass, np.zeros(nq), jacobian, -residual)
        except SingularSystem:
            delta = np.full(nq, np.nan)
        if np.isfinite(delta).all():
            return delta
    weight = np.ones(nq)
    if mass is not None:
        diagonal = np.diag(mass)
        largest = diagonal.max()
        if largest > 0:
            weight = 1 / np.sqrt(np.maximum(diagonal, 1e-6 * largest))
    d = decompose(jacobian * weight, rank)
    if d.rank == 0:
        return np.zeros(nq)
    return weight * (d.right @ ((d.left.T @ (-residual / d.scale)) / d.values[: d.rank]))
