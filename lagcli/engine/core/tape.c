#define _GNU_SOURCE /* sincos */
#include "tape.h"

#include <math.h>

#if defined(__GLIBC__)
#define SINCOS(x, s, c) sincos(x, s, c)
#else
#define SINCOS(x, s, c) (*(s) = sin(x), *(c) = cos(x))
#endif

/* A run of operations of one kind: `width` numbers each, the destination first. */
#define RUN(op, width, value)                                                                     \
    case op:                                                                                      \
        for (const int32_t *end = p + (width) * n; p != end; p += (width))                        \
            r[p[0]] = (value);                                                                    \
        break;
#define A r[p[1]]
#define B r[p[2]]
#define C r[p[3]]

void lag_stream_run(const int32_t *p, double *r)
{
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
        default: /* OP_END */
            return;
        }
    }
}
