/* Memory in pools: all of a pool is released at once. */
#ifndef LAGCLI_MEMORY_H
#define LAGCLI_MEMORY_H

#include "lagcore.h"

typedef struct {
    lag_memory from;
    void *last;                        /* the last allocation, which is linked to the others */
    void *owned;                       /* the last of what is not saved, linked in the same way */
    int failed;                        /* whether an allocation has failed */
} lag_pool;

/* An empty pool; without `from` or its functions, of malloc and free. */
lag_pool lag_pool_of(const lag_memory *from);

/* Zeros from the beginning of a cache line on, also for no bytes: C forbids NULL even for copies of
 * nothing. NULL where there is no memory. */
void *lag_get(lag_pool *pool, size_t count, size_t size);

/* A copy; zeros where `from` is NULL. */
void *lag_copy(lag_pool *pool, const void *from, size_t count, size_t size);

double *lag_doubles(lag_pool *pool, int64_t count);
double *lag_copy_doubles(lag_pool *pool, const double *from, int64_t count);
int32_t *lag_copy_integers(lag_pool *pool, const int32_t *from, int64_t count);

/* Work space from the beginning of a cache line on, without values, not part of what is saved: of pages that nothing is
 * written to, the system provides none. NULL where there is no memory. */
void *lag_scratch(lag_pool *pool, size_t count, size_t size);

/* Zeros that are not part of what is saved: allocated before the pool is first saved. `end`, if there is one, is called
 * with them before they are released. */
void *lag_own(lag_pool *pool, size_t size, void (*end)(void *));

/* Release all; the pool can be used again. */
void lag_release(lag_pool *pool);

/* The contents of a pool as bytes: their number; write them, and return where they end; return where they end if
 * they are of a pool with the present allocations, else NULL, and with `restore` put them back. */
size_t lag_saved_size(const lag_pool *pool);
char *lag_save_pool(const lag_pool *pool, char *to);
const char *lag_saved_pool(const lag_pool *pool, const char *from, int restore);

#endif
