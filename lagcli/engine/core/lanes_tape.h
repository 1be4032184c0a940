/* The tape evaluator on eight register files; see tape.c for one. */

/* A run of operations of one kind: the destination, then the operands. Places are read before
 * anything is written, for all that the compiler knows is that it may be written over them. */
#define RUN(op, width, value)                                                                     \
    case op:                                                                                      \
        for (const int32_t *end = p + (width) * n; p != end; p += (width)) {                      \
            double *to = r + p[0];                                                                \
            const double *a = r + p[1], *b = r + p[(width) > 2 ? 2 : 1],                          \
                         *c = r + p[(width) > 3 ? 3 : 1];                                         \
            (void)b, (void)c;                                                                     \
            EACH_PART (k)                                                                         \
                AT(to + k) = (value);                                                             \
        }                                                                                         \
        break;
/* The same, left to the C library lane by lane. */
#define RUN_SINGLY(op, width, value)                                                              \
    case op:                                                                                      \
        for (const int32_t *end = p + (width) * n; p != end; p += (width))                        \
            EACH_LANE (l)                                                                         \
                r[p[0] + l] = (value);                                                            \
        break;
#define A READ(a + k)
#define B READ(b + k)
#define C READ(c + k)
#define A_SINGLE r[p[1] + l]
#define B_SINGLE r[p[2] + l]
#define TRUTH(condition) ((vec)((condition) & (mask)all(1.0)))

INLINE vec vec_sin(vec x)
{
    vec sine, cosine;
    vec_sincos(x, &sine, &cosine);
    return sine;
}

INLINE vec vec_cos(vec x)
{
    vec sine, cosine;
    vec_sincos(x, &sine, &cosine);
    return cosine;
}

static void lanes_run(const int32_t *p, double *r)
{
    for (;;) {
        const int32_t op = *p++, n = *p++;
        switch (op) {
            RUN(OP_ADD, 3, A + B)
            RUN(OP_SUB, 3, A - B)
            RUN(OP_MUL, 3, A * B)
            RUN(OP_DIV, 3, A / B)
            RUN(OP_NEG, 2, -A)
            RUN(OP_MOVE, 2, A)
            RUN_SINGLY(OP_POW, 3, pow(A_SINGLE, B_SINGLE))
            RUN(OP_SQRT, 2, root(A))
            RUN(OP_SIN, 2, vec_sin(A))
            RUN(OP_COS, 2, vec_cos(A))
            RUN_SINGLY(OP_TAN, 2, tan(A_SINGLE))
            RUN_SINGLY(OP_ASIN, 2, asin(A_SINGLE))
            RUN_SINGLY(OP_ACOS, 2, acos(A_SINGLE))
            RUN_SINGLY(OP_ATAN, 2, atan(A_SINGLE))
            RUN_SINGLY(OP_ATAN2, 3, atan2(A_SINGLE, B_SINGLE))
            RUN_SINGLY(OP_SINH, 2, sinh(A_SINGLE))
            RUN_SINGLY(OP_COSH, 2, cosh(A_SINGLE))
            RUN_SINGLY(OP_TANH, 2, tanh(A_SINGLE))
            RUN_SINGLY(OP_ASINH, 2, asinh(A_SINGLE))
            RUN_SINGLY(OP_ACOSH, 2, acosh(A_SINGLE))
            RUN_SINGLY(OP_ATANH, 2, atanh(A_SINGLE))
            RUN_SINGLY(OP_EXP, 2, exp(A_SINGLE))
            RUN_SINGLY(OP_LOG, 2, log(A_SINGLE))
            RUN_SINGLY(OP_ERF, 2, erf(A_SINGLE))
            RUN_SINGLY(OP_ERFC, 2, erfc(A_SINGLE))
            RUN_SINGLY(OP_FLOOR, 2, floor(A_SINGLE))
            RUN_SINGLY(OP_CEIL, 2, ceil(A_SINGLE))
            RUN(OP_ABS, 2, magnitude(A))
            RUN(OP_LT, 3, TRUTH(A < B))
            RUN(OP_LE, 3, TRUTH(A <= B))
            RUN(OP_EQ, 3, TRUTH(A == B))
            RUN(OP_NE, 3, TRUTH(A != B))
            RUN(OP_AND, 3, A * B)
            RUN(OP_OR, 3, larger(A, B))
            RUN(OP_NOT, 2, 1.0 - A)
            RUN(OP_SELECT, 4, choose(A != 0.0, B, C))
            RUN(OP_MULADD, 4, A * B + C)
            RUN(OP_MULSUB, 4, A * B - C)
            RUN(OP_SUBMUL, 4, C - A * B)
        case OP_SINCOS:
            for (const int32_t *end = p + 3 * n; p != end; p += 3) {
                double *sines = r + p[0], *cosines = r + p[1];
                const double *angles = r + p[2];
                EACH_PART (k) {
                    vec sine, cosine;
                    vec_sincos(READ(angles + k), &sine, &cosine);
                    AT(sines + k) = sine;
                    AT(cosines + k) = cosine;
                }
            }
            break;
        default: /* OP_END */
            return;
        }
    }
}

#undef RUN
#undef RUN_SINGLY
#undef A
#undef B
#undef C
#undef A_SINGLE
#undef B_SINGLE
#undef TRUTH
