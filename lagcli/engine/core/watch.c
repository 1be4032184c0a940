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
#define OVER 0.05           /* of its largest value: the least pivot below which a minimum is examined more closely ... */
#define BELOW 0.9           /* ... if it is below this part of those at the ends of the step ... */
#define SINGULAR 1e-4       /* ... or below this part of the largest one */
#define PROBES 40           /* largest number of states at which a step is examined */
#define ASIDE 0.1           /* weight of all rows in the initial vector of inverse iteration */
#define ITERATIONS 8        /* largest number of iterations ... */
#define SETTLED 0.9         /* ... and ratio of successive values at convergence */

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

void lag_watch_restart(lag_run *run)
{
    const lag_system *s = &run->system;
    lag_path *path = &run->watch.path;
    if (!run->watch.mode)
        return;
    lag_evaluate(&s->dynamics, s, run->step.t, run->step.y, LAG_ALL);
    for (int i = 0; i < s->nb / s->blocks; ++i)
        path->begin[i] = OUT(&s->dynamics, lag_first_jacobian(s) + i);
    run->watch.pivot = lag_least_pivot(run, run->step.t, run->step.y);
    run->watch.largest_pivot = fmax(run->watch.largest_pivot, run->watch.pivot);
    path->margin = CERTAIN * run->watch.pivot;
}

void lag_watch_step(lag_run *run)
{
    lag_path *path = &run->watch.path;
    path->length = path->speed = 0.0;
    path->t = run->step.t;
    path->entries = path->begin;
    run->watch.cancellation.least = INFINITY;
    run->watch.cancellation.most = 0.0;
}

/* Keep B of the dynamics tape at time t, and its distance from the stage before. */
static void extend_path(lag_run *run, double t)
{
    const lag_system *s = &run->system;
    const double *entries = s->dynamics.registers;
    const int32_t *places = s->dynamics.outputs + lag_first_jacobian(s);
    lag_path *path = &run->watch.path;
    double sum = 0.0;
    for (int i = 0; i < s->nb / s->blocks; ++i) {
        const double x = entries[places[i]];
        const double part = (x - path->entries[i]) * run->rows.sizes[s->jacobian_column[i]]
                            / run->rows.lengths[s->jacobian_row[i]];
        sum += part * part;
        path->last[i] = x;
    }
    const double length = sqrt(sum), speed = length / fabs(t - path->t);
    path->entries = path->last;
    path->length += length;
    if (t != path->t)
        path->speed = fmax(path->speed, speed);
    path->t = t;
}

void lag_watch_stage(lag_run *run, double t)
{
    extend_path(run, t);
    if (lag_many_rows(run))
        lag_watch_factors(run);
}

void lag_watch_factors(lag_run *run)
{
    double part = 0.0; /* every step is examined */
    if (lag_solving_by(run) != LAG_BY_LU)
        part = least_part(run);
    else if (by_factors(run))
        part = least_part_of_dense(run);
    lag_cancellation *c = &run->watch.cancellation;
    c->last = part;
    c->least = fmin(c->least, part);
    c->most = fmax(c->most, part);
    c->largest = fmax(c->largest, part);
}

void lag_watch_accept(lag_run *run)
{
    lag_path *path = &run->watch.path;
    double *last = path->last;
    path->last = path->begin;
    path->entries = path->begin = last;
    path->margin = path->margin_at_end;
}

int lag_stage(lag_run *run, double t, const double *y, double *f)
{
    if (lag_derivative(run, t, y, f))
        return 1;
    if (run->watch.mode)
        lag_watch_stage(run, t);
    return 0;
}

/* Record the largest length of each row of B times sizes, or of B; returns the least ratio of the lengths before and
 * after. */
static double measure(lag_run *run, const double *sizes, double *lengths)
{
    const lag_system *s = &run->system;
    double *sum = run->step.work, ratio = 1.0;
    lag_row_squares(s, &s->constraint, lag_constraint_jacobian(s), sizes, sum);
    for (int i = 0; i < s->nc; ++i)
        if (sum[i] > lengths[i] * lengths[i]) {
            const double length = sqrt(sum[i]);
            ratio = fmin(ratio, lengths[i] / length);
            lengths[i] = length;
        }
    return ratio;
}

void lag_measure(lag_run *run)
{
    if (lag_solving_by(run) != LAG_BY_LU)
        measure(run, NULL, run->rows.plain_lengths);
    run->watch.path.margin *= measure(run, run->rows.sizes, run->rows.lengths);
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

/*
 * Whether the least pivot, of which the value at the end is given, may have a small minimum inside the last step:
 * Piyavskii and Shubert's search for the minimum of a function with a known Lipschitz constant, here the speed of B,
 * since no singular value changes faster.
 *
 * B. Shubert, A sequential method seeking the global maximum of a function, SIAM J. Numer. Anal. 9 (1972),
 * doi:10.1137/0709036.
 */
static int dips(lag_run *run, double end)
{
    const double speed = run->watch.path.speed * run->step.h_old, largest = run->watch.largest_pivot;
    double x[PROBES] = {0.0, 1.0}, value[PROBES] = {least_pivot_inside(run, 0.0), end};
    int after[PROBES] = {1, -1}; /* the state at which the part that begins at a state ends */
    const double least = fmin(value[0], value[1]);
    const double small = fmin(OVER * largest, fmax(BELOW * least, SINGULAR * largest));
    if (least < small)
        return 1;
    for (int count = 2; count < PROBES; ++count) {
        /* the part of the step in which the least singular value may be smallest */
        double bound = CERTAIN * small;
        int at = -1;
        for (int i = 0; i < count; ++i) {
            const int j = after[i];
            if (j < 0)
                continue;
            const double lowest = 0.5 * (CERTAIN * (value[i] + value[j]) - speed * (x[j] - x[i]));
            if (lowest < bound)
                bound = lowest, at = i;
        }
        if (at < 0)
            return 0;
        const int to = after[at];
        const double width = x[to] - x[at], middle = 0.5 * (x[at] + x[to]);
        const double aside = 0.5 * CERTAIN * (value[at] - value[to]) / speed;
        x[count] = middle + fmin(fmax(aside, -0.3 * width), 0.3 * width);
        value[count] = least_pivot_inside(run, x[count]);
        if (value[count] < small)
            return 1;
        after[count] = to;
        after[at] = count;
    }
    return 1;
}

int lag_stepped_over(lag_run *run)
{
    lag_path *path = &run->watch.path;
    const lag_cancellation *c = &run->watch.cancellation;
    run->watch.pivot_at_end = INFINITY;
    if (lag_many_rows(run)) {
        path->margin_at_end = 0.0;
        if (!(c->least <= NEAR * c->largest || c->least < STEADY * c->most))
            return 0;
    } else if (path->length < path->margin - CERTAIN * NEAR * run->watch.largest_pivot) {
        path->margin_at_end = path->margin - path->length;
        return 0;
    }
    const double end = lag_least_pivot(run, run->step.t_old + run->step.h_old, run->step.y_new);
    run->watch.pivot_at_end = end;
    run->watch.largest_pivot = fmax(run->watch.largest_pivot, end);
    path->margin_at_end = CERTAIN * end;
    if (!lag_many_rows(run) && path->length < path->margin + path->margin_at_end)
        return 0;
    return dips(run, end);
}

int lag_approaches(lag_run *run)
{
    const double before = run->watch.pivot, largest = run->watch.largest_pivot;
    run->watch.pivot = fmin(run->watch.pivot_at_end, largest);
    return run->watch.pivot < fmin(before, NEAR * largest);
}
