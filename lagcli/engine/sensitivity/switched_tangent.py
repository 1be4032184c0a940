"""Runs of the reference engine that propagate derivatives through switching.

Each accepted step is repeated for the motion and its derivatives together, with the modes and
branches of the step. Derivatives jump at instants: see `instant_tangent`.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy import integrate
from scipy.integrate import OdeSolver

from lagcli.arrays import Array, Flags
from lagcli.engine.constraints.singular import Ahead
from lagcli.engine.contract import Block, IntegrationRequest
from lagcli.engine.integrate.instants import InstantResolution
from lagcli.engine.integrate.switched_integration import SwitchedIntegration
from lagcli.engine.sensitivity.changes import Change, DirectionalSystem, PerturbedState
from lagcli.engine.sensitivity.instant_tangent import DifferentiatedResolution
from lagcli.engine.sensitivity.integration import Derivatives
from lagcli.engine.sensitivity.linearized_constraints import (
    positions_on,
    velocities_on,
    velocity_changes,
)
from lagcli.engine.sensitivity.modal_tangent import motion_change, sliding_change
from lagcli.engine.sensitivity.start import StartDerivatives
from lagcli.engine.sensitivity.triggers import InstantTime, instant_time
from lagcli.engine.system import System

#: Relative changes of a row that are rounding errors; relative jumps of accelerations likewise.
_LEAVES, _SMOOTH = 1e-6, 1e-8
#: SciPy raises smaller tolerances to this, with a warning; it divides by absolute tolerances.
_LEAST_RTOL, _LEAST_ATOL = 100 * float(np.finfo(float).eps), 1e-100
#: Tolerance of the derivatives, relative to that of the motion, whose step is given.
_LOOSER = 10.0
#: Methods for stiff motion, and the method that then integrates the derivatives.
_STIFF = ("Radau", "BDF", "LSODA")

Sink = Callable[[Block, Derivatives], None]


class _RepeatedStep(NamedTuple):
    """The motion with its derivatives along one step: from a time, up to the ends of parts."""

    ends: list[float]
    parts: list[Callable[[float], Array]]


class SwitchedTangent(SwitchedIntegration):
    """A run with its derivatives.

    Parameters
    ----------
    system : System
    request : IntegrationRequest
    start : StartDerivatives
        Derivatives of the initial q and v, (n, nq).
    parameters : (n, np) array
        Derivatives of the parameters.
    names : sequence of n str
        Names of the directions, for messages.
    scales : (n,) array
        Scales by which emitted derivatives are divided.
    sink : callable
        Receives blocks of samples, with their derivatives.
    progress : callable, optional

    Attributes
    ----------
    times : list of (n,) arrays
        Derivatives of the times of the log entries.
    notes : list of str
        Notes on where and why derivatives end.
    """

    def __init__(
        self,
        system: System,
        request: IntegrationRequest,
        start: StartDerivatives,
        parameters: Array,
        names: Sequence[str],
        scales: Array,
        sink: Sink,
        progress: Callable[[float], None] | None,
    ):
        self._sink, self.names, self.scales = sink, tuple(names), scales
        super().__init__(system, request, self._emit_both, progress)
        self.directional = DirectionalSystem(self.phases.system, self.frozen)
        n = len(scales)
        branches = len(self.phases.full.p) - parameters.shape[1]
        self.changes = Change(
            np.zeros(n),
            start.q.T.copy(),
            start.v.T.copy(),
            np.concatenate([parameters.T, np.zeros((branches, n))]),
        )
        self.times: list[Array] = []
        self.notes: list[str] = []
        self._derivatives: list[tuple[Array, Array, Array, Array]] = []
        self._step: tuple[float, Array, float] | None = None
        self._solution: _RepeatedStep | None = None
        self._resolution: DifferentiatedResolution | None = None
        self._change = self.changes

    # samples

    def keep(self, t: float, q: Array, v: Array, a: Array, multipliers: Array, work: float) -> None:
        """Add a sample and its derivatives to the pending ones."""
        change = self._on_rows(t, q, v, self._at(t))
        found = motion_change(self._with(change, t, q, v))
        part = change.q, change.v, found.da, self._unique(found.dmultipliers)
        self._derivatives.append(tuple(x / self.scales for x in part))  # type: ignore[arg-type]
        super().keep(t, q, v, a, multipliers, work)

    def _unique(self, multipliers: Array) -> Array:
        """Return λ_θ with NaN for multipliers that are not unique."""
        motion = self.phases.motion
        if motion.redundant:
            parts = motion.decompose(self.phases.full.dynamics(*self._last_state).jacobian)
            loose = np.abs(parts.dependent).max(axis=1, initial=0.0) > _LEAVES
            multipliers[motion.rows[loose]] = np.nan
        return multipliers

    def _emit_both(self, block: Block) -> None:
        count = len(block.time)
        rows, self._derivatives = self._derivatives[:count], self._derivatives[count:]
        self._sink(block, Derivatives(*(np.array(x) for x in zip(*rows, strict=True))))

    # steps

    def accept(self, solver: OdeSolver, t_old: float, y_old: Array) -> tuple[float, Array, bool]:
        """Sample the last step; see the base class."""
        self._step, self._solution = (t_old, y_old, float(solver.t)), None
        t, y, moved = super().accept(solver, t_old, y_old)
        if not moved:
            self.changes = self._on_rows(t, *self.motion.split(y), self._at(t))
        self._step = None
        return t, y, moved

    def consistent(self, t: float, y: Array) -> Array:
        """Return the nearest consistent state; see the base class."""
        self.directional.hold(t)
        return super().consistent(t, y)

    def _at(self, t: float) -> Change:
        """Return the change of the state at a time of the last step."""
        if self._step is None or t == self._step[0]:
            return self.changes
        if self._solution is None:
            self._solution = self._repeat(*self._step)
        live = self._live
        if not live.any():
            return self.changes
        nq, n = self.motion.nq, int(live.sum())
        inside = self._solution.parts[bisect_left(self._solution.ends, t)]
        found = inside(t)[2 * nq :].reshape(2, nq, n)
        q, v = self.changes.q.copy(), self.changes.v.copy()
        q[:, live], v[:, live] = found
        return self.changes._replace(q=q, v=v)

    @property
    def _live(self) -> Flags:
        """Return which directions have derivatives."""
        return np.asarray(np.isfinite(self.changes.q).all(0) & np.isfinite(self.changes.v).all(0))

    def _repeat(self, t: float, y: Array, end: float) -> _RepeatedStep:
        """Integrate the motion with its derivatives over a step."""
        live, nq = self._live, self.motion.nq
        n = int(live.sum())
        if not n:
            return _RepeatedStep([], [])
        nothing, p = np.zeros(n), self.changes.p[:, live]

        def rate(at: float, z: Array) -> Array:
            q, v = z[:nq], z[nq : 2 * nq]
            parts = z[2 * nq :].reshape(2, nq, n)
            change = Change(nothing, parts[0], parts[1], p)
            found = motion_change(self._with(change, at, q, v))
            return np.concatenate([v, found.a, parts[1].ravel(), found.da.ravel()])

        begin = np.concatenate(
            [y[: 2 * nq], self.changes.q[:, live].ravel(), self.changes.v[:, live].ravel()]
        )
        assert self.sizes is not None
        # zero derivatives have no size
        own = np.maximum(self.sizes.tolerances[: 2 * nq], _LEAST_ATOL)
        strict = 1 / math.sqrt(len(begin))
        allowed = [own, np.repeat(own, n)]
        kind = integrate.Radau if self.settings.method in _STIFF else integrate.DOP853
        solver = kind(
            rate,
            t,
            begin,
            end,
            rtol=max(_LOOSER * strict * self.settings.rtol, _LEAST_RTOL),
            atol=strict * np.concatenate(allowed),
            first_step=end - t,
        )
        ends, parts = list[float](), list[Callable[[float], Array]]()
        while solver.status == "running":
            solver.step()
            if solver.status == "failed":
                raise self.floor(solver.t, solver.y[: 2 * nq + 1], " (of the derivatives)")
            ends.append(float(solver.t))
            parts.append(_part(solver))
        return _RepeatedStep(ends, parts)

    def _on_rows(self, t: float, q: Array, v: Array, change: Change) -> Change:
        """Return a change on the linearized active constraints."""
        self._last_state = t, q, v
        held = self.phases.motion.rows.tolist()
        change = positions_on(self._with(change, t, q, v), held)
        change = velocities_on(self._with(change, t, q, v), held)
        branches = self.phases.branches
        if branches is None or branches.slides is None:
            return change
        # on a sliding surface, by a change along the jump
        at = self._with(change, t, q, v)
        found, gap = sliding_change(at), at.along("kinks")[branches.slides]
        return change._replace(v=change.v - np.outer(found.jump, gap / found.rate))

    def _with(self, change: Change, t: float, q: Array, v: Array) -> PerturbedState:
        return PerturbedState(self.directional, self.phases.motion, t, q, v, change)

    def pass_singular(self, ahead: Ahead) -> tuple[float, Array]:
        """Pass a singular configuration, beyond which there are no derivatives."""
        before, reasons = self._live, list[str]()
        self._lose("the motion passes through a singular configuration", reasons)
        self._note(ahead.time, before, reasons)
        return super().pass_singular(ahead)

    # instants

    def resolution(self, t: float, y: Array) -> InstantResolution:
        """Return the resolution of an instant with its derivatives."""
        self._resolution = DifferentiatedResolution(
            self.phases, t, y, self.directional, self._change
        )
        return self._resolution

    def pass_instant(
        self, t: float, y: Array, numbers: Sequence[int], started: bool
    ) -> tuple[Array, str | None]:
        """Resolve an instant; see the base class."""
        q, v = (x.copy() for x in self.motion.split(y))
        run, span = self.phases, self.settings.t_end - self.request.state.t
        n = len(self.scales)
        time = InstantTime(np.zeros(n), {}, "")
        a, left = np.zeros(len(q)), self.changes
        if started:
            left = self._on_rows(t, q, v, self._at(t))
            a = run.motion.accelerations(t, q, v)[0]
            time = instant_time(self._with(left, t, q, v), run, numbers, span)
        self._change = left.moved(time.change, v, a)
        logged = len(run.entries)
        y, stop = super().pass_instant(t, y, numbers, started)
        found = self._resolution
        assert found is not None
        self._step = None
        for entry in run.entries[logged:]:
            own = time.of_events.get(entry.which) if entry.occurrence == "event" else None
            self.times.append((time.change if own is None else own) / self.scales)
        after_q, after_v = self.motion.split(y)
        after_a = self.motion.accelerations(t, after_q, after_v)[0]
        before: Flags = np.asarray(np.isfinite(left.q).all(axis=0))
        reasons = found.reasons
        size = np.abs(a).max(initial=0.0) + np.abs(after_a).max(initial=0.0)
        smooth = np.abs(after_a - a).max(initial=0.0) <= _SMOOTH * size
        if started and smooth and not found.jumped:
            self.changes = left
        else:
            reasons = [*filter(None, [time.reason]), *reasons]
            self.changes = found.change.moved(-time.change, after_v, after_a)._replace(
                t=np.zeros(n)
            )
        if any(x.occurrence == "rest" for x in run.entries[logged:]):
            name = next(x for x in run.entries[logged:] if x.occurrence == "rest").which
            self._lose(
                f"infinitely many impacts of `{self.system.constraints[name]}` end there", reasons
            )
        self._check_rows(t, after_q, after_v, reasons, started)
        self._note(t, before, reasons)
        return y, stop

    def _check_rows(self, t: float, q: Array, v: Array, reasons: list[str], started: bool) -> None:
        """End derivatives that leave a row that is active from an instant on."""
        run, held = self.phases, self.phases.motion.rows.tolist()
        if not held:
            return
        change, system = self.changes, run.system
        at = self._with(change, t, q, v)
        jacobian = np.abs(run.full.constraints(t, q, v).jacobian)
        position, velocity = at.constraints().position, velocity_changes(at)
        for row in held:
            off = np.abs(velocity[row]) > _LEAVES * (jacobian[row] @ np.abs(change.v))
            off &= np.abs(velocity[row]) > _LEAVES * run.problems.velocity_scale[row]
            if row in system.holonomic:
                place = system.holonomic.index(row)
                gap = np.abs(position[place])
                off |= (gap > _LEAVES * (jacobian[row] @ np.abs(change.q))) & (
                    gap > _LEAVES * run.problems.position_scale[place]
                )
            if off.any():
                self._lose(
                    f"`{system.constraints[row]}` holds there only for this value"
                    if not started
                    else f"`{system.constraints[row]}` holds from there on within a tolerance,"
                    " and not exactly",
                    reasons,
                    off,
                )
        self.changes = self._on_rows(t, q, v, self.changes)

    def _lose(self, reason: str, reasons: list[str], directions: Array | None = None) -> None:
        everywhere = np.ones(len(self.scales), dtype=bool)
        which = everywhere if directions is None else directions
        self.changes = self.changes._replace(
            q=np.where(which, np.nan, self.changes.q), v=np.where(which, np.nan, self.changes.v)
        )
        reasons.append(reason)

    def _note(self, t: float, before: Flags, reasons: list[str]) -> None:
        """Say which directions have lost their derivatives at an instant."""
        lost = before & ~self._live
        if lost.any():
            names = ", ".join(f"`{x}`" for x, gone in zip(self.names, lost, strict=True) if gone)
            why = reasons[0] if reasons else "they have no finite value"
            self.notes.append(f"derivatives by {names} end at t = {t:.9g} s: {why}")


def _part(solver: OdeSolver) -> Callable[[float], Array]:
    """Return the interpolant of a solver's last step."""
    inside, end, reached = solver.dense_output(), solver.t, solver.y.copy()
    return lambda t: reached if t == end else inside(t)
