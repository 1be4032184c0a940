#include "series/layers.h"

#include <stddef.h>

#include "series/inline.h"

/* The operands of each operation. */
static const int operands_of[] = LAG_SERIES_OPERANDS;

#define TOGETHER 8               /* largest number of convolutions computed together */

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

/* A single one. */
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

/* n elements: copied to the buffer if they are not contiguous. */
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

/* Elements PACK at a time; the last ones overlap. */
#define ELEMENTS(value)                                                                           \
    for (int i = 0; i < n - PACK; i += PACK)                                                      \
        *(pack *)(out + i) = (value);                                                             \
    {                                                                                             \
        const int i = n - PACK;                                                                   \
        *(pack *)(out + i) = (value);                                                             \
    }                                                                                             \
    break;

FOR_WIDER const int32_t *lag_series_run_vector(const lag_series *series, int32_t op, int n,
                                               const int32_t *p, int k)
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
