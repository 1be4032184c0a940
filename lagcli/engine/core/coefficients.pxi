"""Parts of the core for themselves: tapes, the factorization, coefficients of methods."""


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
