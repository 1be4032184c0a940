#include "switching/enclosure.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "bind.h"
#include "dense_jets.h"
#include "evaluate.h"
#include "methods/method.h"
#include "solution.h"
#include "step.h"
#include "switching/crossing.h"
#include "switching/rows.h"
#include "switching/settle.h"
#include "switching/surfaces.h"

#define WIDER 0.1           /* of the width: what encloses the dense output around interpolants of a step's ends */
#define ROUNDING (2.0 * DBL_EPSILON)    /* per degree: of control points */
#define MANY 8              /* functions of a tape of which each is evaluated alone where it is asked for alone */
#define HELD 1e-13          /* of the largest terms of phi and psi: how far rows that hold may be off zero */

/* The tapes; GAPS has phi alone, which most steps of contacts need. */
enum { GAPS, ROWS, CONDITIONS, KINKS };

/* Those whose functions have the errors of rows that hold. */
#define OF_HELD_STATES (1 << CONDITIONS | 1 << KINKS)

int lag_is_enclosed(enum lag_watched what)
{
    return what == LAG_WATCH_GAP || what == LAG_WATCH_SLIP || what == LAG_WATCH_KINK || what == LAG_WATCH_CONDITION
           || what == LAG_WATCH_TIME;
}

int lag_is_of_time(const lag_switching *sw, const lag_watched_function *w)
{
    return w->what == LAG_WATCH_TIME || (w->what == LAG_WATCH_KINK && sw->kinks.time[w->which]);
}

/* Slice the tapes of gaps and of rows. */
static void slice(lag_run *run, const lag_switching_rules *rules)
{
    lag_switching *sw = &run->switching;
    lag_enclosure *e = &sw->enclosure;
    lag_pool own = lag_pool_of(&run->pool.from);
    const int rows = sw->rows, functions = rows > sw->nh ? rows : sw->nh;
    int32_t *outputs = lag_get(&own, (size_t)sw->nb + (size_t)functions, sizeof *outputs);
    int32_t *ends = lag_get(&own, (size_t)functions, sizeof *ends);
    if (!own.failed && sw->nh >= MANY) {
        for (int i = 0; i < sw->nh; ++i) {
            outputs[i] = i;
            ends[i] = i + 1;
        }
        e->of_gaps = lag_slices(&run->pool, &rules->gaps, e->tapes[GAPS].inputs, sw->nh, outputs, ends);
    }
    if (!own.failed && rows >= MANY) {
        int count = 0;
        for (int row = 0; row < rows; ++row) {
            for (int e = sw->first_entry[row]; sw->law[row] == LAG_LIMITED && e < sw->first_entry[row + 1]; ++e)
                outputs[count++] = sw->nh + sw->entry[e];
            if (sw->law[row] == LAG_LIMITED)
                outputs[count++] = sw->nh + sw->nb + row;
            ends[row] = count;
        }
        if (count)
            e->of_rows = lag_slices(&run->pool, &rules->functions, e->tapes[ROWS].inputs, rows, outputs, ends);
    }
    run->pool.failed |= own.failed;
    lag_release(&own);
}

