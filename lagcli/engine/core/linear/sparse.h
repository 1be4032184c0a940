/*
 * Sparse LU with a pivot order and a pattern that are known in advance (engine/linear/sparse.py).
 *
 * The matrix has its entries row by row; the factors have theirs row by row in the order of the
 * pivots, columns too, with the fill. Complex numbers are two arrays: real and imaginary parts.
 */
#ifndef LAGCLI_SPARSE_H
#define LAGCLI_SPARSE_H

#include "lagcore.h"

/* Factor a matrix of `count` entries; work has n entries. Returns 0, or 1 at a zero or undefined
 * pivot. */
int lag_sparse_factor(const lag_pivots *order, int count, const double *matrix,
                      double *factors, double *work);

/* Solve with the factors; x holds the right side and becomes the solution. */
void lag_sparse_solve(const lag_pivots *order, const double *factors, double *x,
                      double *work);

/* The same in complex numbers; work has 2 n entries. */
int lag_sparse_factor_complex(const lag_pivots *order, int count, const double *re,
                              const double *im, double *factors_re, double *factors_im,
                              double *work);
void lag_sparse_solve_complex(const lag_pivots *order, const double *factors_re,
                              const double *factors_im, double *x_re, double *x_im, double *work);

#endif
