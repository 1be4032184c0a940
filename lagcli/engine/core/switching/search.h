/* The first instant in a step: where a watched function becomes negative. */
#ifndef LAGCLI_SEARCH_H
#define LAGCLI_SEARCH_H

#include "run.h"

/* Look for the first instant of the last step at which a watched function becomes negative. Returns 1 with
 * `instant` and `hit` set; 0 if there is none, and the next step is ready to be watched, or if the dense output is
 * inaccurate; -1 if something is undefined; LAG_NOT_RESOLVED if the sign of watched function `unresolved` cannot be
 * determined; LAG_STRAYING if the dense output strays at the instant, whose state is then not controlled. */
enum { LAG_NOT_RESOLVED = -2, LAG_STRAYING = -3 };
int lag_find_instant(lag_run *run);

#endif
