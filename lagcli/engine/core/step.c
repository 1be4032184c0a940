#include "step.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "method.h"
#include "motion.h"

double lag_step_size(const lag_run *run)
{
    const double h = run->h;
    if (!(h > 10.0 * DBL_EPSILON * fabs(run->t)) || !(h > DBL_MIN * 1e10))
        return 0.0;
    return run->t + 1.01 * h >= run->t_end ? run->t_end - run->t : h;
}

void lag_accept(lag_run *run, double h, double factor)
{
    run->t_old = run->t;
    run->h_old = h;
    memcpy(run->y_old, run->y, (size_t)lag_size(run->system) * sizeof(double));
    run->t = h == run->t_end - run->t ? run->t_end : run->t + h;
    run->h = fmin(h * factor, run->h_max);
    run->dense_ready = 0;
    ++run->steps;
}

void lag_restart(lag_run *run)
{
    if (run->method->restart)
        run->method->restart(run);
}

void lag_dense(lag_run *run, double t, double *y)
{
    run->stepped->dense(run, t, y);
}
