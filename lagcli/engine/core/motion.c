#include "motion.h"

#include <math.h>
#include <string.h>

#include "linear/ldl.h"
#include "linear/dense.h"
#include "tape/vectors.h"


/* Which factors of the matrix are at hand for the state that the dynamics tape holds. */
enum lag_factored { NOT_FACTORED, FACTORED, FACTORED_DENSE };

int lag_size(const lag_system *s)
{
    return 2 * s->nq + 1;
}

/* Whether n numbers have the same bits. */
static int same(int n, const double *x, const double *y)
{
    for (int i = 0; i < n; ++i) {
        uint64_t a, b;
        memcpy(&a, x + i, sizeof a);
        memcpy(&b, y + i, sizeof b);
        if (a != b)
            return 0;
    }
    return 1;
}

void lag_evaluate(const lag_tape *tape, const lag_system *s, double t, const double *y, int part)
{
    double *r = tape->registers;
    if (part && !tape->output_subsets[part - 1])
        part = LAG_ALL;
    if (r[0] == t && same(2 * s->nq, r + 1, y)) {
        if (tape->held[0] == LAG_ALL || tape->held[0] == part)
            return;
    } else {
        r[0] = t;
        memcpy(r + 1, y, 2 * (size_t)s->nq * sizeof(double));
    }
    tape->held[0] = part;
    tape->held[1] = NOT_FACTORED;
    lag_stream_run(part ? tape->output_subsets[part - 1] : tape->stream, r);
}

/* Order of the dense linear system. */
static int order_of(const lag_run *run)
{
    return run->system.nq + 2 * run->system.nc - run->rows.rank;
}

enum lag_solution lag_solving_by(const lag_run *run)
{
    return run->solver.dense_steps ? LAG_BY_LU : run->solver.by;
}

void lag_row_squares(const lag_system *s, const lag_tape *tape, int first, const double *sizes,
                     double *sum)
{
    memset(sum, 0, (size_t)s->nc * sizeof(double));
    for (int i = 0; i < s->nb; ++i) {
        const double x = OUT(tape, first + i) * (sizes ? sizes[s->jacobian_column[i]] : 1.0);
        sum[s->jacobian_row[i]] += x * x;
    }
}

int lag_scaled_rows(lag_run *run, const lag_tape *tape, int first)
{
    const lag_system *s = &run->system;
    double sum = 0.0;
    memset(run->rows.scaled, 0, (size_t)s->nq * s->nc * sizeof(double));
    for (int i = 0; i < s->nb; ++i) {
        const int row = s->jacobian_row[i], column = s->jacobian_column[i];
        const double x = OUT(tape, first + i) * run->rows.sizes[column] / run->rows.lengths[row];
        run->rows.scaled[row * s->nq + column] = x;
        sum += x;
    }
    return !isfinite(sum);
}

/*
 * Set up and factor the dense matrix, in unknowns and equations without units. Returns 0, or 1.
 *
 * Where B's rows depend on each other by N, N'B = 0, the system is bordered: what of the right side
 * contradicts is taken up by N, and N' lambda = 0 makes lambda the one of least norm. The rows are
 * then over the largest lengths that they have had: a row that vanishes in passing and depends on
 * the others is rounding error, and over its own length it would spoil them.
 */
