/*
 * A model as data: the equations, the dynamics, how their linear system is solved, and a start, in one block of
 * memory that can be stored and sent. It is checked when it is read: whatever the data, a run made from it stays
 * within its memory and ends with a status.
 *
 * The block is a sequence of words of 8 bytes, in the processor's byte order, aligned as numbers:
 *
 *   LAG_MODEL_MAGIC, LAG_MODEL_VERSION, the number of words
 *   nq, nc, nh, np, nm, nb, rank; a lag_model_solution
 *   integers: holonomic, mass_row, mass_column, jacobian_row, jacobian_column, unit, kind
 *   numbers: t_start, y, parameters, sizes, lengths, plain_lengths
 *   the program of the constraint, the program of the dynamics
 *   with LAG_MODEL_ELIMINATION, integers: order, paired, start, row, left_start, left_column, left_entry,
 *   mass_targets, jacobian_targets
 *
 * Integers and numbers are preceded by their count, also single ones; two integers take a word, the last one alone
 * with a zero. A program is the number of its inputs; the integers of prelude, main, three deferred streams, two
 * streams for subsets of outputs, each empty if there is none, and outputs; and the numbers of its registers.
 */
#ifndef LAGMODEL_H
#define LAGMODEL_H

#include "lagcore.h"

#if defined(__GNUC__)
#pragma GCC visibility push(default)
#endif

#define LAG_MODEL_MAGIC 0x6c65646f6d67616c /* "lagmodel" where the lowest byte is the first */
#define LAG_MODEL_VERSION 1
#define LAG_MODEL_LARGEST 32768 /* nq + 2 nc at most */

enum lag_model_solution { LAG_MODEL_DENSE, LAG_MODEL_UNROLLED, LAG_MODEL_ELIMINATION };

/* Why a model is rejected. */
enum lag_model_status {
    LAG_MODEL_READ,        /* it is not */
    LAG_MODEL_FORMAT,      /* no model, of another version or byte order, or not aligned */
    LAG_MODEL_LENGTH,      /* a length that the data do not have */
    LAG_MODEL_SIZES,       /* counts that contradict each other, or are too large */
    LAG_MODEL_INDEX,       /* an index beyond what it counts */
    LAG_MODEL_PROGRAM,     /* a program with an unknown operation, a register that it does not have, or no end */
    LAG_MODEL_OUTPUTS,     /* a program without the inputs or outputs that it must have */
    LAG_MODEL_NUMBER,      /* a start, or a size, that is not finite */
    LAG_MODEL_MEMORY,      /* no memory to make a run */
};

/* What has been read: it points into the data, which must live as long. `settings` has the start, and what belongs
 * to the model; the caller adds times, tolerances and the block before a run is made. */
typedef struct {
    lag_equations equations;
    lag_program dynamics;
    int solution;                      /* a lag_model_solution */
    lag_elimination elimination;       /* with LAG_MODEL_ELIMINATION */
    lag_settings settings;
} lag_model;

/* Read and check a model. Returns a lag_model_status. */
int lag_read_model(const void *data, int64_t bytes, lag_model *model);

/* Check the settings that the caller has added; make a run from a model that has been read, ready for lag_start.
 * Returns a lag_model_status; the run only with LAG_MODEL_READ. */
int lag_run_model(const lag_memory *memory, const lag_model *model, lag_run **run);

/* Check that a program stays within its registers: LAG_MODEL_READ or LAG_MODEL_PROGRAM. Its deferred streams may be
 * empty. */
int lag_check_program(const lag_program *program);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif
