# cython: language_level=3, boundscheck=False, wraparound=False
"""The compiled engine's binding: memory and calls, no mathematics."""

import numpy as np

from lagcli.engine.program.program import assemble

from libc.stdint cimport int32_t


cdef extern from "tape.h":
    ctypedef struct lag_tape:
        const int32_t *stream
        const int32_t *later[3]
        const int32_t *alone[2]
        int32_t *held
        double *registers
        const int32_t *outputs

    void lag_stream_run(const int32_t *stream, double *registers) nogil


cdef extern from "ldl.h":
    ctypedef struct lag_ldl:
        int n
        const int32_t *order
        const int32_t *paired
        const int32_t *start
        const int32_t *row
        const int32_t *left_start
        const int32_t *left_column
        const int32_t *left_entry

    void lag_ldl_factor(
        const lag_ldl *plan, double *diagonal, double *beside, double *lower, double *product,
        double *work,
    ) nogil
    void lag_ldl_solve(
        const lag_ldl *plan, const double *diagonal, const double *beside, const double *lower,
        double *work, double *x,
    ) nogil


cdef extern from "system.h":
    ctypedef struct lag_system:
        int nq, nc, nh
        const int32_t *holonomic
        int nm, nb
        const int32_t *mass_row
        const int32_t *mass_column
        const int32_t *jacobian_row
        const int32_t *jacobian_column
        const int32_t *mass_diagonal
        const int32_t *unit
        lag_tape dynamics
        lag_tape constraint


cdef extern from "events.h":
    ctypedef struct lag_events:
        int count
        lag_tape tape
        int32_t *sign
        int32_t *after
        double time
        int which, direction
        double *y


cdef extern from "series.h":
    ctypedef struct lag_series:
        lag_tape values
        const int32_t *stream
        double *known
        int count
        double *file
        int order
        int steady, numbers, begun
        const int32_t *begins
        int origin, layer
        const int32_t *state

    int lag_series_expand(const lag_series *series, int nq, double t, const double *y) nogil


cdef extern from "run.h":
    ctypedef struct lag_method:
        pass

    const lag_method *lag_method_at(int i)
    const char *lag_method_name(const lag_method *method)

    ctypedef struct lag_run:
        const lag_system *system
        const lag_method *method
        const lag_method *stepped
        lag_implicit *implicit
        lag_series series
        int detecting
        double t_start, t, t_end, h, h_max, rtol, error_old
        double *atol
        const double *given
        double *size
        double *gross
        double *later
        int kinds
        const int32_t *kind
        double *largest
        int projecting, watching
        double alpha, beta
        int baumgarte
        int alpha_from_step, beta_from_alpha
        double *y
        double *f
        double t_old, h_old
        double *y_old
        double *stages
        double *dense
        double *y_new
        double *f_new
        double *trial
        double *y_sample
        double *work
        int finishing
        double *a
        double *multipliers
        int eliminating, refinable, refining, kept_count, other_right
        lag_ldl ldl
        const int32_t *mass_targets
        const int32_t *jacobian_targets
        double *factors
        double *product
        long dense_steps
        double *kkt
        double *lu
        double *right
        double *solution
        int *pivots
        double *sizes
        double *weight
        double *lengths
        double *plain_lengths
        double *scale_position
        double *scale_velocity
        double *rows
        double *weakest_rows
        double *jacobian_before
        int *order
        double *components
        double *dependencies
        int rank
        const double *times
        long times_count, times_next
        double *block
        long block_rows, block_used
        lag_events events
        long steps, rejected, evaluations
        double t_bad
        double *y_bad

    int lag_start(lag_run *run) nogil
    int lag_switch(lag_run *run, const lag_method *method) nogil
    int lag_advance(lag_run *run, long slice) nogil

cdef extern from "sample.h":
    int lag_sample_until(lag_run *run, double end) nogil


cdef extern from "step.h":
    void lag_dense(lag_run *run, double t, double *y) nogil


cdef extern from "sizes.h":
    int lag_sizes_again(lag_run *run)


