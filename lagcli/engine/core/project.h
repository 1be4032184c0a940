/* Projection onto the constraints and the active rows. */
#ifndef LAGCLI_PROJECT_H
#define LAGCLI_PROJECT_H

#include "run.h"

#define FAR 100.0           /* of a step's tolerances: largest change by the error of a step, ... */
#define FAR_PART 1e-3       /* ... if this is also such a part of the largest size of its kind, ... */
#define FAR_ROUNDING 1e-12  /* ... and of the largest coordinate, in the metric of their inertia, and of a constraint's terms */
#define NEGLIGIBLE 0.01     /* of the tolerance: a smaller projection leaves f unchanged */

/* Bring y at t to them. Returns LAG_RUNNING, LAG_UNDEFINED or LAG_OFF. */
int lag_project(lag_run *run, double t, double *y);

/* Project within or after a step; LAG_JUMPED if that moves a coordinate much further than the step's error: a
 * constraint jumps, or the motion would continue elsewhere. */
int lag_return(lag_run *run, double t, double *y);

#endif
