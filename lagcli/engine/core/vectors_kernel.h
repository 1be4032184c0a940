/* What is done on vectors, for one instruction set: its file defines NAME and includes this. */
#define _GNU_SOURCE /* sincos */
#include "vectors.h"

#include <string.h>

#include "tape_run.h"

#define CHUNK 128           /* elements that are done at a time, so that sums stay in the cache */

static void combine(int n, const double *base, int terms, const double *const *x,
                    const double *weight, double *y)
{
    for (int first = 0; first < n; first += CHUNK) {
        const int m = n - first < CHUNK ? n - first : CHUNK;
        double sum[CHUNK];
        int k = 0;
        memset(sum, 0, (size_t)m * sizeof(double));
        for (; k + 3 < terms; k += 4) {
            const double *a = x[k] + first, *b = x[k + 1] + first, *c = x[k + 2] + first;
            const double *d = x[k + 3] + first;
            const double v0 = weight[k], v1 = weight[k + 1], v2 = weight[k + 2], v3 = weight[k + 3];
            int i = 0;
            for (; i + 4 <= m; i += 4)
                *(four *)(sum + i) = FOUR(sum + i) + v0 * FOUR(a + i) + v1 * FOUR(b + i)
                                     + v2 * FOUR(c + i) + v3 * FOUR(d + i);
            for (; i < m; ++i)
                sum[i] = sum[i] + v0 * a[i] + v1 * b[i] + v2 * c[i] + v3 * d[i];
        }
        for (; k < terms; ++k) {
            const double *a = x[k] + first, v = weight[k];
            int i = 0;
            for (; i + 4 <= m; i += 4)
                *(four *)(sum + i) = FOUR(sum + i) + v * FOUR(a + i);
            for (; i < m; ++i)
                sum[i] += v * a[i];
        }
        for (int i = 0; i < m; ++i)
            y[first + i] = base[first + i] + sum[i];
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
