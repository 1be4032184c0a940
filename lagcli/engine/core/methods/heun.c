/* Heun's method of order 2 with Euler's method for its error and linear dense output. */
#include <math.h>

#include "methods/control.h"
#include "methods/method.h"
#include "motion.h"
#include "step.h"
#include "watch.h"

static int step(lag_run *run)
{
    const int n = lag_size(&run->system);
    double *y = run->step.y_new, *f = run->step.f, *k = run->step.f_new, *e = run->step.trial;
    for (int rejected = 0;; rejected = 1) {
        const double h = lag_step_size(run);
        if (h == 0.0)
            return LAG_FLOOR;
        lag_watch_step(run);
        for (int m = 0; m < n; ++m)
            y[m] = run->step.y[m] + h * f[m];
        double error = INFINITY;
        if (!lag_stage(run, run->step.t + h, y, k)) {
            for (int m = 0; m < n; ++m) {
                e[m] = 0.5 * h * (k[m] - f[m]);
                y[m] += e[m];
            }
            error = lag_scaled_norm(run, e, run->step.y, y);
        }
        if (error <= 1.0 && !lag_derivative(run, run->step.t + h, y, k)) {
            const double factor = lag_pi_factor(error, run->step.error_old, lag_heun.order, rejected);
            run->step.error_old = fmax(error, LEAST_ERROR);
            lag_accept(run, h, factor);
            return LAG_RUNNING;
        }
        run->step.h = h * lag_rejected_factor(error, lag_heun.order);
        ++run->step.rejected;
    }
}

static void dense(lag_run *run, double t, double *y)
{
    const double x = (t - run->step.t_old) / run->step.h_old;
    for (int m = 0; m < lag_size(&run->system); ++m)
        y[m] = run->step.y_old[m] + x * (run->step.y_new[m] - run->step.y_old[m]);
}

const lag_method lag_heun = {
    .name = "Heun", .order = 2.0, .uses_slope = 1, .step = step, .dense = dense};
