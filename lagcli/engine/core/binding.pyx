# cython: language_level=3, boundscheck=False, wraparound=False
"""The compiled engine's binding: Python's objects to and from core/lagcore.h, no mathematics."""

import numpy as np

from lagcli.engine.layout import Counts, SampleLayout
from lagcli.engine.program.program import assemble
from lagcli.engine.tape.tape import Tape

from cpython.bytearray cimport PyByteArray_AS_STRING
from libc.stdint cimport int32_t, int64_t
from libc.stdlib cimport free, malloc

from lagcli.engine.core.lagcore cimport *


def _methods():
    cdef int i = 0
    while lag_method_at(i) != NULL:
        yield lag_method_name(lag_method_at(i)).decode()
        i += 1


METHODS = tuple(_methods())


cdef void *_allocate(void *context, size_t size) noexcept nogil:
    return malloc(size)


cdef void _release(void *context, void *memory) noexcept nogil:
    free(memory)


cdef lag_memory _MEMORY
_MEMORY.allocate, _MEMORY.release, _MEMORY.context = _allocate, _release, NULL


def _checked(failed):
    if failed:
        raise MemoryError


include "arguments.pxi"


cdef _copy(const double *values, long count):
    """Return an array of the core's numbers."""
    out = np.empty(count)
    cdef double[::1] view = out
    cdef long i
    for i in range(count):
        view[i] = values[i]
    return out


cdef class Integrator:
    """Steps with projection on a System; see core/run.h.

    Parameters
    ----------
    system : System
    constraint : Program
        Of ``system.constraint``.
    state : State
        At the start.
    t_end : float
    times : (nt,) array
    sizes : (nq,) array
        As in core/run.h.
    lengths, plain_lengths : (nc,) arrays
        The lengths of the rows of B times sizes, and of B, at the start.
    atol : (2 nq + 1,) array
        Absolute tolerances; 0 where they follow the size of the entry.
    kinds : (nq,) sequence of int
        Which coordinates are of the same kind, counted from 0.
    rank, rtol, h_max, projecting, watching, alpha, beta, baumgarte, detecting, refinable
        As in core/run.h; alpha negative means "from the step", beta "as alpha".
    block_rows : int
        Samples kept before they are passed on.
    extra : int
        Numbers at the end of each sample: multipliers of rows that switch.
    changes : (n, 2 nq) array, optional
        Derivatives of q and v at the start, in each direction.
    """

    cdef lag_run *run
    cdef readonly object block
    cdef object system, pattern, tables
    cdef int nq, nc, n, series_order
    cdef long times

    def __init__(
        self, system, constraint, state, double t_end, times, sizes, lengths,
        plain_lengths, int rank, double rtol, atol, kinds, double h_max, bint projecting,
        int watching, double alpha, double beta, bint baumgarte, bint detecting, bint refinable,
        long block_rows, int extra=0, changes=None,
    ):
        cdef _Arguments arguments = _Arguments()
        cdef lag_equations equations = arguments.equations(system, constraint)
        cdef lag_settings s
        self.system, self.times = system, len(times)
        self.nq, self.nc, self.n = equations.nq, equations.nc, 2 * equations.nq + 1
        s.t_start, s.t_end, s.h_max, s.rtol = state.t, t_end, h_max, rtol
        carried = [] if changes is None else changes
        s.directions, wide = len(carried), 3 * self.nq + self.nc + extra
        y = state.y if changes is None else np.concatenate([state.y, np.ravel(carried)])
        s.y, s.atol = arguments.doubles(y), arguments.doubles(atol)
        s.parameters = arguments.doubles(system.held_at(state.t, state.p))
        s.kind, s.rank = arguments.integers(kinds), rank
        s.sizes, s.lengths = arguments.doubles(sizes), arguments.doubles(lengths)
        s.plain_lengths = arguments.doubles(plain_lengths)
        s.projecting, s.watching = projecting, watching
        s.baumgarte, s.alpha, s.beta = baumgarte, alpha, beta
        s.detecting, s.refinable = detecting, refinable
        s.times, s.times_count = arguments.doubles(times), len(times)
        width = SampleLayout(Counts(self.nq, self.nc)).size + extra + s.directions * wide
        self.block = np.empty((block_rows, width))
        cdef double[:, ::1] block = self.block
        s.block, s.block_rows, s.extra = &block[0, 0], block_rows, extra
        self.run = lag_create(&_MEMORY, &equations, &s)
        _checked(self.run == NULL)
        self.use_functions(system)

    def __dealloc__(self):
        if self.run != NULL:
            lag_destroy(self.run)

    def use_functions(self, system):
        cdef _Arguments arguments = _Arguments()
        cdef lag_function *functions
        cdef int i, count = len(system.functions.functions)
        if count == 0:
            return
        functions = <lag_function *>malloc(count * sizeof(lag_function))
        _checked(functions == NULL)
        places = system.functions.places()
        for i, f in enumerate(system.functions.functions):
            functions[i].first = len(system.parameters) + places[f.name][0]
            functions[i].degree, functions[i].count = f.degree, len(f.knots)
            functions[i].period = f.period
            functions[i].knots = arguments.doubles(f.knots)
            functions[i].origins = arguments.doubles(f.origins)
            functions[i].coefficients = arguments.doubles(f.coefficients)
        self.tables = arguments  # the core copies none of their numbers
        failed = lag_use_functions(self.run, functions, count)
        free(functions)
        _checked(failed)

    def use_tangent(self, tangent, int blocks, bint complete):
        """Say that the System is the motion and its derivatives, in blocks; before the dynamics.

        Parameters
        ----------
        tangent : Program
            Of ``system.tangent.tape``.
        blocks, complete
            As in ``system.tangent``.
        """
        cdef _Arguments arguments = _Arguments()
        cdef lag_program program = arguments.program(tangent)
        _checked(lag_use_tangent(self.run, &program, blocks, complete))

    def use_dense(self, dynamics):
        """Solve for a and λ densely. Parameters: dynamics, the program of the System's tape."""
        cdef _Arguments arguments = _Arguments()
        cdef lag_program program = arguments.program(dynamics)
        _checked(lag_use_dense(self.run, &program))

    def use_elimination(self, dynamics, plan, bint unrolled):
        """Solve for a and λ by a static elimination.

        Parameters
        ----------
        dynamics : Program
            Of the System's tape.
        plan : Elimination
        unrolled : bool
            Whether it is appended to the tape.
        """
        cdef _Arguments arguments = _Arguments()
        cdef lag_program program = arguments.program(dynamics)
        cdef lag_elimination elimination
        if unrolled:
            _checked(lag_use_unrolled(self.run, &program))
            return
        elimination = arguments.elimination(plan)
        motion = self.system.motion
        elimination.mass_targets = arguments.integers(plan.targets(motion.mass_pattern))
        # an entry of B stands in the matrix twice; one of them in the half that is stored
        entries, nq = motion.jacobian_pattern, len(motion.coordinates)
        lower = plan.targets([(nq + i, j) for i, j in entries])
        upper = plan.targets([(j, nq + i) for i, j in entries])
        elimination.jacobian_targets = arguments.integers(np.maximum(lower, upper))
        _checked(lag_use_elimination(self.run, &program, &elimination))

    def use_series(self, program):
        """Allow Taylor's method.

        Parameters
        ----------
        program : SeriesProgram
            Of the dynamics that are used.
        """
        cdef _Arguments arguments = _Arguments()
        cdef lag_series_program s
        s.values = arguments.program(assemble(program.values))
        s.stream = arguments.stream(program.stream)
        s.convolutions, s.order = program.convolutions, program.order
        s.invariant, s.numbers = program.invariant, program.numbers
        s.begins, s.begin_count = arguments.integers(program.begins), len(program.begins)
        s.origin, s.layer = program.origin, program.layer
        s.state, s.size = arguments.integers(program.state), program.size
        self.series_order = s.order
        _checked(lag_use_series(self.run, &s))

    def series(self):
        """Return the Taylor coefficients of y = (q, v, W) here, (n, order + 1); NaN without any."""
        found = np.empty((self.n, self.series_order + 1))
        cdef double[:, ::1] view = found
        if lag_coefficients(self.run, &view[0, 0]):
            found[:] = np.nan
        return found

    def allow_dense(self, long steps):
        """Take the next steps by the dense solution, whatever is used otherwise."""
        _checked(lag_allow_dense(self.run, steps))

    def size_again(self):
        """Update the sizes of the terms of accelerations, after the linear solution has changed."""
        return lag_sizes_again(self.run)

    def prepare(self, variation, pattern):
        """Allow implicit methods: take the derivatives and the pattern of their matrix.

        Parameters
        ----------
        variation : JacobianTapes
        pattern : MatrixPattern
        """
        cdef _Arguments arguments = _Arguments()
        cdef lag_jacobians j
        w = variation
        j.program = arguments.program(assemble(w.tape))
        j.force_position = arguments.block(self.flat(w.force_position))
        j.force_velocity = arguments.block(self.flat(w.force_velocity))
        j.rhs_position = arguments.block(self.flat(w.rhs_position))
        j.rhs_velocity = arguments.block(self.flat(w.rhs_velocity))
        j.power_position = arguments.block(w.power_position)
        j.power_velocity = arguments.block(w.power_velocity)
        j.n = len(pattern.start) - 1
        j.start, j.columns = arguments.integers(pattern.start), arguments.integers(pattern.columns)
        j.parts, j.parts_count = arguments.integers(pattern.parts), len(pattern.parts)
        self.pattern = pattern
        _checked(lag_use_jacobians(self.run, &j))

    def flat(self, places):
        return [i * self.nq + j for i, j in places]

    def resolve_time(self, program):
        """Limit steps so that they resolve functions that depend on t explicitly: their program."""
        cdef _Arguments arguments = _Arguments()
        cdef lag_program functions = arguments.program(program)
        _checked(lag_use_explicit_time(self.run, &functions))

    def end_steps_at(self, times):
        """End steps at times, which increase: the right side is not smooth there."""
        cdef _Arguments arguments = _Arguments()
        _checked(lag_use_breaks(self.run, arguments.doubles(times), len(times)))

    def switch(self, method):
        """Go on with a method of `METHODS`; an implicit one must be prepared."""
        return lag_switch(self.run, lag_method_at(METHODS.index(method)))

    def order(self, choose):
        """Let ``choose(pattern, values)`` find an order of pivots for the matrix at hand."""
        cdef _Arguments arguments = _Arguments()
        cdef lag_pivots pivots
        found = choose(self.pattern, _copy(lag_matrix(self.run), len(self.pattern.columns)))
        pivots.n = 0
        if found is not None:
            pivots.n = len(found.row)
            pivots.row, pivots.column = arguments.integers(found.row), arguments.integers(found.column)
            pivots.start = arguments.integers(found.start)
            pivots.columns = arguments.integers(found.columns)
            pivots.diagonal = arguments.integers(found.diagonal)
            pivots.places = arguments.integers(found.places)
        _checked(lag_use_pivots(self.run, &pivots))

    def start(self):
        """Prepare the first step; sample what lies at the start."""
        cdef int status
        with nogil:
            status = lag_start(self.run)
        return status

    def advance(self, long slice):
        """Take at most ``slice`` steps."""
        cdef int status
        with nogil:
            status = lag_advance(self.run, slice)
        return status

    def sample_until(self, double end):
        """Sample the last step up to a time."""
        return lag_sample_until(self.run, end)

    def dense(self, double t):
        """Return the last step's state at a time in it."""
        y = np.empty(self.n)
        cdef double[::1] view = y
        lag_dense(self.run, t, &view[0])
        return y

    def take(self):
        """Return the samples since the last call."""
        rows = self.block[: lag_take(self.run)]
        return rows.copy() if self.times_next < self.times else rows  # more are to come

    def limit(self, double h_max):
        """Set the largest step, s."""
        lag_limit(self.run, h_max)

    def move(self, double t, y, long times_next):
        """Go on from another state; `start` must follow."""
        cdef double[::1] view = np.ascontiguousarray(y, dtype=float)
        lag_move(self.run, t, &view[0], times_next)

    @property
    def t(self):
        """Time reached, s."""
        return lag_report_of(self.run).t

    @property
    def state(self):
        """(q, v, W) there."""
        return _copy(lag_report_of(self.run).y, self.n)

    @property
    def absolute_tolerances(self):
        """The absolute tolerances of q, v and W now."""
        return _copy(lag_report_of(self.run).atol, self.n)

    @property
    def step(self):
        """Start and end of the last step, s."""
        cdef lag_report report = lag_report_of(self.run)
        return report.t_old, report.t

    @property
    def counts(self):
        """Steps, rejected steps, evaluations."""
        cdef lag_report report = lag_report_of(self.run)
        return report.steps, report.rejected, report.evaluations

    @property
    def lengths(self):
        """The largest lengths that the rows of B times sizes have had, (nc,)."""
        return _copy(lag_report_of(self.run).lengths, self.nc)

    @property
    def times_next(self):
        """Index of the next sample time."""
        return lag_report_of(self.run).times_next

    @property
    def t_bad(self):
        """Time at which the equations had no finite value."""
        return lag_report_of(self.run).t_bad

    @property
    def y_bad(self):
        """The state there."""
        return _copy(lag_report_of(self.run).y_bad, self.n)


include "coefficients.pxi"
include "switching.pxi"
include "batch.pxi"
include "contact.pxi"
include "roots.pxi"
include "jets.pxi"
