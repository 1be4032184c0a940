/* The linear system [[M, B'], [B, 0]]: its factors at a state, and solutions for right sides. */
#ifndef LAGCLI_SOLUTION_H
#define LAGCLI_SOLUTION_H

#include "evaluate.h"

/* How a and lambda are computed now: as run->solver.by says, or densely (0). */
static inline enum lag_solution lag_solving_by(const lag_run *run)
{
    return run->solver.dense_steps ? LAG_BY_LU : run->solver.by;
}

/* The number of rows of B that the solution in use leaves out, since they follow from the others: rows.left_out. */
int lag_left_out(const lag_run *run);

/* Make [[M, B'], [B, 0]] at a state ready to solve with. Returns 0, or 1 if it is singular; of the
 * unrolled factors it does not say so: the solutions are not finite then. */
int lag_factor(lag_run *run, double t, const double *y);

/* ln |det [[M, B'], [B, 0]]| by the last factors, but for a constant of the way in which they are found; not of a
 * bordered matrix. */
double lag_log_determinant(lag_run *run);

/* The least change x (nq), in terms of M, with B x = rhs (nc), by the last factors. Returns a number
 * that is finite if x is. */
double lag_correction(lag_run *run, const double *rhs, double *x);

/* (B M^-1 B')^-1 x (nc of the motion) instead of x, by the last factors: the multipliers that go with constraints'
 * accelerations. Not by those of a bordered matrix. */
void lag_oppose(lag_run *run, double *x);

/* Solve [[M, B'], [B, 0]] x = right with the last factors; both have nq + nc entries. `refined` by
 * one step of iterative refinement. right is destroyed. */
void lag_solve(lag_run *run, double *right, double *x, int refined);

/* The same for the blocks from `first` to `end` alone; by the dense solution, for all. */
void lag_solve_blocks(lag_run *run, int first, int end, double *right, double *x, int refined);

/* a and lambda (nq + nc) that generalized forces (nq) add, by the last factors. */
void lag_respond(lag_run *run, const double *forces, double *x);

/* a and lambda of the derivatives, to x, for f and gamma that the tangent tape holds, by the unrolled tape.
 * Returns a number that is finite if they are. */
double lag_solve_tangent(lag_run *run, double *x);

/* One step of iterative refinement of the motion's solution x; not of the dense one. */
void lag_refine(lag_run *run, const double *right, double *x);

/* What such a step adds to a solution, instead of the solution's residual. */
void lag_correct(lag_run *run, double *residual);

/* right less the matrix times x, to r; the sums of the magnitudes to size, where it is given. */
void lag_residual(const lag_run *run, const double *right, const double *x, double *r, double *size);

/* Convert the unknowns besides a to multipliers, which are their negatives, or back. */
void lag_turn(double *x, int n);

#endif
