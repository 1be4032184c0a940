/*
 * What of a run switches: rows of constraints that do not always hold, forces that depend on multipliers,
 * and conditions of events.
 *
 * The run's own system has the constraints that always hold, and no more. The rows are a layer above
 * it: in its elimination they do not occur. Each row that acts is a force along its row of B, whose
 * effect U_k on a and lambda is one more solution with the current factors. With the free motion a_0, the
 * forces z of the rows that hold are such that
 *
 *     A z = gamma - B a_0,   A = B U,
 *
 * and those of rows that slip, and of forces that depend on multipliers, are what their laws say. Rows of
 * unilateral constraints phi <= 0 are turned round, so that all have phi >= 0 and z >= 0.
 *
 * Rows are those of Switching.rows, in their order, then bilateral ones that limit friction.
 */
#ifndef LAGCLI_SWITCHING_H
#define LAGCLI_SWITCHING_H

#include "contact/contact.h"
#include "dense_points.h"
#include "program/slices.h"
#include "tape/interval.h"
#include "tape/tape.h"

#define NODES 9             /* of an interval, at which watched functions are evaluated */

/* Functions that are watched, of a row or a condition. */
enum lag_watched {
    LAG_WATCH_GAP,          /* phi of an open contact */
    LAG_WATCH_FORCE,        /* z of a closed one */
    LAG_WATCH_STICK,        /* static limit less z, or plus z, of a limited row that holds */
    LAG_WATCH_SLIP,         /* psi in the direction in which a row slips */
    LAG_WATCH_SIGN,         /* a function of forces whose sign limits and forces depend on */
    LAG_WATCH_MARGIN,       /* uniqueness of the forces while something slips: Painleve */
    LAG_WATCH_KINK,         /* the function of a branch, relative to its bound */
    LAG_WATCH_SURFACE,      /* the weight of a side in the motion that slides on a surface */
    LAG_WATCH_CONDITION,    /* a function of (t, q, v) */
    LAG_WATCH_TIME,         /* a function of t alone */
    LAG_WATCH_FORCE_CONDITION, /* a function of a and lambda, too */
};

/* Modes of a row that have ended at this instant and must not begin again at it. */
enum lag_ended { NOTHING_ENDED, FORCE_ENDED, STICKING_ENDED_FORWARD, STICKING_ENDED_BACKWARD, SLIPPING_ENDED };

/* A function that is positive as long as the mode lasts. */
typedef struct {
    enum lag_watched what;
    int which;                         /* index of the row, kink, sign or condition */
    double sign;                       /* of a function whose initial sign may be either */
    double shift;                      /* value below zero at the beginning of the mode, due to rounding */
    double noise;                      /* the function is negative below this, less; else it may be rounding */
    int clear;                         /* whether it has been positive beyond that in the step */
    double stray;                      /* of a gap that opens: how far the dense output is off it in the first step */
    double value, rate;                /* at the beginning of the step; of functions of a and lambda alone */
    int hit;                           /* whether it may cross zero in the step; whether it does at the instant */
    double resolved;                   /* until then it counts as positive: it has just changed its sign */
    double ended;                      /* when a condition that held ended in this step; infinity if it did not */
} lag_watched_function;

/* Enclosures of watched functions: enclosure.h. */
enum { LAG_ENCLOSED_TAPES = 4 };
typedef struct {
    lag_tape gaps;                     /* of (t, q, v, p): phi */
    lag_jet_tape tapes[LAG_ENCLOSED_TAPES]; /* of gaps, rows, conditions and kinks */
    const lag_slice *of_gaps, *of_rows; /* nh, rows: what each gap needs, and each row's psi; NULL: the whole tapes */
    int watched, looked;               /* bits of tapes: of the functions watched; that hold enclosures over the step */
    int count;                         /* states that occur in them */
    int *state, *place;                /* count: their indices in y; 2 nq: the inverse */
    int *used;                         /* 2 nq: bits of the tapes that read it */
    lag_interval *jets;                /* count jets: on the interval that is looked at */
    double *error;                     /* count: rounding errors of states that rows hold; of conditions and kinks */
    int held;                          /* whether there are any */
    lag_dense_points dense;            /* of the states */
    int64_t work;                      /* coefficients of jets that were evaluated: the cost of the search */
} lag_enclosure;

/* How a condition's function depends on t: not at all, besides the state, or alone. */
enum lag_time_in { LAG_NO_TIME, LAG_TIME_AND_STATE, LAG_TIME_ALONE };

/* A condition that triggers in both directions has no side while it is zero. */
enum lag_at_zero { LAG_OFF_ZERO, LAG_AT_ZERO, LAG_LEAVES_ZERO /* in the last step */ };

/* A condition of events. */
typedef struct {
    int holds;
    int either;                        /* whether it triggers in both directions */
    int time;                          /* how its function depends on t: a lag_time_in */
    int happened;                      /* at this instant: 1, and 2 once it has been reported */
    int rests;                         /* whether it triggers in both directions and has no side: a lag_at_zero */
    double largest;                    /* value so far */
    double value;                      /* at the beginning of the instant ... */
    double off;                        /* ... by how much it is off zero there, as by the projection */
} lag_condition;

/* A clock of events: tick k is at (first + k step) / per. */
typedef struct {
    double first, step, per;
    double number, next;               /* of the next tick: k; its time, or infinity */
    int64_t left;                      /* number of ticks that may follow */
    int begun;
    int ticks;                         /* at this instant: 1, and 2 once it has been reported */
} lag_clock;

/* Branches of the equations: kinks.h. */
typedef struct {
    int count, first;                  /* their number; index of the first among the parameters */
    const int32_t *whole;              /* count: 0: signs; 1: whole parts, of `floor`; -1: of `ceil` */
    const int32_t *time;               /* count: whether its function depends only on t */
    lag_tape tape;                     /* of (t, q, v, p): the functions, their sizes */
    double *branch, *bound;            /* count: values; the whole numbers that functions are at */
    double *size, *growth, *rounding;  /* count: largest sizes so far; scratch */
    double *held, *drift;              /* count: what rows that hold leave of functions and their rates at the instant */
    double *vanished, *recurred;       /* count: when they vanished last; how often in a row soon after */
    int *state;                        /* count: effect of the instant */
    int slides;                        /* the kink on whose surface the motion slides; -1 */
    double weight, rates;              /* weight of the upper side; difference of the rates of the two sides */
    double *both, *y;                  /* scratch; both: upper less lower a, ..., and their combination */
    int undecided;                     /* functions that vanish at the instant */
    int64_t crossed, slid;             /* number of changes of branches, and of starts of sliding */
} lag_kinks;

