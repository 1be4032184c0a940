#include "breaks.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "methods/method.h"
#include "motion.h"
#include "sizes.h"
#include "step.h"
#include "switching/clock.h"

/* The piece of a function from a time on, or before it: its origin and its coefficients. */
static void take_piece(const lag_function *f, double t, int before, double *piece)
{
    const int periodic = f->period > 0.0;
    /* knots of later periods are rounded like sums */
    const double slack = fmax(lag_coincidence(t), periodic ? lag_coincidence(t - f->knots[0]) : 0.0);
    const double at = before ? t - 2.0 * slack - DBL_MIN : t + slack;
    const double shift = periodic ? floor((at - f->knots[0]) / f->period) * f->period : 0.0;
    int64_t low = 0, high = f->count;  /* the piece is in [low, high) */
    while (high - low > 1) {
        const int64_t middle = low + (high - low) / 2;
        if (f->knots[middle] <= at - shift)
            low = middle;
        else
            high = middle;
    }
    piece[0] = f->origins[low] + shift;
    memcpy(piece + 1, f->coefficients + low * (f->degree + 1), (size_t)(f->degree + 1) * sizeof(double));
}

static void pieces(const lag_run *run, double t, int before, double *parameters)
{
    const lag_breaks *b = &run->breaks;
    for (int i = 0; i < b->function_count; ++i)
        take_piece(b->functions + i, t, before, parameters + b->functions[i].first);
}

void lag_pieces_at(const lag_run *run, double t, double *parameters)
{
    pieces(run, t, 0, parameters);
}

/* Set the pieces of the functions from the time on, or before it, in all tapes. */
static void take_pieces(lag_run *run, int before)
{
    pieces(run, run->step.t, before, run->parameters);
    lag_renew_tapes(run);
}

void lag_pieces_before(lag_run *run)
{
    take_pieces(run, 1);
}

void lag_breaks_start(lag_run *run)
{
    lag_breaks *b = &run->breaks;
    while (b->next > 0 && b->times[b->next - 1] > run->step.t)
        --b->next; /* an event may be located before the end of its step */
    while (b->next < b->count && b->times[b->next] <= run->step.t)
        ++b->next;
    lag_set_stop(run);
    if (b->function_count)
        take_pieces(run, 0);
}

int lag_at_break(const lag_run *run)
{
    return run->breaks.next < run->breaks.count && run->breaks.times[run->breaks.next] <= run->step.t;
}

/* y' at the current state, to f. */
static int slope(lag_run *run)
{
    return lag_derivative(run, run->step.t, run->step.y, run->step.f) ? LAG_UNDEFINED : LAG_RUNNING;
}

int lag_pass_break(lag_run *run)
{
    const int n = lag_size(&run->system);
    double *change = run->step.trial;
    if (!run->method->uses_slope && slope(run) != LAG_RUNNING)
        return LAG_UNDEFINED;
    memcpy(change, run->step.f, (size_t)n * sizeof(double));
    lag_breaks_start(run);
    lag_restart(run);
    if (slope(run) != LAG_RUNNING)
        return LAG_UNDEFINED;
    for (int i = 0; i < n; ++i)
        change[i] = run->step.h * (run->step.f[i] - change[i]);
    if (lag_scaled_norm(run, change, run->step.y, run->step.y) > 1.0) {
        lag_sizes_start(run);
        lag_first_step(run, run->method->order);
    }
    return LAG_RUNNING;
}
