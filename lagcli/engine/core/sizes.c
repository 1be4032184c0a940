#include "sizes.h"

#include <fenv.h>
#include <math.h>
#include <string.h>

#include "derivatives/changes.h"
#include "methods/control.h"
#include "motion.h"
#include "switching/kinks.h"

/* The kinetic energy of velocities v, or of what they may be h later, with M at the dynamics tape's state. */
static double kinetic_energy(const lag_run *run, const double *v, double h)
{
    const lag_system *s = &run->system;
    const lag_tape *e = lag_equations_tape(s);
    const double *a = run->tolerances.acceleration_terms, *b = run->tolerances.future_acceleration;
    double sum = 0.0;
    for (int m = 0; m < s->nm / s->blocks; ++m) { /* of the motion */
        const int i = s->mass_row[m], j = s->mass_column[m];
        sum += OUT(e, m) * (v[i] + copysign(h * (a[i] + b[i]), v[i]))
               * (v[j] + copysign(h * (a[j] + b[j]), v[j]));
    }
    return 0.5 * fabs(sum);
}

void lag_sizes_energy(lag_run *run, const double *y)
{
    const int nq = run->system.nq;
    if (run->tolerances.given[2 * nq] == 0.0)
        run->tolerances.size[2 * nq] = fmax(run->tolerances.size[2 * nq], kinetic_energy(run, y + nq, 0.0));
}

/* The sums of the magnitudes of f_i and, with accelerations a, of M_ij a_j: the largest of each kind of coordinates over
 * its largest M_ii, to `terms`. Without a: of f_i alone. */
static const double *terms_of(lag_run *run, double t, const double *y, const double *a)
{
    const lag_system *s = &run->system;
    double *terms = run->tolerances.terms, *inertia = terms + run->tolerances.kinds;
    double *forces = inertia + run->tolerances.kinds;
    lag_evaluate(&s->dynamics, s, t, y, LAG_ALL);
    const lag_tape *d = lag_equations_tape(s);
    for (int i = 0; i < s->nq; ++i)
        forces[i] = fabs(OUT(d, lag_first_forcing(s) + i));
    for (int m = 0; a && m < s->nm / s->blocks; ++m) /* of the motion; f of the derivatives is not there */
        forces[s->mass_row[m]] += fabs(OUT(d, m) * a[s->mass_column[m]]);
    memset(terms, 0, 2 * (size_t)run->tolerances.kinds * sizeof(double));
    for (int i = 0; i < s->nq; ++i) {
        const int kind = run->tolerances.kind[i];
        terms[kind] = fmax(terms[kind], forces[i]);
        if (s->mass_diagonal[i] >= 0)
            inertia[kind] = fmax(inertia[kind], OUT(d, s->mass_diagonal[i]));
    }
    for (int kind = 0; kind < run->tolerances.kinds; ++kind) {
        const double size = inertia[kind] > 0.0 ? terms[kind] / inertia[kind] : 0.0;
        terms[kind] = isfinite(size) ? size : 0.0;
    }
    return terms;
}

/* The same of f_i for coordinate i; and of the forces of rows, which pass rounding errors on: those of B_k a are those of
 * the a_i that row k changes. A_i, if that is larger: it has what rows have passed on, and is not passed on again. An
 * acceleration `a` that is all rounding shows how many there are. */
static const double *balanced_terms(lag_run *run, double t, const double *y, const double *a)
{
    const lag_switching *sw = &run->switching;
    const int nq = run->system.nq;
    const double *of_kind = terms_of(run, t, y, NULL);
    double *terms = run->tolerances.terms + 2 * run->tolerances.kinds;
    for (int i = 0; i < nq; ++i)
        terms[i] = of_kind[run->tolerances.kind[i]];
    for (int k = 0; k < sw->rows; ++k) {
        if (sw->mode[k] != LAG_HOLDS)
            continue;
        const double *row = sw->jacobian + k * nq, *response = sw->response + k * (nq + run->system.nc);
        double sum = 0.0, own = 0.0;
        for (int i = 0; i < nq; ++i) {
            sum += fabs(row[i]) * terms[i];
            own += row[i] * response[i];
        }
        const double force = own > 0.0 ? fmax(fabs(sw->force[k]), sum / own) : 0.0;
        for (int i = 0; i < nq; ++i)
            terms[i] = fmax(terms[i], fabs(response[i]) * force);
    }
    for (int i = 0; i < nq; ++i) {
        terms[i] = fmax(terms[i], run->tolerances.acceleration_terms[i]);
        if (fabs(a[i]) < VANISHED * terms[i])
            terms[i] = fmax(terms[i], fabs(a[i]) / DBL_EPSILON);
    }
    return terms;
}

