/* Dormand and Prince's explicit method of order 8(5, 3), with dense output of order 7. */
#ifndef LAGCLI_DOP853_H
#define LAGCLI_DOP853_H

#include "run.h"

#define STABLE 6.1          /* h times the dominant eigenvalue: the edge of the stable region */
#define NOT_STIFF 6         /* steps inside it after which the count begins anew */

/* One accepted step from (t, y, f) to (t + h, y_new, f_new). Returns LAG_RUNNING,
 * LAG_UNDEFINED or LAG_FLOOR. */
int lag_dop853_step(lag_run *run);

/* The last step's dense output, n values. */
void lag_dop853_dense(lag_run *run, double t, double *y);

#endif
