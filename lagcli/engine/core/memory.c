#include "memory.h"

#include <stddef.h>
#include <stdlib.h>
#include <string.h>

/* With the address sanitizer, what is beyond an array must not be touched. */
#ifdef __SANITIZE_ADDRESS__
#include <sanitizer/asan_interface.h>
#else
#define ASAN_POISON_MEMORY_REGION(from, bytes) ((void)(from), (void)(bytes))
#endif

#define LINE 64 /* bytes of a cache line */

/* Header of each allocation. */
typedef struct chunk {
    struct chunk *next;
    size_t bytes;                      /* after the header */
} chunk;

/* Header of what is not saved, aligned as malloc is. */
typedef union owned {
    struct {
        union owned *next;
        void (*end)(void *);
    } is;
    max_align_t aligned;
} owned;

static void *allocate(void *context, size_t bytes)
{
    (void)context;
    return malloc(bytes);
}

static void release(void *context, void *memory)
{
    (void)context;
    free(memory);
}

lag_pool lag_pool_of(const lag_memory *from)
{
    const lag_memory usual = {allocate, release, NULL};
    return (lag_pool){.from = from && from->allocate ? *from : usual};
}

void *lag_get(lag_pool *pool, size_t count, size_t size)
{
    const size_t bytes = (count ? count : 1) * size;
    const int fits = count <= (SIZE_MAX - sizeof(chunk) - LINE) / size;
    chunk *made = pool->failed || !fits ? NULL
                               : pool->from.allocate(pool->from.context, sizeof(chunk) + LINE + bytes);
    if (!made) {
        pool->failed = 1;
        return NULL;
    }
    made->next = pool->last;
    char *start = (char *)(made + 1), *memory = start + (LINE - (uintptr_t)start % LINE) % LINE;
    made->bytes = (size_t)(memory - start) + bytes;
    pool->last = made;
    memset(start, 0, made->bytes); /* what is saved has no bytes without a value */
    ASAN_POISON_MEMORY_REGION(memory + bytes, LINE - (size_t)(memory - start));
    return memory;
}

void *lag_copy(lag_pool *pool, const void *from, size_t count, size_t size)
{
    void *to = lag_get(pool, count, size);
    if (to && from)
        memcpy(to, from, count * size);
    return to;
}

double *lag_doubles(lag_pool *pool, int64_t count)
{
    return lag_get(pool, (size_t)count, sizeof(double));
}

double *lag_copy_doubles(lag_pool *pool, const double *from, int64_t count)
{
    return lag_copy(pool, from, (size_t)count, sizeof(double));
}

int32_t *lag_copy_integers(lag_pool *pool, const int32_t *from, int64_t count)
{
    return lag_copy(pool, from, (size_t)count, sizeof(int32_t));
}

/* Bytes that are not saved, without values. */
static char *own(lag_pool *pool, size_t bytes, void (*end)(void *))
{
    owned *made = pool->failed ? NULL : pool->from.allocate(pool->from.context, sizeof *made + bytes);
    if (!made) {
        pool->failed = 1;
        return NULL;
    }
    made->is.next = pool->owned;
    made->is.end = end;
    pool->owned = made;
    return (char *)(made + 1);
}

void *lag_own(lag_pool *pool, size_t size, void (*end)(void *))
{
    void *memory = own(pool, size, end);
    return memory ? memset(memory, 0, size) : NULL;
}

void *lag_scratch(lag_pool *pool, size_t count, size_t size)
{
    if (count > (SIZE_MAX - sizeof(owned) - LINE) / size) {
        pool->failed = 1;
        return NULL;
    }
    char *memory = own(pool, LINE + count * size, NULL);
    return memory ? memory + (LINE - (uintptr_t)memory % LINE) % LINE : NULL;
}

void lag_release(lag_pool *pool)
{
    for (owned *this = pool->owned, *following; this; this = following) {
        following = this->is.next;
        if (this->is.end)
            this->is.end(this + 1);
        pool->from.release(pool->from.context, this);
    }
    pool->owned = NULL;
    chunk *next = pool->last;
    while (next) {
        chunk *this = next;
        next = this->next;
        pool->from.release(pool->from.context, this);
    }
    pool->last = NULL;
}

size_t lag_saved_size(const lag_pool *pool)
{
    size_t bytes = sizeof(size_t);
    for (const chunk *one = pool->last; one; one = one->next)
        bytes += sizeof one + one->bytes;
    return bytes;
}

char *lag_save_pool(const lag_pool *pool, char *to)
{
    size_t chunks = 0;
    char *count = to;
    to += sizeof chunks;
    for (const chunk *one = pool->last; one; one = one->next, ++chunks) {
        memcpy(to, &one, sizeof one);
        memcpy(to + sizeof one, one + 1, one->bytes);
        to += sizeof one + one->bytes;
    }
    memcpy(count, &chunks, sizeof chunks);
    return to;
}

const char *lag_saved_pool(const lag_pool *pool, const char *from, int restore)
{
    size_t chunks;
    memcpy(&chunks, from, sizeof chunks);
    from += sizeof chunks;
    for (chunk *one = pool->last, *next; one; one = next, --chunks) {
        const chunk *saved = NULL;
        next = one->next;
        if (chunks)
            memcpy(&saved, from, sizeof saved);
        if (saved != one)
            return NULL;
        if (restore)
            memcpy(one + 1, from + sizeof one, one->bytes);
        from += sizeof one + one->bytes;
    }
    return chunks ? NULL : from;
}
