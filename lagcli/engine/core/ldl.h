/* Sparse L D L' of a symmetric matrix with a static order; engine/linear/elimination.py finds the order. */
#ifndef LAGCLI_LDL_H
#define LAGCLI_LDL_H

#include <stdint.h>

/* n unknowns; places are numbers in the order of elimination. */
typedef struct {
    int n;
    const int32_t *order;   /* n: the unknown at each place */
    const int32_t *paired;  /* n: whether the place begins a pivot of order two */
    const int32_t *start;   /* n + 1: where each column of L begins */
    const int32_t *row;     /* the places of L's entries, by column, ascending */
    /* what stands to the left of each place in L, by rows */
    const int32_t *left_start; /* n + 1 */
    const int32_t *left_column, *left_entry;
} lag_ldl;

/*
 * Factor. On entry, diagonal (n), beside (n) and lower hold the matrix: its diagonal, the entry of
 * each pair, and what stands in L's places. On return, diagonal and beside hold the inverse of D.
 * product (as long as lower) becomes L D; work has 2 n entries.
 */
void lag_ldl_factor(const lag_ldl *plan, double *diagonal, double *beside, double *lower,
                    double *product, double *work);

/* Solve with the factors; x holds the right side and becomes the solution. work has n entries. */
void lag_ldl_solve(const lag_ldl *plan, const double *diagonal, const double *beside,
                   const double *lower, double *work, double *x);

#endif
