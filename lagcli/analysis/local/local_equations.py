"""A model's equations of motion and their derivatives at any point, compiled once."""

from __future__ import annotations

from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
import symengine as se

from lagcli.analysis.local.contacts import ContactEnd, ContactStatus
from lagcli.analysis.local.gradients import (
    Gradients,
    MotionJacobians,
    Point,
    Reactive,
    motion_jacobians,
)
from lagcli.analysis.local.operating_point import Indices, Response, Tangent, tangent_of
from lagcli.arrays import Array, Flags
from lagcli.engine.constraints.index1 import Index1
from lagcli.engine.constraints.initial import ConsistentState
from lagcli.engine.evaluator import Constraints, Dynamics, Evaluator
from lagcli.engine.linear import dense
from lagcli.engine.linear.dense import Decomposition, SingularSystem, decompose
from lagcli.engine.lowering.lower import lower
from lagcli.engine.scales import LEAST_PART, largest, row_lengths
from lagcli.engine.system import State
from lagcli.equations.derivation.lagrange import Equations, derive
from lagcli.errors import NumericalError
from lagcli.model.model import RATE, Model
from lagcli.simulations.start import find_start

if TYPE_CHECKING:
    from symengine import Basic

    from lagcli.engine.system import System


#: Unbalanced forces below this part of the sum of the forces' magnitudes are rounding errors.
_BALANCED = 1e-8
#: Accelerations below this part of the largest, compared by coordinate, are rounding errors.
_CONSTANT = 1e-9
#: Newton's iteration for forces that depend on λ: ends where λ changes by less than this part.
_ITERATIONS, _SETTLED = 30, 1e-14
#: Changes of rows of B below this part of their terms are rounding errors, and so are smaller
#: shares of scaled rows in a sum that vanishes; the rank takes 1e-8.
_CHANGES = 1e-6


class DerivedModel:
    """A model with its equations, their System and its consistent start.

    Equations, System and start may be given if they are known.
    """

    def __init__(
        self,
        model: Model,
        equations: Equations | None = None,
        system: System | None = None,
        start: ConsistentState | None = None,
    ):
        self.model = model
        self.equations: Equations = equations or derive(model)
        self.system: System = system or lower(self.equations)
        self.t = model.settings.t_start or 0.0
        if start is not None:
            self.start = start

    @cached_property
    def start(self) -> ConsistentState:
        """The consistent initial state; raises ModelError or NumericalError if there is none."""
        return find_start(self.equations, self.system, self.t)


