/*
 * A stream as operations on values: each value is computed once, whatever register it has, so that operations may
 * be put in another order.
 */
#ifndef LAGCLI_NATIVE_FLOW_H
#define LAGCLI_NATIVE_FLOW_H

#include "memory.h"
#include "native/routine.h"

enum { LAG_NO_VALUE = -1, LAG_NEVER = INT32_MAX };

/* An operation. The values of a vector's elements follow each other. */
typedef struct {
    int32_t op;                        /* a lag_op; on vectors LAG_VECTOR more */
    int32_t segment;                   /* scalar operations between the same vector operations have the same */
    int32_t result[2];                 /* SINCOS has two */
    int32_t operand[3];                /* of vectors: those that stand for all elements */
    int32_t first[2], later[3];        /* places in the order at which results, and operands, are used next */
    int32_t length;                    /* elements of a vector */
    const int32_t *words;              /* a vector's destination and operands in the stream */
} lag_node;

typedef struct {
    int32_t values, nodes, length;
    lag_node *node;                    /* nodes, as the stream has them */
    int32_t *order;                    /* length of them: those that are needed, as they are executed */
    int32_t *place;                    /* of each value in the register file; values < places are there before */
    int32_t *use;                      /* of each value: place in the order at which it is used first */
    uint8_t *kept;                     /* values that must come to their place ... */
    uint8_t *late;                     /* ... but not before the end of their segment */
    int32_t places;
} lag_flow;

/* Read a stream of a program. Returns 0, or 1 where it is not valid or there is no memory. */
int lag_flow_read(lag_flow *flow, lag_pool *pool, const lag_source *source, const lag_routine *routine);

/* The place of element k of a vector's operand at `words`; and the words after the operand. */
static inline int32_t lag_element(const int32_t *words, int32_t k)
{
    return words[1] == LAG_INDEXED ? words[2 + k] : words[0] + k * words[1];
}

static inline const int32_t *lag_after(const int32_t *words, int32_t n)
{
    return words + (words[1] == LAG_INDEXED ? 2 + n : 2);
}

#endif
