#include "resolution.h"

#include <math.h>
#include <string.h>

#include "bind.h"
#include "dense_jets.h"

#define BEND 1.2            /* of the largest value: how far a function may bend away from its tangent in half a step */
#define AHEAD 16.0          /* steps for which a limit is computed at once, at first; ... */
#define NEARER 4.0          /* ... then fewer */
#define PARTS 400           /* of a run at most, in which the largest values of functions are sought ... */
#define LOOSE 2.0           /* ... until they are known within this factor */
#define HUGE_SIZE 1e150     /* of a function that is as good as unbounded */
#define TINY 1e-280         /* of one that has lost digits to underflow */
#define FLAT 1e-3           /* of the tolerance: a change of a function, relative to its largest value, that need not be seen */
#define DEPTH 6             /* of halving the interval in which a step is looked at */
#define LEAST 1e-9          /* of the run: a step, or a part, that need not be shorter */

int lag_use_explicit_time(lag_run *run, const lag_program *functions)
{
    lag_resolution *r = &run->resolution;
    lag_pool *pool = &run->pool;
    if (lag_bind(run, pool, &r->tape, functions))
        return 1;
    lag_jets_bind(&r->jets, pool, &r->tape, functions, run->np);
    lag_jets_bind(&r->middle, pool, &r->tape, functions, run->np);
    const int count = (int)(functions->output_count / 3); /* the rest is where they are used, and whether of states */
    r->scale = lag_doubles(pool, count);
    r->singular = lag_get(pool, (size_t)count, sizeof(int));
    r->of_state = lag_get(pool, (size_t)count, sizeof(int));
    int *state = lag_get(pool, 2 * (size_t)run->system.nq, sizeof(int)), states = 0;
    if (pool->failed)
        return 1;
    for (int i = 0; i < count; ++i)
        r->of_state[i] = OUT(&r->tape, 2 * count + i) != 0.0;
    for (int i = 0; i < 2 * run->system.nq; ++i)
        if (r->jets.used[1 + i])
            state[states++] = i;
    lag_dense_points_bind(&r->motion, pool, states, state);
    r->count = pool->failed ? 0 : count;
    return pool->failed;
}

/* Whether a function has a bound, far enough from overflow for its curvature to have one. */
static int is_bounded(lag_interval values)
{
    return lag_interval_size(values) < HUGE_SIZE;
}

/* Whether it is beyond all bounds in all of an interval. */
static int overflows(lag_interval values)
{
    return values.low >= HUGE_SIZE || values.high <= -HUGE_SIZE;
}

static int has_bounds(const lag_interval *jet)
{
    return is_bounded(jet[0]) && isfinite(lag_interval_size(jet[2]));
}

/* Whether a change need not be seen, of a function with this largest value. */
static int is_flat(const lag_run *run, lag_interval values, double scale)
{
    return values.high - values.low <= FLAT * run->settings.rtol * scale;
}

/* Let t be in [a, b]. */
static void set_time(const lag_jet_tape *jets, double a, double b)
{
    lag_interval *t = lag_jet_input(jets, 0);
    memset(t, 0, JET * sizeof *t);
    t[0] = (lag_interval){a, b};
    t[1].low = t[1].high = 1.0;
}

/* Enclose the functions and their derivatives at fixed v, where q is fixed, too, or `moves` with v from the step's
 * beginning. */
static void enclose(lag_run *run, double a, double b, int order, int moves)
{
    lag_jet_tape *jets = &run->resolution.jets;
    const int nq = run->system.nq;
    const double *y = run->step.y, from = a - run->step.t, to = b - run->step.t;
    set_time(jets, a, b);
    for (int i = 0; i < 2 * nq; ++i) {
        lag_interval *x = lag_jet_input(jets, 1 + i);
        const double v = moves && i < nq ? y[nq + i] : 0.0, first = y[i] + v * from, last = y[i] + v * to;
        memset(x, 0, JET * sizeof *x);
        x[0] = (lag_interval){fmin(first, last), fmax(first, last)};
        x[1] = (lag_interval){v, v};
    }
    lag_jets_run(jets, order);
}