cdef extern from "system.h":
    int lag_first_kept(const lag_system *system)
    int lag_sample_size(const lag_system *system)


cdef extern from "sparse.h":
    ctypedef struct lag_order_of_pivots:
        int n
        const int32_t *row
        const int32_t *column
        const int32_t *start
        const int32_t *columns
        const int32_t *diagonal
        const int32_t *places


cdef extern from "implicit.h":
    ctypedef struct lag_block:
        int count, first
        const int32_t *places

    ctypedef struct lag_implicit:
        lag_tape variation
        lag_block force_position, force_velocity, rhs_position, rhs_velocity
        lag_block power_position, power_velocity
        double *mass
        double *jacobian
        double *border
        double *derivatives
        double *velocity
        int n, count
        const int32_t *start
        const int32_t *columns
        const int32_t *parts
        double *matrix
        double *matrix_re
        double *matrix_im
        lag_order_of_pivots order
        double *factors
        double *complex_re
        double *complex_im
        double *right
        double *right_im
        double *residual
        double *work
        double *quotient
        double *zero
        double shift
        long ordered


cdef extern from "rodas5p_tableau.h":
    const double rodas_gamma
    const double rodas_c[8]
    const double rodas_d[8]
    const double rodas_a[8][7]
    const double rodas_C[8][7]
    const double rodas_h[3][8]


cdef extern from "radau5_tableau.h":
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