class LocalEquations(DerivedModel):
    """The equations of a model with their derivatives, at single points."""

    def __init__(
        self,
        model: Model,
        equations: Equations | None = None,
        system: System | None = None,
        start: ConsistentState | None = None,
    ):
        super().__init__(model, equations, system, start)
        #: The equations of all modes: those of a model that does not switch.
        self.whole: Equations = self.equations
        self.jacobian_tape = motion_jacobians(self.equations, self.system)
        self.p = tuple(model.parameter_values.values())
        self.evaluator_of = lru_cache(maxsize=4)(lambda p: Evaluator(self.system, p))
        self._last: tuple[Point, MotionJacobians] | None = None

    @cached_property
    def _velocity_gradients(self) -> Gradients:
        eq = self.equations
        return Gradients.of(eq, [c.velocity for c in eq.constraints], eq.q)

    @cached_property
    def _entry_gradients(self) -> tuple[list[tuple[int, int]], Gradients]:
        """The places (β, i) of the entries b_βi of B, and their derivatives with respect to q."""
        eq = self.equations
        places = [(k, i) for k, c in enumerate(eq.constraints) for i in c.row]
        entries = [eq.constraints[k].row[i] for k, i in places]
        return places, Gradients.of(eq, entries, eq.q)

    def dependent_only_here(self, point: Point, tangent: Tangent) -> tuple[str, ...]:
        """Return constraints whose rows of B depend on each other at a point, but not beside it.

        Such a point is a singular configuration: with wᵀB = 0 there, Σ w_β ∂b_β/∂q does not vanish
        on the admissible deviations. Some of these are impossible, and the stiffness Σ λ_β ∂b_β/∂q
        depends on which of the λ is taken. Rows that depend on each other everywhere satisfy it.
        """
        d = tangent.decomposition
        if not d.dependent.shape[1]:
            return ()
        places, gradients = self._entry_gradients
        changes = gradients.at(point)
        names = self.system.constraints
        found: set[int] = set()
        shares = np.where(np.abs(d.dependent) > _CHANGES, d.dependent, 0.0)  # of scaled rows
        for w in (shares / d.scale[:, None]).T:
            weights = w / np.abs(w).max()
            change, size = np.zeros((2, len(point.q), len(point.q)))
            for (k, i), row in zip(places, changes, strict=True):
                change[i] += weights[k] * row
                size[i] += np.abs(weights[k] * row)
            left, right = tangent.velocity_basis, tangent.position_basis
            bound = np.abs(left.T) @ size @ np.abs(right)
            if (np.abs(left.T @ change @ right) > _CHANGES * bound).any():
                found.update(np.flatnonzero(weights).tolist())
        return tuple(names[k] for k in sorted(found))

    def express(self, expression: Basic) -> Basic:
        """Return an expression of the whole model in the multipliers of these equations."""
        return expression

    def contacts(self, point: Point) -> tuple[ContactStatus, ...]:
        """Return the states of contacts, limits and friction at a point; empty without them."""
        return ()

    def margins(self, point: Point) -> Array:
        """Return by how much contacts are within their modes, of their scales, (ns,)."""
        return np.empty(0)

    def contact_end(self, row: int) -> tuple[ContactEnd, str]:
        """Return the kind of change of a row that leaves its mode, and its name."""
        raise IndexError(row)  # nothing leaves its mode here

    def reached(self, point: Point, tangent: Tangent) -> Tangent:
        """Return the motions that can be reached from a point as its rows of friction hold."""
        return tangent

    @property
    def whole_system(self) -> System:
        """The System of all modes: that of a model that does not switch."""
        return self.system

    def all_multipliers(self, point: Point) -> Array:
        """Return λ of all constraints of the model, (nc,), of those too that do not hold."""
        return point.multipliers

    @cached_property
    def entering(self) -> tuple[int, ...]:
        """Coordinates on which the equations depend."""
        return entering(self.equations)

    @cached_property
    def angles(self) -> Flags:
        """Which coordinates have the period 2π, (nq,)."""
        return angles(self.equations, self.evaluator(self.p), self.t, self.start.state.q)

    @cached_property
    def lengths(self) -> Array:
        """Large changes of the coordinates, (nq,)."""
        evaluator = self.evaluator(self.p)
        turns = turning(self.equations)
        return lengths(evaluator, self.t, self.start.state.q, self.angles, turns)

    @cached_property
    def unsized(self) -> bool:
        """Whether nothing at the start shows the size of coordinates that are not angles."""
        q = self.start.state.q
        size = largest_size(self.evaluator(self.p), self.t, q, self.angles)
        return not size and not self.angles.all()

    @cached_property
    def least_forces(self) -> Array:
        """Forces that count as zero: a fraction of those at large changes of q, (nq,).

        At an equilibrium the terms of a force may cancel, so that the force has no scale.
        """
        q, zero = self.start.state.q, np.zeros(len(self.equations.q))
        multipliers = np.zeros(len(self.equations.constraints))
        jacobians = self.jacobian_tape.at(Point(self.t, q, zero, zero, multipliers, self.p))
        forcing = self.evaluator(self.p).dynamics(self.t, q, zero).forcing
        forces = np.abs(forcing) + np.abs(jacobians.force_position) @ self.lengths
        return np.asarray(LEAST_PART * np.where(np.isfinite(forces), forces, 0.0))

    @cached_property
    def rate(self) -> float:
        """A rate of the motion, √(stiffness/mass) over large changes of the coordinates, 1/s."""
        state, lengths = self.start.state, self.lengths
        zero = np.zeros(len(lengths))
        mass = self.evaluator(self.p).dynamics(self.t, state.q, zero).mass_matrix
        inertia = (np.abs(np.diag(mass)) * lengths**2).max(initial=0.0)
        energy = float((self.least_forces / LEAST_PART * lengths).max(initial=0.0))
        return float(np.sqrt(energy / inertia)) if inertia > 0.0 and energy > 0.0 else 1.0

    def evaluator(self, p: tuple[float, ...]) -> Evaluator:
        """Return the evaluator of M, f, B, γ, φ and ψ for values of the parameters."""
        return self.evaluator_of(p)

    @cached_property
    def reactive(self) -> Reactive | None:
        """The forces that depend on multipliers, if there are any."""
        forces = self.equations.reactive_forces
        return Reactive(self.equations) if any(x != 0 for x in forces) else None

    def dynamics(self, point: Point) -> Dynamics:
        """Return M, f, B and γ, with the forces that depend on multipliers in f."""
        dynamics = self.evaluator(point.p).dynamics(point.t, point.q, point.v)
        if self.reactive is None:
            return dynamics
        forcing = dynamics.forcing + self.reactive.forces(point)
        return dynamics._replace(forcing=forcing, finite=bool(np.isfinite(forcing).all()))

    def reactions(self, point: Point, jacobian: Array) -> Array:
        """Return the derivatives of the forces with respect to λ, (nq, nc): Bᵀ without friction.

        Raises NumericalError if not finite.
        """
        if self.reactive is None:
            return jacobian.T
        slopes = self.reactive.slopes.at(point)
        self._require_finite(slopes)
        return np.asarray(jacobian.T + slopes)

    def jacobians(self, point: Point) -> MotionJacobians:
        """Return the Jacobians of the equations of motion; raises NumericalError if not finite."""
        if self._last is not None and self._last[0] is point:
            return self._last[1]
        jacobians = self.jacobian_tape.at(point)
        self._require_finite(*jacobians)
        self._last = point, jacobians
        return jacobians

    def _require_finite(self, *derivatives: Array) -> None:
        """Raise NumericalError if derivatives of the equations are not finite."""
        if not np.isfinite(np.concatenate(derivatives, axis=None)).all():
            raise NumericalError(
                f"the derivatives of the equations of {self.model.name} have no finite value at"
                " this point: an expression is not smooth there; choose another point"
            )

    def velocity_gradient(self, point: Point) -> Array:
        """Return ∂ψ/∂q, (nc, nq)."""
        return self._velocity_gradients.at(point)

    def tangent(self, point: Point, preferred: Indices = ()) -> Tangent:
        """Return the tangent space of the constraints at a point."""
        evaluator, rows = self.evaluator(point.p), list(self.system.holonomic)
        c = evaluator.constraints(point.t, point.q, point.v)
        sizes = evaluator.sizes(point.t, point.q, point.v)
        whole = self.decomposition(c, sizes, point.v)
        holonomic = whole
        if len(rows) < len(c.jacobian):
            holonomic = decompose(c.jacobian[rows], scale=whole.scale[rows], sizes=sizes)
        return tangent_of(whole, holonomic, self.velocity_gradient(point), preferred)

    def decomposition(self, c: Constraints[Array], sizes: Array, v: Array) -> Decomposition:
        """Return the decomposition of B.

        The scale of a row is that of the terms of its constraint over large changes of the
        coordinates, so that a row of rounding errors counts as zero.
        """
        rows, reach = list(self.system.holonomic), largest(self.lengths, sizes)
        scale = row_lengths(c.jacobian[rows], sizes, c.position_scale, reach)
        if len(rows) < len(c.jacobian):
            holonomic = scale
            scale = row_lengths(c.jacobian, sizes, c.velocity_scale, largest(v, sizes))
            scale[rows] = holonomic
        return decompose(c.jacobian, scale=scale, sizes=sizes)

    def response(self, point: Point, tangent: Tangent) -> Response:
        """Return the map from right sides to δa and δλ; raises NumericalError if inertia is
        missing."""
        d = self.evaluator(point.p).dynamics(point.t, point.q, point.v)
        mass = d.mass_matrix
        coupled = None
        if self.reactive is not None:
            coupled = d.jacobian, self.reactions(point, d.jacobian)
        try:
            response = Response(mass, tangent, coupled)
            response(np.zeros((len(mass), 1)), np.zeros((len(point.multipliers), 1)))
        except SingularSystem:
            raise NumericalError(
                f"the accelerations of {self.model.name} are not determined at this point: a"
                " motion that the constraints allow has no inertia"
            ) from None
        return response

    def moving(self, state: State, rank: int) -> Point:
        """Return the point of a state, including accelerations and multipliers.

        Raises
        ------
        NumericalError
            They are undefined there.
        """
        index1 = Index1(self.evaluator(state.p), rank)
        index1.measure(state.t, state.q, state.v)
        a, multipliers, _ = index1.accelerations(state.t, state.q, state.v)
        if not np.isfinite(a).all():
            raise NumericalError(
                f"the accelerations of {self.model.name} are undefined at t = {state.t:.6g} s;"
                " choose another state"
            )
        point = Point(state.t, state.q, state.v, a, multipliers, state.p)
        return point if self.reactive is None else self._balanced(point)

    def _balanced(self, point: Point) -> Point:
        """Return the point with the a and λ that the forces that depend on λ give, by Newton."""
        tangent = self.tangent(point)
        for _ in range(_ITERATIONS):
            d = self.dynamics(point)
            unbalanced = d.forcing - d.mass_matrix @ point.a + d.jacobian.T @ point.multipliers
            rates = d.rhs - d.jacobian @ point.a
            da, change = self.response(point, tangent)(unbalanced[:, None], rates[:, None])
            point = point._replace(
                a=point.a + da[:, 0], multipliers=point.multipliers + change[:, 0]
            )
            size = np.abs(point.multipliers).max(initial=0.0)
            if not np.abs(change).max(initial=0.0) > _SETTLED * size:
                return point
        raise NumericalError(
            f"the multipliers of {self.model.name} at t = {point.t:.6g} s were not found: forces"
            " depend on them too strongly"
        )

    def is_steady(self, point: Point, tangent: Tangent) -> bool:
        """Whether the independent velocities are constant, up to rounding errors.

        Their accelerations vanish, and so do the derivatives of these. The equations of first-order
        coordinates leave these no independent velocities; theirs must be constant, too.
        """
        if not self._first_order_steady(point, tangent):
            return False
        j = list(tangent.velocities)
        if not j:
            return True
        d = self.dynamics(point)
        basis = tangent.velocity_basis
        demanded = point.a - basis @ point.a[j]  # given by the constraints alone
        inertial = d.mass_matrix @ demanded
        force = self.force_scale(point, np.abs(inertial))
        unbalanced = np.abs(basis.T @ (d.forcing - inertial))
        if (unbalanced > _BALANCED * (np.abs(basis).T @ force)).any():
            return False
        jerk, bound = self.jerk(point, tangent, force)
        return bool((np.abs(jerk[j]) <= bound[j]).all())

    def _first_order_steady(self, point: Point, tangent: Tangent) -> bool:
        """Whether the velocities of first-order coordinates are zero or constant."""
        names = {c.name for c in self.model.constraints if c.of_coordinate}
        i = [k for k, q in enumerate(self.model.coordinates) if q.name + RATE in names]
        if not i:
            return True
        nq, nc = len(point.q), len(point.multipliers)
        by_rate = np.abs(self.response(point, tangent)(np.zeros((nq, nc)), np.eye(nc))[0])
        c = self.evaluator(point.p).constraints(point.t, point.q, point.v)
        rounding = _BALANCED * (by_rate @ c.velocity_scale)
        if (np.abs(point.v) <= rounding).all():
            return True
        rate = np.abs(point.v / self.lengths).max()
        jerk, bound = self.jerk(point, tangent, self.force_scale(point))
        constant = (np.abs(point.a) <= rate * rounding) & (np.abs(jerk) <= bound)
        return bool(constant[i].all())

    def constant_velocities(self, point: Point) -> Indices:
        """Return the coordinates with constant velocities.

        A motion may be steady only in some: a disk that rolls in a circle.
        """
        size = np.abs(point.a / self.lengths)
        jerk, bound = self.jerk(point, self.tangent(point), self.force_scale(point))
        constant = (size <= _CONSTANT * size.max(initial=0.0)) & (np.abs(jerk) <= bound)
        return tuple(np.flatnonzero(constant).tolist())

    def jerk(self, point: Point, tangent: Tangent, force: Array) -> tuple[Array, Array]:
        """Return the derivatives of the accelerations, and bounds of their rounding errors, (nq,).

        Parameters
        ----------
        point : Point
        tangent : Tangent
        force : (nq,) array
            Sums of the magnitudes of forces.
        """
        jac = self.jacobians(point)
        parts = [
            np.column_stack([by_q * point.v, by_v * point.a, by_t])
            for by_q, by_v, by_t in (
                (jac.force_position, jac.force_velocity, jac.force_time),
                (jac.rhs_position, jac.rhs_velocity, jac.rhs_time),
            )
        ]
        respond = self.response(point, tangent)
        forces, rates = (part.sum(axis=1)[:, None] for part in parts)
        jerk = respond(forces, rates)[0][:, 0]
        # upper bound of the sum of the terms
        nq, nc = len(point.q), len(point.multipliers)
        by_force = np.abs(respond(np.eye(nq), np.zeros((nc, nq)))[0])
        by_rate = np.abs(respond(np.zeros((nq, nc)), np.eye(nc))[0])
        rate = np.abs(point.v / self.lengths).max(initial=0.0)
        bound = by_force @ (np.abs(parts[0]).sum(axis=1) + rate * force)
        bound += by_rate @ np.abs(parts[1]).sum(axis=1)
        return jerk, _BALANCED * bound

    def start_point(self, q: Array, v: Array, multipliers: Array, p: tuple[float, ...]) -> Point:
        """Return a point at the start's time, without accelerations."""
        return Point(self.t, q, v, np.zeros(len(q)), multipliers, p)

    def force_scale(self, point: Point, inertial: Array | None = None) -> Array:
        """Return sums of the magnitudes of the forces on the coordinates, (nq,)."""
        evaluator, d = self.evaluator(point.p), self.dynamics(point)
        force = np.abs(d.forcing) + np.abs(d.jacobian.T) @ np.abs(point.multipliers)
        force += np.abs(d.mass_matrix @ point.a) if inertial is None else inertial
        sizes = evaluator.sizes(point.t, point.q, point.v)
        return shared_scale(np.maximum(force, self.least_forces), sizes)


