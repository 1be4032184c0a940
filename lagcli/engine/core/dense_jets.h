/* Enclosures of the last step's dense output and of its derivatives. */
#ifndef LAGCLI_DENSE_JETS_H
#define LAGCLI_DENSE_JETS_H

#include "dense_points.h"
#include "memory.h"
#include "run.h"
#include "tape/interval.h"

/* Allocate the control points of `count` states, whose indices in y are in `state`. */
void lag_dense_points_bind(lag_dense_points *d, lag_pool *pool, int count, const int *state);

/* Forget those of the step before. */
void lag_dense_points_begin(lag_dense_points *d);

/* The range of control points, which encloses the polynomial. */
lag_interval lag_range_of(const double *points, int degree);

/* The jet of state `i` of these, from u to v in [0, 1], up to an order. */
void lag_dense_jet(lag_run *run, lag_dense_points *d, int i, double u, double v, int order, lag_interval *jet);

#endif
