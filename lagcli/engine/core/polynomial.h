/* Polynomials on 0 to 1 in the Bernstein basis: the dense output of a step, one component at a time. */
#ifndef LAGCLI_POLYNOMIAL_H
#define LAGCLI_POLYNOMIAL_H

#include "tables.h"

#define LAG_MOST_DEGREE (LAG_SERIES_ORDER + 1)

/* Multiply a polynomial of degree m, with m + 1 control points b, by the linear function that is `start` at 0 and
 * `end` at 1; then add a constant. b has room for one more. */
static inline void lag_times_linear(double *b, int m, double start, double end, double constant)
{
    b[m + 1] = 0.0;
    for (int j = m + 1; j >= 0; --j) {
        const double before = j > 0 ? b[j - 1] * j : 0.0, here = j <= m ? b[j] * (m + 1 - j) : 0.0;
        b[j] = (end * before + start * here) / (m + 1) + constant;
    }
}

#endif
