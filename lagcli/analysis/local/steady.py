"""Equilibria and steady motions as roots of R(q, λ) = 0, by Newton's method."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from copy import copy
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lagcli.analysis.local.gradients import Gradients, MotionJacobians, Point, point_tape
from lagcli.analysis.local.local_equations import LocalEquations, shared_scale
from lagcli.analysis.local.operating_point import (
    Indices,
    OperatingPoint,
    independent,
    least,
    multipliers_of,
)
from lagcli.arrays import Array
from lagcli.engine.constraints.initial import ConsistentSearch, NoStart
from lagcli.engine.evaluator import Dynamics
from lagcli.engine.linear import dense
from lagcli.engine.scales import LEAST_PART
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.errors import NumericalError, UsageError
from lagcli.model.model import RATE, Model
from lagcli.model.spelling import did_you_mean, nearest

if TYPE_CHECKING:
    from symengine import Basic

    from lagcli.equations.derivation.lagrange import Equations


class MeasuredExpression(NamedTuple):
    """An expression in q, v, t and the parameters with its derivatives."""

    value: ScalarTape
    by_position: Gradients
    by_velocity: Gradients
    expression: Basic

    @classmethod
    def of(cls, eq: Equations, expression: Basic) -> MeasuredExpression:
        """Compile an expression."""

        tape = point_tape(eq, [expression])
        by_q, by_v = (Gradients.of(eq, [expression], symbols) for symbols in (eq.q, eq.v))
        return cls(ScalarTape(tape), by_q, by_v, expression)


class Condition(NamedTuple):
    """An expression, or the rate of a symmetry, that has a given value.

    Parameters
    ----------
    text : str
        As given: ``omega(e).z``, ``theta``, ``rate(J_1)``.
    target : float
        The value, SI.
    measured : MeasuredExpression or None
        The expression; None for a rate.
    rate : int
        The place of the rate among the unknown speeds.
    """

    text: str
    target: float
    measured: MeasuredExpression | None
    rate: int = -1

    def residual(self, point: Point, speeds: Array, local: LocalEquations) -> tuple[float, float]:
        """Return the difference from the given value, and the scale of its rounding errors."""
        if self.measured is None:
            return float(speeds[self.rate]) - self.target, abs(self.target) or local.rate
        value = float(self.measured.value(point.inputs())[0])
        by_q, by_v, _ = self.slopes(point, speeds)
        terms = np.abs(by_q) @ local.lengths + np.abs(by_v) @ (local.rate * local.lengths)
        return value - self.target, max(abs(self.target), abs(value), float(terms)) or 1.0

    def slopes(self, point: Point, speeds: Array) -> tuple[Array, Array, Array]:
        """Return the derivatives with respect to q, v and s at given q and v."""
        by_speed = np.zeros(len(speeds))
        if self.measured is None:
            by_speed[self.rate] = 1.0
            return np.zeros(len(point.q)), np.zeros(len(point.q)), by_speed
        by_q = self.measured.by_position.at(point)[0]
        return by_q, self.measured.by_velocity.at(point)[0], by_speed


#: Singular values of the scaled Jacobian below this part of the largest count as zero.
RANK = 1e-9
#: Residuals, relative to the terms, at which a root is accepted and at which Newton's method ends.
ACCEPTED, REACHED = 1e-10, 1e-15
_ITERATIONS, _RELAXATIONS = 60, 200
#: Residual, relative to the terms, from which Newton's method is used.
_NEAR = 1e-4
#: Rounding errors, relative to the coordinates' lengths.
_ROUNDING = 1e-14
#: Residuals beside a root, relative to the terms or to that of the root, that are rounding errors.
_FLAT, _AS_ROOT = 1e-13, 10.0
#: Distances from a degenerate root, relative to the lengths, at which they are looked for; least
#: part of coordinates in a direction, which otherwise changes multipliers alone.
_FLAT_DISTANCES, _OF_POSITIONS = (1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3), 1e-6
#: The next of these distances; distances at which residuals are compared for their rounding errors.
_FARTHER, _NOISE_DISTANCES = 10.0, (-3e-13, -1e-13, 1e-13, 3e-13)
_BESIDE = 1e-2  # distance of trial points for other roots, relative to these lengths
#: Constraint forces above this multiple of the applied forces indicate a singular configuration.
_STRAINED = 1e6


class IndependentVelocities(NamedTuple):
    """The coordinates with prescribed velocities, and the others as functions of them.

    Parameters
    ----------
    decomposition : Decomposition
        Of B.
    coordinates : tuple of int
    basis : (nq, n) array
        Admissible velocities as functions of the independent ones.
    """

    decomposition: dense.Decomposition
    coordinates: Indices
    basis: Array

    def completed(self, rhs: Array) -> Array:
        """Return the X with B X = rhs, (m,) or (m, k), that is zero for these coordinates."""
        if not rhs.any() or not self.decomposition.rank:
            return np.zeros((len(self.basis), *rhs.shape[1:]))
        one = rhs.ndim == 1
        x = least(self.decomposition, rhs[:, None])[:, 0] if one else least(self.decomposition, rhs)
        return np.asarray(x - self.basis @ x[list(self.coordinates)])


class Residual(NamedTuple):
    """The residual R(q, λ) and the quantities computed with it.

    Parameters
    ----------
    point : Point
        The point, with the velocities and accelerations that belong to q.
    value : (nq + nh,) array
        f − M a + Bᵀλ and φ.
    scale : (nq + nh,) array
        Sums of the magnitudes of the terms.
    decomposition : Decomposition
        Decomposition of B.
    independent : tuple of int
        The coordinates with prescribed velocities.
    basis : (nq, n) array
        Admissible velocities as functions of the independent ones.
    dynamics : Dynamics
    speeds : (ns,) array
        The values of unknown speeds.
    """

    point: Point
    value: Array
    scale: Array
    decomposition: dense.Decomposition
    independent: Indices
    basis: Array
    dynamics: Dynamics
    speeds: Array = np.empty(0)

    @property
    def relative(self) -> float:
        """The largest residual relative to its scale."""
        scale = np.where(self.scale > 0.0, self.scale, 1.0)
        return float(np.abs(self.value / scale).max(initial=0.0))


class SteadyProblem:
    """f − M a + Bᵀλ = 0 and φ = 0 for motions whose independent velocities are constant.

    v and a are functions of q: independent velocities have given values, 0 without one, and no
    accelerations; the others follow from ψ = 0 and B a = γ. Without given velocities and
    explicit time v = a = 0, and the roots are the equilibria ∂V/∂q − Q = Bᵀλ. The velocities of
    first-order coordinates are independent too: their equations are rows of R, not constraints.

    Parameters
    ----------
    local : LocalEquations
    held : mapping of str to float
        Values of velocities by the name of their coordinate.
    unknown : sequence of str
        Coordinates whose velocities are constant but unknown: the speeds s, further unknowns.
    conditions : sequence of Condition
        Further equations.

    Raises
    ------
    UsageError
        A coordinate is unknown.
    """

    def __init__(
        self,
        local: LocalEquations,
        held: Mapping[str, float] | None = None,
        unknown: Sequence[str] = (),
        conditions: Sequence[Condition] = (),
    ):
        self.local, self.t = local, local.t
        self.unknown, self.conditions = tuple(unknown), tuple(conditions)
        names = local.system.coordinates
        self.held = {names.index(name): value for name, value in (held or {}).items()}
        self.sought = tuple(names.index(name) for name in self.unknown)
        self.nq, self.holonomic = len(names), list(local.system.holonomic)
        #: The equations of first-order coordinates, which are among those of R.
        self.balances = [i for i, c in enumerate(local.system.constraints) if c.endswith(RATE)]

    def with_target(self, number: int, value: float) -> SteadyProblem:
        """Return the problem with another value of a condition."""
        problem = copy(self)
        conditions = list(self.conditions)
        conditions[number] = conditions[number]._replace(target=value)
        problem.conditions = tuple(conditions)
        return problem

    @property
    def is_along_symmetries(self) -> bool:
        """Whether velocities are those along symmetries."""
        return False

    def place_of(self, text: str) -> int:
        """Return the place of a condition."""
        return [condition.text for condition in self.conditions].index(text)

    @property
    def is_motion(self) -> bool:
        """Whether steady motions are looked for, not equilibria."""
        return bool(self.held or self.unknown or self.conditions)

    @property
    def speed_names(self) -> tuple[str, ...]:
        """The names of the unknown speeds."""
        return tuple(f"{name}'" for name in self.unknown)

    # the residual

    def first_speeds(self, q: Array, p: tuple[float, ...]) -> Array:
        """Return values of the unknown speeds from which iterations start: those of the file."""
        v = self.local.start.state.v[list(self.sought)]
        lengths = self.local.lengths[list(self.sought)]
        return np.where(np.abs(v) > 0.0, v, self.local.rate * lengths)

    def residual(
        self,
        q: Array,
        multipliers: Array,
        p: tuple[float, ...],
        chosen: Indices | None = None,
        speeds: Array | None = None,
    ) -> Residual:
        """Return R(q, λ, s), with previously chosen independent velocities if given."""
        speeds = self.first_speeds(q, p) if speeds is None else speeds
        evaluator = self.local.evaluator(p)
        zero = np.zeros(self.nq)
        c = evaluator.constraints(self.t, q, zero)
        c = c._replace(jacobian=self._without_balances(c.jacobian))
        sizes = evaluator.sizes(self.t, q, zero)
        if not (np.isfinite(c.jacobian).all() and np.isfinite(sizes).all()):
            return self._undefined(q, multipliers, p, speeds)
        d = self.local.decomposition(c, sizes, zero)
        preferred = (*self.held, *self.sought) if chosen is None else chosen
        chosen_basis = independent(d.null, sizes, preferred, self.local.entering)
        free = IndependentVelocities(d, *chosen_basis)
        v = self._velocity(q, speeds, c.drift, free)
        dynamics = evaluator.dynamics(self.t, q, v)
        if not dynamics.finite or not np.isfinite(c.position).all():
            return self._undefined(q, multipliers, p, speeds)
        a = self._acceleration(v, speeds, dynamics.rhs, free)
        inertial = dynamics.mass_matrix @ a
        if self.local.reactive is not None:
            dynamics = self.local.dynamics(Point(self.t, q, v, a, multipliers, p))
        dynamics = dynamics._replace(jacobian=self._without_balances(dynamics.jacobian))
        balance = dynamics.forcing - inertial + dynamics.jacobian.T @ multipliers
        scale = np.abs(dynamics.forcing) + np.abs(dynamics.mass_matrix) @ np.abs(a)
        scale += np.abs(dynamics.jacobian.T) @ np.abs(multipliers)
        scale = np.maximum(scale, self.local.least_forces)
        # all terms of a constraint may vanish at a root
        reach = np.abs(c.jacobian[self.holonomic]) @ self.local.lengths
        position = np.maximum(c.position_scale, LEAST_PART * reach)
        point = Point(self.t, q, v, a, multipliers, p)
        more = [x.residual(point, speeds, self.local) for x in self.conditions]
        return Residual(
            point,
            np.concatenate([balance, c.position, [value for value, _ in more]]),
            np.concatenate([shared_scale(scale, sizes), position, [size for _, size in more]]),
            *free,
            dynamics,
            speeds,
        )

    def _without_balances(self, jacobian: Array) -> Array:
        """Return B with zeros in the rows that are equations of first-order coordinates."""
        if not self.balances:
            return jacobian
        jacobian = jacobian.copy()
        jacobian[self.balances] = 0.0
        return jacobian

    def _velocity(
        self, q: Array, speeds: Array, drift: Array, free: IndependentVelocities
    ) -> Array:
        """Return v."""
        given = {**self.held, **dict(zip(self.sought, speeds.tolist(), strict=True))}
        target = np.array([given.get(j, 0.0) for j in free.coordinates])
        return free.completed(-drift) + free.basis @ target

    def _acceleration(
        self, v: Array, speeds: Array, rhs: Array, free: IndependentVelocities
    ) -> Array:
        """Return a."""
        return free.completed(rhs)

    def _undefined(
        self, q: Array, multipliers: Array, p: tuple[float, ...], speeds: Array
    ) -> Residual:
        nan = np.full(self.nq + len(self.holonomic) + len(self.conditions), np.nan)
        zero = np.zeros(self.nq)
        point = Point(self.t, q, zero, zero, multipliers, p)
        jacobian = np.zeros((len(multipliers), self.nq))
        empty = dense.decompose(jacobian, 0)
        dynamics = self.local.evaluator(p).dynamics(self.t, q, zero)
        return Residual(point, nan, nan, empty, (), np.zeros((self.nq, 0)), dynamics, speeds)

    def multipliers(self, residual: Residual) -> Array:
        """Return the λ of least norm that balance the forces best.

        Forces that have no derivative by λ, as √(λ₁² + λ₂²) at 0, keep their values.
        """
        if self.local.reactive is not None:
            sizes, scale = residual.decomposition.sizes, residual.decomposition.scale
            with suppress(NumericalError):
                reactions = self.local.reactions(residual.point, residual.dynamics.jacobian)
                step, *_ = np.linalg.lstsq(
                    sizes[:, None] * reactions / scale,
                    -sizes * residual.value[: self.nq],
                    rcond=RANK,
                )
                return np.asarray(residual.point.multipliers + step / scale)
        forces = (
            residual.dynamics.jacobian.T @ residual.point.multipliers - residual.value[: self.nq]
        )
        return multipliers_of(residual.decomposition, forces[:, None])[:, 0]

    # its Jacobian

    def jacobian(self, residual: Residual) -> Array:
        """Return ∂R/∂(q, λ, s), (nq + nh + conditions, nq + nc + ns)."""
        jac, d = self.local.jacobians(residual.point), residual.dynamics
        dv, da = self._by_position(residual, jac)
        force = jac.force_position + jac.force_velocity @ dv - d.mass_matrix @ da
        nq, held = self.nq, d.jacobian[self.holonomic]
        matrix = np.zeros((nq + len(held), nq + len(d.jacobian)))
        matrix[:nq, :nq], matrix[nq:, :nq] = force, held
        matrix[:nq, nq:] = self.local.reactions(residual.point, d.jacobian)
        if not (len(residual.speeds) or self.conditions):
            return matrix
        by_speed, da_s = self.by_speeds(residual, jac)
        force = jac.force_velocity @ by_speed - d.mass_matrix @ da_s
        matrix = np.hstack([matrix, np.vstack([force, np.zeros((len(held), force.shape[1]))])])
        between = np.zeros(len(d.jacobian))
        for condition in self.conditions:
            by_q, by_v, by_s = condition.slopes(residual.point, residual.speeds)
            row = np.concatenate([by_q + by_v @ dv, between, by_v @ by_speed + by_s])
            matrix = np.vstack([matrix, row])
        return matrix

    def _by_position(self, residual: Residual, jac: MotionJacobians) -> tuple[Array, Array]:
        """Return ∂v/∂q and ∂a/∂q, (nq, nq) each."""
        dv = self.changed(residual, -self.local.velocity_gradient(residual.point))
        return dv, self.changed(residual, jac.rhs_position + jac.rhs_velocity @ dv)

    def by_speeds(self, residual: Residual, jac: MotionJacobians) -> tuple[Array, Array]:
        """Return ∂v/∂s and ∂a/∂s, (nq, ns) each."""
        dv = np.zeros((self.nq, len(self.sought)))
        for k, j in enumerate(self.sought):
            if j in residual.independent:
                dv[:, k] = residual.basis[:, residual.independent.index(j)]
        return dv, self.changed(residual, jac.rhs_velocity @ dv)

    def by_parameter(
        self, residual: Residual, jac: MotionJacobians, velocity: Array, rates: Array
    ) -> tuple[Array, Array]:
        """Return ∂v and ∂a for changes of ψ and of γ − B a by a parameter, (nq, 1) each."""
        dv = self.changed(residual, -velocity[:, None])
        return dv, self.changed(residual, rates[:, None] + jac.rhs_velocity @ dv)

    def changed(self, residual: Residual, rhs: Array) -> Array:
        """Return the X with B X = rhs whose rows of the independent velocities are zero."""
        free = IndependentVelocities(residual.decomposition, residual.independent, residual.basis)
        return free.completed(rhs)

    # Newton's method

    def scales(self, residual: Residual, matrix: Array) -> tuple[Array, Array]:
        """Return scales of the rows and columns that make the Jacobian dimensionless."""
        sizes, nq = residual.decomposition.sizes, self.nq
        lengths = residual.decomposition.scale
        stiffness = np.abs(matrix[:nq, :nq] * np.outer(sizes, sizes)).max(initial=0.0) or 1.0
        rows = np.concatenate([sizes / stiffness, 1.0 / lengths[self.holonomic]])
        columns = np.concatenate([sizes, stiffness / lengths])
        if not (len(residual.speeds) or self.conditions):
            return rows, columns
        columns = np.concatenate([columns, self.speed_scales(residual)])
        more = np.abs(matrix[len(rows) :] * columns).max(axis=1, initial=0.0)
        return np.concatenate([rows, 1.0 / np.where(more > 0.0, more, 1.0)]), columns

    def speed_scales(self, residual: Residual) -> Array:
        """Return scales of the unknown speeds, (ns,)."""
        return np.asarray(self.local.rate * residual.decomposition.sizes[list(self.sought)])

    def newton_step(self, residual: Residual, inertia: float = 0.0) -> Array:
        """Return the Newton step of least norm, (nq + nc + ns,).

        With inertia μ > 0 it is an implicit step 1/μ of M q̇ = f − M a + Bᵀλ on the constraints.
        """
        matrix, nq = self.jacobian(residual), self.nq
        rows, columns = self.scales(residual, matrix)
        if inertia:
            weight = rows[0] / columns[0]  # forces over sizes: the inverse of a stiffness
            matrix[:nq, :nq] -= inertia / weight * residual.dynamics.mass_matrix
        scaled = matrix * np.outer(rows, columns)
        u, s, vt = np.linalg.svd(scaled, full_matrices=False)
        rank = int((s > RANK * s.max(initial=0.0)).sum())
        parts = (u[:, :rank].T @ (-rows * residual.value)) / s[:rank]
        return np.asarray(columns * (vt[:rank].T @ parts))

    def solve(
        self,
        q: Array,
        p: tuple[float, ...],
        multipliers: Array | None = None,
    ) -> Residual | None:
        """Return the root found by damped Newton steps, directly or after relaxation.

        Parameters
        ----------
        q : (nq,) array
            Starting point.
        p : tuple of float
        multipliers : (nc,) array, optional
            Starting value; by default the λ that balance the forces best.
        """
        residual = self.begun(q, p, multipliers)
        if not np.isfinite(residual.value).all():
            return None
        root = self.polished(residual)
        return self.polished(self.relaxed(residual)) if root is None else root

    def begun(self, q: Array, p: tuple[float, ...], multipliers: Array | None = None) -> Residual:
        """Return the residual from which iterations start; for the parameters see `solve`."""
        nc = len(self.local.system.constraints)
        given = np.zeros(nc) if multipliers is None else multipliers
        residual = self.residual(q, given, p)
        if multipliers is not None or not np.isfinite(residual.value).all():
            return residual
        return self.residual(
            q, self.multipliers(residual), p, residual.independent, residual.speeds
        )

    def polished(self, residual: Residual) -> Residual | None:
        """Return the root found by damped Newton steps, with the least λ, or None."""
        root = self._newton(residual)
        if root is None:
            return None
        multipliers = self._without_rounding(self.multipliers(root), root)
        if self._strained(root, multipliers):
            return None
        q = np.where(np.abs(root.point.q) > _ROUNDING * self.local.lengths, root.point.q, 0.0)
        return self.residual(q, multipliers, root.point.p, root.independent, root.speeds)

    def _without_rounding(self, multipliers: Array, root: Residual) -> Array:
        """Return λ with zeros where λ b is within rounding of the forces at large changes of q."""
        forces = shared_scale(self.local.least_forces, root.decomposition.sizes) / LEAST_PART
        work = np.abs(root.dynamics.jacobian) * np.abs(multipliers)[:, None]
        return np.where((work > _ROUNDING * forces).any(axis=1), multipliers, 0.0)

    def _strained(self, root: Residual, multipliers: Array) -> bool:
        """Whether constraint forces are extremely large, as near singular configurations."""
        sizes, d, point = root.decomposition.sizes, root.dynamics, root.point
        applied = (np.abs(d.forcing) + np.abs(d.mass_matrix @ point.a)) * sizes
        reaction = (np.abs(d.jacobian.T) @ np.abs(multipliers)) * sizes
        largest = applied.max(initial=0.0)
        return bool(largest and reaction.max(initial=0.0) > _STRAINED * largest)

    def moved(self, residual: Residual, step: Array) -> Residual:
        """Return the residual after a step, (nq + nc + ns,)."""
        point, end = residual.point, self.nq + len(residual.point.multipliers)
        return self.residual(
            point.q + step[: self.nq],
            point.multipliers + step[self.nq : end],
            point.p,
            residual.independent,
            residual.speeds + step[end:],
        )

    def _newton(self, residual: Residual) -> Residual | None:
        """Return the root found by damped Newton steps; None if they do not converge."""
        for iteration in range(_ITERATIONS):
            if residual.relative <= REACHED:
                break
            try:
                step = self.newton_step(residual)
            except NumericalError:
                if not iteration:
                    raise  # at the point from which the search starts
                return None  # they lead to a singularity
            better = self._search(residual, self.limited(step))
            if better is None:
                break
            residual = better
        return residual if residual.relative <= ACCEPTED else None

    def relaxed(
        self, residual: Residual, ends: Callable[[Residual, Residual], bool] | None = None
    ) -> Residual:
        """Follow M q̇ = f − M a + Bᵀλ, with longer steps as the forces decrease, or until it ends.

        It ends near equilibria that are stable when damped, and passes points where Newton steps
        are arbitrary. Pseudo-transient continuation: Kelley, Keyes, SIAM J. Numer. Anal. 35 (1998)
        508.
        """
        inertia, before = 2.0, residual.relative
        for _ in range(_RELAXATIONS):
            try:
                step = self.limited(2 * self.newton_step(residual, inertia)) / 2
            except NumericalError:
                break
            after = self.moved(residual, step)
            if not np.isfinite(after.value).all():
                break
            passed = ends is not None and ends(residual, after)
            residual = after
            if passed or residual.relative < _NEAR:
                break
            inertia *= min(2.0, max(0.5, residual.relative / before))
            before = residual.relative
        return residual

    def limited(self, step: Array) -> Array:
        """Return a step limited to the coordinates' lengths."""
        longest = np.abs(step[: self.nq] / self.local.lengths).max(initial=0.0)
        return step / max(1.0, longest)

    def _search(self, residual: Residual, step: Array) -> Residual | None:
        """Halve the step until the residual falls; None if it does not."""
        scale = np.where(residual.scale > 0.0, residual.scale, 1.0)
        before = np.linalg.norm(residual.value / scale)
        for halving in range(12):
            trial = self.moved(residual, 0.5**halving * step)
            if np.linalg.norm(trial.value / scale) < before:
                return trial
        return None

    # properties of a root

    def neutral(self, residual: Residual) -> Array:
        """Return the changes of q that lead from a root to other roots, (nq, dimension).

        Directions in which forces vanish only to first order lead back to the root.
        """
        matrix = self.jacobian(residual)
        rows, columns = self.scales(residual, matrix)
        _, s, vt = np.linalg.svd(matrix * np.outer(rows, columns))
        rank = int((s > RANK * s.max(initial=0.0)).sum())
        null = vt[rank:].T  # scaled; redundant multipliers do not affect q
        _, s, mixed = np.linalg.svd(null[: self.nq], full_matrices=False)
        whole = [null @ (x / size) for x, size in zip(mixed, s, strict=True) if size > 1e-6]
        lasting = [x[: self.nq] for x in whole if self._leads_to_others(residual, columns, x)]
        return np.asarray(columns[: self.nq, None] * np.array(lasting).reshape(-1, self.nq).T)

    def _leads_to_others(self, residual: Residual, columns: Array, direction: Array) -> bool:
        """Whether there are other roots near a root in a scaled direction of all unknowns.

        With the λ of the root, Newton steps of least norm could lead back to it.
        """
        nq, sizes = self.nq, columns[: self.nq]
        step = _BESIDE / np.abs(sizes * direction[:nq] / self.local.lengths).max()
        root = self._newton(self.moved(residual, step * columns * direction))
        if root is None:
            return False
        along = direction[:nq] @ ((root.point.q - residual.point.q) / sizes)
        return bool(along > step / 2)

    def rounding(self, residual: Residual) -> float:
        """Return the largest residual beside a root, relative to its terms, that is rounding."""
        q, p, lengths = residual.point.q, residual.point.p, self.local.lengths
        beside = (self.unbalanced(q + x * lengths, p) for x in _NOISE_DISTANCES)
        return max(_FLAT, _AS_ROOT * max(residual.relative, *filter(np.isfinite, beside)))

    def flat(self, residual: Residual, neutral: Array, rounding: float) -> Array:
        """Return how far rounding errors may be off a degenerate root, (nq,); zeros at others.

        Along this change of q, either way, forces vanish but for their rounding errors, and the
        stiffness at the root is one of these. Sets of roots are not looked at.
        """
        flat = np.zeros(self.nq)
        if neutral.shape[1] or self.speed_names:
            return flat
        matrix = self.jacobian(residual)
        rows, columns = self.scales(residual, matrix)
        _, s, vt = np.linalg.svd(matrix * np.outer(rows, columns))
        weak = int((s > RANK * s.max(initial=0.0)).sum())
        weakest = vt[min(weak, len(s) - 1) :, : self.nq]  # redundant multipliers do not affect q
        directions, parts, _ = np.linalg.svd(weakest.T, full_matrices=False)
        if parts[0] < _OF_POSITIONS:
            return flat
        along = columns[: self.nq] * directions[:, 0]
        along /= np.abs(along / self.local.lengths).max()
        q, p = residual.point.q, residual.point.p
        for distance in _FLAT_DISTANCES:
            beside = (q + distance * along, q - distance * along)
            if not all(self.unbalanced(x, p) <= rounding for x in beside):
                break
            flat = np.asarray(_FARTHER * distance * along)
        return flat

    def unbalanced(self, q: Array, p: tuple[float, ...]) -> float:
        """Return the residual, relative to its terms, on the constraints next to q, or infinity."""
        placed = self.on_constraints(q)
        return np.inf if placed is None else float(self.begun(placed, p).relative)

    def on_constraints(self, q: Array) -> Array | None:
        """Return a point on the constraints near a guess, or None."""
        local = self.local
        free = np.zeros(len(q), bool)
        search = ConsistentSearch(local.evaluator(local.p), local.t, free, free)
        try:
            return search.place(q, np.zeros(len(q)))
        except NoStart:
            return None

    def check_held(self, residual: Residual) -> None:
        """Raise UsageError if the constraints determine a prescribed velocity."""
        names = self.local.system.coordinates
        for j, value in self.held.items():
            if j not in residual.independent:
                raise UsageError(
                    f"--steady {names[j]}'={value:g}: the constraints determine {names[j]}' from"
                    " the other velocities; hold "
                    + (" or ".join(f"{names[i]}'" for i in residual.independent) or "none")
                    + " instead"
                )
        for j in self.sought:
            if j not in residual.independent:
                raise UsageError(
                    f"--steady {names[j]}': the constraints determine this velocity from the others"
                )

    def is_steady(self, residual: Residual) -> bool:
        """Whether a root is that of a motion that stays steady."""
        return self.local.is_steady(
            residual.point, self.local.tangent(residual.point, residual.independent)
        )

    def operating_point(self, residual: Residual, name: str) -> OperatingPoint:
        """Return a root as an operating point."""
        tangent = self.local.tangent(residual.point, residual.independent)
        return OperatingPoint(
            name, residual.point, tangent, True, self.local.contacts(residual.point)
        )


