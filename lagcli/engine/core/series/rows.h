/* Convolutions of single series, whose coefficients lie side by side in rows. */
#ifndef LAGCLI_SERIES_ROWS_H
#define LAGCLI_SERIES_ROWS_H

#include <stdint.h>

#include "series/inline.h"

#if defined(__has_builtin)
#if __has_builtin(__builtin_shufflevector)
#define VECTORS
#endif
#endif

/* Four contiguous numbers. */
#if defined(VECTORS)
typedef double four __attribute__((vector_size(32), aligned(8), may_alias));
typedef int64_t mask_of_four __attribute__((vector_size(32), aligned(8), may_alias));

ALWAYS_INLINE four forwards(const double *x) { return *(const four *)x; }
ALWAYS_INLINE four backwards(const double *x)
{
    const four y = *(const four *)x;
    return __builtin_shufflevector(y, y, 3, 2, 1, 0);
}
ALWAYS_INLINE four times(four x, four y) { return x * y; }
ALWAYS_INLINE four plus(four x, four y) { return x + y; }
ALWAYS_INLINE four chosen(four x, const int64_t *mask)
{
    return (four)((mask_of_four)x & *(const mask_of_four *)mask);
}
ALWAYS_INLINE double total(four x) { return (x[0] + x[2]) + (x[1] + x[3]); }
#else
typedef struct {
    double at[4];
} four;

#define OF_FOUR(a, b, c, d) ((four){{(a), (b), (c), (d)}})
#define EACH(op) OF_FOUR(x.at[0] op y.at[0], x.at[1] op y.at[1], x.at[2] op y.at[2], x.at[3] op y.at[3])
ALWAYS_INLINE four forwards(const double *x) { return OF_FOUR(x[0], x[1], x[2], x[3]); }
ALWAYS_INLINE four backwards(const double *x) { return OF_FOUR(x[3], x[2], x[1], x[0]); }
ALWAYS_INLINE four times(four x, four y) { return EACH(*); }
ALWAYS_INLINE four plus(four x, four y) { return EACH(+); }
ALWAYS_INLINE four chosen(four x, const int64_t *mask)
{
    for (int l = 0; l < 4; ++l)
        x.at[l] = mask[l] ? x.at[l] : 0.0;
    return x;
}
ALWAYS_INLINE double total(four x) { return (x.at[0] + x.at[2]) + (x.at[1] + x.at[3]); }
#endif

/* Which of the last four terms count: from place (k + 1) % 4 on. */
static const int64_t counting[] = {0, 0, 0, -1, -1, -1, -1};

/*
 * x[2] y[k - 1] + ... + x[k - 1] y[2], of four terms at a time; the last four go back to what is there
 * already, not on to what is not, and those of them that are in the sum do not count again.
 */
ALWAYS_INLINE double convolve(const double *x, const double *y, int k, int fours)
{
    four sum = {0};
    if (fours == 0)
        return 0.0;
    for (int j = 2; j < 4 * fours - 2; j += 4)
        sum = plus(sum, times(forwards(x + j), backwards(y + k - 2 - j)));
    const four last = times(forwards(x + k - 4), backwards(y + 2));
    return total(plus(sum, chosen(last, counting + (k + 1) % 4)));
}

/*
 * Coefficient k of a convolution, x[0] y[k] + ... + x[k] y[0]. All but its two ends was added up an
 * order before, so that nothing waits for long sums: then, too, the next order's terms are added up.
 */
ALWAYS_INLINE double product(const double *x, const double *y, int k, int fours, double *known)
{
    const double now = *known + x[0] * y[k] + x[k] * y[0];
    *known = k == 1 ? x[1] * y[1] : convolve(x, y, k, fours) + (x[1] * y[k] + x[k] * y[1]);
    return now;
}

/* Coefficient k of y = 1 / x: none of x y is left. */
ALWAYS_INLINE double inverse(const double *x, const double *y, int k, int fours, double *known)
{
    const double now = -y[0] * (*known + x[k] * y[0]);
    *known = k == 1 ? x[1] * now : convolve(x, y, k, fours) + (x[1] * now + x[k] * y[1]);
    return now;
}

/* Coefficient k of a convolution without x[0] y[k]: y[k] is not known yet, or x[0] is zero. */
ALWAYS_INLINE double past(const double *x, const double *y, int k, int fours, double *known)
{
    const double before = k == 1 ? 0.0 : x[1] * y[k - 1];
    const double now = *known + x[k] * y[0] + before;
    *known = k == 1 ? 0.0 : convolve(x, y, k, fours) + x[k] * y[1];
    return now;
}

#endif
