#include "fmi/start.h"

#include <math.h>
#include <string.h>

#include "bind.h"

#define ITERATIONS 50       /* Newton steps */
#define HALVINGS 30         /* of one that does not reduce the residual */
#define RESIDUAL 2e-15      /* of the constraint's scale: end of the search */
#define ACCEPTED 1e-10      /* of the scale: largest residual of a state that counts as consistent */
#define INDEPENDENT 1e-6    /* part of a row that can be changed, at least */
#define LEAST_PART 1e-3     /* as in engine/scales.py: part of the size of the state that a scale is, at least */
#define OF_GUESS 1e-5       /* part of the scale at the guess that a scale is, at least */
#define OF_RANK 1e-8        /* part of a row that is independent of the rows before it, at least */

int lag_start_bind(lag_pool *pool, lag_start_search *s, const lag_model *model)
{
    const int nq = model->equations.nq, nc = model->equations.nc;
    s->model = model;
    s->rows = lag_doubles(pool, (int64_t)nc * nq);
    s->right = lag_doubles(pool, nc);
    s->lengths = lag_doubles(pool, nc);
    s->x = lag_doubles(pool, nq);
    s->tried = lag_doubles(pool, nq);
    s->own = lag_doubles(pool, nc);
    s->least = lag_doubles(pool, nc);
    lag_bind_program(pool, &s->constraint, &model->equations.constraint, LAG_PORTABLE);
    if (!pool->failed)
        s->constraint.parameters = s->constraint.registers + model->equations.constraint.inputs - model->equations.np;
    return pool->failed;
}

/* Evaluate the constraints at a state. */
static void evaluate(lag_start_search *s, double t, const double *y)
{
    double *r = s->constraint.registers;
    r[0] = t;
    memcpy(r + 1, y, 2 * (size_t)s->model->equations.nq * sizeof *r);
    lag_tape_run(&s->constraint, &s->constraint.stream);
}

/*
 * The least x (n) with A x = b, A of m rows, by Gram and Schmidt's orthogonalization with the row whose independent
 * part is largest next. Rows whose independent part is less than `least` of their `length` are left out. A, b and the lengths
 * are destroyed. Returns the rank.
 */
static int least_solution(double least, int m, int n, double *a, double *b, double *length, double *x)
{
    int rank = 0;
    memset(x, 0, (size_t)n * sizeof *x);
    for (; rank < m && rank < n; ++rank) {
        int next = -1;
        double largest = least, rest = 0.0;
        for (int i = 0; i < m; ++i) {
            double square = 0.0;
            if (!(length[i] > 0.0))
                continue;
            for (int j = 0; j < n; ++j)
                square += a[i * n + j] * a[i * n + j];
            if (sqrt(square) > largest * length[i]) {
                next = i;
                rest = sqrt(square);
                largest = rest / length[i];
            }
        }
        if (next < 0)
            break;
        double *row = a + next * n;
        const double y = b[next] / rest;
        length[next] = 0.0; /* done */
        for (int j = 0; j < n; ++j) {
            row[j] /= rest;
            x[j] += y * row[j];
        }
        for (int i = 0; i < m; ++i) {
            double part = 0.0;
            if (!(length[i] > 0.0))
                continue;
            for (int pass = 0; pass < 2; ++pass) { /* the second one removes rounding */
                double product = 0.0;
                for (int j = 0; j < n; ++j)
                    product += row[j] * a[i * n + j];
                for (int j = 0; j < n; ++j)
                    a[i * n + j] -= product * row[j];
                part += product;
            }
            b[i] -= part * y;
        }
    }
    return rank;
}

/* Write the rows of B times sizes, without the columns of fixed entries (NULL: none are), and the lengths of all. */
static void write_rows(lag_start_search *s, const int *fixed)
{
    const lag_equations *e = &s->model->equations;
    memset(s->rows, 0, (size_t)e->nc * (size_t)e->nq * sizeof *s->rows);
    memset(s->lengths, 0, (size_t)e->nc * sizeof *s->lengths);
    for (int i = 0; i < e->nb; ++i) {
        const int j = e->jacobian_column[i], row = e->jacobian_row[i];
        const double b = s->model->problem.sizes[j] * OUT(&s->constraint, e->nh + i);
        s->lengths[row] += b * b;
        if (!fixed || !fixed[j])
            s->rows[row * e->nq + j] = b;
    }
    for (int i = 0; i < e->nc; ++i)
        s->lengths[i] = sqrt(s->lengths[i]);
}

double lag_largest_residual(const lag_tape *tape, int n, int first, int scale)
{
    double largest = 0.0;
    for (int i = 0; i < n; ++i) {
        const double value = OUT(tape, first + i), size = OUT(tape, scale + i);
        if (!isfinite(value))
            return INFINITY;
        if (value != 0.0)
            largest = fmax(largest, size > 0.0 ? fabs(value) / size : INFINITY);
    }
    return largest;
}

/*
 * The largest of n residuals, outputs from `first` on, over their scales; INFINITY where one is not finite. All terms of
 * a constraint may vanish at a state: a scale is at least what the sizes of the coordinates x (q or v) imply, and a
 * part of that at the guess, where the search begins. `constraint` are the numbers of the constraints; NULL: from 0 on.
 */