void lag_enclosure_bind(lag_run *run, const lag_switching_rules *rules)
{
    lag_switching *sw = &run->switching;
    lag_enclosure *e = &sw->enclosure;
    const int moving = 2 * run->system.nq;
    if (lag_bind(run, &run->pool, &e->gaps, &rules->gaps))
        return;
    lag_jets_bind(e->tapes + GAPS, &run->pool, &e->gaps, &rules->gaps, run->np);
    lag_jets_bind(e->tapes + ROWS, &run->pool, &sw->functions, &rules->functions, run->np);
    lag_jets_bind(e->tapes + CONDITIONS, &run->pool, &sw->condition_tape, &rules->condition_functions, run->np);
    lag_jets_bind(e->tapes + KINKS, &run->pool, &sw->kinks.tape, &rules->kink_functions, run->np);
    if (!run->pool.failed)
        slice(run, rules);
    e->state = lag_get(&run->pool, (size_t)moving, sizeof *e->state);
    int *used = lag_get(&run->pool, (size_t)moving + 1, sizeof *used);
    if (run->pool.failed)
        return;
    for (int i = 0; i < LAG_ENCLOSED_TAPES; ++i)
        for (int j = 1; j <= moving; ++j)
            used[j - 1] |= e->tapes[i].used[j] << i;
    for (int i = 0; i < sw->nb; ++i) /* psi = B v + b_0 */
        if (sw->law[sw->row[i]] == LAG_LIMITED)
            used[run->system.nq + sw->column[i]] |= 1 << ROWS;
    for (int i = 0; i < moving; ++i)
        if (used[i])
            e->state[e->count++] = i;
    e->used = used;
    e->place = lag_get(&run->pool, (size_t)moving, sizeof *e->place);
    e->error = lag_doubles(&run->pool, e->count);
    e->jets = lag_get(&run->pool, (size_t)e->count * JET, sizeof *e->jets);
    lag_dense_points_bind(&e->dense, &run->pool, e->count, e->state);
    for (int i = 0; i < e->count && !run->pool.failed; ++i)
        e->place[e->state[i]] = i;
}

static lag_interval widened(lag_interval a)
{
    const double margin = WIDER * (a.high - a.low) + 8.0 * ROUNDING * lag_most(-a.low, a.high);
    return (lag_interval){a.low - margin, a.high + margin};
}

/* Enclose state i over the step by its ends and their slopes. */
static lag_interval enclose_between_ends(const lag_run *run, int i, const double *f)
{
    const int nq = run->system.nq, q = i % nq;
    const double h = run->step.h_old, *before = run->step.y_old, *after = run->step.y_new;
    const double a0 = run->step.stages[nq + q], a1 = f[nq + q];
    const double v0 = before[nq + q], v1 = after[nq + q], q0 = before[q], q1 = after[q];
    const double b[] = {q0,
                        q0 + h * v0 / 5.0,
                        q0 + h * (0.4 * v0 + h * a0 / 20.0),
                        q1 - h * (0.4 * v1 - h * a1 / 20.0),
                        q1 - h * v1 / 5.0,
                        q1};
    if (i < nq)
        return widened(lag_range_of(b, 5));
    const double cubic[] = {v0, v0 + h * a0 / 3.0, v1 - h * a1 / 3.0, v1};
    lag_interval r = lag_range_of(cubic, 3);
    for (int j = 1; j < 4; ++j) { /* at the ends, the derivative is v */
        const double slope = 5.0 * (b[j + 1] - b[j]) / h;
        r.low = lag_least(r.low, slope);
        r.high = lag_most(r.high, slope);
    }
    return widened(r);
}

static int tape_of(enum lag_watched what)
{
    switch (what) {
    case LAG_WATCH_GAP:
        return GAPS;
    case LAG_WATCH_SLIP:
        return ROWS;
    case LAG_WATCH_KINK:
        return KINKS;
    default:
        return CONDITIONS;
    }
}

/* Add the errors of the states that a row determines, whose response is known, where phi and psi are off by these. */
static void add_errors(lag_run *run, int row, double gap, double speed)
{
    const lag_switching *sw = &run->switching;
    lag_enclosure *e = &run->switching.enclosure;
    const int nq = run->system.nq;
    const double *response = sw->response + row * (nq + run->system.nc), inertia = lag_along(run, row, response);
    if (!(inertia > 0.0))
        return;
    for (int i = 0; i < e->count; ++i)
        e->error[i] += fabs(response[e->state[i] % nq]) / inertia * (e->state[i] < nq ? gap : speed);
    e->held = 1;
}

/* The rounding error of psi of a row that holds: where nothing has moved yet, that of the force which holds it. */
static double speed_error(const lag_run *run, int row)
{
    const lag_switching *sw = &run->switching;
    const double *response = sw->response + row * (run->system.nq + run->system.nc);
    const double by_force = fabs(sw->force[row]) * lag_along(run, row, response);
    const double time = LAG_HORIZON * (run->settings.t_end - run->step.t_start);
    return HELD * fmax(sw->speed[row], time * by_force) + sw->stray[row];
}

