#include "run.h"

#include <math.h>
#include <string.h>

#include "dop853.h"
#include "motion.h"
#include "project.h"
#include "watch.h"

#define SHORTER 0.3         /* of a step that went over a singular configuration to be passed */
#define NEGLIGIBLE 0.01     /* of the tolerance: a projection that moves less leaves f as it is */
#define BAUMGARTE_STEP 0.1  /* alpha = beta times the step size */

/* Set the damping of the next step, and the derivative with it. */
static int damp(lag_run *run)
{
    if (!run->alpha_from_step)
        return LAG_RUNNING;
    run->alpha = BAUMGARTE_STEP / run->h;
    if (run->beta_from_alpha)
        run->beta = run->alpha;
    return lag_derivative(run, run->t, run->y, run->f) ? LAG_UNDEFINED : LAG_RUNNING;
}

int lag_start(lag_run *run)
{
    if (run->projecting) {
        const int status = lag_project(run, run->t, run->y);
        if (status != LAG_RUNNING)
            return status;
    }
    if (lag_derivative(run, run->t, run->y, run->f))
        return LAG_UNDEFINED;
    run->weakest = lag_weakest(run, run->t, run->y);
    run->usual = fmax(run->usual, run->weakest);
    run->error_old = 1e-4;
    run->finishing = 0;
    lag_dop853_first_step(run);
    return damp(run);
}

/* Write the consistent state at a sample time, with its a and lambda. */
static int sample(lag_run *run, double t, double *y)
{
    const lag_system *s = run->system;
    const int nq = s->nq, nc = s->nc;
    double power, *row = run->block + run->block_used * (2 + 3 * nq + nc);
    if (run->projecting) {
        const int status = lag_project(run, t, y);
        if (status != LAG_RUNNING)
            return status;
    }
    if (lag_accelerate(run, t, y, 1, &power))
        return LAG_UNDEFINED;
    row[0] = t;
    memcpy(row + 1, y, 2 * (size_t)nq * sizeof(double));
    memcpy(row + 1 + 2 * nq, run->a, (size_t)nq * sizeof(double));
    memcpy(row + 1 + 3 * nq, run->multipliers, (size_t)nc * sizeof(double));
    row[1 + 3 * nq + nc] = y[2 * nq];
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

/* Sample and project the last accepted step. */
static int finish(lag_run *run)
{
    const int n = lag_size(run->system);
    const int status = lag_sample_until(run, run->t);
    if (status != LAG_RUNNING)
        return status;
    run->finishing = 0;
    memcpy(run->y, run->y_new, (size_t)n * sizeof(double));
    memcpy(run->f, run->f_new, (size_t)n * sizeof(double));
    const int damped = damp(run);
    if (damped != LAG_RUNNING)
        return damped;
    if (run->projecting && run->system->nc) {
        const int off = lag_project(run, run->t, run->y);
        if (off != LAG_RUNNING)
            return off;
        lag_measure(run);
        for (int i = 0; i < n; ++i)
            run->trial[i] = run->y[i] - run->y_new[i];
        if (lag_scaled_norm(run, run->trial, run->y, run->y) > NEGLIGIBLE
            && lag_derivative(run, run->t, run->y, run->f))
            return LAG_UNDEFINED;
        /* f holds q' = v exactly in any case */
        memcpy(run->f, run->y + run->system->nq, (size_t)run->system->nq * sizeof(double));
    }
    return LAG_RUNNING;
}

void lag_dense(lag_run *run, double t, double *y)
{
    lag_dop853_dense(run, t, y);
}

/* Undo the last step; the next one is a part of it. */
static void take_back(lag_run *run, double part)
{
    run->t = run->t_old;
    run->h = part * run->h_old;
    --run->steps;
    ++run->rejected;
}

int lag_advance(lag_run *run, long slice)
{
    for (;;) {
        if (run->finishing) {
            const int status = finish(run);
            if (status != LAG_RUNNING)
                return status;
            if (run->watching && lag_approaches(run))
                return LAG_NEAR;
        }
        if (run->t >= run->t_end)
            return LAG_DONE;
        if (slice-- <= 0)
            return LAG_RUNNING;
        const int status = lag_dop853_step(run);
        if (status != LAG_RUNNING)
            return status;
        if (lag_inaccurate(run, run->t, run->y_new)) {
            run->t_bad = run->t;
            memcpy(run->y_bad, run->y_new, (size_t)lag_size(run->system) * sizeof(double));
            take_back(run, 1.0);
            return LAG_INACCURATE;
        }
        const int over = run->watching && lag_goes_over(run);
        if (over && run->watching == 1) {
            take_back(run, SHORTER);
            continue;
        }
        if (run->dense_steps)
            --run->dense_steps;
        run->finishing = 1;
        if (over)
            return LAG_OVER;
    }
}
