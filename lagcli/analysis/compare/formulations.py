"""Formulations that only comparisons use: GGL, Maggi's equations, the second kind."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from lagcli.arrays import Array, Indices
from lagcli.engine.constraints.index1 import Index1
from lagcli.engine.contract import Block, IntegrationRequest, Limits, Outcome, Stop, outcome
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.layout import SampleLayout
from lagcli.engine.linear.dense import least_change
from lagcli.engine.system import State

if TYPE_CHECKING:
    from scipy.integrate import DOP853


#: Newton's method for the dependent coordinates: the size of the last change, whose square is the
#: error, and the largest ratio of successive changes.
_SOLVED, _CONTRACTION = 1e-10, 0.5
#: Smallest acceptable singular value of B's dependent columns; below it, others are chosen.
_LEAST_PART = 0.2


class Formulation(Protocol):
    """A system of ordinary differential equations equivalent to a model's equations."""

    def start(self, state: State) -> Array:
        """Return y at a consistent state."""

    def rate(self, t: float, y: Array) -> Array:
        """Return y'."""

    def state(self, t: float, y: Array) -> tuple[Array, Array]:
        """Return q and v."""

    def accelerations(self, t: float, y: Array) -> tuple[Array, Array]:
        """Return a and λ."""

    def restarted(self, t: float, y: Array) -> Array | None:
        """Return y in other unknowns if recent evaluations found the current ones unsuitable.

        t and y are those before the evaluations.
        """


class StabilizedIndexTwo:
    """The GGL formulation, M q' = M v + Bᵀμ with μ such that φ' = 0.

    q' − v is the solution of [[M, Bᵀ], [B, 0]] [q' − v; −μ] = [0; −ψ(v)], which exists as that for
    the accelerations does, also with coordinates without mass. The rows of nonholonomic constraints
    do not change. The velocities and λ are those of the index-1 form. See Gear, Leimkuhler and
    Gupta (1985), doi:10.1016/0377-0427(85)90008-1.

    Parameters
    ----------
    evaluator : Evaluator
    rank : int
        Rank of B at the start.
    """

    def __init__(self, evaluator: Evaluator, rank: int):
        self._evaluator, self._motion = evaluator, Index1(evaluator, rank)

    def start(self, state: State) -> Array:
        """Return (q, v, 0)."""
        self._motion.measure(state.t, state.q, state.v)
        return state.y

    def rate(self, t: float, y: Array) -> Array:
        """Return (v + M⁻¹Bᵀμ, a, power)."""
        q, v = self._motion.split(y)
        rate = self._motion.rate(t, y)
        held = list(self._evaluator.system.holonomic)
        if held and np.isfinite(rate).all():
            motion = self._motion
            d, c = self._evaluator.dynamics(t, q, v), self._evaluator.constraints(t, q, v)
            slip = np.zeros(motion.nc)
            slip[held] = c.velocity(v)[held]
            rate[: len(q)] += least_change(
                c.jacobian, slip, d.mass_matrix, motion.rank, motion.lengths, motion.sizes
            )
        return rate

    def state(self, t: float, y: Array) -> tuple[Array, Array]:
        """Return q and v."""
        return self._motion.split(y)

    def accelerations(self, t: float, y: Array) -> tuple[Array, Array]:
        """Return a and λ."""
        a, multipliers, _ = self._motion.accelerations(t, *self.state(t, y))
        return a, multipliers

    def restarted(self, t: float, y: Array) -> Array | None:
        """Return None: the unknowns q and v remain."""
        return None


class _Split(NamedTuple):
    """Independent and dependent coordinates, and the rows of B that determine the latter."""

    independent: Indices
    dependent: Indices
    rows: Indices
    pivot: float  # value of `_signed_pivot` when they were chosen


class _Reduced:
    """Common part of Maggi's equations and the second kind: the independent velocities u.

    v = R u + d, and (RᵀMR) u' = Rᵀ(f − M a₀), where a₀ satisfies the constraints with u' = 0; λ
    then follows from the equations of the dependent coordinates.
    """

    def __init__(self, evaluator: Evaluator, rank: int):
        self.evaluator, self.rank = evaluator, rank
        self.nq = len(evaluator.system.coordinates)
        self.split = _Split(np.arange(self.nq), np.arange(0), np.arange(0), 1.0)
        self._sizes = np.ones(self.nq)
        self._least = np.inf

    def choose(self, t: float, q: Array, v: Array) -> None:
        """Choose the dependent coordinates: those that B determines best at a state."""
        self._sizes = self.evaluator.sizes(t, q, v)
        if not self.rank:
            return
        jacobian = self.evaluator.constraints(t, q, v).jacobian * self._sizes
        from scipy.linalg import qr

        _, _, columns = qr(jacobian, pivoting=True)
        dependent = np.sort(columns[: self.rank])
        _, _, rows = qr(jacobian[:, dependent].T, pivoting=True)
        rows = np.sort(rows[: self.rank])
        independent = np.setdiff1d(np.arange(self.nq), dependent)
        signed = _signed_pivot(jacobian[rows], dependent)
        self.split = _Split(independent, dependent, rows, signed)

    def _block(self, jacobian: Array) -> Array:
        """Return B's dependent columns, and record their conditioning."""
        s = self.split
        rows = jacobian[s.rows]
        # if the determinant has changed its sign, it has passed zero
        signed = _signed_pivot(rows * self._sizes, s.dependent)
        self._least = min(self._least, signed / s.pivot)
        return rows[:, s.dependent]

    def _unsuitable(self) -> bool:
        """Return whether the dependent velocities were ill-conditioned since the last call."""
        least, self._least = self._least, np.inf
        return least < _LEAST_PART

    def velocity(self, t: float, q: Array, u: Array) -> Array:
        """Return the v with independent velocities u that satisfies the constraints."""
        s, v = self.split, np.zeros(self.nq)
        v[s.independent] = u
        if self.rank:
            c = self.evaluator.constraints(t, q, v)
            v[s.dependent] = _solve(c.jacobian[np.ix_(s.rows, s.dependent)], -c.velocity(v)[s.rows])
        return v

    def motion(self, t: float, q: Array, v: Array) -> tuple[Array, Array, float]:
        """Return a, λ and the power at a consistent state."""
        s, d = self.split, self.evaluator.dynamics(t, q, v)
        if not self.rank:
            a = _solve(d.mass_matrix, d.forcing)
            return a, np.zeros(0), float(d.power)
        block = self._block(d.jacobian)
        null = np.zeros((self.nq, len(s.independent)))
        null[s.independent, np.arange(len(s.independent))] = 1.0
        null[s.dependent] = -_solve(block, d.jacobian[np.ix_(s.rows, s.independent)])
        particular = np.zeros(self.nq)
        particular[s.dependent] = _solve(block, d.rhs[s.rows])
        a = particular
        if len(s.independent):
            reduced = null.T @ d.mass_matrix @ null
            a = a + null @ _solve(reduced, null.T @ (d.forcing - d.mass_matrix @ particular))
        force = d.mass_matrix @ a - d.forcing
        multipliers = np.zeros(len(d.rhs))
        multipliers[s.rows] = _solve(block.T, force[s.dependent])
        return a, multipliers, float(d.power + multipliers @ (d.jacobian @ v))


