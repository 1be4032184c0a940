/* Breaks: times at which the right side is not smooth. Steps end there, and the next one restarts. */
#ifndef LAGCLI_BREAKS_H
#define LAGCLI_BREAKS_H

#include "run.h"

/* Begin, or continue, at run->step.t: find the next break, at which steps must end. */
void lag_breaks_start(lag_run *run);

/* Whether the last step ended at a break that has not been passed. */
int lag_at_break(const lag_run *run);

/* Continue after it, with the right side as it is there. The size of the next step is chosen again if y' jumps.
 * Returns LAG_RUNNING or LAG_UNDEFINED. */
int lag_pass_break(lag_run *run);

/* After a break: take back the pieces that hold before it. */
void lag_pieces_before(lag_run *run);

/* Write the pieces of the functions from a time on to where they are among the parameters. */
void lag_pieces_at(const lag_run *run, double t, double *parameters);

#endif
