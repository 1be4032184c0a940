/*
 * The integrator's public interface: plain C11 that needs nothing but libm, malloc, free and the functions of
 * memory (memcpy, memmove, memset, memcmp); for machine code, on x86-64, also the system's functions of executable memory.
 *
 * It integrates M a = f + B' lambda, B a = gamma, phi = 0, psi = 0 from a consistent state. A program
 * calls lag_create, one of the lag_use_... functions for the linear system, then lag_start and
 * lag_advance until that returns LAG_DONE. The arrays of the structures below are copied; those that
 * the core writes to, lag_problem.block, stay the caller's. nq is the number of coordinates, nc of
 * constraints, nh of holonomic ones; n = 2 nq + 1 that of the state y = (q, v, W), W the work done on
 * the system. SI units throughout. docs/developer/core.md has an example.
 */
#ifndef LAGCORE_H
#define LAGCORE_H

#include <stddef.h>
#include <stdint.h>

#include "settings.h" /* lag_settings */
#include "tables.h" /* lag_status */

/* The library exports what this header declares, and nothing else. */
#if defined(__GNUC__)
#pragma GCC visibility push(default)
#endif

/* Memory allocation. `release` is called with results of `allocate`. Without `allocate`, the core uses malloc and
 * free. */
typedef struct {
    void *(*allocate)(void *context, size_t bytes); /* NULL if there is no memory */
    void (*release)(void *context, void *memory);
    void *context;
} lag_memory;

/* A sequence of operations; engine/core/program.py has the format. */
typedef struct {
    const int32_t *code;
    int64_t length;
} lag_stream;

/* A function as operations on a register file: engine/core/program.py. */
typedef struct {
    lag_stream prelude, main;
    lag_stream deferred[3];               /* for outputs that are evaluated on request */
    lag_stream output_subsets[2];               /* for subsets of the outputs; empty if there are none */
    int inputs;                        /* the first registers; the last of them contain the parameters */
    const double *registers;           /* initial values, before the prelude */
    int64_t register_count;
    const int32_t *outputs;            /* registers */
    int64_t output_count;
} lag_program;

/* The sizes and the sparsity of the equations. */
typedef struct {
    int nq, nc, nh;
    int np;                            /* parameters */
    const int32_t *holonomic;          /* nh: indices of the constraints */
    int nm, nb;                        /* entries of M and of B */
    const int32_t *mass_row, *mass_column;         /* nm */
    const int32_t *jacobian_row, *jacobian_column; /* nb */
    const int32_t *unit;               /* nq: the first coordinate known to have the same unit */
    lag_program constraint;            /* of (t, q, v, p): phi, entries of B, b_0, scales of phi and psi, psi */
} lag_equations;

/* Versions of the core's loops, with equal results: for any processor; for processors with AVX2; and the same with
 * programs that run often as machine code, where the system allows it. */
enum lag_kernel { LAG_PORTABLE, LAG_AVX2, LAG_NATIVE };

/* The fastest version that this processor runs. Ask once: in a virtual machine the answer takes microseconds. */
int lag_best_kernel(void);

/* Handling of singular configurations. */
enum lag_watching { LAG_IGNORE, LAG_PASS, LAG_STOP };

/* An initial value problem: how to solve it, where it begins, and where its samples go. */
typedef struct {
    lag_settings settings;
    double t;                          /* the initial time, s */
    const double *y;                   /* n: the initial state, consistent */
    const double *parameters;          /* np */
    const double *atol;                /* n: absolute tolerances; 0 if they follow the entry's size */
    const int32_t *kind;               /* nq: coordinates of one kind have the same number, from 0 */
    int rank;                          /* rank of B at the initial state */
    const double *sizes;               /* nq: comparable changes of the coordinates */
    const double *lengths;             /* nc: of the rows of B times sizes, at the initial state */
    const double *plain_lengths;       /* nc: of the rows of B */
    int watching;                      /* a lag_watching */
    int detecting;                     /* detect stiffness */
    int refinable;                     /* solutions may be refined before another elimination is requested */
    const double *times;               /* sample times, increasing, s */
    int64_t times_count;
    double *block;                     /* block_rows rows of t, q, v, a, lambda, W */
    int64_t block_rows;
    int extra;                         /* rows that switch: each sample has their multipliers among lambda */
    int directions;                    /* in which a motion that switches is differentiated: their changes of q and v
                                        * follow y, and those of q, v, a, lambda (of all constraints) each row */
    int kernel;                        /* a lag_kernel */
} lag_problem;

