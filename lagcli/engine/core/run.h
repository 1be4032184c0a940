/*
 * A run of the integrator: steps on the index-1 form, with projection onto the constraints.
 *
 * Each part below belongs to the source file that its comment names, which alone changes it, unless said
 * otherwise.
 */
#ifndef LAGCLI_RUN_H
#define LAGCLI_RUN_H

#include "derivatives/derivatives.h"
#include "linear/ldl.h"
#include "memory.h"
#include "series/series.h"
#include "switching/switching.h"
#include "system.h"
#include "tape/interval.h"

/* step.c, and the methods: the state and the last step. */
typedef struct {
    double t_start, t;
    double t_stop;                     /* next break, tick of a clock, or the end: breaks.c */
    double h, h_max;                   /* of the next step */
    double error_old;                  /* error of the last step, for step size control */
    double *y, *f;                     /* n: the state and its derivative */
    double t_old, h_old;               /* the last step */
    double *y_old;                     /* n */
    double *y_new, *f_new;             /* n: the step's end before projection, its derivative */
    double *stages;                    /* 16 n */
    double *dense;                     /* 7 n */
    int dense_ready;
    int strays;                        /* whether the dense output does, at a sample: then a step of its own goes there */
    int searching;                     /* whether instants are searched for: the dense output must be accurate */
    int dense_inaccurate;              /* ... but is not, at (failure.t, failure.y) */
    int finishing;                     /* the last step is accepted and not yet sampled */
    double *trial;                     /* n: scratch */
    double *work;                      /* 2 N, 2 n and 3 nc: scratch */
    int64_t steps, rejected, evaluations;
} lag_step;

/* sizes.c: a tape whose rounding errors are enclosed, and the number of registers that there is memory for. */
typedef struct {
    lag_pool pool;                     /* of the registers, made when they are first needed */
    lag_jet_tape jets;
    int64_t capacity;
} lag_enclosed;

/* sizes.c: the absolute tolerances. */
typedef struct {
    double *atol;                      /* n: of the next step ... */
    double *rounding;                  /* ... and what rounding errors need of it */
    const double *given;               /* n: given tolerances; 0 if they follow the size */
    double *size, *acceleration_terms, *future_acceleration;      /* n, nq + 1, nq: S, A and P, R of sizes.h */
    double *emerging;                  /* nq: M_ii^-1/2 of coordinates that started at rest, without acceleration; else 0 */
    double *rest;                      /* n: the state at the start, from which those leave rest */
    double *noise_at_rest;             /* n: scratch */
    int kinds;                         /* of coordinates, by their unit */
    const int32_t *kind;               /* nq */
    double *largest;                   /* 2 kinds: size of the coordinates and the velocities */
    double *terms;                     /* nq: scratch */
    double *down, *beside, *change;    /* n each: scratch */
    double *noise;                     /* n: rounding errors of y', found in a step ... */
    int64_t noise_until;               /* ... and known until this one */
    double *strict;                    /* 2 n: atol and rounding of the step, before they were raised */
    lag_enclosed *enclosed;            /* 2, not saved: the tape with f and M, and that with a */
    int raised;                        /* whether they are */
    int limiting;                      /* the entry whose error rejected a step last; -1: none */
    int64_t since, again;              /* the step since which A is amplified, and at which it is found again; 0: never */
} lag_tolerances;

/* dop853.c: whether stability, not the order's accuracy, limits the steps. */
typedef struct {
    int detecting;                     /* whether to detect stiffness */
    int stiff, not_stiff;              /* consecutive steps that were so */
} lag_stiffness;

/* advance.c: the damping of Baumgarte's stabilization, given or by the step. */
typedef struct {
    double alpha, beta;
} lag_baumgarte;

/* project_system.c: the projection. */
typedef struct {
    double *scale_position, *scale_velocity;   /* nh, nc */
} lag_projection;

/* solution.c: how a and lambda are found. */
enum lag_solution { LAG_BY_LU, LAG_BY_TAPE, LAG_BY_LDL };

