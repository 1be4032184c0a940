/* Checks of streams, before they are run. */
#ifndef LAGCLI_STREAM_H
#define LAGCLI_STREAM_H

#include "lagcore.h"

/* Whether n places are registers. */
int lag_are_registers(const int32_t *places, int64_t n, int64_t registers);

/* Whether a stream has an end, known operations, and no place but registers. */
int lag_is_stream(const lag_stream *stream, int64_t registers);

#endif
