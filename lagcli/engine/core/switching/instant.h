/* Instants: handling of the ends of modes. */
#ifndef LAGCLI_INSTANT_H
#define LAGCLI_INSTANT_H

#include "run.h"

/* Determine the modes at the start of a run. Returns a lag_status. */
int lag_begin_modes(lag_run *run);

/* At the start of a run, in its modes: an instant is due there if a clock ticks. Returns a lag_status. */
int lag_begin_ticks(lag_run *run);

/* Between steps: begin an instant here, for changes of parameters by the caller that follow. Returns a lag_status. */
int lag_begin_change(lag_run *run);

/* After an accepted step: end it at the first instant in it, if there is one, with the samples before.
 * Returns LAG_RUNNING; sw->due says whether an instant is to be done; or another status. */
int lag_look_for_instant(lag_run *run);

/* Pass a break (lag_pass_break). An instant begins there if a jump of an input ends a mode or makes a condition true, as
 * sw->due says. Returns a lag_status. */
int lag_pass_row(lag_run *run);

/* Whether a contact force grows without bound at (run->step.t, run->step.y), while something slips: steps become small
 * there, or equations undefined in them. */
int lag_jams(lag_run *run);

/* Do what is due at (run->step.t, run->step.y), and restart there. Returns LAG_RUNNING; LAG_HAPPENED where the
 * program that drives the run has something to do before; or what went wrong. */
int lag_do_instant(lag_run *run);

#endif
