/* Streams from streams. */
#ifndef LAGCLI_EXCERPT_H
#define LAGCLI_EXCERPT_H

#include "memory.h"

/* The operations of a stream on which the final values of some registers depend. */
lag_stream lag_excerpt(lag_pool *pool, const lag_stream *stream, const int32_t *registers, int64_t count,
                       int64_t register_count);

#endif
