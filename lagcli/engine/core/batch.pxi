# The batches' part of the binding; see lagbatch.h.

from lagcli.engine.program.subprograms import unpacked

LANES = LAG_LANES


def _scalar(program):
    """Return a program whose operations are on single registers."""
    return program._replace(
        prelude=unpacked(program.prelude),
        main=unpacked(program.main),
        deferred=tuple(map(unpacked, program.deferred)),
        output_subsets=tuple(map(unpacked, program.output_subsets)),
    )


cdef class Batch:
    """Integrates many runs of one System, eight at a time; see core/lagbatch.h.

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

    cdef lag_batch *batch
    cdef Integrator single
    cdef readonly object status, counts, samples
    cdef long slots

    def __init__(
        self, Integrator single, dynamics, constraint, times, long max_steps, parameters, states,
        long slots, bint portable=False,
    ):
        cdef _Arguments arguments = _Arguments()
        cdef lag_program d = arguments.program(_scalar(dynamics))
        cdef lag_program c = arguments.program(_scalar(constraint))
        cdef lag_batch_settings s
        self.single, self.slots = single, slots
        s.times, s.times_count = arguments.doubles(times), len(times)
        s.max_steps, s.runs, s.slots, s.portable = max_steps, len(states), slots, portable
        s.parameters, s.states = arguments.doubles(parameters), arguments.doubles(states)
        self.status = np.zeros(len(states) + 1, dtype=np.int32)
        self.counts = np.zeros((len(states) + 1, 3), dtype=np.int64)
        width = SampleLayout(Counts(single.nq, single.nc)).size
        self.samples = np.empty((slots, len(times), width))
        cdef int32_t[::1] status = self.status
        cdef int64_t[:, ::1] counts = self.counts
        s.status, s.counts = &status[0], &counts[0, 0]
        cdef double[:, :, ::1] samples = self.samples
        s.samples = &samples[0, 0, 0]
        self.batch = lag_batch_create(&_MEMORY, single.run, &d, &c, &s)
        _checked(self.batch == NULL)

    def __dealloc__(self):
        if self.batch != NULL:
            lag_batch_destroy(self.batch)

    def advance(self, long attempts):
        """Try at most so many steps in each lane; return RUNNING, BLOCK_FULL or DONE."""
        cdef int status
        with nogil:
            status = lag_batch_advance(self.batch, attempts)
        return status

    def take(self):
        """Return the runs done since the last call and their samples, by run."""
        runs, slots = np.empty(self.slots, dtype=np.int64), np.empty(self.slots, dtype=np.int64)
        cdef int64_t[::1] run_view = runs, slot_view = slots
        cdef long count = lag_batch_take(self.batch, &run_view[0], &slot_view[0])
        return runs[:count], self.samples[slots[:count]]

    def under_way(self):
        """Return the run in each lane; −1 where there is none."""
        cdef const int64_t *runs = lag_batch_runs(self.batch)
        return [runs[l] for l in range(LAG_LANES)]

    def leave(self, int lane):
        """Let the run in a lane leave it."""
        lag_batch_leave(self.batch, lane)


cdef class BatchTable:
    """A program evaluated over the rows of tables, eight at a time; by one thread at a time.

    Parameters
    ----------
    program : Program
    inputs, parameters : int
        Numbers of all inputs, and of those among them, the last, that are the same for a table.
    portable : bool
        As for Batch.
    """

    cdef lag_table *table
    cdef readonly int columns, parameters, outputs

    def __init__(self, program, int inputs, int parameters, bint portable=False):
        cdef _Arguments arguments = _Arguments()
        cdef lag_program p = arguments.program(_scalar(program))
        self.columns, self.parameters = inputs - parameters, parameters
        self.outputs = len(program.outputs)
        self.table = lag_table_create(&_MEMORY, &p, self.columns, parameters, portable)
        _checked(self.table == NULL)

    def __dealloc__(self):
        if self.table != NULL:
            lag_table_destroy(self.table)

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
                lag_table_evaluate(
                    self.table, &values[0] + i * self.parameters, &given[i, 0, 0], rows, width,
                    &view[i, 0, 0],
                )
        return out


def batch_sincos(x, bint portable=False):
    """Return sin and cos of numbers as batches have them.

    Parameters
    ----------
    x : (n,) array
    """
    cdef long i, count = len(x)
    cdef double[::1] given = np.concatenate([x, np.zeros(LAG_LANES)])
    out = np.zeros((2, count + LAG_LANES))
    cdef double[:, ::1] view = out
    for i in range(0, count, LAG_LANES):
        lag_batch_sincos(&given[i], &view[0, i], &view[1, i], portable)
    return out[:, :count]
