"""A run of the core: Python's objects to and from `lagcore.h`, no mathematics."""

from __future__ import annotations

from collections.abc import Callable
from ctypes import (
    addressof,
    byref,
    c_char_p,
    c_double,
    c_int,
    c_int64,
    c_void_p,
)
from typing import TYPE_CHECKING, Any

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.core.fields import (
    elimination_fields,
    jacobian_fields,
    model_fields,
    pivot_fields,
    series_fields,
)
from lagcli.engine.core.library import KERNEL, Functions, check
from lagcli.engine.core.program import Program
from lagcli.engine.core.status import Status
from lagcli.engine.core.structures import (
    Arguments,
    Doubles,
    address,
    copied,
    lag_elimination,
    lag_jacobians,
    lag_model,
    lag_pivots,
    lag_problem,
    lag_report,
    lag_series_program,
)
from lagcli.engine.layout import Counts, SampleLayout

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from lagcli.engine.linear.elimination import Elimination
    from lagcli.engine.linear.sparse import MatrixPattern, PivotOrder
    from lagcli.engine.system import JacobianTapes, System
    from lagcli.engine.taylor.series import SeriesProgram


core = Functions(
    {
        "lag_method_at": (c_void_p, c_int),
        "lag_method_name": (c_char_p, c_void_p),
        "lag_make_simulation": (c_int, c_void_p, c_void_p, c_void_p, c_void_p),
        "lag_destroy_simulation": (None, c_void_p),
        "lag_run_of": (c_void_p, c_void_p),
        "lag_simulate": (c_int, c_void_p, c_int64),
        "lag_let_answer": (None, c_void_p, c_int64),
        "lag_begin_again_here": (None, c_void_p),
        "lag_use_dense": (c_int, c_void_p, c_void_p),
        "lag_use_elimination": (c_int, c_void_p, c_void_p, c_void_p),
        "lag_use_unrolled": (c_int, c_void_p, c_void_p),
        "lag_use_equations": (c_int, c_void_p, c_void_p),
        "lag_leave_out": (c_int, c_void_p, c_void_p),
        "lag_allow_dense": (c_int, c_void_p, c_int64),
        "lag_use_series": (c_int, c_void_p, c_void_p),
        "lag_use_jacobians": (c_int, c_void_p, c_void_p),
        "lag_matrix": (Doubles, c_void_p),
        "lag_use_pivots": (c_int, c_void_p, c_void_p),
        "lag_switch": (c_int, c_void_p, c_void_p),
        "lag_sample_until": (c_int, c_void_p, c_double),
        "lag_take": (c_int64, c_void_p),
        "lag_dense": (None, c_void_p, c_double, c_void_p),
        "lag_is_near": (c_int, c_void_p),
        "lag_approach_of": (c_int, c_void_p, c_void_p),
        "lag_repeat": (None, c_void_p),
        "lag_move": (None, c_void_p, c_double, c_void_p, c_int64),
        "lag_sizes_again": (c_int, c_void_p),
        "lag_report_of": (None, c_void_p, c_void_p),
        "lag_coefficients": (c_int, c_void_p, c_void_p),
    }
)


def _methods() -> tuple[str, ...]:
    names: list[str] = []
    while method := core.lag_method_at(len(names)):
        names.append(core.lag_method_name(method).decode())
    return tuple(names)


#: The methods of the core, DOP853 first.
METHODS = _methods()


#: All that a simulation may return: the caller answers it.
_EVERY_STATUS = sum(1 << status for status in Status)
#: LAG_APPROACH_STATES.
_APPROACH_STATES = 4
#: lag_model_status: there is no memory.
_NO_MEMORY = 9


class CoreModel:
    """What runs of a System have in common, with one way of solving for a and λ.

    Parameters
    ----------
    system : System
    **parts
        As for `model_fields`, without the problem and the breaks.

    Attributes
    ----------
    parts : dict
    record : lag_model
        Filled once: a run adds its problem.
    """

    def __init__(self, system: System, **parts: Any):
        self.system, self.parts = system, parts
        self._given = Arguments()
        self.record = self._given.filled(lag_model, **model_fields(**parts))


