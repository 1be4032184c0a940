#include "bind.h"

#include <string.h>

const int32_t *lag_copy_stream(lag_pool *pool, const lag_stream *stream)
{
    return lag_copy_integers(pool, stream->code, stream->length);
}

static lag_routine routine(lag_pool *pool, const lag_stream *stream, int kernel)
{
    return lag_routine_of(pool, stream->code ? lag_copy_stream(pool, stream) : NULL, stream->length, kernel);
}

void lag_bind_program(lag_pool *pool, lag_tape *tape, const lag_program *program, int kernel)
{
    tape->vectors = lag_vectors(kernel);
    tape->registers = lag_copy_doubles(pool, program->registers, program->register_count);
    tape->prelude = lag_copy_stream(pool, &program->prelude);
    tape->stream = routine(pool, &program->main, kernel);
    for (int i = 0; i < 3; ++i)
        tape->deferred[i] = routine(pool, &program->deferred[i], kernel);
    for (int i = 0; i < 2; ++i)
        tape->output_subsets[i] = routine(pool, &program->output_subsets[i], kernel);
    tape->held = lag_copy_integers(pool, NULL, 2);
    tape->outputs = lag_copy_integers(pool, program->outputs, program->output_count);
    tape->output_count = program->output_count;
    tape->register_count = program->register_count;
}

int lag_bind(lag_run *run, lag_pool *pool, lag_tape *tape, const lag_program *program)
{
    lag_bind_program(pool, tape, program, run->kernel);
    if (pool->failed)
        return 1;
    tape->parameters = tape->registers + program->inputs - run->np;
    lag_tape_set(tape, run->np, run->parameters);
    return 0;
}

void lag_expect(const lag_tape *tape, int64_t calls)
{
    lag_expect_calls(&tape->stream, calls);
    for (int i = 0; i < 2; ++i)
        lag_expect_calls(&tape->output_subsets[i], calls);
}

void lag_foresee(const lag_tape *tape, double times)
{
    lag_foresee_calls(&tape->stream, times);
    for (int i = 0; i < 3; ++i)
        lag_foresee_calls(&tape->deferred[i], times);
    for (int i = 0; i < 2; ++i)
        lag_foresee_calls(&tape->output_subsets[i], times);
}
