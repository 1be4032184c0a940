/* Checks of programs for power series. */
#ifndef LAGCLI_CHECK_H
#define LAGCLI_CHECK_H

#include "lagmodel.h"

/* Whether a program for the series of a motion of nq coordinates stays within its file; its values have been checked. */
int lag_series_is_valid(const lag_series_program *program, int nq);

#endif