/* An order of elimination of [[M, B'], [B, 0]] = L D L' (engine/linear/elimination.py). Places are
 * numbers in that order. */
typedef struct {
    int n;                  /* nq + nc, of one block; without the rows that are left out */
    const int32_t *order;   /* n: the unknown at each place */
    const int32_t *paired;  /* n: whether a pivot of order two begins at the place */
    const int32_t *start;   /* n + 1: start of each column of L */
    const int32_t *row;     /* the places of L's entries, by column, ascending */
    /* destinations of the entries of M and B: the diagonal (n), the pairs (n), L; -1: nowhere */
    const int32_t *mass_targets, *jacobian_targets;
} lag_elimination;

/* A program for the motion's Taylor coefficients: engine/taylor/series.py. */
typedef struct {
    lag_program values;
    lag_stream stream;
    int convolutions, order;
    int invariant, numbers;
    const int32_t *begins;             /* begin_count */
    int begin_count;
    int origin, layer;
    const int32_t *state;              /* n + 1: t, q, v, W */
    int64_t size;
} lag_series_program;

/* A sparse block of derivatives: places are row * nq + column. */
typedef struct {
    int count;
    const int32_t *places;
} lag_block;

/* The derivatives that implicit methods need, one block after the other, then those with respect to t
 * (engine/system.py); and the pattern of their matrix (engine/linear/sparse.py). */
typedef struct {
    lag_program program;               /* of (t, q, v, a, lambda, p) */
    lag_block force_position, force_velocity, rhs_position, rhs_velocity;
    lag_block power_position, power_velocity;
    int n;                             /* order of the matrix */
    const int32_t *start, *columns;    /* its entries row by row */
    const int32_t *parts;              /* destinations of the parts' entries */
    int64_t parts_count;
} lag_jacobians;

/* Sparse LU with a known order of pivots and pattern. The factors' entries are row by row in the order
 * of the pivots, columns too, with the fill. */
typedef struct {
    int n;
    const int32_t *row, *column;       /* n: positions of the pivots in the matrix */
    const int32_t *start;              /* n + 1: start of the factors' rows */
    const int32_t *columns;            /* of the factors' entries, increasing in each row */
    const int32_t *diagonal;           /* n: diagonal entry of each row */
    const int32_t *places;             /* position of each matrix entry in the factors */
} lag_pivots;

/* A known function of time in pieces: engine/tape/inputs.py. Its piece at t is among the parameters of
 * programs: the time from which it counts, then degree + 1 coefficients, ascending. The arrays are not
 * copied: they must outlive the run. */
typedef struct {
    int first;                         /* index of its piece among the parameters */
    int degree;
    int64_t count;                     /* of pieces */
    const double *knots;               /* count: start of each piece; the first is also used before it */
    const double *origins;             /* count: origin of each piece */
    const double *coefficients;        /* count rows of degree + 1 */
    double period;                     /* 0: none */
} lag_function;

/* Kinds of entries of the log: of rows; and of a model's events, which lagmodel.h adds. */
enum lag_occurrence {
    LAG_CLOSES,
    LAG_OPENS,
    LAG_SLIPS,
    LAG_STICKS,
    LAG_IMPACT,
    LAG_REST,                          /* a sequence of impacts that has a limit in time has ended */
    LAG_NOT_UNIQUE,                    /* an impact has more than one solution */
    LAG_REDUNDANT,                     /* from here on, a force is not unique */
    LAG_EVENT,
    LAG_RELEASES,
    LAG_ENGAGES,
};

/* Rows of constraints that do not always hold, beside those of lag_equations, and what else switches:
 * core/switching/switching.h and engine/switching/switching.py. Numbers of constraints are among all, those of
 * lag_equations and the rows, nc of them. */
