#include "native/native.h"

#include "native/emit.h"
#include "native/machine.h"
#include "native/pages.h"
#include "tape/stream.h"

/* A stream is emitted once its interpretation has taken as long as emission takes, so that no run waits for code more
 * than twice the time that the better choice would have taken: CALLS calls, and FIXED words of a stream for what all
 * streams need. docs/decisions/2026-11-native-code.md has the measurement. */
#define CALLS 100
#define FIXED 200000

typedef struct {
    lag_native native;                 /* first */
    lag_memory from;
    lag_pages pages;
    void *frame;                       /* where the frame's memory begins */
} emitted;

#define LINE 64 /* bytes of a cache line */

/* A frame for code, aligned. Returns 0, or 1 where there is no memory. */
static int make_frame(emitted *own, int32_t numbers)
{
    own->frame = own->from.allocate(own->from.context, (size_t)numbers * sizeof(double) + LINE);
    if (!own->frame)
        return 1;
    own->native.frame = (double *)((char *)own->frame + LINE - (uintptr_t)own->frame % LINE);
    lag_fill_frame(own->native.frame);
    return 0;
}

static void end(void *memory)
{
    emitted *made = memory;
    lag_pages_release(&made->pages);
    if (made->frame)
        made->from.release(made->from.context, made->frame);
}

lag_routine lag_routine_of(lag_pool *pool, const int32_t *code, int64_t length, int kernel)
{
    lag_routine made = {.code = code, .length = length};
#if defined(LAG_MACHINE)
    emitted *own = code && kernel == LAG_NATIVE && length > 2 ? lag_own(pool, sizeof *own, end) : NULL;
    if (own) {
        own->from = pool->from;
        own->native.wait = own->native.worth = CALLS + FIXED / length;
        made.native = &own->native;
    }
#else
    (void)pool, (void)kernel, (void)end;
#endif
    return made;
}

void lag_expect_calls(const lag_routine *routine, int64_t calls)
{
    if (routine->native && calls >= routine->native->wait)
        routine->native->wait = 1;
}

void lag_foresee_calls(const lag_routine *routine, double times)
{
    lag_native *native = routine->native;
    if (!native || !native->wait)
        return;
    const double calls = times * (double)(native->worth - native->wait);
    native->wait = calls >= (double)native->worth ? 1 : native->worth;
}

void lag_native_emit(const lag_source *source, const lag_routine *routine, const lag_calls *calls)
{
    emitted *own = (emitted *)routine->native;
    lag_pool pool = lag_pool_of(&own->from);
    lag_flow flow;
    own->native.wait = 0;
    if (!lag_flow_read(&flow, &pool, source, routine)) {
        const lag_code code = lag_emit(&flow, &pool, source->lanes > 1, calls);
        if (code.bytes && !make_frame(own, code.frame) && !lag_pages_make(&own->pages, code.bytes, code.length)) {
            own->native.run = (lag_emitted *)(uintptr_t)own->pages.at;
            own->native.bytes = code.length;
        }
    }
    lag_release(&pool);
}
