/* What the state of a run contains: archive.h. */
#include "archive.h"

#include <string.h>

#include "evaluate.h"
#include "methods/method.h"
#include "methods/implicit_data.h"
#include "switching/kinks.h"
#include "switching/watched.h"

static void pass(lag_archive *a, void *x)
{
    if (a->use == LAG_COUNTS) {
        a->bytes += 8;
    } else if (a->use == LAG_WRITES) {
        memcpy(a->at, x, 8);
        a->at += 8;
        a->bytes += 8;
    } else if (a->damaged || a->bytes < 8) {
        a->damaged = 1;
    } else {
        memcpy(x, a->at, 8);
        a->at += 8;
        a->bytes -= 8;
    }
}

void lag_archive_reals(lag_archive *a, double *x, int64_t count)
{
    for (int64_t i = 0; i < count; ++i)
        pass(a, x + i);
}

void lag_archive_count(lag_archive *a, int64_t *x, int64_t low, int64_t high)
{
    int64_t value = *x;
    pass(a, &value);
    if (value < low || value > high)
        a->damaged = 1;
    else
        *x = value;
}

void lag_archive_int(lag_archive *a, int *x, int low, int high)
{
    int64_t value = *x;
    lag_archive_count(a, &value, low, high);
    *x = (int)value;
}

void lag_archive_integers(lag_archive *a, int *x, int count, int low, int high)
{
    for (int i = 0; i < count; ++i)
        lag_archive_int(a, x + i, low, high);
}

static void real(lag_archive *a, double *x)
{
    lag_archive_reals(a, x, 1);
}

static void flag(lag_archive *a, int *x)
{
    lag_archive_int(a, x, 0, 1);
}

#define LENGTH(list) (sizeof(list) / sizeof *(list))

/* So many arrays of n entries. */
static void reals(lag_archive *a, double *const *arrays, size_t count, int64_t n)
{
    for (size_t i = 0; i < count; ++i)
        lag_archive_reals(a, arrays[i], n);
}

static void flags(lag_archive *a, int *const *arrays, size_t count, int n)
{
    for (size_t i = 0; i < count; ++i)
        lag_archive_integers(a, arrays[i], n, 0, 1);
}

static void number(lag_archive *a, int64_t *x)
{
    lag_archive_count(a, x, 0, INT64_MAX / 4);
}

/* The method of the simulation, or DOP853, which takes the steps while rows act. */
static void method(lag_archive *a, const lag_method **x, const lag_method *chosen)
{
    int is_chosen = *x == chosen;
    flag(a, &is_chosen);
    *x = is_chosen ? chosen : &lag_dop853;
}

static void step(lag_archive *a, lag_run *run)
{
    lag_step *s = &run->step;
    const int n = lag_size(&run->system);
    double *several[] = {s->y, s->f, s->y_old, s->y_new, s->f_new};
    double *one[] = {&s->t_start, &s->t, &s->t_stop, &s->h, &s->error_old, &s->t_old, &s->h_old};
    int *marks[] = {&s->searching, &s->dense_inaccurate, &s->strays};
    reals(a, several, LENGTH(several), n);
    reals(a, one, LENGTH(one), 1);
    flags(a, marks, LENGTH(marks), 1);
    lag_archive_int(a, &s->dense_ready, 0, 2);
    lag_archive_reals(a, s->dense, INT64_C(7) * n); /* from which Radau's method extrapolates */
    number(a, &s->steps);
    number(a, &s->rejected);
    number(a, &s->evaluations);
    real(a, &run->settings.t_end);
}

