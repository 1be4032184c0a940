/*
 * A model as data, and simulations of it: all that a run needs, in one block of memory that can be stored and sent. It
 * is checked when it is read: whatever the data, a simulation of it stays within its memory and ends with a status.
 *
 * The block is a sequence of words of 8 bytes, in the processor's byte order, aligned as numbers:
 *
 *   LAG_MODEL_MAGIC, LAG_MODEL_VERSION, the number of words
 *   a sum of lag_model_contents; the number of steps after which an elimination in a loop is replaced by the unrolled one
 *   lag_equations; lag_problem; the times of breaks; the number of known functions, each a lag_function
 *   where rank is less than nc, with LAG_MODEL_LOOP or LAG_MODEL_UNROLLED, the rows for lag_leave_out
 *   with LAG_MODEL_PLAIN, the program of the dynamics; also with LAG_MODEL_LOOP, lag_elimination
 *   with LAG_MODEL_UNROLLED, the program of the dynamics with the unrolled elimination
 *   with LAG_MODEL_TIME, the program of the functions for lag_use_explicit_time
 *   with LAG_MODEL_SERIES, lag_series_program
 *   with LAG_MODEL_JACOBIANS, lag_jacobians; the number of orders of pivots, each the number of a method and lag_pivots
 *   with LAG_MODEL_SWITCHING, lag_switching_rules; the program of what actions set, the program of T and V, both of
 *   (t, q, v, a, lambda, p); the number of events, each a lag_event
 *   with LAG_MODEL_ADJUSTS, lag_equations of all constraints, whose program has psi, too, and the program of the entries of M, of
 *   (t, q, v, p) without branches
 *
 * A structure is its fields in the order of lagcore.h, those of lag_settings in that of settings.h: an integer or a number is a word. What a pointer refers to is
 * preceded by its count, 0 for NULL; two integers take a word, the last one alone with a zero. A program is its streams
 * (prelude, main, three deferred ones, two of subsets of outputs, each empty if there is none), the number of its
 * inputs, its registers and its outputs. A lag_block is its places.
 */
#ifndef LAGMODEL_H
#define LAGMODEL_H

#include "lagcore.h"

#if defined(__GNUC__)
#pragma GCC visibility push(default)
#endif

#define LAG_MODEL_MAGIC 0x6c65646f6d67616c /* "lagmodel" where the lowest byte is the first */
#define LAG_MODEL_VERSION 8
#define LAG_MODEL_LARGEST 32768 /* nq + 2 nc, and rows, at most */

/* How a and lambda may be found, densely if neither in a loop nor unrolled; and what else there is. */
enum lag_model_contents {
    LAG_MODEL_PLAIN = 1,
    LAG_MODEL_LOOP = 2,
    LAG_MODEL_UNROLLED = 4,
    LAG_MODEL_TIME = 8,
    LAG_MODEL_SERIES = 16,
    LAG_MODEL_JACOBIANS = 32,
    LAG_MODEL_SWITCHING = 64,
    LAG_MODEL_TANGENT = 128,           /* not in data: the equations are those of a motion and its derivatives */
    LAG_MODEL_RECURSIVE = 256,         /* the unrolled elimination has other unknowns: M and f are those of LAG_MODEL_PLAIN */
    LAG_MODEL_ADJUSTS = 512,           /* events may set values that constraints determine, or apply impulses to them */
};

/* Why a model is rejected, or a simulation of it. */
enum lag_model_status {
    LAG_MODEL_READ,        /* it is not */
    LAG_MODEL_FORMAT,      /* no model, of another version or byte order, or not aligned */
    LAG_MODEL_LENGTH,      /* a length that the data do not have */
    LAG_MODEL_SIZES,       /* counts that contradict each other, or are too large */
    LAG_MODEL_INDEX,       /* an index beyond what it counts */
    LAG_MODEL_PROGRAM,     /* a program with an unknown operation, a register that it does not have, or no end */
    LAG_MODEL_OUTPUTS,     /* a program without the inputs or outputs that it must have */
    LAG_MODEL_NUMBER,      /* a number that is not finite, or beyond its range */
    LAG_MODEL_METHOD,      /* the data lack what the method needs */
    LAG_MODEL_MEMORY,      /* no memory to make a run */
};

/* An event of the model. Its actions are performed in this order. */
typedef struct {
    int condition, clock;              /* what triggers it; -1 */
    int constraint;                    /* or a change of a constraint: its number among all, -1; ... */
    int change;                        /* ... closes, opens, slips, sticks, impacts: as lag_switching_rules.reported */
    int times;                         /* it happens so often at most; 0: without a limit */
    int first;                         /* first output for it of the program of actions: values to set, impulses */
    int target_count;
    const int32_t *kind, *target;      /* what is set: 0, a coordinate; 1, a velocity; 2, a parameter; which */
    int displaces;                     /* whether that may violate constraints */
    int impulse_count;
    const int32_t *impulse;            /* the coordinates of a generalized impulse */
    int release_count, engage_count;
    const int32_t *release, *engage;   /* rows */
    int stops;                         /* whether it ends the run */
} lag_event;

