"""Operating points with their tangent spaces: independent coordinates, δa and δλ."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lagcli.analysis.local.contacts import ContactStatus
from lagcli.analysis.local.gradients import Point
from lagcli.arrays import Array
from lagcli.engine.linear import dense

Indices = tuple[int, ...]

#: Singular values below this part of the largest are taken for zero.
_SINGULAR = 1e-12


class Tangent(NamedTuple):
    """Admissible δq and δv in terms of independent coordinates and velocities.

    δq = Z_q x and δv = W x + Z_v y, where x are the δq of the independent coordinates and y the δv
    of the independent velocities: B_h Z_q = 0, B Z_v = 0, B W + (∂ψ/∂q) Z_q = 0.

    Parameters
    ----------
    positions : tuple of int
        Independent coordinates, nq − rank of B_h.
    velocities : tuple of int
        Coordinates whose velocities are independent, nq − rank of B.
    position_basis : (nq, positions) array
        Z_q, whose rows of the independent coordinates are the identity.
    velocity_basis : (nq, velocities) array
        Z_v, likewise.
    velocity_by_position : (nq, positions) array
        W, whose rows of the independent velocities are zero.
    decomposition : Decomposition
        Decomposition of B.
    """

    positions: Indices
    velocities: Indices
    position_basis: Array
    velocity_basis: Array
    velocity_by_position: Array
    decomposition: dense.Decomposition


def tangent_of(
    whole: dense.Decomposition,
    holonomic: dense.Decomposition,
    velocity_gradient: Array,
    preferred: Indices = (),
) -> Tangent:
    """Return the tangent space of the constraints at a state.

    Parameters
    ----------
    whole, holonomic : Decomposition
        Of B and of its holonomic rows.
    velocity_gradient : (nc, nq) array
        ∂ψ/∂q.
    preferred : tuple of int
        Coordinates whose velocities are independent if the constraints allow it.
    """
    sizes = whole.sizes
    positions, position_basis = independent(holonomic.null, sizes, preferred)
    velocities, velocity_basis = independent(whole.null, sizes, preferred)
    particular = least(whole, -velocity_gradient @ position_basis)
    shift = particular - velocity_basis @ particular[list(velocities)]
    return Tangent(positions, velocities, position_basis, velocity_basis, shift, whole)


def independent(
    null: Array, sizes: Array, preferred: Indices = (), next_best: Indices = ()
) -> tuple[Indices, Array]:
    """Choose independent coordinates, and express a null space by them.

    Parameters
    ----------
    null : (nq, n) array
        A basis.
    sizes : (nq,) array
        Changes of the coordinates that are considered equal in size.
    preferred : tuple of int
        Coordinates to be chosen if they are independent.
    next_best : tuple of int
        Coordinates to be chosen before the others.

    Returns
    -------
    chosen : tuple of n int
        Increasing.
    basis : (nq, n) array
        Its rows of the chosen coordinates are the identity.
    """
    from scipy.linalg.lapack import dgeqp3

    n = null.shape[1]
    if n in (0, len(null)):
        return tuple(range(n)), np.eye(len(null))[:, :n]
    weight = 1.0 / sizes
    # before others, unless the null space hardly moves them
    weight[list(next_best)] *= 30.0
    weight[list(preferred)] *= 1e3
    _, pivots, *_ = dgeqp3((null * weight[:, None]).T)
    chosen = sorted((pivots[:n] - 1).tolist())
    basis = np.asarray(np.linalg.solve(null[chosen].T, null.T).T, dtype=np.float64)
    basis[chosen] = np.eye(n)
    return tuple(chosen), basis


def least(d: dense.Decomposition, rhs: Array) -> Array:
    """Return the X of least norm with B X = rhs, for several right sides (nc, m)."""
    values = d.values[: d.rank, None]
    return np.asarray(
        d.sizes[:, None] * (d.right @ ((d.left.T @ (rhs / d.scale[:, None])) / values))
    )


def multipliers_of(d: dense.Decomposition, forces: Array) -> Array:
    """Return the λ of least norm with Bᵀλ = forces, for several right sides (nq, m)."""
    parts = (d.right.T @ (d.sizes[:, None] * forces)) / d.values[: d.rank, None]
    multipliers = (d.left @ parts) / d.scale[:, None]
    if d.dependent.shape[1]:
        free, _ = np.linalg.qr(d.dependent / d.scale[:, None])
        multipliers = multipliers - free @ (free.T @ multipliers)
    return np.asarray(multipliers)


class Response:
    """Map from right sides of M δa − R δλ = g, B δa = γ to δa and δλ.

    R is Bᵀ, plus ∂f/∂λ if forces depend on λ. For redundant constraints, δλ is the solution of
    least norm.

    Parameters
    ----------
    mass : (nq, nq) array
        M.
    tangent : Tangent
    coupled : ((nc, nq) array, (nq, nc) array), optional
        B and R, where R is not Bᵀ.

    Raises
    ------
    SingularSystem
        An admissible motion has no inertia.
    """

    def __init__(self, mass: Array, tangent: Tangent, coupled: tuple[Array, Array] | None = None):
        self.mass, self.tangent, self.coupled = mass, tangent, coupled
        basis = tangent.velocity_basis
        self.reduced = basis.T @ mass @ basis

    def __call__(self, forces: Array, rates: Array) -> tuple[Array, Array]:
        """Return δa (nq, m) and δλ (nc, m) for g (nq, m) and γ (nc, m)."""
        if self.coupled is not None:
            return self._saddle(*self.coupled, forces, rates)
        d, basis = self.tangent.decomposition, self.tangent.velocity_basis
        a = least(d, rates)
        if basis.shape[1]:
            try:
                a = a + basis @ np.linalg.solve(self.reduced, basis.T @ (forces - self.mass @ a))
            except np.linalg.LinAlgError:
                raise dense.SingularSystem from None
        return a, multipliers_of(d, self.mass @ a - forces)

    def _saddle(
        self, jacobian: Array, reactions: Array, forces: Array, rates: Array
    ) -> tuple[Array, Array]:
        """Return δa and δλ where R is not Bᵀ, from the singular values of the whole."""
        d = self.tangent.decomposition
        sizes, scale, nq = d.sizes, d.scale, len(self.mass)
        matrix = np.block(
            [
                [sizes[:, None] * self.mass * sizes, -sizes[:, None] * reactions / scale],
                [jacobian * sizes / scale[:, None], np.zeros((len(scale), len(scale)))],
            ]
        )
        u, s, vt = np.linalg.svd(matrix)
        rank = int((s > _SINGULAR * s.max(initial=0.0)).sum())
        if rank < nq + d.rank:
            raise dense.SingularSystem
        right = np.vstack([sizes[:, None] * forces, rates / scale[:, None]])
        solution = vt[:rank].T @ ((u[:, :rank].T @ right) / s[:rank, None])
        return sizes[:, None] * solution[:nq], solution[nq:] / scale[:, None]


@dataclass(frozen=True, eq=False)
class OperatingPoint:
    """A point on the constraints, with the tangent space there.

    Parameters
    ----------
    name : str
        Description, such as "the start" or "the state at t = 2 s".
    point : Point
        t, q, v, a, λ and the parameters' values.
    tangent : Tangent
    steady : bool
        Whether the independent velocities are constant: an equilibrium or a steady motion.
    contacts : tuple of ContactStatus
        The states of contacts, limits and friction there; the linear model is that of this mode.
    frame : (nq, nq) array or None
        Of a motion along symmetries, the matrix F of q̇ = F q + b: deviations are those for an
        observer who moves along, δq = e^(F t) x.
    neutral : int
        The dimension of the motions along all symmetries.
    """

    name: str
    point: Point
    tangent: Tangent
    steady: bool
    contacts: tuple[ContactStatus, ...] = ()
    frame: Array | None = None
    neutral: int = 0