def run_tape(tape, inputs, families=(), alone=-1):
    """Run a tape once, with all that is asked for apart, as the engine does.

    Parameters
    ----------
    tape : Tape
    inputs : sequence of float
    families : sequence of str or None
        Labels of the inputs.
    alone : int
        Which of the sets that are asked for alone to yield, if any; other outputs have no meaning
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
    cdef int32_t[::1] main = program.main if alone < 0 else program.alone[alone]
    lag_stream_run(&prelude[0], &r[0])
    lag_stream_run(&main[0], &r[0])
    for stream in program.later:
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
    starts, columns, entries = plan.left
    cdef int n = len(plan.order), count = len(entries)
    cdef int32_t[::1] order = _integers(plan.order), paired = _integers(plan.paired)
    cdef int32_t[::1] start = _integers(plan.starts), left_start = _integers(starts)
    cdef int32_t[::1] row = _integers([i for column in plan.columns for i in column])
    cdef int32_t[::1] left_column = _integers(columns), left_entry = _integers(entries)
    cdef lag_ldl ldl
    ldl.n = n
    ldl.order, ldl.paired, ldl.start, ldl.row = &order[0], &paired[0], &start[0], &row[0]
    ldl.left_start, ldl.left_column = &left_start[0], &left_column[0]
    ldl.left_entry = &left_entry[0]
    cdef double[::1] factors = np.zeros(2 * n + count + 1), product = np.zeros(count + 1)
    cdef double[::1] work = np.zeros(2 * n), x = np.array(right, dtype=float)
    for target, value in zip(plan.targets(places), values, strict=True):
        if target >= 0:
            factors[<int>target] = value
    lag_ldl_factor(&ldl, &factors[0], &factors[n], &factors[2 * n], &product[0], &work[0])
    lag_ldl_solve(&ldl, &factors[0], &factors[n], &factors[2 * n], &work[0], &x[0])
    return np.asarray(x)


def _integers(values):
    """Return an array that is never empty: C forbids pointers to nothing."""
    array = np.array(values, dtype=np.int32).reshape(-1)
    return array if array.size else np.zeros(1, dtype=np.int32)


def _aligned(long n):
    """Return an array of zeros that begins where a cache line does; never empty."""
    array = np.zeros(n + 8)
    first = (-array.ctypes.data % 64) // 8
    return array[first : first + max(n, 1)]


cdef class Integrator:
    """Steps with projection on a System; see core/run.h.

    Parameters
    ----------
    system : System
    constraint : Program
        Of ``system.constraint``.
    t, t_end : float
    y : (2 nq + 1,) array
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
        Samples kept before they are handed over.
    """

    cdef lag_system system
    cdef lag_run run
    cdef lag_implicit implicit
    cdef object keep  # the arrays that the pointers point into
    cdef readonly object block, y_bad
    cdef object tolerances
    cdef object y, y_dense, parameters, mass_pattern, jacobian_pattern
    cdef object y_event, pattern, matrix, factors, kept_order, kept_lengths
    cdef int nq, nc, size

    def __init__(
        self, system, constraint, double t, double t_end, y, times, sizes, lengths,
        plain_lengths, int rank, double rtol, atol, kinds, double h_max, bint projecting,
        int watching, double alpha, double beta, bint baumgarte, bint detecting, bint refinable,
        long block_rows,
    ):
        cdef int nq = len(system.coordinates), nc = len(system.constraints)
        cdef int n = 2 * nq + 1, size = nq + 2 * nc - rank
        self.nq, self.nc, self.size, self.keep = nq, nc, size, []
        self.parameters = system.parameters
        self.mass_pattern, self.jacobian_pattern = system.mass_pattern, system.jacobian_pattern
        self.system.nq, self.system.nc = nq, nc
        self.system.nh = len(system.holonomic)
        self.system.nm = len(system.mass_pattern)
        self.system.nb = len(system.jacobian_pattern)
        self.system.holonomic = self.integers(system.holonomic)
        self.system.mass_row = self.integers([i for i, _ in system.mass_pattern])
        self.system.mass_column = self.integers([j for _, j in system.mass_pattern])
        self.system.jacobian_row = self.integers([i for i, _ in system.jacobian_pattern])
        self.system.jacobian_column = self.integers([j for _, j in system.jacobian_pattern])
        diagonal = {i: at for at, (i, j) in enumerate(system.mass_pattern) if i == j}
        self.system.mass_diagonal = self.integers([diagonal.get(j, -1) for j in range(nq)])
        first = {j: group[0] for group in system.alike for j in group}
        self.system.unit = self.integers([first.get(j, j) for j in range(nq)])
        self.bind(&self.system.constraint, constraint)
        self.run.system = &self.system
        self.run.t, self.run.t_end, self.run.h_max = t, t_end, h_max
        self.run.t_start, self.run.rtol = t, rtol
        kept = np.array(atol, dtype=float)
        self.run.given = self.borrow(kept)
        self.tolerances = kept.copy()
        self.run.atol = self.borrow(self.tolerances)
        self.run.size = self.doubles(n)
        self.run.gross, self.run.later = self.doubles(nq), self.doubles(nq)
        self.run.kind, self.run.kinds = self.integers(kinds), 1 + max(kinds, default=0)
        self.run.largest = self.doubles(2 * self.run.kinds)
        self.run.projecting, self.run.watching = projecting, watching
        self.run.baumgarte = baumgarte
        self.run.method = self.run.stepped = lag_method_at(0)
        self.run.detecting, self.run.refinable = detecting, refinable
        self.run.alpha_from_step = baumgarte and alpha < 0
        self.run.beta_from_alpha = beta < 0
        self.run.alpha, self.run.beta = max(alpha, 0.0), max(beta, 0.0)
        self.run.rank = rank
        self.y = np.array(y, dtype=float)
        self.run.y = self.borrow(self.y)
        self.run.f, self.run.y_old = self.doubles(n), self.doubles(n)
        self.run.y_new, self.run.f_new = self.doubles(n), self.doubles(n)
        self.run.trial = self.doubles(n)
        self.run.y_sample = self.doubles(n)
        self.run.work = self.doubles(2 * (n + size) + 3 * nc)
        self.run.stages, self.run.dense = self.doubles(16 * (n + 7)), self.doubles(7 * (n + 7))
        self.run.a = self.doubles(nq + nc)
        self.run.multipliers = self.run.a + nq
        self.run.right, self.run.solution = self.doubles(size), self.doubles(size)
        self.run.weight = self.doubles(nc)
        self.run.sizes = self.borrow(np.array(sizes, dtype=float))
        self.kept_lengths = np.array(lengths, dtype=float)
        self.run.lengths = self.borrow(self.kept_lengths)
        self.run.plain_lengths = self.borrow(np.array(plain_lengths, dtype=float))
        self.run.scale_position = self.doubles(self.system.nh)
        self.run.scale_velocity = self.doubles(nc)
        self.run.rows = self.doubles(nq * nc)
        self.run.weakest_rows = self.doubles(nc)
        self.run.jacobian_before = self.doubles(2 * self.system.nb)
        self.run.order = <int *>self.integers([0] * nc)
        self.run.components = self.doubles(nc * nc)
        self.run.dependencies = self.doubles((nc - rank) * nc)
        self.run.pivots = <int *>self.integers([0] * size)
        kept = np.array(times, dtype=float)
        self.run.times, self.run.times_count = self.borrow(kept), len(kept)
        self.block = np.empty((block_rows, lag_sample_size(&self.system)))
        self.run.block, self.run.block_rows = self.borrow(self.block), block_rows
        self.y_bad = np.full(n, np.nan)
        self.run.y_bad = self.borrow(self.y_bad)
        self.y_dense = np.empty(n)

    # a pointer is never NULL, also to nothing: C forbids that even for copies of no bytes

    cdef double *borrow(self, array) except NULL:
        if array.size == 0:
            array = np.zeros(1)
        self.keep.append(array)
        cdef double[::1] view = array.reshape(-1)
        return &view[0]

    cdef double *doubles(self, int n) except NULL:
        return self.borrow(_aligned(n))

    cdef int32_t *integers(self, values) except NULL:
        array = _integers(values)
        self.keep.append(array)
        cdef int32_t[::1] view = array
        return &view[0]

    cdef int bind(self, lag_tape *tape, program) except -1:
        registers = _aligned(len(program.registers))
        registers[:] = program.registers
        registers[program.inputs - len(self.parameters) : program.inputs] = self.parameters
        registers[0] = np.nan  # no state yet
        tape.registers = self.borrow(registers)
        tape.stream = self.integers(program.main)
        for i, stream in enumerate(program.later):
            tape.later[<int>i] = self.integers(stream)
        for i, stream in enumerate(program.alone):
            tape.alone[<int>i] = self.integers(stream)
        if not program.alone:
            tape.alone[0] = tape.alone[1] = NULL
        tape.held = self.integers([0, 0])
        tape.outputs = self.integers(program.outputs)
        lag_stream_run(self.integers(program.prelude), tape.registers)
        return 0

    def use_dense(self, dynamics):
        """Solve for a and λ densely. Parameters: dynamics, the program of the System's tape."""
        self.bind(&self.system.dynamics, dynamics)
        self.run.eliminating = 0
        self.allow_dense(0)

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
        cdef lag_ldl *ldl = &self.run.ldl
        cdef int nq = self.nq, n = nq + self.nc
        self.bind(&self.system.dynamics, dynamics)
        self.run.eliminating = 1 if unrolled else 2
        self.run.refining = 0
        ldl.n = n
        ldl.order = self.integers(plan.order)
        ldl.paired = self.integers(plan.paired)
        ldl.start = self.integers(plan.starts)
        ldl.row = self.integers([i for column in plan.columns for i in column])
        if unrolled:
            self.run.kept_count = (
                len(dynamics.outputs) - lag_first_kept(&self.system) - n - nq
            )
            self.run.other_right = dynamics.inputs
            return
        # what the factorization in a loop needs
        starts, columns, entries = plan.left
        ldl.left_start = self.integers(starts)
        ldl.left_column = self.integers(columns)
        ldl.left_entry = self.integers(entries)
        self.run.factors = self.doubles(2 * n + len(entries))
        self.run.product = self.doubles(len(entries))
        self.run.mass_targets = self.integers(plan.targets(self.mass_pattern))
        # an entry of B stands in the matrix twice; one of them in the half that is stored
        places = plan.targets([(nq + i, j) for i, j in self.jacobian_pattern])
        others = plan.targets([(j, nq + i) for i, j in self.jacobian_pattern])
        self.run.jacobian_targets = self.integers(np.maximum(places, others))

    def use_series(self, program):
        """Allow Taylor's method.

        Parameters
        ----------
        program : Series
            Of the dynamics that are used.
        """
        cdef lag_series *series = &self.run.series
        cdef int i
        self.bind(&series.values, assemble(program.values))
        series.stream, series.state = self.integers(program.stream), self.integers(program.state)
        series.count, series.known = program.convolutions, self.doubles(program.convolutions)
        series.file = self.doubles(program.size)
        series.order = program.order
        series.steady, series.numbers = program.steady, program.numbers
        series.begins, series.begun = self.integers(program.begins), len(program.begins)
        series.origin, series.layer = program.origin, program.layer
        for i in range(program.steady):
            series.file[i] = series.values.registers[series.values.outputs[i]]

    def series(self):
        """Return the Taylor coefficients of y = (q, v, W) here, (n, order + 1); NaN without any."""
        cdef const lag_series *series = &self.run.series
        cdef int n = 2 * self.nq + 1, m, k
        found = np.full((n, series.order + 1), np.nan)
        cdef double[:, ::1] coefficients = found
        if lag_series_expand(series, self.nq, self.run.t, self.run.y) == 0:
            for m in range(n):
                for k in range(series.order + 1):
                    coefficients[m, k] = series.file[
                        series.origin + series.state[1 + m] + k * series.layer
                    ]
        return found

    def allow_dense(self, long steps):
        """Take the next steps by the dense solution, whatever is used otherwise."""
        self.run.dense_steps = steps
        if self.run.kkt == NULL:
            self.run.kkt = self.doubles(self.size * self.size)
            self.run.lu = self.doubles(self.size * self.size)

    def size_again(self):
        """Find anew what accelerations are made of, after a change of how they are solved for."""
        return lag_sizes_again(&self.run)

    cdef int block_of(self, lag_block *block, places, int first) except -1:
        block.count, block.first = len(places), first
        block.places = self.integers(places)
        return first + len(places)

    def prepare(self, variation, pattern):
        """Allow implicit methods: take the derivatives and the pattern of their matrix.

        Parameters
        ----------
        variation : Variation
        pattern : MatrixPattern
        """
        cdef lag_implicit *m = &self.implicit
        cdef int nq = self.nq, nc = self.nc, nd = nc - self.run.rank, first = 0
        w = variation
        first = self.block_of(&m.force_position, self.flat(w.force_position), first)
        first = self.block_of(&m.force_velocity, self.flat(w.force_velocity), first)
        first = self.block_of(&m.rhs_position, self.flat(w.rhs_position), first)
        first = self.block_of(&m.rhs_velocity, self.flat(w.rhs_velocity), first)
        first = self.block_of(&m.power_position, w.power_position, first)
        first = self.block_of(&m.power_velocity, w.power_velocity, first)
        self.bind(&m.variation, assemble(w.tape))
        m.mass, m.jacobian = self.doubles(self.system.nm), self.doubles(self.system.nb)
        m.border, m.derivatives = self.doubles(nd * nc), self.doubles(len(w.tape.outputs))
        m.velocity = self.doubles(nq)
        m.quotient, m.zero = self.doubles(nq), self.doubles(nq)
        self.pattern = pattern
        m.n, m.count = len(pattern.start) - 1, len(pattern.columns)
        m.start, m.columns = self.integers(pattern.start), self.integers(pattern.columns)
        m.parts = self.integers(pattern.parts)
        self.matrix = np.zeros(m.count)
        m.matrix = self.borrow(self.matrix)
        m.matrix_re, m.matrix_im = self.doubles(m.count), self.doubles(m.count)
        m.right, m.right_im = self.doubles(m.n), self.doubles(m.n)
        m.residual, m.work = self.doubles(m.n), self.doubles(2 * m.n)
        m.order.n, m.ordered, m.shift = 0, -1, 0.0
        self.run.implicit = m

    def flat(self, places):
        return [i * self.nq + j for i, j in places]

    def watch_events(self, tape):
        """Look for sign changes of a tape's outputs along the motion, from the start on."""
        cdef lag_events *events = &self.run.events
        self.bind(&events.tape, assemble(tape))
        events.count, events.time = len(tape.outputs), np.nan
        events.sign = self.integers([0] * events.count)
        events.after = self.integers([0] * events.count)
        self.y_event = np.zeros(2 * self.nq + 1)
        events.y = self.borrow(self.y_event)

    @property
    def event(self):
        """Number, direction, time and state of the last event."""
        events = self.run.events
        return events.which, events.direction, events.time, self.y_event.copy()

    def switch(self, method):
        """Go on with a method of `METHODS`; an implicit one must be prepared."""
        return lag_switch(&self.run, lag_method_at(METHODS.index(method)))

    def order(self, choose):
        """Let ``choose(pattern, values)`` find an order of pivots for the matrix at hand."""
        found = choose(self.pattern, self.matrix)
        cdef lag_order_of_pivots *order = &self.implicit.order
        order.n = 0
        if found is None:
            return
        self.kept_order = []  # what the former order held goes with it
        order.n = len(found.row)
        order.row, order.column = self.replaced(found.row), self.replaced(found.column)
        order.start, order.columns = self.replaced(found.start), self.replaced(found.columns)
        order.diagonal, order.places = self.replaced(found.diagonal), self.replaced(found.places)
        self.factors = np.zeros((3, len(found.columns)))
        cdef double[:, ::1] view = self.factors
        self.implicit.factors = &view[0, 0]
        self.implicit.complex_re, self.implicit.complex_im = &view[1, 0], &view[2, 0]

    cdef const int32_t *replaced(self, array) except NULL:
        self.kept_order.append(array)
        cdef const int32_t[::1] view = array
        return &view[0]

    def start(self):
        """Prepare the first step; sample what lies at the start."""
        cdef int status
        with nogil:
            status = lag_start(&self.run)
            if status == 0:
                status = lag_sample_until(&self.run, self.run.t)
        return status

    def advance(self, long slice):
        """Take at most ``slice`` steps."""
        cdef int status
        with nogil:
            status = lag_advance(&self.run, slice)
        return status

    def sample_until(self, double end):
        """Sample the last step up to a time."""
        return lag_sample_until(&self.run, end)

    def dense(self, double t):
        """Return the last step's state at a time in it."""
        cdef double[::1] view = self.y_dense
        lag_dense(&self.run, t, &view[0])
        return self.y_dense.copy()

    def take(self):
        """Return the samples since the last call."""
        rows = self.block[: self.run.block_used]
        if self.run.times_next < self.run.times_count:
            rows = rows.copy()  # more are to come
        self.run.block_used = 0
        return rows

    def limit(self, double h_max):
        """Set the largest step, s."""
        self.run.h_max = h_max
        if self.run.h > h_max:
            self.run.h = h_max

    def move(self, double t, y, long times_next):
        """Go on from another state; `start` must follow."""
        self.run.t = t
        self.y[:] = y
        self.run.times_next = times_next

    @property
    def t(self):
        """Time reached, s."""
        return self.run.t

    @property
    def state(self):
        """(q, v, W) there."""
        return self.y.copy()

    @property
    def absolute_tolerances(self):
        """The absolute tolerances of q, v and W now."""
        return self.tolerances.copy()

    @property
    def step(self):
        """Start and end of the last step, s."""
        return self.run.t_old, self.run.t

    @property
    def counts(self):
        """Steps, rejected steps, evaluations."""
        return self.run.steps, self.run.rejected, self.run.evaluations

    @property
    def lengths(self):
        """The largest lengths that the rows of B times sizes have had, (nc,)."""
        return self.kept_lengths.copy()

    @property
    def times_next(self):
        """Index of the next sample time."""
        return self.run.times_next

    @property
    def t_bad(self):
        """Time at which the equations had no finite value."""
        return self.run.t_bad


include "lanes.pxi"
