/* The consistent initial state of a model as data, for other parameters and initial values than those of the data. */
#ifndef LAGCLI_START_H
#define LAGCLI_START_H

#include "lagmodel.h"
#include "memory.h"
#include "tape/tape.h"

/* Why there is none. */
enum lag_start_status {
    LAG_START_FOUND,
    LAG_START_CONTRADICTED, /* no values of the free entries satisfy the constraints nearby */
    LAG_START_UNDEFINED,    /* the constraints have no finite value */
    LAG_START_SINGULAR,     /* the rank of B is not that of the data */
    LAG_START_UNTURNED,     /* a quaternion whose angular velocity is given is 0: no orientation */
    LAG_START_NO_MEMORY,
};

/* The largest of n outputs of a tape from `first` on over their scales, those from `scale` on; INFINITY where one is
 * not finite. */
double lag_largest_residual(const lag_tape *tape, int n, int first, int scale);

/* The angular velocity of a quaternion e at the start, in the body's frame, if it is given in place of e'. */
typedef struct {
    int place[4];                      /* of e among the coordinates */
    int fixed[3];                      /* whether its components hold */
    int given;                         /* whether it holds in place of e' */
} lag_spin;

/* e' of an angular velocity at an orientation; the angular velocity of e and e', which are read at its places. */
void lag_turn_quaternion(const lag_spin *spin, const double *omega, const double *q, double *v);
void lag_angular_velocity(const lag_spin *spin, const double *q, const double *v, double *omega);

/* The search: its tapes and its scratch. */
typedef struct {
    const lag_model *model;
    lag_equations equations;           /* the model's, with the constraints that hold at the start: also of what switches */
    lag_pool *pool;
    lag_spin *spins;
    int spin_count;
    const double *p;                   /* the parameters */
    lag_tape constraint, lasting;      /* the constraints that hold at the start, and those of the model */
    double *rows, *right, *lengths;    /* nc * nq, nc, nc */
    double *sizes;                     /* nq: comparable changes of the coordinates */
    double *x, *guess, *begin, *tried; /* nq: a change of the unknowns, a first guess, where steps begin, a state before one */
    int *held;                         /* nq: which unknowns do not change */
    double *unit;                      /* nq: comparable changes of the unknowns */
    double *own, *least, *scale;       /* nc: see residual_at */
    /* made at the first change: */
    int measures, renewed;             /* whether they are there; whether the tape has the parameters */
    lag_tape dynamics;
    double *tested;                    /* nc * nq: rows */
    double *mass, *matrix, *solution;  /* nq * nq, (nq + nc)^2, nq + nc */
    int *pivots;                       /* nq + nc */
} lag_start_search;

/* Prepare it: set `equations`, which differ from the model's in constraints alone, and `spins` before. The pool must live as
 * long as it. Returns 0, or 1 where there is no memory. */
int lag_start_bind(lag_pool *pool, lag_start_search *search, const lag_model *model);

/*
 * Change the entries of y = (q, v, W) that are not `fixed` (2 nq) until phi = 0 and psi = 0, each Newton step by the
 * change d that is the least by d'M d, as lagcli does; where spins are given, their components in place of e'. And measure
 * the rows of B there, to `lengths` and `plain_lengths` (nc). `p` are the parameters, np of them. Returns a lag_start_status.
 */
int lag_start_find(lag_start_search *search, double t, const double *p, const int *fixed, double *y,
                   double *lengths, double *plain_lengths);

#endif
