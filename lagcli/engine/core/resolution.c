#include "resolution.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "bind.h"

#define BEND 1.2            /* of the largest value: how far a function may bend away from its tangent in half a step */
#define AHEAD 16.0          /* steps for which a limit is computed at once, at first; ... */
#define NEARER 4.0          /* ... then fewer */
#define PARTS 200           /* intervals at most in which the size of an unbounded function is sought, ... */
#define LEVELS 24           /* ... and how often they are halved */
#define NOTHING (DBL_MIN / DBL_EPSILON) /* what is smaller has lost digits */
#define HALVINGS 40         /* of a step; a function that bends more is not resolved by any */
#define SINGULAR 10         /* halvings after which a function without a bound of its curvature is singular there */

int lag_use_explicit_time(lag_run *run, const lag_program *functions)
{
    lag_resolution *r = &run->resolution;
    if (lag_bind(run, &run->pool, &r->tape, functions))
        return 1;
    lag_jets_bind(&r->jets, &run->pool, &r->tape, functions, run->np);
    const int count = (int)(functions->output_count / 2); /* the rest is where they are used */
    r->scale = lag_doubles(&run->pool, count);
    r->count = run->pool.failed ? 0 : count;
    return run->pool.failed;
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

/* Raise the sizes of functions to those between two times, and return whether one that is used there has no bound. In
 * the whole run, bounds count even where functions are not used at this state: they may be at another one. */
static int raise_scales(lag_run *run, double a, double b, int whole)
{
    lag_resolution *r = &run->resolution;
    int unbounded = 0;
    enclose(run, a, b, 0);
    for (int i = 0; i < r->count; ++i) {
        const lag_interval used = *lag_jet_output(&r->jets, r->count + i);
        const double size = lag_interval_size(*lag_jet_output(&r->jets, i));
        const int not_used = used.low == 0.0 && used.high == 0.0;
        if (isfinite(size) && (whole || !not_used))
            r->scale[i] = fmax(r->scale[i], size);
        unbounded |= !isfinite(size) && !not_used;
    }
    return unbounded;
}

/* The sizes that functions have in the run. Where one has no bound, as next to a pole, or beyond the branch in which
 * it is used, the run is halved; where none is found, the size is 0. */
static void measure(lag_run *run)
{
    lag_resolution *r = &run->resolution;
    const double whole = run->settings.t_end - run->step.t;
    double start[LEVELS + 1] = {run->step.t}, length[LEVELS + 1] = {whole};
    int waiting = 1;
    lag_jets_refresh(&r->jets);
    memset(r->scale, 0, (size_t)r->count * sizeof *r->scale);
    for (int k = 0; waiting > 0 && k < PARTS; ++k) {
        const double a = start[--waiting], half = 0.5 * length[waiting];
        if (!raise_scales(run, a, a + 2.0 * half, k == 0) || ldexp(half, LEVELS) < whole)
            continue;
        start[waiting] = a + half;
        start[waiting + 1] = a;
        length[waiting] = length[waiting + 1] = half;
        waiting += 2;
    }
}

/* The largest step between two times that resolves the functions there, `singular`: that have a bound. */
static double resolved_between(lag_run *run, double a, double b, int singular)
{
    lag_resolution *r = &run->resolution;
    double h = INFINITY;
    enclose(run, a, b, 2);
    for (int i = 0; i < r->count; ++i) {
        const lag_interval *jet = lag_jet_output(&r->jets, i), used = *lag_jet_output(&r->jets, r->count + i);
        const double bend = lag_interval_size(jet[2]), size = lag_interval_size(jet[0]);
        if ((used.low == 0.0 && used.high == 0.0) || fmax(size, r->scale[i]) < NOTHING)
            continue;
        const double scale = r->scale[i] > 0.0 ? r->scale[i] : isfinite(size) ? size : 0.0;
        if (bend > 0.0 && !(singular && isinf(bend)))
            h = fmin(h, 2.0 * sqrt(BEND * scale / bend));
    }
    return h;
}

double lag_resolved_step(lag_run *run, double h)
{
    lag_resolution *r = &run->resolution;
    const double t = run->step.t, longest = h;
    if (r->jets.stale)
        measure(run);
    else if (t + h <= r->end && h <= r->step && t >= r->start)
        return h;
    for (int i = 0; i < HALVINGS; ++i, h *= 0.5)
        for (double steps = AHEAD; steps >= 1.0; steps /= NEARER) {
            const double end = fmin(t + steps * h, run->settings.t_end);
            const double allowed = resolved_between(run, t, end, i >= SINGULAR);
            if (allowed < h)
                continue;
            r->start = t;
            r->end = end;
            r->step = allowed;
            return h;
        }
    return longest;
}
