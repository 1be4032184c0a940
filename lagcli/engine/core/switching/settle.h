/* Contact problems of a run: accelerations, and forces of redundant rows. */
#ifndef LAGCLI_SETTLE_H
#define LAGCLI_SETTLE_H

#include "run.h"

#define LAG_HORIZON 1e-3        /* of the duration of the run: how long an acceleration acts in terms of velocities */

/* Arrays for a problem of at most rows + nf, in sw->contacts: those of lag_contacts, two solutions, the rows of the
 * layer, and `extra`, a and lambda of the system. */
typedef struct {
    double *matrix, *offset, *rounding, *limit[2], *slope[2], *force[2], *motion[2], *extra;
    int *law, *mode[2], *rows;
} lag_problem_arrays;

lag_problem_arrays lag_arrays_of(lag_switching *sw);

/* A of n listed rows, with zeros for those that no force moves; their responses are then available. */
void lag_matrix_of(lag_run *run, int n, const int *rows, double *matrix);

/* Limits of n rows, p->rows, as functions of the multipliers' magnitudes: constants to p->limit, and slopes with
 * respect to the listed rows to p->slope; static and kinetic ones. Limits that are curved in multipliers are those
 * about the forces of the rows: their tangents, or their secants from 0. NULL: none of the limits is curved. */
void lag_limits_of(lag_run *run, double t, const double *y, const double *a, int n, const double *force, int tangent,
                   const lag_problem_arrays *p);

/* State of a row at an instant before the problem is solved. */
enum lag_row_state {
    LAG_APART,              /* it does not participate */
    LAG_AT_REST,            /* it may hold */
    LAG_GOES_FORWARD,       /* it begins to slip */
    LAG_GOES_BACKWARD,
    LAG_STOPS,              /* it has slipped until now */
};

/* Solve for the modes at (t, y): to `mode` (rows), the forces z to `force`, and the accelerations to a (nq).
 * Returns what lag_solve_contacts does, or -1 where something is undefined. */
int lag_settle(lag_run *run, double t, const double *y, const int *state, int *mode, double *force, double *a);

/* Let redundant rows that hold share their forces within their laws where they can, at the state at which
 * the forces have been found last: changes `force`, `multipliers`, the lambda of the system, and sets `slack`
 * and `tight`. */
void lag_share_forces(lag_run *run, double t, const double *y);

/* Tolerances of zero for the gap and the velocity of a row. */
double lag_no_gap(const lag_run *run, int row);
double lag_no_speed(const lag_switching *sw, int row);

#endif
