/* Watched functions, which are positive as long as a mode lasts. */
#ifndef LAGCLI_WATCHED_H
#define LAGCLI_WATCHED_H

#include "run.h"

#define WRONG 1e4           /* times the rounding error of a condition: it is on its other side */
#define EXACT_TIME 1e-14    /* of the step, in addition to the rounding of the time: accuracy of an instant */
#define RESOLVED 4.0        /* errors of a root: a function that changes its sign there may do so a second time, due to
                               rounding */
#define SOON 1e-3           /* of a step: time after which a growing function is positive beyond rounding */

/* Begin to watch what the modes at (t, y), where y' is f, ask for. All count as positive there but
 * conditions, whose states are as `condition` says. Returns LAG_RUNNING or LAG_UNDEFINED. */
int lag_watch_modes(lag_run *run, double t, const double *y, const double *f);

/* Which functions to evaluate: all, or those of a and lambda, which are not enclosed. */
enum lag_of { LAG_WATCHED, LAG_SAMPLED };

/* How far roots at t may be apart and are at one instant. */
double lag_one_instant(const lag_run *run, double t);

/* Values of watched functions at a state. Returns 0, or 1 where they are undefined. */
int lag_watched_values(lag_run *run, enum lag_of which, double t, const double *y, double *values);

/* The same, and their rates by difference quotients along y' = f. */
int lag_watched_ends(lag_run *run, enum lag_of which, double t, const double *y, const double *f, double *values,
                     double *slopes);

/* The value of one function of (t, q, v) at a state. */
double lag_watched_value(lag_run *run, const lag_watched_function *w, double t, const double *y);

/* Continue after a step without an instant, with the values and rates of functions of a and lambda at its end. Returns 0,
 * or 1 where a gap is undefined. */
int lag_watch_on(lag_run *run, double t, const double *y, const double *values, const double *slopes);

/* The least value below zero of a function that is not a rounding error. */
double lag_watched_noise(lag_run *run, const lag_watched_function *w);

/* Rounding errors of the value of a condition. */
double lag_condition_noise(const lag_condition *condition);

/* Whether a contact that opens is closed again where the last step ends, in which the dense output may be off its gap:
 * when it closes is known from shorter steps. */
int lag_penetrates(lag_run *run);

/* Whether a function may become negative without an effect: that of a condition that triggers when it begins. */
int lag_ends_silently(const lag_switching *sw, const lag_watched_function *w);

/* a and lambda at a state, of all constraints: run->solver.a, run->switching.multipliers. Returns 0, or 1. */
int lag_all_forces(lag_run *run, double t, const double *y);

/* Choose the signs of functions of forces at the end of an instant: the present ones, except those that have turned or
 * do not agree with the forces. Returns LAG_RUNNING, LAG_UNDEFINED or LAG_NO_SIDE. */
int lag_choose_sides(lag_run *run);

/* The value of a condition at a state, which rises through zero as the condition becomes true. */
double lag_condition_value(lag_run *run, int which, double t, const double *y);

#endif
