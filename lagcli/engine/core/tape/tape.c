#include "tape/tape.h"

#include "tape/vectors.h"

void lag_stream_run(const int32_t *stream, double *registers)
{
    lag_vectors()->run(stream, registers);
}
