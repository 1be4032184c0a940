/* Taylor coefficients of a motion, order by order. The programs are those of engine/taylor/series.py. */
#ifndef LAGCLI_SERIES_H
#define LAGCLI_SERIES_H

#include "tape/tape.h"

/* A program bound to its file. Orders begin at `origin` and are `layer` numbers apart; the state's
 * series, t, q, v, W, have their offsets there. */
typedef struct {
    lag_tape values;                   /* order 0: invariant numbers, what series begin with, a, power */
    const int32_t *stream;
    double *known;                     /* partial sums of each convolution's next coefficient */
    int count;                         /* of convolutions */
    double *file;
    int order;                         /* 0: there is no program */
    int invariant, numbers;            /* number of constant numbers; number including those of each state */
    int begin_count;                   /* how many series other than the state's begin, and where */
    const int32_t *begins;
    int origin, layer;
    const int32_t *state;
} lag_series;

/* Update the numbers that are constant along a run. */
void lag_series_invariant(const lag_series *series);

/* Find the coefficients up to the program's order at a state y of n = 2 nq + 1 numbers. Returns 0,
 * or 1 where they are not finite. */
int lag_series_expand(const lag_series *series, int nq, double t, const double *y);

/* The state at a time h after that of the coefficients. */
void lag_series_sum(const lag_series *series, int n, double h, double *y);

/* The derivatives of the state's components m, m + 1, ... there. */
void lag_series_slope(const lag_series *series, int m, int count, double h, double *slope);

/* Coefficient k of the state's component m. */
#define COEFFICIENT(series, m, k)                                                                 \
    ((series)->file[(series)->origin + (series)->state[1 + (m)] + (k) * (series)->layer])

#endif
