/* What is done on vectors, for one instruction set: its file defines NAME and includes this. */
#define _GNU_SOURCE /* sincos */
#include "vectors.h"

#include "tape_run.h"

static void combine(int n, const double *base, int terms, const double *const *x,
                    const double *weight, double *y)
{
    int i = 0;
    for (; i + 16 <= n; i += 16) { /* sums stay in registers */
        four p = {0.0}, q = p, r = p, s = p;
        for (int k = 0; k < terms; ++k) {
            const double *a = x[k] + i, w = weight[k];
            p += w * FOUR(a);
            q += w * FOUR(a + 4);
            r += w * FOUR(a + 8);
            s += w * FOUR(a + 12);
        }
        *(four *)(y + i) = FOUR(base + i) + p;
        *(four *)(y + i + 4) = FOUR(base + i + 4) + q;
        *(four *)(y + i + 8) = FOUR(base + i + 8) + r;
        *(four *)(y + i + 12) = FOUR(base + i + 12) + s;
    }
    for (; i < n; ++i) {
        double sum = 0.0;
        for (int k = 0; k < terms; ++k)
            sum += weight[k] * x[k][i];
        y[i] = base[i] + sum;
    }
}

static double pick(int n, const double *x, const int32_t *places, double *y)
{
    four sum = {0.0, 0.0, 0.0, 0.0};
    int i = 0;
    for (; i + 4 <= n; i += 4) {
        const int32_t *at = places + i;
        const four part = {x[at[0]], x[at[1]], x[at[2]], x[at[3]]};
        *(four *)(y + i) = part;
        sum += part;
    }
    for (; i < n; ++i)
        sum[0] += y[i] = x[places[i]];
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

INLINE four larger_magnitudes(four x, four y)
{
    const four a = magnitudes(x), b = magnitudes(y);
    const mask_of_four m = a > b;
    return (four)((m & (mask_of_four)a) | (~m & (mask_of_four)b));
}

static double scaled_square(int n, const double *x, const double *y, const double *z, double atol,
                            double rtol)
{
    four sum = {0.0, 0.0, 0.0, 0.0};
    int i = 0;
    for (; i + 4 <= n; i += 4) {
        const four e = FOUR(x + i) / (atol + rtol * larger_magnitudes(FOUR(y + i), FOUR(z + i)));
        sum += e * e;
    }
    for (; i < n; ++i) {
        const double e = x[i] / (atol + rtol * fmax(fabs(y[i]), fabs(z[i])));
        sum[0] += e * e;
    }
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

const lag_vector_kernel NAME = {run_stream, combine, pick, scaled_square};
