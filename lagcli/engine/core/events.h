/* Events: where a function of (t, q, v) changes its sign along the motion. */
#ifndef LAGCLI_EVENTS_H
#define LAGCLI_EVENTS_H

#include "run.h"

/* Begin at (t, y): an event that has just occurred does not occur again. */
void lag_events_start(lag_run *run);

/* Look for the first event of the last step after `since`, and sample up to it. Returns LAG_EVENT,
 * LAG_RUNNING where there is none, or what went wrong. */
int lag_events_look(lag_run *run);

#endif
