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

/* Destinations and operands of each operation. */
static const int places[] = LAG_PLACES;

void lag_lanes_stream(const int32_t *p, int32_t *out)
{
    for (;;) {
        const int32_t op = *out++ = *p++, count = *out++ = *p++;
        if (op == OP_END)
            return;
        const int32_t *end = p + (long)places[op] * count;
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
