/* Monitoring of singular configurations, in which B loses rank momentarily. */
#ifndef LAGCLI_WATCH_H
#define LAGCLI_WATCH_H

#include "run.h"

#define NEAR 0.3            /* of its largest value: smallest pivot near a singular configuration */
#define CERTAIN 0.5         /* part of the least pivot that the least singular value is not below */

/* Whether B, of the motion, has too many rows to orthogonalize them where factors tell as much. */
int lag_many_rows(const lag_run *run);

/* The least pivot of the row-scaled B, at most about 1, or its least singular value where B is large;
 * near 0 in a singular configuration. */
double lag_least_pivot(lag_run *run, double t, const double *y);

/* Begin to monitor at the current state. */
void lag_watch_restart(lag_run *run);

/* Begin to monitor a step. */
void lag_watch_step(lag_run *run);

/* Keep what shows at a stage of a step, at time t, that B may be losing rank; the stage was accelerated last. */
void lag_watch_stage(lag_run *run, double t);

/* Keep ln |det| of the last factors at a stage of a step, at time t, if there are many rows. */
void lag_watch_determinant(lag_run *run, double t);

/* Whether ln |det| is nearly a parabola at the stages of a step, which 2 ln |t - s| is not: whether B keeps its rank. */
int lag_is_smooth_in_step(const lag_determinant *determinant);

/* Whether a step is much shorter than the largest one before it. */
int lag_slows(double largest_step, double h);

/* Continue at the end of the last step. */
void lag_watch_accept(lag_run *run);

/* y' at a stage of a step, keeping what shows there that B may be losing rank. Returns 0, or 1 where
 * it is undefined. */
int lag_stage(lag_run *run, double t, const double *y, double *f);

/* Record the largest length of each row of B; the constraint tape contains the state. */
void lag_measure(lag_run *run);

/* Whether the last step may have passed a singular configuration. */
int lag_stepped_over(lag_run *run);

/* Whether the state after the last step, which was not stepped over, is nearer to a singular configuration than the
 * one before. */
int lag_approaches(lag_run *run);

/* After a step: limit the next one where the last steps approach a singular configuration. Returns LAG_RUNNING; LAG_NEAR
 * where the path ahead is to be examined; LAG_FLOOR where rounding errors keep the motion from going on. */
int lag_follow_approach(lag_run *run);

#endif
