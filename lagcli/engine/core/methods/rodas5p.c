/* Rodas5P: a Rosenbrock-Wanner method of order 5(4), with dense output of order 4. */
#include <math.h>
#include <string.h>

#include "methods/control.h"
#include "methods/implicit.h"
#include "methods/method.h"
#include "motion.h"
#include "methods/rodas5p_tableau.h"
#include "polynomial.h"
#include "sizes.h"
#include "step.h"
#include "watch.h"

/* The stages U of a step of size h from (t, y), and y_new. Returns 0, or 1 where they are
 * undefined. */
static int stages(lag_run *run, double h)
{
    const int n = lag_size(&run->system);
    double *r = run->step.trial, *y = run->step.y_new;
    lag_watch_step(run);
    for (int i = 0; i < RODAS_STAGES; ++i) {
        double *u = run->step.stages + i * n;
        memcpy(y, run->step.y, (size_t)n * sizeof(double));
        for (int j = 0; j < i; ++j)
            for (int m = 0; m < n; ++m)
                y[m] += rodas_a[i][j] * run->step.stages[j * n + m];
        if (i == 0)
            memcpy(r, run->step.f, (size_t)n * sizeof(double));
        else if (lag_stage(run, run->step.t + rodas_c[i] * h, y, r))
            return 1;
        for (int j = 0; j < i; ++j)
            for (int m = 0; m < n; ++m)
                r[m] += rodas_C[i][j] / h * run->step.stages[j * n + m];
        lag_shifted_solve(run, r, rodas_d[i] * h, u);
    }
    const double *last = run->step.stages + (RODAS_STAGES - 1) * n;
    for (int m = 0; m < n; ++m)
        y[m] += last[m];
    return 0;
}

static int step(lag_run *run)
{
    const int n = lag_size(&run->system);
    int rejected = 0, undefined = 0;
    if (lag_linearize(run, run->step.t, run->step.y, run->step.f))
        return LAG_UNDEFINED;
    for (;;) {
        const double h = lag_step_size(run);
        if (h == 0.0)
            return undefined ? LAG_UNDEFINED : LAG_FLOOR;
        double factor = 0.2;
        if (lag_shift(run, 1.0 / (rodas_gamma * h))) {
            const int status = lag_reorder(run);
            if (status != LAG_RUNNING)
                return status;
        } else if (stages(run, h)) {
            undefined = 1;
        } else {
            const double *last = run->step.stages + (RODAS_STAGES - 1) * n;
            double error = lag_scaled_norm(run, last, run->step.y, run->step.y_new);
            for (int attempt = 0; error > 1.0 && attempt < ATTEMPTS; ++attempt)
                if (lag_excuse_rounding(run, h, attempt, lag_shifted_noise))
                    error = lag_scaled_norm(run, last, run->step.y, run->step.y_new);
            factor = error > 0.0 ? fmin(fmax(0.9 * pow(error, -1.0 / 5.0), 0.2), 6.0) : 6.0;
            if (error <= 1.0) {
                if (run->implicit->h_accepted > 0.0 && error > 0.0) {
                    const double follows = lag_predicted_factor(h, error, run->implicit->h_accepted,
                                                                run->step.error_old, lag_rodas5p.order);
                    factor = fmax(fmin(factor, follows), 0.2);
                }
                if (rejected)
                    factor = fmin(factor, 1.0);
                run->step.error_old = fmax(error, 1e-2);
                run->implicit->h_accepted = h;
                lag_accept(run, h, factor);
                return LAG_RUNNING;
            }
            lag_reject_step(run, last);
            if (!isfinite(error))
                factor = 0.2;
        }
        run->step.h = h * factor;
        rejected = 1;
        ++run->step.rejected;
    }
}

/* What bends the chord between the ends of the step. */
static const double *dense_coefficients(lag_run *run)
{
    const int n = lag_size(&run->system);
    double *d = run->step.dense;
    if (!run->step.dense_ready) {
        for (int i = 0; i < 3; ++i)
            for (int m = 0; m < n; ++m) {
                double sum = 0.0;
                for (int j = 0; j < RODAS_STAGES; ++j)
                    sum += rodas_h[i][j] * run->step.stages[j * n + m];
                d[i * n + m] = sum;
            }
        run->step.dense_ready = 1;
    }
    return d;
}

static void dense(lag_run *run, double t, double *y)
{
    const int n = lag_size(&run->system);
    const double *d = dense_coefficients(run);
    const double x = (t - run->step.t_old) / run->step.h_old;
    for (int m = 0; m < n; ++m) {
        const double bend = d[m] + x * (d[n + m] + x * d[2 * n + m]);
        y[m] = run->step.y_old[m] + x * (run->step.y_new[m] - run->step.y_old[m] + (1.0 - x) * bend);
    }
}

static int control_points(lag_run *run, int i, double *b)
{
    const int n = lag_size(&run->system);
    const double *d = dense_coefficients(run) + i, before = run->step.y_old[i];
    b[0] = d[2 * n];
    lag_times_linear(b, 0, 0.0, 1.0, d[n]);
    lag_times_linear(b, 1, 0.0, 1.0, d[0]);
    lag_times_linear(b, 2, 1.0, 0.0, run->step.y_new[i] - before);
    lag_times_linear(b, 3, 0.0, 1.0, before);
    return 4;
}

static void restart(lag_run *run)
{
    run->implicit->h_accepted = 0.0;
}

const lag_method lag_rodas5p = {
    .name = "Rodas5P",
    .order = 5.0,
    .step = step,
    .dense = dense,
    .control_points = control_points,
    .restart = restart};
