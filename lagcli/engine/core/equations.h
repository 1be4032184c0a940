/* Solution of the equations at a state: accelerations, multipliers, and how accurate they are. */
#ifndef LAGCLI_EQUATIONS_H
#define LAGCLI_EQUATIONS_H

#include "solution.h"

#define ACCURATE 0.1        /* of rtol: acceptable residual of the equations, row by row */
#define LEAST_ACCURATE 1e-9 /* the largest and the smallest acceptable residual */
#define MOST_ACCURATE 1e-12
#define DAMPED 1e-15        /* of a constraint's terms: residuals up to this are rounding errors */
#define NEXT_TO_ALL 1e-4    /* of the largest row: minimum scale of a row with small terms */

/* a, lambda (in run->solver.a, run->solver.multipliers) and the power at a state, without the forces of switched
 * rows. Returns 0, or 1 where they are undefined. */
int lag_accelerate_system(lag_run *run, double t, const double *y, int refined, double *power);

/* The same with these forces, on the branches that the parameters state. */
int lag_accelerate_on_branch(lag_run *run, double t, const double *y, int refined, double *power);

/* How far the static elimination's a and lambda at a state, refined or not, are from satisfying
 * M a = f + B' lambda, B a = gamma, next to the terms of these; 0 where there is no elimination. The
 * residual is left in run->step.work. */
double lag_inaccuracy(lag_run *run, double t, const double *y, int refined);

/* The same of a and lambda that lag_accelerate_system has found at a state, directly after it. */
double lag_inaccuracy_of_last(lag_run *run, double t, const double *y);

/* How far redundant constraints contradict each other in B a = gamma at a state, next to the terms of
 * this; 0 where none is redundant. Where rows are left out: how far a is from satisfying these. */
double lag_contradiction(lag_run *run, double t, const double *y);

/* How far a and lambda may be from satisfying them. */
double lag_allowed_inaccuracy(const lag_run *run);

/* Whether they satisfy them that well at a state, which is recorded as that of a failure if they do not. */
int lag_is_accurate(lag_run *run, double t, const double *y);

#endif
