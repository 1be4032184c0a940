/* Projection onto the constraints. */
#ifndef LAGCLI_PROJECT_H
#define LAGCLI_PROJECT_H

#include "run.h"

#define PROJECTIONS 10      /* Newton steps of a projection; the drift of one step takes two */
#define RESIDUAL 2e-15      /* of the constraint's scale: where a projection ends */
#define NOT_REACHED 1e-10   /* of the scale: beyond it there is no consistent state nearby */

/* Bring y at t to the constraints. Returns LAG_RUNNING, LAG_UNDEFINED or LAG_OFF. */
int lag_project(lag_run *run, double t, double *y);

#endif
