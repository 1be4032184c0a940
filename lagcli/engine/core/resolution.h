/*
 * Resolution of explicit functions of time: steps are short enough that the stages see them.
 *
 * Error control sees a function such as sin(w t) only at the stages of a step. Where nothing moves, or before a short
 * pulse, steps would be longer than its periods. Here the second derivatives of such functions with respect to t, at
 * fixed v, are enclosed ahead of the step, and limit its size: to half a period of a sine, so that a cubic through
 * the ends of the step shows its extremes.
 *
 * A function of time and of the state, such as the friction g(v - a t) of a belt, changes in another way where the state
 * moves. If it is not resolved at fixed v, a step is tried that resolves the functions of time alone, and the
 * function's second derivative is enclosed along that step: where a block rests on the belt, it vanishes.
 */
#ifndef LAGCLI_RESOLUTION_H
#define LAGCLI_RESOLUTION_H

#include "run.h"

/* The size of a step from the state of the run that resolves the functions, at most h. */
double lag_resolved_step(lag_run *run, double h);

/* The part of the last step, from its beginning, that would resolve functions of time and state as a step; 1: all of
 * it. */
double lag_resolved_part(lag_run *run);

#endif
