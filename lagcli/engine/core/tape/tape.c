#include "tape/tape.h"

#include <math.h>
#include <string.h>

#include "tape/vectors.h"

void lag_stream_run(const int32_t *stream, double *registers)
{
    lag_vectors()->run(stream, registers);
}

void lag_tape_set(const lag_tape *tape, int n, const double *parameters)
{
    memcpy(tape->parameters, parameters, (size_t)n * sizeof(double));
    tape->registers[0] = NAN; /* no state yet */
    lag_stream_run(tape->prelude, tape->registers);
}
