/* Kinks: branches of the equations, fixed within a step, which change where their functions vanish. Their
 * values are the last parameters of the programs (engine/switching/kinks.py). */
#ifndef LAGCLI_KINKS_H
#define LAGCLI_KINKS_H

#include "run.h"

/* Effect of an instant on a kink: none; its function vanishes; its side is known already. */
enum { LAG_OFF_SURFACE, LAG_ON_SURFACE, LAG_SIDE_KNOWN };

/* Write the branches to the parameters after these have been set. */
void lag_keep_branches(lag_run *run);

/* Evaluate the equations with the branches at some other time and state, until the preview ends. */
void lag_preview_branches(lag_run *run, double t, const double *y);
void lag_end_preview(lag_run *run);

/* The branches at the state of the run, and the surface on which the motion slides: by Filippov's rule where
 * the forces on both sides push onto it. Returns LAG_RUNNING, LAG_UNDEFINED, LAG_SURFACES or LAG_FORKED. */
int lag_choose_branches(lag_run *run);

/* End the slide on a surface: the motion continues on one side of it. */
void lag_leave_surface(lag_run *run, double side);

/* a, lambda and power of a motion that slides on a surface: the combination of both sides that stays on it. */
int lag_slide(lag_run *run, double t, const double *y, int refined, double *power);

/* Project the velocities onto the surface on which the motion slides. Returns LAG_RUNNING or LAG_UNDEFINED. */
int lag_hold_surface(lag_run *run, double t, double *y);

#endif
