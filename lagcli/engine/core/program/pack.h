/* Vectorization: operations of one kind on equidistant registers become one vector operation.
 *
 * Long models repeat the same operations for each body. Operations of one level (those whose operands are ready at
 * the same time) and of one kind are searched for operands in arithmetic progression; such a set becomes one vector
 * operation with contiguous results. The operations and their results do not change, only their order.
 *
 * S. Larsen and S. Amarasinghe, Exploiting superword level parallelism with multimedia instruction sets, PLDI 2000,
 * doi:10.1145/349299.349320.
 */
#ifndef LAGCLI_PACK_H
#define LAGCLI_PACK_H

#include "program/nodes.h"
#include "program/slots.h"

typedef struct {
    lag_pool *pool;                    /* of what lasts */
    const lag_tape *tape;
    int64_t values;
    int32_t *place;                    /* registers of values, or -1 */
    lag_slots slots;
    int32_t families;                  /* how many there are */
    unsigned char *moved;              /* of families: whether the inputs are side by side already */
    int64_t packed;                    /* operations in vectors */
} lag_packing;

/* `place` is completed, from `count` registers on. */
lag_packing lag_packing_of(lag_pool *pool, const lag_tape *tape, int64_t values, int32_t *place, int32_t count);

/* The stream of operations, each after its operands, whose results are `kept` or not. */
lag_stream lag_pack(lag_packing *packing, const lag_node *nodes, int64_t n, const unsigned char *kept);

/* How many operations compute the same function of inputs as at least seven others do; inputs and constants are not
 * distinguished. -1 if there is no memory. */
int64_t lag_repeated(const lag_node *nodes, int64_t n, int64_t values);

#endif
