/* Projection onto the constraints of the system, without switched rows. */
#ifndef LAGCLI_PROJECT_SYSTEM_H
#define LAGCLI_PROJECT_SYSTEM_H

#include "run.h"

#define PROJECTIONS 10      /* Newton steps of a projection; the drift of one step takes two */
#define RESIDUAL 2e-15      /* of the constraint's scale: end of a projection */
#define NOT_REACHED 1e-10   /* of the scale: beyond it no consistent state is nearby */
#define LEAST_PART 1e-3     /* of the system's size: minimum size of a coordinate by its inertia */
#define LEFT_OUT 1e-8       /* of the scale: of velocities, beyond it a row that is left out does not follow from others */
#define RAISE 2             /* Newton steps after which minimum scales are evaluated */

/*
 * A constraint's scale is the largest sum of the magnitudes of its terms so far. These may vanish all
 * along a motion. Where Newton steps do not reach RESIDUAL, the scale is therefore raised to the least
 * that B, q and M give it: engine/scales.py has the formula and the reason.
 */

/* Bring y at t to the constraints. Returns LAG_RUNNING, LAG_UNDEFINED or LAG_OFF. */
int lag_project_system(lag_run *run, double t, double *y);

/* The largest residual of a holonomic constraint at y, of its scale. */
double lag_position_residual(lag_run *run, double t, const double *y);

#endif
