/* Rows that may depend on each other, row by row: m rows of n entries. */
#ifndef LAGCLI_DEPENDENT_ROWS_H
#define LAGCLI_DEPENDENT_ROWS_H

/* In four sums, whose additions do not wait for each other. */
double lag_product(int n, const double *x, const double *y);

/*
 * Gram and Schmidt's orthogonalization, the one whose independent part is largest next, and those left out whose independent
 * part is less than `least` of their `length`. The rows and the lengths are destroyed. Returns the rank.
 */
int lag_orthogonalize(double least, int m, int n, double *a, double *length);

/*
 * Combine rows, and the k numbers that each has in `with`, by rotations (Jacobi) until they are orthogonal: their lengths are
 * then the singular values. Those that are larger than `least` precede the others. `square`: scratch, m. Returns the rank.
 */
int lag_combine(double least, int m, int n, double *a, int k, double *with, double *square);

#endif
