/* Taylor's method: steps of high order by the power series of the motion. */
#ifndef LAGCLI_TAYLOR_H
#define LAGCLI_TAYLOR_H

#include "run.h"

/* One accepted step from (t, y) to (t + h, y_new). Where there is no series (a static elimination
 * that fails there) DOP853 takes it. Returns LAG_RUNNING, LAG_UNDEFINED or LAG_FLOOR. */
int lag_taylor_step(lag_run *run);

/* The last step's dense output, n values. */
void lag_taylor_dense(lag_run *run, double t, double *y);

#endif
