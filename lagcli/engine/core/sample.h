/* Samples of a run: consistent states at given times, with their accelerations and multipliers. */
#ifndef LAGCLI_SAMPLE_H
#define LAGCLI_SAMPLE_H

#include "run.h"

/* Sample the last accepted step, or the start, up to a time. Returns LAG_RUNNING, LAG_BLOCK_FULL, or
 * why a state has no sample. */
int lag_sample_until(lag_run *run, double end);

#endif