static int factor_dense(lag_run *run)
{
    const lag_system *s = &run->system;
    const lag_tape *d = &s->dynamics;
    const int nq = s->nq, nc = s->nc, n = order_of(run), first = lag_first_jacobian(s);
    double *k = run->dense.matrix, *w = run->dense.weight;
    memset(k, 0, (size_t)n * n * sizeof(double));
    for (int i = 0; i < s->nm; ++i) {
        const int row = s->mass_row[i], column = s->mass_column[i];
        k[row * n + column] = OUT(d, i) * run->rows.sizes[row] * run->rows.sizes[column];
    }
    lag_row_squares(s, d, first, run->rows.sizes, w);
    for (int i = 0; i < nc; ++i)
        w[i] = run->rows.rank < nc ? 1.0 / run->rows.lengths[i] : w[i] > 0.0 ? 1.0 / sqrt(w[i]) : 1.0;
    for (int i = 0; i < s->nb; ++i) {
        const int row = s->jacobian_row[i], column = s->jacobian_column[i];
        const double x = OUT(d, first + i) * run->rows.sizes[column] * w[row];
        k[(nq + row) * n + column] = x;
        k[column * n + nq + row] = x;
    }
    if (run->rows.rank < nc) {
        if (lag_scaled_rows(run, d, first))
            return 1;
        lag_pivot(run->rows.scaled, nq, nc, run->rows.rank, run->rows.order, run->rows.components);
        lag_dependencies(nc, run->rows.rank, run->rows.order, run->rows.components, run->rows.dependencies);
        for (int j = 0; j < nc - run->rows.rank; ++j) {
            const double *dependency = run->rows.dependencies + j * nc;
            double *row = k + (nq + nc + j) * n + nq, largest = 0.0;
            for (int i = 0; i < nc; ++i) {
                k[(nq + i) * n + nq + nc + j] = dependency[i];
                row[i] = dependency[i] * w[i] * w[i];
                largest = fmax(largest, fabs(row[i]));
            }
            for (int i = 0; i < nc; ++i)
                row[i] /= largest;
        }
    }
    memcpy(run->dense.lu, k, (size_t)n * n * sizeof(double));
    return lag_lu(run->dense.lu, run->dense.pivots, n);
}

static void solve_dense(lag_run *run, const double *right, double *x, int refined)
{
    const int nq = run->system.nq, nc = run->system.nc, n = order_of(run);
    double *z = run->solver.solution, *b = run->solver.right, *r = run->step.work;
    for (int i = 0; i < nq; ++i)
        b[i] = right[i] * run->rows.sizes[i];
    for (int i = 0; i < nc; ++i)
        b[nq + i] = right[nq + i] * run->dense.weight[i];
    for (int i = nq + nc; i < n; ++i)
        b[i] = 0.0;
    memcpy(z, b, (size_t)n * sizeof(double));
    lag_lu_solve(run->dense.lu, run->dense.pivots, n, z);
    if (refined) {
        for (int i = 0; i < n; ++i) {
            double sum = b[i];
            const double *row = run->dense.matrix + i * n;
            for (int j = 0; j < n; ++j)
                sum -= row[j] * z[j];
            r[i] = sum;
        }
        lag_lu_solve(run->dense.lu, run->dense.pivots, n, r);
        for (int i = 0; i < n; ++i)
            z[i] += r[i];
    }
    for (int i = 0; i < nq; ++i)
        x[i] = z[i] * run->rows.sizes[i];
    for (int i = 0; i < nc; ++i)
        x[nq + i] = z[nq + i] * run->dense.weight[i];
}

/* Set up the matrix and factor it by the static elimination, in a loop. Returns 0, or 1. */
static int factor(lag_run *run)
{
    const lag_system *s = &run->system;
    const lag_tape *d = &s->dynamics;
    const lag_elimination *ldl = &run->factors.plan;
    double *f = run->factors.factors, sum = 0.0;
    const int n = ldl->n, count = 2 * n + ldl->start[n];
    memset(f, 0, (size_t)count * sizeof(double));
    for (int i = 0; i < s->nm; ++i)
        if (run->factors.plan.mass_targets[i] >= 0)
            f[run->factors.plan.mass_targets[i]] = OUT(d, i);
    for (int i = 0; i < s->nb; ++i)
        f[run->factors.plan.jacobian_targets[i]] = OUT(d, lag_first_jacobian(s) + i);
    lag_ldl_factor(ldl, f, f + n, f + 2 * n, run->factors.product, run->step.work);
    for (int i = 0; i < count; ++i)
        sum += f[i];
    return !isfinite(sum);
}

