/*
 * Parts of the core by themselves, for its tests: the library exports them too, but they are not part of the
 * interface. Each has the arguments of the function that it calls.
 */
#ifndef LAGCLI_PARTS_H
#define LAGCLI_PARTS_H

#include "contact/contact.h"
#include "lagcore.h"
#include "roots.h"

#if defined(__GNUC__)
#pragma GCC visibility push(default)
#endif

/* Run a stream on a register file by a lag_kernel. */
void lag_part_run(int kernel, const int32_t *stream, double *registers);

/* A program whose streams become machine code, for one lane or for eight. With `emit`, after the first call, which is
 * interpreted; else where it is worth it. NULL where there is no memory. */
typedef struct lag_part_code lag_part_code;
lag_part_code *lag_part_code_create(const lag_program *program, int lanes, int emit);
void lag_part_code_destroy(lag_part_code *code);

/* Run routine i on a register file, `times` times. */
void lag_part_code_run(lag_part_code *code, int i, double *registers, int64_t times);

/* The bytes of routine i's machine code; 0: it is interpreted. */
int64_t lag_part_code_size(lag_part_code *code, int i);

int lag_part_enclose(const lag_program *program, const double *inputs, double high, int order, int narrowed,
                     double *out);

/* Factor a sparse symmetric matrix and solve with it: see linear/ldl.h. Returns 0, or 1 for an order that is none. */
int lag_part_ldl(const lag_elimination *plan, int kernel, double *factors, double *product, double *work, double *x);

size_t lag_part_contact_memory(int n);
int lag_part_contacts(const lag_contacts *problem, const int *present, void *memory, lag_contact_motion *first,
                      lag_contact_motion *second);
/* The modes that Lemke's method ends with. Returns 0 where it ends on a ray, 1, or 2 where they are those of a solution. */
int lag_part_lemke(const lag_contacts *problem, void *memory, int *mode);
int lag_part_share(const lag_contacts *problem, const int *mode, void *memory, double *force, double *slack,
                   int *tight);
int lag_part_least_distance(int n, int m, double *normal, const double *bound, double *z, double *scratch, int *place);
size_t lag_part_impact_memory(int n);
int lag_part_impact(const lag_impact *impact, int law, void *memory, lag_impact_result *result);

double lag_part_bracketed_root(lag_scalar_function f, void *context, double low, double high, double a, double b,
                               double exact);
double lag_part_last_digit_root(lag_scalar_function f, void *context, double low, double high);

/* Polynomials through values at nodes: see switching/crossing.h. */
double lag_part_node(int k);
void lag_part_bernstein_matrix(double *matrix);
int lag_part_resolved(const double *values);
int lag_part_first_change(const double *bernstein, double from, double *low, double *high);
double lag_part_estimate_root(const double *bernstein, double low, double high);

/* The last step of a run: its start and its length; the enclosure of watched function k over it, 2 numbers, and that of
 * its jet from a to b within it, 2 (order + 1) numbers. */
void lag_part_enclose_watched(lag_run *run, int k, double a, double b, int order, double *step, double *over, double *out);

/* What the search for events of a run has cost: coefficients of jets, and states at which functions were evaluated. */
void lag_part_search_cost(const lag_run *run, int64_t *coefficients, int64_t *states);

/* The watch of a run, see watch.c: at a state, ln |det| of the factors and the least pivot; whether a step between two
 * states, in which B moves at a speed, passes a small minimum; the same of a step with stages, from the first state to
 * the last, the length and the largest speed of its path, the margin at its end, and whether it approaches one; whether
 * ln |det| at some times of a step from t of size h is smooth; whether a step to a state approaches a singular
 * configuration; what follows from a step to a state: a lag_status, the limit of the next step, and whether it is near. */
int lag_part_watch(lag_run *run, double t, const double *y, double *determinant, double *pivot);
int lag_part_steps_over(lag_run *run, double h, double speed, const double *before, const double *after);
int lag_part_path(lag_run *run, int count, const double *times, const double *states, double *path);
void lag_part_measure(lag_run *run, double t, const double *y);
int lag_part_is_smooth(int count, const double *times, const double *values);
int lag_part_approaches(lag_run *run, double t, const double *y);
int lag_part_follow_approach(lag_run *run, double t, const double *y, double *h_max, int *near);

/* The sizes of what accelerations are made of, nq: A of sizes.h. */
const double *lag_part_acceleration_terms(const lag_run *run);

/* The coefficients of methods/rodas5p_tableau.h and methods/radau5_tableau.h. */
typedef struct {
    double gamma, c[8], d[8], a[8][7], C[8][7], h[3][8];
} lag_rodas5p_coefficients;

typedef struct {
    double c[3], t[3][3], t_inverse[3][3], real, re, im, error[3], defect, zero;
} lag_radau5_coefficients;

void lag_part_coefficients(lag_rodas5p_coefficients *rodas5p, lag_radau5_coefficients *radau5);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif
