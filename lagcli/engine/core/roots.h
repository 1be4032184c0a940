/* Roots of functions of one variable inside a bracket: a function that is not negative at `low`, or counts
 * as positive there, and negative at `high`. */
#ifndef LAGCLI_ROOTS_H
#define LAGCLI_ROOTS_H

typedef double (*lag_scalar_function)(void *context, double x);

/* The first place at which the function is found negative, to `exact`: regula falsi with halved ends
 * (Illinois), and a bisection where two steps do not halve the bracket. `a` and `b` are its values at the ends.
 *
 * M. Dowell and P. Jarratt, A modified regula falsi method for computing the root of an equation, BIT 11
 * (1971), doi:10.1007/BF01934364. */
double lag_bracketed_root(lag_scalar_function f, void *context, double low, double high, double a, double b,
                          double exact);

/* The first number at which the function is not positive, by bisection to the last digit. */
double lag_last_digit_root(lag_scalar_function f, void *context, double low, double high);

#endif
