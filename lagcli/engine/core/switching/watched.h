/* Watched functions, which are positive as long as a mode lasts. */
#ifndef LAGCLI_WATCHED_H
#define LAGCLI_WATCHED_H

#include "run.h"

#define SOON 1e-3           /* of a step: time after which a growing function is positive beyond rounding */

/* Begin to watch what the modes at (t, y), where y' is f, ask for. All count as positive there but
 * conditions, whose states are as `condition` says. Returns LAG_RUNNING or LAG_UNDEFINED. */
int lag_watch_modes(lag_run *run, double t, const double *y, const double *f);

/* Values of the watched functions at a state. Returns 0, or 1 where they are undefined. */
int lag_watched_values(lag_run *run, double t, const double *y, double *values);

/* The same, and their rates by difference quotients along y' = f. */
int lag_watched_ends(lag_run *run, double t, const double *y, const double *f, double *values, double *slopes);

/* Continue after a step without an instant, with the values and rates at its end. */
void lag_watch_on(lag_run *run, double t, const double *y, const double *values, const double *slopes);

/* Whether a function may become negative without an effect: that of a condition that triggers when it begins. */
int lag_ends_silently(const lag_switching *sw, const lag_watched_function *w);

/* Whether a function depends only on t, and its value then. */
int lag_is_of_time(const lag_switching *sw, const lag_watched_function *w);
double lag_value_at_time(lag_run *run, const lag_watched_function *w, double t);

/* a and lambda at a state, of all constraints: run->solver.a, run->switching.multipliers. Returns 0, or 1. */
int lag_all_forces(lag_run *run, double t, const double *y);

/* How far below zero a condition that is true is still not over: it would become true again at once. */
double lag_no_change(const lag_condition *condition);

/* The value of a condition at a state, which rises through zero as the condition becomes true. */
double lag_condition_value(lag_run *run, int which, double t, const double *y);

#endif
