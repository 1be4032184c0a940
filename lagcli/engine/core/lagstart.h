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

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif
