#include "dense_jets.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "methods/method.h"
#include "polynomial.h"
#include "run.h"

#define ROUNDING (2.0 * DBL_EPSILON)    /* per degree: of control points */
#define POINTS (LAG_MOST_DEGREE + 1)

void lag_dense_points_bind(lag_dense_points *d, lag_pool *pool, int count, const int *state)
{
    d->count = count;
    d->state = state;
    d->ready = lag_get(pool, (size_t)count, sizeof *d->ready);
    d->points = lag_doubles(pool, (int64_t)count * JET * POINTS);
}

void lag_dense_points_begin(lag_dense_points *d)
{
    memset(d->ready, 0, (size_t)d->count * sizeof *d->ready);
}

/* Those of the derivative of some order of state `i` over its factorial. Those of each order follow from those before. */
static const double *points_of(lag_run *run, lag_dense_points *d, int i, int order)
{
    double *b = d->points + (int64_t)i * JET * POINTS;
    if (!d->ready[i]) {
        d->degree = run->stepped->control_points(run, d->state[i], b);
        d->ready[i] = 1;
    }
    for (int k = d->ready[i]; k <= order; d->ready[i] = ++k) {
        const double *one = b + (k - 1) * POINTS, factor = (d->degree - k + 1) / (run->step.h_old * k);
        for (int j = 0; j <= d->degree - k; ++j)
            b[k * POINTS + j] = factor * (one[j + 1] - one[j]);
    }
    return b + order * POINTS;
}

lag_interval lag_range_of(const double *b, int degree)
{
    lag_interval r = {b[0], b[0]};
    for (int j = 1; j <= degree; ++j) {
        r.low = lag_least(r.low, b[j]);
        r.high = lag_most(r.high, b[j]);
    }
    return r.low <= r.high ? r : LAG_ANYTHING; /* not so if the last one is undefined */
}

/* The range of a polynomial from u to v in [0, 1]: de Casteljau. */
static lag_interval range_within(const double *b, int degree, double u, double v)
{
    double w[POINTS], size = fabs(b[0]);
    w[0] = b[0];
    for (int j = 1; j <= degree; ++j) {
        w[j] = b[j];
        size = lag_most(size, fabs(b[j]));
    }
    if (v < 1.0)
        for (int m = 1; m <= degree; ++m)
            for (int j = degree; j >= m; --j)
                w[j] = w[j - 1] + v * (w[j] - w[j - 1]);
    if (u > 0.0) {
        const double part = u / v;
        for (int m = degree; m > 0; --m)
            for (int j = 0; j < m; ++j)
                w[j] += part * (w[j + 1] - w[j]);
    }
    lag_interval r = lag_range_of(w, degree);
    const double error = ROUNDING * (degree + 1) * size;
    r.low -= error;
    r.high += error;
    return r;
}

void lag_dense_jet(lag_run *run, lag_dense_points *d, int i, double u, double v, int order, lag_interval *jet)
{
    for (int k = 0; k <= order; ++k) {
        const double *b = points_of(run, d, i, k);
        jet[k] = k <= d->degree ? range_within(b, d->degree - k, u, v) : (lag_interval){0.0, 0.0};
    }
}
