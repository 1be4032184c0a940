/* Forces of active rows during the flow. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "linear/dense.h"
#include "motion.h"
#include "switching/rows.h"

#define ITERATIONS 60       /* of Newton's method; one is enough if laws are affine in multipliers */
#define PLAIN 10            /* of these, after which steps are halved that do not reduce what the laws lack ... */
#define SHORTEST 1e-6       /* ... down to this part */
#define OBEYED (4.0 * DBL_EPSILON)  /* of the terms of laws: what they may lack, ... */
#define ROUGHLY 1e-11       /* ... and where rounding errors do not let it become less */
#define EXACT 1e-14         /* of the forces: convergence */
#define INERT 1e-10         /* of the inverse inertia without constraints: a smaller one is a rounding error */

/* Forces that act at a state. The lists are of rows, then of forces that depend on multipliers. */
typedef struct {
    int n;                  /* number of active forces */
    const int *acts;        /* their indices */
    const double *free;     /* a and lambda without the forces */
    const double *offset;   /* n: B a_0 - gamma, of rows that hold */
    const double *scale;    /* n: of a force; forces times it, and accelerations over it, have one unit */
    const double *inert;    /* n: the same without constraints, of a force whose law is not one of accelerations and
                             * that moves nothing, as all that act on a driven mechanism; of others, 0 */
    double *z, *residual;   /* n */
    double *a, *multipliers;    /* with the forces; lambda of all constraints */
    double *all;            /* rows + nf: z by its number */
} acting_forces;

static const double *response_of(const lag_run *run, int k)
{
    return run->switching.response + k * (run->system.nq + run->system.nc);
}

/* The response of constraint `which` to force k, d lambda / d z. */
static double answer(const lag_run *run, int which, int k)
{
    const lag_switching *sw = &run->switching;
    if (k < sw->rows && sw->constraint[k] == which)
        return sw->sign[k];
    for (int i = 0; i < run->system.nc; ++i)
        if (sw->base[i] == which)
            return response_of(run, k)[run->system.nq + i];
    return 0.0;
}

/* a and lambda with the forces z. */
static void superpose(const lag_run *run, const acting_forces *f)
{
    const lag_switching *sw = &run->switching;
    const int nq = run->system.nq, n = nq + run->system.nc;
    memset(f->all, 0, (size_t)(sw->rows + sw->nf) * sizeof(double));
    memcpy(f->a, f->free, (size_t)n * sizeof(double));
    for (int k = 0; k < f->n; ++k) {
        const double *u = response_of(run, f->acts[k]);
        f->all[f->acts[k]] = f->z[k];
        for (int i = 0; i < n; ++i)
            f->a[i] += u[i] * f->z[k];
    }
    lag_gather_multipliers(run, f->a + nq, f->all, f->multipliers);
}

void lag_laws_matrix(lag_run *run, double t, const double *y, const double *a, const double *multipliers, int n,
                     const int *acts, double *matrix)
{
    lag_switching *sw = &run->switching;
    int slips = 0;
    memset(matrix, 0, (size_t)n * n * sizeof(double));
    for (int i = 0; i < n; ++i)
        slips |= acts[i] < sw->rows && lag_row_slips(sw, acts[i]);
    if (slips)
        lag_evaluate_laws(run, &sw->limits, t, y, a, multipliers, LAG_OF_STEP);
    if (sw->nf)
        lag_evaluate_laws(run, &sw->forces, t, y, a, multipliers, LAG_OF_STEP);
    for (int i = 0; i < n; ++i) {
        const int k = acts[i];
        double *row = matrix + i * n;
        if (k >= sw->rows) {
            row[i] += 1.0;
            for (int p = 0; p < sw->force_count; ++p)
                if (sw->force_row[p] == k - sw->rows)
                    for (int j = 0; j < n; ++j)
                        row[j] -= OUT(&sw->forces, sw->nf + p) * answer(run, sw->force_constraint[p], acts[j]);
        } else if (lag_row_slips(sw, k)) {
            const double direction = lag_row_slips(sw, k);
            const int slopes = 2 * sw->nl + sw->pattern_count;
            row[i] += 1.0;
            for (int p = 0; p < sw->pattern_count; ++p)
                if (sw->pattern_limit[p] == sw->limit[k])
                    for (int j = 0; j < n; ++j)
                        row[j] += direction * OUT(&sw->limits, slopes + p)
                                  * answer(run, sw->constraint[sw->pattern_row[p]], acts[j]);
        } else if (lag_along(run, k, response_of(run, k)) > 0.0) { /* else nothing moves it */
            for (int j = 0; j < n; ++j)
                row[j] = lag_along(run, k, response_of(run, acts[j]));
        }
    }
}

/* The laws' residual at z, and its derivatives to the LU matrix. */
static void linearize(lag_run *run, double t, const double *y, const acting_forces *f)
{
    lag_switching *sw = &run->switching;
    superpose(run, f);
    lag_laws_matrix(run, t, y, f->a, f->multipliers, f->n, f->acts, sw->lu);
    for (int i = 0; i < f->n; ++i) {
        const int k = f->acts[i];
        if (k >= sw->rows) {
            f->residual[i] = f->z[i] - OUT(&sw->forces, k - sw->rows);
        } else if (lag_row_slips(sw, k)) {
            f->residual[i] = f->z[i] + lag_row_slips(sw, k) * OUT(&sw->limits, sw->nl + sw->limit[k]);
        } else {
            f->residual[i] = f->offset[i];
            for (int j = 0; j < f->n; ++j)
                f->residual[i] += sw->lu[i * f->n + j] * f->z[j];
        }
    }
}

/* The determinant of a matrix by its LU factors. */
static double determinant(const double *lu, const int *pivots, int n)
{
    double product = 1.0;
    for (int i = 0; i < n; ++i)
        product *= pivots[i] == i ? lu[i * n + i] : -lu[i * n + i];
    return product;
}

/* Whether force k is that of a row that holds: its law is one of accelerations. */
static int is_held(const lag_switching *sw, int k)
{
    return k < sw->rows && !lag_row_slips(sw, k);
}

/* What the laws lack where `scale` is not 0, and the size of their terms, to `size`. */
static double lack(const lag_switching *sw, const acting_forces *f, const double *scale, double *size)
{
    double part = 0.0;
    *size = 0.0;
    for (int i = 0; i < f->n; ++i) {
        const double d = scale[i], force = d * fabs(f->z[i]);
        if (!(d > 0.0))
            continue;
        part = fmax(part, is_held(sw, f->acts[i]) ? fabs(f->residual[i]) / d : d * fabs(f->residual[i]));
        *size = fmax(*size, fmax(fabs(f->offset[i]) / d, force));
    }
    return part;
}

/* Whether the laws lack no more than a part of their terms. */
static int are_obeyed(const lag_switching *sw, const acting_forces *f, double part)
{
    double size, inert;
    const int obeyed = lack(sw, f, f->scale, &size) <= part * size;
    return obeyed && lack(sw, f, f->inert, &inert) <= part * inert;
}

/* Whether the step from which the forces come was small, where `scale` is not 0. */
static int have_settled(const acting_forces *f, const double *scale)
{
    double change = 0.0, size = 0.0;
    for (int i = 0; i < f->n; ++i) {
        change = fmax(change, scale[i] * fabs(f->residual[i]));
        size = fmax(size, scale[i] * fabs(f->z[i]));
    }
    return change <= EXACT * size;
}

/* The scale of a force; 1 of one that moves nothing. */
static double scale_of(const acting_forces *f, int i)
{
    return f->scale[i] > 0.0 ? f->scale[i] : 1.0;
}

/* Solve J x = residual in its place: by the factors, or with the least norm of forces times their scales where rows
 * that hold depend on each other. Returns 0, or 1. memory: 5 n n + 4 n. */
