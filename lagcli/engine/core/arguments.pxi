"""What the core is given: structures of pointers into arrays."""


cdef bint _is_flat(values):
    """Return whether values are a list or a tuple of numbers."""
    return isinstance(values, (list, tuple)) and not (values and hasattr(values[0], "__len__"))


cdef class _Arguments:
    """What the core is given for the time of a call: structures that point into arrays."""

    cdef list arrays

    def __cinit__(self):
        self.arrays = []

    cdef void *room(self, Py_ssize_t size) except NULL:
        memory = bytearray(size)  # of zeros
        self.arrays.append(memory)
        return PyByteArray_AS_STRING(memory)

    # a pointer is never NULL, also to nothing: C forbids that even for copies of no bytes

    cdef const double *doubles(self, values) except NULL:
        cdef double *to
        if _is_flat(values):
            to = <double *>self.room(max(1, len(values)) * sizeof(double))
            for i, x in enumerate(values):
                to[i] = x
            return to
        array = np.ascontiguousarray(values, dtype=float).reshape(-1)
        array = array if array.size else np.zeros(1)
        self.arrays.append(array)
        cdef const double[::1] view = array
        return &view[0]

    cdef const int32_t *integers(self, values) except NULL:
        cdef int32_t *to
        if _is_flat(values):
            to = <int32_t *>self.room(max(1, len(values)) * sizeof(int32_t))
            for i, x in enumerate(values):
                to[i] = x
            return to
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
