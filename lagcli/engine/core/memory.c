#include "memory.h"

#include <string.h>

#define LINE 64 /* bytes of a cache line */

/* Header of each allocation. */
typedef struct chunk {
    struct chunk *next;
} chunk;

void *lag_get(lag_pool *pool, size_t count, size_t size)
{
    const size_t bytes = (count ? count : 1) * size;
    chunk *made = pool->failed ? NULL
                               : pool->from.allocate(pool->from.context, sizeof(chunk) + LINE + bytes);
    if (!made) {
        pool->failed = 1;
        return NULL;
    }
    made->next = pool->last;
    pool->last = made;
    char *memory = (char *)(made + 1);
    memory += (LINE - (uintptr_t)memory % LINE) % LINE;
    memset(memory, 0, bytes);
    return memory;
}

void *lag_copy(lag_pool *pool, const void *from, size_t count, size_t size)
{
    void *to = lag_get(pool, count, size);
    if (to && from)
        memcpy(to, from, count * size);
    return to;
}

double *lag_doubles(lag_pool *pool, long count)
{
    return lag_get(pool, (size_t)count, sizeof(double));
}

double *lag_copy_doubles(lag_pool *pool, const double *from, long count)
{
    return lag_copy(pool, from, (size_t)count, sizeof(double));
}

int32_t *lag_copy_integers(lag_pool *pool, const int32_t *from, long count)
{
    return lag_copy(pool, from, (size_t)count, sizeof(int32_t));
}

void lag_release(lag_pool *pool)
{
    chunk *next = pool->last;
    while (next) {
        chunk *this = next;
        next = this->next;
        pool->from.release(pool->from.context, this);
    }
    pool->last = NULL;
}
