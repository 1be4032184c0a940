"""Equilibria and steady motions as roots of R(q, λ) = 0, by Newton's method."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lagcli.analysis.local.gradients import Point
from lagcli.analysis.local.local_equations import LocalEquations, shared_scale
from lagcli.analysis.local.tangent import Indices, Tangent, independent, least, multipliers_of
from lagcli.engine.linear import dense
from lagcli.errors import UsageError

Array = NDArray[np.float64]

#: Singular values of the scaled Jacobian below this part of the largest are taken for zero.
RANK = 1e-9
#: Of the terms' magnitudes: residuals at which a root is accepted, and at which Newton ends.
ACCEPTED, REACHED = 1e-10, 1e-15
_ITERATIONS, _RELAXATIONS = 60, 200
#: Of the terms' magnitudes: residuals at which Newton's method takes over.
_NEAR = 1e-4


class Residual(NamedTuple):
    """R(q, λ) and what belongs to it.

    Parameters
    ----------
    point : Point
        With the velocities and accelerations that belong to q.
    value : (nq + nh,) array
        f − M a + Bᵀλ and φ.
    scale : (nq + nh,) array
        Sums of the magnitudes of the terms.
    decomposition : Decomposition
        Of B.
    independent : tuple of int
        The coordinates whose velocities are held.
    """

    point: Point
    value: Array
    scale: Array
    decomposition: dense.Decomposition
    independent: Indices

    @property
    def relative(self) -> float:
        """The largest residual over its scale."""
        scale = np.where(self.scale > 0.0, self.scale, 1.0)
        return float(np.abs(self.value / scale).max(initial=0.0))


class SteadyProblem:
    """f − M a + Bᵀλ = 0 and φ = 0 for motions whose independent velocities are constant.

    v and a are functions of q: independent velocities have given values, 0 without one, and no
    accelerations; the others follow from ψ = 0 and B a = γ. Without given velocities and
    explicit time v = a = 0, and the roots are the equilibria ∂V/∂q − Q = Bᵀλ.

    Parameters
    ----------
    local : LocalEquations
    held : mapping of str to float
        Values of velocities by the name of their coordinate.

    Raises
    ------
    UsageError
        A coordinate is unknown.
    """

    def __init__(self, local: LocalEquations, held: Mapping[str, float] | None = None):
        self.local, self.t = local, local.t
        names = local.system.coordinates
        self.held = {names.index(name): value for name, value in (held or {}).items()}
        self.nq, self.holonomic = len(names), list(local.system.holonomic)

    # the residual

    def residual(
        self, q: Array, multipliers: Array, p: tuple[float, ...], chosen: Indices | None = None
    ) -> Residual:
        """Return R(q, λ), for independent velocities that were chosen before, if any."""
        evaluator = self.local.evaluator(p)
        zero = np.zeros(self.nq)
        c = evaluator.constraints(self.t, q, zero)
        sizes = evaluator.sizes(self.t, q, zero)
        if not (np.isfinite(c.jacobian).all() and np.isfinite(sizes).all()):
            return self._undefined(q, multipliers, p)
        d = self.local.decomposition(self.t, q, zero, p)
        preferred = tuple(self.held) if chosen is None else chosen
        free, basis = independent(d.null, sizes, preferred)
        target = np.array([self.held.get(j, 0.0) for j in free])
        v = self._completed(d, -c.drift, free, basis) + basis @ target
        dynamics = evaluator.dynamics(self.t, q, v)
        if not dynamics.finite or not np.isfinite(c.position).all():
            return self._undefined(q, multipliers, p)
        a = self._completed(d, dynamics.rhs, free, basis)
        inertial = dynamics.mass_matrix @ a
        balance = dynamics.forcing - inertial + dynamics.jacobian.T @ multipliers
        scale = np.abs(dynamics.forcing) + np.abs(dynamics.mass_matrix) @ np.abs(a)
        scale += np.abs(dynamics.jacobian.T) @ np.abs(multipliers)
        return Residual(
            Point(self.t, q, v, a, multipliers, p),
            np.concatenate([balance, c.position]),
            np.concatenate([shared_scale(scale, sizes), c.position_scale]),
            d,
            free,
        )

    def _undefined(self, q: Array, multipliers: Array, p: tuple[float, ...]) -> Residual:
        nan = np.full(self.nq + len(self.holonomic), np.nan)
        empty = dense.decompose(np.zeros((len(multipliers), self.nq)), 0)
        point = Point(self.t, q, nan[: self.nq], nan[: self.nq], multipliers, p)
        return Residual(point, nan, nan, empty, ())

    @staticmethod
    def _completed(d: dense.Decomposition, rhs: Array, free: Indices, basis: Array) -> Array:
        """Return the x with B x = rhs that is zero for the free coordinates."""
        found = least(d, rhs[:, None])[:, 0]
        return np.asarray(found - basis @ found[list(free)])

    def multipliers(self, found: Residual) -> Array:
        """Return the λ that balance the forces best, of least norm."""
        balance = found.value[: self.nq]
        jacobian = self.local.evaluator(found.point.p).dynamics(
            self.t, found.point.q, found.point.v
        )
        forces = jacobian.jacobian.T @ found.point.multipliers - balance
        return multipliers_of(found.decomposition, forces[:, None])[:, 0]

    # its Jacobian

    def jacobian(self, found: Residual) -> Array:
        """Return ∂R/∂(q, λ), (nq + nh, nq + nc)."""
        point, tangent = found.point, self._kinematics(found)
        jac = self.local.jacobians(point)
        gradient = self.local.velocity_gradient(point)
        dv = self._changed(tangent, -gradient)
        force = self._force(tangent, jac.force_position, jac.rhs_position, dv, found)
        d = self.local.evaluator(point.p).dynamics(self.t, point.q, point.v)
        nh = len(self.holonomic)
        top = np.hstack([force, d.jacobian.T])
        bottom = np.hstack([d.jacobian[self.holonomic], np.zeros((nh, len(d.jacobian)))])
        return np.vstack([top, bottom])

    def _kinematics(self, found: Residual) -> Tangent:
        d, free = found.decomposition, found.independent
        _, basis = independent(d.null, d.sizes, free)
        empty = np.zeros((self.nq, 0))
        return Tangent((), free, empty, basis, empty, d)

    def _changed(self, tangent: Tangent, rhs: Array) -> Array:
        """Return the X with B X = rhs whose rows of the independent velocities are zero."""
        found = least(tangent.decomposition, rhs)
        return found - tangent.velocity_basis @ found[list(tangent.velocities)]

    def _force(
        self, tangent: Tangent, forces: Array, rates: Array, dv: Array, found: Residual
    ) -> Array:
        """Return δ(f − M a + Bᵀλ) for changes of forces, of B a = γ, and of v."""
        jac = self.local.jacobians(found.point)
        d = self.local.evaluator(found.point.p).dynamics(self.t, found.point.q, found.point.v)
        da = self._changed(tangent, rates + jac.rhs_velocity @ dv)
        return np.asarray(forces + jac.force_velocity @ dv - d.mass_matrix @ da)

    # Newton's method

    def scales(self, found: Residual, matrix: Array) -> tuple[Array, Array]:
        """Return scales of the rows and columns of the Jacobian that make it free of units."""
        sizes, nq = found.decomposition.sizes, self.nq
        lengths = found.decomposition.scale
        stiffness = np.abs(matrix[:nq, :nq] * np.outer(sizes, sizes)).max(initial=0.0) or 1.0
        rows = np.concatenate([sizes / stiffness, 1.0 / lengths[self.holonomic]])
        return rows, np.concatenate([sizes, stiffness / lengths])

    def newton_step(self, found: Residual, inertia: float = 0.0) -> Array:
        """Return the Newton step of least size, (nq + nc,).

        With inertia μ > 0 it is an implicit step 1/μ of M q̇ = f − M a + Bᵀλ on the constraints.
        """
        matrix, nq = self.jacobian(found), self.nq
        rows, columns = self.scales(found, matrix)
        if inertia:
            point = found.point
            d = self.local.evaluator(point.p).dynamics(self.t, point.q, point.v)
            weight = rows[0] / columns[0]  # of forces by sizes: 1 over the stiffness
            matrix[:nq, :nq] -= inertia / weight * d.mass_matrix
        scaled = matrix * np.outer(rows, columns)
        u, s, vt = np.linalg.svd(scaled, full_matrices=False)
        rank = int((s > RANK * s.max(initial=0.0)).sum())
        parts = (u[:, :rank].T @ (-rows * found.value)) / s[:rank]
        return np.asarray(columns * (vt[:rank].T @ parts))

    def solve(
        self,
        q: Array,
        p: tuple[float, ...],
        multipliers: Array | None = None,
        chosen: Indices | None = None,
    ) -> Residual | None:
        """Return the root to which damped Newton steps lead, at once or after relaxation.

        Parameters
        ----------
        q : (nq,) array
            Where to start.
        p : tuple of float
        multipliers : (nc,) array, optional
            Where to start; those that balance the forces best by default.
        chosen : tuple of int, optional
            Independent velocities.
        """
        nc = len(self.local.system.constraints)
        given = np.zeros(nc) if multipliers is None else multipliers
        found = self.residual(q, given, p, chosen)
        if not np.isfinite(found.value).all():
            return None
        if multipliers is None:
            found = self.residual(q, self.multipliers(found), p, found.independent)
        root = self._newton(found)
        if root is None:
            root = self._newton(self._relaxed(found))
        if root is None:
            return None
        return self.residual(root.point.q, self.multipliers(root), p, root.independent)

    def _newton(self, found: Residual) -> Residual | None:
        """Return the root to which damped Newton steps lead; None if they lead to none."""
        for _ in range(_ITERATIONS):
            if found.relative <= REACHED:
                break
            better = self._search(found, self._limited(self.newton_step(found)))
            if better is None:
                break
            found = better
        return found if found.relative <= ACCEPTED else None

    def _relaxed(self, found: Residual) -> Residual:
        """Follow M q̇ = f − M a + Bᵀλ, with longer steps as the forces fall.

        It ends near equilibria that are stable when damped, and passes points where Newton steps
        are arbitrary. Pseudo-transient continuation: Kelley, Keyes, SIAM J. Numer. Anal. 35 (1998)
        508.
        """
        inertia, before = 2.0, found.relative
        for _ in range(_RELAXATIONS):
            step = self._limited(self.newton_step(found, inertia)) / 2
            after = self.residual(
                found.point.q + step[: self.nq],
                found.point.multipliers + step[self.nq :],
                found.point.p,
                found.independent,
            )
            if not np.isfinite(after.value).all():
                break
            found = after
            if found.relative < _NEAR:
                break
            inertia *= min(2.0, max(0.5, found.relative / before))
            before = found.relative
        return found

    def _limited(self, step: Array) -> Array:
        """Return a step that is not longer than the coordinates' lengths."""
        longest = np.abs(step[: self.nq] / self.local.lengths).max(initial=0.0)
        return step / max(1.0, longest)

    def _search(self, found: Residual, step: Array) -> Residual | None:
        """Halve the step until the residual falls; None if it does not."""
        scale = np.where(found.scale > 0.0, found.scale, 1.0)
        before = np.linalg.norm(found.value / scale)
        for halving in range(12):
            part = 0.5**halving * step
            point = found.point
            trial = self.residual(
                point.q + part[: self.nq],
                point.multipliers + part[self.nq :],
                point.p,
                found.independent,
            )
            if np.linalg.norm(trial.value / scale) < before:
                return trial
        return None

    # what a root is

    def neutral(self, found: Residual) -> Array:
        """Return the changes of q that lead from a root to others, (nq, dimension)."""
        matrix = self.jacobian(found)
        rows, columns = self.scales(found, matrix)
        _, s, vt = np.linalg.svd(matrix * np.outer(rows, columns))
        rank = int((s > RANK * s.max(initial=0.0)).sum())
        null = vt[rank:, : self.nq].T  # scaled; redundant multipliers have no part in q
        u, s, _ = np.linalg.svd(null, full_matrices=False)
        return np.asarray(columns[: self.nq, None] * u[:, s > 1e-6])

    def check_held(self, found: Residual) -> None:
        """Raise UsageError where the constraints determine a velocity that is to be held."""
        names = self.local.system.coordinates
        for j, value in self.held.items():
            if j not in found.independent:
                raise UsageError(
                    f"--steady {names[j]}'={value:g}: the constraints determine {names[j]}' from"
                    " the other velocities; hold "
                    + (" or ".join(f"{names[i]}'" for i in found.independent) or "none")
                    + " instead"
                )
