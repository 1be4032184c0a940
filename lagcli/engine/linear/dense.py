"""Dense linear algebra at one state: accelerations and multipliers, projection, rank.

B is scaled by rows and columns, so that its rank does not depend on the units of constraints and
coordinates. The scale of a column is the size of its coordinate (`lagcli.engine.scales`). The scale
of a row is its current length, or its largest length along the run: a row that vanishes in a
singular configuration must not be normalized.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.scales import coordinate_sizes

#: Singular values of the row-scaled B below this count as zero. Weaker directions would cause
#: errors of 1e-16/1e-8 in the accelerations.
RANK_TOLERANCE = 1e-8

#: Order from which a matrix with less than this part of nonzero entries is factorized sparsely.
_LARGE, _FILLED = 500, 0.05
#: Rows this close to the longest rest are as good a pivot: the first of them is taken, so that the
#: choice does not depend on rounding errors.
_AS_GOOD = 0.9


class SingularSystem(ArithmeticError):
    """The equations do not determine the accelerations."""


class Decomposition(NamedTuple):
    """Singular value decomposition of the scaled B, truncated at its rank."""

    scale: Array  # (nc,) lengths of the rows
    sizes: Array  # (nq,) of the coordinates
    left: Array  # (nc, rank)
    values: Array  # (min(nc, nq),) all singular values
    right: Array  # (nq, rank): of B times sizes
    null: Array  # (nq, nq − rank): admissible changes of the coordinates
    dependent: Array  # (nc, nc − rank): combinations of scaled rows that vanish

    @property
    def rank(self) -> int:
        """Numerical rank of B."""
        return self.left.shape[1]

    def least(self, rhs: Array) -> Array:
        """Return the x of least norm with B x = rhs, or the least-squares solution."""
        return self.sizes * (self.right @ ((self.left.T @ (rhs / self.scale)) / self._values))

    def multipliers(self, forces: Array) -> Array:
        """Return a λ with Bᵀλ = forces."""
        parts = (self.right.T @ (self.sizes * forces)) / self._values
        return np.asarray((self.left @ parts) / self.scale)

    @property
    def _values(self) -> Array:
        return self.values[: self.rank]


def row_scale(jacobian: Array) -> Array:
    """Return the lengths of B's rows; 1 for a row of zeros."""
    length: Array = np.sqrt(np.einsum("ij,ij->i", jacobian, jacobian))
    if not length.all():
        length[length == 0.0] = 1.0
    return length


def decompose(
    jacobian: Array,
    rank: int | None = None,
    scale: Array | None = None,
    sizes: Array | None = None,
) -> Decomposition:
    """Decompose B; by default, the rank is determined by `RANK_TOLERANCE`.

    By default, rows are scaled by their lengths, and columns are not scaled.
    """
    scaled, scale, sizes = _scaled(jacobian, scale, sizes)
    u, s, vt = np.linalg.svd(scaled)
    if rank is None:
        rank = int((s > RANK_TOLERANCE).sum())
    null = sizes[:, None] * vt[rank:].T
    return Decomposition(scale, sizes, u[:, :rank], s, vt[:rank].T, null, u[:, rank:])


def count_rank(
    jacobian: Array,
    tolerance: float = RANK_TOLERANCE,
    scale: Array | None = None,
    sizes: Array | None = None,
) -> int:
    """Return the numerical rank of the scaled B; see `decompose`."""
    return int((singular_values(jacobian, scale, sizes) > tolerance).sum())


def singular_values(
    jacobian: Array, scale: Array | None = None, sizes: Array | None = None
) -> Array:
    """Return the singular values of the scaled B, largest first; see `decompose`."""
    scaled, _, _ = _scaled(jacobian, scale, sizes)
    return np.asarray(np.linalg.svd(scaled, compute_uv=False), dtype=float)


def independent_rows(
    jacobian: Array, rank: int, scale: Array | None = None, sizes: Array | None = None
) -> list[int]:
    """Return `rank` rows of the scaled B that are far from dependent, ascending; see `decompose`.

    The others follow from them if B has this rank (Gram-Schmidt with pivoting).
    """
    rest, _, _ = _scaled(jacobian, scale, sizes)
    chosen: list[int] = []
    for _ in range(rank):
        squares = np.einsum("ij,ij->i", rest, rest)
        i = int(np.argmax(squares >= _AS_GOOD**2 * squares.max()))
        chosen.append(i)
        pivot = rest[i] / (np.sqrt(squares[i]) or 1.0)
        rest = rest - np.outer(rest @ pivot, pivot)
        rest[i] = 0.0
    return sorted(chosen)


