/* The tape evaluator, for one instruction set; see tape.h. The loops over vectors are such that the
 * compiler makes vector instructions of them. */
#include <math.h>
#include <stddef.h>

#include "tape/sincos.h"
#include "tape/tape.h"

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wpsabi" /* vectors are passed only within this file */
#endif

#if defined(__GNUC__)
#define INLINE static inline __attribute__((always_inline))
#else
#define INLINE static inline
#endif

typedef double four __attribute__((vector_size(32), aligned(8), may_alias));
typedef int64_t mask_of_four __attribute__((vector_size(32)));
#define FOUR(x) (*(const four *)(x))
#define TWO_FOURS 8         /* number of elements per iteration of loops over vectors */
#if defined(__has_builtin)
#if __has_builtin(__builtin_shufflevector)
#define EVERY_SECOND(x) __builtin_shufflevector(FOUR(x), FOUR((x) + 4), 0, 2, 4, 6)
#endif
#endif
#if !defined(EVERY_SECOND)
#define EVERY_SECOND(x) ((four){(x)[0], (x)[2], (x)[4], (x)[6]})
#endif

INLINE four magnitudes(four x)
{
    return (four)((mask_of_four)x & INT64_MAX);
}

INLINE four roots(four x)
{
    for (int i = 0; i < 4; ++i)
        x[i] = sqrt(x[i]);
    return x;
}

/* An operand's elements: where they lie side by side, and how far the next eight are from there. */
typedef struct {
    const double *at;
    int next;
} elements;

/* n elements of an operand that do not lie side by side, to a buffer; step LAG_INDEXED: at places. */
static void gather(const double *r, int32_t first, int32_t step, const int32_t *places, int n,
                   double *buffer)
{
    const double *x = r + first;
    int i = 0;
    if (step == LAG_INDEXED) {
        for (; i + 4 <= n; i += 4) {
            const int32_t *at = places + i;
            *(four *)(buffer + i) = (four){r[at[0]], r[at[1]], r[at[2]], r[at[3]]};
        }
        for (; i < n; ++i)
            buffer[i] = r[places[i]];
        return;
    }
    const ptrdiff_t one = step;
    if (step == 2)
        for (; i + 4 < n; i += 4, x += 8) /* not at the end, which may be that of the register file */
            *(four *)(buffer + i) = EVERY_SECOND(x);
    for (; i + 4 <= n; i += 4, x += 4 * one)
        *(four *)(buffer + i) = (four){x[0], x[one], x[2 * one], x[3 * one]};
    for (; i < n; ++i, x += one)
        buffer[i] = *x;
}

/* The next operand of an operation on n elements. */
INLINE elements operand(const double *r, const int32_t **p, int n, double *buffer)
{
    const int32_t first = (*p)[0], step = (*p)[1];
    *p += 2;
    if (step == 1)
        return (elements){r + first, TWO_FOURS};
    if (step == 0) {
        const double x = r[first];
        *(four *)buffer = *(four *)(buffer + 4) = (four){x, x, x, x};
        return (elements){buffer, 0};
    }
    gather(r, first, step, *p, n, buffer);
    if (step == LAG_INDEXED)
        *p += n;
    return (elements){buffer, TWO_FOURS};
}

/* A run of operations of one kind: `width` numbers each, the destination first. */
#define RUN(op, width, value)                                                                     \
    case op:                                                                                      \
        for (const int32_t *end = p + (width) * n; p != end; p += (width))                        \
            r[p[0]] = (value);                                                                    \
        break;
/* What values are made of; roots and magnitudes are taken of vectors, too. */
#define SQRT(x) _Generic((x), double: sqrt, default: roots)(x)
#define ABS(x) _Generic((x), double: fabs, default: magnitudes)(x)
#define SIN(x) sin(x)
#define COS(x) cos(x)
#define LARGER(x, y) fmax(x, y)
#define CHOOSE(condition, x, y) ((condition) ? (x) : (y))

/* An operation on vectors of operands a, b, c; no operand lies where the results do. */
#define VECTOR(op, places, value)                                                                 \
    case LAG_VECTOR + op: {                                                                       \
        double *out = r + *p++;                                                                   \
        elements x = operand(r, &p, n, buffer[0]);                                                \
        elements y = (places) > 2 ? operand(r, &p, n, buffer[1]) : x;                             \
        elements z = (places) > 3 ? operand(r, &p, n, buffer[2]) : y;                             \
        const int rest = n % TWO_FOURS;                                                           \
        for (double *end = out + (n - rest); out != end; out += TWO_FOURS) {                      \
            four first, second;                                                                   \
            {                                                                                     \
                const four a = FOUR(x.at), b = FOUR(y.at), c = FOUR(z.at);                        \
                first = (value);                                                                  \
                (void)a, (void)b, (void)c;                                                        \
            }                                                                                     \
            {                                                                                     \
                const four a = FOUR(x.at + 4), b = FOUR(y.at + 4), c = FOUR(z.at + 4);            \
                second = (value);                                                                 \
                (void)a, (void)b, (void)c;                                                        \
            }                                                                                     \
            *(four *)out = first;                                                                 \
            *(four *)(out + 4) = second;                                                          \
            x.at += x.next, y.at += y.next, z.at += z.next;                                       \
        }                                                                                         \
        for (int k = 0; k < rest; ++k) {                                                          \
            const double a = x.at[k], b = y.at[k], c = z.at[k];                                   \
            out[k] = (value);                                                                     \
            (void)a, (void)b, (void)c;                                                            \
        }                                                                                         \
        break;                                                                                    \
    }

static void run_stream(const int32_t *p, double *r)
{
    double buffer[3][LAG_LONGEST];
    for (;;) {
        const int32_t op = *p++, n = *p++;
        switch (op) {
#define A r[p[1]]
#define B r[p[2]]
#define C r[p[3]]
            LAG_LIBRARY_OPERATIONS(RUN)
            LAG_RELATION_OPERATIONS(RUN)
            LAG_BATCH_OPERATIONS(RUN)
            LAG_VECTOR_OPERATIONS(RUN)
#undef A
#undef B
#undef C
        case OP_SINCOS:
            for (const int32_t *end = p + 3 * n; p != end; p += 3) {
                const double x = r[p[2]];
                SINCOS(x, r + p[0], r + p[1]);
            }
            break;
#define A a
#define B b
#define C c
            LAG_VECTOR_OPERATIONS(VECTOR)
#undef A
#undef B
#undef C
        default: /* OP_END */
            return;
        }
    }
}
