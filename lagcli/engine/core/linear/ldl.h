/* Sparse L D L' of a symmetric matrix with a static order; engine/linear/elimination.py finds the order. */
#ifndef LAGCLI_LDL_H
#define LAGCLI_LDL_H

#include "lagcore.h"
#include "memory.h"
#include "tape/vectors.h"

/*
 * Consecutive columns of L that have, below the last of them, the same rows: they are updated together, and
 * each later column by all of them at once.
 */
typedef struct {
    int count;
    const int32_t *first;   /* count + 1: their first columns */
    const int32_t *target;  /* for each row below, in order: where the factors' entries in its column are, from that of
                             * the row itself on */
    const double **source;  /* scratch: the longest supernode */
    double *weight;
    double *column;         /* scratch: the longest column */
} lag_supernodes;

/* Find them in an order of elimination. 0, or 1 without memory. */
int lag_supernodes_of(lag_pool *pool, const lag_elimination *plan, lag_supernodes *found);

/* Whether the columns are those of an elimination: ascending, and with the fill of those before. */
int lag_ldl_closed(const lag_elimination *plan);

/*
 * Factor. On entry, factors hold the matrix: its diagonal (n), the entry of each pair (n), and what
 * stands in L's places. On return, the first two hold the inverse of D, and then follows L.
 * product (as long as L) becomes L D. An entry is the same to the last bit whatever the supernodes are.
 */
void lag_ldl_factor(const lag_elimination *plan, const lag_supernodes *nodes, const lag_vector_kernel *vectors,
                    double *factors, double *product);

/* Solve with the factors; x holds the right side and becomes the solution. work has n entries. */
void lag_ldl_solve(const lag_elimination *plan, const double *factors, double *work, double *x);

#endif
