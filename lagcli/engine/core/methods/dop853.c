#include "methods/dop853.h"

#include <math.h>
#include <string.h>

#include "methods/control.h"
#include "methods/dop853_tableau.h"
#include "methods/method.h"
#include "motion.h"
#include "polynomial.h"
#include "sizes.h"
#include "step.h"
#include "tape/vectors.h"
#include "watch.h"


/* Distance of stages: a multiple of the cache line. */
static int apart(const lag_run *run)
{
    return (lag_size(&run->system) + 7) / 8 * 8;
}

/* Count steps that the method's order does not help: those that stability limits, not the error (Hairer & Wanner,
 * IV.2), and `flat` ones, whose error estimates of different orders are alike, because stiff forces or rounding
 * errors are larger than what the orders differ in. The last two stages have the same time, and their slope is
 * about the dominant eigenvalue; `before` is where the last but one was evaluated. */
static void look_for_stiffness(lag_run *run, double h, const double *before, int flat)
{
    const int n = lag_size(&run->system), moving = n - 1;
    const double *k = run->step.stages + (DOP_STAGES - 1) * apart(run), *last = k + apart(run);
    double *df = run->step.work, *dy = run->step.work + n;
    for (int m = 0; m < moving; ++m) {
        df[m] = last[m] - k[m];
        dy[m] = run->step.y_new[m] - before[m];
    }
    /* over the tolerances: coordinates and velocities of different units are comparable */
    const lag_vector_kernel *v = run->system.vectors;
    const double *y = run->step.y, *z = run->step.y_new;
    const double *atol = run->tolerances.atol, rtol = run->settings.rtol;
    const double rise = v->scaled_square(moving, df, y, z, atol, rtol);
    const double length = v->scaled_square(moving, dy, y, z, atol, rtol);
    const double rate = length > 0.0 ? sqrt(rise / length) : 0.0;
    if (flat || h * rate > STABLE) {
        run->stiffness.not_stiff = 0;
        ++run->stiffness.stiff;
    } else if (++run->stiffness.not_stiff == NOT_STIFF) {
        run->stiffness.stiff = 0;
    }
}

/* y = base + h times a sum of stages, n numbers. */
static void add_stages(const lag_run *run, int n, const double *base, const dop_sum *sum, double h, double *y)
{
    run->system.vectors->combine(n, base, sum->terms, run->step.stages, apart(run), sum->stage, sum->weight, h, y);
}

/* The sum of the squares of an error estimate over the tolerances. */
static double error_by(lag_run *run, const dop_sum *sum)
{
    const int n = lag_size(&run->system), whole = lag_whole_vectors(n);
    double *error = run->step.work;
    memset(error, 0, (size_t)whole * sizeof(double));
    add_stages(run, whole, error, sum, 1.0, error);
    return run->system.vectors->scaled_square(n, error, run->step.y, run->step.y_new,
                                        run->tolerances.atol, run->settings.rtol);
}

/* The error of a step of size h over the tolerances; the squares of its two estimates to e5 and e3. */
static double error_of(lag_run *run, double h, double *e5, double *e3)
{
    *e5 = error_by(run, &dop_e5);
    *e3 = error_by(run, &dop_e3);
    const double below = *e5 + 0.01 * *e3;
    /* overflow is not a small error */
    return !isfinite(below) ? INFINITY : below > 0.0 ? h * *e5 / sqrt(below) : 0.0;
}

/* Whether the error estimates of different orders are alike: stiff forces or rounding errors are larger than what the
 * orders differ in. */
static int is_flat(double e5, double e3)
{
    return e3 < FLAT * FLAT * e5;
}

