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
 * (engine/system.py: JacobianTapes), mu the change of lambda. Where B's rows depend on each other by N, the
 * matrix is bordered by N, as in solution.c.
 */
#ifndef LAGCLI_IMPLICIT_H
#define LAGCLI_IMPLICIT_H

#include "methods/implicit_data.h"

/* Linearize at (t, y); y' goes to f. Returns 0, or 1 where it is undefined. */
int lag_linearize(lag_run *run, double t, const double *y, double *f);

/* Factor for a shift. Returns 0, or 1 where the order of pivots does not suit the numbers. */
int lag_shift(lag_run *run, double s);
int lag_shift_complex(lag_run *run, double re, double im);

/* Whether F_t is not zero. */
int lag_depends_on_time(const lag_run *run);

/* What rates do to the state in a step: lag_shifted_solve without tau. */
void lag_shifted_noise(lag_run *run, const double *rates, double *change);

/* Solve (s - J) u = r + tau F_t; u may be r, and is r of the complex one. */
void lag_shifted_solve(lag_run *run, const double *r, double tau, double *u);
void lag_shifted_solve_complex(lag_run *run, double *re, double *im, double tau_re, double tau_im);

/* The status if a matrix cannot be factored: LAG_ORDER if a new order of pivots may help, LAG_RUNNING if only a
 * smaller step can. */
int lag_reorder(lag_run *run);

#endif