typedef struct {
    int rows, exported, nc;            /* modes of the first rows, `exported` of them, are part of the log */
    const int32_t *constraint, *base;  /* rows, and those of lag_equations: their numbers among all */
    const int32_t *law;                /* rows: of core/contact/contact.h: unilateral, limited, free */
    const int32_t *limit, *normal;     /* rows: which limit, which row limits it; -1 */
    const int32_t *place;              /* rows: index of phi; -1 */
    const double *sign;                /* rows: -1 where phi <= 0 */
    const int32_t *active;             /* rows */
    const int32_t *friction, *restitution; /* rows: which output of `impact`; -1 */
    int nb, nh;
    const int32_t *row, *column;       /* nb */
    lag_program functions;             /* of (t, q, v, p): phi (nh), B (nb), b_0, gamma, scale of psi (rows
                                        * each), scale of phi (nh) */
    lag_program gaps;                  /* of (t, q, v, p): phi (nh) */
    int signs;                         /* of functions of forces, fixed within a step: 1 or -1 */
    lag_program sign_functions;        /* of (t, q, v, a, lambda, signs, p): the functions, and their sizes */
    /* of (t, q, v, a, lambda, signs, p): static and kinetic limits (nl each), their derivatives by pattern */
    lag_program limits;
    int nl, pattern_count;
    const int32_t *pattern_limit, *pattern_row;
    lag_program impact;                /* of (t, q, v, p): coefficients of restitution and friction */
    int nf, force_count;               /* forces that depend on lambda, and their derivatives */
    const int32_t *force_coordinate, *force_row, *force_constraint;
    lag_program forces;                /* of (t, q, v, a, lambda, signs, p) */
    int conditions, force_conditions;
    lag_program condition_functions;   /* of (t, q, v, p) */
    lag_program force_condition_functions; /* of (t, q, v, a, lambda, signs, p) */
    const int32_t *either, *time;      /* of all conditions: whether they happen either way, depend on t alone */
    int clocks;
    const double *ticks;               /* 3 clocks: see lag_clock */
    const int32_t *most;               /* clocks: largest number of ticks; 0 without a limit */
    const int32_t *reported;           /* 5 rows: closes, opens, slips, sticks, impact: whether to return at it */
    int kinks, first_branch;           /* branches of the equations; where they are among the parameters */
    const int32_t *whole, *of_time;    /* kinks: whether whole parts (1: floor, -1: ceil); depend on t alone */
    lag_program kink_functions;        /* of (t, q, v, p): what the branches follow, and its sizes */
    double *log;                       /* log_rows entries: core/switching/log.c */
    int64_t log_rows;
} lag_switching_rules;

/* Functions whose sign may not be determined in a step. */
enum lag_undetermined { LAG_OF_ROW, LAG_OF_KINK, LAG_OF_CONDITION };

typedef struct {
    double t;
    const double *y;                   /* 2 nq + 1 */
    const int *mode, *active;          /* rows */
    const double *gap, *speed, *force; /* rows: phi, psi, z, each by the row's sign */
    double gained;                     /* energy gained by the last impact, if rejected ... */
    int with_friction;                 /* ... whether it had friction */
    int equal_restitution;             /* ... whether all its coefficients of restitution are equal */
    const int *takes_part;             /* rows: participating in the last impact */
    int motions;                       /* result of the last contact problem: core/contact/contact.h */
    int begun;                         /* whether the initial modes are known ... */
    const int *first_mode;             /* ... these modes */
    const double *before;              /* n: the state at the beginning of the instant ... */
    const double *a, *multipliers;     /* ... nq, nc (all constraints): 0 initially */
    int64_t crossed, slid;             /* number of changes of branches, and of starts of sliding */
    const int *kinks;                  /* kinks: 1 if the function of a branch vanishes at the instant */
    const double *branches;            /* kinks */
    enum lag_undetermined undetermined; /* after LAG_UNRESOLVED: the kind of function, ... */
    int which;                         /* ... and the index of its row, kink or condition */
} lag_instant_report;

/* The last contact problem of a run, and its solutions: core/contact/contact.h. */
typedef struct {
    int n;
    const int *row, *law;              /* n */
    const double *matrix, *offset, *static_limit, *static_slope, *kinetic_limit, *kinetic_slope;
    const double *force[2], *motion[2];
    const int *mode[2];
} lag_contact_report;

/* The state of a run. Its arrays are valid until the run continues. */
typedef struct {
    double t_old, t;                   /* start and end of the last step */
    const double *y;                   /* n: at t */
    const double *atol;                /* n: absolute tolerances in use */
    const double *lengths;             /* nc: the largest so far of the rows of B times sizes */
    int64_t steps, rejected, evaluations;
    int64_t times_next;                /* the next sample time */
    double t_bad;                      /* if a status refers to another state: its time ... */
    const double *y_bad;               /* ... and the state */
    int64_t examined;                  /* states whose distance from singular configurations was computed */
    double suspect_from, suspect_to;   /* after LAG_OVER: part of the last step in which B may lose rank */
    int limiting;                      /* the entry of y whose error rejected a step last; -1: none */
} lag_report;

typedef struct lag_run lag_run;
typedef struct lag_method lag_method;

