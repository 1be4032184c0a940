/* Accelerations and multipliers at a state. */
#ifndef LAGCLI_MOTION_H
#define LAGCLI_MOTION_H

#include "run.h"

/* Size of the state y = (q, v, W). */
int lag_size(const lag_system *system);

/* Order of the linear system. */
int lag_order(const lag_run *run);

/* Evaluate a tape at a state; its outputs can be read afterwards. */
void lag_evaluate(const lag_tape *tape, const lag_system *system, double t, const double *y);

/* Write B's rows over their lengths to run->rows, from a tape whose B entries begin at output
 * `first`. Returns 0, or 1 where they are not finite. */
int lag_scaled_rows(lag_run *run, const lag_tape *tape, int first);

/* Factor [[M, B'], [B, 0]] as the dynamics tape holds it. Returns 0, or 1 if it is singular. */
int lag_factor(lag_run *run);

/* a and -lambda over the weights (in run->solution) and the power at a state; `refined` by one step
 * of iterative refinement. Returns 0, or 1 where they are undefined. */
int lag_accelerate(lag_run *run, double t, const double *y, int refined, double *power);

/* y' at a state. Returns 0, or 1 where it is undefined. */
int lag_derivative(lag_run *run, double t, const double *y, double *f);

/* The 2-norm of x over the tolerances at y and z: every component within its own where <= 1. */
double lag_scaled_norm(const lag_run *run, const double *x, const double *y, const double *z);

#endif
