/*
 * Redundant constraints: rows of B that follow from the others. Eliminations leave out nc - rank of them, whose
 * multipliers are then 0; the dense solution has all.
 */
#ifndef LAGCLI_LEFT_OUT_H
#define LAGCLI_LEFT_OUT_H

#include "run.h"

#define MOST_DEFECT 5e-7    /* ... to this */
#define OFTEN 200           /* steps by the dense solution after which other rows are left out */

/*
 * Replace multipliers (nc) by those of least norm with the same forces, at the state of the last factors. What they
 * have of multipliers without forces is taken from them. The force of a row that is left out is opposed by the others:
 * both together are such multipliers. Returns 0, or 1 where only large ones of the others do that: these are almost
 * dependent there, and the solution is not accurate.
 */
int lag_share_multipliers(lag_run *run, double *multipliers);

/* The same for the multipliers that oppose the force of each row that is left out, given in rows.dependencies; eight
 * samples of a batch have found theirs together. */
int lag_share_by_responses(lag_run *run, double *multipliers);

/* Whether, before a step, the rows that are not left out are almost dependent, although all rows are not. */
int lag_check_left_out(lag_run *run);

/* The residual of B a = gamma, relative to its terms, that rows that are left out may have. */
double lag_allowed_defect(const lag_settings *settings);

/* Whether, after a step, a does not satisfy the rows that are left out. */
int lag_overlooked(lag_run *run);

/* Let solver.dense_steps be 1 or 2, for a step. Returns whether this has happened so often that others should be left
 * out: then the state is that of a failure. */
int lag_take_all_rows(lag_run *run, int64_t dense_steps);

#endif
