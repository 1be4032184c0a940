#include "bind.h"

#include <string.h>

const int32_t *lag_copy_stream(lag_pool *pool, const lag_stream *stream)
{
    return lag_copy_integers(pool, stream->code, stream->length);
}

int lag_bind(lag_run *run, lag_pool *pool, lag_tape *tape, const lag_program *program)
{
    tape->vectors = run->system.vectors;
    tape->registers = lag_copy_doubles(pool, program->registers, program->register_count);
    tape->prelude = lag_copy_stream(pool, &program->prelude);
    tape->stream = lag_copy_stream(pool, &program->main);
    for (int i = 0; i < 3; ++i)
        tape->deferred[i] = lag_copy_stream(pool, &program->deferred[i]);
    for (int i = 0; i < 2; ++i)
        tape->output_subsets[i] = program->output_subsets[i].code ? lag_copy_stream(pool, &program->output_subsets[i]) : NULL;
    tape->held = lag_copy_integers(pool, NULL, 2);
    tape->outputs = lag_copy_integers(pool, program->outputs, program->output_count);
    if (pool->failed)
        return 1;
    tape->parameters = tape->registers + program->inputs - run->np;
    lag_tape_set(tape, run->np, run->parameters);
    return 0;
}
