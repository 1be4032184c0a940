/* Sparse L D L' of a symmetric matrix with a static order; engine/linear/elimination.py finds the order. */
#ifndef LAGCLI_LDL_H
#define LAGCLI_LDL_H

#include "lagcore.h"

/*
 * Factor. On entry, diagonal (n), beside (n) and lower hold the matrix: its diagonal, the entry of
 * each pair, and what stands in L's places. On return, diagonal and beside hold the inverse of D.
 * product (as long as lower) becomes L D; work has 2 n entries.
 */
void lag_ldl_factor(const lag_elimination *plan, double *diagonal, double *beside, double *lower,
                    double *product, double *work);

/* Solve with the factors; x holds the right side and becomes the solution. work has n entries. */
void lag_ldl_solve(const lag_elimination *plan, const double *diagonal, const double *beside,
                   const double *lower, double *work, double *x);

#endif
