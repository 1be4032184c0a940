/*
 * An instance of a model as an FMU: what FMI 2.0 and 3.0 have in common. The FMU's folder `resources` has two files:
 * model.bin, a model as data (lagmodel.h); and values.bin, also words of 8 bytes, with the values of FMI:
 *
 *   LAG_VALUES_MAGIC, the number of words, the number of the method, the number of the model's parameters
 *   a list of the parameters that can be set, their places; a list of those of them that are inputs, their places
 *   a list of 2 nq flags, whether initial values are fixed
 *   a list of the quaternions whose angular velocity is given at the start, each its 4 coordinates, and 3 flags, whether the
 *   components of the angular velocity are fixed
 *   whether the constraints that hold at the start are others than those of the equations, because some switch; then the
 *   numbers of them, of holonomic ones, of their entries of B, of parameters, the first of the model's; lists of holonomic ones, and of
 *   the rows and columns of the entries; a program as lag_equations.constraint
 *   a program of the parameters that can be set: all parameters, q and v at the start
 *   a program of (t, q, v, a, lambda, p): the derived values
 *
 * A file derivatives.bin is for directional derivatives:
 *
 *   LAG_DERIVATIVES_MAGIC, the number of words, the number P of parameters that change
 *   a list of constraints whose rows of B are independent and span all
 *   a program of (the parameters that can be set, their changes): the changes of all of the model's parameters
 *   a program of (t, q, v, their changes, delta p, p): the changes of the entries of M, f, the entries of B, gamma
 *   of models that switch, the programs functions, limits, forces and kink_rates of lag_directions, where the model has
 *   such
 *   a program of (t, q, v, a, lambda, their changes, delta p, p): the changes of the derived values
 *
 * The values, by value references from 0 on, are t, q, v, a, lambda, the derived values, the parameters.
 */
#ifndef LAGCLI_INSTANCE_H
#define LAGCLI_INSTANCE_H

#include "lagmodel.h"
#include "start/start.h"

#define LAG_VALUES_MAGIC 0x3265756c61766c6c /* "llvalue2" where the lowest byte is the first */

#define LAG_DERIVATIVES_MAGIC 0x3276697265646c6c /* "llderiv2" where the lowest byte is the first */

#define LAG_MESSAGE 400 /* bytes of a message, at most */

/* Receives what is wrong. */
typedef void lag_fmu_message(void *context, const char *text);

/* Receives the time within a step of the co-simulation. Returns the time at which this is to end: INFINITY as planned. */
typedef double lag_fmu_update(void *context, double t);

/* Whether an initial value was set: not; it holds; the search for a consistent state may change it. */
enum lag_fmu_given { LAG_FMU_NOT_GIVEN, LAG_FMU_FIXED, LAG_FMU_GUESS };

enum lag_fmu_phase { LAG_FMU_MADE, LAG_FMU_INITIALIZING, LAG_FMU_STARTED, LAG_FMU_ENDED, LAG_FMU_FAILED };

/* Directional derivatives: fmi/directional.h. */
typedef struct {
    int has;                           /* whether there are any */
    int parameters;                    /* those that change, the first ones of the run's */
    lag_program of_parameters, of_equations, of_columns;
    lag_directions along;              /* of a model that switches */
    const void *bound;                 /* the simulation for which the tapes are bound */
    lag_tape parameter_tape, equation_tape, column_tape;
    double *changes;                   /* of all values, by value references */
    double *seeds;                     /* 2 settable: parameters that can be set, their changes */
    double *p;                         /* changes of the parameters that change */
    double *right;                     /* 2 (nq + nc): the right side, the solution */
    int rank;                          /* of B ... */
    const int32_t *rows;               /* ... independent rows B_r; if there are others: */
    double *independent;               /* rank * nq: B_r */
    double *matrix, *weight;           /* (nq + rank)^2: [[M, B_r'], [B_r, 0]] with weights (rank) of its rows, factored */
    double *square, *shares, *inner;   /* rank^2: B_r B_r', factored; nc * rank: C with B = C B_r; rank^2: C' C, factored */
    double *solution, *mu, *least;     /* nq + rank: scratch; nc: mu with lambda = C (C' C)^-1 mu, 0 in the other rows; nq:
                                          B_r' (B_r B_r')^-1 (C' C)^-1 mu */
    int *pivots;                       /* nq + 3 rank: of the three matrices */
} lag_fmu_directions;

