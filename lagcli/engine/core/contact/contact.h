/* Contact problems and impacts at one instant; lagcli/engine/core/contact_problem.py states the problem. */
#ifndef LAGCLI_CONTACT_H
#define LAGCLI_CONTACT_H

#include <stddef.h>

/* Laws of rows, those of ContactLaw. */
enum {
    LAG_UNILATERAL, /* 0 <= x, 0 <= y, x y = 0 */
    LAG_LIMITED,    /* y = 0 and |x| <= static limit, or x = -sign(y) * kinetic limit */
    LAG_FREE,       /* y = 0 */
    LAG_FORWARD,    /* x = -kinetic limit, y is anything: the row slips already, with positive velocity */
    LAG_BACKWARD,   /* x = kinetic limit, y is anything */
};

/* Modes of rows, those of RowMode. Friction whose unilateral rows are all open is open too. */
enum { LAG_OPEN, LAG_HOLDS, LAG_SLIPS_FORWARD, LAG_SLIPS_BACKWARD };

/* What a problem has: no solution, one, or more than one. Solutions are distinguished by y. */
enum { LAG_NO_MOTION, LAG_ONE_MOTION, LAG_TWO_MOTIONS };

/*
 * Find x and y = A x + b that obey the law of each row. limit_k = limit[k] + sum_j slope[k n + j] |x_j|;
 * the limits of rows that are not limited, forward or backward are not read.
 *
 * Where static limits exceed kinetic ones, a row sticks if it can.
 */
typedef struct lag_contacts {
    int n;
    const double *matrix;        /* n * n, row by row; symmetric, positive semidefinite */
    const double *offset;        /* n */
    const int *law;              /* n */
    const double *static_limit;  /* n */
    const double *static_slope;  /* n * n */
    const double *kinetic_limit; /* n */
    const double *kinetic_slope; /* n * n */
    const double *rounding;      /* n, errors that the offset may have; or NULL */
} lag_contacts;

/* Where a solution goes; n entries each. Of redundant contacts the forces are those of least norm,
 * sum x^2, among the ones that obey the laws. */
typedef struct lag_contact_motion {
    double *force;  /* x */
    double *motion; /* y */
    int *mode;
} lag_contact_motion;

/*
 * Solve a problem: return LAG_NO_MOTION, LAG_ONE_MOTION or LAG_TWO_MOTIONS, with one solution in
 * `first` and another in `second` as far as there are.
 *
 * present: n modes to try first, or NULL. memory: lag_contact_memory(n) bytes, aligned for double.
 */
int lag_solve_contacts(
    const lag_contacts *problem, const int *present, void *memory, lag_contact_motion *first,
    lag_contact_motion *second);

/*
 * Share the forces of redundant rows in given modes: of the forces x with the motion of `force`, take those
 * of least norm within the laws of the rows that hold, or of least norm where none are within them.
 *
 * slack: of each row whose law another share could obey by more or by less, the largest s such that some
 * share obeys all these laws by s: |x| <= limit - s, x >= s; infinity of other rows. tight: which of these
 * laws do not let s be larger.
 *
 * The rows of the problem have the modes `mode`; rows that slip have the laws LAG_FORWARD or LAG_BACKWARD.
 * Returns whether the rows are redundant; if not, nothing is changed. memory: lag_contact_memory(n) bytes.
 */
int lag_share_contacts(
    const lag_contacts *problem, const int *mode, void *memory, double *force, double *slack, int *tight);

size_t lag_contact_memory(int n);

/* Phases of an impact. */
enum { LAG_COMPRESSION, LAG_EXPANSION, LAG_NEWTON_PHASE };

/*
 * An impact: velocities before, of the rows that take part: contacts that are closed, also some that open, their
 * friction, and bilateral rows that limit friction. The limit of row k is sum_j friction[k n + j] |impulse_j|.
 */
typedef struct lag_impact {
    int n;
    const double *matrix;      /* n * n */
    const double *before;      /* n, relative velocities */
    const int *law;            /* n: LAG_UNILATERAL, LAG_LIMITED or LAG_FREE */
    const double *restitution; /* n, read of unilateral rows */
    const double *friction;    /* n * n, read of limited rows */
    const double *rounding;    /* n, errors that `before` may have; or NULL */
    /* What is called after each phase, in order; or NULL. It has `count` rows, `row` of the impact's (NULL: all). force:
     * its impulses, in an expansion beyond those that compression returns. */
    void (*phase)(void *context, int part, int count, const int *row, const int *mode, const double *force);
    void *context;
} lag_impact;

/* What an impact does; n entries each. The losses, -impulse (before + after) / 2, or the sum of these
 * over the steps of a sequence, add up to the energy lost. */
typedef struct lag_impact_result {
    double *impulse;
    double *after;
    double *loss;
} lag_impact_result;

/*
 * Poisson's law: compression 0 <= y, x, x y = 0, then expansion with 0 <= y, x - e x_C, y (x - e x_C) = 0.
 * Newton's law: 0 <= y + e y_before instead of 0 <= y, of contacts that do not open. Sequential: Poisson's law of one
 * unilateral row after the other, always the one with the largest y^2 / A of those that approach; of equal ones the
 * first; after 200 of these for each contact, all that are left happen at once. Coulomb's friction in all phases.
 *
 * Returns what lag_solve_contacts does; of two motions the result is the first that was found.
 * memory: lag_impact_memory(n) bytes, aligned for double.
 */
int lag_solve_impact(const lag_impact *impact, int law, void *memory, lag_impact_result *result);

size_t lag_impact_memory(int n);

#endif
