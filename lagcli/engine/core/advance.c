#include "run.h"

#include <math.h>
#include <string.h>

#include "bind.h"
#include "breaks.h"
#include "derivatives/changes.h"
#include "left_out.h"
#include "methods/control.h"
#include "methods/dop853.h"
#include "methods/method.h"
#include "motion.h"
#include "project.h"
#include "resolution.h"
#include "sample.h"
#include "sizes.h"
#include "step.h"
#include "switching/clock.h"
#include "switching/instant.h"
#include "switching/kinks.h"
#include "switching/log.h"
#include "switching/watched.h"
#include "watch.h"

#define SHORTER 0.3         /* of a step that passed a singular configuration, in which a contact closes unseen, or whose dense output strays */
#define SOUND 1e-4          /* largest residual of an elimination that refinement can correct */
#define EXACT (100.0 * DBL_EPSILON) /* residual of the order of rounding errors */
#define NOTICEABLE 0.1      /* error of a solution beside the tolerances of a step, which may have rejected it */
#define ACCURATE_STEPS 20   /* consecutive accurate steps after which solutions are no longer refined */
#define CONTRADICTION 5e-7  /* of the terms of B a = gamma: residual that is examined more closely */
#define FORESEEN 16         /* steps after which, and after twice as many again and again, later calls are estimated ... */
#define SURE 0.5            /* ... and the part of them that is expected */
#define BAUMGARTE_STEP 0.1  /* alpha = beta times the step size */

/* Set the damping of the next step, and update the derivative. */
static int damp(lag_run *run)
{
    if (run->settings.formulation != LAG_BAUMGARTE || !isnan(run->settings.alpha))
        return LAG_RUNNING;
    run->baumgarte.alpha = BAUMGARTE_STEP / run->step.h;
    if (isnan(run->settings.beta))
        run->baumgarte.beta = run->baumgarte.alpha;
    return lag_derivative(run, run->step.t, run->step.y, run->step.f) ? LAG_UNDEFINED : LAG_RUNNING;
}

int lag_switch(lag_run *run, const lag_method *method)
{
    run->switching.chosen = method;
    if (run->switching.acting)
        method = &lag_dop853; /* only DOP853 supports forces of switched rows */
    run->method = run->stepped = method;
    run->step.error_old = LEAST_ERROR;
    run->stiffness.stiff = run->stiffness.not_stiff = 0;
    lag_restart(run);
    return lag_derivative(run, run->step.t, run->step.y, run->step.f) ? LAG_UNDEFINED : LAG_RUNNING;
}

/* Undo the last step; it is repeated in parts. */
static void take_back(lag_run *run, double part)
{
    run->step.t = run->step.t_old;
    run->step.h = part * run->step.h_old;
    --run->step.steps;
    ++run->step.rejected;
    lag_restart(run);
}

void lag_repeat(lag_run *run)
{
    run->step.finishing = 0;
    take_back(run, SHORTER);
}

int lag_start(lag_run *run)
{
    if (run->step.finishing) /* something is undefined in the last step */
        lag_repeat(run);
    if (lag_projects(run)) {
        const int status = lag_project(run, run->step.t, run->step.y);
        if (status != LAG_RUNNING)
            return status;
    }
    if (run->switching.used) {
        const int going_on = run->switching.begun;
        int status = lag_begin_modes(run);
        if (status == LAG_RUNNING && going_on) { /* the state may have changed */
            memset(run->switching.kinks.state, 0, (size_t)run->switching.kinks.count * sizeof(int));
            status = lag_choose_branches(run);
        }
        if (status == LAG_RUNNING)
            status = lag_choose_sides(run);
        if (status != LAG_RUNNING)
            return status;
    }
    if (lag_switch(run, run->switching.used ? run->switching.chosen : run->method) != LAG_RUNNING)
        return LAG_UNDEFINED;
    lag_watch_restart(run);
    run->step.finishing = 0;
    run->solver.inaccuracy = INFINITY; /* unknown */
    lag_clocks_start(run);
    lag_breaks_start(run);
    lag_sizes_start(run);
    lag_first_step(run, run->method->order);
    if (run->switching.used && lag_watch_modes(run, run->step.t, run->step.y, run->step.f) != LAG_RUNNING)
        return LAG_UNDEFINED;
    if (run->switching.used)
        lag_log_redundant(run);
    int status = damp(run);
    if (status == LAG_RUNNING && run->switching.used)
        status = lag_begin_ticks(run);
    return status == LAG_RUNNING && !run->switching.due ? lag_sample_until(run, run->step.t) : status;
}