typedef struct {
    int rows, exported, nc;            /* rows; those of Switching.rows; all constraints */
    const int32_t *constraint, *base;  /* rows, nc of the system: their numbers among all */
    const int32_t *law;                /* rows: LAG_UNILATERAL, LAG_LIMITED or LAG_FREE */
    const int32_t *limit, *normal;     /* rows: the limit, the row that limits; -1 */
    const int32_t *place;              /* rows: which phi; -1 */
    const double *sign;                /* rows */
    int nb, nh;
    const int32_t *row, *column;       /* nb: places of B's entries */
    int *first_entry, *entry;          /* rows + 1, nb: numbers of the entries by row, and where each row's begin */
    lag_tape functions;                /* of (t, q, v, p): phi (nh), B (nb), b_0, gamma, scale of psi (rows),
                                        * scale of phi (nh) */
    int signs;                         /* of functions of forces, inputs of limits and forces */
    lag_tape sign_tape;                /* of (t, q, v, a, lambda, signs, p): the functions, their sizes */
    double *side, *found_side;         /* signs: in steps; of the functions as evaluated last */
    int *turned;                       /* signs: 1 where the function crosses zero at this instant, -1 if not after all */
    double *sign_value, *sign_size;    /* signs: the functions at the last evaluation of all forces; largest sizes */
    double *sign_before;               /* signs: the functions at the beginning of the instant */
    int holds_sides;                   /* from the end of an instant to the next one, in which they are found again */
    lag_tape limits, impact;
    int nl, pattern_count;
    const int32_t *pattern_limit, *pattern_row;    /* row: of the layer */
    const int32_t *friction;           /* rows: which coefficient of the impact tape; -1 */
    const int32_t *restitution;        /* rows: likewise */
    int nf, force_count;               /* forces that depend on lambda */
    const int32_t *force_coordinate, *force_row, *force_constraint;
    lag_tape forces;
    int conditions, force_conditions;
    lag_tape condition_tape, force_condition_tape;
    lag_condition *condition;          /* conditions, then force_conditions */
    int clocks;
    lag_clock *clock;                  /* clocks */
    const int32_t *reported;           /* 5 rows: whether to report a change of a row */
    lag_kinks kinks;
    int used;                          /* whether anything switches or is watched */

    /* modes */
    int *mode, *active;                /* rows */
    int acting;                        /* whether any row is not open */
    const struct lag_method *chosen;   /* the method if no row is active */

    /* at the last evaluated state */
    double *phi, *psi, *drift, *gamma; /* rows */
    double *size, *speed;              /* rows: the largest scales so far of phi, of psi */
    double *tried;                     /* rows: of psi, in the step that is tried */
    double *stray;                     /* rows: |psi| of those that hold as the instant begins, without projection */
    double *jacobian;                  /* rows * nq */
    double *response;                  /* (rows + nf) * (nq + nc of the system) */
    double *force;                     /* rows + nf: z */
    double *matrix;                    /* (rows + nf)^2 */
    double *multipliers;               /* nc */
    int redundant;                     /* whether active rows are linearly dependent */
    double *slack;                     /* rows: of lag_share_contacts; infinity without redundancy */
    int *tight;                        /* rows, likewise */
    int *shares;                       /* rows: whether the log has that the force is not unique */
    double margin;                     /* uniqueness of the forces while something slips: 0 if it jams */
    double strength;                   /* the largest force of a row so far */
    double *work;                      /* scratch of forces.c */
    double *lu;                        /* (rows + nf)^2 */
    int *pivots, *acts;                /* rows + nf */
    double *saved;                     /* n: scratch of hold.c */
    double *direction;                 /* nq: scratch */
    double *terms;                     /* rows: scratch */
    double *kept;                      /* 2 rows + nf: scratch of sample.c */

    /* watched functions */
    lag_watched_function *watched;
    int watched_count;
    int64_t looks;                     /* states at which functions were evaluated: the cost of the search */
    int unresolved;                    /* the function whose sign could not be determined in a step */
    double *values, *node_values, *times;  /* watched_count; NODES of these; watched_count */
    double *y, *slope;                 /* n: scratch */
    double to_bernstein[NODES * NODES];
    lag_enclosure enclosure;

    /* the instant */
    int begun, due, located;           /* initial modes are known; an instant is to be handled; samples are taken
                                          first */
    int waits;                         /* whether lag_advance returns before it handles an instant */
    int report;                        /* whether to return to the caller */
    int moved;                         /* whether the caller has changed the state */
    int stage;                         /* what the caller knows of the instant: instant.c */
    int settled;                       /* whether the modes after this instant are determined */
    int rounds, impacts;               /* at the instant: of choosing modes, of impacts */
    int motions;                       /* result of lag_solve_contacts for the last contact problem */
    double instant, last, since;       /* time of the instant; of the previous one; end of the searched part of the
                                          last step */
    double interval;                   /* the longest recent time between instants */
    int problem;                       /* rows of the last problem of accelerations */
    double gained;                     /* energy gained by the last impact ... */
    int with_friction;                 /* ... whether it had friction */
    int equal_restitution;             /* ... whether all its coefficients of restitution are equal */
    double *before, *start;            /* n: scratch */
    int *mode_before, *ended, *state, *trial_mode, *takes_part; /* rows */
    int *rests, *ends, *member;        /* rows: scratch of collision.c */
    int *came_to_rest;                 /* rows: at this instant ... */
    double *rest_time;                 /* rows: ... and the limit of the impacts' times */
    double *rest_friction;             /* rows: scratch of collision.c */
    double remainder;                  /* energy that impacts after this instant still would lose */
    double *struck;                    /* n: the state after the last impact, before rows come to rest */
    double *accumulation;              /* scratch of accumulation.c */
    int *accumulation_lists;
    int *first_mode;                   /* rows: at the start */
    double *begin;                     /* nq + nc: a and lambda at the beginning of the instant */
    double *trial_force, *acceleration;    /* rows, nq */
    double *impulse;                   /* 2 rows + nc: scratch of impacts */
    double *contacts;                  /* scratch of settle.c */
    int *integers;
    void *memory;

    /* the log: entries of `width` numbers */
    double *log;
    int64_t log_rows, log_used, log_open;
} lag_switching;

#endif
