"""A run of the reference engine: SciPy's integrators on the index-1 form, with projection.

After each accepted step, and at each sample, the state is projected onto the constraints; the
integrator continues from there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
from scipy import integrate
from scipy.integrate import BDF, LSODA, OdeSolver

from lagcli.arrays import Array
from lagcli.engine.constraints.index1 import Index1
from lagcli.engine.constraints.passage import Crossing
from lagcli.engine.constraints.projection import Projection, is_far, jumped
from lagcli.engine.constraints.singular import Ahead, RankWatch
from lagcli.engine.contract import (
    Block,
    IntegrationRequest,
    Limits,
    Stop,
    Undefined,
    breaks_of,
)
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.integrate.tolerances import Sizes
from lagcli.engine.system import System
from lagcli.settings.methods import METHODS

#: Baumgarte's α = β times the step size, if the user does not set it.
_BAUMGARTE_STEP = 0.1
#: Growth of a tolerance after which LSODA is restarted, because its tolerances are fixed.
_LSODA_GROWTH = 10.0
#: LSODA continues with a drift of this many tolerances; samples are projected in any case.
_LSODA_DRIFT = 10.0
#: SciPy raises smaller tolerances to this, with a warning.
_LEAST_RTOL = 100 * float(np.finfo(float).eps)


class ScipyIntegration:
    """One run: its state, the samples to be emitted, and its statistics."""

    def __init__(
        self,
        system: System,
        request: IntegrationRequest,
        sink: Callable[[Block], None],
        progress: Callable[[float], None] | None,
    ):
        self.system, self.request, self.sink = system, request, sink
        self.settings = request.settings
        self.progress = progress or (lambda t: None)
        self.sizes: Sizes | None = None
        self.prepare(Evaluator(system, request.state.p))
        self.steps = self.rejected = 0
        self.waiting: list[Array] = []  # t, q, v, a, λ, W
        self.sampled = 0
        self.limits = Limits(self.settings)
        self.breaks = breaks_of(system, request)
        if self.settings.formulation == "baumgarte":
            self.damp(1.0 if self.settings.alpha is None else self.settings.alpha)

    def prepare(self, evaluator: Evaluator) -> None:
        """Create the right-hand side, the projection and the monitor of the rank."""
        self.motion = Index1(evaluator, self.request.rank)
        self.projection = Projection(evaluator, self.request.rank)
        self.watch = RankWatch(self.motion)

    def integrate(self) -> None:
        """Integrate to the end; raise `Stop` to end early."""
        request = self.request
        t = request.state.t
        y = self.consistent(t, request.state.y)
        self.watch.check_start(t, *self.motion.split(y), self.projection)
        self.check_redundancy(t, y)
        for at in self.due(t):
            self.sample(at, y)
        if t >= self.settings.t_end:
            return
        self.sizes = Sizes(self.motion, request, y)
        solver = self.solver(t, y)
        self.watch.add(t, y)
        while t < self.settings.t_end:
            self.limits.check(t, self.steps)
            solver.max_step = min(
                self.settings.max_step, self.watch.largest_step()
            )  # LSODA: has no effect
            self.step(solver, t)
            t, y = self.accept(solver, t, y)
            if self.at_break(t):
                y = self.pass_break(t, y)
            else:
                solver = self.go_on(solver, t, y)
                self.watch.add(t, y)
                ahead = self.watch.ahead()
                if ahead is None:
                    self.progress(t)
                    continue
                if not self.settings.through_singular:
                    raise self.watch.stop(ahead.time, *ahead.path(ahead.time))
                t, y = self.pass_singular(ahead)
                y = self.consistent(t, y)
            self.progress(t)
            if t < self.settings.t_end:
                solver = self.solver(t, y)
                self.watch.restart()
                self.watch.add(t, y)

    def consistent(self, t: float, y: Array) -> Array:
        """Return the nearest consistent state, with y' as it is from now on."""
        after, end = int(np.searchsorted(self.breaks, t, side="right")), self.settings.t_end
        self.stop = min(float(self.breaks[after]), end) if after < len(self.breaks) else end
        self.motion.evaluator.hold(t)
        self.motion.measure(t, *self.motion.split(y))
        y = self.project(t, y)
        if not np.isfinite(self.motion.rate(t, y)).all():
            raise Undefined(self.motion.state(t, y))
        return y

    def at_break(self, t: float) -> bool:
        """Return whether a time is one at which y' is not smooth."""
        at = int(np.searchsorted(self.breaks, t))
        return at < len(self.breaks) and bool(self.breaks[at] == t)

    def pass_break(self, t: float, y: Array) -> Array:
        """Return the state from which the integration continues after a break, or stops."""
        y = self.consistent(t, y)
        assert self.sizes is not None
        self.sizes.restart(t, y)
        for at in self.due(t):
            self.sample(at, y)
        return y

    def solver(self, t: float, y: Array) -> OdeSolver:
        """Return an integrator that starts at a state."""
        # SciPy controls the root mean square of the error over y; with this factor its largest
        # component satisfies the tolerance
        strict = 1 / math.sqrt(len(y))
        assert self.sizes is not None
        self.at_construction = self.sizes.tolerances
        method = METHODS[self.settings.method]
        try:
            return getattr(integrate, method.name)(
                self.motion.rate,
                t,
                y,
                self.stop,
                rtol=max(strict * self.settings.rtol, _LEAST_RTOL),
                atol=strict * self.sizes.tolerances,
                max_step=self.settings.max_step,
                first_step=min(
                    self.sizes.first_step(t, y, method.error_order + 1.0), self.stop - t
                ),
            )
        except ValueError as error:  # SciPy's word for NaN in a Jacobian
            raise Undefined(self.motion.state(t, y)) from error

    def step(self, solver: OdeSolver, t: float) -> None:
        """Take one step, or raise an error."""
        motion, evaluations = self.motion, solver.nfev
        motion.undefined = None
        try:
            message = solver.step()
        except (ValueError, np.linalg.LinAlgError):  # NaN in a Jacobian
            raise Undefined(motion.undefined or motion.state(t, solver.y)) from None
        if solver.status != "failed" and np.isfinite(solver.y).all():
            self.steps += 1
            stages = getattr(solver, "n_stages", None)
            if stages:
                self.rejected += max(0, (solver.nfev - evaluations) // stages - 1)
            return
        if motion.undefined is not None:
            raise Undefined(motion.undefined)
        remark = f" ({message})" if message else ""
        raise self.floor(t, solver.y, remark)

    def floor(self, t: float, y: Array, remark: str) -> Stop:
        """Return the end of a run whose step size fell to the floor."""
        return self.watch.floor(t, y, self.settings.method, remark)

    def accept(self, solver: OdeSolver, t_old: float, y_old: Array) -> tuple[float, Array]:
        """Sample the last step, and return the projected state at its end."""
        t, reached = solver.t, solver.y
        made: list[Callable[[float], Array]] = []

        def inside(at: float) -> Array:
            if at == t:
                return reached
            if not made:  # the dense output costs evaluations
                made.append(solver.dense_output())
            return made[0](at)

        over = None
        if not self.settings.through_singular:
            over = self.watch.stepped_over(inside, t_old, y_old, t, reached)
        end = t if over is None else over
        for at in self.due(math.nextafter(end, -math.inf) if self.at_break(end) else end):
            self.sample(at, inside(at))
        if over is not None:
            raise self.watch.stop(over, *self.motion.split(inside(over)))
        y = self.project(t, reached)
        self.motion.measure(t, *self.motion.split(y))
        self.check_redundancy(t, y)
        return t, y

    def go_on(self, solver: OdeSolver, t: float, y: Array) -> OdeSolver:
        """Continue the integrator from the projected state, with the damping of this step."""
        if solver.status != "running":
            return solver
        damped = False
        assert self.sizes is not None
        self.sizes.update(t, y, abs(solver.step_size))
        if isinstance(solver, LSODA):
            if (self.sizes.tolerances > _LSODA_GROWTH * self.at_construction).any():
                return self.solver(t, y)
        else:
            solver.atol = self.sizes.tolerances / math.sqrt(len(y))
        if self.settings.formulation == "baumgarte" and self.settings.alpha is None:
            self.damp(_BAUMGARTE_STEP / abs(solver.step_size))
            damped = True
        if y is solver.y and not damped:
            return solver
        if isinstance(solver, LSODA):
            # its history cannot be changed: it restarts at order one when the drift matters
            moved = np.abs(y - solver.y)[:-1]
            allowed = self.sizes.tolerances[:-1] + self.settings.rtol * np.abs(y[:-1])
            return self.solver(t, y) if (moved > _LSODA_DRIFT * allowed).any() else solver
        if isinstance(solver, BDF):
            solver.D[0] = y
        else:
            solver.f = self.motion.rate(t, y)
        solver.y = y
        return solver

    def damp(self, alpha: float) -> None:
        """Set Baumgarte's α, and β, which equals α unless it is given."""
        beta = self.settings.beta
        self.motion.damping = alpha, alpha if beta is None else beta

    def project(self, t: float, y: Array) -> Array:
        """Return the nearest consistent state; y itself without projection."""
        if self.settings.formulation != "projection" or not self.system.constraints:
            return y
        before, v = self.motion.split(y)
        q, v = self.projection(t, before, v)
        if self.sizes is not None and self.system.holonomic:
            allowed = self.sizes.tolerances[: len(q)] + self.settings.rtol * np.abs(q)
            if is_far(before, q, allowed, self.sizes.largest(), self.motion.sizes):
                raise jumped(self.system, t, before, q)
        return np.concatenate([q, v, y[-1:]])

    def due(self, end: float) -> Iterator[float]:
        """Yield the sample times up to a time that have not been sampled."""
        times = self.request.times
        while self.sampled < len(times) and times[self.sampled] <= end:
            self.sampled += 1
            yield float(times[self.sampled - 1])

    def sample(self, t: float, y: Array) -> None:
        """Add the consistent state at a sample time, with its a and λ."""
        if self.sampled > 1:  # one step may contain more samples than the time limit allows
            self.limits.check_time(t)
            self.progress(t)
        q, v = self.motion.split(self.project(t, y))
        a, multipliers, _ = self.motion.accelerations(t, q, v)
        if not np.isfinite(a).all():
            raise Undefined(self.motion.evaluator.state(t, q, v))
        self.keep(t, q, v, a, multipliers, float(y[-1]))

    def keep(self, t: float, q: Array, v: Array, a: Array, multipliers: Array, work: float) -> None:
        """Add a sample to the pending ones; emit them when they fill a block."""
        self.waiting.append(np.concatenate([[t], q, v, a, multipliers, [work]]))
        if len(self.waiting) == self.request.block_rows:
            self.emit()

    def emit(self) -> None:
        """Emit the complete samples."""
        rows, self.waiting = self.waiting, []
        if rows:
            self.sink(Block.of_rows(np.array(rows), self.system.sample_layout))

    def pass_singular(self, ahead: Ahead) -> tuple[float, Array]:
        """Pass a singular configuration, sampling on the way."""
        crossing = Crossing(self.motion, self.projection, ahead.before, ahead.time, ahead.path)
        for at in self.due(crossing.end):
            self.keep(at, *crossing(at))
        return crossing.end, crossing.state

    def check_redundancy(self, t: float, y: Array) -> None:
        """Stop if redundant constraints contradict each other."""
        if not self.motion.redundant or self.settings.formulation != "projection":
            return  # off the constraints, the combinations of rows do not vanish
        self.watch.check_redundancy(t, y)
