# Interval evaluation of tapes, for tests; see tape/interval.h.


cdef extern from "tape/interval.h":
    int lag_enclose_program(
        const lag_memory *memory, const lag_program *program, const double *inputs, double high,
        int order, double *out)


def enclosures(tape, inputs, double high, int order):
    """Return bounds of the Taylor coefficients of a tape's outputs: (outputs, order + 1, 2).

    The first input is in an interval from its value to `high`, the others are fixed.
    """
    cdef _Arguments arguments = _Arguments()
    cdef lag_program program = arguments.program(assemble(tape))
    out = np.empty((len(tape.outputs), order + 1, 2))
    cdef double[:, :, ::1] view = out
    _checked(lag_enclose_program(
        &_MEMORY, &program, arguments.doubles(inputs), high, order, &view[0, 0, 0]))
    return out
