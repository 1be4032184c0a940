#include "lanes.h"

const lag_lane_kernel *lag_lanes_kernel(int portable)
{
#if defined(__x86_64__)
    if (!portable && __builtin_cpu_supports("avx2"))
        return &lag_lanes_avx2;
#endif
    (void)portable;
    return &lag_lanes_default;
}

/* Destinations and operands of an operation. */
static int places_of(int32_t op)
{
    switch (op) {
    case OP_NEG: case OP_SQRT: case OP_SIN: case OP_COS: case OP_TAN: case OP_ASIN: case OP_ACOS:
    case OP_ATAN: case OP_SINH: case OP_COSH: case OP_TANH: case OP_ASINH: case OP_ACOSH:
    case OP_ATANH: case OP_EXP: case OP_LOG: case OP_ERF: case OP_ERFC: case OP_FLOOR:
    case OP_CEIL: case OP_ABS: case OP_NOT: case OP_MOVE:
        return 2;
    case OP_SELECT: case OP_MULADD: case OP_MULSUB: case OP_SUBMUL:
        return 4;
    default:
        return 3;
    }
}

void lag_lanes_stream(const int32_t *p, int32_t *out)
{
    for (;;) {
        const int32_t op = *out++ = *p++, count = *out++ = *p++;
        if (op == OP_END)
            return;
        const int32_t *end = p + (long)places_of(op) * count;
        while (p != end)
            *out++ = LAG_LANES * *p++;
    }
}

void lag_lanes_leave(lag_lanes *s, int l)
{
    s->status[s->run[l]] = LAG_LANE_LEFT;
    s->free_slots[s->free_count++] = s->slot[l];
    s->run[l] = -1;
}
