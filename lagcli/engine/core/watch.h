/* The watch for singular configurations: where B loses rank in passing. */
#ifndef LAGCLI_WATCH_H
#define LAGCLI_WATCH_H

#include "run.h"

/* Smallest pivot of the row-scaled B: near 0 in a singular configuration. */
double lag_weakest(lag_run *run, double t, const double *y);

/* Keep the largest length that each row of B has had; the constraint tape holds the state. */
void lag_measure(lag_run *run);

/* Whether the weakest pivot passes a small minimum inside the last step. */
int lag_goes_over(lag_run *run);

#endif