/* Enclose them along the last step. */
static void enclose_motion(lag_run *run, double a, double b)
{
    lag_resolution *r = &run->resolution;
    const double start = run->step.t_old, h = run->step.h_old, middle = a + 0.5 * (b - a);
    const double u = fmin((a - start) / h, 1.0), v = fmin((b - start) / h, 1.0), w = fmin((middle - start) / h, 1.0);
    set_time(&r->jets, a, b);
    set_time(&r->middle, middle, middle);
    for (int i = 0; i < r->motion.count; ++i) {
        const int place = 1 + r->motion.state[i];
        lag_dense_jet(run, &r->motion, i, u, v, JET_ORDER, lag_jet_input(&r->jets, place));
        lag_dense_jet(run, &r->motion, i, w, w, JET_ORDER, lag_jet_input(&r->middle, place));
    }
    lag_jets_run_about(&r->jets, &r->middle, fmax(b - middle, middle - a), JET_ORDER);
}

static int is_used(const lag_run *run, int i)
{
    const lag_interval *used = lag_jet_output(&run->resolution.jets, run->resolution.count + i);
    return used->low != 0.0 || used->high != 0.0;
}

/*
 * The largest values that functions take in the run: those in the middles of parts of it, which are halved where an
 * enclosure is far larger. It has no bound next to poles, and beyond the branch in which a function is used.
 */
static void measure(lag_run *run)
{
    lag_resolution *r = &run->resolution;
    const double whole = run->settings.t_end - run->step.t;
    double start[PARTS] = {run->step.t}, length[PARTS] = {whole};
    int count = 1;
    lag_jets_refresh(&r->jets);
    lag_jets_refresh(&r->middle);
    memset(r->scale, 0, (size_t)r->count * sizeof *r->scale);
    for (int k = 0; k < count; ++k) {
        const double half = 0.5 * length[k], a = start[k], middle = a + half;
        enclose(run, middle, middle, 0, 0);
        for (int i = 0; i < r->count; ++i) {
            const lag_interval values = *lag_jet_output(&r->jets, i);
            if (is_used(run, i) && is_bounded(values))
                r->scale[i] = fmax(r->scale[i], lag_interval_size(values));
        }
        int loose = 0;
        enclose(run, a, a + length[k], 0, 0);
        for (int i = 0; i < r->count && !loose; ++i) {
            const lag_interval values = *lag_jet_output(&r->jets, i);
            loose = is_used(run, i) && !overflows(values) && lag_interval_size(values) > LOOSE * r->scale[i];
        }
        if (!loose || count + 2 > PARTS || half < LEAST * whole)
            continue;
        start[count] = a;
        start[count + 1] = middle;
        length[count] = length[count + 1] = half;
        count += 2;
    }
}

/* Of functions that have been enclosed at a time, mark those that have no bound there, or none that is any use, as singular.
 * One that overflows matters to what it divides, which is resolved itself. */
static void mark_singular(lag_run *run)
{
    lag_resolution *r = &run->resolution;
    for (int i = 0; i < r->count; ++i) {
        const lag_interval *jet = lag_jet_output(&r->jets, i);
        const int matters = lag_interval_size(jet[0]) >= TINY && !is_flat(run, jet[0], r->scale[i]);
        r->singular[i] |= !is_bounded(jet[0]) || (!has_bounds(jet) && matters);
    }
}

/* Find singular functions at the beginning of a step, and the values of those of the state. */
static void begin_step(lag_run *run)
{
    lag_resolution *r = &run->resolution;
    enclose(run, run->step.t, run->step.t, 2, 1);
    for (int i = 0; i < r->count; ++i) {
        const lag_interval value = *lag_jet_output(&r->jets, i);
        if (r->of_state[i] && is_used(run, i) && is_bounded(value))
            r->scale[i] = fmax(r->scale[i], lag_interval_size(value));
    }
    memset(r->singular, 0, (size_t)r->count * sizeof *r->singular);
    mark_singular(run);
}