static void tolerances(lag_archive *a, lag_run *run)
{
    lag_tolerances *t = &run->tolerances;
    const int nq = run->system.nq, n = lag_size(&run->system);
    lag_archive_reals(a, t->atol, n);
    lag_archive_reals(a, t->rounding, n);
    lag_archive_reals(a, t->size, n);
    lag_archive_reals(a, t->acceleration_terms, nq + 1);
    lag_archive_reals(a, t->future_acceleration, nq);
    lag_archive_reals(a, t->emerging, nq);
    lag_archive_reals(a, t->rest, n);
    lag_archive_reals(a, t->largest, INT64_C(2) * t->kinds);
    lag_archive_reals(a, t->noise, n);
    number(a, &t->noise_until);
    lag_archive_int(a, &t->limiting, -1, n - 1);
    number(a, &t->since);
    number(a, &t->again);
    lag_archive_int(a, &run->stiffness.stiff, 0, INT32_MAX / 2);
    lag_archive_int(a, &run->stiffness.not_stiff, 0, INT32_MAX / 2);
    real(a, &run->baumgarte.alpha);
    real(a, &run->baumgarte.beta);
    lag_archive_reals(a, run->projection.scale_position, run->system.nh);
    lag_archive_reals(a, run->projection.scale_velocity, run->system.nc);
}

static void solver(lag_archive *a, lag_run *run)
{
    lag_solver *s = &run->solver;
    lag_rows *rows = &run->rows;
    const int nq = run->system.nq, nc = run->system.nc;
    int64_t dense_steps = s->dense_steps;
    lag_archive_count(a, &dense_steps, 0, INT64_MAX / 4);
    if (a->use == LAG_READS && dense_steps && lag_allow_dense(run, 0)) /* large models allocate it only then */
        a->damaged = 1;
    else
        s->dense_steps = dense_steps;
    flag(a, &s->refining);
    lag_archive_int(a, &s->accurate_steps, 0, INT32_MAX / 2);
    real(a, &s->inaccuracy);
    number(a, &s->rejected);
    lag_archive_reals(a, s->a, nq + nc);
    lag_archive_reals(a, rows->lengths, nc);
    lag_archive_reals(a, rows->plain_lengths, nc);
    real(a, &rows->margin);
    lag_archive_int(a, &rows->poor, 0, INT32_MAX / 2);
    flag(a, &rows->contradicted);
}

static void watch(lag_archive *a, lag_run *run)
{
    lag_watch *w = &run->watch;
    lag_path *path = &w->path;
    lag_determinant *d = &w->determinant;
    const int nb = run->system.nb;
    double *one[] = {&w->pivot, &w->largest_pivot, &w->pivot_at_end, w->suspect, w->suspect + 1, &w->largest_step,
                     &path->t, &path->length, &path->speed, &path->margin, &path->margin_at_end, &d->begin};
    int last = path->entries == path->last, by = (int)d->by;
    reals(a, one, LENGTH(one), 1);
    number(a, &w->examined);
    lag_archive_int(a, &w->mode, LAG_IGNORE, LAG_STOP);
    flag(a, &w->approaching);
    lag_approach *p = &w->approach;
    double *of_approach[] = {&p->value, &p->largest, &p->largest_pivot, &p->examined, &p->changed,
                             &run->step.h_max};
    reals(a, of_approach, LENGTH(of_approach), 1);
    number(a, &p->changed_at);
    lag_archive_int(a, &p->states, 0, LAG_APPROACH_STATES);
    lag_archive_reals(a, p->t, LAG_APPROACH_STATES);
    lag_archive_reals(a, p->values, LAG_APPROACH_STATES);
    lag_archive_reals(a, p->y, (int64_t)LAG_APPROACH_STATES * lag_size(&run->system));
    flag(a, &path->exceeded);
    flag(a, &d->kept);
    lag_archive_reals(a, w->combination, run->system.nc);
    lag_archive_reals(a, path->begin, nb);
    lag_archive_reals(a, path->last, nb);
    flag(a, &last);
    path->entries = last ? path->last : path->begin;
    lag_archive_int(a, &d->count, 0, LAG_DETERMINANTS);
    lag_archive_int(a, &by, LAG_BY_LU, LAG_BY_LDL);
    d->by = (enum lag_solution)by;
    lag_archive_reals(a, d->t, LAG_DETERMINANTS);
    lag_archive_reals(a, d->value, LAG_DETERMINANTS);
}

/* The linearization that the next step may keep; its factors are computed again. */
static void implicit(lag_archive *a, lag_run *run)
{
    lag_implicit *m = run->implicit;
    const int nq = run->system.nq, nc = run->system.nc;
    lag_archive_reals(a, m->mass, run->system.nm);
    lag_archive_reals(a, m->jacobian, run->system.nb);
    lag_archive_reals(a, m->border, (int64_t)(nc - run->rows.rank) * nc);
    lag_archive_reals(a, m->derivatives, m->variation.output_count);
    lag_archive_reals(a, m->velocity, nq);
    real(a, &m->h_accepted);
    real(a, &m->theta);
    real(a, &m->contraction);
    real(a, &m->h_converging);
    lag_archive_count(a, &m->ordered, -1, INT64_MAX / 4);
    lag_archive_int(a, &m->orders, 0, INT32_MAX / 2);
    if (a->use == LAG_READS)
        m->shift = m->shift_re = m->shift_im = 0.0;
}

static void kinks(lag_archive *a, lag_kinks *k)
{
    double *several[] = {k->branch, k->bound, k->size,     k->growth,  k->rounding,
                         k->held,   k->drift, k->vanished, k->recurred};
    reals(a, several, LENGTH(several), k->count);
    lag_archive_integers(a, k->state, k->count, LAG_OFF_SURFACE, LAG_SIDE_KNOWN);
    lag_archive_int(a, &k->slides, -1, k->count - 1);
    real(a, &k->weight);
    real(a, &k->rates);
    lag_archive_int(a, &k->undecided, 0, k->count);
    number(a, &k->crossed);
    number(a, &k->slid);
}

/* What conditions and watched functions were. */
static void watched(lag_archive *a, lag_switching *sw)
{
    for (int c = 0; c < sw->conditions + sw->force_conditions; ++c) {
        lag_condition *x = sw->condition + c;
        flag(a, &x->holds);
        lag_archive_int(a, &x->happened, 0, 2);
        lag_archive_int(a, &x->rests, LAG_OFF_ZERO, LAG_LEAVES_ZERO);
        real(a, &x->largest);
        real(a, &x->value);
        real(a, &x->off);
    }
    for (int k = 0; k < sw->watched_count; ++k) {
        lag_watched_function *w = sw->watched + k;
        double *one[] = {&w->sign, &w->shift, &w->noise, &w->stray, &w->value, &w->rate, &w->resolved, &w->ended};
        reals(a, one, LENGTH(one), 1);
        flag(a, &w->clear);
        flag(a, &w->hit);
    }
}

