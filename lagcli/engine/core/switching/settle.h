/* Contact problems of a run: active rows, and impacts. */
#ifndef LAGCLI_SETTLE_H
#define LAGCLI_SETTLE_H

#include "run.h"

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

/* Result of an impact; rows each. */
typedef struct {
    int *takes_part;
    double *impulse, *loss;
    double *all;            /* of all constraints */
    double supplied, work;  /* by moving constraints; total change of the energy */
    double gained;          /* gain of energy beyond rounding; else 0 */
    int rubbed, alike;      /* whether there was friction; whether all contacts have the same coefficient of
                               restitution */
} lag_impact_report;

/* The impact at (t, y) of rows that take part; those that are `plastic` end
 * at rest. Changes the velocities in y. */
int lag_collide(lag_run *run, double t, double *y, const int *plastic, lag_impact_report *report);

/* Tolerances of zero for the gap and the velocity of a row. */
double lag_no_gap(const lag_switching *sw, int row);
double lag_no_speed(const lag_switching *sw, int row);

#endif