/* The errors that a row's rounding has. */
static void add_rounding(lag_run *run, int row)
{
    add_errors(run, row, HELD * run->switching.size[row], speed_error(run, row));
}

/* Add the errors of the velocities that a surface determines on which the motion slides, where its function is off by
 * this. */
static void add_surface(lag_run *run, double off)
{
    const lag_kinks *k = &run->switching.kinks;
    lag_enclosure *e = &run->switching.enclosure;
    const int nq = run->system.nq;
    for (int i = 0; i < e->count; ++i)
        if (e->state[i] >= nq)
            e->error[i] += fabs(k->both[e->state[i] - nq] / k->rates) * off;
    e->held = 1;
}

static void no_errors(lag_enclosure *e)
{
    if (e->held)
        memset(e->error, 0, (size_t)e->count * sizeof *e->error);
    e->held = 0;
}

/* Whether a row holds at an instant, or touches. */
static int touches(const lag_run *run, int row)
{
    const lag_switching *sw = &run->switching;
    const int closed = sw->law[row] == LAG_UNILATERAL && sw->phi[row] <= lag_no_gap(run, row);
    return sw->active[row] && (closed || sw->mode[row] == LAG_HOLDS);
}

int lag_enclosure_touch(lag_run *run, double t, const double *y)
{
    const lag_switching *sw = &run->switching;
    int factored = 0;
    no_errors(&run->switching.enclosure);
    for (int i = 0; i < sw->rows && (sw->conditions || sw->kinks.count); ++i) {
        if (!touches(run, i))
            continue;
        if (!factored && lag_factor(run, t, y))
            return 1;
        factored = 1;
        lag_row_response(run, i);
        add_rounding(run, i);
    }
    if (sw->kinks.slides >= 0)
        add_surface(run, HELD * sw->kinks.size[sw->kinks.slides]);
    return 0;
}

void lag_enclosure_stray(lag_run *run)
{
    lag_switching *sw = &run->switching;
    if (!sw->enclosure.held)
        return;
    for (int k = 1; k < NODES - 1; ++k) {
        const double t = run->step.t_old + lag_node(k) * run->step.h_old;
        lag_dense_often(run, t, sw->y);
        if (lag_find_rows(run, t, sw->y))
            return;
        for (int i = 0; i < sw->rows; ++i)
            if (sw->mode[i] == LAG_HOLDS)
                add_errors(run, i, fabs(sw->phi[i]), fabs(sw->psi[i]));
        if (sw->kinks.slides >= 0)
            add_surface(run, fabs(lag_off_surface(run, t, sw->y)));
    }
}

void lag_enclosure_begin(lag_run *run, const double *f)
{
    const lag_switching *sw = &run->switching;
    lag_enclosure *e = &run->switching.enclosure;
    e->looked = e->watched = 0;
    lag_dense_points_begin(&e->dense);
    for (int k = 0; k < sw->watched_count; ++k)
        if (lag_is_enclosed(sw->watched[k].what))
            e->watched |= 1 << tape_of(sw->watched[k].what);
    no_errors(e);
    for (int i = 0; i < sw->rows && e->watched & OF_HELD_STATES; ++i)
        if (sw->mode[i] == LAG_HOLDS)
            add_rounding(run, i);
    if (sw->kinks.slides >= 0 && e->watched & OF_HELD_STATES)
        add_surface(run, HELD * sw->kinks.size[sw->kinks.slides]);
    for (int i = 0; i < e->count; ++i) {
        if (!(e->used[e->state[i]] & e->watched))
            continue;
        lag_interval *range = e->jets + (int64_t)JET * i;
        if (run->stepped->uses_slope) {
            *range = enclose_between_ends(run, e->state[i], f);
        } else { /* its dense output costs nothing */
            lag_dense_jet(run, &e->dense, i, 0.0, 1.0, 0, range);
        }
    }
}

