/*
 * Eight runs of one System at once, each in its own lane: with its own parameters, state, time
 * and step size. engine/integrate/batch.py says what leaves the lanes.
 *
 * Where an array is said to be "of lanes", LAG_LANES numbers stand for each of its entries.
 */
#ifndef LAGCLI_BATCH_H
#define LAGCLI_BATCH_H

#include "lagbatch.h"
#include "run.h"

/* A program of engine/core/program.py on eight register files. Each register takes LAG_LANES places. */
typedef struct {
    const int32_t *prelude, *outputs;  /* as in tape.h */
    lag_routine stream, deferred[3], output_subsets[2];
    int64_t output_count, register_count;
    double *registers;                 /* of lanes */
} lag_batch_tape;

/* Eight states at once. The dynamics tape contains the unrolled elimination. */
typedef struct {
    const lag_system *system;          /* without its tapes */
    const lag_run *single;             /* provides the indices of outputs and inputs of the elimination */
    lag_batch_tape dynamics, constraint;
    double *scale_position, *scale_velocity; /* of lanes: nh, nc; the largest so far */
    double *right, *x, *work;          /* of lanes: nq + nc; the same; 2 (nq + nc) */
    double *responses;                 /* of lanes: nc for each row that is left out */
    double *trial;                     /* of lanes: nq */
} lag_octet;

struct lag_batch {
    lag_pool pool;
    const struct lag_batch_kernel *kernel;
    const lag_system *system;
    const lag_settings *settings;
    double t_start;
    int watching, detecting;
    const double *times;               /* sample times */
    int64_t times_count;

    int64_t runs, next;                /* number of runs; the next one to start */
    int parameters_count;
    const double *parameters, *states; /* by run: parameters; q and v at t_start */
    int32_t *status;                   /* by run: a lag_lane_status */
    int64_t *counts;                   /* by run: steps, rejected, evaluations */

    double *samples;                   /* by slot: times_count rows as in run.h; until they are complete, v' of the dense
                                        * output is in the place of a ... */
    double *sample_steps;              /* ... and the sizes of their steps are here */
    int64_t *free_slots;               /* slots without a run */
    int64_t free_count;
    int64_t *finished, *finished_slots; /* runs completed since the last call, and their slots */
    int64_t finished_count;

    lag_octet moving;                  /* a run in each lane */
    lag_octet sampled;                 /* eight samples of one run */

    int64_t run[LAG_LANES];            /* the run in each lane; -1: none */
    int64_t slot[LAG_LANES];
    int64_t times_next[LAG_LANES];     /* index of the next sample */
    int64_t samples_done[LAG_LANES];   /* samples that are projected, with a and lambda */
    double t[LAG_LANES], h[LAG_LANES], error_old[LAG_LANES];
    int after_rejection[LAG_LANES], stiff[LAG_LANES], not_stiff[LAG_LANES];
    double pivot[LAG_LANES], largest_pivot[LAG_LANES]; /* as in run.h ... */
    /* ... and, of many rows, ln |det| at the beginning of a step (NaN: not known) and at its stages ... */
    double determinant[LAG_DETERMINANTS * LAG_LANES], largest_step[LAG_LANES];
    /* ... and lag_path, of few rows; entries are of lanes: nb each */
    double *path_begin, *path_last;
    double path_t[LAG_LANES], path_length[LAG_LANES], path_speed[LAG_LANES];
    double margin[LAG_LANES], margin_at_end[LAG_LANES];
    double enough[LAG_LANES];          /* rows.margin of run.h, of rows that are not left out */
    int poor[LAG_LANES];               /* steps in which they did not suffice */
    int doubted;                       /* lanes whose next step needs all rows ... */
    int all_rows;                      /* ... and those whose step uses them: by the dense solution of a single run */

    /* of lanes, n each: as in run.h */
    double *y, *y_new, *before, *projected, *dense_y;
    double *stages;                    /* 16 n; the first is y' at y */
    double *dense;                     /* 7 n */
    double *dense_slope;               /* of lanes: nq */
    double *lengths;                   /* of lanes: nc */
    /* of lanes: n, n, nq, nq, nq: as in run.h, and what is given there */
    double *atol, *size, *acceleration_terms, *future_acceleration, *emerging;
    double *rest, *noise, *strict;     /* of lanes, n: as in run.h */
    int64_t noise_until[LAG_LANES];
    double *largest;                   /* of lanes: 2 kinds */

    /* functions of a single run, for a closer examination of one lane */
    lag_run *single;
};

/* Emit one of a tape's routines, with functions of four lanes. */
void lag_batch_emit(const lag_batch_tape *tape, const lag_routine *routine, const lag_calls *calls);

/* The functions for one instruction set. */
typedef struct lag_batch_kernel {
    int (*advance)(lag_batch *lanes, int64_t attempts);

    /* Evaluate a tape over the rows of a table: its inputs are the first `columns` numbers of a row,
     * then the parameters. out: by output, `rows` numbers. */
    void (*table)(const lag_batch_tape *tape, const double *parameters, int parameters_count,
                  const double *table, int64_t rows, int columns, int64_t width, int outputs,
                  double *out);

    /* sin and cos of eight numbers. */
    void (*sincos)(const double *x, double *sine, double *cosine);

    /* Run one of a tape's routines. */
    void (*run)(const lag_batch_tape *tape, const lag_routine *routine);
} lag_batch_kernel;

/* The functions of a lag_kernel. */
const lag_batch_kernel *lag_batch_lanes(int kernel);

/* Copy a program to a tape. */
void lag_batch_bind(lag_pool *pool, lag_batch_tape *tape, const lag_program *program, int kernel);

extern const lag_batch_kernel lag_batch_default;
#if defined(__x86_64__)
extern const lag_batch_kernel lag_batch_avx2;
#endif

#endif