/* Method i of the available ones, DOP853 first, or NULL; and its name. */
const lag_method *lag_method_at(int i);
const char *lag_method_name(const lag_method *method);

/* Create a run, with DOP853. Without `memory` it uses malloc and free. NULL if there is no memory. */
lag_run *lag_create(const lag_memory *memory, const lag_equations *equations, const lag_problem *problem);
void lag_destroy(lag_run *run);

/*
 * How a and lambda are found: densely; by an elimination in a loop; or by one that is unrolled in the
 * program. These functions and those below return 0, or 1 where there is no memory: then the run can
 * only be destroyed. Programs of the dynamics are functions of (t, q, v, p): the entries of M, f, the
 * entries of B, gamma, the power (engine/system.py).
 */
int lag_use_dense(lag_run *run, const lag_program *dynamics);
int lag_use_elimination(lag_run *run, const lag_program *dynamics, const lag_elimination *plan);
int lag_use_unrolled(lag_run *run, const lag_program *dynamics);

/* Take M and f from another program with the outputs of the dynamics, evaluated where they are needed: an unrolled
 * elimination of other unknowns does without them. Not with constraints, nor with derivatives; call it after
 * lag_use_unrolled. */
int lag_use_equations(lag_run *run, const lag_program *equations);

/* Say which nc - rank rows of B, ascending, follow from the others: an elimination that leaves them out is used next.
 * Their multipliers are 0 in its solution; samples have the multipliers of least norm. */
int lag_leave_out(lag_run *run, const int32_t *rows);

/* Use the dense solution for the next steps, regardless of other settings. */
int lag_allow_dense(lag_run *run, int64_t steps);

/* Allow Taylor's method, with an unrolled elimination; call it again after lag_use_unrolled. */
int lag_use_series(lag_run *run, const lag_series_program *program);

/* Allow implicit methods. */
int lag_use_jacobians(lag_run *run, const lag_jacobians *jacobians);

/* The entries of the implicit method's matrix, after a step returned LAG_ORDER; and their pivots. */
const double *lag_matrix(const lag_run *run);
int lag_use_pivots(lag_run *run, const lag_pivots *pivots);

/*
 * Say that the equations are those of the motion and, in further blocks that repeat it, of its derivatives: each
 * block has M and B of the motion. The dynamics yield f, gamma and the solution for the motion alone, and 0 for the
 * rest; `tangent` yields f and gamma of each further block, of (t, q, v, a, lambda, p), a and lambda those of
 * the motion. The order of elimination is that of one block. `complete`: an unrolled elimination yields the
 * solution for all blocks. Call it before lag_use_dense and its like.
 */
int lag_use_tangent(lag_run *run, const lag_program *tangent, int blocks, int complete);

/* Limit steps so that they resolve functions of (t, q, v, p) that depend on t explicitly: the program yields their values,
 * then for each whether it is used, and whether it depends on q or v. */
int lag_use_explicit_time(lag_run *run, const lag_program *functions);

/* End steps at these increasing times, at which the right side is not smooth. Samples there are taken after the
 * break. */
int lag_use_breaks(lag_run *run, const double *times, int64_t count);

/* Update the pieces of known functions of time; their knots must be among the breaks. */
int lag_use_functions(lag_run *run, const lag_function *functions, int count);
/*
 * Let rows switch, and look for conditions. Where lag_start or lag_advance returns LAG_HAPPENED, the
 * instant waits: conditions that have happened are requested once, the state, rows and parameters may be changed by
 * the functions below, and the next call continues with the instant.
 */
int lag_use_switching(lag_run *run, const lag_switching_rules *rules);
lag_instant_report lag_instant_of(lag_run *run);
lag_contact_report lag_contacts_of(lag_run *run);
int lag_condition_happened(lag_run *run, int which);
int lag_condition_holds(const lag_run *run, int which);
int lag_clock_ticks(lag_run *run, int which);
double lag_next_tick(const lag_run *run);
double lag_gap_of_none(const lag_run *run, int row); /* tolerance of a closed gap */
void lag_place(lag_run *run, const double *y);
void lag_activate(lag_run *run, int row, int active);
void lag_set_parameters(lag_run *run, const double *parameters);

/* Apply a generalized impulse (nq); with derivatives, its changes (directions * nq), or NULL. The impulses of the constraints
 * that always hold (nc), of least norm, go to `reaction`. Returns LAG_RUNNING or LAG_UNDEFINED. */
int lag_push(lag_run *run, const double *impulse, const double *changes, double *reaction);