/* Raise R_i to what the accelerations of coordinates at rest will be; or A_i, where forces will be in balance. */
static void look_ahead(lag_run *run)
{
    const int nq = run->system.nq;
    const double *y = run->step.y, *a = run->step.f + nq;
    double *f = run->step.f_new, *balanced = run->step.trial, length = run->settings.t_end - run->step.t;
    int at_rest = 0;
    for (int i = 0; i < nq; ++i)
        at_rest |= y[nq + i] == 0.0 && a[i] == 0.0;
    if (!at_rest)
        return;
    memset(balanced, 0, (size_t)nq * sizeof(double));
    for (int k = 0; k < LOOKS; ++k) {
        const double t = run->step.t + (k + 0.5) / LOOKS * length;
        lag_preview_branches(run, t, y);
        if (lag_derivative(run, t, y, f))
            continue;
        const double *terms = balanced_terms(run, t, y, f + nq);
        for (int i = 0; i < nq; ++i) {
            if (y[nq + i] != 0.0 || a[i] != 0.0)
                continue;
            const double later = fabs(f[nq + i]);
            double *size = later < HIDDEN * terms[i] ? balanced : run->tolerances.future_acceleration;
            size[i] = fmax(size[i], later < HIDDEN * terms[i] ? terms[i] : later);
        }
    }
    lag_end_preview(run);
    for (int i = 0; i < nq; ++i)
        if (run->tolerances.acceleration_terms[i] < HIDDEN * balanced[i])
            run->tolerances.acceleration_terms[i] = balanced[i];
}

/* Raise A_i where forces that balance, as those of rows that hold, have grown so much that their rounding errors come
 * near the tolerances. */
static void count_growth(lag_run *run)
{
    const int nq = run->system.nq;
    const double h = SUMMING * run->step.h, *terms = balanced_terms(run, run->step.t, run->step.y, run->step.f + nq);
    for (int i = 0; i < nq / run->system.blocks; ++i) {
        const double size = FOLLOWING * run->settings.rtol * run->tolerances.size[nq + i];
        double *a = run->tolerances.acceleration_terms + i;
        if (GROWN * h * terms[i] > size + h * *a)
            *a = terms[i];
    }
}

/* Raise the sizes of accelerations of each kind, A, that do not show the forces, which balance: to the
 * largest sum of the magnitudes of f_i and M_ij a_j over the largest M_ii. Returns whether some are far larger than that:
 * the equations amplify rounding errors, as next to a singular configuration. */
static int count_forces(lag_run *run, double *largest)
{
    const double *terms = terms_of(run, run->step.t, run->step.y, run->step.f + run->system.nq);
    int amplified = 0;
    for (int kind = 0; kind < run->tolerances.kinds; ++kind) {
        amplified |= terms[kind] > 0.0 && largest[kind] > AMPLIFIED * terms[kind];
        if (largest[kind] < HIDDEN * terms[kind])
            largest[kind] = terms[kind];
    }
    return amplified;
}

/* Find A again after 1, 2, 4, 8, ... steps while rounding errors are amplified. */
static void find_again(lag_run *run, int amplified)
{
    lag_tolerances *tolerances = &run->tolerances;
    if (!tolerances->again)
        tolerances->since = run->step.steps;
    const int64_t passed = run->step.steps - tolerances->since;
    tolerances->again = amplified ? run->step.steps + (passed ? passed : 1) : 0;
}

/* y' with rounding errors of one side: all operations are rounded down, or up. Where a machine has no rounding modes,
 * as WebAssembly, each number of the state is instead the next one below, or above. */
static int derivative_by_side(lag_run *run, int side, double *f)
{
    run->system.dynamics.registers[0] = NAN; /* its current values are rounded differently */
#if defined(FE_DOWNWARD) && defined(FE_UPWARD) && !defined(LAGCLI_NO_ROUNDING_MODES)
    const int nearest = fegetround();
    fesetround(side ? FE_UPWARD : FE_DOWNWARD);
    const int undefined = lag_derivative(run, run->step.t, run->step.y, f);
    fesetround(nearest);
    return undefined;
#else
    double *y = run->step.y_new;
    memcpy(y, run->step.y, (size_t)lag_size(&run->system) * sizeof(double));
    for (int i = 0; i < 2 * run->system.nq; ++i)
        y[i] = nextafter(y[i], (side != i % 2) ? INFINITY : -INFINITY);
    return lag_derivative(run, run->step.t, y, f);
#endif
}

