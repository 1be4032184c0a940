/* A contact problem in given modes of its rows: linear equations and inequalities. */
#ifndef LAGCLI_CONTACT_MODES_H
#define LAGCLI_CONTACT_MODES_H

#include "contact/contact.h"

/*
 * Rows are scaled by d = 1/sqrt(A_ii): forces x/d and motions d y then have the same unit, the root of
 * that of x y, and one tolerance.
 */
typedef struct lag_contact_work {
    const lag_contacts *problem;
    int n;
    double floor;     /* the largest error that d b may have */
    double *scale;    /* n: d */
    double *force;    /* n: x of the last solved modes */
    double *motion;   /* n: y */
    double *equation; /* n * n: of the modes, scaled */
    double *right;    /* n */
    double *allowed;  /* n: errors that d y may have in the last solved modes */
    double *null;     /* n * n: orthonormal basis of the equations' null space, by rows */
    double *normal;   /* 3 n * n: inequalities normal . x >= bound */
    double *reduced;  /* 3 n * n: the normals along the vectors of `null` */
    double *bound;    /* 3 n */
    double *scratch;     /* scratch of lag_least_distance and Lemke's method */
    int *place;       /* 4 n, likewise */
    int *owner;       /* 3 n: the rows of the inequalities */
    int freedom;      /* dimension of the null space for the last solved modes */
    int *sign;        /* n: of x, as assumed where a limit depends on its absolute value */
    int *turned;      /* n: the sign according to the last solution */
    int *referred;    /* n: whether a limit depends on it */
    int *mode;        /* n: the modes to solve */
    int *next;        /* n: the modes according to the last solution */
    int *order;       /* n: unilateral rows, free rows, others */
} lag_contact_work;

/* Allocate the parts of the memory, and scale. */
void lag_contact_prepare(lag_contact_work *work, const lag_contacts *problem, void *memory);

/* Whether all unilateral rows that give row k its limit are open in these modes. */
int lag_contact_idle(const lag_contact_work *work, const int *mode, int k);

/* Make modes those that the laws have: free rows hold, friction of open contacts is open, rows that slip
 * already slip their way, and friction of contacts that close again holds. */
void lag_contact_rouse(const lag_contact_work *work, int *mode);

/* Sign of x_j in the current modes. */
int lag_contact_sign(const lag_contact_work *work, int j);

/*
 * Reduce work->equation in place by complete pivoting; `right` has `width` columns. The rank is returned.
 * columns: the variables' numbers in the order of the pivots. In the first `rank` rows, the first `rank` of these variables have
 * the unit matrix, the others what they add to these.
 */
int lag_contact_reduce(lag_contact_work *work, double *right, int width, int *columns);

/* List the inequalities of work->mode and work->sign, normal . x >= bound, each in the unit of x/d of its
 * row. Returns how many there are. */
int lag_contact_inequalities(lag_contact_work *work);

/*
 * Solve the equations of work->mode and work->sign into work->force: of redundant forces those of least
 * norm that obey the inequalities, or of least norm where none do. Returns whether they do; `tolerance`
 * is what they were judged with, in the unit of x/d.
 */
int lag_contact_solve(lag_contact_work *work, double *tolerance);

/*
 * Solve the equations of work->mode and work->sign into work->force and work->motion. Returns whether
 * the inequalities of the modes hold; if not, work->next and work->turned are what violated rows ask for.
 */
int lag_contact_try(lag_contact_work *work);

/* After lag_contact_try has found a solution: let open contacts and rows at their limits that do not move hold, too,
 * where they can share the forces. */
void lag_contact_close(lag_contact_work *work);

/*
 * Find the shortest z with normal . z >= bound: Lawson and Hanson's least distance programming by
 * nonnegative least squares. Returns whether there is one.
 *
 * normal: m * n, is overwritten. z: n. scratch: (n + 1) * (n + 4) + 2 m. place: m.
 */
int lag_least_distance(
    int n, int m, double *normal, const double *bound, double *z, double *scratch, int *place);

/* Let Lemke's method choose work->mode and work->sign. Returns whether it ends at a solution; it does
 * not where the force of a limited row limits another. */
int lag_contact_lemke(lag_contact_work *work);

#endif
