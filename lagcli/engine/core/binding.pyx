# cython: language_level=3, boundscheck=False, wraparound=False
"""The compiled engine's binding: Python's objects to and from core/lagcore.h, no mathematics."""

import numpy as np

from lagcli.engine.layout import Counts, SampleLayout
from lagcli.engine.program.program import assemble

from libc.stdint cimport int32_t, int64_t
from libc.stdlib cimport free, malloc

from lagcli.engine.core.lagcore cimport *


cdef extern from "tape/tape.h":
    void lag_stream_run(const int32_t *stream, double *registers) nogil


cdef extern from "linear/ldl.h":
    void lag_ldl_factor(
        const lag_elimination *plan, double *diagonal, double *beside, double *lower,
        double *product, double *work,
    ) nogil
    void lag_ldl_solve(
        const lag_elimination *plan, const double *diagonal, const double *beside,
        const double *lower, double *work, double *x,
    ) nogil


cdef extern from "methods/rodas5p_tableau.h":
    const double rodas_gamma
    const double rodas_c[8]
    const double rodas_d[8]
    const double rodas_a[8][7]
    const double rodas_C[8][7]
    const double rodas_h[3][8]


cdef extern from "methods/radau5_tableau.h":
    const double radau_c[3]
    const double radau_t[3][3]
    const double radau_t_inverse[3][3]
    const double radau_real, radau_re, radau_im
    const double radau_error[3]


def _methods():
    cdef int i = 0
    while lag_method_at(i) != NULL:
        yield lag_method_name(lag_method_at(i)).decode()
        i += 1


METHODS = tuple(_methods())


def rodas5p_coefficients():
    """Return γ, c, d, a, C and h of Rodas5P; see core/rodas5p_tableau.h."""
    lists = [list(rodas_c), list(rodas_d), list(rodas_a), list(rodas_C), list(rodas_h)]
    return rodas_gamma, *map(np.array, lists)


def radau5_coefficients():
    """Return c, T, T⁻¹, the eigenvalues and the error's weights; see core/radau5_tableau.h."""
    lists = [list(radau_c), list(radau_t), list(radau_t_inverse)]
    eigenvalues = radau_real, complex(radau_re, radau_im)
    return *map(np.array, lists), eigenvalues, np.array(list(radau_error))


def run_tape(tape, inputs, families=(), output_subset=-1):
    """Run a tape once, with all that is asked for apart, as the engine does.

    Parameters
    ----------
    tape : Tape
    inputs : sequence of float
    families : sequence of str or None
        Labels of the inputs.
    output_subset : int
        Which of the subsets of outputs to evaluate, if any; other outputs have no meaning
        then.

    Returns
    -------
    (outputs,) array
    """
    program = assemble(tape, families)
    registers = program.registers
    registers[: tape.inputs] = inputs
    cdef double[::1] r = registers
    cdef int32_t[::1] prelude = program.prelude
    cdef int32_t[::1] main = program.main if output_subset < 0 else program.output_subsets[output_subset]
    lag_stream_run(&prelude[0], &r[0])
    lag_stream_run(&main[0], &r[0])
    for stream in program.deferred:
        main = stream
        lag_stream_run(&main[0], &r[0])
    return registers[program.outputs]


def solve_ldl(plan, places, values, right):
    """Factor a sparse symmetric matrix and solve with it, as the engine does for large models.

    Parameters
    ----------
    plan : Elimination
    places : sequence of (row, column)
        Of the nonzero entries, both triangles.
    values : sequence of float
    right : (n,) array

    Returns
    -------
    (n,) array
    """
    cdef _Arguments arguments = _Arguments()
    cdef lag_elimination ldl = arguments.elimination(plan)
    cdef int n = ldl.n, count = ldl.start[n]
    cdef double[::1] factors = np.zeros(2 * n + count + 1), product = np.zeros(count + 1)
    cdef double[::1] work = np.zeros(2 * n), x = np.array(right, dtype=float)
    for target, value in zip(plan.targets(places), values, strict=True):
        if target >= 0:
            factors[<int>target] = value
    lag_ldl_factor(&ldl, &factors[0], &factors[n], &factors[2 * n], &product[0], &work[0])
    lag_ldl_solve(&ldl, &factors[0], &factors[n], &factors[2 * n], &work[0], &x[0])
    return np.asarray(x)


cdef void *_allocate(void *context, size_t size) noexcept nogil:
    return malloc(size)


cdef void _release(void *context, void *memory) noexcept nogil:
    free(memory)


cdef lag_memory _MEMORY
_MEMORY.allocate, _MEMORY.release, _MEMORY.context = _allocate, _release, NULL


def _checked(failed):
    if failed:
        raise MemoryError


