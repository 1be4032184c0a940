/* Operations with names of values: numbers from 0. */
#ifndef LAGCLI_NODES_H
#define LAGCLI_NODES_H

#include "lagprogram.h"
#include "memory.h"

typedef struct {
    int32_t op;
    int32_t value[LAG_NODE_VALUES];    /* results, then operands; negative ones are none */
} lag_node;

/* The sizes of operations: of tapes and their programs, or of programs for power series. */
typedef struct {
    const int *operands;
    int both;                          /* the operation with two results, or -1 */
    int end;                           /* the operation that ends a stream */
} lag_kinds;

extern const lag_kinds lag_tape_kinds, lag_series_kinds;

static inline int lag_results(const lag_kinds *kinds, int op)
{
    return op == kinds->both ? 2 : 1;
}

static inline int lag_places(const lag_kinds *kinds, int op)
{
    return kinds->operands[op] + lag_results(kinds, op);
}

/* Integers, none of them initialized to anything but zero. */
static inline int32_t *lag_integers(lag_pool *pool, int64_t count)
{
    return lag_get(pool, (size_t)count, sizeof(int32_t));
}

/* Integers of -1. */
int32_t *lag_unset(lag_pool *pool, int64_t count);

/* order.c: in runs of a kind, window by window; operands come first. Return 0 if there is no memory. */
int lag_in_runs(lag_node *nodes, int64_t n, const lag_kinds *kinds, int64_t values);

/* order.c: sets of operations that can be executed together, as lag_series_levels has them. */
int64_t lag_levels(const lag_node *nodes, int64_t n, const lag_kinds *kinds, int64_t values, int32_t *members,
                   int32_t *ends);

/* allocate.c: registers in place of values. `place` and `count` are completed, for values that are `kept`, and others,
 * whose registers are used again when they are dead. Return 0 if there is no memory. */
int lag_allocate(lag_node *nodes, int64_t n, const lag_kinds *kinds, int64_t values, int32_t *place, int32_t *count,
                 const unsigned char *kept);

/* allocate.c: write the stream of operations with registers; return its length, at most that of
 * lag_stream_bound. */
int64_t lag_write_stream(const lag_node *nodes, int64_t n, const lag_kinds *kinds, int32_t *stream);
static inline int64_t lag_stream_bound(int64_t nodes)
{
    return (2 + LAG_NODE_VALUES) * nodes + 2;
}

#endif