def shared_scale(force: Array, sizes: Array) -> Array:
    """Return scales of forces that are positive even for coordinates without forces.

    Parameters
    ----------
    force : (nq,) array
        Sums of the magnitudes of the forces on each coordinate.
    sizes : (nq,) array
        Changes of the coordinates that are considered equal in size.
    """
    return np.asarray(np.maximum(force, LEAST_PART * (force * sizes).max(initial=0.0) / sizes))


_TURN = 2 * np.pi
#: Differences below this part of the largest value of a tape are rounding errors.
_SAME = 1e-9
_PROBES = 3


def angles(equations: Equations, evaluator: Evaluator, t: float, q: Array) -> Flags:
    """Return which coordinates have the period 2π, such that M, f, B, γ and φ repeat after a turn.

    Parameters
    ----------
    equations : Equations
    evaluator : Evaluator
    t : float
        s.
    q : (nq,) array
        A state near which the expressions have values.
    """
    nq = len(q)
    random = np.random.default_rng(1)
    periodic = np.zeros(nq, dtype=bool)
    periodic[list(entering(equations))] = True  # an absent coordinate has no period
    for _ in range(_PROBES):
        near = q + 0.3 * random.standard_normal(nq) * np.maximum(1e-3, np.abs(q))
        v = random.standard_normal(nq)
        before = _numbers(evaluator, t, near, v)
        for j in np.flatnonzero(periodic):
            turned = near.copy()
            turned[j] += _TURN
            after = _numbers(evaluator, t, turned, v)
            known = np.isfinite(before) & np.isfinite(after)
            size = np.abs(before[known]).max(initial=0.0) + np.abs(after[known]).max(initial=0.0)
            change = np.abs(after[known] - before[known]).max(initial=0.0)
            periodic[j] = bool(known.any() and change <= _SAME * size)
    return periodic