/* An order of pivots of a method, by its number. */
typedef struct {
    int method;
    lag_pivots pivots;
} lag_method_pivots;

/* What a run needs, whether it is read or a program fills it. What it points to must live as long as it and its simulations:
 * the data from which it is read. The problem is that of the simulation that the data were written for; times, tolerances and
 * so on may be changed before a simulation is made. The breaks are those up to t_end; without LAG_MODEL_SWITCHING,
 * `rules` is empty. The log of the rules is NULL where the simulation has its own. */
typedef struct {
    lag_equations equations;
    lag_problem problem;
    int contents;                      /* a sum of lag_model_contents */
    int64_t unroll_after;
    const double *breaks;
    int64_t break_count;
    int function_count, pivots_count, event_count;
    const lag_function *functions;
    const lag_method_pivots *pivots;   /* in the order in which runs of a method ask for them */
    const lag_event *events;
    const int32_t *left_out;           /* nc - rank; NULL without an elimination */
    lag_program dynamics, unrolled, explicit_time;
    lag_elimination elimination;
    lag_series_program series;
    lag_jacobians jacobians;
    lag_switching_rules rules;
    lag_program actions, energy;       /* empty where the caller answers LAG_HAPPENED */
    lag_equations whole;               /* with all constraints, for lag_make_adjustment, with ... */
    lag_program mass;
    lag_program tangent;               /* for lag_use_tangent, with ... */
    int tangent_blocks, tangent_complete;
    void *owned;                       /* what lag_release_model releases; NULL */
} lag_model;

/* Read and check a model. Without `memory` it uses malloc and free. Returns a lag_model_status; what it has allocated is
 * released unless that is LAG_MODEL_READ. */
int lag_read_model(const lag_memory *memory, const void *data, int64_t bytes, lag_model *model);
void lag_release_model(lag_model *model);

/* Check that a program stays within its registers: LAG_MODEL_READ or LAG_MODEL_PROGRAM. Its deferred streams may be
 * empty. */
int lag_check_program(const lag_program *program);

/* A simulation of a model: a run that does what lagcli does where a run returns to its caller. */
typedef struct lag_simulation lag_simulation;

/* Make a simulation by a method, "DOP853" for instance: see lag_method_name. Samples go to problem.block. Returns a
 * lag_model_status; the simulation only with LAG_MODEL_READ. */
int lag_make_simulation(const lag_memory *memory, const lag_model *model, const char *method,
                        lag_simulation **simulation);
void lag_destroy_simulation(lag_simulation *simulation);

/* Its run: for lag_take, lag_report_of, lag_dense and the like. */
lag_run *lag_run_of(lag_simulation *simulation);

/* Take at most this number of steps. Returns a lag_status. The simulation continues after LAG_RUNNING; after
 * LAG_BLOCK_FULL, once the samples are taken; and after what lag_let_answer lets it return. Any other status
 * is its last. */
int lag_simulate(lag_simulation *simulation, int64_t steps);

/* Go on to a time, where a step ends, also beyond t_end, but not beyond the last break of known functions. Returns
 * LAG_RUNNING, LAG_DONE where an event has ended the simulation before, or why it failed. */
int lag_simulate_to(lag_simulation *simulation, double t);

/* Let it return these statuses, a sum of 1 << lag_status, too, instead of doing what is to be done there: the caller does, and
 * lets it continue. Whoever answers LAG_HAPPENED performs the actions of events, and takes the run's log: lag_take_log. After
 * lag_begin_again_here, the simulation begins its motion again, from where it is. */
void lag_let_answer(lag_simulation *simulation, int64_t statuses);
void lag_begin_again_here(lag_simulation *simulation);

/* The event that has ended it, or -1. */
int lag_stopped_by(const lag_simulation *simulation);

/* The log so far, *count entries of *width numbers: time, lag_occurrence, what (a constraint's number, or an event's),
 * loss, supplied, work, the modes of exported rows after the instant, q, v before and after, impulses of all
 * constraints. It is valid until the simulation continues. */
const double *lag_log_of(const lag_simulation *simulation, int64_t *count, int *width);

/* Save and restore it, as lag_save and lag_restore do with a run; the log is cut back. */
size_t lag_simulation_size(const lag_simulation *simulation);
void lag_save_simulation(const lag_simulation *simulation, void *to);
int lag_restore_simulation(lag_simulation *simulation, const void *from);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif
