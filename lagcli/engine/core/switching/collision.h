/* Impacts at an instant. */
#ifndef LAGCLI_COLLISION_H
#define LAGCLI_COLLISION_H

#include "run.h"

/* Whether a contact approaches, or a moving constraint is engaged. */
int lag_collides(const lag_run *run);

/* Do the impact that is due, and log it. Rows that would bounce no higher than a gap that counts as none end at
 * rest. Returns LAG_RUNNING, or why there is none. */
int lag_do_collision(lag_run *run);

#endif
