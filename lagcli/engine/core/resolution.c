#include "resolution.h"

#include <math.h>
#include <string.h>

#include "bind.h"

#define BEND 1.2            /* of the largest value: how far a function may bend away from its tangent in half a step */
#define AHEAD 16.0          /* steps for which a limit is computed at once, at first; ... */
#define NEARER 4.0          /* ... then fewer */
#define PARTS 400           /* of a run at most, in which the largest values of functions are sought ... */
#define LOOSE 2.0           /* ... until they are known within this factor */
#define HUGE_SIZE 1e150     /* of a function that is as good as unbounded */
#define TINY 1e-280         /* of one that has lost digits to underflow */
#define FLAT 1e-3           /* of the tolerance: a change of a function, relative to its largest value, that need not be seen */
#define LEAST 1e-9          /* of the run: a step, or a part, that need not be shorter */

int lag_use_explicit_time(lag_run *run, const lag_program *functions)
{
    lag_resolution *r = &run->resolution;
    if (lag_bind(run, &run->pool, &r->tape, functions))
        return 1;
    lag_jets_bind(&r->jets, &run->pool, &r->tape, functions, run->np);
    const int count = (int)(functions->output_count / 2); /* the rest is where they are used */
    r->scale = lag_doubles(&run->pool, count);
    r->singular = lag_get(&run->pool, (size_t)count, sizeof(int));
    r->count = run->pool.failed ? 0 : count;
    return run->pool.failed;
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

/* Whether a change need not be seen. */
static int is_flat(const lag_run *run, int i, lag_interval values)
{
    return values.high - values.low <= FLAT * run->settings.rtol * run->resolution.scale[i];
}

/* Enclose the functions and their derivatives at fixed q and v. */
static void enclose(lag_run *run, double a, double b, int order)
{
    lag_jet_tape *jets = &run->resolution.jets;
    for (int i = 0; i < 2 * run->system.nq + 1; ++i) {
        lag_interval *x = lag_jet_input(jets, i);
        memset(x, 0, JET * sizeof *x);
        x[0] = i ? (lag_interval){run->step.y[i - 1], run->step.y[i - 1]} : (lag_interval){a, b};
        x[1].low = x[1].high = i == 0;
    }
    lag_jets_run(jets, order);
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
    memset(r->scale, 0, (size_t)r->count * sizeof *r->scale);
    for (int k = 0; k < count; ++k) {
        const double half = 0.5 * length[k], a = start[k], middle = a + half;
        enclose(run, middle, middle, 0);
        for (int i = 0; i < r->count; ++i) {
            const lag_interval values = *lag_jet_output(&r->jets, i);
            if (is_used(run, i) && is_bounded(values))
                r->scale[i] = fmax(r->scale[i], lag_interval_size(values));
        }
        int loose = 0;
        enclose(run, a, a + length[k], 0);
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

/* Find the functions that have no bound at a time, or none that is any use. One that overflows matters to what it divides,
 * which is resolved itself. */
static void find_singular(lag_run *run, double t)
{
    lag_resolution *r = &run->resolution;
    enclose(run, t, t, 2);
    for (int i = 0; i < r->count; ++i) {
        const lag_interval *jet = lag_jet_output(&r->jets, i);
        r->singular[i] = !is_bounded(jet[0]) || (!has_bounds(jet) && !is_flat(run, i, jet[0]));
    }
}

/* The largest step between two times that resolves the functions there, other than singular ones. */
static double resolved_between(lag_run *run, double a, double b)
{
    lag_resolution *r = &run->resolution;
    double h = INFINITY;
    enclose(run, a, b, 2);
    for (int i = 0; i < r->count; ++i) {
        const lag_interval *jet = lag_jet_output(&r->jets, i);
        const int bounded = has_bounds(jet);
        const double bend = lag_interval_size(jet[2]), size = lag_interval_size(jet[0]);
        const double scale = r->scale[i] > 0.0 || !bounded ? r->scale[i] : size;
        if (r->singular[i] || !is_used(run, i) || fmax(scale, size) < TINY || is_flat(run, i, jet[0]))
            continue;
        h = fmin(h, bounded ? 2.0 * sqrt(BEND * scale / bend) : 0.0);
    }
    return h;
}

double lag_resolved_step(lag_run *run, double longest)
{
    lag_resolution *r = &run->resolution;
    const double t = run->step.t;
    if (r->jets.stale)
        measure(run);
    else if (t + longest <= r->end && longest <= r->step && t >= r->start)
        return longest;
    find_singular(run, t);
    const double least = LEAST * (run->settings.t_end - run->step.t_start);
    double h = longest;
    for (; h >= least; h *= 0.5)
        for (double steps = AHEAD; steps >= 1.0; steps /= NEARER) {
            const double end = fmin(t + steps * h, run->settings.t_end);
            const double allowed = resolved_between(run, t, end);
            if (allowed < h)
                continue;
            r->start = t;
            r->end = end;
            r->step = allowed;
            return h;
        }
    return fmin(longest, least); /* across a place where one has no bounds */
}
