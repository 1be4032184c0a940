/*
 * Machine code of streams, bit for bit with the results of their interpreters, where the processor is an x86-64 with
 * AVX2 and the system lets memory become executable. Everywhere else, nothing is emitted and the interpreter stays.
 */
#ifndef LAGCLI_NATIVE_H
#define LAGCLI_NATIVE_H

#include "memory.h"
#include "native/calls.h"
#include "native/routine.h"

/* A routine of a stream, which may be NULL; with LAG_NATIVE it is emitted once it has run often. */
lag_routine lag_routine_of(lag_pool *pool, const int32_t *code, int64_t length, int kernel);

/* Emit a routine at its next call if so many calls, which will come, are worth it. */
void lag_expect_calls(const lag_routine *routine, int64_t calls);

/* Expect so many times the calls since the last time: emit a routine at its next call if they are worth it; otherwise
 * not before it has run as often again. */
void lag_foresee_calls(const lag_routine *routine, double times);

/* Count a call that was interpreted. Returns whether it is time to emit the routine. */
static inline int lag_native_due(const lag_routine *routine)
{
    lag_native *native = routine->native;
    return native && native->wait && !--native->wait;
}

/* Emit a routine, if that is possible. `calls` are the functions for its lanes. */
void lag_native_emit(const lag_source *source, const lag_routine *routine, const lag_calls *calls);

#endif
