/* Evaluation of tapes at a state. */
#ifndef LAGCLI_EVALUATE_H
#define LAGCLI_EVALUATE_H

#include "program/slices.h"
#include "run.h"

/* Size of the state y = (q, v, W). */
static inline int lag_size(const lag_system *system)
{
    return 2 * system->nq + 1 + system->carried;
}

/* n numbers, and those up to a multiple of four: states and stages have room for them, which are zeros, so that sums
 * need not treat the last numbers apart. */
static inline int lag_whole_vectors(int n)
{
    return (n + 3) / 4 * 4;
}

/* Parts of a tape: all; for the dynamics, intermediate results for other right sides; for the constraints, phi with
 * its scale, or B, psi and its scale. */
enum lag_part { LAG_NOTHING = -1, LAG_ALL, LAG_FACTORS = 1, LAG_POSITIONS = 1, LAG_VELOCITIES = 2 };

/* The factors of the matrix available for the state of the dynamics tape: its second entry of `held`. */
enum lag_factored { LAG_NOT_FACTORED, LAG_FACTORED, LAG_FACTORED_DENSE };

/* Evaluate a tape, or a part, at a state, unless it holds that; these outputs can be read
 * afterwards. */
void lag_evaluate(const lag_tape *tape, const lag_system *system, double t, const double *y, int part);

/* Evaluate a slice of a tape at a state: the outputs of its function can be read, and no others. */
void lag_evaluate_slice(const lag_tape *tape, const lag_slice *slice, double t, const double *y);

/* The tape whose outputs are M and f at the state that the dynamics tape holds. */
const lag_tape *lag_equations_tape(const lag_system *system);

/* Set the run's parameters in all tapes. */
void lag_renew_tapes(lag_run *run);

/* Write the rows of B times sizes, over their lengths, of the first blocks to run->rows.scaled, from a tape whose
 * B entries begin at output `first`. Returns 0, or 1 where they are not finite. */
int lag_scaled_rows(lag_run *run, int blocks, const lag_tape *tape, int first);

/* The squares of the lengths of the rows of B times sizes (nc), or of B where sizes is NULL, from a
 * tape whose B entries begin at `first`. */
void lag_row_squares(const lag_system *system, const lag_tape *tape, int first, const double *sizes,
                     double *sum);

/* Record the state at which the equations are not finite, or not solved accurately. Returns 1. */
int lag_failed(lag_run *run, double t, const double *y);

#endif
