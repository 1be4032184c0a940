#include "dop853.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "dop853_tableau.h"
#include "motion.h"
#include "watch.h"

/* Hairer, Norsett & Wanner, II.4: a first step from the sizes of y, y' and y''. */
void lag_dop853_first_step(lag_run *run)
{
    const int n = lag_size(run->system);
    const double d0 = lag_scaled_norm(run, run->y, run->y, run->y);
    const double d1 = lag_scaled_norm(run, run->f, run->y, run->y);
    double h = d0 < 1e-5 || d1 < 1e-5 ? 1e-6 : 0.01 * d0 / d1;
    h = fmin(h, fmin(run->h_max, run->t_end - run->t));
    double *f1 = run->stages;
    for (int i = 0; i < n; ++i)
        run->y_new[i] = run->y[i] + h * run->f[i];
    if (lag_derivative(run, run->t + h, run->y_new, f1)) {
        run->h = h; /* the step itself will find a size that is defined */
        return;
    }
    for (int i = 0; i < n; ++i)
        f1[i] -= run->f[i];
    const double d2 = lag_scaled_norm(run, f1, run->y, run->y) / h;
    const double d = fmax(d1, d2);
    const double h1 = d <= 1e-15 ? fmax(1e-6, h * 1e-3) : pow(0.01 / d, 1.0 / 8.0);
    run->h = fmin(fmin(100.0 * h, h1), run->h_max);
}

int lag_dop853_step(lag_run *run)
{
    const int n = lag_size(run->system);
    double *stage = run->stages;
    int rejected = 0, undefined = 0;
    for (;;) {
        double h = run->h;
        if (!(h > 10.0 * DBL_EPSILON * fabs(run->t)) || !(h > DBL_MIN * 1e10))
            return undefined ? LAG_UNDEFINED : LAG_FLOOR;
        int last = 0;
        if (run->t + 1.01 * h >= run->t_end) {
            h = run->t_end - run->t;
            last = 1;
        }
        memcpy(stage, run->f, (size_t)n * sizeof(double));
        int bad = 0;
        run->kept = INFINITY;
        for (int i = 1; i <= DOP_STAGES && !bad; ++i) {
            const double *a = i < DOP_STAGES ? dop_a[i] : dop_b;
            double *y = run->y_new;
            for (int m = 0; m < n; ++m)
                y[m] = 0.0;
            for (int j = 0; j < i; ++j) {
                const double w = h * a[j];
                if (w == 0.0)
                    continue;
                const double *kj = stage + j * n;
                for (int m = 0; m < n; ++m)
                    y[m] += w * kj[m];
            }
            for (int m = 0; m < n; ++m)
                y[m] += run->y[m];
            const double c = i < DOP_STAGES ? dop_c[i] : 1.0;
            bad = lag_derivative(run, run->t + c * h, y, stage + i * n);
            if (!bad && run->watching)
                lag_watch_stage(run);
        }
        double factor = 0.2;
        if (!bad) {
            double e5 = 0.0, e3 = 0.0;
            for (int m = 0; m < n; ++m) {
                double x5 = 0.0, x3 = 0.0;
                for (int i = 0; i <= DOP_STAGES; ++i) {
                    x5 += dop_e5[i] * stage[i * n + m];
                    x3 += dop_e3[i] * stage[i * n + m];
                }
                const double tolerance =
                    run->atol + run->rtol * fmax(fabs(run->y[m]), fabs(run->y_new[m]));
                x5 /= tolerance;
                x3 /= tolerance;
                e5 += x5 * x5;
                e3 += x3 * x3;
            }
            const double below = e5 + 0.01 * e3;
            const double error = below > 0.0 ? h * e5 / sqrt(below) : 0.0;
            /* PI control, Hairer & Wanner IV.2, with beta = 0.04 */
            factor = error > 0.0
                         ? 0.9 * pow(error, -1.0 / 8.0 + 0.03) * pow(run->error_old, 0.04)
                         : 10.0;
            if (error <= 1.0) {
                factor = fmin(fmax(factor, 0.2), rejected ? 1.0 : 10.0);
                run->error_old = fmax(error, 1e-4);
                run->t_old = run->t;
                run->h_old = h;
                memcpy(run->y_old, run->y, (size_t)n * sizeof(double));
                run->t = last ? run->t_end : run->t + h;
                run->h = fmin(h * factor, run->h_max);
                memcpy(run->f_new, stage + DOP_STAGES * n, (size_t)n * sizeof(double));
                run->dense_ready = 0;
                ++run->steps;
                return LAG_RUNNING;
            }
            factor = fmax(0.9 * pow(error, -1.0 / 8.0), 0.2);
        }
        undefined |= bad;
        run->h = h * factor;
        rejected = 1;
        ++run->rejected;
    }
}

void lag_dop853_dense(lag_run *run, double t, double *y)
{
    const int n = lag_size(run->system);
    const double h = run->h_old, *stage = run->stages;
    double *d = run->dense;
    if (!run->dense_ready) {
        for (int i = DOP_STAGES + 1; i < DOP_ALL_STAGES; ++i) {
            double *trial = run->trial;
            memcpy(trial, run->y_old, (size_t)n * sizeof(double));
            for (int j = 0; j < i; ++j)
                for (int m = 0; m < n; ++m)
                    trial[m] += h * dop_a[i][j] * stage[j * n + m];
            /* undefined values cannot arise: the step around it was accepted; if they do, the
             * sample's own check finds them */
            if (lag_derivative(run, run->t_old + dop_c[i] * h, trial, run->stages + i * n))
                for (int m = 0; m < n; ++m)
                    run->stages[i * n + m] = NAN;
        }
        for (int m = 0; m < n; ++m) {
            const double delta = run->y_new[m] - run->y_old[m];
            d[m] = delta;
            d[n + m] = h * stage[m] - delta;
            d[2 * n + m] = 2.0 * delta - h * (stage[DOP_STAGES * n + m] + stage[m]);
            for (int i = 0; i < 4; ++i) {
                double sum = 0.0;
                for (int j = 0; j < DOP_ALL_STAGES; ++j)
                    sum += dop_d[i][j] * stage[j * n + m];
                d[(3 + i) * n + m] = h * sum;
            }
        }
        run->dense_ready = 1;
    }
    const double x = (t - run->t_old) / h;
    for (int m = 0; m < n; ++m) {
        double sum = 0.0;
        for (int i = 0; i < 7; ++i) {
            sum += d[(6 - i) * n + m];
            sum *= i % 2 == 0 ? x : 1.0 - x;
        }
        y[m] = run->y_old[m] + sum;
    }
}
