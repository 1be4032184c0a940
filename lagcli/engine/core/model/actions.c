/* Events of a model as data, and their actions: those of engine/integrate/switching_run.py. */
#include <string.h>

#include "bind.h"
#include "breaks.h"
#include "contact/contact.h"
#include "lagstart.h"
#include "model/simulation.h"
#include "motion.h"
#include "switching/rows.h"

#define HEAD 6 /* numbers of an entry before the modes: time, occurrence, what, loss, supplied, work */
enum { TIME, OCCURRENCE, WHAT, LOSS, SUPPLIED, WORK };
enum { OF_POSITION, OF_VELOCITY, OF_PARAMETER };

/* The changes of rows that trigger events, by occurrence; -1. */
static const int change_of[] = {[LAG_CLOSES] = 0, [LAG_OPENS] = 1,  [LAG_SLIPS] = 2,       [LAG_STICKS] = 3,
                                [LAG_IMPACT] = 4, [LAG_REST] = 0,   [LAG_NOT_UNIQUE] = -1, [LAG_REDUNDANT] = -1,
                                [LAG_EVENT] = -1, [LAG_RELEASES] = -1, [LAG_ENGAGES] = -1};

static double *entry_at(const lag_simulation *s, int64_t i)
{
    return s->log->rows + i * s->width;
}

static void destroy_adjustment(void *owned)
{
    lag_adjustment **adjustment = owned;
    if (*adjustment)
        lag_destroy_adjustment(*adjustment);
}

/* Allocate what values that events set need. Returns 0, or 1 where there is no memory. */
static int bind_displacement(lag_simulation *s)
{
    const lag_model *m = &s->model;
    lag_displacement *d = &s->displacement;
    const size_t nq = (size_t)m->equations.nq, nc = (size_t)m->rules.nc;
    d->fixed = lag_get(&s->pool, 2 * nq, sizeof *d->fixed);
    d->impulse = lag_doubles(&s->pool, m->rules.nc);
    d->reaction = lag_doubles(&s->pool, m->equations.nc);
    if (!(m->contents & LAG_MODEL_ADJUSTS))
        return s->pool.failed;
    d->positions = lag_get(&s->pool, nc, sizeof *d->positions);
    d->velocities = lag_get(&s->pool, nc, sizeof *d->velocities);
    d->sign = lag_get(&s->pool, nc, sizeof *d->sign);
    d->no_gap = lag_doubles(&s->pool, m->rules.nc);
    d->p = lag_doubles(&s->pool, m->whole.np);
    /* its scratch is not part of the state */
    lag_adjustment **adjustment = lag_own(&s->pool, sizeof *adjustment, destroy_adjustment);
    if (s->pool.failed)
        return 1;
    d->adjustment = *adjustment = lag_make_adjustment(&s->pool.from, &m->whole, &m->mass);
    return !d->adjustment;
}

int lag_events_bind(lag_simulation *s)
{
    const lag_model *m = &s->model;
    const int nq = m->equations.nq;
    s->stopped = -1;
    s->engaging = -1;
    if (!(m->contents & LAG_MODEL_SWITCHING))
        return 0;
    s->width = HEAD + m->rules.exported + 3 * nq + m->rules.nc;
    s->happened = lag_get(&s->pool, (size_t)m->event_count, sizeof *s->happened);
    s->p = lag_copy_doubles(&s->pool, m->problem.parameters, m->rules.first_branch);
    s->held = lag_doubles(&s->pool, m->equations.np);
    s->none = lag_doubles(&s->pool, nq + m->rules.nc);
    s->before = lag_doubles(&s->pool, 2 * nq + 1);
    s->after = lag_doubles(&s->pool, 2 * nq + 1);
    if (s->pool.failed || !m->energy.output_count) /* the caller answers LAG_HAPPENED */
        return s->pool.failed;
    if (bind_displacement(s))
        return 1;
    return lag_bind(s->run, &s->pool, &s->actions, &m->actions)
           || lag_bind(s->run, &s->pool, &s->energy, &m->energy);
}

