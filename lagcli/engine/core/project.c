#include "project.h"

#include <math.h>

#include "project_system.h"
#include "switching/hold.h"
#include "switching/kinks.h"

int lag_project(lag_run *run, double t, double *y)
{
    int status = lag_project_system(run, t, y);
    if (status == LAG_RUNNING && run->switching.acting) {
        status = lag_hold(run, t, y);
        if (status == LAG_RUNNING && run->switching.kinks.slides >= 0)
            status = lag_hold_surface(run, t, y);
    }
    return status;
}

int lag_return(lag_run *run, double t, double *y)
{
    const int nq = run->system.nq, status = lag_project(run, t, y);
    if (status != LAG_RUNNING || run->system.nh == 0)
        return status;
    const double *sizes = run->rows.sizes;
    double most = 0.0;
    for (int i = 0; i < nq; ++i)
        most = fmax(most, fabs(y[i]) / sizes[i]);
    for (int i = 0; i < nq; ++i) {
        const double moved = fabs(y[i] - run->failure.y[i]);
        if (moved > FAR_ROUNDING * most * sizes[i]
            && moved > FAR * (run->tolerances.atol[i] + run->settings.rtol * fabs(y[i]))
            && moved > FAR_PART * run->tolerances.largest[run->tolerances.kind[i]]
            && lag_position_residual(run, t, run->failure.y) > FAR_ROUNDING)
            return LAG_JUMPED;
    }
    return LAG_RUNNING;
}
