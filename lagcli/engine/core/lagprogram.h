/*
 * The public interface to programs: made from tapes, which list operations one by one.
 *
 * Equal operations are grouped into runs, so that the evaluator dispatches once for many of them; in long tapes,
 * those on equidistant registers become vector operations. Operations on parameters are moved to a prelude that
 * runs once; a product used only in a sum is merged with the sum, and the sine and cosine of one angle are merged;
 * registers are reused when their values are dead. No operation gets other operands: results are those of the tape.
 */
#ifndef LAGPROGRAM_H
#define LAGPROGRAM_H

#include "lagcore.h"

#if defined(__GNUC__)
#pragma GCC visibility push(default)
#endif

/* Operations on a register file: inputs first, then constants, then results; see engine/tape/tape.py. */
typedef struct {
    int inputs;
    int parameters;                    /* the last inputs but for the following: constant along a run */
    int rhs_inputs;                    /* the last inputs: only deferred outputs depend on them */
    const double *constants;
    int64_t constant_count;
    const int32_t *code;               /* operation, result, three operands; unused ones are 0 */
    int64_t code_count;
    const int32_t *outputs;            /* registers */
    int64_t output_count;
    const int32_t *deferred;           /* sizes of the groups of deferred outputs, the last ones */
    int deferred_count;                /* at most 3 */
    const int32_t *subset, *subset_ends; /* indices of outputs, one subset after the other */
    int subset_count;                  /* at most 2 */
    const int32_t *isomorphic, *isomorphic_ends; /* results that are likely used in the same way, group after group */
    int64_t isomorphic_count;
    const int32_t *families;           /* family_count inputs: the number of each one's family, from 0; or -1 */
    int64_t family_count;
    int64_t vectors_from;              /* operations from which vectors are sought */
} lag_tape;

/* A program and the number of operations in its main stream. */
typedef struct {
    lag_program program;
    int64_t size;
} lag_assembled;

/* The program of a tape; NULL if there is no memory, or if the tape is not `valid`: an unknown operation, an operand that
 * is not ready, or an output that does not exist. */
lag_assembled *lag_assemble(const lag_memory *memory, const lag_tape *tape, int *valid);
void lag_assembled_destroy(lag_assembled *assembled);

/* The stream with the same operations as scalar ones. Returns its length; without `to`, only that. */
int64_t lag_unpack(const lag_stream *stream, int32_t *to);

/* The parts of which programs for power series are made, too (engine/taylor). Their arguments are not checked: values
 * have numbers from 0 to below `values`, and those of -1 are none. */

/* Operations of a program for power series. */
typedef struct {
    int64_t count;
    const int32_t *numbers;            /* by operation: its kind, then its results and operands, LAG_NODE_VALUES */
    int64_t values;
} lag_nodes;

/* Order the first operations in runs of a kind, and allocate registers.
 *
 * `ordered` is the number of operations that are ordered; the others follow them. place: the register of each value,
 * or -1, which is completed; kept: whether a value is needed at the end; count: the first free register, which
 * becomes the number of registers. Writes the stream, at most (2 + LAG_NODE_VALUES) * nodes + 2 numbers; returns its
 * length, -1 if there is no memory. */
int64_t lag_series_stream(const lag_nodes *nodes, int64_t ordered, int32_t *place, const unsigned char *kept,
                          int32_t *count, int32_t *stream);

/* Sets of operations of one kind that can be executed together, in order: near the beginning as early as possible,
 * near the end as late as possible. Writes the operations of one set after the other, and the ends of the sets, at
 * most one for each operation; returns the number of sets, -1 if there is no memory. */
int64_t lag_series_levels(const lag_nodes *nodes, int32_t *members, int32_t *ends);

/* Points of n rows and k <= 4 columns in arithmetic progression: of at least LAG_SHORTEST points each, in which one
 * coordinate may be arbitrary. Writes the indices of the points of one run after the other, and the ends of the runs,
 * at most n / LAG_SHORTEST, then the remaining points; returns the number of runs, -1 if there is no memory. */
int64_t lag_progressions(const int32_t *points, int64_t n, int k, int32_t *members, int32_t *ends);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif
