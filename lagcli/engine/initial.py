"""Consistent initial state: guesses move until the constraints hold, fixed values stay."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lagcli.engine import linear
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.system import System

Array = NDArray[np.float64]

#: Fixed values may violate a constraint by this much of its scale: they were written with so many
#: digits. The first projection removes it.
ACCEPTED = 1e-10
_REACHED = 1e-14  # of the constraint's scale: where iteration ends
_ITERATIONS = 200


@dataclass(frozen=True)
class ConsistentState:
    """A state on the constraints.

    Parameters
    ----------
    q, v : (nq,) arrays
    rank : int
        Rank of B.
    moved : mapping of str to (float, float)
        What was moved, coordinate or velocity (``phi'``), from where to where.
    """

    q: Array
    v: Array
    rank: int
    moved: Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class Violation:
    """A constraint that does not hold: its name, its residual and that relative to its scale."""

    constraint: str
    residual: float
    relative: float


class NoConsistentState(Exception):
    """No consistent initial state was found.

    Parameters
    ----------
    level : "position" or "velocity"
    violations : list of Violation
    stuck : list of str
        Of the violated constraints' unknowns, those that are fixed.
    contradiction : bool
        Whether the free entries cannot improve the residual at all: the fixed values, or the
        constraints among each other, contradict.
    """

    def __init__(
        self, level: str, violations: list[Violation], stuck: list[str], contradiction: bool
    ):
        super().__init__(level)
        self.level, self.violations = level, violations
        self.stuck, self.contradiction = stuck, contradiction


class UndefinedStart(Exception):
    """The equations have no finite value at the initial state (t, q, v)."""

    def __init__(self, t: float, q: Array, v: Array):
        super().__init__("undefined")
        self.state = (t, q, v)


def consistent_state(
    system: System, t: float, q: Array, v: Array, fixed_q: Array, fixed_v: Array
) -> ConsistentState:
    """Solve for an initial state that satisfies φ = 0 and ψ = 0.

    Positions by damped Gauss–Newton steps of least M-weighted length, then velocities, which enter
    linearly. Where several branches exist, the one nearest the guess is taken.

    Parameters
    ----------
    system : System
    t : float
        s.
    q, v : (nq,) arrays
        Fixed values and guesses.
    fixed_q, fixed_v : (nq,) arrays of bool

    Returns
    -------
    ConsistentState

    Raises
    ------
    NoConsistentState
        With the residuals and what could be freed.
    UndefinedStart
        The equations have no finite value there.
    """
    return _Start(system, t, fixed_q, fixed_v).solve(q, v)


class _Start:
    def __init__(self, system: System, t: float, fixed_q: Array, fixed_v: Array):
        self.system, self.t = system, t
        self.evaluator = Evaluator(system)
        self.fixed_q, self.fixed_v = fixed_q.astype(bool), fixed_v.astype(bool)
        self.holonomic = list(system.holonomic)

    def solve(self, q: Array, v: Array) -> ConsistentState:
        new_q = self.positions(q.copy(), v)
        new_v = self.velocities(new_q, v.copy())
        c = self.evaluator.constraints(self.t, new_q, new_v)
        rank = 0
        if len(c.jacobian):
            lengths = self.evaluator.row_lengths(c, new_q, new_v)
            rank = linear.decompose(c.jacobian, scale=lengths).rank
        moved = {}
        for i, name in enumerate(self.system.coordinates):
            if new_q[i] != q[i]:
                moved[name] = (float(q[i]), float(new_q[i]))
        for i, name in enumerate(self.system.coordinates):
            if new_v[i] != v[i]:
                moved[f"{name}'"] = (float(v[i]), float(new_v[i]))
        return ConsistentState(new_q, new_v, rank, moved)

    def residual(self, q: Array, v: Array) -> tuple[Array, Array, Array]:
        """Return φ, its scale and its Jacobian."""
        c = self.evaluator.constraints(self.t, q, v)
        jacobian = c.jacobian[self.holonomic]
        if not (np.isfinite(c.position).all() and np.isfinite(jacobian).all()):
            raise UndefinedStart(self.t, q, v)
        # where all terms vanish, the coordinates' own size says what is small
        floor = linear.row_scale(jacobian) * (1e-3 + np.abs(q).max(initial=0.0)) * 1e-3
        return c.position, np.maximum(c.position_scale, floor), jacobian

    def positions(self, q: Array, v: Array) -> Array:
        if not self.holonomic:
            return q
        free = np.flatnonzero(~self.fixed_q)
        phi, scale, jacobian = self.residual(q, v)
        for _ in range(_ITERATIONS):
            worst = np.abs(phi / scale).max()
            if worst <= _REACHED or not len(free):
                break
            mass = self.evaluator.dynamics(self.t, q, v).mass_matrix
            weight = mass[np.ix_(free, free)] if np.isfinite(mass).all() else None
            # near a singular point of the free Jacobian a full step would be wild: cut its rank
            part = jacobian[:, free]
            step = linear.least_change(part, phi, weight, linear.decompose(part, tolerance=1e-6).rank)
            # an angle beyond a turn or a length beyond the model's size means a bad direction
            length = np.abs(step).max()
            step *= min(1.0, (1.0 + np.abs(q).max()) / length) if length else 1.0
            trial, improved = self.search(q, v, free, step, phi, scale)
            if not improved:
                break
            q = trial
            phi, scale, jacobian = self.residual(q, v)
        if np.abs(phi / scale).max() > ACCEPTED:
            self.fail("position", phi, scale, jacobian, self.holonomic, self.fixed_q, "")
        return q

    def search(
        self, q: Array, v: Array, free: Array, step: Array, phi: Array, scale: Array
    ) -> tuple[Array, bool]:
        """Halve the step until the residual falls."""
        before = np.linalg.norm(phi / scale)
        for halving in range(30):
            trial = q.copy()
            trial[free] += step * 0.5**halving
            try:
                after = np.linalg.norm(self.residual(trial, v)[0] / scale)
            except UndefinedStart:
                continue
            if after < before:
                return trial, True
        return q, False

    def velocities(self, q: Array, v: Array) -> Array:
        if not self.system.constraints:
            return v
        free = np.flatnonzero(~self.fixed_v)
        for _ in range(3):  # linear: the second and third remove rounding
            c = self.evaluator.constraints(self.t, q, v)
            psi = c.jacobian @ v + c.drift
            if not np.isfinite(psi).all():
                raise UndefinedStart(self.t, q, v)
            floor = linear.row_scale(c.jacobian) * (1e-3 + np.abs(v).max(initial=0.0)) * 1e-3
            scale = np.maximum(c.velocity_scale, floor)
            if np.abs(psi / scale).max() <= _REACHED or not len(free):
                break
            mass = self.evaluator.dynamics(self.t, q, v).mass_matrix
            weight = mass[np.ix_(free, free)] if np.isfinite(mass).all() else None
            part = c.jacobian[:, free]
            v[free] += linear.least_change(part, psi, weight, linear.decompose(part).rank)
        c = self.evaluator.constraints(self.t, q, v)
        psi = c.jacobian @ v + c.drift
        scale = np.maximum(scale, c.velocity_scale)
        if np.abs(psi / scale).max() > ACCEPTED:
            every = list(range(len(self.system.constraints)))
            self.fail("velocity", psi, scale, c.jacobian, every, self.fixed_v, "'")
        return v

    def fail(
        self,
        level: str,
        residual: Array,
        scale: Array,
        jacobian: Array,
        rows: list[int],
        fixed: Array,
        prime: str,
    ) -> None:
        relative = np.abs(residual / scale)
        bad = np.flatnonzero(relative > ACCEPTED)
        names = self.system.constraints
        violations = [
            Violation(names[rows[i]], float(residual[i]), float(relative[i])) for i in bad
        ]
        touched = (np.abs(jacobian[bad]) > 0).any(axis=0)
        stuck = [
            f"{name}{prime}"
            for i, name in enumerate(self.system.coordinates)
            if fixed[i] and touched[i]
        ]
        weights = residual / scale**2
        gradient = np.abs((jacobian * weights[:, None])[:, ~fixed]).sum(axis=0, initial=0.0)
        slope = np.abs(((jacobian * weights[:, None]).sum(axis=0))[~fixed])
        contradiction = bool((slope <= 1e-4 * gradient + 1e-300).all())
        raise NoConsistentState(level, violations, stuck, contradiction)
