/* Data of implicit methods in a run; methods/implicit.h states the linear systems. */
#ifndef LAGCLI_IMPLICIT_DATA_H
#define LAGCLI_IMPLICIT_DATA_H

#include "linear/sparse.h"
#include "run.h"

/* A block of derivatives: places are row * nq + column, values begin at an output. */
typedef struct {
    int count, first;
    const int32_t *places;
} lag_part_of_jacobian;

typedef struct lag_implicit {
    lag_tape variation;
    lag_part_of_jacobian force_position, force_velocity, rhs_position, rhs_velocity;
    lag_part_of_jacobian power_position, power_velocity;

    /* at the state of the last linearization */
    double *mass, *jacobian;           /* nm, nb: entries of M and B */
    double *border;                    /* (nc - rank) * nc: N */
    double *derivatives;               /* outputs of the variation tape */
    double *velocity;                  /* nq: v */

    /* the matrix: entries by rows, and destinations of the parts' entries, in the order M, G_v, G_q, B', B, Gamma_v,
     * Gamma_q, N, N' */
    int n, count;                      /* order nq + nc + nc - rank, entries */
    const int32_t *start, *columns;
    const int32_t *parts;
    double *matrix;                    /* count */
    double *matrix_re, *matrix_im;     /* count: for a complex shift */

    lag_pool pivots_pool;
    lag_pivots order;                  /* n is 0 if there is none yet */
    double *factors, *complex_re, *complex_im;
    double *right, *right_im, *residual;   /* n each */
    double *work;                      /* 2 n */
    double *quotient, *zero;           /* nq each: r_q/s, and zeros */
    double *atol;                      /* of Radau's error estimate; as many as numbers of the state */
    double shift, shift_re, shift_im;  /* of the factors; 0 if there are none */
    int refine;                        /* whether the solutions of the factors need refinement */
    int64_t ordered;                   /* the step for which orders were chosen */
    int orders;                        /* their number */

    double h_accepted;                 /* the last step; 0 before the first */
    double theta, contraction;         /* Radau: Newton's rate of convergence, and the factor of its last change */
    double h_converging;               /* the largest step at which Newton's method is likely to converge */
} lag_implicit;

#endif
