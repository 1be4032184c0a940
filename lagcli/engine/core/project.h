/* Projection onto the constraints. */
#ifndef LAGCLI_PROJECT_H
#define LAGCLI_PROJECT_H

#include "run.h"

/* Bring y at t to the constraints. Returns LAG_RUNNING, LAG_UNDEFINED or LAG_OFF. */
int lag_project(lag_run *run, double t, double *y);

#endif
