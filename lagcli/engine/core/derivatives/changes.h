/* The changes of a motion along directions, between instants. */
#ifndef LAGCLI_CHANGES_H
#define LAGCLI_CHANGES_H

#include "run.h"

/* The changes of a direction in a state: delta q, then delta v. */
double *lag_change(const lag_run *run, double *y, int k);
lag_direction lag_direction_of(const lag_run *run, const double *y, int k, double time);

/* Evaluate the derivative of a tape of (t, q, v, p), or of (t, q, v, a, lambda, signs, p), along a direction. The
 * latter with the changes of a (nq), and of lambda of all constraints by those of the system's and of the rows' z;
 * signs are constant. */
void lag_evaluate_along(const lag_run *run, const lag_tape *tape, double t, const double *y, lag_direction d);
void lag_evaluate_laws_along(const lag_run *run, const lag_tape *tape, double t, const double *y, lag_direction d,
                             const double *of_a, const double *of_z);

/* The changes of a, lambda and z along directions at (t, y), where the motion's have been found last, to of_a and
 * of_z. Returns 0, or 1 where they are undefined. */
int lag_differentiate(lag_run *run, double t, const double *y, int count, const lag_direction *directions);

/* Solve a matrix of n rows (row by row) for right, in its place; with the least norm where its rows depend on each
 * other. memory: 6 n n + 6 n numbers; n pivots. */
void lag_solve_square(int n, const double *matrix, int *pivots, double *right, double *memory);

/* The rates of the changes in y, to the end of f. Returns 0, or 1. */
int lag_rates_of_changes(lag_run *run, double t, const double *y, double *f);

/* The change of psi of a row of the layer along a direction, for the tape of the rows evaluated along it. */
double lag_change_of_speed(const lag_run *run, int row, const double *v, const double *of_v);

/* Move the changes in y onto the linearized constraints that are active, by the least corrections in terms of M.
 * Returns 0, or 1. */
int lag_project_changes(lag_run *run, double t, double *y);

/* Write the changes of q, v, a and lambda of all directions at a state whose a and lambda have been found: NaN where
 * there are none, or of multipliers that are not unique. Returns 0, or 1. */
int lag_write_changes(lag_run *run, double t, const double *y, double *row);

/* How many numbers these are. */
int lag_width_of_changes(const lag_run *run);

#endif
