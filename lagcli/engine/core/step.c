#include "step.h"

#include <math.h>
#include <string.h>

#include "methods/control.h"
#include "methods/method.h"
#include "evaluate.h"
#include "resolution.h"
#include "switching/rows.h"

double lag_coincidence(double t)
{
    return RESOLUTION * fabs(t);
}

double lag_step_size(lag_run *run)
{
    const double left = run->step.t_stop - run->step.t;
    double h = run->step.h;
    if (run->switching.rows)
        lag_forget_speeds(run);
    if (left <= lag_coincidence(run->step.t_stop) && h >= left)
        return left; /* a rounding error between times at which steps end, not a step that became small */
    if (run->resolution.count)
        h = lag_resolved_step(run, fmin(h, left));
    if (!(h > 10.0 * DBL_EPSILON * fabs(run->step.t)) || !(h > DBL_MIN * 1e10))
        return 0.0;
    if (run->step.t + 1.01 * h >= run->step.t_stop)
        return left;
    return lag_exact_step(run->step.t, h, run->step.t_start, run->settings.t_end);
}

void lag_accept(lag_run *run, double h, double factor)
{
    run->step.t_old = run->step.t;
    run->step.h_old = h;
    memcpy(run->step.y_old, run->step.y, (size_t)lag_size(&run->system) * sizeof(double));
    run->step.t = h == run->step.t_stop - run->step.t ? run->step.t_stop : run->step.t + h;
    /* a step that was cut short does not reduce the next one */
    run->step.h = fmin(factor < 1.0 ? h * factor : fmax(h * factor, run->step.h), run->step.h_max);
    run->step.dense_ready = run->step.dense_inaccurate = run->step.strays = 0;
    ++run->step.steps;
    if (run->switching.rows)
        lag_keep_speeds(run);
}

void lag_restart(lag_run *run)
{
    if (run->method->restart)
        run->method->restart(run);
}

void lag_dense(lag_run *run, double t, double *y)
{
    if (run->step.strays) /* the stages are no longer those of the step */
        lag_dense_often(run, t, y);
    else
        run->stepped->dense(run, t, y);
}

void lag_go_to(lag_run *run, double t, double *y)
{
    if (!run->step.strays || run->stepped->step_to(run, t, y))
        lag_dense(run, t, y);
}

int lag_strays(lag_run *run, double t, const double *a)
{
    const lag_method *method = run->stepped;
    const int nq = run->system.nq;
    double *slope = run->step.trial + nq;
    if (run->step.strays || !method->dense_slope)
        return 0;
    method->dense_slope(run, t, run->step.trial);
    for (int i = 0; i < nq; ++i)
        slope[i] = run->step.h_old * (slope[i] - a[i]);
    const double square = run->system.vectors->scaled_square(nq, slope, run->step.y_old + nq, run->step.y_new + nq,
                                                             run->tolerances.atol + nq, run->settings.rtol);
    run->step.strays = square > MOST_STRAY * MOST_STRAY * nq;
    return run->step.strays;
}

void lag_dense_often(lag_run *run, double t, double *y)
{
    const lag_method *method = run->stepped;
    (method->dense_often ? method->dense_often : method->dense)(run, t, y);
}
