#include "solution.h"

#include <math.h>
#include <string.h>

#include "linear/dense.h"
#include "linear/ldl.h"
#include "tape/vectors.h"

/* Order of the dense linear system. */
static int order_of(const lag_run *run)
{
    return run->system.nq + 2 * run->system.nc - run->rows.rank;
}

int lag_left_out(const lag_run *run)
{
    return run->rows.left_out && lag_solving_by(run) != LAG_BY_LU ? run->system.nc - run->rows.rank : 0;
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
    const lag_tape *d = &s->dynamics, *e = lag_equations_tape(s);
    const int nq = s->nq, nc = s->nc, n = order_of(run), first = lag_first_jacobian(s);
    double *k = run->dense.matrix, *w = run->dense.weight;
    memset(k, 0, (size_t)n * n * sizeof(double));
    for (int i = 0; i < s->nm; ++i) {
        const int row = s->mass_row[i], column = s->mass_column[i];
        k[row * n + column] = OUT(e, i) * run->rows.sizes[row] * run->rows.sizes[column];
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
        if (lag_scaled_rows(run, s->blocks, d, first))
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

#define FACTORS 8 /* number of pivots whose product is in the range of numbers */

/* The logarithm of a product, of factors given one by one. */
typedef struct {
    double sum, product;
    int factors;
} logarithm;

static void multiply(logarithm *of, double factor)
{
    of->product *= factor;
    if (++of->factors % FACTORS == 0) {
        of->sum += log(fabs(of->product));
        of->product = 1.0;
    }
}

double lag_log_determinant(lag_run *run)
{
    const lag_tape *d = &run->system.dynamics;
    logarithm of = {0.0, 1.0, 0};
    if (lag_solving_by(run) == LAG_BY_TAPE) {
        lag_tape_run(d, &d->deferred[0]);
        return OUT(d, lag_first_determinant(&run->system));
    }
    if (lag_solving_by(run) == LAG_BY_LU) { /* of a matrix with scaled rows */
        const int n = order_of(run);
        for (int k = 0; k < n; ++k)
            multiply(&of, run->dense.lu[k * n + k]);
        for (int i = 0; i < run->system.nc; ++i)
            multiply(&of, 1.0 / (run->dense.weight[i] * run->dense.weight[i]));
    } else {
        const lag_elimination *ldl = &run->factors.plan;
        const double *inverse = run->factors.factors, *beside = inverse + ldl->n;
        for (int k = 0; k < ldl->n; ++k)
            if (ldl->paired[k]) {
                multiply(&of, 1.0 / (inverse[k] * inverse[k + 1] - beside[k] * beside[k]));
                ++k;
            } else {
                multiply(&of, 1.0 / inverse[k]);
            }
    }
    return of.sum + log(fabs(of.product));
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
    for (int i = 0; i < s->nm / s->blocks; ++i)
        if (run->factors.plan.mass_targets[i] >= 0)
            f[run->factors.plan.mass_targets[i]] = OUT(d, i);
    for (int i = 0; i < s->nb / s->blocks; ++i)
        if (run->factors.plan.jacobian_targets[i] >= 0)
            f[run->factors.plan.jacobian_targets[i]] = OUT(d, lag_first_jacobian(s) + i);
    lag_ldl_factor(ldl, &run->factors.nodes, s->vectors, f, run->factors.product);
    for (int i = 0; i < count; ++i)
        sum += f[i];
    return !isfinite(sum);
}

int lag_factor(lag_run *run, double t, const double *y)
{
    const lag_system *s = &run->system;
    const lag_tape *d = &s->dynamics;
    const int way = lag_solving_by(run) != LAG_BY_LU ? LAG_FACTORED : LAG_FACTORED_DENSE;
    /* an unrolled elimination's factors may do without some rows of B */
    lag_evaluate(d, s, t, y, way == LAG_FACTORED ? LAG_FACTORS : LAG_ALL);
    if (lag_solving_by(run) == LAG_BY_TAPE || d->held[1] == way)
        return 0;
    const int bad = way == LAG_FACTORED ? factor(run) : factor_dense(run);
    d->held[1] = bad ? LAG_NOT_FACTORED : way;
    return bad;
}

void lag_residual(const lag_run *run, const double *right, const double *x, double *r,
                     double *size)
{
    const lag_system *s = &run->system;
    const lag_tape *d = &s->dynamics, *e = lag_equations_tape(s);
    const int nq = s->nq, n = nq + s->nc;
    memcpy(r, right, (size_t)n * sizeof(double));
    if (size)
        for (int i = 0; i < n; ++i)
            size[i] = fabs(right[i]);
    for (int i = 0; i < s->nm; ++i) {
        const int row = s->mass_row[i];
        const double part = OUT(e, i) * x[s->mass_column[i]];
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

void lag_turn(double *x, int n)
{
    for (int i = 0; i < n; ++i)
        x[i] = -x[i];
}

/* Start of the tape's solution for another right side; the one for the constraints follows. */
static int first_other(const lag_run *run)
{
    return lag_first_others(&run->system);
}

/* Copy some blocks of unknowns, or add them. */
static void copy_blocks(const lag_run *run, int first, int end, const double *from, double *to)
{
    const lag_system *s = &run->system;
    const int nq = s->nq / s->blocks, nc = s->nc / s->blocks, count = end - first;
    memcpy(to + first * nq, from + first * nq, (size_t)(count * nq) * sizeof(double));
    memcpy(to + s->nq + first * nc, from + s->nq + first * nc, (size_t)(count * nc) * sizeof(double));
}

static void add_blocks(const lag_run *run, int first, int end, const double *from, double *to)
{
    const lag_system *s = &run->system;
    const int nq = s->nq / s->blocks, nc = s->nc / s->blocks;
    for (int i = first * nq; i < end * nq; ++i)
        to[i] += from[i];
    for (int i = s->nq + first * nc; i < s->nq + end * nc; ++i)
        to[i] += from[i];
}

/* Solve with the last factors instead of the right side of one block; not by the dense solution. */
static void substitute_block(lag_run *run, double *x)
{
    const lag_elimination *ldl = &run->factors.plan;
    const lag_tape *d = &run->system.dynamics;
    const int nq = run->system.nq / run->system.blocks, n = nq + run->system.nc / run->system.blocks;
    const double *f = run->factors.factors;
    if (run->solver.by == LAG_BY_TAPE) {
        memcpy(d->registers + run->solver.other_right, x, (size_t)n * sizeof(double));
        lag_tape_run(d, &d->deferred[1]);
        d->vectors->pick(n, d->registers, d->outputs + first_other(run), x);
        lag_turn(x + nq, n - nq);
    } else {
        lag_ldl_solve(ldl, f, run->step.work + n * run->system.blocks, x);
        for (int j = lag_left_out(run) - 1; j >= 0; --j)
            x[nq + run->rows.left_out[j]] = 0.0;
    }
}

/* The same for some of the blocks; x is that of all of them. */
static void substitute(lag_run *run, int first, int end, double *x)
{
    const lag_system *s = &run->system;
    const int nq = s->nq / s->blocks, nc = s->nc / s->blocks;
    if (s->blocks == 1) {
        substitute_block(run, x);
        return;
    }
    double *one = run->solver.block;
    for (int k = first; k < end; ++k) {
        double *a = x + k * nq, *rest = x + s->nq + k * nc;
        memcpy(one, a, (size_t)nq * sizeof(double));
        memcpy(one + nq, rest, (size_t)nc * sizeof(double));
        substitute_block(run, one);
        memcpy(a, one, (size_t)nq * sizeof(double));
        memcpy(rest, one + nq, (size_t)nc * sizeof(double));
    }
}

/* Refine the solution of some blocks. */
static void refine_blocks(lag_run *run, int first, int end, const double *right, double *x)
{
    double *r = run->step.work;
    lag_residual(run, right, x, r, 0);
    substitute(run, first, end, r);
    add_blocks(run, first, end, r, x);
}

void lag_correct(lag_run *run, double *residual)
{
    substitute(run, 0, run->system.blocks, residual);
}

double lag_solve_tangent(lag_run *run, double *x)
{
    const lag_system *s = &run->system;
    const lag_tape *d = &s->dynamics, *w = &s->tangent;
    const lag_vector_kernel *vectors = s->vectors;
    const int nq = s->nq / s->blocks, nc = s->nc / s->blocks;
    const int32_t *outputs = d->outputs + first_other(run);
    double sum = 0.0;
    for (int k = 1; k < s->blocks; ++k) {
        const int32_t *right = w->outputs + (k - 1) * (nq + nc);
        vectors->pick(nq + nc, w->registers, right, d->registers + run->solver.other_right);
        lag_tape_run(d, &d->deferred[1]);
        sum += vectors->pick(nq, d->registers, outputs, x + k * nq);
        sum += vectors->pick(nc, d->registers, outputs + nq, x + s->nq + k * nc);
    }
    return sum;
}

void lag_refine(lag_run *run, const double *right, double *x)
{
    refine_blocks(run, 0, 1, right, x);
}

void lag_solve_blocks(lag_run *run, int first, int end, double *right, double *x, int refined)
{
    if (lag_solving_by(run) == LAG_BY_LU) {
        solve_dense(run, right, x, refined);
        return;
    }
    copy_blocks(run, first, end, right, x);
    substitute(run, first, end, x);
    if (refined)
        refine_blocks(run, first, end, right, x);
}

void lag_solve(lag_run *run, double *right, double *x, int refined)
{
    lag_solve_blocks(run, 0, run->system.blocks, right, x, refined);
}

void lag_respond(lag_run *run, const double *forces, double *x)
{
    const int nq = run->system.nq, nc = run->system.nc;
    double *right = run->solver.right;
    memcpy(right, forces, (size_t)nq * sizeof(double));
    memset(right + nq, 0, (size_t)nc * sizeof(double));
    lag_solve(run, right, x, 0);
    lag_turn(x + nq, nc);
}

double lag_correction(lag_run *run, const double *rhs, double *x)
{
    const lag_system *s = &run->system;
    const lag_tape *d = &s->dynamics;
    const int nq = s->nq, nc = s->nc;
    double sum = 0.0;
    if (lag_solving_by(run) == LAG_BY_TAPE) {
        const int mq = nq / s->blocks, mc = nc / s->blocks; /* of one block */
        for (int k = 0; k < s->blocks; ++k) {
            memcpy(d->registers + run->solver.other_right + mq + mc, rhs + k * mc, (size_t)mc * sizeof(double));
            lag_tape_run(d, &d->deferred[2]);
            sum += d->vectors->pick(mq, d->registers, d->outputs + first_other(run) + mq + mc, x + k * mq);
        }
        return sum;
    }
    double *right = run->solver.right, *all = run->solver.a;
    memset(right, 0, (size_t)nq * sizeof(double));
    memcpy(right + nq, rhs, (size_t)nc * sizeof(double));
    lag_solve(run, right, all, 0);
    for (int i = 0; i < nq; ++i)
        sum += x[i] = all[i];
    return sum;
}

void lag_oppose(lag_run *run, double *x)
{
    const int nq = run->system.nq, nc = run->system.nc / run->system.blocks;
    double *all = run->solver.solution;
    if (lag_solving_by(run) == LAG_BY_LU) {
        double *right = run->solver.right;
        all = run->step.work;
        memset(right, 0, (size_t)nq * sizeof(double));
        memcpy(right + nq, x, (size_t)nc * sizeof(double));
        solve_dense(run, right, all, 0);
    } else {
        memset(all, 0, (size_t)nq * sizeof(double));
        memcpy(all + nq, x, (size_t)nc * sizeof(double));
        substitute(run, 0, 1, all);
    }
    for (int i = 0; i < nc; ++i)
        x[i] = -all[nq + i];
}

