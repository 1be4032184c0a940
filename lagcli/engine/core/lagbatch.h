/*
 * The public interface to batches: many runs of the same equations, eight at a time, and functions of
 * tables of numbers. Streams of their programs hold operations on single registers alone.
 */
#ifndef LAGBATCH_H
#define LAGBATCH_H

#include "lagcore.h"

#if defined(__GNUC__)
#pragma GCC visibility push(default)
#endif

#define LAG_LANES 8 /* runs that are integrated at once */

typedef struct {
    const double *times;               /* sample times, increasing, s */
    int64_t times_count;
    int64_t runs;
    const double *parameters;          /* by run, np */
    const double *states;              /* by run, q and v at the start, consistent */
    int64_t slots;                     /* runs whose samples are held at once, more than LAG_LANES */
    int kernel;                        /* a lag_kernel */
    /* owned by the caller, written by the core */
    int32_t *status;                   /* by run: a lag_lane_status */
    int64_t *counts;                   /* by run: steps, rejected, evaluations */
    double *samples;                   /* by slot: rows of t, q, v, a, lambda, W */
} lag_batch_settings;

typedef struct lag_batch lag_batch;

/*
 * Make runs ready. `single` has the settings of each, and an unrolled elimination; the batch uses it, so it
 * must live as long. The programs are those of its dynamics and of its constraints. NULL where there is
 * no memory.
 */
lag_batch *lag_batch_create(const lag_memory *memory, lag_run *single, const lag_program *dynamics,
                            const lag_program *constraint, const lag_batch_settings *settings);
void lag_batch_destroy(lag_batch *batch);

/* Attempt at most a number of steps in each lane. Returns LAG_RUNNING; LAG_BLOCK_FULL if finished runs must be taken
 * first; LAG_DONE if no run is waiting or active. */
int lag_batch_advance(lag_batch *batch, int64_t attempts);

/* The number of runs that were completed since the last call; which they are, and the slots of their
 * samples, which are free from now on. Both arrays have room for all slots. */
int64_t lag_batch_take(lag_batch *batch, int64_t *runs, int64_t *slots);

/* The run in each lane; -1 for an empty lane. */
const int64_t *lag_batch_runs(const lag_batch *batch);

/* Remove the run in a lane; its status is then LAG_LANE_LEFT. */
void lag_batch_leave(lag_batch *batch, int lane);

typedef struct lag_table lag_table;

/* A program that is evaluated over the rows of tables: its inputs are the first numbers of a row, then
 * `np` parameters. NULL where there is no memory. */
lag_table *lag_table_create(const lag_memory *memory, const lag_program *program, int columns, int np,
                            int kernel);
void lag_table_destroy(lag_table *table);

/* Evaluate it. values: `rows` rows of `width` numbers. out: by output, `rows` numbers. */
void lag_table_evaluate(const lag_table *table, const double *parameters, const double *values,
                        int64_t rows, int64_t width, double *out);

/* sin and cos of LAG_LANES numbers. */
void lag_batch_sincos(const double *x, double *sine, double *cosine, int kernel);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif
