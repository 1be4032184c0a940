#include "methods/series.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "tape/vectors.h"

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wpsabi" /* vectors are passed within this file alone */
#endif

/* Wider registers give the same numbers: the widest there are is chosen when the program is loaded. */
#if defined(__x86_64__) && defined(__gnu_linux__) && defined(__GNUC__) && !defined(__clang__)
#define FOR_WIDER __attribute__((target_clones("avx2", "default")))
#else
#define FOR_WIDER
#endif
/* In loops over operations of a few instructions, going on to the next one is much of the work. */
#if defined(__GNUC__) && !defined(__clang__)
#define TWO_AT_A_TIME _Pragma("GCC unroll 2")
#else
#define TWO_AT_A_TIME
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

/* The operands that each operation has. */
static const int operands_of[] = LAG_SERIES_OPERANDS;

/* Four numbers side by side. */
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

/* Coefficient k of a convolution without x[0] y[k]: y[k] is not there yet, or x[0] is zero. */
ALWAYS_INLINE double past(const double *x, const double *y, int k, int fours, double *known)
{
    const double before = k == 1 ? 0.0 : x[1] * y[k - 1];
    const double now = *known + x[k] * y[0] + before;
    *known = k == 1 ? 0.0 : convolve(x, y, k, fours) + x[k] * y[1];
    return now;
}

/* Vectors of series in layers. */

#define TOGETHER 8               /* convolutions that are made together, at most */

#if defined(__GNUC__)
#define PACK 4
typedef double pack __attribute__((vector_size(32), aligned(8), may_alias));
#else
#define PACK 1
typedef double pack;
#endif

/* x_first y_{k - first} + ... + x_last y_{k - last}, of some series side by side. */
ALWAYS_INLINE void convolve_packs(double *out, const double *x, const double *y, ptrdiff_t layer,
                                  int first, int last, int packs)
{
    pack sum[4];
    for (int l = 0; l < packs; ++l)
        sum[l] = (pack){0.0};
    x += first * layer;
    y -= first * layer;
    for (int j = first; j <= last; ++j, x += layer, y -= layer)
        for (int l = 0; l < packs; ++l)
            sum[l] += *(const pack *)(x + PACK * l) * *(const pack *)(y + PACK * l);
    for (int l = 0; l < packs; ++l)
        *(pack *)(out + PACK * l) = sum[l];
}

/* Convolutions out = x y of n series side by side, x at order 0 and y at order k. */
typedef struct {
    double *out;
    const double *x, *y;
} convolution;

/* Several of them, some elements at a time, since they share series; n >= 2 PACK, the last elements
 * overlap with those before. */
ALWAYS_INLINE void convolutions(const convolution *of, int count, ptrdiff_t layer, int first, int last,
                                int n)
{
    const int packs = n >= 4 * PACK ? 4 : 2;
    for (int i = 0; i < n; i += packs * PACK) {
        i = i + packs * PACK <= n ? i : n - packs * PACK;
        for (const convolution *c = of; c < of + count; ++c)
            if (packs == 4)
                convolve_packs(c->out + i, c->x + i, c->y + i, layer, first, last, 4);
            else
                convolve_packs(c->out + i, c->x + i, c->y + i, layer, first, last, 2);
    }
}

/* One of them. */
ALWAYS_INLINE void convolve_series(double *out, const double *x, const double *y, ptrdiff_t layer, int first,
                                   int last, int n)
{
    const convolution of = {out, x, y};
    convolutions(&of, 1, layer, first, last, n);
}

/* Coefficient k of n products; of a square half the terms are the others. */
ALWAYS_INLINE void products(double *out, const double *x, const double *y, ptrdiff_t layer, int k, int n)
{
    if (x != y) {
        convolve_series(out, x - k * layer, y, layer, 0, k, n);
        return;
    }
    const double *middle = x - (k - k / 2) * layer;
    convolve_series(out, x - k * layer, x, layer, 0, (k - 1) / 2, n);
    if (k % 2)
        for (int i = 0; i < n; ++i)
            out[i] = 2.0 * out[i];
    else
        for (int i = 0; i < n; ++i)
            out[i] = 2.0 * out[i] + middle[i] * middle[i];
}