int lag_factor(lag_run *run, double t, const double *y)
{
    const lag_system *s = &run->system;
    const lag_tape *d = &s->dynamics;
    const int way = lag_solving_by(run) != LAG_BY_LU ? FACTORED : FACTORED_DENSE;
    lag_evaluate(d, s, t, y, LAG_FACTORS);
    if (lag_solving_by(run) == LAG_BY_TAPE || d->held[1] == way)
        return 0;
    const int bad = way == FACTORED ? factor(run) : factor_dense(run);
    d->held[1] = bad ? NOT_FACTORED : way;
    return bad;
}

/* right less the matrix times x, to r; the sums of the magnitudes to size, where it is given. */
static void residual(const lag_run *run, const double *right, const double *x, double *r,
                     double *size)
{
    const lag_system *s = &run->system;
    const lag_tape *d = &s->dynamics;
    const int nq = s->nq, n = nq + s->nc;
    memcpy(r, right, (size_t)n * sizeof(double));
    if (size)
        for (int i = 0; i < n; ++i)
            size[i] = fabs(right[i]);
    for (int i = 0; i < s->nm; ++i) {
        const int row = s->mass_row[i];
        const double part = OUT(d, i) * x[s->mass_column[i]];
        r[row] -= part;
        if (size)
            size[row] += fabs(part);
    }
    for (int i = 0; i < s->nb; ++i) {
        const int row = nq + s->jacobian_row[i], column = s->jacobian_column[i];
        const double b = OUT(d, lag_first_jacobian(s) + i);
        r[row] -= b * x[column];
        r[column] -= b * x[row];
        if (size) {
            size[row] += fabs(b * x[column]);
            size[column] += fabs(b * x[row]);
        }
    }
}

/* The multipliers from the unknowns beside a, which are their negatives, or back. */
static void turn(double *x, int n)
{
    for (int i = 0; i < n; ++i)
        x[i] = -x[i];
}

/* Where the tape's solution for another right side begins; the one for the constraints alone follows. */
static int first_other(const lag_run *run)
{
    return lag_first_cancellation(&run->system) + run->solver.cancellation_count;
}

/* Solve with the last factors in place of the right side; not by the dense solution. */
static void substitute(lag_run *run, double *x)
{
    const lag_elimination *ldl = &run->factors.plan;
    const lag_tape *d = &run->system.dynamics;
    const int n = ldl->n;
    const double *f = run->factors.factors;
    if (run->solver.by == LAG_BY_TAPE) {
        memcpy(d->registers + run->solver.other_right, x, (size_t)n * sizeof(double));
        lag_stream_run(d->deferred[1], d->registers);
        lag_vectors()->pick(n, d->registers, d->outputs + first_other(run), x);
        turn(x + run->system.nq, run->system.nc);
    } else {
        lag_ldl_solve(ldl, f, f + n, f + 2 * n, run->step.work + n, x);
    }
}

/* One step of iterative refinement of a solution x. */
static void refine(lag_run *run, const double *right, double *x)
{
    double *r = run->step.work;
    residual(run, right, x, r, 0);
    substitute(run, r);
    for (int i = 0; i < run->factors.plan.n; ++i)
        x[i] += r[i];
}

/* Solve [[M, B'], [B, 0]] x = right with the last factors; both have nq + nc entries. `refined` by
 * one step of iterative refinement. right is destroyed. */
static void solve(lag_run *run, double *right, double *x, int refined)
{
    if (lag_solving_by(run) == LAG_BY_LU) {
        solve_dense(run, right, x, refined);
        return;
    }
    memcpy(x, right, (size_t)run->factors.plan.n * sizeof(double));
    substitute(run, x);
    if (refined)
        refine(run, right, x);
}

double lag_correction(lag_run *run, const double *rhs, double *x)
{
    const lag_system *s = &run->system;
    const lag_tape *d = &s->dynamics;
    const int nq = s->nq, nc = s->nc;
    double sum = 0.0;
    if (lag_solving_by(run) == LAG_BY_TAPE) {
        memcpy(d->registers + run->solver.other_right + nq + nc, rhs, (size_t)nc * sizeof(double));
        lag_stream_run(d->deferred[2], d->registers);
        return lag_vectors()->pick(nq, d->registers, d->outputs + first_other(run) + nq + nc, x);
    }
    double *right = run->solver.right, *all = run->solver.a;
    memset(right, 0, (size_t)nq * sizeof(double));
    memcpy(right + nq, rhs, (size_t)nc * sizeof(double));
    solve(run, right, all, 0);
    for (int i = 0; i < nq; ++i)
        sum += x[i] = all[i];
    return sum;
}

