"""The right-hand side in a mode: active rows, slipping rows, forces that depend on λ.

With F the forces of slipping rows and the generalized forces that depend on λ, a and λ of the
active rows are affine in F, and F = Φ(a, λ) is solved by Newton's iteration, which ends after one
step if Φ is affine.
"""

from __future__ import annotations

import math

import numpy as np

from lagcli.arrays import Array, Indices
from lagcli.engine.constraints.index1 import Index1
from lagcli.engine.evaluator import Dynamics, Evaluator
from lagcli.engine.linear import dense
from lagcli.engine.switching.cones import least_norm_within
from lagcli.engine.switching.reference.branches import Branches
from lagcli.engine.switching.reference.held import HeldEvaluator
from lagcli.engine.switching.reference.tapes import SwitchingTapes
from lagcli.engine.switching.switching import RowMode, SwitchedRow

_ITERATIONS = 30
#: Relative change of the forces at which Newton's iteration has converged.
_CONVERGED = 1e-14
#: Forces below this part of their terms are rounding errors.
_NO_FORCE = 1e-9


class ModalMotion(Index1):
    """The right-hand side of the index-1 form in a mode, with λ of all constraints.

    Parameters
    ----------
    full : Evaluator
    tapes : SwitchingTapes
    rows : sequence of int
        The active constraints.
    modes : (ns,) array of int
        `RowMode` of each switched row.
    rank : int
        Rank of the active rows of B.

    Attributes
    ----------
    margin : float
        Determinant of Newton's iteration at the last state: 1 without friction; the motion is
        determined as long as it does not vanish.
    slipping, limit_of : (n,) arrays of int
        Slipping constraints, and the indices of their limits.
    against : (n,) array
        1 or −1: the ratio of λ to the limit for each of them.
    """

    def __init__(
        self, full: Evaluator, tapes: SwitchingTapes, rows: list[int], modes: Indices, rank: int
    ):
        self.held = HeldEvaluator(full, rows)
        super().__init__(self.held, rank)
        self.full, self.tapes, self.modes = full, tapes, modes
        self.rows = np.array(rows, dtype=np.intp)
        switched = tapes.switching.rows
        slipping = [r for r, mode in zip(switched, modes, strict=True) if RowMode(mode).slips]
        self.slipping = np.array([r.row for r in slipping], dtype=np.intp)
        self.limit_of = np.array([r.limit for r in slipping], dtype=np.intp)
        self.against = np.array(
            [-1.0 if mode == RowMode.FORWARD else 1.0 for mode in modes if RowMode(mode).slips]
        )
        self.cones = [r for r, mode in zip(switched, modes, strict=True) if mode == RowMode.HOLDS]
        self.margin = 1.0
        self.branches: Branches | None = None

    def inputs(
        self, t: float, q: Array, v: Array, a: Array, multipliers: Array
    ) -> tuple[float, ...]:
        """Return the inputs of tapes with a and λ."""
        return (t, *q.tolist(), *v.tolist(), *a.tolist(), *multipliers.tolist(), *self.full.p)

    def accelerations(self, t: float, q: Array, v: Array) -> tuple[Array, Array, float]:
        """Return a, λ of all constraints and the power at a state; NaN if they are undefined."""
        branches = self.branches
        if branches is not None and branches.slides is not None:
            return branches.combined(branches.slides, t, q, v, self.on_branches)
        return self.on_branches(t, q, v)

    def on_branches(self, t: float, q: Array, v: Array) -> tuple[Array, Array, float]:
        """Return the same on the current branches, regardless of a sliding surface."""
        self.evaluations += 1
        full = self.full.dynamics(t, q, v)
        if full.finite:
            d = self.held.of(full)
            rhs = d.rhs if self.damping is None else d.rhs - self._stabilization(t, q, v)
            try:
                a, multipliers, reactive = self._with_forces(t, q, v, full, d, rhs)
            except dense.SingularSystem:
                pass
            else:
                power = float(full.power + multipliers @ (full.jacobian @ v) + reactive @ v)
                if math.isfinite(a.sum()) and math.isfinite(power):
                    return a, multipliers, power
        if np.isfinite(q).all() and np.isfinite(v).all():
            self.undefined = self.full.state(t, q, v)
        nothing = np.full(len(self.full.system.constraints), math.nan)
        return np.full(self.nq, math.nan), nothing, math.nan

    def _with_forces(
        self, t: float, q: Array, v: Array, full: Dynamics, d: Dynamics, rhs: Array
    ) -> tuple[Array, Array, Array]:
        """Return a, λ, and the generalized forces that depend on λ."""
        switching = self.tapes.switching
        ns, nf = len(self.slipping), len(switching.force_coordinates)
        a, held = self._solve(d, rhs)
        multipliers = np.zeros(len(full.rhs))
        multipliers[self.rows] = held
        if ns + nf:
            columns = np.zeros((self.nq, ns + nf))
            columns[:, :ns] = full.jacobian[self.slipping].T
            columns[list(switching.force_coordinates), ns + np.arange(nf)] = 1.0
            nothing = np.zeros(len(rhs))
            parts = [self._solve(d._replace(forcing=x), nothing) for x in columns.T]
            along_a = np.array([x for x, _ in parts]).T
            along = np.zeros((len(multipliers), ns + nf))
            along[self.rows] = np.array([x for _, x in parts]).T
            along[self.slipping, np.arange(ns)] = 1.0
            forces, slopes = np.zeros(ns + nf), np.zeros((ns + nf, len(multipliers)))
            start_a, start = a, multipliers
            for _ in range(_ITERATIONS):
                inputs = self.inputs(t, q, v, a, multipliers)
                limits, reactive = self.tapes.limits(inputs), self.tapes.forces(inputs)
                found = np.concatenate([self.against * limits.kinetic[self.limit_of], reactive[0]])
                slopes[:ns] = self.against[:, None] * limits.kinetic_slopes[self.limit_of]
                slopes[ns:] = reactive.slopes
                newton = np.eye(ns + nf) - slopes @ along
                try:
                    change = np.linalg.solve(newton, found - forces)
                except np.linalg.LinAlgError:
                    raise dense.SingularSystem from None
                forces = forces + change
                a, multipliers = start_a + along_a @ forces, start + along @ forces
                if not np.abs(change).max() > _CONVERGED * np.abs(forces).max():
                    break
            self.margin = float(np.linalg.det(newton))
            generalized = np.zeros(self.nq)
            generalized[list(switching.force_coordinates)] = forces[ns:]
        else:
            generalized = np.zeros(self.nq)
        if self.redundant and self.cones:
            multipliers = self._within_cones(t, q, v, a, multipliers, full)
        return a, multipliers, generalized

    def _within_cones(
        self, t: float, q: Array, v: Array, a: Array, multipliers: Array, full: Dynamics
    ) -> Array:
        """Return the multipliers of least norm within the cones, if the cones are feasible."""
        rows, bounds = self.cone_rows(t, q, v, a, multipliers)
        if (bounds <= 0).all():
            return multipliers
        free = self.free_multipliers(full, self.inputs(t, q, v, a, multipliers))
        if not free.shape[1]:
            return multipliers
        found = least_norm_within(multipliers, free, rows @ free, bounds)
        return multipliers if found is None else found

    def free_multipliers(self, full: Dynamics, inputs: tuple[float, ...]) -> Array:
        """Return the directions in which λ may change without changing forces, (nc, k).

        The friction of slipping rows changes with the λ that limit it.
        """
        parts = self.decompose(full.jacobian[self.rows])
        free = np.zeros((len(full.rhs), parts.dependent.shape[1]))
        free[self.rows] = parts.dependent / parts.scale[:, None]
        if not len(self.slipping):
            return free
        slopes = self.tapes.limits(inputs).kinetic_slopes[self.limit_of]
        free[self.slipping] = self.against[:, None] * (slopes @ free)
        at = full.jacobian[self.slipping]
        _, s, vt = np.linalg.svd(at.T @ free[self.slipping], full_matrices=True)
        size = np.abs(at).max() * np.abs(free).max(initial=0.0)
        return free @ vt[int((s > _NO_FORCE * size).sum()) :].T

    def cone_owners(self) -> list[int]:
        """Return the constraint of each row of `cone_rows`."""
        sides = {0: 2, 1: 1, -1: 1}
        return [r.row for r in self.cones for _ in range(sides[r.sign] if self._bounded(r) else 0)]

    @staticmethod
    def _bounded(row: SwitchedRow) -> bool:
        return bool(row.sign) or row.limit is not None

    def force_terms(self, t: float, q: Array, v: Array) -> Array:
        """Return Σ_β |λ_β b_iβ|."""
        _, multipliers, _ = self.accelerations(t, q, v)
        return np.nan_to_num(np.abs(multipliers) @ np.abs(self.full.dynamics(t, q, v).jacobian))

    def cone_rows(
        self, t: float, q: Array, v: Array, a: Array, multipliers: Array
    ) -> tuple[Array, Array]:
        """Return rows and bounds: a change z of λ satisfies the laws if rows z ≥ bounds."""
        limits = self.tapes.limits(self.inputs(t, q, v, a, multipliers))
        unit = np.eye(len(multipliers))
        rows, bounds = [], []
        for r in self.cones:
            if r.sign:
                rows.append(r.sign * unit[r.row])
                bounds.append(-r.sign * multipliers[r.row])
            elif r.limit is not None:
                for side in (1.0, -1.0):
                    rows.append(limits.static_slopes[r.limit] + side * unit[r.row])
                    bounds.append(-(limits.static[r.limit] + side * multipliers[r.row]))
        return np.array(rows).reshape(-1, len(multipliers)), np.array(bounds)