#: Relative differences of velocities above rounding errors.
_DIFFERENT = 1e-6


class SteadyState(NamedTuple):
    """A root of the steady problem.

    Parameters
    ----------
    local : LocalEquations
        The equations of which it is a root.
    operating_point : OperatingPoint
    residual : Residual
    neutral : (nq, dimension) array
        Changes of q that lead to other roots: the tangent space of a set of equilibria.
    flat : (nq,) array
        How far rounding errors may be off a degenerate root: `SteadyProblem.flat`.
    rounding : float
        The largest residual beside it, relative to its terms, that is a rounding error.
    speeds : mapping of str to float
        Unknown speeds, by name.
    """

    local: LocalEquations
    operating_point: OperatingPoint
    residual: Residual
    neutral: Array
    flat: Array
    rounding: float
    speeds: Mapping[str, float] = MappingProxyType({})


def velocity_coordinate(names: Sequence[str], text: str) -> str:
    """Return the coordinate whose velocity a text such as ``phi'`` or ``phi_dot`` names.

    Raises
    ------
    UsageError
        It names none.
    """
    name = text.removesuffix("'") if text.endswith("'") else text.removesuffix("_dot")
    if name not in names or name == text:
        known = [f"{q}'" for q in names]
        remedy = did_you_mean(nearest(text, known)) or f"there are {', '.join(known[:20])}"
        raise UsageError(f"--steady `{text}` is not a velocity of the model; {remedy}")
    return name


