/*
 * Absolute tolerances that follow the size of each entry of the state.
 *
 * Step control holds the error of entry i to rtol |y_i| + atol_i. Where no absolute tolerance is
 * given, it is
 *
 *     atol_i = FOLLOWING rtol S_i + rounding,
 *
 * S_i the largest |y_i| so far. Of the work W it is the largest kinetic energy, and of systems that have coordinates
 * without inertia at least h P, where P is the sum of the magnitudes of their forces times velocities at the start.
 * Rounding is what
 * double precision leaves uncertain, below which step control would chase noise. It follows from the entry itself, never
 * from others of its unit, beside which its motion may be tiny:
 *
 *   - ROUNDING times S_i;
 *   - SUMMING times h A_i for a velocity, and h^2 A_i for its coordinate. h is the step, A_i the size of
 *     what the acceleration is made of at the start, parts of which may cancel (a body in equilibrium):
 *     what it changes by between rounding up and rounding down, over the rounding unit. Where the acceleration is zero
 *     and, at the start, all rounding too (a coordinate that a constraint holds), it is the sum of the magnitudes of
 *     forces over the inertia. It is raised to that of later
 *     times where a coordinate at rest stays so, as a body that friction holds under a load that grows, and
 *     during the run where forces that rows hold have grown beyond it. Next to a singular configuration it is much
 *     larger, and is found again as the run goes on;
 *   - TIMING times T R_i for a velocity, and h T R_i for its coordinate. T is the length of the run,
 *     R_i, of a coordinate at rest without acceleration, the largest acceleration at times to come: a
 *     load that is applied later, at a time that is known to a rounding;
 *   - EMERGED times the velocity at which the coordinate would have the largest kinetic energy so far, where it starts at
 *     rest without acceleration: what others pass on to it, as along a chain, begins with a high power of the time, of
 *     which no step has a small relative error.
 *
 * During the run, an error that is larger than the tolerance, or does not fall with the order, may be one of rounding: of
 * forces that balance by symmetry, say. Then the rounding errors of y' at the step's end are found, and the tolerances of
 * this step are raised by what they change in it: lag_excuse_rounding.
 *
 * Rounding is kept apart, for methods whose estimate has another tolerance. Every term changes with the units as y_i
 * does. See docs/decisions/2026-11-tolerances.md.
 */
#ifndef LAGCLI_SIZES_H
#define LAGCLI_SIZES_H

#include <float.h>

#include "run.h"

#define FOLLOWING 0.1
#define OF_DERIVATIVES 100.0 /* the same for derivatives of the motion, which then seldom limit the steps */
#define ROUNDING (100.0 * DBL_EPSILON)
#define SUMMING (100.0 * DBL_EPSILON)
#define TIMING (10.0 * DBL_EPSILON)
#define HIDDEN 1e-8         /* of the forces' size: a smaller A is a rounding error */
#define VANISHED 1e-12      /* of the forces' size: an acceleration below it is all rounding */
#define GROWN 0.1           /* of the forces' size: a smaller A, without a velocity, is too small for rows that hold */
#define AMPLIFIED 1e3       /* of the forces' size: a larger A is that of rounding errors which the equations amplify */
#define EMERGED 1e-18       /* of the velocity of the same kinetic energy: what a coordinate at rest reaches anyway */
#define NO_SIZE 1e-100      /* tolerance of an entry without any size so far */
#define SAMPLED 100.0       /* times a sample of rounding errors: more than they are */
#define CREDIBLE 1e-7       /* of the velocity of the largest kinetic energy: what rounding errors change in a step at most;
                             * beside a pole, where more is lost, the motion ends. A coordinate that leaves rest, whose first
                             * velocities are smaller than any rounding error, has those that there are at rest, too */
#define NOTICED 0.1         /* of a tolerance: less does not matter to it */
#define KNOWN 16            /* number of steps in which rounding errors are those found before ... */
#define LASTING 0.5         /* ... and the part of them that counts beside those found then */
#define ATTEMPTS 2
#define IGNORED 1e6         /* times what they are: rounding errors that are not seen at all */
#define MOST_REGISTERS 100000 /* of a tape that is enclosed */
#define LOOKS 64            /* number of later times at which accelerations are evaluated */

/* Compute A and R for the initial state (t, y, f). */
void lag_sizes_start(lag_run *run);

/* Compute the changes of the state in a step from those of y', n each. */
typedef void lag_propagation(lag_run *run, const double *rates, double *change);

/* After a step of size h to y_new whose error is too large: raise its tolerances where rounding errors of y' may account
 * for the error; at the first attempt (0) by those found in an earlier step, at the second by those at y_new.
 * `propagate` is that of the method; NULL: h times the rates. Returns whether any is raised: then the error is to be judged
 * again, and lag_be_strict is to be called if it is too large after ATTEMPTS. */
int lag_excuse_rounding(lag_run *run, double h, int attempt, lag_propagation *propagate);

/* Multiply what tolerances were raised by: with IGNORED, rounding errors, which no smaller step makes smaller, do not
 * choose the next step. Returns whether any were raised. */
int lag_scale_rounding(lag_run *run, double factor);

/* Reject a step: take back that its tolerances were raised, and keep which entry of its errors, 2 nq of any one
 * factor, is the largest beside its tolerance. */
void lag_reject_step(lag_run *run, const double *errors);

/* Take back that the tolerances of a step were raised, and forget rounding errors found in it: its end may be far from
 * where a shorter one goes, beyond a kink, say. */
void lag_be_strict(lag_run *run);

/* Find A again where the linear system is solved in another way from here on. Returns LAG_RUNNING, or
 * LAG_UNDEFINED. */
int lag_sizes_again(lag_run *run);

/* Find A again if it was found next to a singular configuration, where it is large, and it is time to. Called before a
 * step; the same results. */
int lag_sizes_follow(lag_run *run);

/* Before the step from (t, y, f) of size h: sizes, and the absolute tolerances of the step. */
void lag_sizes_update(lag_run *run);

/* Update the kinetic energy, from the velocities in y and M of the dynamics tape. */
void lag_sizes_energy(lag_run *run, const double *y);

/* Choose the size of a first step from (t, y, f); see lag_sizes_start. */
void lag_first_step(lag_run *run, double order);

#endif
