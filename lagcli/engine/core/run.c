#include "run.h"

#include <math.h>
#include <string.h>

#include "control.h"
#include "events.h"
#include "method.h"
#include "motion.h"
#include "project.h"
#include "sample.h"
#include "sizes.h"
#include "step.h"
#include "watch.h"

#define SHORTER 0.3         /* of a step that went over a singular configuration to be passed */
#define SOUND 1e-4          /* the largest residual of an elimination that refinement may make up for */
#define CALM 20             /* accurate steps in a row until solutions are no longer refined */
#define CONTRADICTION 5e-7  /* of the terms of B a = gamma: what is looked at more closely */
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

int lag_switch(lag_run *run, const lag_method *method)
{
    run->method = run->stepped = method;
    run->error_old = LEAST_ERROR;
    run->stiff = run->not_stiff = 0;
    lag_restart(run);
    return lag_derivative(run, run->t, run->y, run->f) ? LAG_UNDEFINED : LAG_RUNNING;
}

int lag_start(lag_run *run)
{
    if (run->projecting) {
        const int status = lag_project(run, run->t, run->y);
        if (status != LAG_RUNNING)
            return status;
    }
    if (lag_switch(run, run->method) != LAG_RUNNING)
        return LAG_UNDEFINED;
    run->weakest = lag_weakest(run, run->t, run->y);
    run->usual = fmax(run->usual, run->weakest);
    run->finishing = 0;
    run->kept_last = 0.0;
    run->inaccuracy = INFINITY; /* not known yet */
    lag_events_start(run);
    lag_sizes_start(run);
    lag_first_step(run, run->method->order);
    return damp(run);
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
    if (run->method->uses_slope) {
        memcpy(run->f, run->f_new, (size_t)n * sizeof(double));
        const int damped = damp(run);
        if (damped != LAG_RUNNING)
            return damped;
    }
    if (run->projecting && run->system->nc) {
        const int off = lag_return(run, run->t, run->y);
        if (off != LAG_RUNNING)
            return off;
        lag_measure(run);
        lag_sizes_update(run);
        if (!run->method->uses_slope)
            return LAG_RUNNING; /* it evaluates y' itself */
        for (int i = 0; i < n; ++i)
            run->trial[i] = run->y[i] - run->y_new[i];
        if (lag_scaled_norm(run, run->trial, run->y, run->y) > NEGLIGIBLE
            && lag_derivative(run, run->t, run->y, run->f))
            return LAG_UNDEFINED;
        /* f holds q' = v exactly in any case */
        memcpy(run->f, run->y + run->system->nq, (size_t)run->system->nq * sizeof(double));
    } else {
        lag_sizes_update(run);
    }
    return LAG_RUNNING;
}

/* Undo the last step; the next one is a part of it. */
static void take_back(lag_run *run, double part)
{
    run->t = run->t_old;
    run->h = part * run->h_old;
    run->kept_last = 0.0;
    --run->steps;
    ++run->rejected;
    lag_restart(run);
}

/* After a step: whether y' is accurate enough. Where plain solutions of the linear system are not, but
 * refined ones are, y' takes these until plain ones have been accurate for some steps. */
static int accurate(lag_run *run)
{
    const double allowed = lag_allowed_inaccuracy(run), *y = run->y_new;
    run->inaccuracy = lag_inaccuracy(run, run->t, y, 0);
    if (run->inaccuracy <= allowed) {
        if (run->refining && ++run->accurate_steps == CALM)
            run->refining = 0;
        return 1;
    }
    run->accurate_steps = 0;
    if (run->refining)
        return lag_inaccuracy(run, run->t, y, 1) <= allowed;
    return 0;
}

/* After a step that was not accurate enough and taken back: start refining if that makes up for what
 * the elimination lacks. Returns whether it does. */
static int refine(lag_run *run)
{
    if (!run->refinable || run->refining || run->stepped->uses_series || run->inaccuracy > SOUND
        || lag_inaccuracy(run, run->t_bad, run->y_bad, 1) > lag_allowed_inaccuracy(run))
        return 0;
    run->refining = 1;
    return !lag_derivative(run, run->t, run->y, run->f);
}

int lag_advance(lag_run *run, long slice)
{
    for (;;) {
        if (run->finishing) {
            int status = run->events.count ? lag_events_look(run) : LAG_RUNNING;
            if (status == LAG_RUNNING)
                status = finish(run);
            if (status != LAG_RUNNING)
                return status;
            if (run->watching && lag_approaches(run))
                return LAG_NEAR;
            if (run->contradicted)
                return LAG_CONTRADICTED;
            if (run->stiff >= STIFF && run->t < run->t_end) {
                run->stiff = 0;
                return LAG_STIFF;
            }
        }
        if (run->t >= run->t_end)
            return LAG_DONE;
        if (slice-- <= 0)
            return LAG_RUNNING;
        const int status = run->method->step(run);
        if (status != LAG_RUNNING)
            return status;
        const int sound = accurate(run);
        lag_sizes_energy(run, run->y_new);
        if (!sound) {
            run->t_bad = run->t;
            memcpy(run->y_bad, run->y_new, (size_t)lag_size(run->system) * sizeof(double));
            take_back(run, 1.0);
            if (refine(run))
                continue;
            return LAG_INACCURATE;
        }
        run->contradicted = run->projecting
                            && lag_contradiction(run, run->t, run->y_new) > CONTRADICTION;
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
