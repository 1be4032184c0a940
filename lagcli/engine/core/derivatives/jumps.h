/*
 * Jumps of the changes of a motion at an instant, whose time changes, too: by delta t = -(delta g) / g' for the
 * function g that vanishes. The state at the instant changes by delta q + v delta t, delta v + a delta t, which
 * impacts and actions map, and from which what the motion after the instant would have added is taken away.
 *
 * Hiskens & Pai, Trajectory sensitivity analysis of hybrid systems, IEEE Trans. Circuits Syst. I 47 (2000); Leine &
 * Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems, 2004, chapter 7.
 */
#ifndef LAGCLI_JUMPS_H
#define LAGCLI_JUMPS_H

#include "run.h"

/* At the beginning of an instant, where a and lambda before it have been found: the changes of its time and of the
 * state in run->step.y. Returns 0, or 1. */
int lag_begin_jump(lag_run *run);

/* The same at the start of the run, whose time does not change. */
void lag_begin_first_jump(lag_run *run);

/* At the end of an instant, or of the start, in the new modes. Returns 0, or 1. */
int lag_end_jump(lag_run *run, int started);

/* Before the phases of an impact of the listed rows, without restitution if it is `inelastic`. The phases then change the
 * velocities' changes in y: as contact/contact.h asks. */
void lag_begin_impact(lag_run *run, double t, double *y, int n, const int *rows, int inelastic);
/* After an impulse at the state in run->step.y has changed the velocities, and the multipliers' impulses, by `moved`
 * (nq + nc of the system): the changes of the impulse are `pushed` (n * nq). */
void lag_jump_by_push(lag_run *run, const double *moved, const double *pushed);

void lag_impact_phase(void *run, int part, int n, const int *row, const int *mode, const double *force);

#endif
