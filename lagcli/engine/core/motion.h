/* The motion: accelerations and multipliers at a state, and y'. */
#ifndef LAGCLI_MOTION_H
#define LAGCLI_MOTION_H

#include "equations.h"

/* a, lambda (in run->solver.a, run->solver.multipliers) and the power at a state. Returns 0, or 1 where they are
 * undefined. */
int lag_accelerate(lag_run *run, double t, const double *y, int refined, double *power);

/* The same where no step ends, so that nothing else checks how accurate the elimination is: if it is not, the dense solution is
 * used, until solver.dense_steps is set back. */
int lag_accelerate_accurately(lag_run *run, double t, const double *y, int refined, double *power);

/* The same for this state alone: solver.dense_steps is set back. */
int lag_accelerate_alone(lag_run *run, double t, const double *y, int refined, double *power);

/* y' at a state. Returns 0, or 1 where it is undefined. */
int lag_derivative(lag_run *run, double t, const double *y, double *f);

/* The 2-norm of x over the tolerances at y and z: every component within its own where <= 1. */
double lag_scaled_norm(const lag_run *run, const double *x, const double *y, const double *z);

#endif