/* Where an operand's elements are, side by side; `each` is −1, or 0 where one stands for all. */
typedef struct {
    const double *at;
    ptrdiff_t each;
} elements;

#define PACK_OF(x, i) (*(const pack *)((x).at + ((i) & (x).each)))

/* n elements: in the buffer, if they do not lie side by side. */
ALWAYS_INLINE elements operand(const double *x, const int32_t *p, int n, double *buffer)
{
    const ptrdiff_t step = p[1];
    int i = 0;
    if (step == 1)
        return (elements){x + p[0], -1};
    if (step == LAG_INDEXED) {
        p += 2;
#if PACK == 4
        for (; i + PACK <= n; i += PACK)
            *(pack *)(buffer + i) = (pack){x[p[i]], x[p[i + 1]], x[p[i + 2]], x[p[i + 3]]};
#endif
        for (; i < n; ++i)
            buffer[i] = x[p[i]];
        return (elements){buffer, -1};
    }
    x += p[0];
#if PACK == 4
    for (; i + PACK <= n; i += PACK, x += PACK * step)
        *(pack *)(buffer + i) = (pack){x[0], x[step], x[2 * step], x[3 * step]};
#endif
    for (; i < n; ++i, x += step)
        buffer[i] = *x;
    return (elements){buffer, -1};
}

/* Numbers: one for all elements, or each its own. */
ALWAYS_INLINE elements numbers(const double *file, const int32_t *p, double *buffer)
{
    if (p[1])
        return (elements){file + p[0], -1};
    for (int i = 0; i < PACK; ++i)
        buffer[i] = file[p[0]];
    return (elements){buffer, 0};
}

static const int32_t *after(const int32_t *p, int n)
{
    return p + (p[1] == LAG_INDEXED ? 2 + n : 2);
}

/* Elements PACK at a time, the last ones with some of those before. */
#define ELEMENTS(value)                                                                           \
    for (int i = 0; i < n - PACK; i += PACK)                                                      \
        *(pack *)(out + i) = (value);                                                             \
    {                                                                                             \
        const int i = n - PACK;                                                                   \
        *(pack *)(out + i) = (value);                                                             \
    }                                                                                             \
    break;

