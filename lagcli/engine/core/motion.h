/* Accelerations and multipliers at a state. */
#ifndef LAGCLI_MOTION_H
#define LAGCLI_MOTION_H

#include "solution.h"

#define ACCURATE 0.1        /* of rtol: acceptable residual of the equations, row by row */
#define LEAST_ACCURATE 1e-9 /* the largest and the smallest acceptable residual */
#define MOST_ACCURATE 1e-12
#define DAMPED 1e-15        /* of a constraint's terms: residuals up to this are rounding errors */
#define NEXT_TO_ALL 1e-4    /* of the largest row: minimum scale of a row with small terms */

/* Size of the state y = (q, v, W). */
int lag_size(const lag_system *system);

/* Parts of a tape: all; for the dynamics, intermediate results for other right sides; for the constraints, phi with
 * its scale, or B, psi and its scale. */
enum lag_part { LAG_ALL, LAG_FACTORS = 1, LAG_POSITIONS = 1, LAG_VELOCITIES = 2 };

/* Evaluate a tape, or a part, at a state, unless it holds that; these outputs can be read
 * afterwards. */
void lag_evaluate(const lag_tape *tape, const lag_system *system, double t, const double *y, int part);

/* Write the rows of B times sizes, over their lengths, of the first blocks to run->rows.scaled, from a tape whose
 * B entries begin at output `first`. Returns 0, or 1 where they are not finite. */
int lag_scaled_rows(lag_run *run, int blocks, const lag_tape *tape, int first);

/* The squares of the lengths of the rows of B times sizes (nc), or of B where sizes is NULL, from a
 * tape whose B entries begin at `first`. */
void lag_row_squares(const lag_system *system, const lag_tape *tape, int first, const double *sizes,
                     double *sum);

/* a, lambda (in run->solver.a, run->solver.multipliers) and the power at a state. Returns 0, or 1 where they are
 * undefined. */
int lag_accelerate(lag_run *run, double t, const double *y, int refined, double *power);

/* The same without the forces of switched rows. */
int lag_accelerate_system(lag_run *run, double t, const double *y, int refined, double *power);

/* y' at a state. Returns 0, or 1 where it is undefined. */
int lag_derivative(lag_run *run, double t, const double *y, double *f);

/* How far the static elimination's a and lambda at a state, refined or not, are from satisfying
 * M a = f + B' lambda, B a = gamma, next to the terms of these; 0 where there is no elimination. */
double lag_inaccuracy(lag_run *run, double t, const double *y, int refined);

/* How far redundant constraints contradict each other in B a = gamma at a state, next to the terms of
 * this; 0 where none is redundant. */
double lag_contradiction(lag_run *run, double t, const double *y);

/* How far a and lambda may be from satisfying them. */
double lag_allowed_inaccuracy(const lag_run *run);

/* Whether they satisfy them that well at a state, which is recorded as that of a failure if they do not. */
int lag_is_accurate(lag_run *run, double t, const double *y);

/* The 2-norm of x over the tolerances at y and z: every component within its own where <= 1. */
double lag_scaled_norm(const lag_run *run, const double *x, const double *y, const double *z);

#endif
