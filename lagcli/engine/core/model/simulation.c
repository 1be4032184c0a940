/* Simulations of models as data: what lagcli does where a run returns to its caller. */
#include "model/simulation.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "evaluate.h"
#include "methods/method.h"
#include "switching/clock.h"
#include "switching/instant.h"

#define LOG_ROWS 512     /* entries of the run's log, at least */
#define RETRIES 16       /* at one time: beyond it, dense solutions are no help */
#define REPEATS 10       /* of a step that may have passed a singular configuration, each shorter than the last one */
#define LEAST_PERIOD (64.0 * DBL_EPSILON) /* of a clock, relative to times: shorter ones are rounding errors */

/* Whether the settings are in their ranges; NaN is within none but of what may be left out. */
static int are_settings(const lag_settings *s)
{
    return isfinite(s->t_end) && s->rtol >= 0.0 && isfinite(s->rtol) && !(s->alpha < 0.0) && !(s->beta < 0.0)
           && s->max_step > 0.0 && s->closed >= 0.0 && isfinite(s->closed);
}

/* Whether the problem can be solved, which the caller may have changed. */
static int is_problem(const lag_model *model)
{
    const lag_problem *p = &model->problem;
    const lag_switching_rules *r = &model->rules;
    const int n = 2 * model->equations.nq + 1;
    if (!p->atol || p->times_count < 0 || (p->times_count && (!p->times || !p->block)) || p->block_rows < 1
        || p->extra != r->rows || p->directions < 0 || !isfinite(p->t) || !are_settings(&p->settings)
        || !(p->settings.t_end >= p->t))
        return 0;
    for (int i = 0; i < n; ++i)
        if (!(p->atol[i] >= 0.0))
            return 0;
    for (int64_t i = 0; i < p->times_count; ++i)
        if (!isfinite(p->times[i]) || (i && !(p->times[i] > p->times[i - 1])))
            return 0;
    for (int i = 0; i < r->clocks; ++i) {
        const double first = r->ticks[3 * i], step = r->ticks[3 * i + 1], per = r->ticks[3 * i + 2];
        const double largest = fmax(fabs(first / per), fmax(fabs(p->t), fabs(p->settings.t_end)));
        if (!(per > 0.0) || !(step > 0.0) || !(step / per >= LEAST_PERIOD * largest) || !isfinite(step / per))
            return 0;
    }
    return 1;
}

/* The number of a method by its name; -1. */
static int number_of(const char *name)
{
    for (int i = 0; lag_method_at(i); ++i) {
        const char *a = lag_method_name(lag_method_at(i)), *b = name;
        while (*a && *a == *b)
            ++a, ++b;
        if (*a == *b)
            return i;
    }
    return -1;
}

/* The methods that need more than the equations. */
static int is_missing(const lag_model *model, const lag_method *method)
{
    if (method == &lag_taylor)
        return !(model->contents & LAG_MODEL_SERIES);
    return method != &lag_dop853 && !(model->contents & LAG_MODEL_JACOBIANS);
}

static int use_functions(lag_simulation *s)
{
    const lag_model *m = &s->model;
    return m->function_count && lag_use_functions(s->run, m->functions, m->function_count);
}

static int use_switching(lag_simulation *s)
{
    lag_switching_rules rules = s->model.rules;
    const int64_t least = 8 * (int64_t)rules.rows + 8;
    if (!(s->model.contents & LAG_MODEL_SWITCHING))
        return 0;
    const int width = 6 + rules.exported + 3 * s->model.equations.nq + rules.nc;
    if (!rules.log) {
        rules.log_rows = least > LOG_ROWS ? least : LOG_ROWS;
        rules.log = lag_doubles(&s->pool, rules.log_rows * width);
    }
    return !rules.log || lag_use_switching(s->run, &rules);
}

/* Use the unrolled elimination from here on. */
static int unroll(lag_simulation *s)
{
    s->steps_to_unroll = INT64_MAX;
    if (lag_use_unrolled(s->run, &s->model.unrolled))
        return 1;
    if (s->model.contents & LAG_MODEL_RECURSIVE)
        return lag_use_equations(s->run, &s->model.dynamics);
    return lag_method_at(s->method) == &lag_taylor && lag_use_series(s->run, &s->model.series);
}

