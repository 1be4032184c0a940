/* Projection onto the constraints. */
#ifndef LAGCLI_PROJECT_H
#define LAGCLI_PROJECT_H

#include "run.h"

#define PROJECTIONS 10      /* Newton steps of a projection; the drift of one step takes two */
#define RESIDUAL 2e-15      /* of the constraint's scale: where a projection ends */
#define NOT_REACHED 1e-10   /* of the scale: beyond it there is no consistent state nearby */
#define LEAST_PART 1e-3     /* of the system's size that a coordinate has at least, by its inertia */
#define FAR 100.0           /* of a step's tolerances: no error of a step moves a coordinate further, ... */
#define FAR_PART 1e-3       /* ... if this is also such a part of the largest size of its kind, ... */
#define FAR_ROUNDING 1e-12  /* ... and of the largest coordinate, in the metric of their inertia */
#define RAISE 2             /* Newton steps after which the least scales are looked at */
#define NEGLIGIBLE 0.01     /* of the tolerance: a projection that moves less leaves f as it is */

/*
 * A constraint's scale is the largest sum of the magnitudes of its terms so far. These may vanish all
 * along a motion. Where Newton steps do not reach RESIDUAL, the scale is therefore raised to the least
 * that B, q and M give it: engine/constraints/scales.py has the formula and the reason.
 */

/* Bring y at t to the constraints. Returns LAG_RUNNING, LAG_UNDEFINED or LAG_OFF. */
int lag_project(lag_run *run, double t, double *y);

/* Onto the constraints of the system alone, without rows that switch. */
int lag_project_system(lag_run *run, double t, double *y);

/* Do so within or after a step; LAG_JUMPED where that moves a coordinate far further than the step's
 * error does: a constraint jumps, or the motion would go on elsewhere. */
int lag_return(lag_run *run, double t, double *y);

#endif