void lag_oppose(lag_run *run, double *x)
{
    const int nq = run->system.nq, nc = run->system.nc;
    double *all = run->solver.solution;
    memset(all, 0, (size_t)nq * sizeof(double));
    memcpy(all + nq, x, (size_t)nc * sizeof(double));
    substitute(run, all);
    for (int i = 0; i < nc; ++i)
        x[i] = -all[nq + i];
}

/* What of a residual exceeds its rounding errors, which damping would otherwise turn into noise: with the
 * short steps of a start from rest, beta is large. */
static double beyond_rounding(double residual, double scale)
{
    const double floor = DAMPED * scale;
    return residual > floor ? residual - floor : residual < -floor ? residual + floor : 0.0 * residual;
}

/* The right side (f, gamma) at the state that the tapes hold, to run->solver.right. */
static void right_side(lag_run *run)
{
    const lag_system *s = &run->system;
    const lag_tape *d = &s->dynamics, *c = &s->constraint;
    const int nq = s->nq, nc = s->nc;
    double *right = run->solver.right;
    lag_vectors()->pick(nq, d->registers, d->outputs + lag_first_forcing(s), right);
    lag_vectors()->pick(nc, d->registers, d->outputs + lag_first_rhs(s), right + nq);
    if (!run->baumgarte.active)
        return;
    const double alpha = run->baumgarte.alpha, beta = run->baumgarte.beta;
    const int psi = lag_constraint_velocity(s), psi_scale = lag_constraint_velocity_scale(s);
    const int scale = lag_constraint_position_scale(s);
    for (int i = 0; i < nc; ++i)
        right[nq + i] -= alpha * beyond_rounding(OUT(c, psi + i), OUT(c, psi_scale + i));
    for (int i = 0; i < s->nh; ++i) {
        const int k = s->holonomic[i];
        right[nq + k] -= alpha * beyond_rounding(OUT(c, psi + k), OUT(c, psi_scale + k))
                         + beta * beta * beyond_rounding(OUT(c, i), OUT(c, scale + i));
    }
}

/* Note where the equations have no finite value. Returns 1. */
static int undefined(lag_run *run, double t, const double *y)
{
    run->failure.t = t;
    memcpy(run->failure.y, y, (size_t)lag_size(&run->system) * sizeof(double));
    return 1;
}

int lag_accelerate(lag_run *run, double t, const double *y, int refined, double *power)
{
    const lag_system *s = &run->system;
    const lag_tape *d = &s->dynamics;
    const int nq = s->nq, nc = s->nc, n = nq + nc;
    double *x = run->solver.a; /* a, then lambda */
    int bad = 0;
    ++run->step.evaluations;
    if (run->baumgarte.active)
        lag_evaluate(&s->constraint, s, t, y, LAG_ALL);
    lag_evaluate(d, s, t, y, LAG_ALL);
    /* the unrolled tape finds a, lambda and their power itself, to its own right side */
    const int own = lag_solving_by(run) == LAG_BY_TAPE && !run->baumgarte.active;
    bad = own ? !isfinite(lag_vectors()->pick(n, d->registers, d->outputs + lag_first_solution(s), x))
              : lag_factor(run, t, y);
    if (!bad && (refined || !own)) {
        right_side(run);
        if (own) {
            turn(x + nq, nc);
            refine(run, run->solver.right, x);
        } else {
            solve(run, run->solver.right, x, refined);
        }
        turn(x + nq, nc);
        double sum = 0.0;
        for (int i = 0; i < n; ++i)
            sum += x[i];
        bad = !isfinite(sum);
    }
    if (bad)
        return undefined(run, t, y);
    if (own) {
        *power = OUT(d, lag_first_total_power(s));
        return 0;
    }
    double p = OUT(d, lag_first_power(s));
    for (int i = 0; i < s->nb; ++i)
        p += x[nq + s->jacobian_row[i]] * OUT(d, lag_first_jacobian(s) + i)
             * y[nq + s->jacobian_column[i]];
    *power = p;
    return 0;
}

