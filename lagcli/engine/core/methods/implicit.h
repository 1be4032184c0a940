/*
 * The equations linearized at a state, and the linear systems of implicit methods.
 *
 * With y = (q, v, W) and y' = F(t, y), an implicit method solves (s - J) u = r + tau F_t, J = F_y,
 * s about one over the step size. What q' = v and B a = gamma say is eliminated:
 *
 *     u_q = (r_q + u_v) / s,
 *     [[M - G_v/s - G_q/s^2, B'], [B - Gamma_v/s - Gamma_q/s^2, 0]] [u_v; -mu/s]
 *         = [M r_v + G_q r_q/s + tau G_t; B r_v + Gamma_q r_q/s + tau Gamma_t] / s,
 *
 * G = f - M a + B' lambda and Gamma = gamma - B a differentiated at fixed a and lambda
 * (engine/jacobians.py), mu the change of lambda. Where B's rows depend on each other by N, the
 * matrix is bordered by N, as in motion.c.
 */
#ifndef LAGCLI_IMPLICIT_H
#define LAGCLI_IMPLICIT_H

#include "run.h"
#include "linear/sparse.h"

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
    double shift, shift_re, shift_im;  /* of the factors; 0 if there are none */
    int refine;                        /* whether the solutions of the factors need refinement */
    long ordered;                      /* the step for which orders were chosen */
    int orders;                        /* their number */

    double h_accepted;                 /* the last step; 0 before the first */
    double theta, contraction;         /* Radau: Newton's rate of convergence, and the factor of its last change */
    double h_converging;               /* the largest step at which Newton's method is likely to converge */
} lag_implicit;

/* Linearize at (t, y); y' goes to f. Returns 0, or 1 where it is undefined. */
int lag_linearize(lag_run *run, double t, const double *y, double *f);

/* Factor for a shift. Returns 0, or 1 where the order of pivots does not suit the numbers. */
int lag_shift(lag_run *run, double s);
int lag_shift_complex(lag_run *run, double re, double im);

/* Solve (s - J) u = r + tau F_t; u may be r. */
void lag_shifted_solve(lag_run *run, const double *r, double tau, double *u);
void lag_shifted_solve_complex(lag_run *run, double *re, double *im);

/* The status if a matrix cannot be factored: LAG_ORDER if a new order of pivots may help, LAG_RUNNING if only a
 * smaller step can. */
int lag_reorder(lag_run *run);

#endif
