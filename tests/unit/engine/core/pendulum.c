/* A pendulum by the core alone: prints t, q, v, a, lambda, W of each sample in hexadecimal. */
#include <stdio.h>
#include <stdlib.h>

#include "lagcore.h"
#include "pendulum.h" /* equations, dynamics and start of the model */

static long allocations; /* that are not released */

static void *allocate(void *context, size_t bytes)
{
    ++*(long *)context;
    return malloc(bytes);
}

static void release(void *context, void *memory)
{
    --*(long *)context;
    free(memory);
}

int main(void)
{
    const lag_memory memory = {allocate, release, &allocations};
    static double block[SAMPLES * WIDTH];
    problem.block = block;
    problem.block_rows = SAMPLES;

    lag_run *run = lag_create(&memory, &equations, &problem);
    if (!run || lag_use_unrolled(run, &dynamics))
        return 1;
    int status = lag_start(run);
    while (status == LAG_RUNNING)
        status = lag_advance(run, 100);
    const long rows = lag_take(run);
    for (long i = 0; i < rows; ++i)
        for (int j = 0; j < WIDTH; ++j)
            printf("%a%c", block[i * WIDTH + j], j + 1 < WIDTH ? ' ' : '\n');
    lag_destroy(run);
    return status != LAG_DONE || allocations != 0;
}