/* The largest step that resolves function i, which has this largest value, on the interval of the last enclosure. */
static double step_of(const lag_run *run, int i, double scale)
{
    const lag_resolution *r = &run->resolution;
    const lag_interval *jet = lag_jet_output(&r->jets, i);
    const int bounded = has_bounds(jet);
    const double bend = lag_interval_size(jet[2]), size = lag_interval_size(jet[0]);
    const double largest = scale > 0.0 || !bounded ? scale : size;
    if (r->singular[i] || !is_used(run, i) || fmax(largest, size) < TINY || is_flat(run, jet[0], scale))
        return INFINITY;
    return bounded ? 2.0 * sqrt(BEND * largest / bend) : 0.0;
}

/* Whether a step resolves, between two times, the functions other than singular ones at fixed v: all of them,
 * those of time alone, or none. */
enum { NONE, OF_TIME, ALL };

static int resolved_between(lag_run *run, double a, double b, double h, double *allowed)
{
    lag_resolution *r = &run->resolution;
    int resolved = ALL;
    *allowed = INFINITY;
    enclose(run, a, b, 2, 1);
    for (int i = 0; i < r->count; ++i) {
        const double step = step_of(run, i, r->scale[i]);
        *allowed = fmin(*allowed, step);
        if (!(step >= h))
            resolved = r->of_state[i] ? (resolved < OF_TIME ? resolved : OF_TIME) : NONE;
    }
    return resolved;
}

double lag_resolved_step(lag_run *run, double longest)
{
    lag_resolution *r = &run->resolution;
    const double t = run->step.t;
    r->supposed = 0;
    if (r->jets.stale)
        measure(run);
    else if (t + longest <= r->end && longest <= r->step && t >= r->start)
        return longest;
    begin_step(run);
    const double least = LEAST * (run->settings.t_end - run->step.t_start);
    double h = longest;
    for (; h >= least; h *= 0.5) {
        for (double steps = AHEAD; steps >= 1.0; steps /= NEARER) {
            const double end = fmin(t + steps * h, run->settings.t_end);
            double allowed;
            const int resolved = resolved_between(run, t, end, h, &allowed);
            r->supposed |= resolved == OF_TIME;
            if (resolved < ALL)
                continue;
            r->supposed = 0;
            r->start = t;
            r->end = end;
            r->step = allowed;
            return h;
        }
        if (r->supposed)
            return h;
    }
    return fmin(longest, least); /* across a place where one has no bounds */
}

/* Whether a step of size h resolves the functions of time and state from a to b along the last one. Where the bounds are
 * not close enough to tell, halves of the interval are looked at, down to some depth. */
static int resolves(lag_run *run, double a, double b, double h, int depth)
{
    lag_resolution *r = &run->resolution;
    int resolved = 1;
    enclose_motion(run, a, b);
    for (int i = 0; i < r->count && resolved; ++i) {
        const lag_interval middle = *lag_jet_output(&r->middle, i);
        const double scale = is_bounded(middle) ? fmax(r->scale[i], lag_interval_size(middle)) : r->scale[i];
        resolved = !r->of_state[i] || step_of(run, i, scale) >= h;
    }
    const double middle = 0.5 * (a + b);
    return resolved || (depth > 0 && resolves(run, a, middle, h, depth - 1) && resolves(run, middle, b, h, depth - 1));
}

double lag_resolved_part(lag_run *run)
{
    if (!run->resolution.supposed)
        return 1.0;
    const double t = run->step.t_old, whole = run->step.h_old;
    const double least = LEAST * (run->settings.t_end - run->step.t_start);
    double h = whole;
    lag_dense_points_begin(&run->resolution.motion);
    enclose_motion(run, t, t);
    mark_singular(run);
    while (h > least && !resolves(run, t, t + h, h, DEPTH))
        h *= 0.5;
    return h / whole;
}