class MaggiForm(_Reduced):
    """Maggi's equations for the independent velocities, with q' = v for all coordinates.

    Parameters
    ----------
    evaluator : Evaluator
    rank : int
        Rank of B at the start.
    """

    def start(self, state: State) -> Array:
        """Return (q, u, 0)."""
        self.choose(state.t, state.q, state.v)
        return np.concatenate([state.q, state.v[self.split.independent], [0.0]])

    def state(self, t: float, y: Array) -> tuple[Array, Array]:
        """Return q and v."""
        q = y[: self.nq]
        return q, self.velocity(t, q, y[self.nq : -1])

    def rate(self, t: float, y: Array) -> Array:
        """Return (v, u', power)."""
        q, v = self.state(t, y)
        a, _, power = self.motion(t, q, v)
        return np.concatenate([v, a[self.split.independent], [power]])

    def accelerations(self, t: float, y: Array) -> tuple[Array, Array]:
        """Return a and λ."""
        return self.motion(t, *self.state(t, y))[:2]

    def restarted(self, t: float, y: Array) -> Array | None:
        """Return y with other independent velocities."""
        if not self._unsuitable():
            return None
        q, v = self.state(t, y)
        self.choose(t, q, v)
        return np.concatenate([q, v[self.split.independent], y[-1:]])


class SecondKindForm(_Reduced):
    """Lagrange's equations of the second kind in independent coordinates.

    The dependent coordinates solve the constraints at every evaluation, by Newton's method from
    their last values (Wehage & Haug 1982, doi:10.1115/1.3256318).

    Parameters
    ----------
    evaluator : Evaluator
        All of its constraints are holonomic.
    rank : int
        Rank of B at the start.
    """

    def start(self, state: State) -> Array:
        """Return (independent q, u, 0)."""
        self.choose(state.t, state.q, state.v)
        self._held = list(self.evaluator.system.holonomic)
        self._last = self._anchor = state.q.copy()
        return self._unknowns(state.q, state.v, 0.0)

    def _unknowns(self, q: Array, v: Array, work: float) -> Array:
        s = self.split
        return np.concatenate([q[s.independent], v[s.independent], [work]])

    def state(self, t: float, y: Array) -> tuple[Array, Array]:
        """Return q and v; NaN if Newton's method does not converge near the last solution."""
        n = len(self.split.independent)
        # after a sample early in a step, the state before the step may be closer
        for guess in (self._last, self._anchor):
            q = self._solved(t, y[:n], guess)
            if q is not None:
                self._last = q
                return q, self.velocity(t, q, y[n:-1])
        self._least = 0.0  # a step that reaches this is repeated in other coordinates
        return np.full(self.nq, np.nan), np.full(self.nq, np.nan)

    def _solved(self, t: float, independent: Array, guess: Array) -> Array | None:
        """Return the coordinates near a guess; None if Newton's method does not converge."""
        q, v, s = guess.copy(), np.zeros(self.nq), self.split
        settled = _SOLVED * np.abs(q).max()
        q[s.independent] = independent
        before, moved = np.inf, np.inf if self.rank else 0.0
        # a change that is not much smaller than the previous one may lead to another assembly mode
        while settled < moved <= _CONTRACTION * before:
            c, before = self.evaluator.constraints(t, q, v), moved
            jacobian = c.jacobian[self._held][:, s.dependent]
            change = np.linalg.lstsq(jacobian, c.position, rcond=None)[0]
            q[s.dependent] -= change
            moved = float(np.abs(change).max())
        return q if moved <= settled else None

    def rate(self, t: float, y: Array) -> Array:
        """Return (u, u', power)."""
        q, v = self.state(t, y)
        a, _, power = self.motion(t, q, v)
        free = self.split.independent
        return np.concatenate([v[free], a[free], [power]])

    def accelerations(self, t: float, y: Array) -> tuple[Array, Array]:
        """Return a and λ."""
        return self.motion(t, *self.state(t, y))[:2]

    def restarted(self, t: float, y: Array) -> Array | None:
        """Return y in other independent coordinates."""
        if not self._unsuitable():
            self._anchor = self._last
            return None
        self._last = self._anchor
        q, v = self.state(t, y)
        self.choose(t, q, v)
        return self._unknowns(q, v, float(y[-1]))


def _signed_pivot(rows: Array, dependent: Indices) -> float:
    """Return the least singular value of the dependent columns with the sign of the determinant.

    The rows are first scaled to length one.
    """
    if not np.isfinite(rows).all():
        return 0.0
    block = rows[:, dependent] / np.linalg.norm(rows, axis=1)[:, None]
    sign, _ = np.linalg.slogdet(block)
    return float(sign * np.linalg.svd(block, compute_uv=False)[-1])


