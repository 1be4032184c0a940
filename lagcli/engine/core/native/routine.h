/* Streams, and the machine code that they become. */
#ifndef LAGCLI_NATIVE_ROUTINE_H
#define LAGCLI_NATIVE_ROUTINE_H

#include "lagcore.h"

/* Code that takes the numbers of one lane or of four. */
typedef void lag_emitted(double *registers, double *frame);

typedef struct {
    lag_emitted *run;                  /* NULL until it is emitted */
    double *frame;                     /* its constants, and values for which there are no registers */
    int64_t worth;                     /* calls whose interpretation takes as long as its emission */
    int64_t wait;                      /* calls until then; 0: never */
    size_t bytes;                      /* of the code */
} lag_native;

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

#endif
