/* Control points of the last step's dense output, a polynomial on 0 to 1 (polynomial.h), and of its derivatives. */
#ifndef LAGCLI_DENSE_POINTS_H
#define LAGCLI_DENSE_POINTS_H

#include "memory.h"
#include "tape/interval.h"

typedef struct {
    int count;                         /* of states */
    const int *state;                  /* count: their indices in y */
    int *ready;                        /* count: orders of derivatives whose control points are known */
    int degree;
    double *points;                    /* of each state: control points, and those of the derivatives over factorials */
} lag_dense_points;

/* Allocate those of `count` states, whose indices in y are in `state`. */
void lag_dense_points_bind(lag_dense_points *d, lag_pool *pool, int count, const int *state);

/* Forget those of the step before. */
void lag_dense_points_begin(lag_dense_points *d);

/* The range of control points, which encloses the polynomial. */
lag_interval lag_range_of(const double *points, int degree);

/* The jet of state `i` of these, from u to v in [0, 1], up to an order. */
void lag_dense_jet(lag_run *run, lag_dense_points *d, int i, double u, double v, int order, lag_interval *jet);

#endif
