# The lanes' part of the binding; see lanes.h.

from lagcli.engine.program.subprograms import unpacked

from libc.stdint cimport int64_t


cdef extern from "lanes.h":
    enum: LAG_LANES

    cdef enum lag_lane_status:
        LAG_LANE_WAITING
        LAG_LANE_UNDER_WAY
        LAG_LANE_DONE
        LAG_LANE_LEFT

    ctypedef struct lag_lane_tape:
        const int32_t *prelude
        const int32_t *stream
        const int32_t *later[3]
        const int32_t *alone[2]
        const int32_t *outputs
        double *registers

    ctypedef struct lag_octet:
        const lag_system *system
        const lag_run *single
        lag_lane_tape dynamics, constraint
        double *scale_position
        double *scale_velocity
        double *right
        double *x
        double *work
        double *trial

    ctypedef struct lag_lanes:
        const lag_system *system
        double t_start, t_end, h_max, rtol
        int watching, detecting
        long max_steps
        const double *times
        long times_count
        long runs, next
        int parameters_count
        const double *parameters
        const double *states
        int32_t *status
        int64_t *counts
        double *samples
        int64_t *free_slots
        int64_t free_count
        int64_t *finished
        int64_t *finished_slots
        int64_t finished_count
        lag_octet moving, sampled
        int64_t run[LAG_LANES]
        double *y
        double *y_new
        double *before
        double *projected
        double *dense_y
        double *stages
        double *dense
        double *lengths
        double *atol
        double *size
        double *gross
        double *later
        double *largest
        lag_run *single
        const int32_t *single_dynamics_prelude
        const int32_t *single_constraint_prelude

    ctypedef struct lag_lane_kernel:
        int (*advance)(lag_lanes *lanes, long attempts) nogil
        void (*table)(
            const lag_lane_tape *tape, const double *parameters, int parameters_count,
            const double *table, long rows, int columns, long width, int outputs, double *out,
        ) nogil
        void (*sincos)(const double *x, double *sine, double *cosine) nogil

    const lag_lane_kernel *lag_lanes_kernel(int portable)
    void lag_lanes_stream(const int32_t *stream, int32_t *out)
    void lag_lanes_leave(lag_lanes *lanes, int lane)


LANES = LAG_LANES


cdef class _LaneMemory:
    """Memory that lives as long as what points into it."""

    cdef object keep

    cdef double *borrow(self, array) except NULL:
        if array.size == 0:
            array = np.zeros(1)
        self.keep.append(array)
        cdef double[::1] view = array.reshape(-1)
        return &view[0]

    cdef double *lanes(self, long n) except NULL:
        return self.borrow(_aligned(n * LAG_LANES))

    cdef int32_t *integers(self, values) except NULL:
        array = _integers(values)
        self.keep.append(array)
        cdef int32_t[::1] view = array
        return &view[0]

    cdef int64_t *longs(self, array) except NULL:
        self.keep.append(array)
        cdef int64_t[::1] view = array.reshape(-1)
        return &view[0]

    cdef const int32_t *stream(self, stream) except NULL:
        single = unpacked(stream)
        out = np.empty_like(single)
        cdef int32_t[::1] given = single
        cdef int32_t *place = self.integers(out)
        lag_lanes_stream(&given[0], place)
        return place

    cdef int bind_lanes(self, lag_lane_tape *tape, program) except -1:
        cdef double[::1] numbers = program.registers
        cdef long i, l
        tape.prelude, tape.stream = self.stream(program.prelude), self.stream(program.main)
        for i, stream in enumerate(program.later):
            tape.later[<int>i] = self.stream(stream)
        for i, stream in enumerate(program.alone):
            tape.alone[<int>i] = self.stream(stream)
        tape.outputs = self.integers(program.outputs * LAG_LANES)
        tape.registers = self.lanes(len(numbers))
        for i in range(len(numbers)):
            for l in range(LAG_LANES):
                tape.registers[i * LAG_LANES + l] = numbers[i]
        return 0


