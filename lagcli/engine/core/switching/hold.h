/* Projection onto the active rows. */
#ifndef LAGCLI_HOLD_H
#define LAGCLI_HOLD_H

#include "run.h"

/* Bring y at t, which is on the system's constraints, to the rows that hold, too. Returns LAG_RUNNING or a
 * status of the projection. */
int lag_hold(lag_run *run, double t, double *y);

#endif
