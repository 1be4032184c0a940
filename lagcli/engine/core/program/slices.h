/* Slices of programs: what single functions need of a tape that has many. */
#ifndef LAGCLI_SLICES_H
#define LAGCLI_SLICES_H

#include "lagcore.h"
#include "memory.h"

/* The operations that some outputs of a program need, as scalar ones, and the inputs that these or the outputs read. An evaluation
 * leaves the other outputs undefined. */
typedef struct {
    lag_stream stream;
    const int32_t *inputs;
    int count;
} lag_slice;

/*
 * The slices of functions, of which function k has the outputs listed from ends[k - 1] (0) to ends[k]. Inputs are the first ones,
 * so many, without the parameters. NULL where together they are more than LAG_SLICES times as long as the program, and where there
 * is no memory (pool->failed).
 */
#define LAG_SLICES 4
const lag_slice *lag_slices(lag_pool *pool, const lag_program *program, int inputs, int functions, const int32_t *outputs,
                            const int32_t *ends);

#endif