/* Use an elimination in a loop, or the dense solution. */
static int use_loop(lag_simulation *s)
{
    const lag_model *m = &s->model;
    return m->contents & LAG_MODEL_LOOP ? lag_use_elimination(s->run, &m->dynamics, &m->elimination)
                                        : lag_use_dense(s->run, &m->dynamics);
}

static int use_dynamics(lag_simulation *s)
{
    const lag_model *m = &s->model;
    const int unrolled = m->contents & LAG_MODEL_UNROLLED;
    if (m->contents & LAG_MODEL_TANGENT
        && lag_use_tangent(s->run, &m->tangent, m->tangent_blocks, m->tangent_complete))
        return 1;
    if (m->left_out && lag_leave_out(s->run, m->left_out))
        return 1;
    if (!(m->contents & LAG_MODEL_PLAIN) || (unrolled && lag_method_at(s->method) == &lag_taylor))
        return unroll(s);
    s->steps_to_unroll = unrolled ? m->unroll_after : INT64_MAX;
    return use_loop(s);
}

/* Make the run. Returns 0, or 1 where there is no memory. */
static int make_run(lag_simulation *s, const lag_memory *memory)
{
    const lag_model *m = &s->model;
    const lag_method *method = lag_method_at(s->method);
    s->run = lag_create(memory, &m->equations, &m->problem);
    if (!s->run || use_functions(s) || use_switching(s) || use_dynamics(s))
        return 1;
    if (method != &lag_dop853) {
        if (method != &lag_taylor && lag_use_jacobians(s->run, &m->jacobians))
            return 1;
        lag_switch(s->run, method);
    }
    return (m->contents & LAG_MODEL_TIME && lag_use_explicit_time(s->run, &m->explicit_time))
           || (m->break_count && lag_use_breaks(s->run, m->breaks, m->break_count)) || lag_events_bind(s);
}

int lag_make_simulation(const lag_memory *memory, const lag_model *model, const char *method,
                        lag_simulation **simulation)
{
    const int number = number_of(method);
    *simulation = NULL;
    if (!is_problem(model))
        return LAG_MODEL_NUMBER;
    if (number < 0 || is_missing(model, lag_method_at(number)))
        return LAG_MODEL_METHOD;
    lag_pool pool = lag_pool_of(memory);
    lag_simulation *made = lag_get(&pool, 1, sizeof *made);
    if (!made)
        return LAG_MODEL_MEMORY;
    made->pool = pool;
    made->model = *model;
    made->method = number;
    made->retried = NAN;
    lag_pool of_log = lag_pool_of(memory);
    made->log = lag_get(&of_log, 1, sizeof *made->log);
    if (made->log)
        made->log->pool = of_log;
    if (!made->log || make_run(made, memory)) {
        lag_destroy_simulation(made);
        return LAG_MODEL_MEMORY;
    }
    *simulation = made;
    return LAG_MODEL_READ;
}

void lag_destroy_simulation(lag_simulation *s)
{
    if (s->run)
        lag_destroy(s->run);
    if (s->log) {
        lag_pool of_log = s->log->pool; /* the log is allocated in it */
        lag_release(&of_log);
    }
    lag_pool pool = s->pool; /* and the simulation in this one */
    lag_release(&pool);
}

lag_run *lag_run_of(lag_simulation *s)
{
    return s->run;
}

int lag_stopped_by(const lag_simulation *s)
{
    return s->stopped;
}

const double *lag_log_of(const lag_simulation *s, int64_t *count, int *width)
{
    *count = s->used;
    *width = s->width;
    return s->log->rows;
}

static int end(lag_simulation *s, int status)
{
    s->phase = LAG_ENDED;
    return s->status = status;
}

/* Use the next order of pivots for the method, or the dense solution where there is none. */
static int use_pivots(lag_simulation *s)
{
    const lag_model *m = &s->model;
    const lag_pivots none = {0}, *pivots = &none;
    for (int i = 0, order = 0; pivots == &none && i < m->pivots_count; ++i)
        if (m->pivots[i].method == s->method && order++ == s->orders)
            pivots = &m->pivots[i].pivots;
    ++s->orders;
    return lag_use_pivots(s->run, pivots);
}

