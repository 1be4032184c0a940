/* The log of what happens at instants. */
#ifndef LAGCLI_LOG_H
#define LAGCLI_LOG_H

#include "run.h"

/* What an entry is of, in the order of Occurrence in engine/contract.py. */
enum lag_occurrence { LAG_CLOSES, LAG_OPENS, LAG_SLIPS, LAG_STICKS, LAG_IMPACT, LAG_REST };

/* Whether there is room for all that one round of an instant may add. */
int lag_log_has_room(const lag_run *run);

/* Add an entry for a row. impulse: nc, or NULL. */
void lag_log(lag_run *run, double t, enum lag_occurrence what, int row, const double *before,
             const double *after, const double *impulse, double loss, double supplied);

/* Complete the entries of an instant by the modes that follow. */
void lag_log_modes(lag_run *run);

#endif
