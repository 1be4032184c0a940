/* Projection onto the constraints. */
#ifndef LAGCLI_PROJECT_H
#define LAGCLI_PROJECT_H

#include "run.h"

#define PROJECTIONS 10      /* Newton steps of a projection; the drift of one step takes two */
#define RESIDUAL 2e-15      /* of the constraint's scale: end of a projection */
#define NOT_REACHED 1e-10   /* of the scale: beyond it no consistent state is nearby */
#define LEAST_PART 1e-3     /* of the system's size: minimum size of a coordinate by its inertia */
#define FAR 100.0           /* of a step's tolerances: largest change by the error of a step, ... */
#define FAR_PART 1e-3       /* ... if this is also such a part of the largest size of its kind, ... */
#define FAR_ROUNDING 1e-12  /* ... and of the largest coordinate, in the metric of their inertia */
#define RAISE 2             /* Newton steps after which minimum scales are evaluated */
#define NEGLIGIBLE 0.01     /* of the tolerance: a smaller projection leaves f unchanged */

/*
 * A constraint's scale is the largest sum of the magnitudes of its terms so far. These may vanish all
 * along a motion. Where Newton steps do not reach RESIDUAL, the scale is therefore raised to the least
 * that B, q and M give it: engine/constraints/scales.py has the formula and the reason.
 */

/* Bring y at t to the constraints. Returns LAG_RUNNING, LAG_UNDEFINED or LAG_OFF. */
int lag_project(lag_run *run, double t, double *y);

/* Project onto the constraints of the system, without switched rows. */
int lag_project_system(lag_run *run, double t, double *y);

/* Project within or after a step; LAG_JUMPED if that moves a coordinate much further than the step's error: a
 * constraint jumps, or the motion would continue elsewhere. */
int lag_return(lag_run *run, double t, double *y);

#endif
