/*
 * Derivatives of a motion that switches with respect to n parameters or initial values.
 *
 * The changes (delta q, delta v) of each direction follow W in the state y, so that steps, dense output and error
 * control apply to them as to the motion. Between instants
 *
 *     M delta a - B' delta lambda = delta (f - M a + B' lambda),  B delta a = delta (gamma - B a),
 *
 * with the laws of rows that slip; the right sides are derivatives at fixed a and lambda along (q, v, p). The factors
 * of M and B are those of the motion. At an instant the changes jump: jumps.c.
 *
 * The tapes are derivatives of those of the motion along a direction: of (t, q, v, delta t, delta q, delta v,
 * delta p, p), or of (t, q, v, a, lambda, delta t, ..., delta lambda, delta p, p).
 */
#ifndef LAGCLI_DERIVATIVES_H
#define LAGCLI_DERIVATIVES_H

#include "tape/tape.h"

#define MOST_CULPRITS 8

/* Why a direction has no derivative from an instant on; engine/sensitivity/switched_run.py has the sentences. */
enum lag_reason {
    LAG_NO_REASON,
    LAG_GRAZES,             /* a function only touches zero */
    LAG_SHARES,             /* a mode ends by a force that is not unique */
    LAG_COINCIDE,           /* functions vanish simultaneously, and their order matters */
    LAG_CLOSE_TOGETHER,     /* contacts close simultaneously, and their order matters */
    LAG_RESTS,              /* infinitely many impacts end */
    LAG_ONLY_HERE,          /* a row holds at the start for one value only */
    LAG_WITHIN_TOLERANCE,   /* a row holds within a tolerance, and not exactly */
};

/* What a reason is about: watched functions, by their kind (enum lag_watched) and number. */
typedef struct {
    int reason, count;
    int what[MOST_CULPRITS], which[MOST_CULPRITS];
} lag_cause;

/* A direction: changes of t, q, v and of the parameters. */
typedef struct lag_direction {
    double t;
    const double *q, *v, *p;
} lag_direction;

typedef struct {
    int n, np;                         /* directions; parameters that may change, the first ones of a run's */
    int live;                          /* the number of directions that have derivatives */
    double *p;                         /* n * np */
    lag_tape dynamics;                 /* entries of M, f, entries of B, gamma */
    lag_tape constraint;               /* phi, entries of B, b_0 */
    lag_tape functions;                /* of the rows: phi, entries of B, b_0, gamma */
    lag_tape limits, impact, forces, signs, conditions, force_conditions;
    lag_tape kinks, kink_rates;        /* kink_rates: of (t, q, v, p, their rates, the changes of both), p last */
    const int32_t *decides;            /* conditions: whether an event with actions depends on it */
    int *lost;                         /* n */
    double *lost_at;                   /* n: when ... */
    lag_cause *why;                    /* n: ... and why */

    /* at the last evaluated state */
    double *a, *multipliers, *z;       /* nq + nc of the system; all constraints; rows + forces: of the motion */
    double *lu;                        /* the factors of the laws' matrix */
    double *square;                    /* the matrix itself, and scratch, where its rows depend on each other */
    int *pivots, *acts, acting;        /* rows + forces: those that act, and their number */
    int redundant;                     /* whether rows that hold depend on each other */
    double *of_a, *of_z;               /* n + 1 each: changes of a and lambda of the system, of z */
    double *of_weight;                 /* n + 1: of the upper side, while the motion slides on a surface */
    double *side;                      /* scratch of sliding */

    /* at an instant */
    double *time;                      /* n: change of its time */
    double *of_condition;              /* conditions * n: the same of the conditions that happen */
    double *left;                      /* n * 2 nq: the changes before it */
    int jumped;                        /* whether the state has jumped */
    int rested;                        /* a row that has come to rest; -1 */
    lag_cause cause;                   /* why the time has no derivative */
    double *now;                       /* nq: the velocities in an impact */
    double *compression, *of_compression; /* rows; n * rows: impulses of the compression */
    double *of_impact;                 /* changes of the coefficients: n * outputs of the impact tape */
    int impact_count;
    const int *taking;                 /* the rows that take part in the impact ... */
    int inelastic;                     /* ... and whether it has no restitution */
    double *struck, struck_at;         /* the state, and the time */
    double *after;                     /* nq: velocities after a phase */
    double *slopes;                    /* watched functions * (n + 1) */
    struct lag_direction *directions;  /* n + 1: scratch */
    int *which;                        /* n: scratch */
    const double *none;                /* np: zeros */
    double *right, *x, *row;           /* scratch: of the system; nq + nc; rows */
} lag_derivatives;

#endif