typedef struct {
    lag_pool pool, run_pool;           /* of the instance; of what depends on its simulation */
    lag_fmu_message *message;
    void *context;
    lag_model model;
    const lag_method *method;
    lag_start_search search;
    lag_tape lasting;                  /* the constraints of the run */
    lag_simulation *simulation;        /* NULL until it is needed */
    lag_tape start, columns;           /* the programs */
    lag_program columns_program;
    int nq, nc, own, settable, inputs; /* coordinates, constraints, parameters, those that can be set, inputs */
    int64_t derived, count;            /* derived values, all values */
    const int32_t *place, *input, *fixed;
    double *given, *taken;             /* settable: their values; those that the simulation has ... */
    double *initial;                   /* 2 nq: initial values that were set ... */
    int *is_given, *is_fixed;          /* 2 nq: ... a lag_fmu_given; whether the search may not change them */
    double *begin;                     /* 2 nq: the initial values, set or not, before the search */
    double *parameters, *y, *lengths, *plain_lengths; /* np, 2 nq + 1, nc, nc: of the start */
    double *held;                      /* np: parameters at a sample */
    double *row;                       /* a sample */
    double *values;                    /* count */
    double started_at;                 /* t at the start */
    double stop;                       /* the last time; INFINITY if it is not known */
    enum lag_fmu_phase phase;
    int exchange;                      /* whether another program integrates: model exchange */
    int current;                       /* whether the values are those of the state */
    int changed;                       /* whether an input has changed since the last step */
    int has_event_mode;                /* of co-simulation: whether the importing tool handles events ... */
    int may_return;                    /* ... and steps may end before their end */
    lag_fmu_update *update;            /* called after each step of the integration; NULL */
    lag_fmu_directions directions;
    uint64_t identity;                 /* a hash of the files and of the library; even */
} lag_fmu;

/* Make an instance of the files in a folder, whose name ends in a separator, for model exchange or co-simulation. NULL, and a message, if that fails. */
lag_fmu *lag_fmu_open(const char *resources, int exchange, lag_fmu_message *message, void *context);

/* Make an instance of the contents of these files, aligned as numbers, which must live as long as it. */
lag_fmu *lag_fmu_make(const void *model, int64_t model_bytes, const void *values, int64_t values_bytes, int exchange,
                      lag_fmu_message *message, void *context);
void lag_fmu_close(lag_fmu *fmu);

/* Forget the simulation and what was set. */
void lag_fmu_reset(lag_fmu *fmu);

/* Read and set values. These functions and those below return 0, or 1, and a message, if that fails. */
int lag_fmu_get(lag_fmu *fmu, const unsigned *references, size_t count, double *values);
int lag_fmu_set(lag_fmu *fmu, const unsigned *references, size_t count, const double *values);

/* Begin to set initial values, for a simulation from a time on, up to `stop`. */
int lag_fmu_initialize(lag_fmu *fmu, double start, double stop);

/* Find the consistent initial state, and begin. */
int lag_fmu_begin(lag_fmu *fmu);

/* The first part of it: make the simulation, of fmu->model's problem with the values that were set. */
int lag_fmu_prepare(lag_fmu *fmu);

/* The second part: let what switches begin. Returns 0; 1, and a message. The simulation may be over: an event has ended it. */
int lag_fmu_start(lag_fmu *fmu);

/* Report why the simulation has ended at its present time, a lag_status. Returns 1. */
int lag_fmu_fail_at(lag_fmu *fmu, int status);

/* Evaluate all values at a sample of the simulation's last step: t, q, v, a, lambda. */
void lag_fmu_evaluate_at(lag_fmu *fmu, const double *row);

/* Go on from the present time to another. It ends before where that is allowed: at an event, which lag_fmu_is_due tells
 * and lag_fmu_happen completes, as the next step does, too; or as `update` says. `fmu->phase` is LAG_FMU_ENDED if an event
 * has ended the simulation. */
int lag_fmu_advance(lag_fmu *fmu, double from, double t);
double lag_fmu_time(const lag_fmu *fmu);
int lag_fmu_is_due(const lag_fmu *fmu);

/* Let the event happen that is due, and the inputs act that have changed; *next is the time of the next one that is known,
 * or INFINITY. */
int lag_fmu_happen(lag_fmu *fmu, double *next);

/* Model exchange, of models that do not switch: the state is (q, v). */
void lag_fmu_move(lag_fmu *fmu, double t, const double *state);
int lag_fmu_state_of(const lag_fmu *fmu, double *state, size_t count);
int lag_fmu_derivatives(lag_fmu *fmu, double *derivatives);
/* Whether the state has left the constraints; bring it back to them. */
int lag_fmu_drifted(lag_fmu *fmu);
int lag_fmu_project(lag_fmu *fmu);

/*
 * The state of an instance, as bytes without addresses: any instance of the same FMU and kind can restore it, in any
 * process. lag_fmu_save and lag_fmu_state_from return NULL, and a message, if that fails; a failing lag_fmu_restore
 * leaves an instance that can only be reset.
 */
typedef struct lag_fmu_state lag_fmu_state;
lag_fmu_state *lag_fmu_save(lag_fmu *fmu);
int lag_fmu_restore(lag_fmu *fmu, lag_fmu_state *state);
void lag_fmu_forget(lag_fmu_state *state);
/* Its bytes; NULL of no state. */
const void *lag_fmu_bytes_of(const lag_fmu_state *state, size_t *bytes);
lag_fmu_state *lag_fmu_state_from(const lag_fmu *fmu, const void *from, size_t bytes);

/* Make the simulation of a model, fmu->model with other values; end it. */
int lag_fmu_make_simulation(lag_fmu *fmu, const lag_model *model);
void lag_fmu_end_simulation(lag_fmu *fmu);

/* A hash of bytes, continued from that of others or from LAG_FMU_NO_HASH. */
#define LAG_FMU_NO_HASH UINT64_C(0xcbf29ce484222325)
uint64_t lag_fmu_hash(uint64_t hash, const void *data, size_t bytes);

/* Report what is wrong. Returns 1. */
int lag_fmu_fail(const lag_fmu *fmu, const char *format, ...);

#endif