static int step(lag_run *run)
{
    const int n = lag_size(&run->system), s = apart(run), whole = lag_whole_vectors(n);
    double *stage = run->step.stages;
    int rejected = 0, undefined = 0;
    for (;;) {
        const double h = lag_step_size(run);
        if (h == 0.0)
            return undefined ? LAG_UNDEFINED : LAG_FLOOR;
        memcpy(stage, run->step.f, (size_t)n * sizeof(double));
        int bad = 0;
        lag_watch_step(run);
        for (int i = 1; i <= DOP_STAGES && !bad; ++i) {
            double *y = run->step.y_new;
            add_stages(run, whole, run->step.y, i < DOP_STAGES ? dop_a + i : &dop_b, h, y);
            const double c = i < DOP_STAGES ? dop_c[i] : 1.0;
            if (i == DOP_STAGES - 1)
                memcpy(run->step.trial, y, (size_t)n * sizeof(double));
            bad = lag_derivative(run, run->step.t + c * h, y, stage + i * s);
            if (!bad && run->watch.mode) {
                if (dop_watched[i])
                    lag_watch_stage(run, run->step.t + c * h);
                lag_watch_determinant(run, run->step.t + c * h);
            }
        }
        double factor = 0.2;
        if (!bad) {
            double e5, e3, error = error_of(run, h, &e5, &e3);
            const int flat = error > SEEN && is_flat(e5, e3), notable = error > NOTABLE && flat;
            for (int attempt = 0; (error > 1.0 || (flat && !run->tolerances.raised)) && attempt < ATTEMPTS; ++attempt)
                if (lag_excuse_rounding(run, h, attempt, NULL))
                    error = error_of(run, h, &e5, &e3);
            if (error > 1.0) {
                error_by(run, &dop_e5);
                lag_reject_step(run, run->step.work);
            }
            if (error <= 1.0) {
                if (run->stiffness.detecting)
                    look_for_stiffness(run, h, run->step.trial, notable);
                if (lag_scale_rounding(run, IGNORED)) {
                    error = error_of(run, h, &e5, &e3);
                    lag_scale_rounding(run, 1.0 / IGNORED);
                }
                factor = lag_pi_factor(error, run->step.error_old, lag_dop853.order, rejected);
                run->step.error_old = fmax(error, LEAST_ERROR);
                memcpy(run->step.f_new, stage + DOP_STAGES * s, (size_t)n * sizeof(double));
                lag_accept(run, h, factor);
                return LAG_RUNNING;
            }
            factor = lag_rejected_factor(error, lag_dop853.order);
        }
        undefined |= bad;
        run->step.h = h * factor;
        rejected = 1;
        ++run->step.rejected;
    }
}

/* Values of dense_ready. */
enum { NO_STAGES, ALL_STAGES, COEFFICIENTS };

/* The stages of the dense output. */
static void add_dense_stages(lag_run *run)
{
    const int n = lag_size(&run->system), s = apart(run);
    const double h = run->step.h_old;
    for (int i = DOP_STAGES + 1; i < DOP_ALL_STAGES; ++i) {
        double *trial = run->step.trial;
        add_stages(run, lag_whole_vectors(n), run->step.y_old, dop_a + i, h, trial);
        /* undefined values cannot arise: the step around it was accepted; if they do, the
         * sample's own check finds them */
        const double t = run->step.t_old + dop_c[i] * h;
        if (lag_derivative(run, t, trial, run->step.stages + i * s))
            for (int m = 0; m < n; ++m)
                run->step.stages[i * s + m] = NAN;
        else if (run->step.searching && !lag_is_accurate(run, t, trial))
            run->step.dense_inaccurate = 1;
    }
    run->step.dense_ready = ALL_STAGES;
}

static void dense(lag_run *run, double t, double *y)
{
    const double h = run->step.h_old, x = (t - run->step.t_old) / h;
    if (!run->step.dense_ready)
        add_dense_stages(run);
    /* x (d_0 + (1 - x) (d_1 + x (d_2 + (1 - x) (d_3 + ...)))), where d_0 is the change of y in the
     * step, d_1 and d_2 give it the slopes at the ends, and all are sums of stages */
    double weight[7] = {x}, all[DOP_ALL_STAGES] = {0.0};
    for (int i = 1; i < 7; ++i)
        weight[i] = weight[i - 1] * (i % 2 == 0 ? x : 1.0 - x);
    const double change = weight[0] - weight[1] + 2.0 * weight[2];
    for (int j = 0; j < dop_b.terms; ++j)
        all[dop_b.stage[j]] = change * dop_b.weight[j];
    dop_sum sum = dop_d[0]; /* all four have the same stages, and those of dop_b */
    for (int i = 0; i < 4; ++i)
        for (int j = 0; j < sum.terms; ++j)
            all[sum.stage[j]] += weight[3 + i] * dop_d[i].weight[j];
    all[0] += weight[1] - weight[2];
    all[DOP_STAGES] -= weight[2];
    for (int j = 0; j < sum.terms; ++j)
        sum.weight[j] = all[sum.stage[j]];
    add_stages(run, lag_size(&run->system), run->step.y_old, &sum, h, y);
}

