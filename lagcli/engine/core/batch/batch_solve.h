/* Contents of the dynamics tapes of eight lanes: matrices, factors, solutions; see solution.c for one. */

/* An output of a tape, eight numbers. */
#define OUTPUT(tape, i) ((tape)->registers + (tape)->outputs[i])

/* Set t, q and v (of lanes) as a tape's inputs and run it, or a part (lag_part). */
static void batch_evaluate(const lag_batch_tape *tape, const lag_system *s, const double *t,
                           const double *y, int part)
{
    memcpy(tape->registers, t, LAG_LANES * sizeof(double));
    memcpy(tape->registers + LAG_LANES, y, 2 * (size_t)s->nq * LAG_LANES * sizeof(double));
    batch_tape_run(tape, part ? &tape->output_subsets[part - 1] : &tape->stream);
}

/* y' (of lanes) at the state of the dynamics tape. */
static void batch_derivative(const lag_octet *o, double *f)
{
    const lag_system *s = o->system;
    const lag_batch_tape *d = &o->dynamics;
    const int nq = s->nq;
    memcpy(f, d->registers + (1 + nq) * LAG_LANES, (size_t)nq * LAG_LANES * sizeof(double));
    for (int i = 0; i < nq; ++i)
        memcpy(f + (nq + i) * LAG_LANES, OUTPUT(d, lag_first_solution(s) + i),
               LAG_LANES * sizeof(double));
    memcpy(f + 2 * nq * LAG_LANES, OUTPUT(d, lag_first_total_power(s)), LAG_LANES * sizeof(double));
}

/* Put `count` outputs of a tape's deferred stream for other right sides, given from register `input` on,
 * in x. */
static void batch_other(const lag_octet *o, int deferred, int input, int inputs, int output, int count,
                        double *x)
{
    const lag_batch_tape *d = &o->dynamics;
    memcpy(d->registers + input * LAG_LANES, x, (size_t)inputs * LAG_LANES * sizeof(double));
    batch_tape_run(d, &d->deferred[deferred]);
    for (int i = 0; i < count; ++i)
        memcpy(x + i * LAG_LANES, OUTPUT(d, output + i), LAG_LANES * sizeof(double));
}

/* Solve [[M, B'], [B, 0]] x = x with the matrix of the dynamics tape. */
static void batch_solve(const lag_octet *o, double *x)
{
    const int n = o->system->nq + o->system->nc;
    const int output = lag_first_others(o->system);
    batch_other(o, 1, o->single->solver.other_right, n, output, n, x);
    for (int i = o->system->nq * LAG_LANES; i < n * LAG_LANES; ++i)
        x[i] = -x[i];
}

/* The smallest change x (nq), in the metric of M, with B x = rhs (nc): see lag_correction. */
static void batch_correct(const lag_octet *o, double *x)
{
    const int nq = o->system->nq, nc = o->system->nc, n = nq + nc;
    const int output = lag_first_others(o->system) + n;
    batch_other(o, 2, o->single->solver.other_right + n, nc, output, nq, x);
}

/* (f, gamma) less the matrix times x = (a, -lambda), to r; the sums of the magnitudes to size, where
 * it is given. */
static void batch_residual(const lag_octet *o, const double *x, double *r, double *size)
{
    const lag_system *s = o->system;
    const lag_batch_tape *d = &o->dynamics;
    const int nq = s->nq, n = nq + s->nc;
    EACH_PART (k) {
        for (int i = 0; i < n; ++i) {
            const int output = i < nq ? lag_first_forcing(s) + i : lag_first_rhs(s) + i - nq;
            const vec right = READ(OUTPUT(d, output) + k);
            AT(r + i * LAG_LANES + k) = right;
            if (size)
                AT(size + i * LAG_LANES + k) = magnitude(right);
        }
        for (int i = 0; i < s->nm; ++i) {
            const int row = s->mass_row[i] * LAG_LANES + k;
            const vec part = READ(OUTPUT(d, i) + k)
                             * READ(x + s->mass_column[i] * LAG_LANES + k);
            AT(r + row) -= part;
            if (size)
                AT(size + row) += magnitude(part);
        }
        for (int i = 0; i < s->nb; ++i) {
            const int row = (nq + s->jacobian_row[i]) * LAG_LANES + k;
            const int column = s->jacobian_column[i] * LAG_LANES + k;
            const vec b = READ(OUTPUT(d, lag_first_jacobian(s) + i) + k);
            const vec one = b * READ(x + column), other = b * READ(x + row);
            AT(r + row) -= one;
            AT(r + column) -= other;
            if (size) {
                AT(size + row) += magnitude(one);
                AT(size + column) += magnitude(other);
            }
        }
    }
}

/* x = (a, -lambda) from the dynamics tape. */
static void batch_solution(const lag_octet *o, double *x)
{
    const lag_system *s = o->system;
    const int nq = s->nq, n = nq + s->nc;
    EACH_PART (k)
        for (int i = 0; i < n; ++i) {
            const vec given = READ(OUTPUT(&o->dynamics, lag_first_solution(s) + i) + k);
            AT(x + i * LAG_LANES + k) = i < nq ? given : -given;
        }
}

/* x = (a, -lambda), with one step of iterative refinement. */
static void batch_refined(const lag_octet *o, double *x)
{
    const int n = (o->system->nq + o->system->nc) * LAG_LANES;
    batch_solution(o, x);
    batch_residual(o, x, o->right, 0);
    batch_solve(o, o->right);
    EACH_PART (k)
        for (int i = k; i < n; i += LAG_LANES)
            AT(x + i) += READ(o->right + i);
}

/* Whether a row of B is one of those that the common elimination leaves out, at the given places. */
static int batch_leaves_out(const lag_octet *o, const int32_t *places, int row)
{
    for (int j = lag_left_out(o->single) - 1; j >= 0; --j)
        if (places[j] == row)
            return 1;
    return 0;
}

/* The lanes in which x is not accurate enough: lag_inaccuracy of equations.c. */
static int batch_inaccurate(const lag_octet *o, const double *x, double rtol)
{
    const int n = o->system->nq + o->system->nc;
    double *r = o->work, *size = o->work + n * LAG_LANES;
    const double allowed = fmin(fmax(ACCURATE * rtol, MOST_ACCURATE), LEAST_ACCURATE);
    int bad_lanes = 0;
    batch_residual(o, x, r, size);
    EACH_PART (k) {
        vec largest = all(0.0);
        mask bad = {0};
        for (int i = 0; i < n; ++i)
            largest = larger(READ(size + i * LAG_LANES + k), largest);
        for (int i = 0; i < n; ++i) {
            if (batch_leaves_out(o, o->single->rows.left_out, i - o->system->nq))
                continue; /* batch_overlooked is about these */
            const vec bound = READ(size + i * LAG_LANES + k) + NEXT_TO_ALL * largest;
            bad |= ~(magnitude(READ(r + i * LAG_LANES + k)) <= allowed * bound);
        }
        bad_lanes |= set_of(bad, k);
    }
    return bad_lanes;
}
