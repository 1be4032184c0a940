/* Infinitely many impacts in finite time. */
#ifndef LAGCLI_ACCUMULATION_H
#define LAGCLI_ACCUMULATION_H

#include "run.h"

/* Doubles and integers that lag_end_of_impacts needs, of a number of rows. */
int64_t lag_accumulation_doubles(int64_t rows);
int64_t lag_accumulation_integers(int64_t rows);

/*
 * The time at which infinitely many impacts come to an end, at (t, y), the state after one of them: those of contact
 * `row`, and of the contacts that its impulses move, as far as these are closed or among `rests`, which bounce
 * lower than what counts as a gap. NAN where they do not end. member: rows, whether a row is among these contacts.
 * friction: rows, changed for limited rows that these contacts move: their impulses until then, beyond those of the
 * forces that they have where all these contacts are at rest.
 */
double lag_end_of_impacts(
    lag_run *run, double t, const double *y, int row, const int *rests, int *member, double *friction);

#endif
