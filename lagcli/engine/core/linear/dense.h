/* Dense linear algebra of one state. Matrices are row by row. */
#ifndef LAGCLI_LINEAR_H
#define LAGCLI_LINEAR_H

/* LU with partial pivoting, in place; pivots has n entries. Returns 0, or 1 if singular. */
int lag_lu(double *matrix, int *pivots, int n);

/* Solve with the factors; x holds the right side and becomes the solution. */
void lag_lu_solve(const double *lu, const int *pivots, int n, double *x);

/*
 * Gram-Schmidt with pivoting on `count` vectors of `size` entries each, vector by vector, in place,
 * for `rank` steps; returns the length of what was left of the last pivot.
 *
 * order: the vectors' numbers in the order of the pivots. r: count * count, row k the components
 * along pivot k.
 */
double lag_pivot(double *vectors, int size, int count, int rank, int *order, double *r);

/*
 * The length that lag_pivot returns, from the products of the vectors with each other: a symmetric matrix, which
 * changes. By Cholesky's decomposition, in a fraction of the time, but lengths below about 1e-7 of the largest are lost
 * in rounding. order: the vectors' numbers, those of the pivots first.
 */
double lag_pivot_of_products(double *products, int count, int rank, int *order);

/* Solve for the pivots' entries of x with the products that lag_pivot_of_products has left. work: rank. Returns 0, or 1
 * where the solution is not finite. */
int lag_solve_products(const double *products, int count, int rank, const int *order, double *x, double *work);

/*
 * From lag_pivot's order and r, the combinations of the vectors that vanish: count - rank rows of
 * `count` coefficients, each of length one.
 */
void lag_dependencies(int count, int rank, const int *order, const double *r, double *out);

#endif