/* Space for more entries at the end of the log. Returns 0, or 1 where there is no memory. */
static int reserve(lag_simulation *s, int64_t count)
{
    lag_event_log *log = s->log;
    if (s->used + count <= log->capacity)
        return 0;
    const int64_t capacity = 2 * (s->used + count);
    double *rows = lag_get(&log->pool, (size_t)capacity, (size_t)s->width * sizeof *rows);
    if (!rows)
        return 1;
    if (log->rows)
        memcpy(rows, log->rows, (size_t)(s->used * s->width) * sizeof *rows);
    log->rows = rows;
    log->capacity = capacity;
    return 0;
}

int lag_events_collect(lag_simulation *s)
{
    if (!s->width)
        return 0;
    const int64_t count = lag_take_log(s->run);
    if (!count)
        return 0;
    if (reserve(s, count))
        return 1;
    memcpy(entry_at(s, s->used), s->run->switching.log, (size_t)(count * s->width) * sizeof(double));
    s->used += count;
    return 0;
}

/* The present modes, to an entry. */
static void write_modes(const lag_simulation *s, double *entry)
{
    for (int i = 0; i < s->model.rules.exported; ++i)
        entry[HEAD + i] = s->run->switching.mode[i];
}

/* An entry of an event; velocities before and after. */
static double *append(lag_simulation *s, enum lag_occurrence occurrence, int what, const double *before,
                      const double *after)
{
    const size_t nq = (size_t)s->model.equations.nq;
    double *entry = entry_at(s, s->used++), *rest = entry + HEAD + s->model.rules.exported;
    memset(entry, 0, (size_t)s->width * sizeof *entry);
    entry[TIME] = s->run->step.t;
    entry[OCCURRENCE] = occurrence;
    entry[WHAT] = what;
    write_modes(s, entry);
    memcpy(rest, after, nq * sizeof *rest);
    memcpy(rest + nq, before + nq, nq * sizeof *rest);
    memcpy(rest + 2 * nq, after + nq, nq * sizeof *rest);
    return entry;
}

const double *lag_held_parameters(lag_simulation *s)
{
    const lag_switching *sw = &s->run->switching;
    const int first = sw->kinks.first;
    memcpy(s->held, s->run->parameters, (size_t)s->run->np * sizeof(double));
    memcpy(s->held, s->p, (size_t)first * sizeof(double));
    memcpy(s->held + first, sw->kinks.branch, (size_t)sw->kinks.count * sizeof(double));
    lag_pieces_at(s->run, s->run->step.t, s->held);
    return s->held;
}

/* The energy, v.p - L, at a state. */
static double energy(lag_simulation *s, const double *y)
{
    lag_held_parameters(s);
    lag_tape_set(&s->energy, s->run->np, s->held);
    lag_evaluate_forces(s->run, &s->energy, s->run->step.t, y, s->none, s->none + s->model.equations.nq);
    return OUT(&s->energy, 0);
}

/* Whether a row is in a list. */
static int is_in(const int32_t *list, int count, int row)
{
    for (int i = 0; i < count; ++i)
        if (list[i] == row)
            return 1;
    return 0;
}

/* What holds while an event sets values: constraints that it engages only where it sets velocities. */
static void find_held(lag_simulation *s, const lag_event *e)
{
    const lag_switching *sw = &s->run->switching;
    lag_displacement *d = &s->displacement;
    const size_t count = (size_t)sw->nc;
    int sets_velocities = 0;
    memset(d->positions, 0, count * sizeof *d->positions);
    memset(d->velocities, 0, count * sizeof *d->velocities);
    memset(d->sign, 0, count * sizeof *d->sign);
    for (int i = 0; i < e->target_count; ++i)
        sets_velocities |= e->kind[i] == OF_VELOCITY;
    for (int i = 0; i < s->run->system.nc; ++i)
        d->positions[sw->base[i]] = d->velocities[sw->base[i]] = 1;
    for (int i = 0; i < sw->rows; ++i) {
        const int constraint = sw->constraint[i], free = sw->law[i] == LAG_FREE;
        const int engaged = is_in(e->engage, e->engage_count, i), released = is_in(e->release, e->release_count, i);
        const int holds = i >= sw->exported || (free && sw->active[i] && !released);
        d->positions[constraint] = holds;
        d->velocities[constraint] = holds || (free && engaged && sets_velocities);
        if (sw->law[i] == LAG_UNILATERAL && sw->active[i] && !released && sw->mode[i] == LAG_HOLDS) {
            d->sign[constraint] = sw->sign[i] < 0.0 ? -1 : 1;
            d->no_gap[constraint] = lag_gap_of_none(s->run, i);
        }
    }
}

