/*
 * Machine code of streams, bit for bit with the results of their interpreters, where the processor is an x86-64 with
 * AVX2 and the system lets memory become executable. Everywhere else, nothing is emitted and the interpreter stays.
 */
#ifndef LAGCLI_NATIVE_H
#define LAGCLI_NATIVE_H

#include "lagcore.h"
#include "memory.h"
#include "native/calls.h"

typedef struct lag_native lag_native;

/* A stream bound to its program: what is interpreted, and what may become machine code. */
typedef struct {
    const int32_t *code;               /* NULL: there is none */
    int64_t length;
    lag_native *native;                /* NULL: interpreted only */
} lag_routine;

enum { LAG_ROUTINES = 6 }; /* main, deferred, output subsets */

/* What a program's routines have in common. */
typedef struct {
    const lag_routine *routines[LAG_ROUTINES];
    const int32_t *outputs;
    int64_t output_count, register_count;
    int lanes;                         /* numbers of a register: 1, or LAG_LANES, of which registers are multiples */
} lag_source;

/* Code that takes the numbers of one lane or of four. */
typedef void lag_emitted(double *registers, double *frame);

struct lag_native {
    lag_emitted *run;                  /* NULL until it is emitted */
    double *frame;                     /* its constants, and values for which there are no registers */
    int64_t wait;                      /* calls until then; 0: never */
    size_t bytes;                      /* of the code */
};

/* A routine of a stream, which may be NULL; with LAG_NATIVE it is emitted once it has run often. */
lag_routine lag_routine_of(lag_pool *pool, const int32_t *code, int64_t length, int kernel);

/* Count a call that was interpreted. Returns whether it is time to emit the routine. */
static inline int lag_native_due(const lag_routine *routine)
{
    lag_native *native = routine->native;
    return native && native->wait && !--native->wait;
}

/* Emit a routine, if that is possible. `calls` are the functions for its lanes. */
void lag_native_emit(const lag_source *source, const lag_routine *routine, const lag_calls *calls);

#endif
