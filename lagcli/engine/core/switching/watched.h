/* Watched functions: positive as long as a mode lasts. */
#ifndef LAGCLI_WATCHED_H
#define LAGCLI_WATCHED_H

#include "run.h"

/* Begin to watch what the modes at (t, y), where y' is f, ask for. All count as positive there but
 * conditions, whose states are as `condition` says. Returns LAG_RUNNING or LAG_UNDEFINED. */
int lag_watch_modes(lag_run *run, double t, const double *y, const double *f);

/* Values of the watched functions at a state. Returns 0, or 1 where they are undefined. */
int lag_watched_values(lag_run *run, double t, const double *y, double *values);

/* Look for the first instant of the last step at which a watched function becomes negative. Returns 1 with
 * `instant` and `hit` set; 0 where there is none, and the next step is ready to be watched; -1 where
 * something is undefined. */
int lag_find_instant(lag_run *run);

/* a and lambda at a state, of all constraints: run->solver.a, run->switching.multipliers. Returns 0, or 1. */
int lag_all_forces(lag_run *run, double t, const double *y);

/* The value of a condition at a state, which rises through zero as the condition becomes true. */
double lag_condition_value(lag_run *run, int which, double t, const double *y);

#endif
