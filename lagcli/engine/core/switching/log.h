/* The event log. */
#ifndef LAGCLI_LOG_H
#define LAGCLI_LOG_H

#include "run.h"

/* Whether the log has space for one round of an instant. */
int lag_log_has_room(const lag_run *run);

/* Add an entry for a row. impulse: nc, or NULL. */
void lag_log(lag_run *run, double t, enum lag_occurrence what, int row, const double *before,
             const double *after, const double *impulse, double loss, double supplied);

/* Add entries for rows whose force is not unique from now on, as other rows can bear parts of it. */
void lag_log_redundant(lag_run *run);

/* Complete the entries of an instant with the next modes. */
void lag_log_modes(lag_run *run);

#endif