/* Let the values that events do not set follow onto the constraints; the impulse of that goes to `impulse`. Returns LAG_RUNNING, or
 * why the motion ends. */
static int follow(lag_simulation *s, const lag_event *e, double *y, double *impulse)
{
    lag_run *run = s->run;
    lag_displacement *d = &s->displacement;
    lag_report report;
    find_held(s, e);
    lag_report_of(run, &report);
    const lag_held_rows held = {d->positions, d->velocities, d->sign, d->no_gap, report.atol + run->system.nq};
    const int found = lag_adjust(d->adjustment, run->step.t, d->p, &held, d->fixed, y, impulse);
    return found == LAG_START_FOUND       ? LAG_RUNNING
           : found == LAG_START_UNDEFINED ? LAG_UNDEFINED
           : found == LAG_START_NO_MEMORY ? LAG_NO_MEMORY
                                          : LAG_CONFLICT;
}

/* The parameters of adjustments: without the branches. */
static void set_parameters_of_adjustment(lag_simulation *s)
{
    const int first = s->model.rules.first_branch, kinks = s->model.rules.kinks;
    memcpy(s->displacement.p, s->held, (size_t)first * sizeof(double));
    memcpy(s->displacement.p + first, s->held + first + kinks, (size_t)(s->run->np - first - kinks) * sizeof(double));
}

/* Set values and apply impulses, with the work of that, the energy that moving constraints supply, and the impulse of all
 * constraints. Returns LAG_RUNNING, or why the motion ends. */
static int change(lag_simulation *s, const lag_event *e, double *work, double *supplied, double *impulse)
{
    lag_run *run = s->run;
    const lag_switching *sw = &run->switching;
    const int nq = run->system.nq;
    double *y = s->before, *after = s->after;
    const double start = energy(s, y);
    int sets_parameters = 0, status = LAG_RUNNING;
    lag_tape_set(&s->actions, run->np, s->held);
    lag_evaluate_forces(run, &s->actions, run->step.t, y, sw->begin, sw->begin + nq);
    for (int i = 0; i < e->target_count; ++i) {
        const double value = OUT(&s->actions, e->first + i);
        const int place = (e->kind[i] == OF_VELOCITY ? nq : 0) + e->target[i];
        if (e->kind[i] == OF_PARAMETER) {
            s->p[e->target[i]] = value;
            sets_parameters = 1;
        } else {
            after[place] = value;
            s->displacement.fixed[place] = 1;
        }
    }
    lag_held_parameters(s);
    if (s->displacement.adjustment)
        set_parameters_of_adjustment(s);
    if (s->displacement.adjustment && e->displaces && e->target_count)
        status = follow(s, e, after, impulse);
    if (status != LAG_RUNNING)
        return status;
    if (sets_parameters)
        lag_set_parameters(run, s->held);
    lag_place(run, after);
    if (e->impulse_count) {
        double *push = s->none, *reaction = s->displacement.reaction; /* nothing else uses the first one meanwhile */
        for (int i = 0; i < e->impulse_count; ++i)
            push[e->impulse[i]] = OUT(&s->actions, e->first + e->target_count + i);
        status = lag_push(run, push, NULL, reaction);
        memset(push, 0, (size_t)nq * sizeof *push);
        if (status != LAG_RUNNING)
            return status;
        memcpy(after, run->step.y, (2 * (size_t)nq + 1) * sizeof *after);
        for (int i = 0; i < run->system.nc; ++i)
            impulse[sw->base[i]] += reaction[i];
        memset(s->displacement.fixed + nq, 0, (size_t)nq * sizeof *s->displacement.fixed);
    }
    const double gained = energy(s, after) - start;
    if (s->displacement.adjustment)
        *supplied = lag_supplied(s->displacement.adjustment, run->step.t, s->displacement.p, after, impulse);
    *work = gained - *supplied;
    after[2 * nq] = y[2 * nq] + gained;
    lag_place(run, after);
    return LAG_RUNNING;
}

