#include "run.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "dop853.h"
#include "motion.h"
#include "project.h"
#include "radau5.h"
#include "rodas5p.h"
#include "sizes.h"
#include "taylor.h"
#include "watch.h"

#define SHORTER 0.3         /* of a step that went over a singular configuration to be passed */
#define FINE 1e-5           /* of rtol: a residual of the equations that samples may have */
#define SOUND 1e-4          /* the largest residual of an elimination that refinement may make up for */
#define CALM 20             /* accurate steps in a row until solutions are no longer refined */
#define CONTRADICTION 5e-7  /* of the terms of B a = gamma: what is looked at more closely */
#define BAUMGARTE_STEP 0.1  /* alpha = beta times the step size */

/* What a method does: whether it goes on from f, and the order of its error control. */
static const struct {
    int (*step)(lag_run *run);
    void (*dense)(lag_run *run, double t, double *y);
    int needs_slope;
    double order;
} steppers[] = {
    [LAG_DOP853] = {lag_dop853_step, lag_dop853_dense, 1, 8.0},
    [LAG_RODAS5P] = {lag_rodas5p_step, lag_rodas5p_dense, 0, 5.0},
    [LAG_RADAU5] = {lag_radau5_step, lag_radau5_dense, 0, 4.0},
    [LAG_TAYLOR] = {lag_taylor_step, lag_taylor_dense, 0, 8.0},
};

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

int lag_switch(lag_run *run, int method)
{
    run->method = run->stepped = method;
    run->error_old = 1e-4;
    run->stiff = run->not_stiff = 0;
    lag_radau5_restart(run);
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
    lag_first_step(run, steppers[run->method].order);
    return damp(run);
}

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

/* Sample and project the last accepted step. */
static int finish(lag_run *run)
{
    const int n = lag_size(run->system);
    const int status = lag_sample_until(run, run->t);
    if (status != LAG_RUNNING)
        return status;
    run->finishing = 0;
    memcpy(run->y, run->y_new, (size_t)n * sizeof(double));
    if (steppers[run->method].needs_slope) {
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
        if (!steppers[run->method].needs_slope)
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

void lag_dense(lag_run *run, double t, double *y)
{
    steppers[run->stepped].dense(run, t, y);
}

/* Undo the last step; the next one is a part of it. */
static void take_back(lag_run *run, double part)
{
    run->t = run->t_old;
    run->h = part * run->h_old;
    run->kept_last = 0.0;
    --run->steps;
    ++run->rejected;
    lag_radau5_restart(run);
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
    if (!run->refinable || run->refining || run->stepped == LAG_TAYLOR || run->inaccuracy > SOUND
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
        const int status = steppers[run->method].step(run);
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
