/* The search for a consistent initial state: values that are not fixed change until the constraints hold. */
#ifndef LAGCLI_START_H
#define LAGCLI_START_H

#include "lagstart.h"
#include "memory.h"
#include "tape/tape.h"

/* The largest of n outputs of a tape from `first` on over their scales, those from `scale` on; INFINITY where one is
 * not finite. */
double lag_largest_residual(const lag_tape *tape, int n, int first, int scale);

/* The angular velocity of a quaternion e at the start, in the body's frame, if it is given in place of e'. */
typedef struct {
    int place[4];                      /* of e among the coordinates */
    int fixed[3];                      /* whether its components hold */
    int given;                         /* whether it holds in place of e' */
} lag_spin;

#define LAG_SPIN_NUMBERS 7 /* of a lag_spin as data: the places, and what is fixed */

/* e' of an angular velocity at an orientation; the angular velocity of e and e', which are read at its places. */
void lag_turn_quaternion(const lag_spin *spin, const double *omega, const double *q, double *v);
void lag_angular_velocity(const lag_spin *spin, const double *q, const double *v, double *omega);

/* The search: what it is given, its tapes and its scratch. */
struct lag_start_search {
    lag_equations equations;           /* with the constraints that may hold at the start */
    lag_program dynamics_program;      /* of (t, q, v, p), whose first outputs are the entries of M */
    int np, first_branch;              /* its parameters: those of the constraints, and branches before one of them */
    lag_spin *spins;
    int spin_count;
    lag_pool *pool, of_its_own;        /* where its arrays are; of a search that has one of its own */
    lag_tape constraint;
    int *all, *place;                  /* nc: all hold; the places of the constraints in phi, or -1 */
    const int *holds;                  /* nc: which constraints hold */
    double *rows, *right, *lengths;    /* nc * nq, nc, nc */
    double *sizes, *inertia;           /* nq: comparable changes of the coordinates; 0 without inertia */
    double *x, *guess, *begin, *tried; /* nq: a change of the unknowns, a first guess, where steps begin, a state before one */
    double *nearest;                   /* nq: where the steps from the guess end */
    int *fixed;                        /* nq: which unknowns do not change */
    double *unit;                      /* nq: comparable changes of the unknowns */
    double *own, *least, *scale;       /* nc: see residual_at */
    /* made at the first search: */
    int measures;                      /* whether they are there */
    lag_tape dynamics;
    double *tested;                    /* nc * nq: rows */
    double *mass, *matrix, *solution;  /* nq * nq, (nq + nc)^2, nq + nc */
    int *pivots;                       /* nq + nc */
};

/* Take spins from so many numbers, which are in their ranges. Returns 0, or 1 where there is no memory. */
int lag_start_take_spins(lag_start_search *search, lag_pool *pool, const int32_t *numbers, int count);

/* Prepare it: what it is given must be set. The pool must live as long as it. `rows` are those that lag_start_rank will
 * measure, at most. Returns 0, or 1 where there is no memory. */
int lag_start_bind(lag_pool *pool, lag_start_search *search, int rows);

/* lag_find_positions and lag_find_velocities of all constraints; between them, angular velocities that are given turn with
 * the orientation. `fixed` are 2 nq. Returns a lag_start_status. */
int lag_start_find(lag_start_search *search, double t, const double *p, const int *fixed, double *y);

/* Give the tapes their parameters; all constraints hold. Returns 0, or 1 where there is no memory. */
int lag_start_begin(lag_start_search *search, const double *p);

/* Evaluate the constraints, M and the sizes of the coordinates at a state, after a search. */
void lag_start_evaluate(lag_start_search *search, double t, const double *y);

/* Measure the rows of a Jacobian of nc rows, nb entries in a tape from `first` on, times sizes, and without them, to `lengths`
 * and `plain_lengths` (nc, at most as many as the search has). Returns their rank. */
int lag_start_rank(lag_start_search *search, const lag_equations *equations, const lag_tape *tape, const double *sizes,
                     double *lengths, double *plain_lengths);

#endif
