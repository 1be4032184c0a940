/* Taylor's method: steps of high order by the power series of the motion. */
#include <math.h>
#include <string.h>

#include "methods/method.h"
#include "motion.h"
#include "series/series.h"
#include "sizes.h"
#include "polynomial.h"
#include "step.h"
#include "tape/vectors.h"
#include "watch.h"

#define SAFETY 0.9          /* of the step at which the last terms equal the tolerance */
#define LARGEST 10.0        /* times the last step */
#define DEFECT 1000.0       /* times the tolerance: what the end of a step may be off by, were y' as
                             * wrong as there all along */

#define TURN 0.7            /* of its length: what a row of B may change by in a step, so that places
                             * in it show what happens between them */

/* The size of the terms of an order, over the tolerances. */
static double size_of_terms(lag_run *run, int order)
{
    const lag_series *s = &run->series;
    double *term = run->step.trial;
    run->system.vectors->pick(lag_size(&run->system), s->file + s->origin + order * s->layer, s->state + 1, term);
    return lag_scaled_norm(run, term, run->step.y, run->step.y);
}

/* The step at which the last terms are within the tolerances. The last but one is looked at too:
 * of a series in even or odd powers every second term is zero. Jorba & Zou, section 3.2. */
static double step_of_series(lag_run *run)
{
    double h = INFINITY;
    for (int k = run->series.order - 1; k <= run->series.order; ++k) {
        const double size = size_of_terms(run, k);
        if (size > 0.0)
            h = fmin(h, SAFETY * pow(size, -1.0 / k));
    }
    return h;
}

/* Whether the series is not what the equations say at the step's end, where y' has just been found:
 * it continues along another branch of a root, say, or converges too slowly for its last terms to show
 * what is left out. */
static int is_off(lag_run *run, double h)
{
    const int nq = run->system.nq;
    double *slope = run->step.trial;
    lag_series_slope(&run->series, nq, nq + 1, h, slope);
    for (int i = 0; i <= nq; ++i)
        slope[i] = h * (slope[i] - run->step.f_new[nq + i]);
    const double square = run->system.vectors->scaled_square(nq + 1, slope, run->step.y + nq, run->step.y_new + nq,
                                                       run->tolerances.atol + nq, run->settings.rtol);
    return !(square <= DEFECT * DEFECT);
}

/* A step of DOP853, which is not longer than this: a longer one may just have been taken back. */
static int explicit_step(lag_run *run, double longest)
{
    if (lag_derivative(run, run->step.t, run->step.y, run->step.f))
        return LAG_UNDEFINED;
    if (run->stepped != &lag_dop853)
        lag_first_step(run, lag_dop853.order);
    run->step.h = fmin(run->step.h, longest);
    run->stepped = &lag_dop853;
    return lag_dop853.step(run);
}

/* The largest change of a row of B from the step's beginning to its last stage, relative to the row's length. */
static double turned(lag_run *run)
{
    const lag_system *s = &run->system;
    const double *before = run->watch.path.begin, *after = run->watch.path.last;
    double *sum = run->step.work, most = 0.0;
    memset(sum, 0, (size_t)s->nc * sizeof(double));
    for (int i = 0; i < s->nb / s->blocks; ++i)
        sum[s->jacobian_row[i]] += (after[i] - before[i]) * (after[i] - before[i]);
    for (int i = 0; i < s->nc; ++i) {
        const double part = sum[i] / (run->rows.plain_lengths[i] * run->rows.plain_lengths[i]);
        most = part > most ? part : most;
    }
    return sqrt(most);
}

/*
 * Try a step of size h: evaluate at its end, and in its middle if singular configurations are watched for. Returns LAG_RUNNING and the factor by which the next step may be
 * larger; LAG_UNDEFINED where y' is undefined; or LAG_INACCURATE and a smaller factor by which this
 * one must be shorter, where the series is off or B turns too far.
 */
static int try_step(lag_run *run, double h, double *factor)
{
    static const double place[] = {0.5, 1.0};
    const int n = lag_size(&run->system);
    lag_watch_step(run);
    for (int i = run->watch.mode ? 0 : 1; i < 2; ++i) {
        double *y = i == 1 ? run->step.y_new : run->samples.y;
        lag_series_sum(&run->series, n, place[i] * h, y);
        if (lag_derivative(run, run->step.t + place[i] * h, y, run->step.f_new)) {
            *factor = 0.5;
            return LAG_UNDEFINED;
        }
        if (run->watch.mode) {
            lag_watch_stage(run, run->step.t + place[i] * h);
            lag_watch_determinant(run, run->step.t + place[i] * h);
        }
    }
    *factor = 0.5;
    int off = is_off(run, h);
    for (int attempt = 0; off && attempt < ATTEMPTS; ++attempt)
        if (lag_excuse_rounding(run, h, attempt, NULL))
            off = is_off(run, h);
    if (off)
        return LAG_INACCURATE;
    *factor = LARGEST;
    if (!run->watch.mode)
        return LAG_RUNNING;
    const double turn = turned(run);
    *factor = turn > 0.0 ? fmin(0.9 * TURN / turn, LARGEST) : LARGEST;
    return turn > TURN ? LAG_INACCURATE : LAG_RUNNING;
}

/* If there is no series (a static elimination that fails there), DOP853 takes the step. */
static int step(lag_run *run)
{
    const lag_system *s = &run->system;
    const double longest = run->step.h;
    ++run->step.evaluations;
    if (lag_solving_by(run) != LAG_BY_TAPE || run->series.order == 0
        || lag_series_expand(&run->series, s->nq, run->step.t, run->step.y))
        return explicit_step(run, longest);
    run->stepped = &lag_taylor;
    run->step.h = fmin(run->step.h, step_of_series(run));
    int undefined = 0;
    for (;;) {
        double factor;
        const double h = lag_step_size(run);
        if (h == 0.0) /* a small step shows whether the equations are undefined */
            return undefined ? LAG_UNDEFINED : explicit_step(run, longest);
        const int status = try_step(run, h, &factor);
        if (status == LAG_RUNNING) {
            lag_accept(run, h, factor);
            return LAG_RUNNING;
        }
        lag_be_strict(run);
        undefined |= status == LAG_UNDEFINED;
        run->step.h = factor * h;
        ++run->step.rejected;
    }
}

static void dense(lag_run *run, double t, double *y)
{
    lag_series_sum(&run->series, lag_size(&run->system), t - run->step.t_old, y);
}

static int control_points(lag_run *run, int i, double *b)
{
    const lag_series *s = &run->series;
    b[0] = COEFFICIENT(s, i, s->order);
    for (int m = 0; m < s->order; ++m)
        lag_times_linear(b, m, 0.0, run->step.h_old, COEFFICIENT(s, i, s->order - 1 - m));
    return s->order;
}

const lag_method lag_taylor = {
    .name = "Taylor",
    .order = 8.0,
    .uses_series = 1,
    .step = step,
    .dense = dense,
    .control_points = control_points};