/* Expect the calls of the steps that are left, if they are as long as the last one. */
static void foresee(const lag_run *run)
{
    const int64_t steps = run->step.steps;
    if (steps < FORESEEN || steps & (steps - 1)) /* no power of two */
        return;
    const double left = (run->settings.t_end - run->step.t) / run->step.h_old;
    const double last = (double)(steps == FORESEEN ? steps : steps / 2), times = SURE * left / last;
    lag_foresee(&run->system.dynamics, times);
    lag_foresee(&run->system.constraint, times);
}

/* Sample and project the last accepted step. */
static int finish(lag_run *run)
{
    const int n = lag_size(&run->system);
    const double t = run->step.t;
    const int status = lag_sample_until(run, lag_at_break(run) ? nextafter(t - lag_coincidence(t), -INFINITY) : t);
    if (status != LAG_RUNNING)
        return status;
    run->step.finishing = 0;
    foresee(run);
    if (run->watch.mode)
        lag_watch_accept(run);
    run->rows.margin -= run->watch.path.length;
    memcpy(run->step.y, run->step.y_new, (size_t)n * sizeof(double));
    if (run->method->uses_slope) {
        memcpy(run->step.f, run->step.f_new, (size_t)n * sizeof(double));
        const int damped = damp(run);
        if (damped != LAG_RUNNING)
            return damped;
    }
    if (lag_projects(run) && (run->system.nc || run->switching.acting)) {
        const int off = lag_return(run, run->step.t, run->step.y);
        if (off != LAG_RUNNING)
            return off;
        if (run->derivatives.n && lag_project_changes(run, run->step.t, run->step.y))
            return LAG_UNDEFINED;
        lag_measure(run);
        lag_sizes_update(run);
        if (!run->method->uses_slope)
            return LAG_RUNNING; /* it evaluates y' itself */
        for (int i = 0; i < n; ++i)
            run->step.trial[i] = run->step.y[i] - run->step.y_new[i];
        if (lag_scaled_norm(run, run->step.trial, run->step.y, run->step.y) > NEGLIGIBLE
            && lag_derivative(run, run->step.t, run->step.y, run->step.f))
            return LAG_UNDEFINED;
        /* f holds q' = v exactly in any case */
        memcpy(run->step.f, run->step.y + run->system.nq, (size_t)run->system.nq * sizeof(double));
    } else {
        lag_sizes_update(run);
    }
    return LAG_RUNNING;
}

/* Whether refined solutions may replace plain ones. */
static int may_refine(const lag_run *run)
{
    return run->solver.refinable && !run->solver.refining && !run->stepped->uses_series
           && run->solver.inaccuracy <= SOUND;
}

/* Directly after lag_inaccuracy: the scaled norm of what refinement would change in the velocities of the last step. */
static double solution_error(lag_run *run)
{
    const int nq = run->system.nq;
    double *correction = run->step.work, *change = run->step.trial;
    lag_correct(run, correction);
    memset(change, 0, (size_t)lag_size(&run->system) * sizeof(double));
    for (int i = 0; i < nq; ++i)
        change[nq + i] = run->step.h_old * correction[i];
    return lag_scaled_norm(run, change, run->step.y_new, run->step.y_new);
}

/* Whether y' is accurate enough after a step. If plain solutions of the linear system are not, but refined
 * ones are, y' uses these until plain ones have been accurate for ACCURATE_STEPS steps. After a rejected step,
 * whose cause may be the error of a solution, this error must also be negligible beside the tolerances. */
static int accurate(lag_run *run)
{
    const double allowed = lag_allowed_inaccuracy(run), *y = run->step.y_new;
    const double inaccuracy = run->solver.inaccuracy = lag_inaccuracy(run, run->step.t, y, 0);
    const int refining = run->solver.refining, rejected = run->step.rejected > run->solver.rejected;
    const int suspected = inaccuracy > EXACT && (refining || (rejected && may_refine(run)));
    run->solver.rejected = run->step.rejected;
    if (inaccuracy <= allowed && !(suspected && solution_error(run) > NOTICEABLE)) {
        if (refining && ++run->solver.accurate_steps == ACCURATE_STEPS)
            run->solver.refining = 0;
        return 1;
    }
    run->solver.accurate_steps = 0;
    return refining && lag_inaccuracy(run, run->step.t, y, 1) <= allowed;
}

/* After a step that was not accurate enough and taken back: start refining if that makes up for what
 * the elimination lacks. Returns whether it does. */
static int refine(lag_run *run)
{
    if (!may_refine(run)
        || lag_inaccuracy(run, run->failure.t, run->failure.y, 1) > lag_allowed_inaccuracy(run))
        return 0;
    run->solver.refining = 1;
    return !lag_derivative(run, run->step.t, run->step.y, run->step.f);
}

int lag_advance(lag_run *run, int64_t slice)
{
    for (;;) {
        if (run->step.finishing) {
            int status = run->switching.used ? lag_look_for_instant(run) : LAG_RUNNING;
            if (status == LAG_RUNNING && !run->step.finishing && !run->switching.due)
                continue; /* the step is repeated */
            if (status == LAG_RUNNING && !run->switching.due)
                status = finish(run);
            if ((status == LAG_INACCURATE || status == LAG_UNDEFINED) && run->step.finishing) {
                run->step.finishing = run->switching.located = 0; /* the state is that before the step */
                take_back(run, 1.0);
            }
            if (status != LAG_RUNNING || (run->switching.due && run->switching.waits))
                return status;
            const int approach = run->watch.mode && !run->switching.due ? lag_follow_approach(run) : LAG_RUNNING;
            if (approach != LAG_RUNNING)
                return approach;
            if (run->rows.contradicted && !lag_is_near(run))
                return LAG_CONTRADICTED;
            if (lag_overlooked(run) && lag_take_all_rows(run, 2))
                return LAG_INACCURATE;
            if (run->stiffness.stiff >= STIFF && run->step.t < run->settings.t_end && !run->switching.acting) {
                run->stiffness.stiff = 0;
                return LAG_STIFF;
            }
        }
        int status = LAG_RUNNING;
        if (run->switching.due && (status = lag_do_instant(run)) != LAG_RUNNING)
            return status;
        if (lag_at_break(run) && (status = lag_pass_row(run)) == LAG_RUNNING) {
            if (run->switching.due && run->switching.waits)
                return status;
            if (run->switching.due)
                continue;
            status = damp(run);
        }
        if (status == LAG_RUNNING)
            status = lag_sample_until(run, run->step.t);
        if (status != LAG_RUNNING)
            return status;
        if (run->step.t >= run->settings.t_end)
            return LAG_DONE;
        if (slice-- <= 0)
            return LAG_RUNNING;
        if (run->solver.dense_steps)
            --run->solver.dense_steps;
        if (lag_check_left_out(run) && lag_take_all_rows(run, 1))
            return LAG_INACCURATE;
        status = lag_sizes_follow(run);
        if (status == LAG_RUNNING)
            status = run->method->step(run);
        if ((status == LAG_FLOOR || status == LAG_UNDEFINED) && lag_jams(run))
            return LAG_JAMMED;
        if (status != LAG_RUNNING)
            return status;
        const int sound = accurate(run);
        lag_sizes_energy(run, run->step.y_new);
        if (!sound) {
            run->failure.t = run->step.t;
            memcpy(run->failure.y, run->step.y_new, (size_t)lag_size(&run->system) * sizeof(double));
            take_back(run, 1.0);
            if (refine(run))
                continue;
            return LAG_INACCURATE;
        }
        if (run->switching.used && lag_penetrates(run)) {
            take_back(run, SHORTER);
            continue;
        }
        run->rows.contradicted = lag_projects(run) && !lag_left_out(run)
                            && lag_contradiction(run, run->step.t, run->step.y_new) > CONTRADICTION;
        const int over = run->watch.mode && lag_stepped_over(run);
        if (over && run->watch.mode == 1) {
            take_back(run, SHORTER);
            continue;
        }
        const double part = lag_resolved_part(run);
        if (part < 1.0) {
            take_back(run, part);
            continue;
        }
        run->step.finishing = 1;
        if (over)
            return LAG_OVER;
    }
}