/* Go back to the elimination in a loop, for good, from that of other unknowns, whose order is more delicate; or solve densely
 * for a step, as the elimination fails. Returns whether that may help. */
static int retry(lag_simulation *s)
{
    const int with_loop = LAG_MODEL_RECURSIVE | LAG_MODEL_LOOP;
    if ((s->model.contents & with_loop) == with_loop && s->run->system.equations.registers)
        return !use_loop(s) && lag_sizes_again(s->run) == LAG_RUNNING;
    const double t = s->run->step.t;
    s->retries = s->retried == t ? s->retries + 1 : 0;
    s->retried = t;
    return s->retries < RETRIES && !lag_allow_dense(s->run, 1) && lag_sizes_again(s->run) == LAG_RUNNING;
}

/* Whether the caller answers a status. */
static int answers(const lag_simulation *s, int status)
{
    return s->answered >> status & 1;
}

/* Whether the caller must take samples before anything else, or the log if it does that. */
static int is_full(const lag_simulation *s)
{
    return answers(s, LAG_HAPPENED) || s->run->samples.used >= s->run->samples.rows;
}

int lag_simulate(lag_simulation *s, int64_t steps)
{
    lag_run *run = s->run;
    for (;;) {
        const int64_t before = run->step.steps, until = s->steps_to_unroll - before;
        int status = LAG_RUNNING;
        switch (s->phase) {
        case LAG_AT_START: status = lag_start(run); break;
        case LAG_UNDER_WAY:
            if (steps <= 0 && !run->switching.due) /* an instant is completed */
                return LAG_RUNNING;
            status = lag_advance(run, steps <= 0 ? 0 : steps < until ? steps : until);
            steps -= run->step.steps > before ? run->step.steps - before : 1; /* what ends a slice early counts, too */
            break;
        case LAG_SETTLING: status = run->switching.begun ? lag_advance(run, 0) : lag_start(run); break;
        case LAG_LAST_SAMPLE: status = lag_sample_until(run, run->step.t); break;
        case LAG_ENDED: return s->status;
        }
        if (!answers(s, LAG_HAPPENED) && lag_events_collect(s))
            return end(s, LAG_NO_MEMORY);
        const int has_begun = run->switching.begun || !run->switching.used;
        if (status == LAG_BLOCK_FULL) {
            if (s->phase == LAG_AT_START && has_begun)
                s->phase = LAG_UNDER_WAY;
            if (is_full(s))
                return LAG_BLOCK_FULL;
            continue;
        }
        if (s->phase == LAG_LAST_SAMPLE)
            return end(s, LAG_DONE);
        if (s->phase == LAG_SETTLING) {
            if (status != LAG_RUNNING && status != LAG_RESOLVED && status != LAG_HAPPENED)
                return end(s, LAG_DONE);
            lag_events_resolve(s);
            s->phase = LAG_LAST_SAMPLE;
            continue;
        }
        if (answers(s, status)) {
            s->phase = LAG_UNDER_WAY;
            return status;
        }
        switch (status) {
        case LAG_RUNNING:
            if (s->phase == LAG_AT_START) {
                s->phase = LAG_UNDER_WAY;
                if (s->open)
                    lag_events_resolve(s);
            }
            if (run->step.steps > before)
                s->repeats = 0;
            if (run->step.steps >= s->steps_to_unroll && unroll(s))
                return end(s, LAG_NO_MEMORY);
            if (lag_is_due(s))
                return LAG_RUNNING;
            break;
        case LAG_HAPPENED:
            status = lag_events_happen(s);
            if (status != LAG_RUNNING)
                return end(s, status);
            s->phase = s->stopped >= 0 ? LAG_SETTLING : run->switching.begun ? LAG_UNDER_WAY : LAG_AT_START;
            break;
        case LAG_RESOLVED: lag_events_resolve(s); break;
        case LAG_ORDER:
            if (use_pivots(s))
                return end(s, LAG_NO_MEMORY);
            break;
        case LAG_INACCURATE:
            if (!retry(s))
                return end(s, status);
            break;
        case LAG_UNDEFINED:
            if (s->retried == run->step.t || !retry(s))
                return end(s, status);
            s->phase = LAG_AT_START;
            break;
        case LAG_STIFF: /* there is one method */
        case LAG_NEAR:  /* if the path leads there, the steps end at their minimum, or one goes over it */
            break;
        case LAG_OVER:
            if (s->repeats++ == REPEATS)
                return end(s, status);
            lag_repeat(run);
            break;
        default: return end(s, status);
        }
    }
}

void lag_let_answer(lag_simulation *s, int64_t statuses)
{
    s->answered = statuses & ~(INT64_C(1) << LAG_RUNNING | INT64_C(1) << LAG_DONE);
}

void lag_begin_again_here(lag_simulation *s)
{
    s->phase = LAG_AT_START;
}

void lag_wait(lag_simulation *s, int waits)
{
    s->run->switching.waits = waits;
}

int lag_is_due(const lag_simulation *s)
{
    return s->run->switching.due && s->run->switching.waits;
}

double lag_next_time(const lag_simulation *s)
{
    return lag_next_tick(s->run);
}

int lag_simulate_to(lag_simulation *s, double t)
{
    return lag_simulate_watched(s, t, NULL, NULL);
}

int lag_simulate_watched(lag_simulation *s, double t, lag_after_step *after, void *context)
{
    lag_run *run = s->run;
    int status = lag_simulate(s, 0);
    if (!(run->settings.t_end > t))
        run->settings.t_end = t + (t - run->step.t_start) + 1.0;
    while (status == LAG_RUNNING && run->step.t < t && !lag_is_due(s)) {
        lag_set_stop(run);
        run->step.t_stop = fmin(run->step.t_stop, t);
        status = lag_simulate(s, 1);
        if (status == LAG_RUNNING && after)
            t = fmin(t, fmax(after(context), run->step.t));
    }
    return status;
}

int lag_change_parameters(lag_simulation *s, const double *from, const double *to, int count)
{
    lag_run *run = s->run;
    double *p = s->p ? s->p : run->parameters;
    if (run->switching.used && s->phase == LAG_UNDER_WAY) {
        const int status = run->switching.due ? LAG_RUNNING : lag_begin_change(run);
        if (status != LAG_RUNNING)
            return end(s, status);
    } else {
        s->phase = LAG_AT_START;
    }
    for (int i = 0; i < count; ++i)
        if (to[i] != from[i])
            p[i] = to[i];
    if (s->p)
        lag_set_parameters(run, lag_held_parameters(s));
    else
        lag_renew_tapes(run);
    return LAG_RUNNING;
}

const double *lag_parameters_of(lag_simulation *s)
{
    return s->model.contents & LAG_MODEL_SWITCHING ? lag_held_parameters(s) : s->run->parameters;
}

void lag_archive_simulation(lag_archive *a, lag_simulation *s)
{
    lag_run *run = s->run;
    int phase = (int)s->phase, orders = s->orders;
    lag_archive_int(a, &phase, LAG_AT_START, LAG_ENDED);
    lag_archive_int(a, &s->status, 0, INT32_MAX);
    lag_archive_reals(a, &s->retried, 1);
    lag_archive_int(a, &s->retries, 0, INT32_MAX / 2);
    lag_archive_int(a, &s->repeats, 0, REPEATS);
    lag_archive_int(a, &orders, 0, INT32_MAX / 2);
    s->phase = (enum lag_phase)phase;
    if (s->phase == LAG_ENDED && s->status != LAG_DONE) /* one that has failed has no state to continue from */
        a->damaged = 1;
    if (a->use == LAG_READS && run->implicit && orders != s->orders) {
        const lag_pivots none = {0};
        s->orders = orders - 1;
        a->damaged |= orders > 0 ? use_pivots(s) : lag_use_pivots(run, &none);
        s->orders = orders;
    }
    lag_archive_run(a, run, lag_method_at(s->method));
    if (s->width)
        lag_archive_events(a, s);
}

size_t lag_simulation_size(const lag_simulation *s)
{
    return lag_saved_size(&s->pool) + lag_state_size(s->run);
}

void lag_save_simulation(const lag_simulation *s, void *to)
{
    lag_save(s->run, lag_save_pool(&s->pool, to));
}

int lag_restore_simulation(lag_simulation *s, const void *from)
{
    const char *run = lag_saved_pool(&s->pool, from, 0);
    if (!run || lag_restore(s->run, run))
        return 1;
    lag_saved_pool(&s->pool, from, 1);
    return 0;
}
