/* Operations on arrays for one instruction set: the including file defines NAME. */
#define _GNU_SOURCE /* sincos */
#include "tape/vectors.h"

#include "tape/tape_run.h"

/* Row number k of those that are combined, from element i on, and its weight. */
#define ROW(k) (rows + (ptrdiff_t)number[k] * apart + i)
#define WEIGHT(k) (factor * weight[k])

static void combine(int n, const double *base, int terms, const double *rows, int apart, const int *number,
                    const double *weight, double factor, double *y)
{
    int i = 0;
    for (; i + 16 <= n; i += 16) { /* sums remain in registers */
        four p = {0.0}, q = p, r = p, s = p;
        for (int k = 0; k < terms; ++k) {
            const double *a = ROW(k), w = WEIGHT(k);
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
    for (; i + 8 <= n; i += 8) {
        four p = {0.0}, q = p;
        for (int k = 0; k < terms; ++k) {
            const double *a = ROW(k), w = WEIGHT(k);
            p += w * FOUR(a);
            q += w * FOUR(a + 4);
        }
        *(four *)(y + i) = FOUR(base + i) + p;
        *(four *)(y + i + 4) = FOUR(base + i + 4) + q;
    }
    if (i + 4 <= n) {
        four p = {0.0};
        for (int k = 0; k < terms; ++k)
            p += WEIGHT(k) * FOUR(ROW(k));
        *(four *)(y + i) = FOUR(base + i) + p;
        i += 4;
    }
    if (i == n)
        return;
    const int second = i + 1 < n, third = i + 2 < n ? 2 : 0; /* one pass for the last elements */
    double p = 0.0, q = 0.0, r = 0.0;
    for (int k = 0; k < terms; ++k) {
        const double *a = ROW(k), w = WEIGHT(k);
        p += w * a[0];
        q += w * a[second];
        r += w * a[third];
    }
    y[i] = base[i] + p;
    if (second)
        y[i + 1] = base[i + 1] + q;
    if (third)
        y[i + 2] = base[i + 2] + r;
}

#undef ROW
#undef WEIGHT

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
    double rest = 0.0;
    for (; i < n; ++i)
        rest += y[i] = x[places[i]];
    return ((sum[0] + sum[1]) + (sum[2] + sum[3])) + rest;
}

INLINE four choose(mask_of_four m, four a, four b)
{
    return (four)((m & (mask_of_four)a) | (~m & (mask_of_four)b));
}

INLINE four larger(four a, four b)
{
    return choose(a > b, a, b);
}

INLINE four smaller(four a, four b)
{
    return choose(a < b, a, b);
}

static double largest(int n, const double *x, const double *now, double *scale)
{
    const four tiny = {1e-300, 1e-300, 1e-300, 1e-300};
    four most = {0.0, 0.0, 0.0, 0.0};
    int i = 0;
    for (; i + 4 <= n; i += 4) {
        const four raised = larger(FOUR(now + i), FOUR(scale + i));
        *(four *)(scale + i) = raised;
        const four part = magnitudes(FOUR(x + i)) / larger(raised, tiny);
        most = choose((part > most) | (part != part), part, most);
    }
    for (; i < n; ++i) {
        if (now[i] > scale[i])
            scale[i] = now[i];
        const double part = fabs(x[i]) / (scale[i] > 1e-300 ? scale[i] : 1e-300);
        if (part > most[0] || isnan(part))
            most[0] = part;
    }
    for (int k = 1; k < 4; ++k)
        if (most[k] > most[0] || isnan(most[k]))
            most[0] = most[k];
    return most[0];
}

static double scaled_square(int n, const double *x, const double *y, const double *z,
                            const double *atol, double rtol)
{
    four sum = {0.0, 0.0, 0.0, 0.0};
    int i = 0;
    for (; i + 4 <= n; i += 4) {
        const four size = larger(magnitudes(FOUR(y + i)), magnitudes(FOUR(z + i)));
        const four e = FOUR(x + i) / (FOUR(atol + i) + rtol * size);
        sum += e * e;
    }
    for (; i < n; ++i) {
        const double a = fabs(y[i]), b = fabs(z[i]), e = x[i] / (atol[i] + rtol * (a > b ? a : b));
        sum[0] += e * e;
    }
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

static void subtract(int n, double *y, int terms, const double *const *x, const double *weight)
{
    int i = 0;
    for (; i + 16 <= n; i += 16) { /* differences remain in registers */
        four p = FOUR(y + i), q = FOUR(y + i + 4), r = FOUR(y + i + 8), s = FOUR(y + i + 12);
        for (int k = 0; k < terms; ++k) {
            const double *a = x[k] + i, w = weight[k];
            p -= w * FOUR(a);
            q -= w * FOUR(a + 4);
            r -= w * FOUR(a + 8);
            s -= w * FOUR(a + 12);
        }
        *(four *)(y + i) = p;
        *(four *)(y + i + 4) = q;
        *(four *)(y + i + 8) = r;
        *(four *)(y + i + 12) = s;
    }
    for (; i + 4 <= n; i += 4) {
        four p = FOUR(y + i);
        for (int k = 0; k < terms; ++k)
            p -= weight[k] * FOUR(x[k] + i);
        *(four *)(y + i) = p;
    }
    for (; i < n; ++i) {
        double p = y[i];
        for (int k = 0; k < terms; ++k)
            p -= weight[k] * x[k][i];
        y[i] = p;
    }
}

const lag_vector_kernel NAME = {run_stream, combine, pick, largest, scaled_square, subtract};