/* psi of a row: B v + b_0. */
static void slip_jet(const lag_run *run, const lag_jet_tape *tape, int row, int order, lag_interval *out)
{
    const lag_switching *sw = &run->switching;
    const lag_enclosure *e = &sw->enclosure;
    lag_interval product[JET];
    memcpy(out, lag_jet_output(tape, sw->nh + sw->nb + row), (size_t)(order + 1) * sizeof *out);
    for (int n = sw->first_entry[row]; n < sw->first_entry[row + 1]; ++n) {
        const int i = sw->entry[n], v = e->place[run->system.nq + sw->column[i]];
        lag_jet_multiply(lag_jet_output(tape, sw->nh + i), e->jets + (int64_t)JET * v, product, order);
        for (int k = 0; k <= order; ++k)
            out[k] = lag_interval_add(out[k], product[k]);
    }
}

/* The jet of function k by its tape's outputs. */
static void take_output(lag_run *run, int k, int order, lag_interval *out)
{
    lag_switching *sw = &run->switching;
    const lag_watched_function *w = sw->watched + k;
    const lag_jet_tape *tape = sw->enclosure.tapes + tape_of(w->what);
    const size_t size = (size_t)(order + 1) * sizeof *out;
    double sign = w->sign;
    if (w->what == LAG_WATCH_SLIP) {
        slip_jet(run, tape, w->which, order, out);
    } else if (w->what == LAG_WATCH_GAP) {
        memcpy(out, lag_jet_output(tape, sw->place[w->which]), size);
        sign *= sw->sign[w->which];
    } else {
        memcpy(out, lag_jet_output(tape, w->which), size);
    }
    if (w->what == LAG_WATCH_KINK) {
        const double bound = lag_kink_bound(run, w->which, w->sign);
        out[0] = lag_interval_add(out[0], (lag_interval){-bound, -bound});
    }
    for (int i = 0; i <= order; ++i)
        out[i] = lag_interval_scale(out[i], sign);
    out[0] = lag_interval_add(out[0], (lag_interval){w->shift, w->shift});
}

/* What a watched function needs of its tape; NULL: all. */
static const lag_slice *slice_of(const lag_run *run, int k)
{
    const lag_switching *sw = &run->switching;
    const lag_watched_function *w = sw->watched + k;
    if (w->what == LAG_WATCH_GAP && sw->enclosure.of_gaps)
        return sw->enclosure.of_gaps + sw->place[w->which];
    return w->what == LAG_WATCH_SLIP && sw->enclosure.of_rows ? sw->enclosure.of_rows + w->which : NULL;
}

/* Evaluate a tape, or a slice of it, with t in [a, b] and the jets of the states. */
static void evaluate(lag_run *run, lag_jet_tape *tape, const lag_slice *part, double a, double b, int order)
{
    lag_enclosure *e = &run->switching.enclosure;
    lag_interval *t = lag_jet_input(tape, 0);
    lag_jets_refresh(tape);
    e->work += order + 1;
    t[0] = (lag_interval){a, b};
    for (int k = 1; k <= order; ++k)
        t[k] = (lag_interval){k == 1, k == 1};
    if (part) { /* of functions that rows which hold do not move */
        for (int j = 0; j < part->count; ++j)
            if (part->inputs[j])
                memcpy(lag_jet_input(tape, part->inputs[j]), e->jets + (int64_t)JET * e->place[part->inputs[j] - 1],
                       (size_t)(order + 1) * sizeof *t);
        lag_jets_run_part(tape, &part->stream, order);
        return;
    }
    for (int i = 0; i < e->count; ++i) {
        if (!tape->used[1 + e->state[i]])
            continue;
        lag_interval *x = lag_jet_input(tape, 1 + e->state[i]);
        memcpy(x, e->jets + (int64_t)JET * i, (size_t)(order + 1) * sizeof *t);
        if (e->held && OF_HELD_STATES >> (tape - e->tapes) & 1) {
            x->low -= e->error[i];
            x->high += e->error[i];
        }
    }
    lag_jets_run(tape, order);
}

