/* Rows at a state, and their forces. */
#ifndef LAGCLI_ROWS_H
#define LAGCLI_ROWS_H

#include "run.h"

/* Whether a row is active: it holds or slips. */
int lag_row_acts(const lag_switching *sw, int row);

/* The direction in which a row slips: 1, -1, or 0. */
int lag_row_slips(const lag_switching *sw, int row);

/* phi, psi, gamma and B of all rows. Returns 0, or 1 if they are not finite. */
int lag_find_rows(lag_run *run, double t, const double *y);

/* Update the scales of phi and psi at a state of the motion. Returns 0, or 1 where phi of an active row is undefined. */
int lag_measure_rows(lag_run *run, double t, const double *y);

/* The scales of psi at the stages of a step: discard them, or keep them if the step is accepted. At rest, rounding
 * errors are relative to them; in a rejected step, they may be unbounded. */
void lag_forget_speeds(lag_run *run);
void lag_keep_speeds(lag_run *run);

/* B x of a row, x (nq). */
double lag_along(const lag_run *run, int row, const double *x);

/* The same of n rows, by B's entries: to out[0], out[stride], ...; NaN where any of x is undefined. */
void lag_along_each(const lag_run *run, int n, const int *rows, const double *x, double *out, int stride);

/* U of a row, or of a force (rows + number), by the current factors, to its place; returns that. */
const double *lag_row_response(lag_run *run, int k);

/* Evaluate a tape of (t, q, v, a, lambda, p), lambda of all constraints. */
void lag_evaluate_forces(const lag_run *run, const lag_tape *tape, double t, const double *y,
                         const double *a, const double *multipliers);

/* Signs of functions of forces: those of the step, if there is one, or of the functions at these forces. */
enum lag_sides { LAG_OF_STEP, LAG_OF_FORCES };

/* Evaluate the functions of signs with their own signs, to found_side. */
void lag_find_sides(const lag_run *run, double t, const double *y, const double *a, const double *multipliers);

/* Evaluate the tape of limits or forces, of (t, q, v, a, lambda, signs, p). */
void lag_evaluate_laws(const lag_run *run, const lag_tape *tape, double t, const double *y, const double *a,
                       const double *multipliers, enum lag_sides sides);

/* lambda of all constraints, from those of the system and the rows' forces z. */
void lag_gather_multipliers(const lag_run *run, const double *of_system, const double *z, double *out);

/* x of least norm with A x = b, A positive semidefinite, n by n. Of rows that depend on others, b is not read.
 * memory: 3 n n + 3 n. Returns A's rank. */
int lag_least_norm(int n, const double *matrix, const double *b, double *x, double *memory);

/* The derivatives of the laws of n acting forces by these forces, n by n: rows that hold, B U; the others, what is
 * left of z - Phi(lambda). Their responses are available. Evaluates the tapes of limits and forces. */
void lag_laws_matrix(lag_run *run, double t, const double *y, const double *a, const double *multipliers, int n,
                     const int *acts, double *matrix);

/* Add what the rows that act and the forces that depend on multipliers do to a and lambda, as they have
 * been found without; and to the power. Returns 0, or 1 where that is undefined. */
int lag_add_forces(lag_run *run, double t, const double *y, double *power);

#endif