def _solve(matrix: Array, right: Array) -> Array:
    """Return the solution of a linear system; NaN if it is singular."""
    try:
        return np.asarray(np.linalg.solve(matrix, right), dtype=float)
    except np.linalg.LinAlgError:
        return np.full_like(right, np.nan)


#: The absolute tolerance, relative to rtol times the largest entry of y.
_ABSOLUTE = 0.1
#: SciPy raises smaller relative tolerances to this value, with a warning.
_LEAST_RTOL = 100 * float(np.finfo(float).eps)

#: Factor of the step after a change of coordinates; shortest step, relative to the time.
_SHORTER, _SHORTEST = 0.5, 1e-12


def integrate(
    formulation: Formulation, request: IntegrationRequest, layout: SampleLayout
) -> tuple[Block, Outcome]:
    """Integrate a formulation.

    Returns
    -------
    samples : Block
        The samples up to the end of the run.
    outcome : Outcome
    """
    run = _SampledRun(formulation, request)
    with np.errstate(all="ignore"):
        ended = outcome(run.integrate)
    ended.steps, ended.evaluations = run.steps, run.evaluations
    return Block.of_rows(np.array(run.rows).reshape(-1, layout.size), layout), ended


class _SampledRun:
    def __init__(self, formulation: Formulation, request: IntegrationRequest):
        self.formulation, self.request = formulation, request
        self.rows: list[Array] = []
        self.steps = self.evaluations = 0
        self._limits = Limits(request.settings)

    def integrate(self) -> None:
        """Integrate until all samples are computed."""
        state, times = self.request.state, self.request.times
        y = self.formulation.start(state)
        if self._reached(times, state.t):
            self._sample(state.t, y)
        solver = self._solver(state.t, y)
        while len(self.rows) < len(times):
            self._limits.check(solver.t, self.steps)
            before, y = solver.t, solver.y.copy()
            message = solver.step()
            changed = self.formulation.restarted(before, y)
            if changed is not None:
                if solver.t - before < _SHORTEST * abs(solver.t):
                    raise Stop(f"no coordinates determine the others at t = {before:.9g} s")
                solver = self._solver(before, changed, _SHORTER * (solver.t - before))
                continue
            if solver.status == "failed" or not np.isfinite(solver.y).all():
                raise Stop(f"{message or 'no finite value'} at t = {solver.t:.9g} s")
            self.steps += 1
            if self._reached(times, solver.t):
                inside = solver.dense_output()
                while self._reached(times, solver.t):
                    at = float(times[len(self.rows)])
                    self._sample(at, inside(at))

    def _reached(self, times: Array, t: float) -> bool:
        return len(self.rows) < len(times) and bool(times[len(self.rows)] <= t)

    def _solver(self, t: float, y: Array, first_step: float | None = None) -> DOP853:
        from scipy.integrate import DOP853

        settings = self.request.settings
        strict = 1 / math.sqrt(len(y))  # limits the largest component, not the root mean square
        size = float(np.abs(y).max()) or 1.0
        return DOP853(
            self._rate,
            t,
            y,
            settings.t_end,
            rtol=max(strict * settings.rtol, _LEAST_RTOL),
            atol=strict * settings.rtol * _ABSOLUTE * size,
            max_step=settings.max_step,
            first_step=first_step,
        )

    def _rate(self, t: float, y: Array) -> Array:
        self.evaluations += 1
        # an earlier stage may be undefined; then repeat the step with a shorter length
        return self.formulation.rate(t, y) if np.isfinite(y).all() else np.full_like(y, np.nan)

    def _sample(self, t: float, y: Array) -> None:
        q, v = self.formulation.state(t, y)
        a, multipliers = self.formulation.accelerations(t, y)
        self.rows.append(np.concatenate([[t], q, v, a, multipliers, y[-1:]]))