double lag_gap_at(lag_run *run, int row, double t, const double *y)
{
    const lag_enclosure *e = &run->switching.enclosure;
    const int place = run->switching.place[row];
    if (e->of_gaps)
        lag_evaluate_slice(&e->gaps, e->of_gaps + place, t, y);
    else
        lag_evaluate(&e->gaps, &run->system, t, y, LAG_ALL);
    return OUT(&e->gaps, place);
}

lag_interval lag_enclose_step(lag_run *run, int k)
{
    lag_enclosure *e = &run->switching.enclosure;
    const int tape = tape_of(run->switching.watched[k].what);
    lag_interval out;
    if (!(e->looked >> tape & 1))
        evaluate(run, e->tapes + tape, NULL, run->step.t_old, run->step.t, 0);
    e->looked |= 1 << tape;
    take_output(run, k, 0, &out);
    return out;
}

/* The jet of a state between two parts of the step. */
static void enclose_state(lag_run *run, int i, double u, double v, int order)
{
    lag_enclosure *e = &run->switching.enclosure;
    lag_dense_jet(run, &e->dense, i, u, v, order, e->jets + (int64_t)JET * i);
}

void lag_enclose(lag_run *run, int k, double a, double b, int order, lag_interval *out)
{
    lag_switching *sw = &run->switching;
    lag_enclosure *e = &sw->enclosure;
    const double start = run->step.t_old, h = run->step.h_old;
    const double u = fmin(fmax((a - start) / h - DBL_EPSILON, 0.0), 1.0);
    const double v = fmin(fmax((b - start) / h + DBL_EPSILON, 0.0), 1.0);
    const lag_watched_function *w = sw->watched + k;
    const lag_slice *part = slice_of(run, k);
    const int tape = tape_of(w->what);
    if (part) {
        for (int j = 0; j < part->count; ++j)
            if (part->inputs[j])
                enclose_state(run, e->place[part->inputs[j] - 1], u, v, order);
        if (w->what == LAG_WATCH_SLIP)
            for (int k = sw->first_entry[w->which]; k < sw->first_entry[w->which + 1]; ++k)
                enclose_state(run, e->place[run->system.nq + sw->column[sw->entry[k]]], u, v, order);
    } else if (!lag_is_of_time(sw, w)) { /* otherwise, whatever the states are does not matter */
        for (int i = 0; i < e->count; ++i)
            if (e->used[e->state[i]] >> tape & 1)
                enclose_state(run, i, u, v, order);
    }
    evaluate(run, e->tapes + tape, part, a, b, order);
    take_output(run, k, order, out);
}

void lag_enclose_at(lag_run *run, int k, double t, const double *y, const double *f, lag_interval *out)
{
    lag_enclosure *e = &run->switching.enclosure;
    const int tape = tape_of(run->switching.watched[k].what);
    for (int i = 0; i < e->count; ++i) {
        const int state = e->state[i];
        e->jets[(int64_t)JET * i] = (lag_interval){y[state], y[state]};
        e->jets[(int64_t)JET * i + 1] = (lag_interval){f[state], f[state]};
    }
    evaluate(run, e->tapes + tape, slice_of(run, k), t, t, 1);
    take_output(run, k, 1, out);
}

/* The width of the enclosure of a tape's output at a state, due to the errors of rows that hold. */
static double error_of(lag_run *run, int of, int which, double t, const double *y)
{
    lag_enclosure *e = &run->switching.enclosure;
    lag_jet_tape *tape = e->tapes + of;
    for (int i = 0; i < e->count; ++i)
        e->jets[(int64_t)JET * i] = (lag_interval){y[e->state[i]], y[e->state[i]]};
    evaluate(run, tape, NULL, t, t, 0);
    const lag_interval value = lag_jet_output(tape, which)[0];
    return value.high - value.low;
}