static void switching(lag_archive *a, lag_run *run, const lag_method *chosen)
{
    lag_switching *sw = &run->switching;
    const int rows = sw->rows, all = rows + sw->nf, nq = run->system.nq, n = lag_size(&run->system);
    int *modes[] = {sw->mode, sw->mode_before, sw->first_mode};
    int *marks[] = {sw->active, sw->takes_part, sw->came_to_rest, sw->tight, sw->shares};
    double *by_row[] = {sw->phi, sw->psi, sw->drift, sw->gamma, sw->size, sw->speed, sw->tried, sw->stray, sw->slack,
                        sw->rest_time, sw->trial_force};
    double *one[] = {&sw->margin, &sw->strength, &sw->instant, &sw->last, &sw->since, &sw->interval, &sw->gained,
                     &sw->remainder};
    int *other[] = {&sw->acting, &sw->redundant, &sw->begun, &sw->due, &sw->report, &sw->moved, &sw->settled, &sw->with_friction,
                    &sw->equal_restitution, &sw->holds_sides};
    for (size_t i = 0; i < LENGTH(modes); ++i)
        lag_archive_integers(a, modes[i], rows, LAG_OPEN, LAG_SLIPS_BACKWARD);
    flags(a, marks, LENGTH(marks), rows);
    lag_archive_integers(a, sw->ended, rows, NOTHING_ENDED, SLIPPING_ENDED);
    reals(a, by_row, LENGTH(by_row), rows);
    reals(a, one, LENGTH(one), 1);
    flags(a, other, LENGTH(other), 1);
    lag_archive_int(a, &sw->stage, 0, 2);
    lag_archive_int(a, &sw->rounds, 0, INT32_MAX / 2);
    lag_archive_int(a, &sw->impacts, 0, INT32_MAX / 2);
    lag_archive_int(a, &sw->motions, -1, LAG_TWO_MOTIONS);
    method(a, &sw->chosen, chosen);
    lag_archive_reals(a, sw->jacobian, (int64_t)rows * nq);
    lag_archive_reals(a, sw->response, (int64_t)all * (nq + run->system.nc));
    lag_archive_reals(a, sw->force, all);
    lag_archive_reals(a, sw->multipliers, sw->nc);
    lag_archive_reals(a, sw->begin, nq + sw->nc);
    lag_archive_reals(a, sw->side, sw->signs);
    lag_archive_integers(a, sw->turned, sw->signs, 0, 1);
    lag_archive_reals(a, sw->sign_size, sw->signs);
    lag_archive_reals(a, sw->sign_value, sw->signs);
    lag_archive_reals(a, sw->sign_before, sw->signs);
    lag_archive_reals(a, sw->struck, n);
    for (int i = 0; i < sw->clocks; ++i) {
        lag_clock *c = sw->clock + i;
        real(a, &c->number);
        real(a, &c->next);
        lag_archive_count(a, &c->left, 0, INT64_MAX);
        flag(a, &c->begun);
        lag_archive_int(a, &c->ticks, 0, 2);
        /* steps would go back to a tick that is past, and never arrive */
        if (a->use == LAG_READS && c->begun && !(c->next >= run->step.t_old))
            a->damaged = 1;
    }
    kinks(a, &sw->kinks);
}

static void all(lag_archive *a, lag_run *run, const lag_method *chosen)
{
    lag_resolution *r = &run->resolution;
    lag_archive_reals(a, run->parameters, run->np);
    step(a, run);
    tolerances(a, run);
    solver(a, run);
    watch(a, run);
    method(a, &run->method, chosen);
    method(a, &run->stepped, chosen);
    lag_archive_count(a, &run->breaks.next, 0, run->breaks.count);
    lag_archive_count(a, &run->samples.next, 0, run->samples.count);
    if (run->implicit)
        implicit(a, run);
    if (r->count) {
        flag(a, &r->jets.stale);
        lag_archive_reals(a, r->scale, r->count);
        real(a, &r->start);
        real(a, &r->end);
        real(a, &r->step);
    }
    if (run->switching.used)
        switching(a, run, chosen);
}

void lag_archive_run(lag_archive *a, lag_run *run, const lag_method *chosen)
{
    lag_archive again = *a;
    all(a, run, chosen);
    if (a->use == LAG_READS && !a->damaged) {
        const int stale = run->resolution.jets.stale;
        lag_renew_tapes(run);
        if (run->resolution.count && !stale) {
            lag_jets_refresh(&run->resolution.jets);
            lag_jets_refresh(&run->resolution.middle);
        }
        /* the list of watched functions follows from the modes; what it changes beside is read again */
        if (run->switching.used && lag_watch_modes(run, run->step.t, run->step.y, run->step.f) != LAG_RUNNING)
            a->damaged = 1;
        all(&again, run, chosen);
    }
    int count = run->switching.watched_count;
    lag_archive_int(a, &count, run->switching.watched_count, run->switching.watched_count);
    if (run->switching.used)
        watched(a, &run->switching);
}