def _numbers(evaluator: Evaluator, t: float, q: Array, v: Array) -> Array:
    c = evaluator.constraints(t, q, v)
    return np.concatenate([evaluator.entries(t, q, v), c.position, c.drift])


def entering(eq: Equations) -> tuple[int, ...]:
    """Return the coordinates on which the equations depend."""
    expressions = [eq.lagrangian, *eq.applied_forces, *(c.velocity for c in eq.constraints)]
    expressions += [c.position for c in eq.constraints if c.position is not None]
    symbols = set().union(*(e.free_symbols for e in expressions))
    return tuple(j for j, q in enumerate(eq.q) if q in symbols)


def turning(eq: Equations) -> Flags:
    """Return which coordinates occur in sines and cosines, times a number, (nq,).

    They need not have a period: the moment of a torsion spring depends on the number of turns.
    """
    expressions = [eq.lagrangian, *eq.applied_forces]
    expressions += [c.position for c in eq.constraints if c.position is not None]
    arguments = {x.args[0] for e in expressions for x in e.atoms(se.sin, se.cos)}
    return np.array([any(x.diff(q).is_Number and x.diff(q) != 0 for x in arguments) for q in eq.q])


def lengths(evaluator: Evaluator, t: float, q: Array, periodic: Flags, turning: Flags) -> Array:
    """Return large changes of the coordinates, (nq,).

    1 rad for an angle, or more for one without a period. For other coordinates, the size of the
    largest coordinate, compared by inertia, or the size of the constraints' terms if all are zero.
    """
    sizes = evaluator.sizes(t, q, np.zeros(len(q)))
    scales = (largest_size(evaluator, t, q, periodic) or 1.0) * sizes
    scales[periodic] = 1.0
    scales[turning] = np.maximum(scales[turning], 1.0)
    return np.asarray(scales)


def largest_size(evaluator: Evaluator, t: float, q: Array, periodic: Flags) -> float:
    """Return the size of the largest coordinate that is not an angle, compared by inertia.

    That of the constraints' terms if all are zero; 0 without any.
    """
    zero = np.zeros(len(q))
    c = evaluator.constraints(t, q, zero)
    sizes = evaluator.sizes(t, q, zero)
    size = float(np.abs(q / sizes)[~periodic].max(initial=0.0))
    rows = c.jacobian[list(evaluator.system.holonomic)] * sizes
    if not size and len(rows):
        size = float((c.position_scale / dense.row_scale(rows)).max())
    return size