/* Find P: the forces of coordinates without inertia do as much work as is missing where one of their velocities is a
 * part of it larger. */
static void count_power(lag_run *run, double *f)
{
    const lag_system *s = &run->system;
    const double part = 0x1p-20;
    double power = 0.0, *y = run->step.y_new;
    for (int i = 0; i < s->nq / s->blocks; ++i) {
        if (s->mass_diagonal[i] >= 0 || run->step.y[s->nq + i] == 0.0)
            continue;
        memcpy(y, run->step.y, (size_t)lag_size(s) * sizeof(double));
        y[s->nq + i] *= 1.0 + part;
        if (!lag_derivative(run, run->step.t, y, f))
            power += fabs(f[2 * s->nq] - run->step.f[2 * s->nq]) / part;
    }
    run->tolerances.acceleration_terms[s->nq] = power;
}

void lag_sizes_start(lag_run *run)
{
    const int nq = run->system.nq;
    double *rates[] = {run->step.trial, run->step.f_new};
    int undefined = 0;
    for (int side = 0; side < 2; ++side) {
        undefined |= derivative_by_side(run, side, rates[side]);
    }
    for (int i = 0; i < nq; ++i) {
        const double noise = undefined ? 0.0 : fabs(rates[1][nq + i] - rates[0][nq + i]);
        const double a = fmax(fabs(run->step.f[nq + i]), noise / DBL_EPSILON);
        run->tolerances.acceleration_terms[i] = fmax(run->tolerances.acceleration_terms[i], a);
    }
    count_power(run, rates[0]);
    run->system.dynamics.registers[0] = NAN;
    memset(run->tolerances.largest, 0, (size_t)run->tolerances.kinds * sizeof(double));
    for (int i = 0; i < nq; ++i) {
        double *largest = run->tolerances.largest + run->tolerances.kind[i];
        *largest = fmax(*largest, run->tolerances.acceleration_terms[i]);
    }
    find_again(run, count_forces(run, run->tolerances.largest));
    for (int i = 0; i < nq; ++i)
        run->tolerances.acceleration_terms[i] = run->tolerances.largest[run->tolerances.kind[i]];
    look_ahead(run);
    /* derivatives are those by theta over its scale, in the units of the motion: what cancels in them is as large */
    for (int i = 0, motion = nq / run->system.blocks; i < nq; ++i) {
        double *a = run->tolerances.acceleration_terms;
        a[i] = fmax(a[i], a[i % motion]);
    }
}

int lag_sizes_again(lag_run *run)
{
    memset(run->tolerances.acceleration_terms, 0, (size_t)(run->system.nq + 1) * sizeof(double));
    if (lag_derivative(run, run->step.t, run->step.y, run->step.f))
        return LAG_UNDEFINED;
    lag_sizes_start(run);
    lag_evaluate(&run->system.dynamics, &run->system, run->step.t, run->step.y, LAG_ALL);
    run->tolerances.size[2 * run->system.nq] = kinetic_energy(run, run->step.y + run->system.nq, run->step.h);
    lag_sizes_update(run);
    return LAG_RUNNING;
}

/* Raise the sizes of changes in y, and set the absolute tolerances of a step's. */
static void sizes_of_changes(lag_run *run)
{
    const lag_derivatives *w = &run->derivatives;
    lag_tolerances *tolerances = &run->tolerances;
    const int nq = run->system.nq, first = 2 * nq + 1;
    const double h = SUMMING * run->step.h;
    for (int k = 0; k < w->n; ++k)
        for (int part = 0; part < 2; ++part) {
            double *size = tolerances->size + first + (2 * k + part) * nq;
            double *atol = tolerances->atol + first + (2 * k + part) * nq, largest = 0.0;
            double *rounding = tolerances->rounding + first + (2 * k + part) * nq;
            const double *change = run->step.y + first + (2 * k + part) * nq;
            for (int i = 0; i < nq; ++i) {
                size[i] = fmax(size[i], fabs(change[i]));
                largest = fmax(largest, size[i]);
            }
            for (int i = 0; i < nq; ++i) {
                const double noise = h * tolerances->acceleration_terms[i] * (part ? 1.0 : run->step.h);
                rounding[i] = ROUNDING * largest + noise + NO_SIZE;
                atol[i] = OF_DERIVATIVES * run->settings.rtol * size[i] + ROUNDING * largest + noise + NO_SIZE;
            }
        }
}