cdef class Lanes(_LaneMemory):
    """Integrates many runs of one System, eight at a time; see core/lanes.h.

    Parameters
    ----------
    single : Integrator
        What looks closer at one run: with the settings of all and an unrolled elimination.
    dynamics, constraint : Program
        As the single one has them.
    times : (nt,) array
    max_steps : int
    parameters : (n, np) array
    states : (n, 2 nq) array
        q and v at the start.
    slots : int
        Runs whose samples are held at once, more than LANES.
    portable : bool
        Do without the processor's own instructions.
    """

    cdef lag_lanes s
    cdef const lag_lane_kernel *kernel
    cdef Integrator single
    cdef readonly object status, counts, samples
    cdef object finished, finished_slots

    def __init__(
        self, Integrator single, dynamics, constraint, times, long max_steps, parameters, states,
        long slots, bint portable=False,
    ):
        cdef lag_run *run = &single.run
        cdef int l
        cdef int nq = single.nq, nc = single.nc, n = 2 * nq + 1
        cdef lag_lanes *s = &self.s
        self.keep, self.single, self.kernel = [], single, lag_lanes_kernel(portable)
        s.system, s.single = run.system, run
        for l in range(nq):
            run.sizes[l] = 1.0  # each lane has parameters, and so inertia, of its own
        s.single_dynamics_prelude = self.integers(dynamics.prelude)
        s.single_constraint_prelude = self.integers(constraint.prelude)
        s.t_start, s.t_end, s.h_max = run.t, run.t_end, run.h_max
        s.rtol = run.rtol
        s.watching, s.detecting, s.max_steps = run.watching, run.detecting, max_steps
        times = np.ascontiguousarray(times, dtype=float)
        s.times, s.times_count = self.borrow(times), len(times)
        s.runs, s.next, s.parameters_count = len(states), 0, parameters.shape[1]
        s.parameters = self.borrow(np.ascontiguousarray(parameters, dtype=float))
        s.states = self.borrow(np.ascontiguousarray(states, dtype=float))
        self.status = np.zeros(len(states) + 1, dtype=np.int32)
        cdef int32_t[::1] status = self.status
        s.status = &status[0]
        self.counts = np.zeros((len(states) + 1, 3), dtype=np.int64)
        s.counts = self.longs(self.counts)
        self.samples = np.empty((slots, len(times), 2 + 3 * nq + nc))
        s.samples = self.borrow(self.samples)
        s.free_slots, s.free_count = self.longs(np.arange(slots)[::-1].copy()), slots
        self.finished, self.finished_slots = np.zeros((2, slots), dtype=np.int64)
        s.finished, s.finished_slots = self.longs(self.finished), self.longs(self.finished_slots)
        s.finished_count = 0
        self.bind_octet(&s.moving, dynamics, constraint)
        self.bind_octet(&s.sampled, dynamics, constraint)
        for l in range(LAG_LANES):
            s.run[l] = -1
        s.y, s.y_new, s.before = self.lanes(n), self.lanes(n), self.lanes(n)
        s.projected, s.dense_y = self.lanes(n), self.lanes(n)
        s.stages, s.dense = self.lanes(16 * n), self.lanes(7 * n)
        s.lengths = self.lanes(nc)
        s.atol, s.size = self.lanes(n), self.lanes(n)
        s.gross, s.later = self.lanes(nq), self.lanes(nq)
        s.largest = self.lanes(2 * run.kinds)

    cdef int bind_octet(self, lag_octet *o, dynamics, constraint) except -1:
        cdef const lag_system *system = self.s.system
        cdef int n = system.nq + system.nc
        o.system, o.single = system, &self.single.run
        self.bind_lanes(&o.dynamics, dynamics)
        self.bind_lanes(&o.constraint, constraint)
        o.scale_position, o.scale_velocity = self.lanes(system.nh), self.lanes(system.nc)
        o.right, o.x, o.work = self.lanes(n), self.lanes(n), self.lanes(2 * n)
        o.trial = self.lanes(system.nq)
        return 0

    def advance(self, long attempts):
        """Try at most so many steps in each lane; return RUNNING, BLOCK_FULL or DONE."""
        cdef int status
        with nogil:
            status = self.kernel.advance(&self.s, attempts)
        return status

    def take(self):
        """Return the runs done since the last call and their samples, by run."""
        cdef long i, count = self.s.finished_count
        slots = self.finished_slots[:count]
        runs, samples = self.finished[:count].copy(), self.samples[slots]
        for i in range(count):
            self.s.free_slots[self.s.free_count] = self.s.finished_slots[i]
            self.s.free_count += 1
        self.s.finished_count = 0
        return runs, samples

    def under_way(self):
        """Return the run in each lane; −1 where there is none."""
        return [self.s.run[l] for l in range(LAG_LANES)]

    def leave(self, int lane):
        """Let the run in a lane leave it."""
        lag_lanes_leave(&self.s, lane)


cdef class LaneTable(_LaneMemory):
    """A program evaluated over the rows of tables, eight at a time; by one thread at a time.

    Parameters
    ----------
    program : Program
    inputs, parameters : int
        Numbers of all inputs, and of those among them, the last, that are the same for a table.
    portable : bool
        As for Lanes.
    """

    cdef lag_lane_tape tape
    cdef const lag_lane_kernel *kernel
    cdef readonly int columns, parameters, outputs

    def __init__(self, program, int inputs, int parameters, bint portable=False):
        self.keep, self.kernel = [], lag_lanes_kernel(portable)
        self.bind_lanes(&self.tape, program)
        self.columns, self.parameters = inputs - parameters, parameters
        self.outputs = len(program.outputs)

    def __call__(self, tables, parameters):
        """Return the outputs, (tables, outputs, rows).

        Parameters
        ----------
        tables : (n, rows, width) array
            The first of each row are the inputs.
        parameters : (n, parameters) array
        """
        cdef long i, count = tables.shape[0], rows = tables.shape[1], width = tables.shape[2]
        out = np.empty((count, self.outputs, rows))
        if not out.size:
            return out
        cdef double[:, :, ::1] given = np.ascontiguousarray(tables, dtype=float)
        cdef double[::1] values = np.append(parameters, 0.0)  # never empty
        cdef double[:, :, ::1] view = out
        with nogil:
            for i in range(count):
                self.kernel.table(
                    &self.tape, &values[0] + i * self.parameters, self.parameters,
                    &given[i, 0, 0], rows, self.columns, width, self.outputs, &view[i, 0, 0],
                )
        return out


def lanes_sincos(x, bint portable=False):
    """Return sin and cos of numbers as the lanes have them.

    Parameters
    ----------
    x : (n,) array
    """
    cdef const lag_lane_kernel *kernel = lag_lanes_kernel(portable)
    cdef long i, count = len(x)
    cdef double[::1] given = np.concatenate([x, np.zeros(LAG_LANES)])
    out = np.zeros((2, count + LAG_LANES))
    cdef double[:, ::1] view = out
    for i in range(0, count, LAG_LANES):
        kernel.sincos(&given[i], &view[0, i], &view[1, i])
    return out[:, :count]
