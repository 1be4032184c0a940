/* What emitted code calls. */
#ifndef LAGCLI_NATIVE_CALLS_H
#define LAGCLI_NATIVE_CALLS_H

#include "tables.h"

typedef void lag_called(void);

/* By operation: a function of the C library, or of lanes; NULL where instructions are emitted. Of one lane:
 * double f(double, double), or void f(double, double *sine, double *cosine). Of four: void f(const double *,
 * const double *, double *), or void f(const double *, double *sines, double *cosines). */
typedef struct {
    lag_called *of[OP_END];
} lag_calls;

extern const lag_calls lag_calls_of_one;

#endif
