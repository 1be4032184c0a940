#include "series.h"

#include <math.h>
#include <string.h>

/* Wider registers give the same numbers: the widest there are is chosen when the program is loaded. */
#if defined(__x86_64__) && defined(__gnu_linux__) && defined(__GNUC__) && !defined(__clang__)
#define FOR_WIDER __attribute__((target_clones("avx2", "default")))
#else
#define FOR_WIDER
#endif
#if defined(__GNUC__)
#define ALWAYS_INLINE static inline __attribute__((always_inline))
#else
#define ALWAYS_INLINE static inline
#endif
#if defined(__has_builtin)
#if __has_builtin(__builtin_shufflevector)
#define VECTORS
#endif
#endif

enum lag_series_op {
    SERIES_SUM, SERIES_SCALE, SERIES_RATE, SERIES_MUL, SERIES_MULSUM, SERIES_INVERSE, SERIES_CHAIN,
    SERIES_END
};

/* a[0] b[0] + a[1] b[-1] + ..., of four terms at a time. */
#if defined(VECTORS)
typedef double four __attribute__((vector_size(32), aligned(8), may_alias));

ALWAYS_INLINE double convolve(const double *a, const double *b, int fours)
{
    four sum = {0.0, 0.0, 0.0, 0.0};
    for (int j = 0; j < 4 * fours; j += 4) {
        const four x = *(const four *)(a + j), y = *(const four *)(b - j - 3);
        sum += x * __builtin_shufflevector(y, y, 3, 2, 1, 0);
    }
    return (sum[0] + sum[2]) + (sum[1] + sum[3]);
}
#else
ALWAYS_INLINE double convolve(const double *a, const double *b, int fours)
{
    double sum[4] = {0.0, 0.0, 0.0, 0.0};
    for (int j = 0; j < 4 * fours; j += 4)
        for (int l = 0; l < 4; ++l)
            sum[l] += a[j + l] * b[-j - l];
    return (sum[0] + sum[2]) + (sum[1] + sum[3]);
}
#endif

/*
 * Coefficient k of a convolution, x[0] y[k] + ... + x[k] y[0]. All but its two ends was added up an
 * order before, so that nothing waits for long sums: then, too, the next order's terms are added up,
 * x[2] y[k - 1] to x[k - 1] y[2] by fours. What the last four have too many is x[k] y[1], to be added
 * otherwise, and zeros: terms that are not there yet, and what stands before a row.
 */
ALWAYS_INLINE double product(const double *x, const double *y, int k, int fours, double *known)
{
    const double now = *known + x[0] * y[k] + x[k] * y[0], last = k % 4 == 2 ? x[k] * y[1] : 0.0;
    *known = k == 1 ? x[1] * y[1] : convolve(x + 2, y + k - 1, fours) + (x[1] * y[k] + last);
    return now;
}

/* Coefficient k of y = 1 / x: none of x y is left. */
ALWAYS_INLINE double inverse(const double *x, const double *y, int k, int fours, double *known)
{
    const double now = -y[0] * (*known + x[k] * y[0]), last = k % 4 == 2 ? x[k] * y[1] : 0.0;
    *known = k == 1 ? x[1] * now : convolve(x + 2, y + k - 1, fours) + (x[1] * now + last);
    return now;
}

/* Coefficient k of a convolution where that of y is not there yet, and x[0] is zero. */
ALWAYS_INLINE double chained(const double *x, const double *y, int k, int fours, double *known)
{
    const double before = k == 1 ? 0.0 : x[1] * y[k - 1], last = k % 4 == 2 ? x[k] * y[1] : 0.0;
    const double now = *known + x[k] * y[0] + before;
    *known = k == 1 ? 0.0 : convolve(x + 2, y + k - 1, fours) + last;
    return now;
}

#define RUN(op, width, value)                                                                     \
    case op:                                                                                      \
        for (const int32_t *end = p + (width) * n; p != end; p += (width))                        \
            c[p[0]] = (value);                                                                    \
        break;
#define NUMBER(i) file[p[i]]
#define NOW(i) c[p[i]]
#define BY(function, i, j) function(file + p[i], file + p[j], k, fours, known++)

ALWAYS_INLINE void run_order(const lag_series *s, int k, int fours)
{
    const int32_t *p = s->stream;
    double *const file = s->file, *const c = file + k;
    double *known = s->known;
    const double over = 1.0 / k;
    for (;;) {
        const int32_t op = *p++, n = *p++;
        switch (op) {
            RUN(SERIES_SUM, 5, NUMBER(1) * NOW(2) + NUMBER(3) * NOW(4))
            RUN(SERIES_SCALE, 3, NUMBER(1) * NOW(2))
            RUN(SERIES_RATE, 2, k * NOW(1))
            RUN(SERIES_MUL, 3, BY(product, 1, 2))
            RUN(SERIES_MULSUM, 6, NUMBER(1) * BY(product, 2, 3) + NUMBER(4) * NOW(5))
            RUN(SERIES_INVERSE, 2, BY(inverse, 1, 0))
            RUN(SERIES_CHAIN, 4, NUMBER(1) * over * BY(chained, 2, 3))
        default: /* SERIES_END */
            return;
        }
    }
}

/* Coefficients of order k > 0 of all series, once those of the state are there. The loops of short
 * convolutions are unrolled: they take most of the time. */
FOR_WIDER static void next_order(const lag_series *s, int k)
{
    const int fours = (k + 1) / 4;
    if (k == 1) {
        run_order(s, 1, 0);
        return;
    }
    switch (fours) {
    case 0: run_order(s, k, 0); break;
    case 1: run_order(s, k, 1); break;
    case 2: run_order(s, k, 2); break;
    case 3: run_order(s, k, 3); break;
    case 4: run_order(s, k, 4); break;
    case 5: run_order(s, k, 5); break;
    case 6: run_order(s, k, 6); break;
    default: run_order(s, k, fours);
    }
}

int lag_series_expand(const lag_series *s, int nq, double t, const double *y)
{
    const int n = 2 * nq + 1, row = s->row, order = s->order;
    double *file = s->file, *time = file + s->first, *state = time + row, *r = s->values.registers;
    r[0] = t;
    memcpy(r + 1, y, 2 * (size_t)nq * sizeof(double));
    lag_stream_run(s->values.stream, r);
    memset(time, 0, (size_t)s->rows * row * sizeof(double));
    memset(s->known, 0, (size_t)s->count * sizeof(double));
    time[0] = t;
    time[1] = 1.0;
    for (int m = 0; m < n; ++m)
        state[m * row] = y[m];
    const int32_t *value = s->values.outputs + s->steady;
    for (int i = n + 2; i < s->rows; ++i)
        time[i * row] = r[*value++];
    for (int m = 0; m < nq; ++m) {
        state[m * row + 1] = y[nq + m];
        state[(nq + m) * row + 1] = r[*value++];
    }
    state[2 * nq * row + 1] = r[*value];
    for (int k = 1; k < order; ++k) {
        const double over = 1.0 / (k + 1);
        next_order(s, k);
        for (int m = 0; m < nq; ++m) {
            double *q = state + m * row + k, *v = q + nq * row;
            q[1] = v[0] * over;
            v[1] = file[s->rates[m] + k] * over;
        }
        state[2 * nq * row + k + 1] = file[s->rates[nq] + k] * over;
    }
    double sum = 0.0;
    for (int m = 0; m < n; ++m)
        sum += state[m * row + order];
    return !isfinite(sum);
}

/* The sums of components m, m + 1, ..., each of coefficients from order 1 on times weights. */
FOR_WIDER static void weigh(const lag_series *s, int m, int count, const double *weight, double *sums)
{
    const int fours = (s->order + 3) / 4;
    for (int i = 0; i < count; ++i) {
        const double *c = &COEFFICIENT(s, m + i, 1);
        double sum[4] = {0.0, 0.0, 0.0, 0.0};
        for (int k = 4 * (fours - 1); k >= 0; k -= 4) /* small terms first */
            for (int l = 0; l < 4; ++l)
                sum[l] += c[k + l] * weight[k + l];
        sums[i] = (sum[3] + sum[2]) + (sum[1] + sum[0]);
    }
}

void lag_series_sum(const lag_series *s, int n, double h, double *y)
{
    double power[MOST_ORDER + 4] = {h};
    for (int k = 1; k < s->order; ++k)
        power[k] = power[k / 2] * power[(k - 1) / 2];
    weigh(s, 0, n, power, y);
    for (int m = 0; m < n; ++m)
        y[m] += COEFFICIENT(s, m, 0);
}

void lag_series_slope(const lag_series *s, int m, int count, double h, double *slope)
{
    double weight[MOST_ORDER + 4] = {1.0}, power = 1.0;
    for (int k = 1; k < s->order; ++k) {
        power *= h;
        weight[k] = (k + 1) * power;
    }
    weigh(s, m, count, weight, slope);
}