/* Raise a size to a value. (fmax is a call.) */
static inline void raise_to(double *size, double value)
{
    if (value > *size)
        *size = value;
}

void lag_sizes_update(lag_run *run)
{
    const int nq = run->system.nq, motion = nq / run->system.blocks;
    const double h = SUMMING * run->step.h, length = TIMING * (run->settings.t_end - run->step.t_start);
    double *size = run->tolerances.size, *largest = run->tolerances.largest;
    memset(largest, 0, 2 * (size_t)run->tolerances.kinds * sizeof(double));
    if (run->switching.acting)
        count_growth(run);
    for (int part = 0; part < 2; ++part)
        for (int i = 0; i < nq; ++i) {
            const int m = part * nq + i;
            raise_to(size + m, fabs(run->step.y[m]));
            raise_to(largest + part * run->tolerances.kinds + run->tolerances.kind[i], size[m]);
        }
    for (int part = 0; part < 2; ++part)
        for (int i = 0; i < nq; ++i) {
            const int m = part * nq + i;
            const double noise = (h * run->tolerances.acceleration_terms[i] + length * run->tolerances.future_acceleration[i])
                                 * (part ? 1.0 : run->step.h);
            const double all = largest[part * run->tolerances.kinds + run->tolerances.kind[i]];
            run->tolerances.rounding[m] = run->tolerances.given[m] > 0.0 ? 0.0 : ROUNDING * all + noise + NO_SIZE;
            run->tolerances.atol[m] = run->tolerances.given[m] > 0.0
                               ? run->tolerances.given[m]
                               : (i < motion ? FOLLOWING : OF_DERIVATIVES) * run->settings.rtol * size[m]
                                         + ROUNDING * all + noise + NO_SIZE;
        }
    raise_to(size + 2 * nq, fabs(run->step.y[2 * nq]));
    const double energy = fmax(size[2 * nq], run->step.h * run->tolerances.acceleration_terms[nq]);
    run->tolerances.atol[2 * nq] = run->tolerances.given[2 * nq] > 0.0 ? run->tolerances.given[2 * nq]
                                                 : FOLLOWING * run->settings.rtol * energy + NO_SIZE;
    if (run->derivatives.n)
        sizes_of_changes(run);
}

void lag_first_step(lag_run *run, double order)
{
    const int nq = run->system.nq, n = 2 * nq;
    const double *y = run->step.y, *f = run->step.f;
    double *change = run->step.stages;
    lag_first_step_rule rule = {
        .nq = nq, .stride = 1, .kinds = run->tolerances.kinds, .kind = run->tolerances.kind, .y = y, .f = f,
        .acceleration_terms = run->tolerances.acceleration_terms,
        .future_acceleration = run->tolerances.future_acceleration, .largest = run->tolerances.largest,
        .weight = run->step.trial,
        .length = run->settings.t_end - run->step.t, .h_max = run->step.h_max,
    };
    lag_sizes_update(run);
    const double h = lag_trial_step(&rule);
    for (int i = 0; i < lag_size(&run->system); ++i)
        run->step.y_new[i] = y[i] + h * f[i];
    if (lag_derivative(run, run->step.t + h, run->step.y_new, change)) {
        run->step.h = h;
    } else {
        for (int i = 0; i < n; ++i)
            change[i] -= f[i];
        run->step.h = lag_chosen_step(&rule, change, h, run->settings.rtol, order);
    }
    /* M at the initial state, where velocities may be zero: use those after the step */
    lag_evaluate(&run->system.dynamics, &run->system, run->step.t, y, LAG_ALL);
    run->tolerances.size[n] = fmax(run->tolerances.size[n], kinetic_energy(run, y + nq, run->step.h));
    lag_sizes_update(run);
}

int lag_sizes_follow(lag_run *run)
{
    const int64_t again = run->tolerances.again;
    return again && run->step.steps >= again ? lag_sizes_again(run) : LAG_RUNNING;
}
