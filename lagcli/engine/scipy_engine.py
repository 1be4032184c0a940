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
from scipy import integrate
from scipy.optimize import minimize_scalar

from lagcli.engine import linear
from lagcli.engine.evaluator import Constraints, Evaluator
from lagcli.engine.run import Request, Run
from lagcli.engine.system import System

Array = NDArray[np.float64]

#: A smallest singular value of the row-scaled B below this marks a singular configuration: nearer
#: to it, λ has lost half its digits.
SINGULAR = 1e-6
#: Places inside a step at which the rank is watched.
_WATCH = (0.25, 0.5, 0.75, 1.0)
#: Newton steps of a projection: from the drift of one step, two reach rounding error.
_PROJECTIONS = 8
#: Residuals are brought below this times the constraint's own scale.
_RESIDUAL = 2e-15
#: In passing a singular configuration, directions of B weaker than this are left uncorrected: a
#: residual of rounding size would move the state by 1e-16 over this.
_WEAK = 1e-4
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
        if not (np.isfinite(d.forcing).all() and np.isfinite(rhs).all()
                and np.isfinite(d.mass_matrix).all() and np.isfinite(d.jacobian).all()):
            self.undefined = (t, q.copy(), v.copy())
            return np.full(self.nq, np.nan), np.full(self.nc, np.nan), math.nan
        try:
            if self.redundant or self.request.through_singular:
                rank = None if self.request.through_singular else self.request.rank
                decomposition = linear.decompose(d.jacobian, rank)
                a, multipliers = linear.solve_redundant(
                    d.mass_matrix, d.forcing, d.jacobian, rhs, decomposition
                )
            else:
                a, multipliers = linear.solve_regular(d.mass_matrix, d.forcing, d.jacobian, rhs)
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
        if self.request.through_singular:
            rank = linear.decompose(jacobian, tolerance=_WEAK).rank
            return linear.least_change(jacobian, residual, mass, rank)
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

    def weakest(self, t: float, y: Array) -> float:
        """Return the singular value that vanishes at a singular configuration."""
        q, v = self.split(y)
        jacobian = self.evaluator.constraints(t, q, v).jacobian
        if not np.isfinite(jacobian).all():
            return 1.0
        return float(linear.singular_values(jacobian)[self.request.rank - 1])

    def watch(
        self, history: list[tuple[float, float]], solution: Callable[[float], Array],
        t_old: float, t_new: float,
    ) -> float | None:
        """Return the time of a singular configuration in the last step, or None."""
        if self.request.rank == 0:
            return None
        for part in _WATCH:
            t = t_old + part * (t_new - t_old)
            history.append((t, self.weakest(t, solution(t))))
        del history[:-5]
        for (t0, s0), (_, s1), (t2, s2) in zip(history, history[1:], history[2:], strict=False):
            if s1 <= s0 and s1 <= s2 and s1 < 0.2:
                low = max(t0, t_old)
                if t2 <= low:
                    continue
                found = minimize_scalar(
                    lambda t: self.weakest(t, solution(t)),
                    bounds=(low, t2),
                    method="bounded",
                    options={"xatol": 1e-10 * (abs(t2) + t2 - low)},
                )
                if found.fun < SINGULAR:
                    return float(found.x)
        return float(t_new) if history[-1][1] < SINGULAR else None

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
        if self.projecting:
            y = self.project(t, y)
        start = self.rhs(t, y)
        if not np.isfinite(start).all():
            raise self.stop_undefined(t, *self.split(y))
        self.check_redundancy(t, y)
        pending = list(request.times[::-1])
        while pending and pending[-1] <= t:
            self.sample(pending.pop(), y)
        solver = self.solver(t, y, None)
        began = time.monotonic()
        history: list[tuple[float, float]] = []
        while solver.status == "running":
            if self.steps >= request.max_steps:
                raise _Stop(
                    f"gave up after {self.steps} steps at t = {t:.9g} s; --max-steps allows more"
                )
            if request.timeout is not None and time.monotonic() - began > request.timeout:
                raise _Stop(f"gave up after {request.timeout:g} s of time at t = {t:.9g} s (--timeout)")
            self.step(solver, t)
            t_old, t, y_new = t, solver.t, solver.y
            dense: list[Callable[[float], Array]] = []

            def solution(at: float, dense: list[Callable[[float], Array]] = dense) -> Array:
                if not dense:
                    dense.append(solver.dense_output())
                return dense[0](at)

            singular = None
            if self.nc and not request.through_singular:
                singular = self.watch(history, solution, t_old, t)
            end = t if singular is None else singular
            while pending and pending[-1] <= end and not (pending[-1] == singular):
                at = pending.pop()
                self.sample(at, y_new if at == t else solution(at))
            if singular is not None:
                raise self.stop_singular(singular, solution(singular))
            y = self.project(t, y_new) if self.projecting else y_new
            if self.steps == 1:
                self.check_rank_rises(t, y)
            if self.steps % 16 == 0 and self.redundant:
                self.check_redundancy(t, y)
            solver = self.restart(solver, t, y)
            self.progress(t)

    def solver(self, t: float, y: Array, first_step: float | None) -> integrate.OdeSolver:
        request = self.request
        method = getattr(integrate, request.method)
        options = {"first_step": first_step} if first_step else {}
        # SciPy judges a step by the root mean square over y; with this factor its largest
        # component obeys the tolerance
        strict = 1 / math.sqrt(len(y))
        if request.formulation == "baumgarte":
            self.alpha = request.alpha if request.alpha is not None else 1.0
            self.beta = request.beta if request.beta is not None else self.alpha
        try:
            return method(
                self.rhs, t, y, request.t_end, rtol=max(strict * request.rtol, _LEAST_RTOL),
                atol=strict * request.atol, max_step=request.max_step, **options,
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
            _, v = self.split(solver.y)
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
            return self.solver(t, y, None) if (moved > 0.1 * allowed).any() else solver
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

    def stop_singular(self, t: float, y: Array) -> _Stop:
        q, v = self.split(y)
        names = ", ".join(self.weak_constraints(t, q, v))
        return _Stop(
            f"singular configuration at t = {t:.9g} s: the constraints {names} become dependent"
            " there and do not determine the motion; --through-singular passes it"
        )

    def weak_constraints(self, t: float, q: Array, v: Array) -> list[str]:
        """Return the constraints that take part in the dependency at a state."""
        jacobian = self.evaluator.constraints(t, q, v).jacobian
        u, _, _ = np.linalg.svd(jacobian / linear.row_scale(jacobian)[:, None])
        parts = np.abs(u[:, self.request.rank - 1 :]).max(axis=1)
        return [n for n, x in zip(self.system.constraints, parts, strict=True) if x > 0.05]

    def check_rank_rises(self, t: float, y: Array) -> None:
        """Stop if the start was singular: B has a higher rank one step later."""
        if not self.redundant or self.request.through_singular:
            return
        q, v = self.split(y)
        values = linear.singular_values(self.evaluator.constraints(t, q, v).jacobian)
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
        if not self.redundant or self.request.through_singular:
            return
        q, v = self.split(y)
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
