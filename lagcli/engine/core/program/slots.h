/* Registers of vectors: allocated side by side and released together. */
#ifndef LAGCLI_SLOTS_H
#define LAGCLI_SLOTS_H

#include "memory.h"

typedef struct {
    lag_pool *pool;
    int32_t begin, end;                /* those before are not allocated here; the number of registers */
    int32_t *starts, *stops;           /* free intervals, ascending */
    int64_t free_count, free_room;
    int32_t *owner;                    /* of registers: the vector */
    int64_t owner_room;
    int32_t *first, *size, *alive;     /* of vectors: registers, and how many of them are in use */
    int64_t count, room;
} lag_slots;

lag_slots lag_slots_from(lag_pool *pool, int32_t begin);

/* The first of a number of contiguous registers, of whole cache lines if there are several. */
int32_t lag_slots_take(lag_slots *slots, int32_t values);

/* Release a register, with its vector when no other register of that is in use. */
void lag_slots_release(lag_slots *slots, int32_t at);

#endif
