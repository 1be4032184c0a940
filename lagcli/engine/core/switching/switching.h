/*
 * What of a run switches: rows of constraints that do not always hold, forces that depend on multipliers,
 * and conditions of events.
 *
 * The run's own system has the constraints that always hold, and no more. The rows are a layer above
 * it: in its elimination they do not occur. Each row that acts is a force along its row of B, whose
 * effect U_k on a and lambda is one more solution with the factors at hand. With the free motion a_0, the
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
#include "tape/tape.h"

#define NODES 9             /* of an interval, at which watched functions are evaluated */

/* What is watched of a row, or a condition. */
enum lag_watched {
    LAG_WATCH_GAP,          /* phi of an open contact */
    LAG_WATCH_FORCE,        /* z of a closed one */
    LAG_WATCH_STICK,        /* static limit less |z| of a limited row that holds */
    LAG_WATCH_SLIP,         /* psi in the direction in which a row slips */
    LAG_WATCH_SIGN,         /* |z| of a bilateral row that limits friction: there the force has a kink */
    LAG_WATCH_MARGIN,       /* how unique the forces are while something slips: Painleve */
    LAG_WATCH_KINK,         /* the function of a branch, from the bound of that */
    LAG_WATCH_SURFACE,      /* the part of a side in the motion that slides on a surface */
    LAG_WATCH_CONDITION,    /* a function of (t, q, v) */
    LAG_WATCH_TIME,         /* a function of t alone */
    LAG_WATCH_FORCE_CONDITION, /* a function of a and lambda, too */
};

/* What a row has ended at this instant, which does not begin again at it. */
enum lag_ended { NOTHING_ENDED, FORCE_ENDED, STICKING_ENDED_FORWARD, STICKING_ENDED_BACKWARD, SLIPPING_ENDED };

/* A function that is positive as long as the mode lasts. */
typedef struct {
    enum lag_watched what;
    int which;                         /* row or condition */
    double sign;                       /* of a function that may begin either way */
    double shift;                      /* by which it is below zero as the mode begins, by rounding */
    double noise;                      /* what is no crossing soon after that: it grows from zero */
    double value, rate;                /* at the beginning of the step */
    int hit;                           /* whether it may cross zero in the step; whether it does at the instant */
} lag_watched_function;

/* A condition of events. */
typedef struct {
    int holds;
    int either;                        /* whether it happens either way */
    int time;                          /* whether it depends on t alone */
    int happened;                      /* at this instant: 1, and 2 as soon as that is known outside */
    double largest;                    /* value so far */
} lag_condition;

/* Branches of the equations: kinks.h. */
typedef struct {
    int count, first;                  /* how many; where they begin among the parameters */
    const int32_t *whole;              /* count: 0: signs; 1: whole parts, of `floor`; -1: of `ceil` */
    const int32_t *time;               /* count: whether its function depends on t alone */
    lag_tape tape;                     /* of (t, q, v, p): the functions, their sizes */
    double *branch, *bound;            /* count: values; the whole numbers that functions are at */
    double *size, *growth, *rounding;  /* count: largest sizes so far; scratch */
    int *state;                        /* count: what the instant does to it */
    int slides;                        /* the kink on whose surface the motion slides; -1 */
    double weight, rates;              /* the part of the upper side in it; the rate less that below */
    double *both, *y;                  /* scratch; both: upper less lower a, ..., and their combination */
    int undecided;                     /* functions that vanish at the instant */
    long crossed, slid;                /* how often a branch has changed, a motion begun to slide */
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
    lag_tape functions;                /* of (t, q, v, p): phi (nh), B (nb), b_0, gamma, scale of psi (rows),
                                        * scale of phi (nh) */
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
    const int32_t *reported;           /* 5 rows: whether a change of a row is to be reported */
    lag_kinks kinks;
    int used;                          /* whether anything switches or is watched */
    int law_of_impact;
    double closed;                     /* of the size of phi: a gap that counts as none */

    /* modes */
    int *mode, *active;                /* rows */
    int acting;                        /* whether something is not open */
    const struct lag_method *chosen;   /* the method when nothing acts */

    /* at the state evaluated last */
    double *phi, *psi, *drift, *gamma; /* rows */
    double *size, *speed;              /* rows: the largest scales so far of phi, of psi */
    double *jacobian;                  /* rows * nq */
    double *response;                  /* (rows + nf) * (nq + nc of the system) */
    double *force;                     /* rows + nf: z */
    double *matrix;                    /* (rows + nf)^2 */
    double *multipliers;               /* nc */
    int redundant;                     /* whether rows that hold depend on each other */
    double *slack;                     /* rows: of lag_share_contacts; infinity where nothing is redundant */
    int *tight;                        /* rows, likewise */
    double margin;
    double strength;                   /* the largest force of a row so far */
    double *work;                      /* scratch of forces.c */
    double *lu;                        /* (rows + nf)^2 */
    int *pivots, *acts;                /* rows + nf */
    double *saved;                     /* n: scratch of hold.c */
    double *direction;                 /* nq: scratch */

    /* watched functions */
    lag_watched_function *watched;
    int watched_count;
    double *values, *node_values, *times;  /* watched_count; NODES of these; watched_count */
    double *y, *slope;                 /* n: scratch */
    double to_bernstein[NODES * NODES];

    /* the instant */
    int begun, due, located;           /* modes are known; an instant is to be done; samples come first */
    int report;                        /* whether the program that drives the run has something to do */
    int moved;                         /* whether it has changed the state */
    int told;                          /* whether it knows of the instant, and of its end: instant.c */
    int settled;                       /* whether the modes after this instant are found */
    int rounds;
    int found;                         /* of the last contact problem: what lag_solve_contacts returned */
    double instant, last, since;       /* when; the one before; up to where the last step was searched */
    double calm;                       /* the time between instants, the longest one that is not long ago */
    int problem;                       /* rows of the last problem of accelerations */
    double gained;                     /* energy by the last impact ... */
    int rubbed, alike;                 /* ... whether it had friction, contacts of one restitution */
    double *before, *start;            /* n: scratch */
    int *mode_before, *ended, *state, *trial_mode, *takes_part, *rests, *came_to_rest; /* rows */
    int *first_mode;                   /* rows: at the start */
    double *begin;                     /* nq + nc: a and lambda as the instant begins */
    double *trial_force, *acceleration;    /* rows, nq */
    double *impulse;                   /* 2 rows + nc: scratch of impacts */
    double *contacts;                  /* scratch of settle.c */
    int *integers;
    void *memory;
    double *recent;                    /* 3 rows: the last times of impacts */

    /* the log: entries of `width` numbers */
    double *log;
    long log_rows, log_used, log_open;
} lag_switching;

#endif
