"""Contact problems of a System at one instant: impacts, and the next modes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from lagcli.arrays import Array, Flags, Indices
from lagcli.engine.constraints.index1 import Index1
from lagcli.engine.constraints.projection import Projection
from lagcli.engine.contract import Undefined
from lagcli.engine.evaluator import Dynamics, Evaluator
from lagcli.engine.linear import dense
from lagcli.engine.scales import least_scales
from lagcli.engine.switching.contacts import contact_motions
from lagcli.engine.switching.impacts import (
    ImpactLaw,
    ImpactProblem,
    ImpactStage,
    resolve_impact,
)
from lagcli.engine.switching.problem import ContactLaw, ContactProblem, ContactSolution
from lagcli.engine.switching.reference.coupling import Coupling
from lagcli.engine.switching.reference.held import HeldEvaluator
from lagcli.engine.switching.reference.tapes import SwitchingTapes
from lagcli.engine.switching.stops import (
    gains_energy,
    no_impact,
    no_motion,
    two_motions,
)
from lagcli.engine.switching.switching import RowMode

#: Velocities below this part of a row's scale count as zero; less if the scale includes the
#: acceleration over the whole run.
_RESTS, _HORIZON = 1e-10, 1e-3
#: Limits and forces that are not affine in λ are linearized until they change by less than this.
_ITERATIONS, _SETTLED = 30, 1e-12
#: Gains of energy below this part of the energy in an impact are rounding errors.
_GAIN = 1e-9


class ImpactOutcome(NamedTuple):
    """Result of an impact: v afterwards, impulses and losses of all constraints.

    Parameters
    ----------
    v : (nq,) array
    impulse, loss : (nc,) arrays
    bilateral : list of int
        Participating bilateral constraints, except those that limit friction.
    stages : tuple of ImpactStage
        Linear phases; their rows are indices of constraints.
    """

    v: Array
    impulse: Array
    loss: Array
    bilateral: list[int]
    stages: tuple[ImpactStage, ...]


class NextModes(NamedTuple):
    """Modes from an instant on, with a and λ of all constraints."""

    modes: Indices
    a: Array
    multipliers: Array


class InstantProblems:
    """Sets up and solves the contact problems of a System.

    Parameters
    ----------
    evaluator : Evaluator
    tapes : SwitchingTapes
    closed : float
        Gap below which a contact counts as closed, of its scale.
    law : ImpactLaw
    duration : float
        Duration of the run, s.

    Attributes
    ----------
    active : (ns,) array of bool
        Which switched rows exist.
    """

    def __init__(
        self,
        evaluator: Evaluator,
        tapes: SwitchingTapes,
        closed: float,
        law: ImpactLaw,
        duration: float,
    ):
        self.evaluator, self.tapes, self.closed, self.law = evaluator, tapes, closed, law
        self.system, self.rows = evaluator.system, tapes.switching.rows
        self.duration = duration
        self.active: Flags = np.array([row.active for row in self.rows], dtype=bool)
        nc = len(self.system.constraints)
        switched = {row.row for row in self.rows}
        self._permanent = [i for i in range(nc) if i not in switched]
        self._number = {row.row: k for k, row in enumerate(self.rows)}
        self._place = {row: k for k, row in enumerate(self.system.holonomic)}
        self.position_scale = np.zeros(len(self.system.holonomic))
        self.velocity_scale = np.zeros(nc)
        self.lengths = np.zeros(nc)
        self._sizes: Array | None = None

    # states

    def measure(self, t: float, q: Array, v: Array, motion: Index1) -> None:
        """Record the largest scales of the rows."""
        a, _, _ = motion.accelerations(t, q, v)
        c, d = self.evaluator.constraints(t, q, v), self.evaluator.dynamics(t, q, v)
        inertia = self.system.inertia(np.diag(d.mass_matrix))
        least = least_scales(inertia, c.jacobian, q)[list(self.system.holonomic)]
        self.position_scale = np.maximum.reduce([self.position_scale, c.position_scale, least])
        lengths = self.evaluator.row_lengths(t, q, v, c, self.sizes(t, q, v))
        self.lengths = np.maximum(self.lengths, lengths)
        fall = np.abs(c.jacobian) @ np.abs(a) * _HORIZON * self.duration
        least = least_scales(inertia, c.jacobian, v)
        self.velocity_scale = np.maximum.reduce(
            [self.velocity_scale, c.velocity_scale, least, np.nan_to_num(fall)]
        )

    def sizes(self, t: float, q: Array, v: Array) -> Array:
        """Return comparable changes of the coordinates."""
        if self._sizes is None:
            self._sizes = self.evaluator.sizes(t, q, v)
        return self._sizes

    def gaps(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Return the signed gaps of unilateral rows, and the tolerance below which they are
        closed."""
        position = self.evaluator.constraints(t, q, v).position
        gaps, allowed = np.full(len(self.rows), np.inf), np.zeros(len(self.rows))
        for k, row in enumerate(self.rows):
            if row.sign:
                place = self._place[row.row]
                gaps[k] = row.sign * position[place]
                allowed[k] = self.closed * self.position_scale[place]
        return gaps, allowed

    def rates(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Return ψ of switched rows, signed for unilateral ones, and the tolerance of zero."""
        velocity = self.evaluator.constraints(t, q, v).velocity(v)
        numbers = [row.row for row in self.rows]
        signs = np.array([row.sign or 1 for row in self.rows])
        return signs * velocity[numbers], _RESTS * self.velocity_scale[numbers]

    def held(self, modes: Indices) -> list[int]:
        """Return the active constraints in given modes."""
        some = [r.row for r, mode in zip(self.rows, modes, strict=True) if mode == RowMode.HOLDS]
        return sorted([*self._permanent, *some])

    def bilateral(self) -> list[int]:
        """Return the bilateral constraints that no event has released."""
        some = [
            r.row
            for r, active in zip(self.rows, self.active, strict=True)
            if active and not r.sign and r.limit is None
        ]
        return sorted([*self._permanent, *some])

    def rank(self, t: float, q: Array, v: Array, rows: Sequence[int]) -> int:
        """Return the rank of rows of B."""
        c, sizes, some = self.evaluator.constraints(t, q, v), self.sizes(t, q, v), list(rows)
        lengths = np.maximum(self.lengths, self.evaluator.row_lengths(t, q, v, c, sizes))[some]
        return dense.count_rank(c.jacobian[some], scale=lengths, sizes=sizes) if some else 0

    def dynamics(self, t: float, q: Array, v: Array) -> Dynamics:
        """Return the dynamics, or stop."""
        d = self.evaluator.dynamics(t, q, v)
        if not d.finite:
            raise Undefined(self.evaluator.state(t, q, v))
        return d

    # impacts

    def impact(self, t: float, q: Array, v: Array, contacts: Sequence[int]) -> ImpactOutcome:
        """Return the result of the impact of closed contacts.

        Parameters
        ----------
        contacts : sequence of int
            Indices of switched rows that approach or rest.

        Raises
        ------
        Stop
            The impact would increase the energy, or has no solution.
        """
        d = self.dynamics(t, q, v)
        restitution, friction = self.tapes.impact((t, *q.tolist(), *v.tolist(), *self.evaluator.p))
        unilateral = [k for k, row in enumerate(self.rows) if row.sign]
        bilateral = set(self.bilateral())
        normals = {self.rows[k].row for k in contacts} | bilateral
        limited = [
            k
            for k, row in enumerate(self.rows)
            if row.limit is not None
            and self.active[k]
            and row.normal in normals
            and friction[row.limit] > 0
        ]
        free = sorted(
            {j for k in limited if (j := self.rows[k].normal) in bilateral and j is not None}
        )
        rows = [self.rows[k].row for k in contacts] + [self.rows[k].row for k in limited] + free
        laws = np.array(
            [ContactLaw.UNILATERAL] * len(contacts)
            + [ContactLaw.LIMITED] * len(limited)
            + [ContactLaw.FREE] * len(free)
        )
        signs = np.ones(len(rows))
        signs[: len(contacts)] = [self.rows[k].sign for k in contacts]
        coupling = Coupling(
            d, sorted(bilateral - set(free)), rows, self.sizes(t, q, v), self.lengths
        )
        before = signs * self.evaluator.constraints(t, q, v).velocity(v)[rows]
        coefficients, slopes = np.zeros(len(rows)), np.zeros((len(rows), len(rows)))
        coefficients[: len(contacts)] = [restitution[unilateral.index(k)] for k in contacts]
        for i, k in enumerate(limited, start=len(contacts)):
            normal, limit = self.rows[k].normal, self.rows[k].limit
            assert normal is not None
            slopes[i, rows.index(normal)] = friction[limit]
        matrix = signs[:, None] * coupling.matrix * signs
        problem = ImpactProblem(matrix, before, laws, coefficients, slopes)
        found = resolve_impact(problem, self.law)
        names = [self.system.constraints[self.rows[k].row] for k in contacts]
        if found is None:
            raise no_impact(t, names)
        energy = float(np.abs(found.impulse * before).max(initial=0.0))
        if found.loss.sum() < -_GAIN * energy:
            alike = len(set(coefficients[: len(contacts)])) <= 1
            gain = -float(found.loss.sum())
            raise gains_energy(t, names, gain, self.law, bool(slopes.any()), alike)
        impulse, loss = np.zeros((2, len(self.system.constraints)))
        forces = signs * found.impulse
        impulse[rows], loss[rows] = forces, found.loss
        impulse[coupling.bilateral] += coupling.along_bilateral @ forces
        numbers = np.array(rows, dtype=np.intp)
        stages = tuple(stage._replace(rows=numbers[stage.rows]) for stage in found.stages)
        after = v + coupling.along_q @ forces
        return ImpactOutcome(after, impulse, loss, coupling.bilateral, stages)

    # accelerations

    def modes(
        self,
        t: float,
        q: Array,
        v: Array,
        resting: Sequence[int],
        present: Indices,
        pinned: Mapping[int, ContactLaw],
        guess: Array,
    ) -> NextModes:
        """Return the next modes.

        Parameters
        ----------
        resting : sequence of int
            Indices of the unilateral rows that are closed and at rest.
        present : (ns,) array of int
            Current modes.
        pinned : mapping of int to ContactLaw
            Laws of limited rows that have just reached their limit, or come to rest.
        guess : (nc,) array
            Current λ.

        Raises
        ------
        Stop
            There is no motion, or there are two.
        """
        d = self.dynamics(t, q, v)
        closed = {self.rows[k].row for k in resting}
        limited = [
            k
            for k, row in enumerate(self.rows)
            if row.limit is not None and self.active[k] and self._bears(row.normal, closed)
        ]
        carriers = {
            j
            for i, j in self.tapes.switching.limit_pattern
            if any(self.rows[k].limit == i for k in limited)
        }
        bilateral = set(self.bilateral())
        free = sorted(carriers & bilateral)
        rows = [self.rows[k].row for k in (*resting, *limited)] + free
        rates, zero = self.rates(t, q, v)
        laws = [int(ContactLaw.UNILATERAL)] * len(resting)
        for k in limited:
            moving = ContactLaw.FORWARD if rates[k] > 0 else ContactLaw.BACKWARD
            law = ContactLaw.LIMITED if abs(rates[k]) <= zero[k] else moving
            laws.append(int(pinned.get(k, law)))
        laws += [int(ContactLaw.FREE)] * len(free)
        signs = np.ones(len(rows))
        signs[: len(resting)] = [self.rows[k].sign for k in resting]
        coupling = Coupling(
            d, sorted(bilateral - set(free)), rows, self.sizes(t, q, v), self.lengths
        )
        now = np.array(
            [present[k] for k in (*resting, *limited)] + [int(RowMode.HOLDS)] * len(free)
        )
        multipliers = guess.copy()
        multipliers[[j for j in free if multipliers[j] == 0]] = 1.0
        a = np.zeros(len(q))
        reactive = np.zeros(len(q))
        problem: ContactProblem | None = None
        for _ in range(_ITERATIONS):
            start_a, start, offset = coupling.loaded(d.forcing + reactive)
            inputs = (t, *q.tolist(), *v.tolist(), *a.tolist(), *multipliers.tolist())
            limits = self.tapes.limits((*inputs, *self.evaluator.p))
            n = len(rows)
            static, kinetic = np.zeros((2, n))
            slopes = np.zeros((2, n, n))
            for i, k in enumerate(limited, start=len(resting)):
                limit = self.rows[k].limit
                assert limit is not None
                static[i] = limits.static[limit] - limits.static_slopes[limit] @ multipliers
                kinetic[i] = limits.kinetic[limit] - limits.kinetic_slopes[limit] @ multipliers
                along = np.where(multipliers[rows] < 0, -1.0, 1.0)
                along[: len(resting)] = signs[: len(resting)]
                slopes[0, i] = limits.static_slopes[limit][rows] * along
                slopes[1, i] = limits.kinetic_slopes[limit][rows] * along
            # if a limit is proportional to forces, the rest of its constant part is rounding error
            noise = 1e-14 * np.abs(slopes).sum(axis=2) * np.abs(multipliers).max(initial=1.0)
            static[np.abs(static) <= noise[0]] = 0.0
            kinetic[np.abs(kinetic) <= noise[1]] = 0.0
            problem = ContactProblem(
                signs[:, None] * coupling.matrix * signs,
                signs * offset,
                np.array(laws),
                static,
                kinetic,
                *slopes,
            )
            motions = contact_motions(problem, now)
            if len(motions) != 1:
                names = [self.system.constraints[i] for i in rows]
                failure = no_motion if not motions else two_motions
                raise failure(t, names, problem, motions)
            forces = signs * motions[0].force
            a = start_a + coupling.along_q @ forces
            before, multipliers = multipliers, np.zeros(len(multipliers))
            multipliers[rows] = forces
            multipliers[coupling.bilateral] = start + coupling.along_bilateral @ forces
            inputs = (t, *q.tolist(), *v.tolist(), *a.tolist(), *multipliers.tolist())
            again = self.tapes.forces((*inputs, *self.evaluator.p)).values
            new = np.zeros(len(q))
            new[list(self.tapes.switching.force_coordinates)] = again
            settled = np.abs(new - reactive).max(initial=0) <= _SETTLED * np.abs(d.forcing).max()
            reactive = new
            if settled and (
                not limited or self._predicts(problem, limited, resting, motions[0], inputs)
            ):
                break
            multipliers = np.where(multipliers == 0, before, multipliers)
        modes = np.full(len(self.rows), int(RowMode.OPEN), dtype=np.intp)
        for k, mode in zip((*resting, *limited), motions[0].modes, strict=False):
            modes[k] = mode
        for k, row in enumerate(self.rows):
            if not row.sign and row.limit is None and self.active[k]:
                modes[k] = RowMode.HOLDS
        return NextModes(modes, a, multipliers)

    def _bears(self, normal: int | None, closed: set[int]) -> bool:
        """Return whether the contact of a row's friction is closed, or there is none."""
        if normal is None or normal not in self._number:
            return True
        k = self._number[normal]
        return normal in closed if self.rows[k].sign else bool(self.active[k])

    def _predicts(
        self,
        problem: ContactProblem,
        limited: Sequence[int],
        resting: Sequence[int],
        motion: ContactSolution,
        inputs: tuple[float, ...],
    ) -> bool:
        """Return whether the linearized limits are accurate."""
        limits = self.tapes.limits((*inputs, *self.evaluator.p))
        size = np.abs(motion.force)
        for constant, slopes, values in (
            (problem.static, problem.static_slopes, limits.static),
            (problem.kinetic, problem.kinetic_slopes, limits.kinetic),
        ):
            linear = (constant + slopes @ size)[len(resting) : len(resting) + len(limited)]
            found = values[np.array([self.rows[k].limit for k in limited], dtype=np.intp)]
            if np.abs(linear - found).max() > 1e-9 * (np.abs(found).max() or 1.0):
                return False
        return True

    # projection

    def projected(self, t: float, q: Array, v: Array, modes: Indices) -> tuple[Array, Array]:
        """Return the nearest state on the active rows of given modes."""
        rows = self.held(modes)
        held = HeldEvaluator(self.evaluator, rows)
        return self.projection(held, self.rank(t, q, v, rows))(t, q, v)

    def projection(self, held: HeldEvaluator, rank: int) -> Projection:
        """Return the projection onto rows, with the largest scales so far."""
        found = Projection(held, rank)
        found.position_scale = self.position_scale[held.positions]
        found.velocity_scale = self.velocity_scale[held.rows]
        return found