def _scaled(
    jacobian: Array, scale: Array | None, sizes: Array | None
) -> tuple[Array, Array, Array]:
    """Return B scaled by rows and columns, and the scales."""
    if sizes is None:
        sizes = np.ones(jacobian.shape[1])
    scaled = jacobian * sizes
    if scale is None:
        scale = row_scale(scaled)
    return scaled / scale[:, None], scale, sizes


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
    # rows of B are scaled to the magnitude of M, so that pivots are comparable
    weight = (mass.max() or 1.0) / row_scale(jacobian)  # M's largest entry is on its diagonal
    scaled = jacobian * weight[:, None]
    right = np.empty(n)
    right[:nq] = forcing
    right[nq:] = rhs * weight
    try:
        if n >= _LARGE and (factors := _sparse_factors(mass, scaled)) is not None:
            return _refined(*factors, right, nq, weight)
        matrix = np.zeros((n, n))
        matrix[:nq, :nq] = mass
        matrix[nq:, :nq] = scaled
        matrix[:nq, nq:] = scaled.T
        return _refined(matrix, lambda b: np.linalg.solve(matrix, b), right, nq, weight)
    except np.linalg.LinAlgError:
        raise SingularSystem from None


def _refined(
    matrix: Any, solve: Callable[[Array], Any], right: Array, nq: int, weight: Array
) -> tuple[Array, Array]:
    """Return the parts of the solution of A x = b, refined once."""
    x = np.asarray(solve(right), dtype=np.float64)
    x += solve(right - matrix @ x)
    return x[:nq], -x[nq:] * weight


def _sparse_factors(mass: Array, rows: Array) -> tuple[Any, Callable[[Array], Any]] | None:
    """Return [[M, Bᵀ], [B, 0]] and b → its solution by sparse factors; None for few zeros.

    Raises
    ------
    LinAlgError
        The matrix is singular.
    """
    from scipy.sparse import block_array, csc_array
    from scipy.sparse.linalg import splu

    b = csc_array(rows)
    matrix = block_array([[csc_array(mass), b.T], [b, None]], format="csc")
    if matrix.nnz > _FILLED * matrix.shape[0] ** 2:
        return None
    try:
        return matrix, splu(matrix).solve
    except RuntimeError:
        raise np.linalg.LinAlgError from None


def solve_redundant(
    mass: Array, forcing: Array, rhs: Array, d: Decomposition
) -> tuple[Array, Array]:
    """Solve the same system for B of deficient rank, by the null space of B.

    a and Bᵀλ are unique; λ is the one of least norm.

    Raises
    ------
    SingularSystem
        M is singular on the null space of B.
    """
    particular = d.least(rhs)
    a = particular
    if d.null.shape[1]:
        reduced = d.null.T @ mass @ d.null
        try:
            z = np.linalg.solve(reduced, d.null.T @ (forcing - mass @ particular))
        except np.linalg.LinAlgError:
            raise SingularSystem from None
        a = particular + d.null @ z
    multipliers = d.multipliers(mass @ a - forcing)
    if d.dependent.shape[1]:
        free, _ = np.linalg.qr(d.dependent / d.scale[:, None])
        multipliers = multipliers - free @ (free.T @ multipliers)
    return a, multipliers


def least_change(
    jacobian: Array,
    residual: Array,
    mass: Array | None,
    rank: int | None,
    scale: Array | None = None,
    sizes: Array | None = None,
) -> Array:
    """Return the smallest δ with B δ = −residual.

    Parameters
    ----------
    jacobian : (n, nq) array
    residual : (n,) array
    mass : (nq, nq) array or None
        The norm is δᵀMδ; if M is None, or if M or B do not permit it, the norm scaled by the sizes
        of the coordinates.
    rank : int or None
        Rank to use; by default full rank if the numbers permit it, otherwise the numerical rank.
    scale, sizes : arrays, optional
        As for `decompose`.
    """
    n, nq = jacobian.shape
    if n == 0:
        return np.zeros(nq)
    if mass is not None and rank in (None, n):
        delta = _least_change(jacobian, residual, mass)
        if delta is not None:
            return delta
    if sizes is None and mass is not None:
        sizes = coordinate_sizes(np.diag(mass), jacobian)
    d = decompose(jacobian, rank, scale=scale, sizes=sizes)
    if mass is not None and 0 < d.rank < n:
        # the number of independent combinations of the rows
        rows, rhs = d.left.T @ (jacobian / d.scale[:, None]), d.left.T @ (residual / d.scale)
        delta = _least_change(rows, rhs, mass)
        if delta is not None:
            return delta
    return d.least(-residual)


def _least_change(jacobian: Array, residual: Array, mass: Array) -> Array | None:
    """Return the smallest δ in the metric of M for B of full rank; None if there is none."""
    try:
        delta, _ = solve_regular(mass, np.zeros(len(mass)), jacobian, -residual)
    except SingularSystem:
        return None
    return delta if np.isfinite(delta).all() else None
