#include "sample.h"

#include <math.h>
#include <string.h>

#include "derivatives/changes.h"
#include "left_out.h"
#include "motion.h"
#include "project.h"
#include "step.h"
#include "switching/settle.h"

#define FINE 1e-5           /* of rtol: acceptable residual of the equations at samples */

/* Write the multipliers of all constraints, with those of rows that switch. */
static void write_multipliers(const lag_run *run, double *multipliers)
{
    const lag_switching *sw = &run->switching;
    for (int i = 0; i < run->system.nc; ++i)
        multipliers[sw->base[i]] = run->solver.multipliers[i];
    for (int i = 0; i < sw->rows; ++i)
        multipliers[sw->constraint[i]] = sw->mode[i] == LAG_OPEN ? 0.0 : sw->sign[i] * sw->force[i];
}

/* Find a and lambda, the least of those that are not unique. Returns 0, or 1 where they are undefined. */
static int accelerate(lag_run *run, double t, const double *y)
{
    const int refined = run->solver.refining || lag_solving_by(run) == LAG_BY_LU
                        || run->solver.inaccuracy > FINE * run->settings.rtol;
    double power;
    if (lag_accelerate_accurately(run, t, y, refined, &power))
        return 1;
    if (!lag_left_out(run) || !lag_share_multipliers(run, run->solver.multipliers))
        return 0;
    run->solver.dense_steps = 1;
    return lag_accelerate(run, t, y, 1, &power);
}

/* Write the consistent state next to y, with its a and lambda. */
static int write_consistent(lag_run *run, double t, double *y, double *row)
{
    const lag_system *s = &run->system;
    const int nq = s->nq, nc = s->nc;
    if (lag_projects(run)) {
        const int status = lag_return(run, t, y);
        if (status != LAG_RUNNING)
            return status;
    }
    if (run->derivatives.n && lag_project_changes(run, t, y))
        return LAG_UNDEFINED;
    if (accelerate(run, t, y))
        return LAG_UNDEFINED;
    if (run->switching.acting && run->switching.redundant)
        lag_share_forces(run, t, y);
    row[0] = t;
    memcpy(row + lag_sample_q(s), y, 2 * (size_t)nq * sizeof(double));
    memcpy(row + lag_sample_a(s), run->solver.a, (size_t)nq * sizeof(double));
    if (run->samples.extra)
        write_multipliers(run, row + lag_sample_multipliers(s));
    else
        memcpy(row + lag_sample_multipliers(s), run->solver.multipliers, (size_t)nc * sizeof(double));
    row[lag_sample_work(s) + run->samples.extra] = y[2 * nq];
    if (run->derivatives.n && lag_write_changes(run, t, y, row + lag_sample_size(s) + run->samples.extra))
        return LAG_UNDEFINED;
    return LAG_RUNNING;
}

/* The same; what the elimination cannot do accurately is done by the dense solution, for this row alone. */
static int write_row(lag_run *run, double t, double *y, double *row)
{
    const int64_t dense_steps = run->solver.dense_steps;
    const int status = write_consistent(run, t, y, row);
    run->solver.dense_steps = dense_steps;
    return status;
}

/* Store the sample at a time, which may lie within the last step. */
static int sample(lag_run *run, double t, int within, double *y)
{
    const int64_t width = lag_sample_size(&run->system) + run->samples.extra + lag_width_of_changes(run);
    double *row = run->samples.block + run->samples.used * width;
    int status = write_row(run, t, y, row);
    if (status == LAG_RUNNING && within && lag_strays(run, t, row + lag_sample_a(&run->system))) {
        lag_go_to(run, t, y);
        status = write_row(run, t, y, row);
    }
    if (status != LAG_RUNNING)
        return status;
    if (run->samples.written)
        run->samples.written(run->samples.context, row);
    ++run->samples.used;
    ++run->samples.next;
    return LAG_RUNNING;
}

int lag_sample_here(lag_run *run, double *row)
{
    lag_switching *sw = &run->switching;
    const size_t of_state = (size_t)lag_size(&run->system) * sizeof(double);
    const size_t solution = (size_t)(run->system.nq + run->system.nc) * sizeof(double);
    const size_t all = (size_t)(sw->rows + sw->nf), of_rows = (size_t)sw->rows * sizeof(double);
    double *y = run->samples.y, *kept = sw->kept;
    /* the motion does not depend on whether anybody reads a row: forces are found from the ones before */
    memcpy(run->samples.kept, run->solver.a, solution);
    if (sw->rows + sw->nf) {
        memcpy(kept, sw->force, all * sizeof(double));
        memcpy(kept + all, sw->tried, of_rows);
    }
    memcpy(y, run->step.y, of_state);
    const int status = write_row(run, run->step.t, y, row);
    memcpy(run->solver.a, run->samples.kept, solution);
    if (sw->rows + sw->nf) {
        memcpy(sw->force, kept, all * sizeof(double));
        memcpy(sw->tried, kept + all, of_rows);
    }
    return status;
}

int lag_sample_until(lag_run *run, double end)
{
    const int n = lag_size(&run->system);
    double *y = run->samples.y;
    while (run->samples.next < run->samples.count && run->samples.times[run->samples.next] <= end) {
        const double t = run->samples.times[run->samples.next];
        if (run->samples.used == run->samples.rows)
            return LAG_BLOCK_FULL;
        const int within = run->step.finishing && t < run->step.t;
        if (within)
            lag_go_to(run, t, y);
        else
            memcpy(y, run->step.finishing ? run->step.y_new : run->step.y, (size_t)n * sizeof(double));
        const int status = sample(run, t, within, y);
        if (status != LAG_RUNNING)
            return status;
    }
    return LAG_RUNNING;
}
