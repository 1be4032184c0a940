#include "switching/instant.h"

#include <math.h>
#include <string.h>

#include "breaks.h"
#include "derivatives/jumps.h"
#include "methods/control.h"
#include "methods/method.h"
#include "motion.h"
#include "project.h"
#include "sample.h"
#include "sizes.h"
#include "step.h"
#include "switching/choice.h"
#include "switching/clock.h"
#include "switching/collision.h"
#include "switching/enclosure.h"
#include "switching/kinks.h"
#include "switching/log.h"
#include "switching/rows.h"
#include "switching/search.h"
#include "switching/settle.h"
#include "switching/watched.h"
#include "watch.h"

#define ROUNDS 100          /* rounds at one instant after which it counts as endless */
#define AGAIN 1e-7          /* of the run: a function of a branch vanishes again so soon; ... */
#define OFTEN 1000          /* ... if it does so often in a row, it does not end */
#define SAME_INSTANT 1e-13  /* of the time, or of the step: an instant not later than the last one */
#define BETWEEN 2.0         /* of the time between instants: limit of a step after one; longer steps locate the next
                               one less accurately */
#define RETAINED 0.1        /* of that time: shorter intervals are ignored */
#define BEYOND 10           /* closed gaps: how far an action may move a contact beyond its surface, or away from
                               it, as rounding */
#define TURNS 100.0         /* tolerances, and ... */
#define TURNS_PART 1e-6     /* ... of the velocities: a change by a projection that counts as a jump */

/* What the program that drives the run knows of an instant. */
enum { NOTHING_REPORTED, BEGIN_REPORTED, END_REPORTED };

#define UNCERTAIN 10.0      /* relative tolerances: a margin below may be zero */
#define JAMMING 1e-3        /* margin below which forces, which are inversely proportional to it, reduce the steps */

static double *velocities(lag_run *run)
{
    return run->step.y + run->system.nq;
}

/* Whether a row that holds shares its force with others, and could obey its law by more than these. */
static int loose(const lag_switching *sw, int row)
{
    return sw->redundant && isfinite(sw->slack[row]) && !sw->tight[row];
}

/* Whether a row slips. */
static int slips(const lag_switching *sw)
{
    for (int i = 0; i < sw->rows; ++i)
        if (lag_row_slips(sw, i))
            return 1;
    return 0;
}

int lag_jams(lag_run *run)
{
    return slips(&run->switching) && !lag_all_forces(run, run->step.t, run->step.y)
           && fabs(run->switching.margin) < JAMMING;
}

/* Whether a function of a branch vanishes again and again, as where a body comes to rest in a notch: the times between
 * become those in which it moves by rounding errors. */
static int recurs(lag_run *run, int kink)
{
    lag_kinks *k = &run->switching.kinks;
    const double t = run->switching.instant, soon = AGAIN * (run->settings.t_end - run->step.t_start);
    k->recurred[kink] = k->recurred[kink] > 0.0 && t - k->vanished[kink] < soon ? k->recurred[kink] + 1.0 : 1.0;
    k->vanished[kink] = t;
    return k->recurred[kink] > OFTEN;
}

