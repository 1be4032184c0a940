#include "motion.h"

#include <math.h>
#include <string.h>

#include "derivatives/changes.h"
#include "switching/kinks.h"
#include "tape/vectors.h"

int lag_accelerate(lag_run *run, double t, const double *y, int refined, double *power)
{
    if (run->switching.used && run->switching.kinks.slides >= 0)
        return lag_slide(run, t, y, refined, power) ? lag_failed(run, t, y) : 0;
    return lag_accelerate_on_branch(run, t, y, refined, power);
}

int lag_accelerate_accurately(lag_run *run, double t, const double *y, int refined, double *power)
{
    run->solver.verifies = 1;
    const int undefined = lag_accelerate(run, t, y, refined, power);
    run->solver.verifies = 0;
    return undefined;
}

int lag_accelerate_alone(lag_run *run, double t, const double *y, int refined, double *power)
{
    const int64_t dense_steps = run->solver.dense_steps;
    const int undefined = lag_accelerate_accurately(run, t, y, refined, power);
    run->solver.dense_steps = dense_steps;
    return undefined;
}

int lag_derivative(lag_run *run, double t, const double *y, double *f)
{
    const lag_system *s = &run->system;
    const lag_tape *d = &s->dynamics;
    const int nq = s->nq;
    memcpy(f, y + nq, (size_t)nq * sizeof(double));
    if (lag_solving_by(run) != LAG_BY_TAPE || lag_stabilizes(run) || run->solver.refining
        || run->switching.acting || (s->blocks > 1 && !s->complete) || run->derivatives.n) {
        if (lag_accelerate(run, t, y, run->solver.refining, f + 2 * nq))
            return 1;
        memcpy(f + nq, run->solver.a, (size_t)nq * sizeof(double));
        return run->derivatives.n && lag_rates_of_changes(run, t, y, f) ? lag_failed(run, t, y) : 0;
    }
    /* directly from the unrolled tape; without lambda there is no a */
    ++run->step.evaluations;
    lag_evaluate(d, s, t, y, LAG_ALL);
    f[2 * nq] = OUT(d, lag_first_total_power(s));
    const int32_t *places = d->outputs + lag_first_solution(s);
    return isfinite(d->vectors->pick(nq, d->registers, places, f + nq)) ? 0 : lag_failed(run, t, y);
}

double lag_scaled_norm(const lag_run *run, const double *x, const double *y, const double *z)
{
    const int n = lag_size(&run->system);
    return sqrt(run->system.vectors->scaled_square(n, x, y, z, run->tolerances.atol, run->settings.rtol));
}