/* Whether a contact can be engaged at a state: none can that is beyond its surface, nor a constraint off it. */
static int can_engage(const lag_simulation *s, int row, const double *y)
{
    const lag_switching *sw = &s->run->switching;
    const lag_tape *gaps = &sw->enclosure.gaps;
    if (sw->place[row] < 0)
        return 1;
    lag_evaluate(gaps, &s->run->system, s->run->step.t, y, LAG_ALL);
    const double gap = OUT(gaps, sw->place[row]);
    return (sw->law[row] == LAG_UNILATERAL ? -sw->sign[row] * gap : gap < 0.0 ? -gap : gap) <= lag_gap_of_none(s->run, row);
}

int lag_is_violated(const lag_simulation *s, const double *y)
{
    const lag_switching *sw = &s->run->switching;
    for (int i = 0; i < sw->exported; ++i)
        if (sw->law[i] == LAG_UNILATERAL && sw->active[i] && !can_engage(s, i, y))
            return 1;
    return 0;
}

/* Perform the actions of one event. */
static int act(lag_simulation *s, int number)
{
    const lag_event *e = s->model.events + number;
    lag_run *run = s->run;
    const size_t bytes = (2 * (size_t)run->system.nq + 1) * sizeof(double);
    double work = 0.0, supplied = 0.0, *impulse = s->displacement.impulse;
    memset(impulse, 0, (size_t)s->model.rules.nc * sizeof *impulse);
    memcpy(s->before, run->step.y, bytes);
    memcpy(s->after, run->step.y, bytes);
    if (reserve(s, INT64_C(1) + e->release_count + e->engage_count))
        return LAG_NO_MEMORY;
    if (e->target_count || e->impulse_count) {
        const int status = change(s, e, &work, &supplied, impulse);
        if (status != LAG_RUNNING)
            return status;
    }
    double *entry = append(s, LAG_EVENT, number, s->before, s->after);
    entry[SUPPLIED] = supplied;
    entry[WORK] = work;
    memcpy(entry + s->width - s->model.rules.nc, impulse, (size_t)s->model.rules.nc * sizeof *entry);
    for (int i = 0; i < e->release_count; ++i) {
        lag_activate(run, e->release[i], 0);
        append(s, LAG_RELEASES, s->model.rules.constraint[e->release[i]], s->after, s->after);
    }
    for (int i = 0; i < e->engage_count; ++i) {
        if (!can_engage(s, e->engage[i], s->after))
            return LAG_VIOLATED;
        lag_activate(run, e->engage[i], 1);
        append(s, LAG_ENGAGES, s->model.rules.constraint[e->engage[i]], s->after, s->after);
    }
    if (e->engage_count && s->engaging < 0) {
        s->engaging = s->used - 1 - e->release_count - e->engage_count;
        s->engaged_work = work;
    }
    return LAG_RUNNING;
}

/* Whether a change of a row since the last reaction triggers an event. */
static int is_triggered(const lag_simulation *s, const lag_event *e, int64_t until)
{
    for (int64_t i = s->seen; e->constraint >= 0 && i < until; ++i) {
        const double *entry = entry_at(s, i);
        if ((int)entry[WHAT] == e->constraint && change_of[(int)entry[OCCURRENCE]] == e->change)
            return 1;
    }
    return 0;
}