/* Record the watched functions that cross zero and end a mode. Returns LAG_RUNNING, LAG_JAMMED or LAG_ENDLESS. */
static int note_ends(lag_run *run)
{
    lag_switching *sw = &run->switching;
    for (int k = 0; k < sw->watched_count; ++k) {
        const lag_watched_function *w = sw->watched + k;
        if (!w->hit || (w->what < LAG_WATCH_SLIP && loose(sw, w->which)))
            continue;
        if (w->what == LAG_WATCH_FORCE && slips(sw) && sw->margin < UNCERTAIN * run->settings.rtol)
            return LAG_JAMMED; /* the force is 0/0 within the tolerance: Painleve's singular point */
        if (w->what == LAG_WATCH_FORCE)
            sw->ended[w->which] = FORCE_ENDED;
        else if (w->what == LAG_WATCH_STICK)
            sw->ended[w->which] = sw->force[w->which] < 0.0 ? STICKING_ENDED_FORWARD : STICKING_ENDED_BACKWARD;
        else if (w->what == LAG_WATCH_SLIP)
            sw->ended[w->which] = SLIPPING_ENDED;
        else if (w->what == LAG_WATCH_MARGIN)
            return LAG_JAMMED;
        else if (w->what == LAG_WATCH_SIGN)
            sw->turned[w->which] = 1;
        else if (w->what == LAG_WATCH_KINK) {
            sw->kinks.state[w->which] = LAG_ON_SURFACE;
            ++sw->kinks.crossed;
            if (recurs(run, w->which))
                return LAG_ENDLESS;
        } else if (w->what == LAG_WATCH_SURFACE)
            lag_leave_surface(run, -w->sign);
        else if (w->what >= LAG_WATCH_CONDITION) {
            lag_condition *c = sw->condition + w->which;
            c->holds = c->either ? !c->holds : 1;
            c->happened = 1;
            sw->report = 1;
        }
    }
    lag_note_ticks(run);
    return LAG_RUNNING;
}

/*
 * Begin an instant at sw->instant, in the state `before`: a and lambda as the mode ends, and the values of conditions,
 * are those there. Returns LAG_RUNNING, or LAG_UNDEFINED.
 */
static int begin_instant(lag_run *run)
{
    lag_switching *sw = &run->switching;
    if (lag_all_forces(run, sw->instant, sw->before))
        return LAG_UNDEFINED;
    memcpy(sw->begin, run->solver.a, (size_t)run->system.nq * sizeof(double));
    memcpy(sw->begin + run->system.nq, sw->multipliers, (size_t)sw->nc * sizeof(double));
    if (sw->signs)
        memcpy(sw->sign_before, sw->sign_value, (size_t)sw->signs * sizeof(double));
    sw->located = 0;
    run->step.finishing = 0;
    run->step.t = sw->instant;
    memcpy(run->step.y, sw->before, (size_t)lag_size(&run->system) * sizeof(double));
    for (int i = 0; i < sw->rows; ++i) /* psi is that of lag_all_forces */
        sw->stray[i] = !lag_projects(run) && sw->mode[i] == LAG_HOLDS ? fabs(sw->psi[i]) : 0.0;
    for (int c = 0; c < sw->conditions + sw->force_conditions; ++c) {
        lag_condition *condition = sw->condition + c;
        condition->happened = 0;
        condition->value = lag_condition_value(run, c, sw->instant, sw->before);
        if (condition->rests) { /* but for its rounding errors, and those of the rows that hold it there */
            const double zero = fmax(lag_condition_noise(condition), lag_held_error(run, c, sw->instant, sw->before));
            condition->rests = fabs(condition->value) <= zero ? LAG_AT_ZERO : LAG_OFF_ZERO;
        }
        const int root = c < sw->conditions && fabs(condition->off) <= WRONG * lag_condition_noise(condition);
        condition->off = root ? fabs(condition->value) : 0.0;
    }
    memset(sw->ended, 0, (size_t)sw->rows * sizeof(int));
    memset(sw->kinks.state, 0, (size_t)sw->kinks.count * sizeof(int));
    memcpy(sw->mode_before, sw->mode, (size_t)sw->rows * sizeof(int));
    sw->due = 1;
    sw->settled = 0;
    sw->stage = NOTHING_REPORTED;
    return LAG_RUNNING;
}

/* Whether the instant follows the last one: rounds are counted anew. Ticks advance, however close they are. */
static void begin_count(lag_run *run)
{
    lag_switching *sw = &run->switching;
    const double same = SAME_INSTANT * fmax(fabs(sw->instant), run->step.h_old);
    if (sw->instant > sw->last + same || lag_ticks_at(run, sw->instant)) {
        sw->rounds = sw->impacts = 0;
        sw->interval = fmax(sw->instant - sw->last, RETAINED * sw->interval);
    }
    sw->last = sw->instant;
}

/* Mark the functions of the present modes that a jump of an input at the current time makes negative, besides those that
 * are marked. `values` are there. Returns whether there are any marks. */
static int mark_jumps(lag_run *run, const double *values)
{
    lag_switching *sw = &run->switching;
    int marked = 0;
    for (int k = 0; k < sw->watched_count; ++k) {
        lag_watched_function *w = sw->watched + k;
        const double zero = fmax(w->noise, lag_watched_noise(run, w));
        const int jumps = values[k] < -zero && run->step.t >= w->resolved && !lag_ends_silently(sw, w);
        marked |= w->hit |= jumps;
    }
    return marked;
}

int lag_pass_row(lag_run *run)
{
    lag_switching *sw = &run->switching;
    const int status = lag_pass_break(run);
    if (status != LAG_RUNNING || !run->switching.used)
        return status;
    const double *y = run->step.y;
    double *values = sw->values, *slopes = sw->node_values;
    if (!sw->watched_count)
        return LAG_RUNNING;
    if (lag_watched_ends(run, LAG_WATCHED, run->step.t, y, run->step.f, values, slopes))
        return LAG_UNDEFINED;
    for (int k = 0; k < sw->watched_count; ++k)
        sw->watched[k].hit = 0;
    if (!mark_jumps(run, values)) {
        lag_watch_on(run, run->step.t, y, values, slopes);
        return LAG_RUNNING;
    }
    sw->instant = run->step.t;
    memcpy(sw->before, y, (size_t)lag_size(&run->system) * sizeof(double));
    for (int c = 0; c < sw->conditions; ++c)
        sw->condition[c].off = INFINITY;
    lag_pieces_before(run);
    const int begun = begin_instant(run);
    lag_breaks_start(run);
    if (begun != LAG_RUNNING || lag_all_forces(run, run->step.t, run->step.y))
        return LAG_UNDEFINED;
    begin_count(run);
    if (run->derivatives.n) /* the time of a row is given */
        lag_begin_first_jump(run);
    return note_ends(run);
}

int lag_look_for_instant(lag_run *run)
{
    lag_switching *sw = &run->switching;
    const size_t n = (size_t)lag_size(&run->system);
    if (!sw->located) {
        run->step.searching = 1;
        const int result = lag_find_instant(run);
        run->step.searching = 0;
        if (run->step.dense_inaccurate) {
            run->step.dense_ready = run->step.dense_inaccurate = 0;
            return LAG_INACCURATE;
        }
        if (result == LAG_STRAYING) {
            lag_repeat(run);
            return LAG_RUNNING;
        }
        if (result < 0 || !lag_join_ticks(run, result)) {
            if (result < 0) {
                run->failure.t = run->step.t;
                memcpy(run->failure.y, run->step.y_new, n * sizeof(double));
            }
            return result == LAG_NOT_RESOLVED ? LAG_UNRESOLVED : result < 0 ? LAG_UNDEFINED : LAG_RUNNING;
        }
        sw->located = 1;
    }
    int status = lag_sample_until(run, nextafter(sw->instant - lag_coincidence(sw->instant), -INFINITY));
    if (status != LAG_RUNNING)
        return status;
    lag_dense(run, sw->instant, sw->before);
    if (!lag_is_accurate(run, sw->instant, sw->before) && lag_allow_dense(run, 1)) /* for the step after it, too */
        return LAG_NO_MEMORY;
    for (int c = 0; c < sw->conditions; ++c)
        sw->condition[c].off = lag_condition_value(run, c, sw->instant, sw->before);
    if (lag_projects(run) && (status = lag_return(run, sw->instant, sw->before)) != LAG_RUNNING)
        return status;
    if (begin_instant(run) != LAG_RUNNING)
        return LAG_UNDEFINED;
    begin_count(run);
    if (run->derivatives.n && lag_begin_jump(run))
        return LAG_UNDEFINED;
    if (lag_at_break(run)) {
        lag_breaks_start(run);
        if (lag_watched_values(run, LAG_WATCHED, run->step.t, run->step.y, sw->values))
            return LAG_UNDEFINED;
        mark_jumps(run, sw->values);
    }
    return note_ends(run);
}

int lag_begin_change(lag_run *run)
{
    lag_switching *sw = &run->switching;
    sw->instant = sw->last = run->step.t;
    sw->rounds = sw->impacts = 0;
    memcpy(sw->before, run->step.y, (size_t)lag_size(&run->system) * sizeof(double));
    for (int c = 0; c < sw->conditions; ++c) /* the state is not one of a search for roots */
        sw->condition[c].off = INFINITY;
    return begin_instant(run);
}

/* Whether a contact is beyond its surface. */
static int violated(const lag_run *run)
{
    const lag_switching *sw = &run->switching;
    for (int i = 0; i < sw->rows; ++i)
        if (sw->active[i] && sw->law[i] == LAG_UNILATERAL && sw->phi[i] < -BEYOND * lag_no_gap(run, i))
            return 1;
    return 0;
}

/* Open the contacts that an action has moved away from their surfaces. */
static void leave_surfaces(lag_run *run)
{
    lag_switching *sw = &run->switching;
    for (int i = 0; i < sw->rows; ++i)
        if (sw->law[i] == LAG_UNILATERAL && sw->mode[i] == LAG_HOLDS && sw->phi[i] > BEYOND * lag_no_gap(run, i))
            sw->mode[i] = LAG_OPEN;
}

/* Log the changes of modes since the beginning of the instant, and contacts that came to rest. The first of these has
 * the energy that impacts after this instant would have lost. */
static void log_changes(lag_run *run)
{
    lag_switching *sw = &run->switching;
    const double *v = velocities(run);
    for (int i = 0; i < sw->exported; ++i) {
        const int now = sw->mode[i], old = sw->mode_before[i];
        const int stays = sw->came_to_rest[i] && now == LAG_HOLDS;
        const int rests = stays && sw->rest_time[i] <= run->settings.t_end; /* else the run ends in these impacts */
        int what = -1;
        if (sw->law[i] == LAG_FREE || (now == old && !rests))
            continue;
        if (sw->law[i] == LAG_UNILATERAL)
            what = now == LAG_OPEN ? LAG_OPENS : LAG_CLOSES;
        else if (old != LAG_OPEN && now != LAG_OPEN)
            what = now == LAG_HOLDS ? LAG_STICKS : LAG_SLIPS;
        if (what < 0)
            continue;
        if (now != old)
            sw->report |= sw->reported[5 * i + what];
        const int first = stays && sw->remainder > 0.0;
        lag_log(run, rests ? sw->rest_time[i] : run->step.t, rests ? LAG_REST : what, i,
                first ? sw->struck + run->system.nq : v, v, NULL, first ? sw->remainder : 0.0, 0.0);
        if (first)
            sw->remainder = 0.0;
    }
    sw->remainder = 0.0;
    memset(sw->came_to_rest, 0, (size_t)sw->rows * sizeof(int));
    memcpy(sw->mode_before, sw->mode, (size_t)sw->rows * sizeof(int));
}

/* The sides of conditions at the instant. The search has determined them; where an action or an impact has changed a
 * condition's function, its value does, unless that is a rounding error. A change of side by a jump counts as one by
 * the motion; one that happens either way does so once at an instant. */
static int update_conditions(lag_run *run)
{
    lag_switching *sw = &run->switching;
    if (lag_enclosure_touch(run, run->step.t, run->step.y))
        return LAG_UNDEFINED;
    for (int c = 0; c < sw->conditions + sw->force_conditions; ++c) {
        lag_condition *condition = sw->condition + c;
        const double value = lag_condition_value(run, c, run->step.t, run->step.y);
        if (isnan(value))
            return LAG_UNDEFINED;
        const double noise = lag_condition_noise(condition), before = condition->value;
        /* an action may move the state by the drift of the constraints */
        const double error = lag_held_error(run, c, run->step.t, run->step.y);
        const double zero = fmax(condition->happened ? fmax(WRONG * noise, condition->off) : noise, error);
        condition->largest = fmax(condition->largest, fabs(value));
        condition->value = value;
        const int reached = c >= sw->conditions && before < -zero && fabs(value) <= zero; /* by a jump of forces */
        if (sw->begun && (!(fabs(value - before) > noise) || (fabs(value) <= zero && !reached))) {
            if (condition->happened && fabs(value) <= zero)
                condition->off = fmax(condition->off, fabs(value));
            continue;
        }
        const int holds = value >= 0.0 || reached, changes = holds != condition->holds;
        condition->holds = holds;
        if (condition->rests) { /* it leaves zero */
            condition->rests = LAG_OFF_ZERO;
            continue;
        }
        if (sw->begun && changes && (condition->either ? !condition->happened : holds)) {
            condition->happened = 1;
            sw->report = 1;
        }
    }
    sw->moved = 0;
    return LAG_RUNNING;
}

/* Whether nothing has moved so far: tolerances follow the accelerations to come, which the modes have changed. */
static int at_rest(const lag_run *run)
{
    for (int i = run->system.nq; i < 2 * run->system.nq; ++i)
        if (run->step.y[i] != 0.0 || run->tolerances.size[i] > 0.0)
            return 0;
    return 1;
}

/* Restart in the new modes. The step keeps its size unless the accelerations jump. */
static int restart(lag_run *run)
{
    lag_switching *sw = &run->switching;
    const int nq = run->system.nq, n = lag_size(&run->system);
    double *change = run->step.trial;
    run->method = run->stepped = sw->acting ? &lag_dop853 : sw->chosen;
    run->step.error_old = LEAST_ERROR;
    run->stiffness.stiff = run->stiffness.not_stiff = 0;
    run->watch.determinant.begin = NAN;
    lag_restart(run);
    if (sw->interval > 0.0)
        run->step.h = fmin(run->step.h, BETWEEN * sw->interval);
    memset(change, 0, (size_t)n * sizeof(double));
    for (int i = 0; i < nq; ++i)
        change[nq + i] = -run->step.f[nq + i];
    if (lag_derivative(run, run->step.t, run->step.y, run->step.f))
        return LAG_UNDEFINED;
    lag_watch_restart(run);
    lag_sizes_update(run);
    for (int i = 0; i < nq; ++i)
        change[nq + i] = run->step.h * (change[nq + i] + run->step.f[nq + i]);
    int begins = lag_scaled_norm(run, change, run->step.y, run->step.y) > 1.0;
    if (sw->kinks.count && at_rest(run)) {
        lag_sizes_start(run);
        begins = 1;
    }
    if (begins && run->step.t < run->settings.t_end)
        lag_first_step(run, run->method->order);
    const int status = lag_watch_modes(run, run->step.t, run->step.y, run->step.f);
    if (status == LAG_RUNNING)
        lag_log_redundant(run);
    return status;
}

/* Whether the projection at a kink has changed the velocities: a constraint has a corner there. */
static int turns(lag_run *run)
{
    const int nq = run->system.nq;
    double *change = run->step.trial;
    memset(change, 0, (size_t)lag_size(&run->system) * sizeof(double));
    for (int i = nq; i < 2 * nq; ++i)
        change[i] = run->step.y[i] - run->switching.start[i];
    const double moved = lag_scaled_norm(run, change, run->step.y, run->step.y);
    return moved > TURNS && moved * run->settings.rtol > TURNS_PART;
}

int lag_do_instant(lag_run *run)
{
    lag_switching *sw = &run->switching;
    const double t = run->step.t;
    double *y = run->step.y;
    int status = LAG_RUNNING;
    if (sw->report) { /* actions of the user are performed first */
        sw->report = 0;
        sw->stage = BEGIN_REPORTED;
        return LAG_HAPPENED;
    }
    while (!sw->settled || sw->moved) { /* actions without effect need no new modes */
        sw->settled = sw->holds_sides = 0;
        if (!lag_log_has_room(run))
            return LAG_BLOCK_FULL;
        if (lag_find_rows(run, t, y))
            return LAG_UNDEFINED;
        lag_measure_rows(run, t, y);
        if (sw->moved && violated(run))
            return LAG_VIOLATED;
        if (sw->moved)
            leave_surfaces(run);
        if (lag_collides(run)) {
            status = lag_do_collision(run);
            if (status != LAG_RUNNING)
                return status;
            continue;
        }
        if (++sw->rounds > ROUNDS)
            return LAG_ENDLESS;
        status = lag_choose_branches(run);
        if (status == LAG_RUNNING)
            status = lag_choose_modes(run);
        if (status == LAG_RUNNING && sw->kinks.undecided && sw->rows) { /* the forces may have changed */
            status = lag_choose_branches(run);
            if (status == LAG_RUNNING)
                status = lag_choose_modes(run);
        }
        memcpy(sw->start, y, (size_t)lag_size(&run->system) * sizeof(double));
        if (status == LAG_RUNNING && lag_projects(run))
            status = sw->kinks.undecided ? lag_return(run, t, y) : lag_project(run, t, y);
        if (status == LAG_RUNNING && sw->kinks.undecided && turns(run))
            status = LAG_CORNER;
        if (status == LAG_RUNNING)
            status = lag_choose_sides(run);
        if (status != LAG_RUNNING)
            return status;
        if (!sw->begun) /* the first modes are no changes */
            memcpy(sw->mode_before, sw->mode, (size_t)sw->rows * sizeof(int));
        log_changes(run);
        if ((status = update_conditions(run)) != LAG_RUNNING)
            return status;
        lag_log_modes(run);
        sw->settled = 1;
        if (!sw->report)
            break;
        sw->report = 0;
        sw->stage = BEGIN_REPORTED;
        return LAG_HAPPENED;
    }
    sw->due = 0;
    if (run->derivatives.n && sw->stage != END_REPORTED && lag_end_jump(run, sw->begun))
        return LAG_UNDEFINED;
    if (!sw->begun) {
        sw->begun = 1;
        sw->stage = NOTHING_REPORTED;
        memcpy(sw->first_mode, sw->mode, (size_t)sw->rows * sizeof(int));
        return LAG_RUNNING; /* lag_start does the rest */
    }
    if (sw->stage != END_REPORTED && (status = restart(run)) != LAG_RUNNING)
        return status;
    if (sw->stage == BEGIN_REPORTED) {
        sw->stage = END_REPORTED;
        sw->due = 1;
        return LAG_RESOLVED;
    }
    return lag_sample_until(run, t);
}

int lag_begin_modes(lag_run *run)
{
    lag_switching *sw = &run->switching;
    if (!sw->begun && !sw->due) {
        sw->due = 1;
        sw->stage = NOTHING_REPORTED;
        sw->rounds = sw->impacts = 0;
        sw->last = run->step.t;
        memcpy(sw->before, run->step.y, (size_t)lag_size(&run->system) * sizeof(double));
        if (run->derivatives.n)
            lag_begin_first_jump(run);
    }
    return sw->due ? lag_do_instant(run) : LAG_RUNNING;
}

int lag_begin_ticks(lag_run *run)
{
    lag_switching *sw = &run->switching;
    const double t = run->step.t;
    if (!lag_ticks_at(run, t))
        return LAG_RUNNING;
    memcpy(sw->before, run->step.y, (size_t)lag_size(&run->system) * sizeof(double));
    if (run->derivatives.n)
        lag_begin_first_jump(run);
    if (lag_all_forces(run, t, sw->before))
        return LAG_UNDEFINED;
    memcpy(sw->begin, run->solver.a, (size_t)run->system.nq * sizeof(double));
    memcpy(sw->begin + run->system.nq, sw->multipliers, (size_t)sw->nc * sizeof(double));
    sw->instant = sw->last = t;
    sw->rounds = 0;
    sw->due = sw->settled = 1;
    sw->stage = NOTHING_REPORTED;
    lag_note_ticks(run);
    return LAG_RUNNING;
}
