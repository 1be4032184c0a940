/* Choice of the next modes at an instant. */
#ifndef LAGCLI_CHOICE_H
#define LAGCLI_CHOICE_H

#include "run.h"

/* What is known of the rows before the accelerations, lag_row_state: those that are closed and do not separate
 * rest. */
void lag_states_of(const lag_run *run, int *state);

/* Choose the modes that follow from the accelerations; a contact that has just opened and would close at once
 * stays closed. Returns LAG_RUNNING, or why there are none. */
int lag_choose_modes(lag_run *run);

#endif
