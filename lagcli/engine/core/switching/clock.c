#include "switching/clock.h"

#include <math.h>

#include "step.h"
#include "switching/watched.h"

/* The time of a tick by its number, rounded once. */
static double time_of(const lag_clock *c, double number)
{
    return fma(number, c->step, c->first) / c->per;
}

void lag_clocks_start(lag_run *run)
{
    const double t = run->step.t;
    for (int i = 0; i < run->switching.clocks; ++i) {
        lag_clock *c = run->switching.clock + i;
        if (c->begun)
            continue;
        c->begun = 1;
        c->number = fmax(0.0, floor((t - time_of(c, 0.0)) * c->per / c->step) - 1.0);
        while (time_of(c, c->number) < t - lag_coincidence(t))
            c->number += 1.0;
        c->next = c->left > 0 ? time_of(c, c->number) : INFINITY;
    }
}

double lag_next_tick(const lag_run *run)
{
    double next = INFINITY;
    for (int i = 0; i < run->switching.clocks; ++i)
        next = fmin(next, run->switching.clock[i].next);
    return next;
}

void lag_set_stop(lag_run *run)
{
    const lag_breaks *b = &run->breaks;
    const double tick = lag_next_tick(run);
    const double stop = b->next < b->count ? fmin(b->times[b->next], run->settings.t_end) : run->settings.t_end;
    run->step.t_stop = tick < stop - lag_coincidence(stop) ? tick : stop;
}

int lag_ticks_at(const lag_run *run, double t)
{
    return lag_next_tick(run) <= t + lag_coincidence(t);
}

int lag_join_ticks(lag_run *run, int found)
{
    lag_switching *sw = &run->switching;
    const double t = run->step.t;
    if (!lag_ticks_at(run, t) || (found && sw->instant < t - lag_one_instant(run, t)))
        return found;
    if (!found)
        for (int k = 0; k < sw->watched_count; ++k)
            sw->watched[k].hit = 0;
    sw->instant = t;
    return 1;
}

void lag_note_ticks(lag_run *run)
{
    lag_switching *sw = &run->switching;
    for (int i = 0; i < sw->clocks; ++i) {
        lag_clock *c = sw->clock + i;
        c->ticks = c->next <= sw->instant + lag_coincidence(sw->instant);
        if (!c->ticks)
            continue;
        sw->report = 1;
        c->number += 1.0;
        c->next = --c->left > 0 ? time_of(c, c->number) : INFINITY;
    }
    if (sw->clocks)
        lag_set_stop(run);
}