int lag_derivative(lag_run *run, double t, const double *y, double *f)
{
    const lag_system *s = &run->system;
    const lag_tape *d = &s->dynamics;
    const int nq = s->nq;
    memcpy(f, y + nq, (size_t)nq * sizeof(double));
    if (lag_solving_by(run) != LAG_BY_TAPE || run->baumgarte.active || run->solver.refining) {
        if (lag_accelerate(run, t, y, run->solver.refining, f + 2 * nq))
            return 1;
        memcpy(f + nq, run->solver.a, (size_t)nq * sizeof(double));
        return 0;
    }
    /* straight from the unrolled tape; without lambda there is no a */
    ++run->step.evaluations;
    lag_evaluate(d, s, t, y, LAG_ALL);
    f[2 * nq] = OUT(d, lag_first_total_power(s));
    const int32_t *places = d->outputs + lag_first_solution(s);
    return isfinite(lag_vectors()->pick(nq, d->registers, places, f + nq)) ? 0 : undefined(run, t, y);
}

double lag_inaccuracy(lag_run *run, double t, const double *y, int refined)
{
    const lag_system *s = &run->system;
    const int nq = s->nq, n = nq + s->nc;
    double *r = run->step.work, *size = run->step.work + n, *x = run->solver.solution, power, all = 0.0;
    if (lag_solving_by(run) == LAG_BY_LU || lag_accelerate(run, t, y, refined, &power))
        return 0;
    --run->step.evaluations;
    right_side(run);
    for (int i = 0; i < n; ++i)
        x[i] = i < nq ? run->solver.a[i] : -run->solver.a[i];
    residual(run, run->solver.right, x, r, size);
    for (int i = 0; i < n; ++i)
        all = size[i] > all ? size[i] : all;
    for (int i = 0; i < n; ++i)
        size[i] += NEXT_TO_ALL * all;
    const double most = lag_vectors()->largest(n, r, size, size);
    return isnan(most) ? INFINITY : most;
}

double lag_contradiction(lag_run *run, double t, const double *y)
{
    const lag_system *s = &run->system;
    const lag_tape *d = &s->dynamics;
    const int nq = s->nq, nc = s->nc, extra = nc - run->rows.rank;
    /* the unknowns beside a and lambda: how much of each dependency there is in gamma */
    const double *taken = run->solver.solution + nq + nc;
    double most = 0.0, terms = 0.0, power;
    if (!extra || lag_accelerate(run, t, y, 0, &power))
        return 0.0;
    --run->step.evaluations;
    for (int i = 0; i < nc; ++i) {
        double part = 0.0;
        for (int j = 0; j < extra; ++j)
            part += run->rows.dependencies[j * nc + i] * taken[j];
        most = fmax(most, fabs(part));
        terms = fmax(terms, fabs(OUT(d, lag_first_rhs(s) + i)) / run->rows.lengths[i]);
    }
    for (int i = 0; i < nq; ++i)
        terms = fmax(terms, fabs(run->solver.a[i]) / run->rows.sizes[i]);
    return terms > 0.0 ? most / terms : 0.0;
}

double lag_allowed_inaccuracy(const lag_run *run)
{
    return fmin(fmax(ACCURATE * run->tolerances.rtol, MOST_ACCURATE), LEAST_ACCURATE);
}

double lag_scaled_norm(const lag_run *run, const double *x, const double *y, const double *z)
{
    const lag_tolerances *tolerances = &run->tolerances;
    const int n = lag_size(&run->system);
    return sqrt(lag_vectors()->scaled_square(n, x, y, z, tolerances->atol, tolerances->rtol));
}
