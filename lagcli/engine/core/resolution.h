/*
 * Resolution of explicit functions of time: steps are short enough that the stages see them.
 *
 * Error control sees a function such as sin(w t) only at the stages of a step. Where nothing moves, or before a short
 * pulse, steps would be longer than its periods. Here the second derivatives of such functions with respect to t, at
 * fixed q and v, are enclosed ahead of the step, and limit its size: to half a period of a sine, so that a cubic through the ends of the step shows its extremes.
 */
#ifndef LAGCLI_RESOLUTION_H
#define LAGCLI_RESOLUTION_H

#include "run.h"

/* The size of a step from the state of the run that resolves the functions, at most h. */
double lag_resolved_step(lag_run *run, double h);

#endif