static int solve_step(lag_switching *sw, const acting_forces *f, double *residual, int redundant, double *memory)
{
    const int n = f->n;
    if (!redundant) {
        if (lag_lu(sw->lu, sw->pivots, n))
            return 1;
        lag_lu_solve(sw->lu, sw->pivots, n, residual);
        return 0;
    }
    double *matrix = memory, *square = matrix + n * n, *x = square + n * n, *rest = x + n;
    for (int i = 0; i < n; ++i) {
        const double own = scale_of(f, i), factor = is_held(sw, f->acts[i]) ? 1.0 / own : own;
        residual[i] *= factor;
        for (int j = 0; j < n; ++j)
            matrix[i * n + j] = factor * sw->lu[i * n + j] / scale_of(f, j);
    }
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
            square[i * n + j] = 0.0;
            for (int k = 0; k < n; ++k)
                square[i * n + j] += matrix[i * n + k] * matrix[j * n + k];
        }
    lag_least_norm(n, square, residual, x, rest);
    for (int j = 0; j < n; ++j) {
        residual[j] = 0.0;
        for (int i = 0; i < n; ++i)
            residual[j] += matrix[i * n + j] * x[i] / scale_of(f, j);
    }
    return 0;
}

/* Newton's method on the laws. `held` is the determinant of the rows that hold alone, 0 where they
 * depend on each other. Returns 1 where there is no solution, or none is found. */
static int solve_laws(lag_run *run, double t, const double *y, const acting_forces *f, double held,
                      double *memory)
{
    lag_switching *sw = &run->switching;
    double lacked = INFINITY, part = 1.0, size, *step = memory, *rest = memory + f->n;
    for (int iteration = 0; iteration < ITERATIONS; ++iteration) {
        double sum = 0.0;
        linearize(run, t, y, f);
        if (iteration && are_obeyed(sw, f, OBEYED))
            return 0;
        const double now = iteration < PLAIN ? 0.0 : lack(sw, f, f->scale, &size) + lack(sw, f, f->inert, &size);
        if (now >= lacked && part > SHORTEST) {
            part *= 0.5;
            for (int i = 0; i < f->n; ++i)
                f->z[i] += part * step[i];
            continue;
        }
        if (iteration >= PLAIN)
            lacked = now;
        if (solve_step(sw, f, f->residual, held == 0.0, rest))
            return 1;
        sw->margin = held != 0.0 ? determinant(sw->lu, sw->pivots, f->n) / held : 1.0;
        part = 1.0;
        for (int i = 0; i < f->n; ++i) {
            f->z[i] -= step[i] = f->residual[i];
            sum += f->z[i];
        }
        if (!isfinite(sum))
            return 1;
        if (have_settled(f, f->scale) && have_settled(f, f->inert)) {
            superpose(run, f);
            return 0;
        }
    }
    linearize(run, t, y, f);
    return !are_obeyed(sw, f, ROUGHLY);
}

/* The inverse inertia at a row or a force without constraints. */
static double mobility_alone(const lag_run *run, int k)
{
    const lag_switching *sw = &run->switching;
    const int nq = run->system.nq;
    const double *sizes = run->rows.sizes;
    double sum = 0.0;
    if (k >= sw->rows) {
        const double size = sizes[sw->force_coordinate[k - sw->rows]];
        return size * size;
    }
    for (int j = 0; j < nq; ++j) {
        const double part = sw->jacobian[k * nq + j] * sizes[j];
        sum += part * part;
    }
    return sum;
}

/* The matrix of rows that hold, n of them listed by their place among those that act; `rows` has memory for n. */
static void matrix_of(const lag_run *run, const acting_forces *f, const int *held, int n, int *rows, double *matrix)
{
    for (int i = 0; i < n; ++i)
        rows[i] = f->acts[held[i]];
    for (int j = 0; j < n; ++j)
        lag_along_each(run, n, rows, response_of(run, rows[j]), matrix + j, n);
}

int lag_add_forces(lag_run *run, double t, const double *y, double *power)
{
    lag_switching *sw = &run->switching;
    const lag_system *s = &run->system;
    const int nq = s->nq, all = sw->rows + sw->nf;
    double *work = sw->work, *solution = run->solver.a;
    double *free = work, *a = free + nq + s->nc, *offset = a + nq + s->nc, *z = offset + all;
    double *residual = z + all, *scale = residual + all, *inert = scale + all, *memory = inert + all;
    int *acts = sw->acts, *held = sw->acts + all, n = 0, holds = 0, laws = 0;
    if (lag_find_rows(run, t, y) || lag_factor(run, t, y))
        return 1;
    for (int k = 0; k < all; ++k) {
        if (k < sw->rows && !lag_row_acts(sw, k))
            continue;
        if (k < sw->rows && !lag_row_slips(sw, k))
            held[holds++] = n;
        else
            laws = 1;
        acts[n++] = k;
        lag_row_response(run, k);
    }
    memcpy(free, solution, (size_t)(nq + s->nc) * sizeof(double));
    acting_forces f = {.n = n, .acts = acts, .free = free, .offset = offset, .scale = scale, .inert = inert, .z = z,
                       .residual = residual, .a = a, .multipliers = sw->multipliers, .all = sw->force};
    for (int i = 0; i < n; ++i) {
        const int k = acts[i];
        z[i] = sw->force[k]; /* those of the previous state */
        const double *u = response_of(run, k);
        const double mobility = k < sw->rows ? lag_along(run, k, u) : u[sw->force_coordinate[k - sw->rows]];
        scale[i] = sqrt(fmax(mobility, 0.0));
        inert[i] = offset[i] = 0.0;
        if (k >= sw->rows || lag_row_slips(sw, k)) {
            const double alone = mobility_alone(run, k);
            if (!(mobility > INERT * alone)) {
                scale[i] = 0.0;
                inert[i] = sqrt(alone);
            }
            continue;
        }
        offset[i] = lag_along(run, k, free) - sw->gamma[k];
        if (lag_stabilizes(run)) {
            const double beta = run->baumgarte.beta;
            offset[i] += run->baumgarte.alpha * sw->psi[k] + beta * beta * sw->phi[k];
        }
    }
    sw->margin = 1.0;
    sw->redundant = 0;
    matrix_of(run, &f, held, holds, sw->pivots, sw->matrix);
    if (laws) {
        double factor = 1.0;
        memcpy(sw->lu, sw->matrix, (size_t)holds * holds * sizeof(double));
        if (holds > 1 && lag_least_norm(holds, sw->matrix, offset, residual, memory) < holds)
            factor = 0.0;
        else if (holds)
            factor = lag_lu(sw->lu, sw->pivots, holds) ? 0.0 : determinant(sw->lu, sw->pivots, holds);
        sw->redundant = factor == 0.0;
        if (sw->redundant) /* of least norm, independent of previous values */
            memset(z, 0, (size_t)n * sizeof(double));
        if (solve_laws(run, t, y, &f, factor, memory))
            return 1;
    } else {
        for (int i = 0; i < n; ++i)
            residual[i] = -offset[i];
        sw->redundant = lag_least_norm(n, sw->matrix, residual, z, memory) < n;
        superpose(run, &f);
    }
    double sum = 0.0;
    for (int i = 0; i < nq + s->nc; ++i)
        sum += solution[i] = a[i];
    for (int i = 0; i < n; ++i)
        *power += z[i] * (acts[i] < sw->rows ? lag_along(run, acts[i], y + nq)
                                             : y[nq + sw->force_coordinate[acts[i] - sw->rows]]);
    /* the power of the system's constraints due to the forces */
    for (int i = 0; i < s->nb; ++i)
        *power += (a[nq + s->jacobian_row[i]] - free[nq + s->jacobian_row[i]])
                  * OUT(&s->dynamics, lag_first_jacobian(s) + i) * y[nq + s->jacobian_column[i]];
    return !isfinite(sum + *power);
}
