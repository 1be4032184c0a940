/* The search for consistent initial states, for callers. */
#ifndef LAGSTART_H
#define LAGSTART_H

#include "lagcore.h"
#include "tables.h"

#if defined(__GNUC__)
#pragma GCC visibility push(default)
#endif

typedef struct lag_start_search lag_start_search;

/* Make a search with constraints, and the dynamics, whose first outputs are the entries of M, of the same parameters. `spins`
 * are the quaternions whose angular velocities are given, seven numbers each: the places of the components among the
 * coordinates, and whether each component of the angular velocity is fixed. NULL where there is no memory. */
lag_start_search *lag_make_start_search(const lag_equations *equations, const lag_program *dynamics, const int32_t *spins,
                                        int spin_count);
void lag_destroy_start_search(lag_start_search *search);

/*
 * For each of `count` rows: change the coordinates of y = (q, v) that are not `fixed` (nq) until phi = 0, each Newton step by the
 * change d that is the least by d'M d; or, where these move a light part far, by the coordinates' sizes. `holds` (nc) says which
 * constraints hold; NULL: all. p are the rows of parameters. A lag_start_status of each row goes to `found`; y is changed in any
 * case: where the constraints contradict each other, to where the steps from the guess end, and where they are undefined, to a
 * state at which they are.
 */
void lag_find_positions(lag_start_search *search, double t, int64_t count, const double *p, const int *holds, const int *fixed,
                        double *y, int *found);

/* The same for velocities, until psi = 0; those of the quaternions are changed by their angular velocities. */
void lag_find_velocities(lag_start_search *search, double t, int64_t count, const double *p, const int *holds, const int *fixed,
                         double *y, int *found);

/* The scales of the constraints' terms at the guess of the last search, nc, in the part of it that a scale is at least. */
const double *lag_least_scales(const lag_start_search *search);

typedef struct lag_adjustment lag_adjustment;

/* Make an adjustment of states, with constraints and the dynamics as for a search. Without `memory` it uses malloc and free. NULL
 * where there is no memory. */
lag_adjustment *lag_make_adjustment(const lag_memory *memory, const lag_equations *equations, const lag_program *dynamics);
void lag_destroy_adjustment(lag_adjustment *adjustment);

/* What holds while values are set. */
typedef struct {
    const int *positions, *velocities; /* nc: whether each constraint holds, contacts apart, for positions and for velocities */
    const int *sign;                   /* nc: 1 of closed contacts that satisfy phi >= 0, -1 of those with phi <= 0, else 0 */
    const double *no_gap;              /* nc: their gaps that count as none */
    const double *accuracy;            /* nq: errors that velocities may have */
} lag_held_rows;

/*
 * Move the values of y = (q, v) that are not `fixed` (2 nq) to the nearest state on the constraints: the positions as
 * lag_find_positions, then the velocities, which change by the impulse (nc) of the constraints alone. A closed contact opens where
 * that needs less change, and where it would pull; one that cannot be satisfied remains violated. p are parameters. Returns a
 * lag_start_status.
 */
int lag_adjust(lag_adjustment *adjustment, double t, const double *p, const lag_held_rows *held, const int *fixed, double *y,
               double *impulse);

/* The energy that moving constraints supply by an impulse (nc) after which the state is y. */
double lag_supplied(lag_adjustment *adjustment, double t, const double *p, const double *y, const double *impulse);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif
