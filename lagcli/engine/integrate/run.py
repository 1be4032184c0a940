"""A run of a System that does not switch: steps with projection in C, controlled from Python.

The core runs in slices and returns when it is done, when its sample block is full, when a slice is
over (for interrupts, progress and limits), and when a decision is required: a singular
configuration ahead or inside the last step, a state that is not finite, a step size at its minimum.
These are handled in Python.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.contract import (
    Block,
    IntegrationRequest,
    Limits,
    Outcome,
    Stop,
    Undefined,
    breaks_of,
    outcome,
)
from lagcli.engine.core.fields import (
    elimination_fields,
    equations_fields,
    function_fields,
)
from lagcli.engine.core.program import Program
from lagcli.engine.core.run import CoreModel, Integrator
from lagcli.engine.core.settings import core_values
from lagcli.engine.core.status import Status
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.integrate.methods import Methods
from lagcli.engine.integrate.prepared import (
    Prepared,
    explicit_time,
    find_elimination,
    may_unroll,
    prepare,
    recursive,
    unrolled,
)
from lagcli.engine.linear.elimination import unroll
from lagcli.engine.system import State, System

if TYPE_CHECKING:
    from lagcli.engine.constraints.index1 import Index1
    from lagcli.engine.constraints.projection import Projection
    from lagcli.engine.constraints.singular import Ahead, Crossing, RankWatch
    from lagcli.engine.linear.elimination import Elimination
    from lagcli.engine.taylor.series import SeriesProgram


#: Target duration of a slice of steps, s: the latency of an interrupt.
_SLICE = 0.03
#: Initial upper estimate of a step's duration for each operation of the equations, s.
_MOST_SECONDS = 1e-6
#: Largest ratio of successive slices: the first steps are not representative.
_GROWTH = 16
#: Durations of a run: times so far from 0 lack digits of those of its steps.
_FAR = 1e3
#: Steps after which an elimination is unrolled, or the recursive form taken: its program costs as
#: much as it saves in 450 to 700 of them (a ring of 100, a chain of 100, a net of rods).
PROGRAM_STEPS = 500
#: Number of states for an order of elimination; after that, failures use the dense solution.
_MOST_STATES = 20
#: The coordinate that changes fastest, over what the start and its velocities cover, from which
#: it diverges.
_DIVERGED = 1e9
#: Order of the dense matrix from which redundant constraints are left out of an elimination. To
#: find one, and to assemble its program, takes as long as the dense solution of a short run.
LEAST_LEFT_OUT = 40


class Integration:
    """One run: the core, its programs, the sink of its samples, and its decisions.

    Parameters
    ----------
    system, request, sink, progress
        As in the contract.
    for_batch : bool
        Whether the result is used for batches, which do not refine solutions.

    Attributes
    ----------
    in_use : Prepared
        The current method of solving for a and λ; after the run, the last one.
    """

    def __init__(
        self,
        system: System,
        request: IntegrationRequest,
        sink: Callable[[Block], None],
        progress: Callable[[float], None] | None,
        *,
        for_batch: bool = False,
    ):
        self.system, self.request, self.sink = system, request, sink
        self.settings, self.for_batch = request.settings, for_batch
        self.progress = progress or (lambda t: None)
        self.evaluator = Evaluator(system, request.state.p)
        self.nq = len(system.coordinates)
        self.redundant = request.rank < len(system.constraints)
        self.series = self.settings.method == "Taylor"
        self.states: list[State] = [request.state]
        recursive = system.recursive_form is not None and not self.redundant
        self.may_recur = recursive and not for_batch
        prepared = self.prepared()
        self.core = self.integrator(prepared)
        self.note(prepared)
        self.reordered = math.nan
        self.methods = Methods(self.core, system, request, self.no_series)

    def problem(self) -> dict[str, Any]:
        """Return the initial value problem, as for `Integrator`."""
        request, system = self.request, self.system
        start = request.state
        c = self.evaluator.constraint_rows(start.t, start.q, start.v)
        sizes = self.evaluator.sizes(start.t, start.q, start.v)
        return {
            "settings": core_values(self.settings),
            "t": start.t,
            "y": start.y,
            "parameters": start.p,
            "atol": request.tolerances,
            "kind": request.kind_of,
            "rank": request.rank,
            "sizes": sizes,
            "lengths": self.evaluator.row_lengths(start.t, start.q, start.v, c, sizes),
            "plain_lengths": self.evaluator.row_lengths(
                start.t, start.q, start.v, c, np.ones(self.nq)
            ),
            "watching": 0 if not request.rank else 1 if self.crosses else 2,
            "detecting": self.settings.method == "auto" and system.variation is not None,
            "refinable": not self.for_batch,
            "times": request.times,
            "block_rows": max(1, min(request.block_rows, len(request.times))),
            "extra": 0,
            "directions": 0,
        }

    @property
    def crossable(self) -> bool:
        """Whether the run can continue through singular configurations."""
        return True

    @property
    def crosses(self) -> bool:
        """Whether it does."""
        return self.settings.through_singular and self.crossable

    def explicit_time(self) -> Program | None:
        """Return the program of the functions of time that steps resolve."""
        return explicit_time(self.system)

    def integrator(self, prepared: Prepared) -> Integrator:
        """Return the core of the run."""
        breaks = breaks_of(self.system, self.request)
        return Integrator(self.model(prepared), self.problem(), breaks)

    def model(self, prepared: Prepared) -> CoreModel:
        """Return what runs have in common: that of the System's last run, if it was prepared so."""
        last = _last_model(self.system)
        made = last.made  # other threads may replace it
        if made is None or made[0] is not prepared:
            made = last.made = prepared, CoreModel(self.system, **self.parts(prepared))
        return made[1]

    def parts(self, prepared: Prepared) -> dict[str, Any]:
        """Return what runs have in common, as for `model_fields`."""
        system = self.system
        return {
            "equations": equations_fields(system, prepared.constraint),
            "functions": function_fields(system),
            "explicit_time": self.explicit_time(),
            **_tangent(system, prepared),
            **_solution(system, prepared),
        }

    def prepared(self) -> Prepared:
        """Return the initial programs."""
        order, known = self.request.elimination, self.request.prepared
        if self.redundant and not self.may_leave_out:
            order = None
        elif order is None:
            order = self.find_elimination(self.states)
        return self.ready(order, known)

    @property
    def may_leave_out(self) -> bool:
        """Whether redundant constraints may be left out of the elimination.

        Not in small systems, except in batches; without the projection, which shows whether they
        still follow from the others; or if the equations need the multipliers of least norm at each
        evaluation.
        """
        system, nc = self.system, len(self.system.constraints)
        stays = self.settings.formulation == "projection"
        large = self.nq + 2 * nc - self.request.rank >= LEAST_LEFT_OUT
        worth = large or self.for_batch
        return stays and worth and system.tangent is None and system.switching is None

    def find_elimination(
        self, states: Sequence[State], lengths: Array | None = None
    ) -> Elimination | None:
        """Return an order of elimination for some states; None if there is none."""
        return find_elimination(self.evaluator, states, self.request.rank, lengths)

    def ready(self, order: Elimination | None, known: Prepared | None) -> Prepared:
        """Return the programs for an order, or for none; reuse those that do not depend on it."""
        prepared = prepare(self.system, order, known)
        # power series are those of the unrolled operations
        return unrolled(self.system, prepared) if self.series else prepared

    def use(self, prepared: Prepared) -> None:
        """Go on with another method of solving for a and λ."""
        self.give_dynamics(prepared)
        self.note(prepared)

    def note(self, prepared: Prepared) -> None:
        """Keep the method of solving for a and λ that the core uses, and when another one pays."""
        self.in_use = prepared
        # a number of steps, not a time, so that runs are reproducible
        self.unroll_at = math.inf
        recurs = self.may_recur and not prepared.unrolled and prepared.elimination is not None
        if prepared.worth_unrolling or recurs:
            self.unroll_at = self.core.counts[0] + PROGRAM_STEPS
        self.no_series = self.expand(prepared) if self.series else ""

    def for_long_runs(self) -> Prepared:
        """Return the programs that cost more to make and less to run."""
        if may_unroll(self.in_use.elimination):
            return unrolled(self.system, self.in_use)
        found = recursive(self.system, self.in_use)
        self.may_recur = found is not None
        return found or self.in_use

    def give_dynamics(self, prepared: Prepared) -> None:
        """Give the core the programs of the dynamics."""
        if prepared.elimination is None:
            self.core.use_dense(prepared.dynamics)
        else:
            self.core.use_elimination(prepared.dynamics, prepared.elimination, prepared.unrolled)
        if prepared.recursive:
            assert prepared.plain is not None
            self.core.use_equations(prepared.plain)

    def expand(self, prepared: Prepared) -> str:
        """Prepare Taylor's method; return why there are no power series, if there are none."""
        program = self.series_program(prepared)
        if isinstance(program, str):
            return program
        self.core.use_series(program)
        return ""

    def series_program(self, prepared: Prepared) -> SeriesProgram | str:
        """Return the program of the power series, or why there is none."""
        from lagcli.engine.taylor.expansion import NotAnalytic
        from lagcli.engine.taylor.series import depending_on_time, expand
        from lagcli.engine.taylor.sizes import order_for

        system = self.system
        if prepared.elimination is None:
            return "their linear system is solved densely"
        if not prepared.unrolled or prepared.recursive:
            return "they are too long"
        staying = self.settings.formulation == "projection"
        working = depending_on_time(system) if staying else range(len(system.constraints))
        left_out = prepared.elimination.left_out(system.motion)
        if system.tangent is None:
            tape = unroll(system, prepared.elimination)
        else:
            from lagcli.engine.linear.one_tape import in_one_tape

            system, tape = in_one_tape(system, prepared.elimination)
        try:
            return expand(system, tape, order_for(self.settings.rtol), working, left_out)
        except NotAnalytic:
            return "functions with kinks or jumps have no power series"

    def reorder(self) -> None:
        """Find an order that also suits the end of the failed step; otherwise solve densely.

        The recursive form is left for good: its order is more delicate than that of M.

        Called only if refined solutions are not accurate enough either.
        """
        core = self.core
        if self.in_use.recursive:
            self.may_recur = False
            self.use(self.in_use._replace(whole=None, recursive=False))
            core.size_again()
            return
        again, self.reordered = self.reordered == core.t, core.t
        if not again and len(self.states) <= _MOST_STATES:
            self.states.append(self.evaluator.state(core.t, *self.split(core.state)))
            self.states.append(self.evaluator.state(core.t_bad, *self.split(core.y_bad)))
            elimination = self.find_elimination(self.states, core.lengths)
            if elimination is None and self.redundant:
                # rows that are independent here may depend on each other there
                self.states = self.states[-1:]
                elimination = self.find_elimination(self.states, core.lengths)
            if not self.in_use.serves(elimination):
                self.use(self.ready(elimination, self.in_use))
                core.size_again()
                return
        core.allow_dense(1)
        core.size_again()

    # created on demand: most runs need none of these

    @cached_property
    def ranked(self) -> System:
        """The System whose rank is watched: that of the motion, if derivatives do not matter.

        B of each derivative is that of the motion. Derivatives grow without limit towards a
        singular configuration, so that their path does not show it.
        """
        return self.system if self.redundant or self.crosses else self.system.motion

    def ranked_part(self, y: Array) -> Array:
        """Return the part of a state that belongs to `ranked`."""
        n = len(self.ranked.coordinates)
        if n == self.nq:
            return y
        return np.concatenate([y[:n], y[self.nq : self.nq + n], y[-1:]])

    @cached_property
    def motion(self) -> Index1:
        """The right-hand side of `ranked` in Python, for rare cases."""
        from lagcli.engine.constraints.index1 import Index1

        start, n = self.request.state, len(self.ranked.coordinates)
        rank = self.request.rank * n // self.nq
        motion = Index1(Evaluator(self.ranked, start.p), rank)
        motion.measure(start.t, start.q[:n], start.v[:n])
        return motion

    @cached_property
    def ranked_projection(self) -> Projection:
        """The projection of `ranked` in Python."""
        from lagcli.engine.constraints.projection import Projection

        if self.ranked is self.system:
            return self.projection
        return Projection(self.motion.evaluator, self.motion.rank)

    @cached_property
    def projection(self) -> Projection:
        """The projection in Python, for rare cases."""
        from lagcli.engine.constraints.projection import Projection

        return Projection(self.evaluator, self.request.rank)

    @cached_property
    def watch(self) -> RankWatch:
        """The monitor of singular configurations."""
        from lagcli.engine.constraints.singular import RankWatch

        return RankWatch(self.motion)

    def split(self, y: Array) -> tuple[Array, Array]:
        """Return q and v."""
        return y[: self.nq], y[self.nq : 2 * self.nq]

    # the run

    def run(self) -> Outcome:
        """Integrate, once."""
        run = outcome(self.integrate)
        run.message = "; ".join(filter(None, [run.message, self.methods.message()]))
        self.collect()
        run.steps, run.rejected, run.evaluations = self.core.counts
        run.methods, run.tolerances = self.methods.used, self.core.absolute_tolerances
        run.choice = self.methods.choice()
        return run

    def integrate(self) -> None:
        """Integrate; a run that cannot be completed raises `Stop`."""
        core = self.core
        limits = Limits(self.settings)
        self.check_start()
        if self.handle_status(core.start()):
            return
        # a step of a large model may take as long as a slice
        most_seconds = _MOST_SECONDS * (1 + len(self.system.dynamics.code))
        slice_ = min(max(1, int(_SLICE / most_seconds)), _GROWTH)
        report = core.report
        while True:
            steps = report.steps
            limits.check(report.t, steps, self.limited)
            started = time.monotonic()
            until = min(self.settings.max_steps, self.unroll_at) - steps
            most = int(min(slice_, until, self.methods.most_steps(steps)))
            status = core.advance(most)
            taken = time.monotonic() - started
            report = core.report
            self.methods.count(report.steps)
            if self.handle_status(status):
                return
            if status == Status.RUNNING:
                slice_ = max(1, min(_GROWTH * slice_, int(most * _SLICE / max(taken, 1e-6))))
                self.methods.review(report)
                if report.steps >= self.unroll_at:
                    self.use(self.for_long_runs())
            else:
                report = core.report
            self.progress(report.t)

    def limited(self) -> str:
        """Return what limits the steps, as the end of a sentence; empty if it is not known."""
        core = self.core
        entry = core.limiting
        names = self.system.coordinates
        if not 0 <= entry < 2 * self.nq:
            return ""
        name = names[entry] if entry < self.nq else f"{names[entry - self.nq]}'"
        atol = core.absolute_tolerances[entry]
        return f"; the error of `{name}`, whose absolute tolerance is {atol:.2g}, limits the steps"

    def diverging(self) -> str:
        """Return that a coordinate grows without bound, as the end of a sentence, if one does."""
        start, (q, v) = self.request.state, self.split(self.core.state)
        fastest = int(np.argmax(np.abs(v)))
        covered = abs(start.q).max() + abs(start.v).max() * (self.core.t - start.t)
        if not abs(q[fastest]) > _DIVERGED * covered > 0.0:
            return ""
        return (
            f"; it is {q[fastest]:.3g} there: it seems to grow beyond all bounds in a finite time"
        )

    def handle_status(self, status: int) -> bool:
        """Handle a status of the core; return whether the run is complete."""
        core = self.core
        if status == Status.UNDEFINED:
            if not np.isfinite(core.y_bad).all():  # between the ends of a step
                raise Undefined(self.evaluator.state(core.t, *self.split(core.state)))
            state = self.evaluator.state(core.t_bad, *self.split(core.y_bad))
            defined = self.evaluator.dynamics(state.t, state.q, state.v).finite
            if self.reordered != core.t and defined:
                # the equations are defined: a pivot of the static order vanished
                self.reorder()
                return self.handle_status(core.start())
            raise Undefined(state)
        if status in (Status.OFF, Status.JUMPED):
            from lagcli.engine.constraints.branch_cuts import passes_branch_cut

            since, _ = core.step
            before = (since, *self.split(core.dense(since)))
            cut = passes_branch_cut(self.evaluator, before, (core.t_bad, *self.split(core.y_bad)))
            if cut is not None:
                raise cut
        if status == Status.OFF:
            self.projection(core.t_bad, *self.split(core.y_bad))
            raise Stop(
                f"the motion cannot be brought back onto the constraints at t = {core.t_bad:.9g} s;"
                " try a smaller --rtol or --max-step"
            )
        if status == Status.JUMPED:
            from lagcli.engine.constraints.projection import jumped

            q, v = self.split(core.y_bad)
            raise jumped(self.system, core.t_bad, q, self.projection(core.t_bad, q, v)[0])
        if status == Status.FLOOR:
            y, near = self.ranked_part(core.state), core.is_near()
            if self.methods.may_help() and not near:
                self.methods.stiff(forced=True)
                return False
            raise self.far_from_zero() or self.floor(core.t, y, near=near)
        if status == Status.BLOCK_FULL:
            self.collect()
            return False  # in the midst of a step: nothing else changes
        if status == Status.NEAR:
            return self.check_ahead()
        if status == Status.OVER:
            self.check_stepped_over()
        elif status == Status.INACCURATE:
            self.reorder()
        elif status == Status.CONTRADICTED:
            self.check_redundancy()
        elif status == Status.STIFF:
            self.methods.stiff()
        elif status == Status.ORDER:
            self.methods.order()
        return bool(status == Status.DONE)

    def floor(self, t: float, y: Array, *, near: bool) -> Stop:
        """Return the end of a run whose step size fell to the floor."""
        if near:
            return self.watch.floor(t, y)
        _, v = self.motion.split(y)
        fastest = self.ranked.coordinates[int(np.argmax(np.abs(v)))]
        why = (
            "the motion is singular or jumps there"
            if self.settings.method in ("auto", "Radau")
            else "the motion is stiff or singular there; try --method Radau"
        )
        return Stop(
            f"the step size fell to its minimum at t = {t:.9g} s, where `{fastest}` changes fastest"
            f" ({np.abs(v).max():.3g} per second): {why}{self.diverging() or self.limited()}"
        )

    def far_from_zero(self) -> Stop | None:
        """Return the end of a run whose steps are too short where times are far apart."""
        t, length = self.core.t, self.settings.t_end - self.settings.t_start
        if abs(t) <= _FAR * length:
            return None
        return Stop(
            f"the step size fell to its minimum at t = {t:.9g} s, where times differ by"
            f" {np.spacing(abs(t)):.2g} s at least: let the run start nearer to t = 0"
        )

    def check_ahead(self) -> bool:
        """Examine the path of the last steps, which approach a singular configuration."""
        core, watch = self.core, self.watch
        self.measure()
        ahead = watch.ahead(
            [(t, self.ranked_part(y)) for t, y in core.approach()],
            self.last_step,
            self.ranked_projection,
        )
        if ahead is None:
            return False
        if not self.crosses:
            q, v = ahead.path(ahead.singular.time)
            raise watch.stop(ahead.singular, q, v, self.advice(lambda: ahead), core.t)
        crossing = self.crossing(ahead)
        self.collect()
        times = self.request.times
        upto = int(np.searchsorted(times, crossing.end, side="right"))
        due = times[core.times_next : upto]
        for first in range(0, len(due), self.request.block_rows):
            rows = []
            for at in due[first : first + self.request.block_rows]:
                q, v, a, multipliers, work = crossing(at)
                rows.append(np.concatenate([[at], q, v, a, multipliers, [work]]))
            self.emit(np.array(rows))
            self.progress(float(rows[-1][0]))
        core.move(crossing.end, crossing.state, upto)
        return crossing.end >= self.settings.t_end or self.handle_status(core.start())

    def crossing(self, ahead: Ahead) -> Crossing:
        """Return the motion across a singular configuration."""
        from lagcli.engine.constraints.singular import Crossing

        time = ahead.singular.time
        return Crossing(self.motion, self.ranked_projection, ahead.before, time, ahead.path)

    def advice(self, approach: Callable[[], Ahead]) -> str:
        """Return what helps at a singular configuration where the run stops."""
        if not self.crossable:
            return "--through-singular is for models without contacts, limits and events"
        try:
            self.crossing(approach())
        except Stop:
            return "no smooth continuation beyond it has been found"
        return "--through-singular continues through it"

    def measure(self) -> None:
        """Measure B at this state, and get the largest lengths of its rows from the core."""
        motion = self.motion
        motion.measure(self.core.t, *motion.split(self.ranked_part(self.core.state)))
        motion.lengths = np.maximum(motion.lengths, self.core.lengths[: motion.nc])

    def last_step(self, t: float) -> Array:
        """Return the state whose rank is watched at a time in the last step."""
        return self.ranked_part(self.core.dense(t))

    def check_stepped_over(self) -> None:
        """Stop if the last step passed a singular configuration; repeat one that may have."""
        core, path = self.core, self.last_step
        self.measure()
        found = self.watch.singular_time(path, *core.suspect)
        if found is None:
            return
        if not found.certain:
            core.repeat()
            return
        while (status := core.sample_until(found.time)) == Status.BLOCK_FULL:
            self.collect()
            self.progress(core.t)
        self.handle_status(status)
        start, (since, _) = self.request.state, core.step

        def approach() -> Ahead:
            usual = self.watch.weakest(start.t, self.ranked_part(start.y))
            return self.watch.inside(found, path, since, usual, self.ranked_projection)

        q, v = self.motion.split(path(found.time))
        raise self.watch.stop(found, q, v, self.advice(approach))

    def check_start(self) -> None:
        """Stop if the start is singular, or if redundant constraints contradict each other."""
        if self.redundant:
            start = self.request.state
            self.watch.check_start(start.t, start.q, start.v, self.projection)
            self.check_redundancy()

    def check_redundancy(self) -> None:
        """Stop if redundant constraints contradict each other."""
        t, y = self.core.t, self.ranked_part(self.core.state)
        self.measure()
        if self.settings.formulation == "projection":
            self.watch.check_redundancy(t, y)

    # samples

    def collect(self) -> None:
        """Emit the samples in the core's block."""
        rows = self.core.take()
        if len(rows):
            self.emit(rows)

    def emit(self, rows: Array) -> None:
        """Emit samples, given as rows t, q, v, a, λ, W."""
        self.sink(Block.of_rows(rows, self.system.sample_layout))


class _LastModel:
    """What the last run of a System was prepared with, and its model."""

    made: tuple[Prepared, CoreModel] | None = None


@lru_cache(maxsize=4)
def _last_model(system: System) -> _LastModel:
    """Return what the last run was made of; cached for many runs."""
    return _LastModel()


def _solution(system: System, prepared: Prepared) -> dict[str, Any]:
    """Return how a and λ are found, as for `model_fields`."""
    plan, motion = prepared.elimination, system.motion
    if plan is None:
        return {"dynamics": prepared.dynamics}
    left_out = plan.left_out(motion) or None
    if prepared.recursive:
        return {"dynamics": prepared.plain, "unrolled": prepared.whole, "recursive": True}
    if prepared.whole is not None:
        return {"unrolled": prepared.whole, "left_out": left_out}
    elimination = elimination_fields(motion, plan)
    return {"dynamics": prepared.plain, "elimination": elimination, "left_out": left_out}


def _tangent(system: System, prepared: Prepared) -> dict[str, Any]:
    """Return the right sides of derivatives, as for `model_fields`."""
    if system.tangent is None:
        return {}
    blocks, complete = system.tangent.blocks, system.tangent.complete
    return {
        "tangent": prepared.tangent,
        "tangent_blocks": blocks,
        "tangent_complete": complete,
    }
