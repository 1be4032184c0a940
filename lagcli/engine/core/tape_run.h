/* The tape evaluator, for one instruction set; see tape.h. The loops over vectors are such that the
 * compiler makes vector instructions of them. */
#include <math.h>
#include <stddef.h>

#include "tape.h"

#if defined(__GLIBC__)
#define SINCOS(x, s, c) sincos(x, s, c)
#else
#define SINCOS(x, s, c) (*(s) = sin(x), *(c) = cos(x))
#endif
#if defined(__GNUC__)
#define INLINE static inline __attribute__((always_inline))
#else
#define INLINE static inline
#endif

typedef double four __attribute__((vector_size(32), aligned(8), may_alias));
typedef int64_t mask_of_four __attribute__((vector_size(32)));
#define FOUR(x) (*(const four *)(x))
#define TWO_FOURS 8         /* elements that loops over vectors take at a time */
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
        for (; i + 4 < n; i += 4, x += 8) /* not at the end, which may be that of the file */
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
#define A r[p[1]]
#define B r[p[2]]
#define C r[p[3]]

/* An operation on vectors of operands a, b, c; no operand lies where the results do. */
#define ELEMENTS(four_value, value)                                                               \
    const int rest = n % TWO_FOURS;                                                               \
    for (double *end = out + (n - rest); out != end; out += TWO_FOURS) {                          \
        four first, second;                                                                       \
        {                                                                                         \
            const four a = FOUR(x.at), b = FOUR(y.at), c = FOUR(z.at);                            \
            first = (four_value);                                                                 \
            (void)a, (void)b, (void)c;                                                            \
        }                                                                                         \
        {                                                                                         \
            const four a = FOUR(x.at + 4), b = FOUR(y.at + 4), c = FOUR(z.at + 4);                \
            second = (four_value);                                                                \
            (void)a, (void)b, (void)c;                                                            \
        }                                                                                         \
        *(four *)out = first;                                                                     \
        *(four *)(out + 4) = second;                                                              \
        x.at += x.next, y.at += y.next, z.at += z.next;                                           \
    }                                                                                             \
    for (int k = 0; k < rest; ++k) {                                                              \
        const double a = x.at[k], b = y.at[k], c = z.at[k];                                       \
        out[k] = (value);                                                                         \
        (void)a, (void)b, (void)c;                                                                \
    }                                                                                             \
    break;
#define VECTOR_1(op, four_value, value)                                                           \
    case LAG_VECTOR + op: {                                                                       \
        double *out = r + *p++;                                                                   \
        elements x = operand(r, &p, n, buffer[0]), y = x, z = x;                                  \
        ELEMENTS(four_value, value)                                                               \
    }
#define VECTOR_2(op, value)                                                                       \
    case LAG_VECTOR + op: {                                                                       \
        double *out = r + *p++;                                                                   \
        elements x = operand(r, &p, n, buffer[0]), y = operand(r, &p, n, buffer[1]), z = y;       \
        ELEMENTS(value, value)                                                                    \
    }
#define VECTOR_3(op, value)                                                                       \
    case LAG_VECTOR + op: {                                                                       \
        double *out = r + *p++;                                                                   \
        elements x = operand(r, &p, n, buffer[0]), y = operand(r, &p, n, buffer[1]);              \
        elements z = operand(r, &p, n, buffer[2]);                                                \
        ELEMENTS(value, value)                                                                    \
    }

static void run_stream(const int32_t *p, double *r)
{
    double buffer[3][LAG_LONGEST];
    for (;;) {
        const int32_t op = *p++, n = *p++;
        switch (op) {
            RUN(OP_ADD, 3, A + B)
            RUN(OP_SUB, 3, A - B)
            RUN(OP_MUL, 3, A * B)
            RUN(OP_DIV, 3, A / B)
            RUN(OP_NEG, 2, -A)
            RUN(OP_POW, 3, pow(A, B))
            RUN(OP_SQRT, 2, sqrt(A))
            RUN(OP_SIN, 2, sin(A))
            RUN(OP_COS, 2, cos(A))
            RUN(OP_TAN, 2, tan(A))
            RUN(OP_ASIN, 2, asin(A))
            RUN(OP_ACOS, 2, acos(A))
            RUN(OP_ATAN, 2, atan(A))
            RUN(OP_ATAN2, 3, atan2(A, B))
            RUN(OP_SINH, 2, sinh(A))
            RUN(OP_COSH, 2, cosh(A))
            RUN(OP_TANH, 2, tanh(A))
            RUN(OP_ASINH, 2, asinh(A))
            RUN(OP_ACOSH, 2, acosh(A))
            RUN(OP_ATANH, 2, atanh(A))
            RUN(OP_EXP, 2, exp(A))
            RUN(OP_LOG, 2, log(A))
            RUN(OP_ERF, 2, erf(A))
            RUN(OP_ERFC, 2, erfc(A))
            RUN(OP_FLOOR, 2, floor(A))
            RUN(OP_CEIL, 2, ceil(A))
            RUN(OP_ABS, 2, fabs(A))
            RUN(OP_LT, 3, A < B)
            RUN(OP_LE, 3, A <= B)
            RUN(OP_EQ, 3, A == B)
            RUN(OP_NE, 3, A != B)
            RUN(OP_AND, 3, A * B)
            RUN(OP_OR, 3, fmax(A, B))
            RUN(OP_NOT, 2, 1.0 - A)
            RUN(OP_SELECT, 4, A != 0.0 ? B : C)
            RUN(OP_MULADD, 4, A * B + C)
            RUN(OP_MULSUB, 4, A * B - C)
            RUN(OP_SUBMUL, 4, C - A * B)
        case OP_SINCOS:
            for (const int32_t *end = p + 3 * n; p != end; p += 3) {
                const double x = r[p[2]];
                SINCOS(x, r + p[0], r + p[1]);
            }
            break;
            VECTOR_1(OP_MOVE, a, a)
            VECTOR_2(OP_ADD, a + b)
            VECTOR_2(OP_SUB, a - b)
            VECTOR_2(OP_MUL, a * b)
            VECTOR_2(OP_DIV, a / b)
            VECTOR_1(OP_NEG, -a, -a)
            VECTOR_1(OP_SQRT, roots(a), sqrt(a))
            VECTOR_1(OP_ABS, magnitudes(a), fabs(a))
            VECTOR_3(OP_MULADD, a * b + c)
            VECTOR_3(OP_MULSUB, a * b - c)
            VECTOR_3(OP_SUBMUL, c - a * b)
        default: /* OP_END */
            return;
        }
    }
}