/* d_0 to d_6. */
static const double *dense_coefficients(lag_run *run)
{
    const int n = lag_size(&run->system), s = apart(run);
    const double h = run->step.h_old, *stages = run->step.stages;
    double *d = run->step.dense;
    if (!run->step.dense_ready)
        add_dense_stages(run);
    if (run->step.dense_ready != COEFFICIENTS) {
        const double *first = stages, *last = stages + DOP_STAGES * s;
        memset(d, 0, 7 * (size_t)n * sizeof(double));
        add_stages(run, n, d, &dop_b, h, d);
        for (int m = 0; m < n; ++m) {
            d[n + m] = h * first[m] - d[m];
            d[2 * n + m] = d[m] - h * last[m] - d[n + m];
        }
        for (int i = 0; i < 4; ++i)
            add_stages(run, n, d + (3 + i) * n, dop_d + i, h, d + (3 + i) * n);
        run->step.dense_ready = COEFFICIENTS;
    }
    return d;
}

static void dense_often(lag_run *run, double t, double *y)
{
    const int n = lag_size(&run->system);
    const double x = (t - run->step.t_old) / run->step.h_old, rest = 1.0 - x;
    const double *before = run->step.y_old, *d = dense_coefficients(run);
    for (int m = 0; m < n; ++m) {
        const double *c = d + m;
        const double inner = c[3 * n] + x * (c[4 * n] + rest * (c[5 * n] + x * c[6 * n]));
        y[m] = before[m] + x * (c[0] + rest * (c[n] + x * (c[2 * n] + rest * inner)));
    }
}

static void dense_slope(lag_run *run, double t, double *slope)
{
    const int n = lag_size(&run->system);
    const double h = run->step.h_old, x = (t - run->step.t_old) / h, rest = 1.0 - x;
    const double *d = dense_coefficients(run);
    for (int m = 0; m < n; ++m) { /* of dense_often, from the innermost factor on */
        double value = d[6 * n + m], rate = 0.0;
        for (int k = 5; k >= 0; --k) {
            rate = k % 2 ? value + x * rate : rest * rate - value;
            value = d[k * n + m] + (k % 2 ? x : rest) * value;
        }
        slope[m] = (value + x * rate) / h;
    }
}

/* The first stage and the coefficients of the dense output remain. */
static int step_to(lag_run *run, double t, double *y)
{
    const int n = lag_size(&run->system), s = apart(run);
    const double h = t - run->step.t_old;
    for (int i = 1; i < DOP_STAGES; ++i) {
        add_stages(run, n, run->step.y_old, dop_a + i, h, y);
        if (lag_derivative(run, run->step.t_old + dop_c[i] * h, y, run->step.stages + i * s))
            return 1;
    }
    add_stages(run, n, run->step.y_old, &dop_b, h, y);
    return 0;
}

static int control_points(lag_run *run, int i, double *b)
{
    const int n = lag_size(&run->system);
    const double *d = dense_coefficients(run) + i, before = run->step.y_old[i];
    for (int k = 0; k < 8; ++k) { /* as in dense_often: x^i (1 - x)^j has C(7 - i - j, k - i) / C(7, k) */
        const double end = d[3 * n] + (k - 2) / 3.0 * (d[4 * n] + (5 - k) / 2.0 * (d[5 * n] + (k - 3) * d[6 * n]));
        const double inner = d[n] + (k - 1) / 5.0 * (d[2 * n] + (6 - k) / 4.0 * end);
        b[k] = before + k / 7.0 * (d[0] + (7 - k) / 6.0 * inner);
    }
    return 7;
}

const lag_method lag_dop853 = {.name = "DOP853",
                               .order = 8.0,
                               .uses_slope = 1,
                               .step = step,
                               .dense = dense,
                               .dense_often = dense_often,
                               .dense_slope = dense_slope,
                               .step_to = step_to,
                               .control_points = control_points};
