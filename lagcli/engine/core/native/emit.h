/* From operations on values to instructions. */
#ifndef LAGCLI_NATIVE_EMIT_H
#define LAGCLI_NATIVE_EMIT_H

#include "native/calls.h"
#include "native/flow.h"

typedef struct {
    uint8_t *bytes;                    /* in a pool; NULL without memory, or without instructions for an operation */
    size_t length;
    int32_t frame;                     /* numbers of the frame, constants first */
} lag_code;

/* Emit the operations of a flow, on one lane or on four. */
lag_code lag_emit(const lag_flow *flow, lag_pool *pool, int wide, const lag_calls *calls);

/* Write the constants to a frame. */
void lag_fill_frame(double *frame);

#endif