/* Return the entries of the log, and empty it. */
int64_t lag_take_log(lag_run *run);

/*
 * Derivatives of a motion that switches: derivatives/derivatives.h. Programs are the derivatives of those with the
 * same name along a direction, of (t, q, v, delta t, delta q, delta v, delta p, p), or of (t, q, v, a, lambda,
 * delta t, ..., delta lambda, delta p, p); programs of what there is none of are empty. After lag_use_switching. With
 * them, DOP853 takes the steps, and each entry of the log ends with the changes of its time.
 */
typedef struct {
    int parameters;                    /* whose changes are given: the first ones */
    const double *p;                   /* directions * parameters: changes at the start */
    const int32_t *decides;            /* conditions: whether an event with actions depends on it */
    lag_program dynamics;              /* entries of M, f, entries of B, gamma */
    lag_program constraint;            /* phi, entries of B, b_0 */
    lag_program functions;             /* of the rows: phi, entries of B, b_0, gamma */
    lag_program limits, impact, forces, signs;
    lag_program conditions, force_conditions;
    lag_program kinks;
    lag_program kink_rates;            /* of (t, q, v, their rates, delta t, ..., delta p, delta v, delta a, p): the
                                        * rates of the functions, their changes */
} lag_directions;

int lag_use_directions(lag_run *run, const lag_directions *directions);

/* Why a direction has no derivatives: a lag_reason, and watched functions by their kind and number. */
typedef struct {
    int lost, reason, count;
    double t;
    const int *what, *which;
} lag_loss_report;
lag_loss_report lag_loss_of(const lag_run *run, int direction);

/* Changes of the state at an instant (directions * 2 nq, parameters), of a and lambda of all constraints (nq + nc), and
 * of the instant's time, or that of a condition (-1: none). */
int lag_read_changes(lag_run *run, double *of_state, double *of_parameters, double *of_forces);
const double *lag_change_of_time(const lag_run *run, int condition);

/* Set them where an action has changed the state. */
void lag_set_changes(lag_run *run, const double *of_state, const double *of_parameters);

/* Continue with another method from here. Returns LAG_RUNNING or LAG_UNDEFINED. */
int lag_switch(lag_run *run, const lag_method *method);

/* Prepare the first step; take the sample at the initial time. Returns a lag_status. */
int lag_start(lag_run *run);

/* Take at most `slice` steps. Returns a lag_status. */
int lag_advance(lag_run *run, int64_t slice);

/* Sample the last accepted step, or the start, up to a time. Returns a lag_status. */
int lag_sample_until(lag_run *run, double end);

/* Write the sample row of the current state, which is not stored. Returns a lag_status. */
int lag_sample_here(lag_run *run, double *row);

/* Return the number of filled rows of the block, and empty it. */
int64_t lag_take(lag_run *run);

/* The last step's dense output: q, v, W and the derivatives of q and v, as `y` of lag_problem. */
void lag_dense(lag_run *run, double t, double *y);

/* Whether the state is near a singular configuration: its least singular value is small, relative to its largest. */
int lag_is_near(lag_run *run);

/* After LAG_NEAR: the last states, of which each is nearer to a singular configuration than the one before, t, q, v, W of
 * each. Returns their number, at most LAG_APPROACH_STATES. */
int lag_approach_of(const lag_run *run, double *states);

/* Take the last step back, after LAG_OVER; the next one is shorter. */
void lag_repeat(lag_run *run);

/* Continue from another state; lag_start must follow. */
void lag_move(lag_run *run, double t, const double *y, int64_t times_next);

/* Update the sizes of the terms of accelerations, after the linear solution has changed: sizes.h. Returns
 * LAG_RUNNING or LAG_UNDEFINED. */
int lag_sizes_again(lag_run *run);

/* Write the state of a run. */
void lag_report_of(const lag_run *run, lag_report *report);

/* Taylor coefficients of y here, n rows of order + 1. Returns 0, or 1 where there are none. */
int lag_coefficients(lag_run *run, double *out);

/*
 * Save a run, to bytes of the given number, and continue from there later: for attempts that may be undone. Only the
 * run that was saved can be restored, and only while it has allocated nothing: lag_restore returns 1, and does
 * nothing, after one of the lag_use_... functions. The block and the log are the caller's.
 */
size_t lag_state_size(const lag_run *run);
void lag_save(const lag_run *run, void *to);
int lag_restore(lag_run *run, const void *from);

/* The fingerprint of the sources that the library was compiled from, as hexadecimal digits. */
const char *lag_fingerprint(void);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif
