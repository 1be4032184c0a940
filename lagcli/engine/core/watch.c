#include "watch.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "linear/dense.h"
#include "methods/method.h"
#include "motion.h"
#include "step.h"
#include "tape/vectors.h"

#define LARGE 20000.0       /* number of operations above which the rows of B are not orthogonalized */
#define OVER 0.05           /* of its largest value: the smallest pivot that is examined more closely */
#define ASIDE 0.1           /* weight of all rows in the initial vector of inverse iteration */
#define ITERATIONS 8        /* largest number of iterations ... */
#define SETTLED 0.9         /* ... and ratio of successive values at convergence */
#define GOLDEN 0.6180339887498949

/*
 * The least part that a pivot of the last factors keeps of the terms that it is the sum of,
 * scaled so that a multiplier's pivot without cancellation counts one. 0 where the matrix is
 * singular. The square root, because pivots are quadratic in B.
 */
static double least_part_of_factors(lag_run *run)
{
    const lag_elimination *ldl = &run->factors.plan;
    const int n = ldl->n;
    const double *d, *beside, *l;
    double *taken = run->step.work, least = 1.0;
    d = run->factors.factors;
    beside = d + n;
    l = beside + n;
    memset(taken, 0, (size_t)n * sizeof(double));
    for (int k = 0; k < n; ++k) {
        double part;
        if (ldl->paired[k]) {
            const double inverse = d[k] * d[k + 1] - beside[k] * beside[k];
            const double a = d[k + 1] / inverse, b = -beside[k] / inverse, c = d[k] / inverse;
            const int shift = ldl->start[k + 1] - ldl->start[k];
            for (int e = ldl->start[k]; e < ldl->start[k + 1]; ++e) {
                const double x = l[e], y = l[e + shift];
                taken[ldl->row[e]] += fabs(a * x * x) + fabs(2.0 * b * x * y) + fabs(c * y * y);
            }
            part = fabs(inverse) / (fabs(d[k] * d[k + 1]) + beside[k] * beside[k]);
            ++k;
        } else {
            const double pivot = fabs(1.0 / d[k]);
            for (int e = ldl->start[k]; e < ldl->start[k + 1]; ++e)
                taken[ldl->row[e]] += l[e] * l[e] * pivot;
            part = 2.0 * pivot / (pivot + taken[k]);
        }
        if (part < least)
            least = part;
    }
    return sqrt(least);
}

/* The same, or the relative length of the shortest row of B, if that is smaller. */
static double least_part(lag_run *run)
{
    const lag_system *s = &run->system;
    const lag_tape *d = &s->dynamics;
    if (run->solver.by == LAG_BY_TAPE) { /* the tape computes both */
        const int pivots = run->solver.cancellation_count - s->nc;
        const int32_t *places = d->outputs + lag_first_cancellation(s);
        const lag_vector_kernel *vectors = s->vectors;
        lag_tape_run(d, &d->deferred[0]);
        return sqrt(fmin(vectors->least(pivots, d->registers, places, NULL),
                         vectors->least(s->nc, d->registers, places + pivots, run->rows.plain_lengths)));
    }
    double *sum = run->step.work, shortest = 1.0;
    lag_row_squares(s, d, lag_first_jacobian(s), NULL, sum);
    for (int i = 0; i < s->nc; ++i)
        shortest = fmin(shortest, sum[i] / (run->rows.plain_lengths[i] * run->rows.plain_lengths[i]));
    return fmin(least_part_of_factors(run), sqrt(shortest));
}

/* The same of the dense factors, whose pivots are quadratic in B too, and whose rows of B have length one. */
static double least_part_of_dense(lag_run *run)
{
    const lag_system *s = &run->system;
    double *sum = run->step.work, shortest = 1.0;
    lag_row_squares(s, &s->dynamics, lag_first_jacobian(s), run->rows.sizes, sum);
    for (int i = 0; i < s->nc; ++i)
        shortest = fmin(shortest, sum[i] / (run->rows.lengths[i] * run->rows.lengths[i]));
    return sqrt(fmin(lag_least_dense_pivot(run), shortest));
}

/* Normalize x; returns its previous length. */
static double normalize(double *x, int n)
{
    double sum = 0.0;
    for (int i = 0; i < n; ++i)
        sum += x[i] * x[i];
    const double length = sqrt(sum);
    for (int i = 0; i < n; ++i)
        x[i] /= length;
    return length;
}

/*
 * The least singular value of B's rows over their lengths, in the metric of M, by inverse iteration
 * with the last factors; from above, and the closer the further it is below the others. It begins
 * with what was found last, which differs little, and with something of all rows.
 */
static double least_singular(lag_run *run)
{
    const int nc = run->system.nc / run->system.blocks;
    double *x = run->watch.combination, value = INFINITY;
    for (int i = 0; i < nc; ++i)
        x[i] += ASIDE * cos(1.0 + 1.7 * i) / sqrt(nc);
    normalize(x, nc);
    for (int k = 0; k < ITERATIONS; ++k) {
        const double before = value;
        for (int i = 0; i < nc; ++i)
            x[i] *= run->rows.lengths[i];
        lag_oppose(run, x);
        for (int i = 0; i < nc; ++i)
            x[i] *= run->rows.lengths[i];
        value = 1.0 / sqrt(normalize(x, nc));
        if (!(value > 0.0) || !isfinite(value)) { /* the factors are not accurate enough */
            memset(x, 0, (size_t)nc * sizeof(double));
            return 0.0;
        }
        if (value > SETTLED * before)
            break;
    }
    return value;
}

/* Whether the last factors can tell how near a singular configuration is: not those of a bordered matrix. */
static int by_factors(const lag_run *run)
{
    const int whole = run->rows.rank == run->system.nc && run->system.blocks == 1 && !run->switching.used;
    return whole || lag_solving_by(run) != LAG_BY_LU;
}

int lag_many_rows(const lag_run *run)
{
    const int nq = run->system.nq / run->system.blocks, nc = run->system.nc / run->system.blocks;
    return (double)nc * nc * nq > LARGE;
}

double lag_least_pivot(lag_run *run, double t, const double *y)
{
    const lag_system *s = &run->system;
    const lag_tape *c = &s->constraint;
    const int nq = s->nq / s->blocks, nc = s->nc / s->blocks; /* of the motion, whose B is that of all blocks */
    if (run->rows.rank == 0)
        return 1.0;
    ++run->watch.examined;
    if (by_factors(run) && lag_many_rows(run))
        return lag_factor(run, t, y) ? 0.0 : least_singular(run);
    lag_evaluate(c, s, t, y, LAG_VELOCITIES);
    if (lag_scaled_rows(run, 1, c, lag_constraint_jacobian(s)))
        return 1.0;
    return lag_pivot(run->rows.scaled, nq, nc, run->rows.rank / s->blocks, run->rows.order, run->rows.components);
}

void lag_watch_step(lag_run *run)
{
    run->watch.cancellation.least = INFINITY;
    run->watch.cancellation.most = 0.0;
}

void lag_watch_stage(lag_run *run)
{
    double part = 0.0; /* every step is examined */
    if (lag_solving_by(run) != LAG_BY_LU)
        part = least_part(run);
    else if (by_factors(run) && lag_many_rows(run))
        part = least_part_of_dense(run);
    lag_cancellation *c = &run->watch.cancellation;
    c->last = part;
    c->least = fmin(c->least, part);
    c->most = fmax(c->most, part);
    c->largest = fmax(c->largest, part);
}

int lag_stage(lag_run *run, double t, const double *y, double *f)
{
    if (lag_derivative(run, t, y, f))
        return 1;
    if (run->watch.mode)
        lag_watch_stage(run);
    return 0;
}

/* Record the largest length of each row of B times sizes, or of B. */
static void measure(lag_run *run, const double *sizes, double *lengths)
{
    const lag_system *s = &run->system;
    double *sum = run->step.work;
    lag_row_squares(s, &s->constraint, lag_constraint_jacobian(s), sizes, sum);
    for (int i = 0; i < s->nc; ++i)
        if (sum[i] > lengths[i] * lengths[i])
            lengths[i] = sqrt(sum[i]);
}

void lag_measure(lag_run *run)
{
    if (lag_solving_by(run) != LAG_BY_LU)
        measure(run, NULL, run->rows.plain_lengths);
    measure(run, run->rows.sizes, run->rows.lengths);
}

/* Whether the stages of the last step indicate a singular configuration. */
static int alarmed(const lag_run *run)
{
    const lag_cancellation *c = &run->watch.cancellation;
    return c->least <= NEAR * c->largest || c->least < STEADY * c->most;
}

/* The least pivot inside the last step, on the cubic through its ends: B depends on q and t alone. */
static double least_pivot_inside(lag_run *run, double x)
{
    const int nq = run->system.nq;
    const double h = run->step.h_old, z = 1.0 - x;
    const double *q0 = run->step.y_old, *v0 = q0 + nq, *q1 = run->step.y_new, *v1 = q1 + nq;
    double *y = run->samples.y;
    if (run->stepped->uses_series) { /* its steps are too long for a cubic, and provide all states */
        lag_dense(run, run->step.t_old + x * h, y);
        return lag_least_pivot(run, run->step.t_old + x * h, y);
    }
    for (int m = 0; m < nq; ++m)
        y[m] = z * z * ((1.0 + 2.0 * x) * q0[m] + x * h * v0[m])
               + x * x * ((1.0 + 2.0 * z) * q1[m] - z * h * v1[m]);
    memcpy(y + nq, v1, (size_t)nq * sizeof(double));
    return lag_least_pivot(run, run->step.t_old + x * h, y);
}

int lag_stepped_over(lag_run *run)
{
    if (!alarmed(run))
        return 0;
    /* the neighbours of the ends show whether it falls or rises there */
    static const double place[] = {0.0, 0.001, 0.25, 0.5, 0.75, 0.999, 1.0};
    double value[7];
    for (int i = 0; i < 7; ++i)
        value[i] = least_pivot_inside(run, place[i]);
    for (int i = 1; i < 6; ++i) {
        if (value[i] > value[i - 1] || value[i] > value[i + 1])
            continue;
        /* golden section, until the bracket is short relative to the accuracy of a cubic */
        double low = place[i - 1], high = place[i + 1], least = value[i];
        double a = high - GOLDEN * (high - low), b = low + GOLDEN * (high - low);
        double fa = least_pivot_inside(run, a), fb = least_pivot_inside(run, b);
        for (int k = 0; k < 12; ++k) {
            if (fa < fb) {
                high = b, b = a, fb = fa;
                fa = least_pivot_inside(run, a = high - GOLDEN * (high - low));
            } else {
                low = a, a = b, fa = fb;
                fb = least_pivot_inside(run, b = low + GOLDEN * (high - low));
            }
            least = fmin(least, fmin(fa, fb));
        }
        if (least < OVER * run->watch.largest_pivot)
            return 1;
    }
    return 0;
}

int lag_approaches(lag_run *run)
{
    const double before = run->watch.pivot;
    run->watch.pivot = run->watch.largest_pivot;
    if (!alarmed(run))
        return 0;
    run->watch.pivot = lag_least_pivot(run, run->step.t, run->step.y);
    run->watch.largest_pivot = fmax(run->watch.largest_pivot, run->watch.pivot);
    return run->watch.pivot < fmin(before, NEAR * run->watch.largest_pivot);
}
