/* Events: where a function of (t, q, v) changes its sign along the motion. */
#ifndef LAGCLI_EVENTS_H
#define LAGCLI_EVENTS_H

#include <stdint.h>

#include "tape.h"

struct lag_run;

typedef struct {
    int count;                         /* 0: there are none to look for */
    lag_tape tape;                     /* their functions */
    int32_t *sign, *after;             /* count: at `since` and later; 0 where not known yet */
    double since;                      /* up to where the last step was searched */
    double time;                       /* of the last event */
    int which, direction;              /* which it was; 1 where its function rises, else -1 */
    int located;                       /* whether it lies ahead of the samples */
    double *y;                         /* 2 nq + 1: the state there, on the constraints */
} lag_events;

/* Begin at (t, y): what has just happened does not happen again. */
void lag_events_start(struct lag_run *run);

/* Look for the first event of the last step after `since`, and sample up to it. Returns LAG_EVENT,
 * LAG_RUNNING where there is none, or what went wrong. */
int lag_events_look(struct lag_run *run);

#endif
