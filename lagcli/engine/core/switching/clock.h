/* Clocks: events at counted instants, at which steps end. */
#ifndef LAGCLI_CLOCK_H
#define LAGCLI_CLOCK_H

#include "run.h"

/* Begin at run->step.t, once: find the first tick of each clock. */
void lag_clocks_start(lag_run *run);

/* The time of the next tick; infinity if there is none. */
double lag_next_tick(const lag_run *run);

/* Let steps end at the next break, at the next tick of a clock, or at the end of the run. */
void lag_set_stop(lag_run *run);

/* Whether a clock ticks at a time. */
int lag_ticks_at(const lag_run *run, double t);

/* After a search for an instant in the last step, which has found one or not: if a clock ticks at its end, the instant
 * is there, unless it is earlier. Returns whether there is an instant. */
int lag_join_ticks(lag_run *run, int found);

/* Note the clocks that tick at the instant, and find their next ticks. */
void lag_note_ticks(lag_run *run);

#endif