cdef class _Arguments:
    """What the core is given for the time of a call: structures that point into arrays."""

    cdef list arrays

    def __cinit__(self):
        self.arrays = []

    # a pointer is never NULL, also to nothing: C forbids that even for copies of no bytes

    cdef const double *doubles(self, values) except NULL:
        array = np.ascontiguousarray(values, dtype=float).reshape(-1)
        array = array if array.size else np.zeros(1)
        self.arrays.append(array)
        cdef const double[::1] view = array
        return &view[0]

    cdef const int32_t *integers(self, values) except NULL:
        array = np.ascontiguousarray(values, dtype=np.int32).reshape(-1)
        array = array if array.size else np.zeros(1, dtype=np.int32)
        self.arrays.append(array)
        cdef const int32_t[::1] view = array
        return &view[0]

    cdef lag_stream stream(self, code):
        return lag_stream(self.integers(code), len(code))

    cdef lag_program program(self, program):
        cdef lag_program p
        cdef int i
        p.prelude, p.main = self.stream(program.prelude), self.stream(program.main)
        for i in range(3):
            p.deferred[i] = lag_stream(NULL, 0)
        for i in range(2):
            p.output_subsets[i] = lag_stream(NULL, 0)
        for i, code in enumerate(program.deferred):
            p.deferred[i] = self.stream(code)
        for i, code in enumerate(program.output_subsets):
            p.output_subsets[i] = self.stream(code)
        p.inputs = program.inputs
        p.registers, p.register_count = self.doubles(program.registers), len(program.registers)
        p.outputs, p.output_count = self.integers(program.outputs), len(program.outputs)
        return p

    cdef lag_equations equations(self, system, constraint):
        cdef lag_equations e
        e.nq, e.nc = len(system.coordinates), len(system.constraints)
        e.nh, e.np = len(system.holonomic), system.held
        e.nm, e.nb = len(system.mass_pattern), len(system.jacobian_pattern)
        e.holonomic = self.integers(system.holonomic)
        e.mass_row = self.integers([i for i, _ in system.mass_pattern])
        e.mass_column = self.integers([j for _, j in system.mass_pattern])
        e.jacobian_row = self.integers([i for i, _ in system.jacobian_pattern])
        e.jacobian_column = self.integers([j for _, j in system.jacobian_pattern])
        first = {j: group[0] for group in system.same_unit for j in group}
        e.unit = self.integers([first.get(j, j) for j in range(e.nq)])
        e.constraint = self.program(constraint)
        return e

    cdef lag_elimination elimination(self, plan):
        cdef lag_elimination e
        starts, columns, entries = plan.left
        e.n = len(plan.order)
        e.order, e.paired = self.integers(plan.order), self.integers(plan.paired)
        e.start = self.integers(plan.starts)
        e.row = self.integers([i for column in plan.columns for i in column])
        e.left_start, e.left_column = self.integers(starts), self.integers(columns)
        e.left_entry = self.integers(entries)
        e.mass_targets = e.jacobian_targets = NULL
        return e

    cdef lag_block block(self, places):
        return lag_block(len(places), self.integers(places))


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
        long block_rows,
    ):
        cdef _Arguments arguments = _Arguments()
        cdef lag_equations equations = arguments.equations(system, constraint)
        cdef lag_settings s
        self.system, self.times = system, len(times)
        self.nq, self.nc, self.n = equations.nq, equations.nc, 2 * equations.nq + 1
        s.t_start, s.t_end, s.h_max, s.rtol = state.t, t_end, h_max, rtol
        s.y, s.atol = arguments.doubles(state.y), arguments.doubles(atol)
        s.parameters = arguments.doubles(system.held_at(state.t, state.p))
        s.kind, s.rank = arguments.integers(kinds), rank
        s.sizes, s.lengths = arguments.doubles(sizes), arguments.doubles(lengths)
        s.plain_lengths = arguments.doubles(plain_lengths)
        s.projecting, s.watching = projecting, watching
        s.baumgarte, s.alpha, s.beta = baumgarte, alpha, beta
        s.detecting, s.refinable = detecting, refinable
        s.times, s.times_count = arguments.doubles(times), len(times)
        self.block = np.empty((block_rows, SampleLayout(Counts(self.nq, self.nc)).size))
        cdef double[:, ::1] block = self.block
        s.block, s.block_rows = &block[0, 0], block_rows
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
        elimination.mass_targets = arguments.integers(plan.targets(self.system.mass_pattern))
        # an entry of B stands in the matrix twice; one of them in the half that is stored
        entries = self.system.jacobian_pattern
        lower = plan.targets([(self.nq + i, j) for i, j in entries])
        upper = plan.targets([(j, self.nq + i) for i, j in entries])
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
        """Find anew what accelerations are made of, after a change of how they are solved for."""
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

    def watch_events(self, tape):
        """Look for sign changes of a tape's outputs along the motion, from the start on."""
        cdef _Arguments arguments = _Arguments()
        cdef lag_program program = arguments.program(assemble(tape))
        _checked(lag_use_events(self.run, &program))

    def end_steps_at(self, times):
        """End steps at times, which increase: the right side is not smooth there."""
        cdef _Arguments arguments = _Arguments()
        _checked(lag_use_breaks(self.run, arguments.doubles(times), len(times)))

    @property
    def event(self):
        """Number, direction, time and state of the last event."""
        cdef lag_event event = lag_last_event(self.run)
        return event.which, event.direction, event.time, _copy(event.y, self.n)

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


include "batch.pxi"
include "contact.pxi"
