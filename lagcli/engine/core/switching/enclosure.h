/*
 * Enclosures of watched functions along the last step, by interval evaluation of their tapes.
 *
 * The states are first enclosed over the whole step without its dense output, which costs evaluations: q by the
 * control points of the quintic through q, v and a at both ends, v by those of the quintic's derivative and of the
 * cubic through v and a, widened. Within the step they are the polynomials of the dense output, exactly.
 */
#ifndef LAGCLI_ENCLOSURE_H
#define LAGCLI_ENCLOSURE_H

#include "run.h"

/* Whether a function is enclosed: those of (t, q, v) are, those of a and lambda are not. */
int lag_is_enclosed(enum lag_watched what);

/* Whether a function depends only on t. */
int lag_is_of_time(const lag_switching *sw, const lag_watched_function *w);

/* Bind the tapes of a run's rules; pool->failed says whether there is no memory. */
void lag_enclosure_bind(lag_run *run, const lag_switching_rules *rules);

/* phi of a row at a state. */
double lag_gap_at(lag_run *run, int row, double t, const double *y);

/* Errors of states at an instant: those that rows which hold or touch put somewhere, as impacts do. Returns 0, or 1. */
int lag_enclosure_touch(lag_run *run, double t, const double *y);

/* The error of a condition's value, and of a kink's function, at a state due to these; 0 without. */
double lag_held_error(lag_run *run, int which, double t, const double *y);
double lag_held_error_of_kink(lag_run *run, int kink, double t, const double *y);

/* Begin with the last step: `f` is y' at its end, for methods that know it there. */
void lag_enclosure_begin(lag_run *run, const double *f);

/* Add the errors that the dense output has between the ends of the step, where rows hold. */
void lag_enclosure_stray(lag_run *run);

/* Watched function k on the whole step. */
lag_interval lag_enclose_step(lag_run *run, int k);

/* The jet of watched function k on [a, b] within the step, up to an order, to `out`. */
void lag_enclose(lag_run *run, int k, double a, double b, int order, lag_interval *out);

/* The value and the rate of watched function k at a state, where y' = f, to `out`. */
void lag_enclose_at(lag_run *run, int k, double t, const double *y, const double *f, lag_interval *out);

/* The error of watched function k where states are off by so many tolerances of a step. */
double lag_error_of_states(lag_run *run, int k, double t, const double *y, double tolerances);

/* The rate of a kink's function at a state with accelerations a; not finite where it has no bounds. */
double lag_rate_of_kink(lag_run *run, int kink, double t, const double *y, const double *a);

/* The sign of a kink's function where contacts that touch open; 0 where these do not change it. Their responses are
 * known. */
int lag_side_of_kink(lag_run *run, int kink, double t, const double *y);

/* The error of the rate of a kink's function due to the velocities that such rows hold. */
double lag_held_rate_of_kink(lag_run *run, int kink, double t, const double *y);

/* Whether an operation of its tape was undefined in all of the interval that it was evaluated on last. */
int lag_is_undefined(lag_run *run, int k);

#endif