typedef struct {
    enum lag_solution by;
    int64_t dense_steps;               /* of steps to take by dense LU, one more: also up to the next one */
    int refinable;                     /* whether solutions may be refined before an order is replaced */
    int verifies;                      /* whether each a and lambda is checked: lag_accelerate_accurately */
    int refining;                      /* whether y' needs a refined solution ... */
    int accurate_steps;                /* ... and the consecutive steps that would not have needed it */
    double inaccuracy;                 /* residual of the equations at the last step's end ... */
    int64_t rejected;                  /* ... and the number of steps rejected until then */
    double *a, *multipliers;           /* nq, nc: at the state evaluated last */
    double *right, *solution;          /* N each */
    double *block;                     /* nq + nc of one block: scratch */
    int other_right;                   /* index of another right side in the tape's inputs */
} lag_solver;

/* solution.c: the elimination in a loop. */
typedef struct {
    lag_elimination plan;
    lag_supernodes nodes;
    double *factors;                   /* inverse of D: 2 (nq + nc); L */
    double *product;                   /* as long as L */
} lag_factors;

/* solution.c: the dense matrix, bordered by the dependencies of B's rows: N = nq + nc + nc - rank. */
typedef struct {
    double *matrix, *lu;               /* N*N each; NULL until they are needed */
    int *pivots;                       /* N */
    double *weight;                    /* nc: scales the rows of B times sizes to order one */
} lag_dense_matrix;

/* watch.c and solution.c: the rows of B. */
typedef struct {
    int rank;                          /* of B at the initial state */
    double *sizes;                     /* nq: changes of the coordinates that count as equal, by their
                                        * inertia at the start; the unknowns are a over sizes */
    double *lengths;                   /* nc: largest length of each row of B times sizes so far */
    double *plain_lengths;             /* nc: the same of the rows of B alone */
    double *scaled;                    /* nc * nq: the rows of B times sizes over their lengths; with many
                                        * rows, this and what follows NULL until the dense solution is used */
    int *order;                        /* nc */
    double *components;                /* nc * nc */
    int32_t *same_column;              /* nb: the next entry of B in the column of each, or -1 */
    double *dependencies;              /* (nc - rank) * nc */
    double margin;                     /* left_out.c: path of B for which the rows that are not left out suffice */
    int poor;                          /* steps in which they did not */
    int32_t *left_out, *place_left_out; /* nc - rank: rows that follow from the others, which eliminations leave out, and
                                        * their places in phi, or -1; NULL where they leave out none */
    int contradicted;                  /* redundant constraints may contradict each other */
} lag_rows;

#define LAG_DETERMINANTS 16 /* at which ln |det| is known in a step, at most */

/*
 * ln |det [[M, B'], [B, 0]]| in a step, of models with many rows of B, or whose B moves too much for the bound by its
 * path: near a time s at which B loses rank it is 2 ln |t - s| and something smooth.
 */
typedef struct {
    int kept;                          /* whether it is computed at the stages */
    int count;
    double t[LAG_DETERMINANTS], value[LAG_DETERMINANTS]; /* at the beginning, if it is known, and at the stages */
    double begin;                      /* at the beginning; NaN: not known */
    enum lag_solution by;              /* how it is found: values that are found in different ways differ */
} lag_determinant;

/*
 * The path of B, times sizes over lengths, in a step: from its beginning through its stages, by the Frobenius norm.
 * No singular value changes by more than the path's length (Weyl).
 */
typedef struct {
    double *begin, *last;              /* nb each: entries of B where the step began, and at its last stage */
    double *weight;                    /* nb: sizes over lengths */
    const double *entries;             /* of the two, those from which the path continues */
    double t;                          /* of these */
    double length, speed;              /* of the path, and its largest speed between two stages */
    int exceeded;                      /* whether the last step's path exceeded what its ends allow */
    double margin, margin_at_end;      /* of few rows: what the least singular value is not below, where the step began
                                        * and where it ended */
} lag_path;

#define LAG_APPROACH_STATES 4 /* states of an approach that are kept */

