/* Radau IIA of order 5 with simplified Newton steps, after Hairer & Wanner's RADAU5. */
#ifndef LAGCLI_RADAU5_H
#define LAGCLI_RADAU5_H

#include "run.h"

/* Forget the last step: the next has nothing to continue. */
void lag_radau5_restart(lag_run *run);

/* One accepted step from (t, y) to (t + h, y_new). Returns LAG_RUNNING, LAG_UNDEFINED, LAG_FLOOR or
 * LAG_ORDER. */
int lag_radau5_step(lag_run *run);

/* The last step's dense output, n values: the collocation polynomial. */
void lag_radau5_dense(lag_run *run, double t, double *y);

#endif
