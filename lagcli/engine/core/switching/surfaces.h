/* Surfaces at which branches change: the functions of kinks (kinks.h). */
#ifndef LAGCLI_SURFACES_H
#define LAGCLI_SURFACES_H

#include "run.h"

/* The bound of a kink's branch in a direction. */
double lag_kink_bound(const lag_run *run, int kink, double direction);

/* A kink's function less that bound, at the state that its tape holds: the branch
 * lasts while direction times that is positive. */
double lag_kink_distance(const lag_run *run, int kink, double direction);

/* The size of a kink's terms there. */
double lag_kink_size(const lag_run *run, int kink);

/* By how much the function of the surface on which the motion slides is off it. */
double lag_off_surface(lag_run *run, double t, const double *y);

#endif