static double residual_at(lag_start_search *s, int n, int first, int scale, const int32_t *constraint, const double *x,
                          int begins)
{
    const lag_equations *e = &s->model->equations;
    const double *sizes = s->model->problem.sizes;
    double largest = 0.0, size = 0.0;
    for (int j = 0; j < e->nq; ++j)
        size = fmax(size, fabs(x[j]) / sizes[j]);
    memset(s->own, 0, (size_t)e->nc * sizeof *s->own);
    memset(s->lengths, 0, (size_t)e->nc * sizeof *s->lengths);
    for (int i = 0; i < e->nb; ++i) {
        const int j = e->jacobian_column[i], row = e->jacobian_row[i];
        const double b = OUT(&s->constraint, e->nh + i);
        s->own[row] += fabs(b * x[j]);
        s->lengths[row] += b * sizes[j] * b * sizes[j];
    }
    for (int i = 0; i < n; ++i) {
        const int row = constraint ? constraint[i] : i;
        const double value = OUT(&s->constraint, first + i);
        double terms = fmax(OUT(&s->constraint, scale + i), s->own[row]);
        terms = fmax(terms, LEAST_PART * size * sqrt(s->lengths[row]));
        if (begins)
            s->least[row] = OF_GUESS * terms;
        terms = fmax(terms, s->least[row]);
        if (!isfinite(value))
            return INFINITY;
        if (value != 0.0)
            largest = fmax(largest, terms > 0.0 ? fabs(value) / terms : INFINITY);
    }
    return largest;
}

/* Move the free positions to phi = 0. */
static int find_positions(lag_start_search *s, double t, const int *fixed, double *y)
{
    const lag_equations *e = &s->model->equations;
    const int nq = e->nq, scale = e->nh + e->nb + e->nc;
    evaluate(s, t, y);
    double residual = residual_at(s, e->nh, 0, scale, e->holonomic, y, 1);
    for (int iteration = 0; iteration < ITERATIONS && residual > RESIDUAL; ++iteration) {
        if (!isfinite(residual))
            return LAG_START_UNDEFINED;
        write_rows(s, fixed);
        for (int i = 0; i < e->nh; ++i) {
            memmove(s->rows + i * nq, s->rows + e->holonomic[i] * nq, (size_t)nq * sizeof *s->rows);
            s->lengths[i] = s->lengths[e->holonomic[i]];
            s->right[i] = -OUT(&s->constraint, i);
        }
        least_solution(INDEPENDENT, e->nh, nq, s->rows, s->right, s->lengths, s->x);
        memcpy(s->tried, y, (size_t)nq * sizeof *y);
        double part = 1.0, after = INFINITY;
        for (int k = 0; k < HALVINGS && !(after < residual); ++k, part *= 0.5) {
            for (int j = 0; j < nq; ++j)
                y[j] = s->tried[j] + part * s->model->problem.sizes[j] * s->x[j];
            evaluate(s, t, y);
            after = residual_at(s, e->nh, 0, scale, e->holonomic, y, 0);
        }
        if (!(after < residual)) { /* rounding errors, or the least residual, are reached */
            memcpy(y, s->tried, (size_t)nq * sizeof *y);
            break;
        }
        residual = after;
    }
    evaluate(s, t, y);
    return residual <= ACCEPTED ? LAG_START_FOUND : LAG_START_CONTRADICTED;
}

/* Move the free velocities to psi = 0. */
static int find_velocities(lag_start_search *s, double t, const int *fixed, double *y)
{
    const lag_equations *e = &s->model->equations;
    const int nq = e->nq, scale = 2 * e->nh + e->nb + e->nc, first = scale + e->nc;
    double residual = INFINITY;
    for (int iteration = 0; iteration < ITERATIONS; ++iteration) {
        evaluate(s, t, y);
        const double now = residual_at(s, e->nc, first, scale, NULL, y + nq, iteration == 0);
        if (!isfinite(now) && iteration == 0)
            for (int i = 0; i < e->nc; ++i)
                if (!isfinite(OUT(&s->constraint, first + i)))
                    return LAG_START_UNDEFINED;
        if (now <= RESIDUAL || (iteration > 2 && !(now < 0.5 * residual))) {
            residual = fmin(now, residual);
            break;
        }
        residual = now;
        write_rows(s, fixed + nq);
        for (int i = 0; i < e->nc; ++i)
            s->right[i] = -OUT(&s->constraint, first + i);
        least_solution(INDEPENDENT, e->nc, nq, s->rows, s->right, s->lengths, s->x);
        for (int j = 0; j < nq; ++j)
            y[nq + j] += s->model->problem.sizes[j] * s->x[j];
    }
    return residual <= ACCEPTED ? LAG_START_FOUND : LAG_START_CONTRADICTED;
}

int lag_start_find(lag_start_search *s, double t, const double *p, const int *fixed, double *y, double *lengths,
                   double *plain_lengths)
{
    const lag_equations *e = &s->model->equations;
    const int nq = e->nq;
    lag_tape_set(&s->constraint, e->np, p);
    int status = find_positions(s, t, fixed, y);
    if (status == LAG_START_FOUND)
        status = find_velocities(s, t, fixed, y);
    if (status != LAG_START_FOUND)
        return status;
    write_rows(s, NULL);
    for (int i = 0; i < e->nc; ++i) {
        double square = 0.0, plain = 0.0;
        for (int j = 0; j < nq; ++j) {
            const double b = s->rows[i * nq + j], b_j = b / s->model->problem.sizes[j];
            square += b * b;
            plain += b_j * b_j;
        }
        lengths[i] = square > 0.0 ? sqrt(square) : 1.0;
        plain_lengths[i] = plain > 0.0 ? sqrt(plain) : 1.0;
        s->right[i] = 0.0;
    }
    const int rank = least_solution(OF_RANK, e->nc, nq, s->rows, s->right, s->lengths, s->x);
    return rank == s->model->problem.rank ? LAG_START_FOUND : LAG_START_SINGULAR;
}
