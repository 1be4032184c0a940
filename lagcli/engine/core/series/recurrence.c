#include "series/series.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "series/inline.h"
#include "series/rows.h"
#include "series/layers.h"
#include "tape/vectors.h"

/* In loops over operations of a few instructions, dispatch is much of the work. */
#if defined(__GNUC__) && !defined(__clang__)
#define TWO_AT_A_TIME _Pragma("GCC unroll 2")
#else
#define TWO_AT_A_TIME
#endif
#define RUN(op, value)                                                                            \
    case SERIES_##op:                                                                             \
        TWO_AT_A_TIME for (int left = n; left > 0; --left, p += SERIES_##op##_PLACES)             \
            c[p[0]] = (value);                                                                    \
        break;
#define NUMBER(i) file[p[i]]
#define NOW(i) c[p[i]]
#define BY(function, i, j) function(file + p[i], file + p[j], k, fours, known++)

ALWAYS_INLINE void run_order(const lag_series *s, int k, int fours)
{
    const int32_t *p = s->stream;
    double *const file = s->file, *const c = file + s->origin + (ptrdiff_t)k * s->layer;
    double *const next = c + s->layer;
    double *known = s->known;
    const double over = 1.0 / k, over_next = 1.0 / (k + 1);
    for (;;) {
        const int32_t op = *p++, n = *p++;
        switch (op) {
            RUN(SUM, NUMBER(1) * NOW(2) + NUMBER(3) * NOW(4))
            RUN(SCALE, NUMBER(1) * NOW(2))
            RUN(RATE, k * NOW(1))
            RUN(MUL, BY(product, 1, 2))
            RUN(MULSUM, NUMBER(1) * BY(product, 2, 3) + NUMBER(4) * NOW(5))
            RUN(INVERSE, BY(inverse, 1, 2))
            RUN(CHAIN, NUMBER(1) * over * BY(past, 2, 3))
            RUN(MUL_TAIL, BY(past, 1, 2))
            RUN(MUL_TAIL_SUM, NUMBER(1) * BY(past, 2, 3) + NUMBER(4) * NOW(5))
        case SERIES_INTEGRATE:
            for (const int32_t *end = p + 2 * n; p != end; p += 2)
                next[p[0]] = NOW(1) * over_next;
            break;
        case SERIES_TO_ROW:
            for (const int32_t *end = p + 2 * n; p != end; p += 2)
                file[p[0] + k] = NOW(1);
            break;
        case SERIES_END:
            return;
        default:
            p = lag_series_run_vector(s, op - LAG_VECTOR, n, p, k);
        }
    }
}

/* Coefficients of order k > 0 of all series, once those of the state are there. The loops of short
 * convolutions are unrolled: they take most of the time. */
FOR_WIDER static void next_order(const lag_series *s, int k)
{
    const int fours = k == s->order - 1 ? 0 : (k + 1) / 4; /* no order follows the last */
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

void lag_series_invariant(const lag_series *series)
{
    for (int i = 0; i < series->invariant; ++i)
        series->file[i] = OUT(&series->values, i);
}

int lag_series_expand(const lag_series *s, int nq, double t, const double *y)
{
    const int n = 2 * nq + 1, order = s->order;
    const int32_t *state = s->state, *value = s->values.outputs + s->invariant;
    double *file = s->file, *now = file + s->origin, *next = now + s->layer, *r = s->values.registers;
    r[0] = t;
    memcpy(r + 1, y, 2 * (size_t)nq * sizeof(double));
    lag_tape_run(&s->values, &s->values.stream);
    memset(s->known, 0, (size_t)s->count * sizeof(double));
    s->values.vectors->pick(s->numbers - s->invariant, r, value, file + s->invariant);
    value += s->numbers - s->invariant;
    for (int i = 0; i < s->begin_count; ++i)
        file[s->begins[i]] = r[*value++];
    now[*state] = t;
    next[*state++] = 1.0;
    for (int m = 0; m < n; ++m) {
        now[state[m]] = y[m];
        next[state[m]] = m < nq ? y[nq + m] : r[*value++];
    }
    for (int k = 1; k < order; ++k)
        next_order(s, k);
    double sum = 0.0;
    for (int m = 0; m < n; ++m)
        sum += COEFFICIENT(s, m, order);
    return !isfinite(sum);
}

/* The sums of components m, m + 1, ... to the last one: coefficients of an order on, times weights,
 * the first of which is 1. */
FOR_WIDER static void weigh(const lag_series *s, int m, int count, int from, const double *weight,
                            double *sums)
{
    const int terms = s->order - from;
    if (s->layer > 1) { /* the state's families lie side by side, and W comes last */
        const int first = s->state[1 + m], size = s->state[m + count] + 1 - first;
        const double *c = &COEFFICIENT(s, m, from);
        int number[LAG_SERIES_ORDER];
        double reversed[LAG_SERIES_ORDER], *side_by_side = &COEFFICIENT(s, m + count - 1, s->order) + 1;
        for (int k = 0; k < terms; ++k) { /* small terms first */
            number[k] = terms - k;
            reversed[k] = weight[terms - k];
        }
        s->values.vectors->combine(size, c, terms, c, s->layer, number, reversed, 1.0, side_by_side);
        s->values.vectors->pick(count, side_by_side - first, s->state + 1 + m, sums);
        return;
    }
    const int fours = (terms + 3) / 4;
    for (int i = 0; i < count; ++i) {
        const double *c = &COEFFICIENT(s, m + i, from);
        four sum = {0};
        for (int k = 4 * (fours - 1); k >= 0; k -= 4)
            sum = plus(sum, times(forwards(c + 1 + k), forwards(weight + 1 + k)));
        sums[i] = c[0] + total(sum);
    }
}

void lag_series_sum(const lag_series *s, int n, double h, double *y)
{
    double power[LAG_SERIES_ORDER + 4] = {1.0, h};
    for (int k = 2; k <= s->order; ++k)
        power[k] = power[k / 2] * power[k - k / 2];
    weigh(s, 0, n, 0, power, y);
}

void lag_series_slope(const lag_series *s, int m, int count, double h, double *slope)
{
    double weight[LAG_SERIES_ORDER + 4] = {1.0}, power = 1.0;
    for (int k = 1; k < s->order; ++k) {
        power *= h;
        weight[k] = (k + 1) * power;
    }
    weigh(s, m, count, 1, weight, slope);
}