def completed(problem: SteadyProblem, residual: Residual) -> SteadyState:
    """Return a root as an operating point.

    Raises
    ------
    UsageError
        The constraints determine a prescribed velocity.
    NumericalError
        The state is not steady: the equations depend on time or on a coordinate that moves.
    """
    local = problem.local
    problem.check_held(residual)
    name = "the steady motion" if np.any(residual.point.v) else "the equilibrium"
    if not problem.is_steady(residual):
        what = "steady motion" if problem.is_motion else "equilibrium"
        cause = "the time" if not np.any(residual.point.v) else "the time, or on what moves"
        raise NumericalError(
            f"{local.model.name} has no {what} here: forces balance at t ="
            f" {residual.point.t:g} s, but they depend on {cause}"
        )
    point = problem.operating_point(residual, name)
    speeds = dict(zip(problem.speed_names, residual.speeds.tolist(), strict=True))
    neutral, rounding = problem.neutral(residual), problem.rounding(residual)
    flat = problem.flat(residual, neutral, rounding)
    return SteadyState(local, point, residual, neutral, flat, rounding, speeds)


def ignored_velocities(model: Model, point: Point) -> dict[str, float]:
    """Return initial velocities that the file gives and that a motion does not have."""
    velocities = dict(zip(model.coordinate_names, point.v.tolist(), strict=True))
    return {
        f"{name}'": given.value
        for name, given in model.initial_velocities.items()
        if given.value and abs(given.value - velocities[name]) > _DIFFERENT * abs(given.value)
    }


def none_found(local: LocalEquations, problem: SteadyProblem, q: Array) -> NumericalError:
    """Return the error of an unsuccessful search, with the unbalanced forces."""
    start = problem.residual(q, np.zeros(len(local.system.constraints)), local.p)
    what = "steady motion" if problem.is_motion else "equilibrium"
    text = f"no {what} of {local.model.name} was found from its initial values"
    if np.isfinite(start.value).all():
        balanced = problem.residual(q, problem.multipliers(start), local.p)
        relative = np.abs(balanced.value) / np.where(balanced.scale > 0, balanced.scale, 1.0)
        nq = len(q)
        worst = [int(i) for i in np.argsort(-relative[:nq]) if relative[i] > 1e-6][:3]
        if worst:
            names = ", ".join(local.system.coordinates[i] for i in worst)
            text += f": forces on {names} remain"
    return NumericalError(
        f"{text}; give initial values nearer to one (--set-initial), or check that there is one"
    )
