#include "tape/tape.h"

#include <math.h>
#include <string.h>

void lag_tape_set(const lag_tape *tape, int n, const double *parameters)
{
    memcpy(tape->parameters, parameters, (size_t)n * sizeof(double));
    tape->registers[0] = NAN; /* no state yet */
    tape->vectors->run(tape->prelude, tape->registers);
}

void lag_tape_emit(const lag_tape *tape, const lag_routine *routine)
{
    const lag_routine *deferred = tape->deferred, *subsets = tape->output_subsets;
    const lag_source source = {
        .routines = {&tape->stream, deferred, deferred + 1, deferred + 2, subsets, subsets + 1},
        .outputs = tape->outputs,
        .output_count = tape->output_count,
        .register_count = tape->register_count,
        .lanes = 1,
    };
    lag_native_emit(&source, routine, &lag_calls_of_one);
}