double lag_held_error(lag_run *run, int which, double t, const double *y)
{
    if (!run->switching.enclosure.held || which >= run->switching.conditions)
        return 0.0;
    return error_of(run, CONDITIONS, which, t, y);
}

double lag_held_error_of_kink(lag_run *run, int kink, double t, const double *y)
{
    return run->switching.enclosure.held ? error_of(run, KINKS, kink, t, y) : 0.0;
}

double lag_error_of_states(lag_run *run, int k, double t, const double *y, double tolerances)
{
    lag_enclosure *e = &run->switching.enclosure;
    const int held = e->held;
    lag_interval out;
    for (int i = 0; i < e->count; ++i) {
        const int state = e->state[i];
        const double error = tolerances * (run->tolerances.atol[state] + run->settings.rtol * fabs(y[state]));
        e->jets[(int64_t)JET * i] = (lag_interval){y[state] - error, y[state] + error};
    }
    e->held = 0;
    evaluate(run, e->tapes + tape_of(run->switching.watched[k].what), slice_of(run, k), t, t, 0);
    e->held = held;
    take_output(run, k, 0, &out);
    return 0.5 * (out.high - out.low);
}

/* The rate of a kink's function at a state that changes by `rate`, nq of q and nq of v. */
static lag_interval rate_of_kink(lag_run *run, int kink, double t, const double *y, const double *of_q, const double *of_v)
{
    lag_enclosure *e = &run->switching.enclosure;
    lag_jet_tape *tape = e->tapes + KINKS;
    const int nq = run->system.nq;
    for (int i = 0; i < e->count; ++i) {
        const int state = e->state[i];
        const double *of = state < nq ? of_q : of_v, rate = of ? of[state % nq] : 0.0;
        e->jets[(int64_t)JET * i] = (lag_interval){y[state], y[state]};
        e->jets[(int64_t)JET * i + 1] = (lag_interval){rate, rate};
    }
    evaluate(run, tape, NULL, t, t, 1);
    return lag_jet_output(tape, kink)[1];
}

double lag_rate_of_kink(lag_run *run, int kink, double t, const double *y, const double *a)
{
    const lag_interval slope = rate_of_kink(run, kink, t, y, y + run->system.nq, a);
    return 0.5 * (slope.low + slope.high);
}

/* The rate of a kink's function along the response of a row, in q and, if asked, in v. */
static lag_interval rate_along_row(lag_run *run, int kink, int row, double t, const double *y, int with_speeds)
{
    const double *response = run->switching.response + row * (run->system.nq + run->system.nc);
    const lag_interval by_time = rate_of_kink(run, kink, t, y, NULL, NULL);
    const lag_interval whole = rate_of_kink(run, kink, t, y, response, with_speeds ? response : NULL);
    return lag_interval_add(whole, lag_interval_scale(by_time, -1.0));
}

int lag_side_of_kink(lag_run *run, int kink, double t, const double *y)
{
    const lag_switching *sw = &run->switching;
    int side = 0;
    for (int i = 0; i < sw->rows && !side; ++i)
        if (sw->law[i] == LAG_UNILATERAL && touches(run, i))
            side = lag_interval_sign(rate_along_row(run, kink, i, t, y, 1));
    return side;
}

double lag_held_rate_of_kink(lag_run *run, int kink, double t, const double *y)
{
    const lag_switching *sw = &run->switching;
    double error = 0.0;
    for (int i = 0; i < sw->rows; ++i) {
        if (!touches(run, i))
            continue;
        const double inertia = lag_along(run, i, sw->response + i * (run->system.nq + run->system.nc));
        if (inertia > 0.0)
            error += lag_interval_size(rate_along_row(run, kink, i, t, y, 0)) / inertia * speed_error(run, i);
    }
    return error;
}

int lag_is_undefined(lag_run *run, int k)
{
    lag_switching *sw = &run->switching;
    return sw->enclosure.tapes[tape_of(sw->watched[k].what)].undefined;
}
