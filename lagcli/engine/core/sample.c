#include "sample.h"

#include <math.h>
#include <string.h>

#include "motion.h"
#include "project.h"
#include "step.h"

#define FINE 1e-5           /* of rtol: a residual of the equations that samples may have */

/* Write the consistent state at a sample time, with its a and lambda. */
static int sample(lag_run *run, double t, double *y)
{
    const lag_system *s = run->system;
    const int nq = s->nq, nc = s->nc;
    double power, *row = run->block + run->block_used * lag_sample_size(s);
    if (run->projecting) {
        const int status = lag_return(run, t, y);
        if (status != LAG_RUNNING)
            return status;
    }
    const int refined = run->refining || !lag_eliminating(run) || run->inaccuracy > FINE * run->rtol;
    if (lag_accelerate(run, t, y, refined, &power))
        return LAG_UNDEFINED;
    row[0] = t;
    memcpy(row + lag_sample_q(s), y, 2 * (size_t)nq * sizeof(double));
    memcpy(row + lag_sample_a(s), run->a, (size_t)nq * sizeof(double));
    memcpy(row + lag_sample_multipliers(s), run->multipliers, (size_t)nc * sizeof(double));
    row[lag_sample_work(s)] = y[2 * nq];
    ++run->block_used;
    ++run->times_next;
    return LAG_RUNNING;
}

int lag_sample_until(lag_run *run, double end)
{
    const int n = lag_size(run->system);
    double *y = run->y_sample;
    while (run->times_next < run->times_count && run->times[run->times_next] <= end) {
        const double t = run->times[run->times_next];
        if (run->block_used == run->block_rows)
            return LAG_BLOCK_FULL;
        if (run->finishing && t < run->t)
            lag_dense(run, t, y);
        else
            memcpy(y, run->finishing ? run->y_new : run->y, (size_t)n * sizeof(double));
        const int status = sample(run, t, y);
        if (status != LAG_RUNNING)
            return status;
    }
    return LAG_RUNNING;
}
