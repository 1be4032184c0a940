#include "program/slots.h"

#include <string.h>

lag_slots lag_slots_from(lag_pool *pool, int32_t begin)
{
    return (lag_slots){.pool = pool, .begin = begin, .end = begin};
}

/* Replace an array by one with room for more; it keeps its contents. */
static void grow(lag_pool *pool, int32_t **array, int64_t used, int64_t room)
{
    int32_t *made = lag_get(pool, (size_t)room, sizeof *made);
    if (made && used)
        memcpy(made, *array, (size_t)used * sizeof *made);
    *array = made;
}

/* Make room for one more vector. */
static void make_room(lag_slots *s)
{
    if (s->count == s->room) {
        s->room = 64 + 2 * s->room;
        grow(s->pool, &s->first, s->count, s->room);
        grow(s->pool, &s->size, s->count, s->room);
        grow(s->pool, &s->alive, s->count, s->room);
    }
    if (s->count >= s->free_room) { /* each vector, when it is released, may leave one interval */
        s->free_room = 64 + 2 * s->free_room;
        grow(s->pool, &s->starts, s->free_count, s->free_room);
        grow(s->pool, &s->stops, s->free_count, s->free_room);
    }
    if (s->end - s->begin > s->owner_room) {
        const int64_t before = s->owner_room;
        s->owner_room = 2 * (int64_t)(s->end - s->begin);
        grow(s->pool, &s->owner, before, s->owner_room);
    }
}

int32_t lag_slots_take(lag_slots *s, int32_t values)
{
    const int32_t size = values > 1 ? (values + LAG_LINE - 1) / LAG_LINE * LAG_LINE : values;
    int64_t i = 0;
    while (i < s->free_count &&
           (s->stops[i] - s->starts[i] < size || (size > 1 && s->starts[i] % LAG_LINE)))
        ++i;
    int32_t start;
    if (i < s->free_count) {
        start = s->starts[i];
        s->starts[i] += size;
        if (s->starts[i] == s->stops[i]) {
            --s->free_count;
            memmove(s->starts + i, s->starts + i + 1, (size_t)(s->free_count - i) * sizeof *s->starts);
            memmove(s->stops + i, s->stops + i + 1, (size_t)(s->free_count - i) * sizeof *s->stops);
        }
    } else {
        start = size == 1 ? s->end : (s->end + LAG_LINE - 1) / LAG_LINE * LAG_LINE;
        s->end = start + size;
    }
    make_room(s);
    if (s->pool->failed)
        return s->begin;
    s->first[s->count] = start;
    s->size[s->count] = size;
    s->alive[s->count] = values;
    for (int32_t at = start; at < start + size; ++at)
        s->owner[at - s->begin] = (int32_t)s->count;
    ++s->count;
    return start;
}

void lag_slots_release(lag_slots *s, int32_t at)
{
    if (s->pool->failed)
        return;
    const int32_t vector = s->owner[at - s->begin];
    if (--s->alive[vector])
        return;
    const int32_t start = s->first[vector], stop = start + s->size[vector];
    int64_t i = 0, high = s->free_count;
    while (i < high) {
        const int64_t middle = (i + high) / 2;
        if (s->starts[middle] < start)
            i = middle + 1;
        else
            high = middle;
    }
    const int joins_before = i > 0 && s->stops[i - 1] == start;
    const int joins_after = i < s->free_count && s->starts[i] == stop;
    if (joins_before && joins_after) {
        s->stops[i - 1] = s->stops[i];
        --s->free_count;
        memmove(s->starts + i, s->starts + i + 1, (size_t)(s->free_count - i) * sizeof *s->starts);
        memmove(s->stops + i, s->stops + i + 1, (size_t)(s->free_count - i) * sizeof *s->stops);
    } else if (joins_before) {
        s->stops[i - 1] = stop;
    } else if (joins_after) {
        s->starts[i] = start;
    } else {
        memmove(s->starts + i + 1, s->starts + i, (size_t)(s->free_count - i) * sizeof *s->starts);
        memmove(s->stops + i + 1, s->stops + i, (size_t)(s->free_count - i) * sizeof *s->stops);
        s->starts[i] = start;
        s->stops[i] = stop;
        ++s->free_count;
    }
}
