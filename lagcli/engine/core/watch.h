/* The watch for singular configurations: where B loses rank in passing. */
#ifndef LAGCLI_WATCH_H
#define LAGCLI_WATCH_H

#include "run.h"

#define NEAR 0.3            /* of its largest value: the least pivot next to a singular place */
#define STEADY 0.7          /* of the most that pivots kept during a step: less needs a closer look */

/* The least pivot of the row-scaled B, at most about 1, or its least singular value where B is large;
 * near 0 in a singular configuration. */
double lag_least_pivot(lag_run *run, double t, const double *y);

/* Begin to watch a step. */
void lag_watch_step(lag_run *run);

/* Keep what shows at a stage of a step that B may be losing rank; the stage was accelerated last. */
void lag_watch_stage(lag_run *run);

/* y' at a stage of a step, keeping what shows there that B may be losing rank. Returns 0, or 1 where
 * it is undefined. */
int lag_stage(lag_run *run, double t, const double *y, double *f);

/* Keep the largest length that each row of B has had; the constraint tape holds the state. */
void lag_measure(lag_run *run);

/* Whether the least pivot passes a small minimum inside the last step. */
int lag_stepped_over(lag_run *run);

/* Whether the state after the last step is nearer to a singular configuration than the one before. */
int lag_approaches(lag_run *run);

#endif
