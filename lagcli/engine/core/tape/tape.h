/* The tape evaluator. The streams are those of engine/core/program.py, the operations those of
 * engine/tape/operations.py. */
#ifndef LAGCLI_TAPE_H
#define LAGCLI_TAPE_H

#include <stdint.h>

#include "native/native.h"
#include "tables.h"
#include "tape/vectors.h"

/* A tape bound to its register file; inputs come first. The deferred streams are for outputs that are
 * requested apart; those alone for outputs without the rest. */
typedef struct {
    const lag_vector_kernel *vectors;  /* of the processor */
    const int32_t *prelude;
    lag_routine stream, deferred[3], output_subsets[2];
    int32_t *held;                     /* what was evaluated last: all (0), or which alone; and, of the
                                        * dynamics, a lag_factored of its matrix */
    double *registers, *parameters;    /* the registers of the parameters */
    const int32_t *outputs;
    int64_t output_count, register_count;
} lag_tape;

/* Emit one of a tape's routines. */
void lag_tape_emit(const lag_tape *tape, const lag_routine *routine);

/* Run one of a tape's routines. */
static inline void lag_tape_run(const lag_tape *tape, const lag_routine *routine)
{
    const lag_native *native = routine->native;
    if (native && native->run) {
        native->run(tape->registers, native->frame);
        return;
    }
    tape->vectors->run(routine->code, tape->registers);
    if (lag_native_due(routine))
        lag_tape_emit(tape, routine);
}

/* Set n parameters of a tape; its outputs become invalid. */
void lag_tape_set(const lag_tape *tape, int n, const double *parameters);

/* Read output i of a tape. */
#define OUT(tape, i) ((tape)->registers[(tape)->outputs[i]])

#endif
