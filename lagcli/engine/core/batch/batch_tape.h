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
/* The same with a function of the C library, lane by lane. */
#define RUN_SINGLY(op, width, value)                                                              \
    case op:                                                                                      \
        for (const int32_t *end = p + (width) * n; p != end; p += (width))                        \
            EACH_LANE (l)                                                                         \
                r[p[0] + l] = (value);                                                            \
        break;
/* A comparison: 1 where it holds. */
#define RUN_RELATION(op, width, value) RUN(op, width, (vec)((value) & (mask)all(1.0)))
#define SQRT(x) root(x)
#define ABS(x) magnitude(x)
#define SIN(x) vec_sin(x)
#define COS(x) vec_cos(x)
#define LARGER(x, y) larger(x, y)
#define CHOOSE(condition, x, y) choose(condition, x, y)

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

static void batch_run(const int32_t *p, double *r)
{
    for (;;) {
        const int32_t op = *p++, n = *p++;
        switch (op) {
#define A READ(a + k)
#define B READ(b + k)
#define C READ(c + k)
            LAG_RELATION_OPERATIONS(RUN_RELATION)
            LAG_BATCH_OPERATIONS(RUN)
            LAG_VECTOR_OPERATIONS(RUN)
#undef A
#undef B
#undef C
#define A r[p[1] + l]
#define B r[p[2] + l]
            LAG_LIBRARY_OPERATIONS(RUN_SINGLY)
#undef A
#undef B
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

/* The same of four lanes, for machine code. */
#define FOUR_LANES 4
#define OF_PARTS(op, width, value)                                                                \
    static inline void lanes_##op(const double *a, const double *b, double *to)                          \
    {                                                                                             \
        (void)b;                                                                                  \
        for (int k = 0; k < FOUR_LANES; k += VEC)                                                 \
            AT(to + k) = (value);                                                                 \
    }
#define OF_LANES(op, width, value)                                                                \
    static inline void lanes_##op(const double *a, const double *b, double *to)                          \
    {                                                                                             \
        (void)b;                                                                                  \
        for (int l = 0; l < FOUR_LANES; ++l)                                                      \
            to[l] = (value);                                                                      \
    }
#define A READ(a + k)
#define B READ(b + k)
#define C READ(b + k)
LAG_BATCH_OPERATIONS(OF_PARTS)
#undef A
#undef B
#undef C
#define A a[l]
#define B b[l]
LAG_LIBRARY_OPERATIONS(OF_LANES)
#undef A
#undef B

static void lanes_sincos(const double *angles, double *sines, double *cosines)
{
    for (int k = 0; k < FOUR_LANES; k += VEC) {
        vec sine, cosine;
        vec_sincos(READ(angles + k), &sine, &cosine);
        AT(sines + k) = sine;
        AT(cosines + k) = cosine;
    }
}

#define CALL(op) [op] = (lag_called *)lanes_##op
#define CALLED(op, width, value) CALL(op),
static const lag_calls batch_calls = {
    {LAG_LIBRARY_OPERATIONS(CALLED) CALL(OP_SIN), CALL(OP_COS), [OP_SINCOS] = (lag_called *)lanes_sincos}};

/* Run one of a tape's routines. */
static void batch_tape_run(const lag_batch_tape *tape, const lag_routine *routine)
{
    const lag_native *native = routine->native;
    if (native && native->run) {
        for (int l = 0; l < LAG_LANES; l += FOUR_LANES)
            native->run(tape->registers + l, native->frame);
        return;
    }
    batch_run(routine->code, tape->registers);
    if (lag_native_due(routine))
        lag_batch_emit(tape, routine, &batch_calls);
}

#undef OF_PARTS
#undef OF_LANES
#undef CALL
#undef CALLED
#undef RUN
#undef RUN_SINGLY
#undef RUN_RELATION
#undef SQRT
#undef ABS
#undef SIN
#undef COS
#undef LARGER
#undef CHOOSE