class Integrator:
    """Steps with projection on a System; see core/lagmodel.h and core/run.h.

    Parameters
    ----------
    model : CoreModel
    problem : dict
        The fields of `lag_problem`, by their names there. ``parameters`` are the values of all
        parameters of the System; after q, v and W, ``y`` has the derivatives of q and v in
        ``directions``. The number of times, the block and the kernel are added here.
    breaks : (n,) array
        Times at which the right side is not smooth, increasing: steps end there.

    Attributes
    ----------
    block : (block_rows, width) array
        Samples that the core has written.
    orders : list of PivotOrder
        The orders of pivots that have been used.
    """

    _simulation: int | None = None

    def __init__(self, model: CoreModel, problem: dict[str, Any], breaks: Array):
        # the simulation points into the arrays of both
        self._model, self._given = model, Arguments()
        equations = model.record.equations
        self._system = model.system
        self._nq: int = equations.nq
        self._nc: int = equations.nc
        self._n = 2 * self._nq + 1
        self._carried = 2 * self._nq * problem["directions"]
        width = SampleLayout(Counts(self._nq, self._nc)).size + problem["extra"]
        width += problem["directions"] * (3 * self._nq + self._nc + problem["extra"])
        self.block = np.empty((problem["block_rows"], width))
        self._times = int(np.size(problem["times"]))
        made = c_void_p()
        record = self._record(problem, breaks)
        status = core.lag_make_simulation(None, byref(record), METHODS[0].encode(), byref(made))
        check(status == _NO_MEMORY)
        if status:
            raise ValueError(f"the core refuses the problem: lag_model_status {status}")
        self._simulation = made.value
        self._run: int = core.lag_run_of(made)
        core.lag_let_answer(made, _EVERY_STATUS)
        self.orders: list[PivotOrder] = []
        # one record for all: creating one takes longer than filling it
        self._written = lag_report()
        self._written_to = addressof(self._written)

    def _record(self, problem: dict[str, Any], breaks: Array) -> lag_model:
        """Return the model with the problem."""
        record = lag_model.from_buffer_copy(self._model.record)
        record.problem = self._given.filled(lag_problem, **self._complete(problem))
        record.breaks, record.break_count = self._given.doubles(breaks), len(breaks)
        return record

    def _complete(self, problem: dict[str, Any]) -> dict[str, Any]:
        """Return a problem with what is added here."""
        return problem | {
            "parameters": self._system.held_at(problem["t"], problem["parameters"]),
            "times_count": self._times,
            "block": self.block,
            "kernel": KERNEL,
        }

    # an argument, because globals may be gone when the interpreter exits
    def __del__(self, destroy: Any = core.lag_destroy_simulation) -> None:
        if self._simulation:
            destroy(self._simulation)

    def _use(self, function: Callable[..., int], program: Program) -> None:
        """Call a function of the core with a program."""
        given = Arguments()
        check(function(self._run, byref(given.program(program))))

    def use_dense(self, dynamics: Program) -> None:
        """Solve for a and λ densely. Parameters: dynamics, the program of the System's tape."""
        self._use(core.lag_use_dense, dynamics)

    def use_elimination(self, dynamics: Program, plan: Elimination, unrolled: bool) -> None:
        """Solve for a and λ by a static elimination.

        Parameters
        ----------
        dynamics : Program
            Of the System's tape.
        plan : Elimination
        unrolled : bool
            Whether it is appended to the tape.
        """
        given = Arguments()
        left_out = plan.left_out(self._system.motion)
        if left_out:
            check(core.lag_leave_out(self._run, given.integers(left_out)))
        if unrolled:
            self._use(core.lag_use_unrolled, dynamics)
            return
        elimination = given.filled(lag_elimination, **elimination_fields(self._system.motion, plan))
        program = given.program(dynamics)
        check(core.lag_use_elimination(self._run, byref(program), byref(elimination)))

    def use_equations(self, equations: Program) -> None:
        """Take M and f from another program; after `use_elimination`.

        Parameters
        ----------
        equations : Program
            Of the System's dynamics tape.
        """
        self._use(core.lag_use_equations, equations)

    def use_series(self, program: SeriesProgram) -> None:
        """Allow Taylor's method.

        Parameters
        ----------
        program : SeriesProgram
            Of the dynamics that are used.
        """
        given = Arguments()
        record = given.filled(lag_series_program, **series_fields(program))
        self._series_order = program.order
        check(core.lag_use_series(self._run, byref(record)))

    def series(self) -> Array:
        """Return the Taylor coefficients of y = (q, v, W) here, (n, order + 1); NaN without any."""
        coefficients = np.empty((self._n, self._series_order + 1))
        if core.lag_coefficients(self._run, address(coefficients)):
            coefficients[:] = np.nan
        return coefficients

    def allow_dense(self, steps: int) -> None:
        """Take the next steps by the dense solution, whatever is used otherwise."""
        check(core.lag_allow_dense(self._run, steps))

    def size_again(self) -> int:
        """Update the sizes of the terms of accelerations, after the linear solution has changed."""
        status: int = core.lag_sizes_again(self._run)
        return status

    def prepare(self, variation: JacobianTapes, pattern: MatrixPattern) -> None:
        """Allow implicit methods: take the derivatives and the pattern of their matrix.

        Parameters
        ----------
        variation : JacobianTapes
        pattern : MatrixPattern
        """
        given = Arguments()
        record = given.filled(lag_jacobians, **jacobian_fields(variation, pattern, self._nq))
        self._pattern = pattern
        check(core.lag_use_jacobians(self._run, byref(record)))

    def switch(self, method: str) -> int:
        """Continue with a method of `METHODS`; an implicit one must be prepared."""
        status: int = core.lag_switch(self._run, core.lag_method_at(METHODS.index(method)))
        return status

    def order(self, choose: Callable[[MatrixPattern, Array], PivotOrder | None]) -> None:
        """Let ``choose(pattern, values)`` find an order of pivots for the current matrix."""
        pattern = self._pattern
        chosen = choose(pattern, copied(core.lag_matrix(self._run), len(pattern.columns)))
        given, record = Arguments(), lag_pivots()
        if chosen is not None:
            record = given.filled(lag_pivots, **pivot_fields(chosen))
            self.orders.append(chosen)
        check(core.lag_use_pivots(self._run, byref(record)))

    def start(self) -> int:
        """Prepare the first step from here, and store the samples here."""
        core.lag_begin_again_here(self._simulation)
        return self.advance(0)

    def advance(self, slice_: int) -> int:
        """Take at most ``slice_`` steps."""
        status: int = core.lag_simulate(self._simulation, slice_)
        return status

    def sample_until(self, end: float) -> int:
        """Sample the last step up to a time."""
        status: int = core.lag_sample_until(self._run, end)
        return status

    def dense(self, t: float) -> Array:
        """Return the last step's state, (q, v, W), at a time in it."""
        y = np.empty(self._n + self._carried)
        core.lag_dense(self._run, t, address(y))
        return y[: self._n]

    def take(self) -> Array:
        """Return the samples since the last call."""
        rows = self.block[: core.lag_take(self._run)]
        return rows.copy() if self.times_next < self._times else rows  # more are to come

    def is_near(self) -> bool:
        """Return whether the state is near a singular configuration."""
        return bool(core.lag_is_near(self._run))

    def approach(self) -> list[tuple[float, Array]]:
        """Return the last states, (t, (q, v, W)), after `Status.NEAR`."""
        states = np.empty((_APPROACH_STATES, 1 + self._n))
        count = core.lag_approach_of(self._run, address(states))
        return [(float(row[0]), row[1:]) for row in states[:count]]

    def repeat(self) -> None:
        """Take the last step back, after `Status.OVER`; the next one is shorter."""
        core.lag_repeat(self._run)

    def move(self, t: float, y: ArrayLike, times_next: int) -> None:
        """Continue from another state; call `start` next."""
        given = Arguments()
        core.lag_move(self._run, t, given.doubles(y), times_next)

    @property
    def report(self) -> lag_report:
        """The state of the run now, in a record that is overwritten by the next call."""
        core.lag_report_of(self._run, self._written_to)
        return self._written

    @property
    def t(self) -> float:
        """Time reached, s."""
        t: float = self.report.t
        return t

    @property
    def state(self) -> Array:
        """(q, v, W) there."""
        return copied(self.report.y, self._n)

    @property
    def absolute_tolerances(self) -> Array:
        """The absolute tolerances of q, v and W now."""
        return copied(self.report.atol, self._n)

    @property
    def limiting(self) -> int:
        """The entry of (q, v, W) whose error rejected a step last, or -1."""
        entry: int = self.report.limiting
        return entry

    @property
    def step(self) -> tuple[float, float]:
        """Start and end of the last step, s."""
        report = self.report
        return report.t_old, report.t

    @property
    def suspect(self) -> tuple[float, float]:
        """Start and end of the part of the last step in which B may lose rank, s."""
        report = self.report
        return report.suspect_from, report.suspect_to

    @property
    def counts(self) -> tuple[int, int, int]:
        """Steps, rejected steps, evaluations."""
        report = self.report
        return report.steps, report.rejected, report.evaluations

    @property
    def lengths(self) -> Array:
        """The largest lengths that the rows of B times sizes have had, (nc,)."""
        return copied(self.report.lengths, self._nc)

    @property
    def times_next(self) -> int:
        """Index of the next sample time."""
        index: int = self.report.times_next
        return index

    @property
    def t_bad(self) -> float:
        """Time at which the equations had no finite value."""
        t: float = self.report.t_bad
        return t

    @property
    def y_bad(self) -> Array:
        """The state there."""
        return copied(self.report.y_bad, self._n)

    @property
    def sample_width(self) -> int:
        """Numbers in a row of samples."""
        return SampleLayout(Counts(self._nq, self._nc)).size

    @property
    def handle(self) -> int:
        """Address of the run."""
        return self._run
