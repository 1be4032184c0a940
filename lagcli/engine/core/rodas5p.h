/* Rodas5P: a Rosenbrock-Wanner method of order 5(4), with dense output of order 4. */
#ifndef LAGCLI_RODAS5P_H
#define LAGCLI_RODAS5P_H

#include "run.h"

/* One accepted step from (t, y) to (t + h, y_new). Returns LAG_RUNNING, LAG_UNDEFINED, LAG_FLOOR or
 * LAG_ORDER. */
int lag_rodas5p_step(lag_run *run);

/* The last step's dense output, n values. */
void lag_rodas5p_dense(lag_run *run, double t, double *y);

#endif
