/* Impacts of a run: impulses at a state. */
#ifndef LAGCLI_IMPULSE_H
#define LAGCLI_IMPULSE_H

#include "run.h"

/* Result of an impact; rows each. */
typedef struct {
    int together;           /* given: all closed contacts take part, also those that open, without restitution;
                               changed to 0 where one has the coefficient 1 */
    int *takes_part;
    double *impulse, *loss;
    double *all;            /* of all constraints */
    double supplied;        /* by moving constraints */
    double gained;          /* gain of energy beyond rounding; else 0 */
    int with_friction;      /* whether there was friction; 0 before */
    int equal_restitution;  /* whether all contacts have the same coefficient of restitution */
} lag_impact_report;

/* Whether a contact is closed; and does not open, so that it takes part in an impact. */
int lag_is_closed(const lag_run *run, int row);
int lag_meets(const lag_run *run, int row);

/* Whether a row may act while contacts come to rest, `rests`: these, closed ones, the friction of both, and rows that need
 * no contact. */
int lag_may_act(const lag_run *run, int row, const int *rests);

/* The impact at (t, y) of rows that take part. Changes the velocities in y. Returns what lag_solve_contacts does, or
 * -1 where something is undefined. */
int lag_collide(lag_run *run, double t, double *y, lag_impact_report *report);

/* Stop contacts that come to rest, `rests`, at (t, y), while others that are closed do not approach and what sticks
 * does not slip; what slips, and what limits a force without a contact, has a given impulse, `friction`. `lost` is the
 * energy that is lost besides the work of these. Changes the velocities in y; returns as lag_collide. */
int lag_bring_to_rest(lag_run *run, double t, double *y, const int *rests, const double *friction, double *lost);

#endif
