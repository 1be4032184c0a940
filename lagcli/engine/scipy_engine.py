"""The reference engine: SciPy's integrators on the index-1 form, with projection.

y = (q, v, W): accelerations come from the constraint equations differentiated twice, W is the work
done on the system. After each accepted step, and at each written sample, the state is brought back
to φ = 0 by the smallest change in the metric of M, and then to ψ = 0 (Hairer & Wanner, Solving
Ordinary Differential Equations II, VII.2).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import integrate, interpolate
from scipy.optimize import minimize_scalar

from lagcli.engine import linear
from lagcli.engine.evaluator import Constraints, Evaluator
from lagcli.engine.run import Request, Run
from lagcli.engine.system import System

Array = NDArray[np.float64]

#: The smallest singular value of the row-scaled B that marks a singular configuration.
SINGULAR = 1e-5
#: Below this value the path ahead is looked at: B still determines λ to ten digits here, and the
#: step sizes have not yet collapsed.
_NEAR = 2e-2
#: Places inside a step at which the rank is watched.
_WATCH = (0.25, 0.5, 0.75, 1.0)
#: Newton steps of a projection: from the drift of one step, two reach rounding error.
_PROJECTIONS = 8
#: Residuals are brought below this times the constraint's own scale.
_RESIDUAL = 2e-15
#: Baumgarte's α = β times the step size, where the user gives none.
_BAUMGARTE_STEP = 0.1
#: SciPy raises smaller ones to this, with a warning.
_LEAST_RTOL = 100 * float(np.finfo(float).eps)
_RHS_LIMIT = 1e-6  # relative defect of B a = γ beyond which redundant constraints contradict


@dataclass
class _Samples:
    """The samples written so far."""

    time: list[float] = field(default_factory=list)
    states: list[tuple[Array, Array, Array, Array, float]] = field(default_factory=list)

    def arrays(self, nq: int, nc: int) -> tuple[Array, ...]:
        shapes = ((nq,), (nq,), (nq,), (nc,), ())
        n = len(self.time)
        columns = [
            np.array([s[k] for s in self.states], dtype=float).reshape(n, *shape)
            for k, shape in enumerate(shapes)
        ]
        return np.array(self.time), *columns


class _Lazy:
    """A step's dense output, made when first asked for."""

    def __init__(self, make: Callable[[], Callable[[float], Array]]):
        self.make = make
        self.made: Callable[[float], Array] | None = None

    def __call__(self, t: float) -> Array:
        if self.made is None:
            self.made = self.make()
        return self.made(t)


class _Stop(Exception):
    """Ends a run; the message is for the user."""

    def __init__(self, message: str, undefined: tuple[float, Array, Array] | None = None):
        super().__init__(message)
        self.undefined = undefined


def run(
    system: System, request: Request, progress: Callable[[float], None] | None = None
) -> Run:
    """Integrate a System; see the contract in `lagcli.engine.run`."""
    return _Integration(system, request, progress).run()


class _Integration:
    def __init__(
        self, system: System, request: Request, progress: Callable[[float], None] | None
    ):
        self.system, self.request = system, request
        self.progress = progress or (lambda t: None)
        self.evaluator = Evaluator(system)
        self.nq, self.nc = len(system.coordinates), len(system.constraints)
        self.holonomic = list(system.holonomic)
        self.redundant = request.rank < self.nc
        self.projecting = request.formulation == "projection"
        self.alpha = self.beta = 0.0
        self.evaluations = self.steps = self.rejected = 0
        self.undefined: tuple[float, Array, Array] | None = None
        self.samples = _Samples()
        self.watched: list[tuple[float, float]] = []
        self.recent: list[tuple[float, Array]] = []
        self.lengths = np.zeros(self.nc)
        self.scale = np.zeros(len(self.holonomic)), np.zeros(self.nc)

    # the right-hand side

    def split(self, y: Array) -> tuple[Array, Array]:
        return y[: self.nq], y[self.nq : 2 * self.nq]

    def accelerations(self, t: float, q: Array, v: Array) -> tuple[Array, Array, float]:
        """Return a, λ and the power at a state; NaN where they are undefined."""
        self.evaluations += 1
        d = self.evaluator.dynamics(t, q, v)
        rhs = d.rhs
        if self.request.formulation == "baumgarte":
            rhs = rhs - self.stabilization(t, q, v)
        try:
            if not math.isfinite(d.mass_matrix.sum() + d.jacobian.sum()):
                raise linear.SingularSystem
            if self.redundant:
                decomposition = linear.decompose(
                    d.jacobian, self.request.rank, scale=self.lengths
                )
                a, multipliers = linear.solve_redundant(
                    d.mass_matrix, d.forcing, d.jacobian, rhs, decomposition
                )
            else:
                a, multipliers = linear.solve_regular(d.mass_matrix, d.forcing, d.jacobian, rhs)
            if not math.isfinite(a.sum()):
                raise linear.SingularSystem
        except linear.SingularSystem:
            self.undefined = (t, q.copy(), v.copy())
            return np.full(self.nq, np.nan), np.full(self.nc, np.nan), math.nan
        power = float(d.power + multipliers @ (d.jacobian @ v))
        return a, multipliers, power

    def stabilization(self, t: float, q: Array, v: Array) -> Array:
        """Return Baumgarte's 2α ψ + β² φ (holonomic) and α ψ (nonholonomic)."""
        c = self.evaluator.constraints(t, q, v)
        velocity = c.jacobian @ v + c.drift
        term = self.alpha * velocity
        term[self.holonomic] += (
            self.alpha * velocity[self.holonomic] + self.beta**2 * c.position
        )
        return term

    def rhs(self, t: float, y: Array) -> Array:
        q, v = self.split(y)
        a, _, power = self.accelerations(t, q, v)
        return np.concatenate([v, a, [power]])

    # projection

    def project(self, t: float, y: Array) -> Array:
        """Return the consistent state next to y."""
        if self.nc == 0:
            return y
        q, v = self.split(y.copy())
        mass = self.evaluator.dynamics(t, q, v).mass_matrix
        if not np.isfinite(mass).all():
            raise self.stop_undefined(t, q, v)
        c = self.project_positions(t, q, v, mass)
        for _ in range(2):
            residual = c.jacobian @ v + c.drift
            if (np.abs(residual) <= _RESIDUAL * self.scale[1]).all():
                break
            v = v + self.change(c.jacobian, residual, mass, holonomic=False)
        return np.concatenate([q, v, y[2 * self.nq :]])

    def project_positions(self, t: float, q: Array, v: Array, mass: Array) -> Constraints:
        """Bring q to φ = 0, in place; return the constraints there."""
        best = np.inf
        for _ in range(_PROJECTIONS):
            c = self.evaluator.constraints(t, q, v)
            self.scale = (
                np.maximum(self.scale[0], c.position_scale),
                np.maximum(self.scale[1], c.velocity_scale),
            )
            if not (np.isfinite(c.position).all() and np.isfinite(c.jacobian).all()):
                raise self.stop_undefined(t, q, v)
            if not self.holonomic:
                return c
            allowed = np.maximum(self.scale[0], 1e-300)
            worst = float((np.abs(c.position) / allowed).max())
            if worst <= _RESIDUAL or worst >= 0.5 * best:
                break
            best = worst
            q += self.change(c.jacobian[self.holonomic], c.position, mass, holonomic=True)
        return c

    def change(self, jacobian: Array, residual: Array, mass: Array, holonomic: bool) -> Array:
        if self.redundant:
            # the rank is that of all rows together; of the holonomic ones alone it is counted
            return linear.least_change(
                jacobian, residual, mass, linear.decompose(jacobian).rank
                if holonomic else self.request.rank,
            )
        return linear.least_change(jacobian, residual, mass, None)

    def stop_undefined(self, t: float, q: Array, v: Array) -> _Stop:
        state = (t, np.array(q), np.array(v))
        return _Stop(f"the equations have no finite value at t = {t:.9g} s", state)

    # singular configurations

    def weakest(self, t: float, q: Array, v: Array) -> float:
        """Return the singular value that vanishes at a singular configuration."""
        jacobian = self.evaluator.constraints(t, q, v).jacobian
        if self.request.rank == 0 or not np.isfinite(jacobian).all():
            return 1.0
        return float(linear.singular_values(jacobian, self.lengths)[self.request.rank - 1])

    def stepped_over(
        self, solution: Callable[[float], Array], t_old: float, t_new: float
    ) -> float | None:
        """Return the time of a singular configuration inside the last step, or None."""
        history = self.watched
        for part in _WATCH:
            t = t_old + part * (t_new - t_old)
            history.append((t, self.weakest(t, *self.split(solution(t)))))
        del history[:-5]
        for (t0, s0), (_, s1), (t2, s2) in zip(history, history[1:], history[2:], strict=False):
            low = max(t0, t_old)
            if s1 <= s0 and s1 <= s2 and s1 < 0.2 and t2 > low:
                found = self.least(lambda t: self.split(solution(t)), low, t2)
                if found is not None:
                    return found
        return None

    def least(
        self, path: Callable[[float], tuple[Array, Array]], low: float, high: float
    ) -> float | None:
        """Return the time between two at which the path is singular, or None."""
        found = minimize_scalar(
            lambda t: self.weakest(t, *path(t)),
            bounds=(low, high),
            method="bounded",
            options={"xatol": 1e-12 * max(abs(high), high - low)},
        )
        return float(found.x) if found.fun < SINGULAR else None

    def ahead(self) -> tuple[float, Callable[[float], tuple[Array, ...]]] | None:
        """Look along the path for a singular configuration that the last steps lead to.

        Returns
        -------
        (time, path) or None
            The configuration's time, and the continuation of q, v, a, λ and W through it: the
            polynomial of the last three states, which keeps the momentum.
        """
        if len(self.recent) < 3 or not self.request.rank:
            return None
        (t0, y0), (t1, y1) = self.recent[-2:]
        before, now = (self.weakest(t, *self.split(y)) for t, y in ((t0, y0), (t1, y1)))
        if not now < min(before, _NEAR):
            return None
        path = self.continuation()
        reach = 3 * now / ((before - now) / (t1 - t0))
        found = self.least(lambda t: path(t)[:2], t1, t1 + reach)
        return None if found is None else (found, path)

    def continuation(self) -> Callable[[float], tuple[Array, ...]]:
        times = [t for t, _ in self.recent]
        motion, rest = [], []
        for t, y in self.recent:
            q, v = self.split(y)
            a, multipliers, power = self.accelerations(t, q, v)
            motion += [q, v, a]
            rest.append(np.concatenate([multipliers, [y[-1]]]))
        q_of = interpolate.KroghInterpolator(np.repeat(times, 3), motion)
        rest_of = interpolate.KroghInterpolator(times, rest)

        def path(t: float) -> tuple[Array, ...]:
            q, v, a = q_of.derivatives(t, 3)
            others = rest_of(t)
            return q, v, a, others[:-1], others[-1:]

        return path

    def pass_singular(
        self, pending: list[float], singular: float, path: Callable[[float], tuple[Array, ...]]
    ) -> tuple[float, Array]:
        """Go through a singular configuration to its mirror image in time, and sample on the way."""
        t = self.recent[-1][0]
        end = min(2 * singular - t, self.request.t_end)
        while pending and pending[-1] <= end:
            at = pending.pop()
            q, v, a, multipliers, work = path(at)
            self.samples.time.append(float(at))
            self.samples.states.append((q, v, a, multipliers, float(work[0])))
        q, v, _, _, work = path(end)
        y = self.project(end, np.concatenate([q, v, work]))
        if np.abs(y[: self.nq] - q).max() > 1e-3 * (1 + np.abs(q).max()):
            raise _Stop(f"the motion cannot be continued through the singular configuration at t = {singular:.9g} s")
        self.recent.clear()
        self.watched.clear()
        return end, y

    # the run

    def run(self) -> Run:
        status, message = "completed", ""
        try:
            self.integrate()
        except _Stop as stop:
            status, message = "failed", str(stop)
            self.undefined = stop.undefined
        except KeyboardInterrupt:
            status, message = "interrupted", "interrupted; the samples so far are kept"
        t, q, v, a, multipliers, work = self.samples.arrays(self.nq, self.nc)
        return Run(
            time=t, q=q, v=v, a=a, multipliers=multipliers, work=work,
            status=status,  # type: ignore[arg-type]
            message=message, steps=self.steps, rejected=self.rejected,
            evaluations=self.evaluations, undefined=self.undefined,
        )

    def integrate(self) -> None:
        request = self.request
        t, y = request.t_start, np.concatenate([request.q, request.v, [0.0]])
        self.measure(t, y)
        if self.projecting:
            y = self.project(t, y)
        start = self.rhs(t, y)
        if not np.isfinite(start).all():
            raise self.stop_undefined(t, *self.split(y))
        self.check_redundancy(t, y)
        pending = list(request.times[::-1])
        while pending and pending[-1] <= t:
            self.sample(pending.pop(), y)
        solver = self.solver(t, y)
        began = time.monotonic()
        while solver.status == "running":
            self.check_limits(t, began)
            self.step(solver, t)
            t_old, t, y_new = t, solver.t, solver.y
            solution = _Lazy(solver.dense_output)
            over = None
            if self.nc and not request.through_singular:
                over = self.stepped_over(solution, t_old, t)
            end = t if over is None else over
            while pending and pending[-1] <= end:
                at = pending.pop()
                self.sample(at, y_new if at == t else solution(at))
            if over is not None:
                raise self.stop_singular(over, *self.split(solution(over)))
            y = self.project(t, y_new) if self.projecting else y_new
            self.measure(t, y)
            if self.steps == 1:
                self.check_rank_rises(t, y)
            if self.steps % 16 == 0:
                self.check_redundancy(t, y)
            solver = self.restart(solver, t, y)
            self.recent = [*self.recent[-2:], (t, y)]
            if (found := self.ahead()) is not None:
                singular, path = found
                if not request.through_singular:
                    raise self.stop_singular(singular, *path(singular)[:2])
                t, y = self.pass_singular(pending, singular, path)
                if t < request.t_end:
                    solver = self.solver(t, y)
                else:
                    break
            self.progress(t)

    def measure(self, t: float, y: Array) -> None:
        """Keep the largest length that each row of B has had."""
        q, v = self.split(y)
        c = self.evaluator.constraints(t, q, v)
        if np.isfinite(c.jacobian).all():
            self.lengths = np.maximum(self.lengths, self.evaluator.row_lengths(c, q, v))

    def check_limits(self, t: float, began: float) -> None:
        request = self.request
        if self.steps >= request.max_steps:
            raise _Stop(
                f"gave up after {self.steps} steps at t = {t:.9g} s; --max-steps allows more"
            )
        if request.timeout is not None and time.monotonic() - began > request.timeout:
            raise _Stop(
                f"gave up after {request.timeout:g} s of time at t = {t:.9g} s; --timeout allows"
                " more"
            )

    def solver(self, t: float, y: Array) -> integrate.OdeSolver:
        request = self.request
        method = getattr(integrate, request.method)
        # SciPy judges a step by the root mean square over y; with this factor its largest
        # component obeys the tolerance
        strict = 1 / math.sqrt(len(y))
        if request.formulation == "baumgarte":
            self.alpha = request.alpha if request.alpha is not None else 1.0
            self.beta = request.beta if request.beta is not None else self.alpha
        try:
            return method(
                self.rhs, t, y, request.t_end, rtol=max(strict * request.rtol, _LEAST_RTOL),
                atol=strict * request.atol, max_step=request.max_step,
            )
        except ValueError as error:
            raise self.stop_undefined(t, *self.split(y)) from error

    def step(self, solver: integrate.OdeSolver, t: float) -> None:
        evaluations = solver.nfev
        try:
            message = solver.step()
        except (ValueError, np.linalg.LinAlgError):  # SciPy's word for NaN in a Jacobian
            raise self.stop_undefined(t, *self.split(solver.y)) from None
        self.steps += 1
        stages = getattr(solver, "n_stages", None)
        if stages:
            self.rejected += max(0, (solver.nfev - evaluations) // stages - 1)
        if solver.status == "failed" or not np.isfinite(solver.y).all():
            self.steps -= 1
            if self.undefined is not None:
                raise self.stop_undefined(*self.undefined)
            q, v = self.split(solver.y)
            if self.weakest(t, q, v) < _NEAR:
                raise self.stop_singular(t, q, v)
            fastest = self.system.coordinates[int(np.argmax(np.abs(v)))]
            raise _Stop(
                f"the step size fell to the floor at t = {t:.9g} s, where `{fastest}` changes"
                f" fastest ({np.abs(v).max():.3g} per second): the motion is stiff or singular"
                f" there; try --method Radau ({message or 'no progress'})"
            )
        self.undefined = None

    def restart(self, solver: integrate.OdeSolver, t: float, y: Array) -> integrate.OdeSolver:
        """Let the integrator go on from the projected state."""
        if solver.status != "running":
            return solver
        if self.request.formulation == "baumgarte" and self.request.alpha is None:
            self.alpha = self.beta = _BAUMGARTE_STEP / abs(solver.step_size)
        if not self.projecting or self.nc == 0:
            return solver
        moved = np.abs(y - solver.y)[: 2 * self.nq]
        if isinstance(solver, integrate.LSODA):
            # its history cannot be moved: it starts again when the drift matters
            allowed = self.request.atol + self.request.rtol * np.abs(y[: 2 * self.nq])
            return self.solver(t, y) if (moved > 0.1 * allowed).any() else solver
        if isinstance(solver, integrate.BDF):
            solver.D[0] = y
        else:
            solver.f = self.rhs(t, y)
        solver.y = y
        return solver

    def sample(self, t: float, y: Array) -> None:
        """Write the consistent state at a sample time, with its a and λ."""
        if self.projecting:
            y = self.project(t, y)
        q, v = self.split(y)
        a, multipliers, _ = self.accelerations(t, q, v)
        if not np.isfinite(a).all():
            raise self.stop_undefined(t, q, v)
        self.samples.time.append(float(t))
        self.samples.states.append((q, v, a, multipliers, float(y[-1])))

    # what can go wrong

    def stop_singular(self, t: float, q: Array, v: Array) -> _Stop:
        names = ", ".join(self.weak_constraints(t, q, v))
        return _Stop(
            f"singular configuration at t = {t:.9g} s: the constraints {names} become dependent"
            " there and do not determine the motion; --through-singular passes it"
        )

    def weak_constraints(self, t: float, q: Array, v: Array) -> list[str]:
        """Return the constraints that take part in the dependency at a state."""
        jacobian = self.evaluator.constraints(t, q, v).jacobian
        u, _, _ = np.linalg.svd(jacobian / self.lengths[:, None])
        parts = np.abs(u[:, self.request.rank - 1 :]).max(axis=1)
        return [n for n, x in zip(self.system.constraints, parts, strict=True) if x > 0.05]

    def check_rank_rises(self, t: float, y: Array) -> None:
        """Stop if the start was singular: B has a higher rank one step later."""
        if not self.redundant or self.request.through_singular:
            return
        q, v = self.split(y)
        values = linear.singular_values(self.evaluator.constraints(t, q, v).jacobian, self.lengths)
        if len(values) > self.request.rank and values[self.request.rank] > SINGULAR:
            self.samples = _Samples()
            names = ", ".join(
                self.weak_constraints(self.request.t_start, self.request.q, self.request.v)
            )
            raise _Stop(
                f"the start is a singular configuration: the constraints {names} are dependent"
                " there and only there; start beside it, or give --through-singular"
            )

    def check_redundancy(self, t: float, y: Array) -> None:
        """Stop if redundant constraints contradict each other."""
        q, v = self.split(y)
        if not self.redundant or self.weakest(t, q, v) < _NEAR:
            return
        d = self.evaluator.dynamics(t, q, v)
        a, _, _ = self.accelerations(t, q, v)
        scale = np.abs(d.rhs).max() + np.abs(d.jacobian @ a).max() + 1e-300
        # with Baumgarte's terms the right side is another one; the contradiction is the same
        defect = d.rhs - d.jacobian @ a
        if self.request.formulation != "baumgarte" and np.abs(defect).max() > max(
            _RHS_LIMIT * scale, 1e-9
        ):
            worst = self.system.constraints[int(np.argmax(np.abs(defect)))]
            raise _Stop(
                f"the redundant constraints contradict each other at t = {t:.9g} s: they cannot"
                f" all hold with `{worst}`"
            )