/* The last steps, where each went towards a singular configuration. */
typedef struct {
    double value;                      /* the least singular value after the last step; INFINITY: far from 0 */
    double largest, largest_pivot;     /* its largest so far, and the largest least pivot where it was determined */
    double examined;                   /* value below which the path ahead is to be examined */
    double changed;                    /* value at the last progress, ... */
    int64_t changed_at;                /* ... and number of steps until then */
    int states;                        /* that are kept */
    double t[LAG_APPROACH_STATES], values[LAG_APPROACH_STATES], *y; /* their times, values and y, lag_size each */
} lag_approach;

/* watch.c: the watch for singular configurations. */
typedef struct {
    int mode;                          /* a lag_watching */
    double pivot, largest_pivot;       /* least pivot of B after the last step; its largest so far */
    double pivot_at_end;               /* of the last step, before projection; INFINITY: far from 0 */
    int64_t examined;                  /* states whose least pivot was computed, or would be without the determinant */
    double suspect[2];                 /* part of the last step in which B may lose rank: from 0 to 1 */
    double *combination;               /* nc: of rows, that inverse iteration found last; and nc of scratch */
    lag_approach approach;
    lag_path path;
    lag_determinant determinant;
    double largest_step;               /* of many rows: since the least pivot was last computed */
    int approaching;                   /* whether the last step went towards a singular configuration */
} lag_watch;

/* sample.c: samples. */
typedef struct {
    const double *times;
    int64_t count, next;               /* of times; the next one */
    double *block;                     /* rows of t, q, v, a, lambda (of all constraints), W */
    int64_t rows, used;
    int extra;                         /* multipliers of rows that switch */
    double *y, *kept;                  /* n, nq + nc: scratch */
    void (*written)(void *context, const double *row); /* called with each sample, while the parameters are those at it; NULL */
    void *context;
} lag_samples;

/* breaks.c: times at which the right side is not smooth. */
typedef struct {
    const double *times;               /* increasing, s */
    int64_t count, next;               /* the first one after the state */
    const lag_function *functions;     /* whose pieces change there */
    int function_count;
} lag_breaks;

/* resolution.c: functions that depend on t explicitly. */
typedef struct {
    int count;                         /* 0: there are none */
    lag_tape tape;                     /* of (t, q, v, p) */
    lag_jet_tape jets;
    int *of_state;                     /* count: whether they depend on q or v, too */
    double *scale;                     /* count: their largest values in the run; 0: none was found */
    int *singular;                     /* count: whether they have no bounds even at the beginning of the step */
    double start, end, step;           /* steps up to this resolve them between these times */
    int supposed;                      /* whether the step may not resolve those of the state, if this rests */
    lag_jet_tape middle;               /* jets at the middle of an interval */
    lag_dense_points motion;           /* of the states that occur in them */
} lag_resolution;

/* equations.c and project_system.c: the state that a status is about. */
typedef struct {
    double t;
    double *y;                         /* n */
} lag_failure;

struct lag_run {
    lag_pool pool;                     /* data that live as long as the run ... */
    lag_pool dynamics_pool;            /* ... and as long as its way of computing a and lambda */
    int kernel;                        /* a lag_kernel */
    lag_settings settings;
    int np;
    double *parameters;                /* breaks.c changes the pieces of functions */
    lag_system system;
    const lag_method *method, *stepped; /* in use; the one that took the last step */
    lag_step step;
    lag_tolerances tolerances;
    lag_stiffness stiffness;
    lag_baumgarte baumgarte;
    lag_projection projection;
    lag_solver solver;
    lag_factors factors;
    lag_dense_matrix dense;
    lag_rows rows;
    lag_watch watch;
    lag_samples samples;
    lag_resolution resolution;
    lag_breaks breaks;
    lag_switching switching;
    lag_derivatives derivatives;
    lag_series series;                 /* data of Taylor's method */
    struct lag_implicit *implicit;     /* data of implicit methods; NULL until they are allowed */
    lag_failure failure;
};

/* Whether each state is projected onto the constraints; or their residuals are damped. */
static inline int lag_projects(const lag_run *run)
{
    return run->settings.formulation == LAG_PROJECTION;
}

static inline int lag_stabilizes(const lag_run *run)
{
    return run->settings.formulation == LAG_BAUMGARTE;
}

#endif