int lag_events_happen(lag_simulation *s)
{
    lag_run *run = s->run;
    const lag_switching *sw = &run->switching;
    const int conditions = sw->conditions + sw->force_conditions;
    const int64_t until = s->used;
    const int engaged = s->engaging >= 0;
    if (!s->open) {
        s->open = 1;
        s->first = s->used;
    }
    memset(s->displacement.fixed, 0, 2 * (size_t)run->system.nq * sizeof *s->displacement.fixed);
    for (int k = 0; k < s->model.event_count; ++k) {
        const lag_event *e = s->model.events + k;
        const int happens = is_triggered(s, e, until)
                            || (e->condition >= 0 && sw->condition[e->condition].happened == 1)
                            || (e->clock >= 0 && sw->clock[e->clock].ticks == 1);
        if (!happens || (e->times && s->happened[k] >= e->times))
            continue;
        ++s->happened[k];
        const int status = act(s, k);
        if (status != LAG_RUNNING)
            return status;
        if (e->stops)
            s->stopped = k;
    }
    if (!engaged && s->engaging >= 0)
        s->work_before = run->step.y[2 * run->system.nq];
    for (int i = 0; i < conditions; ++i)
        lag_condition_happened(run, i);
    for (int i = 0; i < sw->clocks; ++i)
        lag_clock_ticks(run, i);
    s->seen = s->used;
    return LAG_RUNNING;
}

void lag_archive_events(lag_archive *a, lag_simulation *s)
{
    int64_t count = 0;
    int reacts = 0;
    for (int k = 0; k < s->model.event_count; ++k)
        reacts |= s->model.events[k].constraint >= 0;
    if (reacts)
        count = s->used - s->seen;
    lag_archive_reals(a, s->p, s->model.rules.first_branch);
    for (int k = 0; k < s->model.event_count; ++k)
        lag_archive_count(a, s->happened + k, 0, INT64_MAX);
    lag_archive_int(a, &s->stopped, -1, s->model.event_count - 1);
    lag_archive_count(a, &count, 0, a->use == LAG_READS ? (int64_t)a->bytes / 16 : INT64_MAX);
    if (a->use == LAG_READS) {
        s->used = s->seen = s->first = 0;
        s->open = 0;
        s->engaging = -1;
        if (a->damaged || reserve(s, count)) {
            a->damaged = 1;
            return;
        }
        s->used = count;
    }
    for (int64_t i = 0; i < count; ++i) {
        double *entry = entry_at(s, s->seen + i);
        int64_t occurrence = (int64_t)entry[OCCURRENCE], what = (int64_t)entry[WHAT];
        lag_archive_count(a, &occurrence, 0, LAG_ENGAGES);
        lag_archive_count(a, &what, 0, INT32_MAX);
        if (a->use != LAG_READS)
            continue;
        memset(entry, 0, (size_t)s->width * sizeof *entry);
        entry[OCCURRENCE] = (double)occurrence;
        entry[WHAT] = (double)what;
    }
}

/* Add to the work of an event that engages a row the energy that the velocities have lost since. */
static void complete_engagement(lag_simulation *s)
{
    const int nq = s->model.equations.nq;
    const double *y = s->run->step.y;
    double *entry = entry_at(s, s->engaging), others = 0.0;
    for (int64_t i = s->engaging + 1; i < s->used; ++i)
        others += entry_at(s, i)[SUPPLIED] - entry_at(s, i)[LOSS] + entry_at(s, i)[WORK];
    entry[WORK] = s->engaged_work + y[2 * nq] - s->work_before - others;
    memcpy(entry + HEAD + s->model.rules.exported + 2 * nq, y + nq, (size_t)nq * sizeof *entry);
    s->engaging = -1;
}

void lag_events_resolve(lag_simulation *s)
{
    for (int64_t i = s->first; i < s->used; ++i)
        if (entry_at(s, i)[OCCURRENCE] >= LAG_EVENT)
            write_modes(s, entry_at(s, i));
    if (s->engaging >= 0)
        complete_engagement(s);
    s->open = 0;
}
