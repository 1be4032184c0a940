/* The step of a run: its size, its acceptance, and its dense output. */
#ifndef LAGCLI_STEP_H
#define LAGCLI_STEP_H

#include <float.h>

#include "run.h"

#define RESOLUTION (16.0 * DBL_EPSILON) /* of |t|: closer times coincide */

/* The difference from t of times that coincide with it. */
double lag_coincidence(double t);

/* Begin to try a step. Returns its size, limited by t_stop; 0 if it is below the minimum. */
double lag_step_size(lag_run *run);

/* Accept a step of size h to y_new; the next is larger by a factor. */
void lag_accept(lag_run *run, double h, double factor);

/* Discard the last step: the next one does not continue it. */
void lag_restart(lag_run *run);

/* The last step's dense output, n values. */
void lag_dense(lag_run *run, double t, double *y);

/* Whether v' of the dense output is not the accelerations there: its error is not controlled, and may be far larger than
 * that of the step near the limit of stability. If so, it strays until the next step. */
int lag_strays(lag_run *run, double t, const double *a);

/* The state at a time within the last step: its dense output or, where it strays, a step of its own from the same
 * beginning. */
void lag_go_to(lag_run *run, double t, double *y);

/* The same with different rounding, for frequent evaluation in one step. */
void lag_dense_often(lag_run *run, double t, double *y);

#endif
