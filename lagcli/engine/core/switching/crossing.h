/* Location of the first point at which a function becomes negative, by a polynomial through values at nodes. */
#ifndef LAGCLI_CROSSING_H
#define LAGCLI_CROSSING_H

#include "switching/switching.h"

/* Node k of an interval from 0 to 1. */
double lag_node(int k);

/* The matrix that converts values at nodes to Bernstein coefficients. */
void lag_bernstein_matrix(double *matrix);

/* Whether values at the nodes determine the function: the last Chebyshev coefficients are small. */
int lag_resolved(const double *values);

/* Look for the first place beyond `from` at which the polynomial goes from + to -: its bracket within
 * 0 to 1 to low and high. Returns whether there is one. The polynomial counts as positive at 0. */
int lag_first_change(const double *bernstein, double from, double *low, double *high);

/* The root in a bracket that lag_first_change has found, as well as the polynomial tells it. */
double lag_estimate_root(const double *bernstein, double low, double high);

#endif
