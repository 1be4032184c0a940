/* Accelerations and multipliers at a state. */
#ifndef LAGCLI_MOTION_H
#define LAGCLI_MOTION_H

#include "run.h"

#define ACCURATE 0.1        /* of rtol: what the residual of the equations may be, row by row */
#define LEAST_ACCURATE 1e-9 /* the largest and the smallest residual that is asked for */
#define MOST_ACCURATE 1e-12
#define NEXT_TO_ALL 1e-4    /* of the largest row: what a row of small terms is compared with */

/* Size of the state y = (q, v, W). */
int lag_size(const lag_system *system);

/* Evaluate a tape at a state, unless it holds that state; its outputs can be read afterwards. */
void lag_evaluate(const lag_tape *tape, const lag_system *system, double t, const double *y);

/* Write B's rows over their lengths to run->rows, from a tape whose B entries begin at output
 * `first`. Returns 0, or 1 where they are not finite. */
int lag_scaled_rows(lag_run *run, const lag_tape *tape, int first);

/* The squares of the lengths of B's rows (nc), from a tape whose B entries begin at `first`. */
void lag_row_squares(const lag_system *system, const lag_tape *tape, int first, double *sum);

/* psi = B v + b_0 (nc) at the state that the constraint tape holds. */
void lag_velocity_residual(const lag_system *system, const double *y, double *psi);

/* Where the unrolled elimination's outputs begin that tell what its pivots keep; run->kept_count, of
 * which the last nc are the squares of the lengths of B's rows. The other solution follows. */
int lag_first_kept(const lag_run *run);

/* How a and lambda are found now: as run->eliminating says, or densely (0). */
int lag_eliminating(const lag_run *run);

/* Make [[M, B'], [B, 0]], as the dynamics tape holds it, ready for lag_solve. Returns 0, or 1 if it
 * is singular. */
int lag_factor(lag_run *run);

/* Solve [[M, B'], [B, 0]] x = right with the last factors; both have nq + nc entries. `refined` by
 * one step of iterative refinement. right is destroyed. */
void lag_solve(lag_run *run, double *right, double *x, int refined);

/* a, lambda (in run->a, run->multipliers) and the power at a state. Returns 0, or 1 where they are
 * undefined. */
int lag_accelerate(lag_run *run, double t, const double *y, int refined, double *power);

/* y' at a state. Returns 0, or 1 where it is undefined. */
int lag_derivative(lag_run *run, double t, const double *y, double *f);

/* How far the static elimination's a and lambda at a state are from satisfying M a = f + B' lambda,
 * B a = gamma, next to the terms of these; 0 where there is no elimination. */
double lag_inaccuracy(lag_run *run, double t, const double *y);

/* How far they may be. */
double lag_allowed_inaccuracy(const lag_run *run);

/* The 2-norm of x over the tolerances at y and z: every component within its own where <= 1. */
double lag_scaled_norm(const lag_run *run, const double *x, const double *y, const double *z);

#endif