/* Coefficient k of an operation on vectors. Returns what follows it in the stream. */
FOR_WIDER static const int32_t *run_vector(const lag_series *series, int32_t op, int n, const int32_t *p,
                                           int k)
{
    double made[LAG_SERIES_LONGEST], buffer[2][LAG_SERIES_LONGEST], apart[LAG_SERIES_LONGEST], same[2][PACK];
    const ptrdiff_t layer = series->layer;
    const double *const file = series->file;
    double *const now = series->file + series->origin + k * layer;
    double *const to = op == SERIES_INTEGRATE ? now + layer : now;
    double *const out = p[1] == 1 ? to + p[0] : apart;
    const int32_t *o[5] = {after(p, n)}; /* the operands */
    for (int i = 1; i < operands_of[op]; ++i)
        o[i] = after(o[i - 1], n);
    const elements m = {made, -1};
#define CONVOLVED(i) (now + o[i][0])
#define VALUES(j, place) operand(now, o[j], n, buffer[place])
#define NUMBERS(j, place) numbers(file, o[j], same[place])
#define A PACK_OF(a, i)
#define B PACK_OF(b, i)
#define S PACK_OF(s, i)
#define T PACK_OF(t, i)
#define MADE PACK_OF(m, i)
    switch (op) {
    case SERIES_SUM: {
        const elements s = NUMBERS(0, 0), a = VALUES(1, 0), t = NUMBERS(2, 1), b = VALUES(3, 1);
        ELEMENTS(S * A + T * B)
    }
    case SERIES_SCALE: {
        const elements s = NUMBERS(0, 0), a = VALUES(1, 0);
        ELEMENTS(S * A)
    }
    case SERIES_RATE: {
        const elements a = VALUES(0, 0);
        ELEMENTS((double)k * A)
    }
    case SERIES_INTEGRATE: {
        const elements a = VALUES(0, 0);
        const double over = 1.0 / (k + 1);
        ELEMENTS(over * A)
    }
    case SERIES_COPY: {
        const elements a = operand(now, o[0], n, out);
        if (a.at == out)
            break;
        ELEMENTS(A)
    }
    case SERIES_MUL:
        products(out, CONVOLVED(0), CONVOLVED(1), layer, k, n);
        break;
    case SERIES_MULSUM: {
        const elements s = NUMBERS(0, 0), t = NUMBERS(3, 1), b = VALUES(4, 1);
        products(made, CONVOLVED(1), CONVOLVED(2), layer, k, n);
        ELEMENTS(S * MADE + T * B)
    }
    case SERIES_MUL_TAIL: { /* with those that follow: the matrix depends on none of them */
        convolution of[TOGETHER] = {{out, CONVOLVED(0) - k * layer, CONVOLVED(1)}};
        const int32_t *next = o[1] + 2;
        int count = 1;
        if (out == apart) {
            convolutions(of, count, layer, 1, k, n);
            break;
        }
        for (; count < TOGETHER && next[0] == LAG_VECTOR + op && next[1] == n && next[3] == 1; next += 8)
            of[count++] = (convolution){now + next[2], now + next[4] - k * layer, now + next[6]};
        convolutions(of, count, layer, 1, k, n);
        return next;
    }
    case SERIES_INVERSE: {
        const elements b = {CONVOLVED(1) - k * layer, -1};
        convolve_series(made, CONVOLVED(0) - k * layer, CONVOLVED(1), layer, 1, k, n);
        ELEMENTS(-B * MADE)
    }
    default: { /* SERIES_CHAIN */
        const elements s = NUMBERS(0, 0);
        const double over = 1.0 / k;
        convolve_series(made, CONVOLVED(1) - k * layer, CONVOLVED(2), layer, 1, k, n);
        ELEMENTS(S * over * MADE)
    }
    }
    if (out == apart)
        for (int i = 0; i < n; ++i)
            to[p[1] == LAG_INDEXED ? p[2 + i] : p[0] + i * (ptrdiff_t)p[1]] = apart[i];
    return after(o[operands_of[op] - 1], n);
}

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
            p = run_vector(s, op - LAG_VECTOR, n, p, k);
        }
    }
}

/* Coefficients of order k > 0 of all series, once those of the state are there. The loops of short
 * convolutions are unrolled: they take most of the time. */
FOR_WIDER static void next_order(const lag_series *s, int k)
{
    const int fours = k == s->order - 1 ? 0 : (k + 1) / 4; /* no order comes after the last */
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
    lag_stream_run(s->values.stream, r);
    memset(s->known, 0, (size_t)s->count * sizeof(double));
    lag_vectors()->pick(s->numbers - s->invariant, r, value, file + s->invariant);
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
        const double *c = &COEFFICIENT(s, m, from), *x[LAG_SERIES_ORDER];
        double reversed[LAG_SERIES_ORDER], *side_by_side = &COEFFICIENT(s, m + count - 1, s->order) + 1;
        for (int k = 0; k < terms; ++k) { /* small terms first */
            x[k] = c + (terms - k) * (ptrdiff_t)s->layer;
            reversed[k] = weight[terms - k];
        }
        lag_vectors()->combine(size, c, terms, x, reversed, side_by_side);
        lag_vectors()->pick(count, side_by_side - first, s->state + 1 + m, sums);
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
