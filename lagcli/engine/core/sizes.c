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

/* Raise a size to a value. (fmax is a call.) */
static inline void raise_to(double *size, double value)
{
    if (value > *size)
        *size = value;
}

/* The inertia M_ii where the dynamics tape was evaluated last; 0 if there is none. */
static double inertia_of(const lag_system *s, int i)
{
    const int diagonal = s->mass_diagonal[i];
    return diagonal < 0 ? 0.0 : fmax(OUT(lag_equations_tape(s), diagonal), 0.0);
}

/* The sums of the magnitudes of f_i and, with accelerations a, of M_ij a_j over M_ii, nq, to `terms`; 0 without
 * inertia. */
static double *terms_of(lag_run *run, double t, const double *y, const double *a)
{
    const lag_system *s = &run->system;
    double *terms = run->tolerances.terms;
    lag_evaluate(&s->dynamics, s, t, y, LAG_ALL);
    const lag_tape *d = lag_equations_tape(s);
    for (int i = 0; i < s->nq; ++i)
        terms[i] = fabs(OUT(d, lag_first_forcing(s) + i));
    for (int m = 0; a && m < s->nm / s->blocks; ++m) /* of the motion; f of the derivatives is not there */
        terms[s->mass_row[m]] += fabs(OUT(d, m) * a[s->mass_column[m]]);
    for (int i = 0; i < s->nq; ++i) {
        const double inertia = inertia_of(s, i);
        const double size = inertia > 0.0 ? terms[i] / inertia : 0.0;
        terms[i] = isfinite(size) ? size : 0.0;
    }
    return terms;
}

/* The same of f_i alone; and of the forces of rows, which pass rounding errors on: those of B_k a are those of
 * the a_i that row k changes. A_i, if that is larger: it has what rows have passed on, and is not passed on again. An
 * acceleration `a` that is all rounding shows how many there are. */
static const double *balanced_terms(lag_run *run, double t, const double *y, const double *a)
{
    const lag_switching *sw = &run->switching;
    const int nq = run->system.nq;
    double *terms = terms_of(run, t, y, NULL);
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
 * near the tolerances. That of a coordinate without inertia, which rows alone determine, has no size of its own: next to a
 * singular configuration it would have any. */
static void count_growth(lag_run *run)
{
    const int nq = run->system.nq;
    const double h = SUMMING * run->step.h, *terms = balanced_terms(run, run->step.t, run->step.y, run->step.f + nq);
    for (int i = 0; i < nq / run->system.blocks; ++i) {
        const double size = FOLLOWING * run->settings.rtol * run->tolerances.size[nq + i];
        double *a = run->tolerances.acceleration_terms + i;
        if (inertia_of(&run->system, i) > 0.0 && GROWN * h * terms[i] > size + h * *a)
            *a = terms[i];
    }
}

/* Raise the sizes of accelerations, A, that do not show the forces, which balance: to the sum of their magnitudes over the
 * inertia. Returns whether some are far larger than that: the equations amplify rounding errors, as next to a singular
 * configuration. */
static int count_forces(lag_run *run)
{
    const double *terms = terms_of(run, run->step.t, run->step.y, run->step.f + run->system.nq);
    double *a = run->tolerances.acceleration_terms;
    int amplified = 0;
    for (int i = 0; i < run->system.nq; ++i) {
        amplified |= terms[i] > 0.0 && a[i] > AMPLIFIED * terms[i];
        if (a[i] < HIDDEN * terms[i])
            a[i] = terms[i];
    }
    return amplified;
}

/* Find the coordinates at rest without acceleration, where the dynamics tape was evaluated last. */
static void find_emerging(lag_run *run)
{
    const lag_system *s = &run->system;
    for (int i = 0; i < s->nq; ++i) {
        const double inertia = inertia_of(s, i);
        const int emerges = run->step.y[s->nq + i] == 0.0 && run->step.f[s->nq + i] == 0.0;
        run->tolerances.emerging[i] = emerges && inertia > 0.0 ? 1.0 / sqrt(inertia) : 0.0;
    }
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

/* Let the values that tapes hold be computed again. */
static void forget_values(lag_run *run)
{
    run->system.dynamics.registers[0] = NAN;
    if (run->system.equations.registers)
        run->system.equations.registers[0] = NAN;
}

/* The state with each number replaced by the next one below or above, on the side that the parity of its index's bits
 * gives: neighbours, and those at equal distances, do not all move alike. */
static const double *state_beside(lag_run *run, int side, const double *y)
{
    double *beside = run->tolerances.beside;
    memcpy(beside, y, (size_t)lag_size(&run->system) * sizeof(double));
    for (int i = 0; i < 2 * run->system.nq; ++i) {
        int above = side;
        for (int bits = i; bits; bits &= bits - 1)
            above = !above;
        beside[i] = nextafter(beside[i], above ? INFINITY : -INFINITY);
    }
    return beside;
}

/* y' at (t, y) with rounding errors of one side: all operations are rounded down, or up; `rounded`: the state, too. Where
 * a machine has no rounding modes, as WebAssembly, it always is. */
static int derivative_by_side(lag_run *run, int side, int rounded, double t, const double *y, double *f)
{
    forget_values(run); /* they are rounded differently */
#if defined(FE_DOWNWARD) && defined(FE_UPWARD) && !defined(LAGCLI_NO_ROUNDING_MODES)
    const double *state = rounded ? state_beside(run, side, y) : y;
    const int nearest = fegetround();
    fesetround(side ? FE_UPWARD : FE_DOWNWARD);
    const int undefined = lag_derivative(run, t, state, f);
    fesetround(nearest);
    return undefined;
#else
    (void)rounded;
    return lag_derivative(run, t, state_beside(run, side, y), f);
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

/* The difference between y' at (t, y) rounded up and rounded down, to f; `rounded`: with the state. Returns 0, or 1 where
 * y' is undefined. */
static int difference_of_sides(lag_run *run, int rounded, double t, const double *y, double *f)
{
    const int n = lag_size(&run->system);
    double *down = run->tolerances.down;
    const int undefined = derivative_by_side(run, 0, rounded, t, y, down) | derivative_by_side(run, 1, rounded, t, y, f);
    forget_values(run);
    for (int m = 0; m < n; ++m)
        f[m] = fabs(f[m] - down[m]);
    memset(f, 0, (size_t)run->system.nq * sizeof(double)); /* q' = v is exact */
    return undefined;
}

/* The enclosure of the tape that gives a, or else of that with f and M; NULL if it is too large. */
static lag_jet_tape *enclosed_tape(lag_run *run, int solves)
{
    const lag_system *s = &run->system;
    const lag_tape *tape = solves ? &s->dynamics : lag_equations_tape(s);
    lag_enclosed *e = run->tolerances.enclosed + solves;
    if (tape->register_count > MOST_REGISTERS)
        return NULL;
    if (e->capacity < tape->register_count) { /* at first, or after another order of elimination */
        lag_release(&e->pool);
        e->jets.registers = lag_get(&e->pool, JET * (size_t)tape->register_count, sizeof(lag_interval));
        e->capacity = e->jets.registers ? tape->register_count : 0;
    }
    lag_jets_of_tape(&e->jets, tape);
    return e->capacity ? &e->jets : NULL;
}

/* Bounds of the rounding errors of accelerations at (t, y), whose numbers are rounded, too: those of a_i, or of f_i over
 * M_ii where no tape solves; to `bounds`. Returns 0, or 1 where there are none. */
static int enclose_rounding(lag_run *run, double t, const double *y, double *bounds)
{
    const lag_system *s = &run->system;
    const int nq = s->nq, solves = lag_solving_by(run) == LAG_BY_TAPE && !run->switching.acting;
    lag_jet_tape *jets = s->blocks > 1 ? NULL : enclosed_tape(run, solves);
    if (!jets)
        return 1;
    lag_jets_refresh(jets);
    for (int i = 0; i <= 2 * nq; ++i) {
        const double x = i ? y[i - 1] : t;
        lag_jet_input(jets, i)[0] = i ? (lag_interval){nextafter(x, -INFINITY), nextafter(x, INFINITY)} : (lag_interval){x, x};
    }
    lag_jets_run(jets, 0);
    for (int i = 0; i < nq; ++i) {
        const int diagonal = s->mass_diagonal[i];
        const lag_interval value = *lag_jet_output(jets, (solves ? lag_first_solution(s) : lag_first_forcing(s)) + i);
        const double inertia = solves ? 1.0 : diagonal < 0 ? INFINITY : lag_jet_output(jets, diagonal)->low;
        const double width = (value.high - value.low) / inertia;
        bounds[i] = isfinite(width) ? fabs(width) : 0.0;
    }
    return 0;
}

/*
 * What rounding errors change in y' at (t, y), n, from above, to `noise`.
 *
 * A difference of two evaluations is a sample: it may be zero by chance. An enclosure is none, but it is larger, by a
 * factor that both together show, and which grows with the number of operations.
 */
static int find_noise(lag_run *run, double t, const double *y, double *noise)
{
    const int nq = run->system.nq;
    double *bounds = run->tolerances.beside, sampled = 0.0, enclosed = 0.0;
    if (difference_of_sides(run, 1, t, y, noise))
        return 1;
    const int bounded = !enclose_rounding(run, t, y, bounds);
    for (int i = 0; i < nq && bounded; ++i) {
        const double inertia = inertia_of(&run->system, i);
        sampled += inertia * noise[nq + i] * noise[nq + i];
        enclosed += inertia * bounds[i] * bounds[i];
    }
    for (int m = nq; m < lag_size(&run->system); ++m)
        noise[m] *= SAMPLED;
    const double ratio = fmax(sqrt(enclosed / sampled), SAMPLED);
    for (int i = 0; i < nq && bounded; ++i)
        noise[nq + i] = fmax(noise[nq + i], sampled > 0.0 ? SAMPLED / ratio * bounds[i] : bounds[i]);
    return 0;
}

/* Raise the tolerances of a step where changes of the state, n, explain errors. Returns whether any is raised. */
static int raise_tolerances(lag_run *run, const double *change)
{
    lag_tolerances *tolerances = &run->tolerances;
    const int n = lag_size(&run->system);
    const double rtol = run->settings.rtol, *y = run->step.y, *z = run->step.y_new;
    int raised = 0;
    for (int m = 0; m < n; ++m) {
        const double noise = fabs(change[m]), tolerance = tolerances->atol[m] + rtol * fmax(fabs(y[m]), fabs(z[m]));
        if (!(noise > NOTICED * tolerance) || !isfinite(noise)
            || (m <= 2 * run->system.nq && tolerances->given[m] > 0.0))
            continue;
        if (!tolerances->raised) {
            memcpy(tolerances->strict, tolerances->atol, (size_t)n * sizeof(double));
            memcpy(tolerances->strict + n, tolerances->rounding, (size_t)n * sizeof(double));
            tolerances->raised = 1;
        }
        tolerances->atol[m] = tolerances->strict[m] + noise;
        tolerances->rounding[m] = tolerances->strict[n + m] + noise;
        raised = 1;
    }
    return raised;
}

/* Find the rounding errors that y' of coordinates which leave rest would have there at t; 0 of the others. */
static void find_noise_at_rest(lag_run *run, double t)
{
    lag_tolerances *tolerances = &run->tolerances;
    const int nq = run->system.nq;
    int leaves = 0;
    for (int i = 0; i < nq; ++i)
        leaves |= tolerances->emerging[i] > 0.0;
    const int unknown = !leaves || find_noise(run, t, tolerances->rest, tolerances->noise_at_rest);
    for (int i = 0; i < nq; ++i)
        if (unknown || tolerances->emerging[i] == 0.0)
            tolerances->noise_at_rest[nq + i] = 0.0;
}

/* Find the rounding errors of y' at the end of the attempted step of size h, with the branches there: that of the step may
 * have any values beyond its kink. Those found last count by a part. Returns 0, or 1 where they are not known. */
static int find_noise_of_step(lag_run *run, double h)
{
    lag_tolerances *tolerances = &run->tolerances;
    const int nq = run->system.nq, n = lag_size(&run->system);
    const double t = run->step.t + h;
    lag_preview_branches(run, t, run->step.y_new);
    find_noise_at_rest(run, t);
    const int unknown = find_noise(run, t, run->step.y_new, tolerances->change);
    lag_end_preview(run);
    if (unknown)
        return 1;
    /* a force that sets in does so at a time that is known to a rounding */
    const double length = TIMING * (run->settings.t_end - run->step.t_start);
    for (int m = nq; m < 2 * nq; ++m)
        if (run->step.y[m] == 0.0 && run->step.f[m] == 0.0)
            tolerances->change[m] = fmax(tolerances->change[m], length * fabs(tolerances->down[m]) / h);
    /* a step that is far too long ends anywhere */
    const double speed = CREDIBLE * sqrt(2.0 * tolerances->size[2 * nq]) / h;
    for (int i = 0; i < nq / run->system.blocks; ++i) {
        const double inertia = inertia_of(&run->system, i);
        if (speed > 0.0 && inertia > 0.0)
            tolerances->change[nq + i] = fmin(tolerances->change[nq + i],
                                              fmax(speed / sqrt(inertia), tolerances->noise_at_rest[nq + i]));
    }
    for (int m = 0; m < n; ++m)
        tolerances->noise[m] = fmax(tolerances->change[m], LASTING * tolerances->noise[m]);
    tolerances->noise_until = run->step.steps + KNOWN;
    return 0;
}

/* Forget the rounding errors that were found. */
static void forget_noise(lag_run *run)
{
    run->tolerances.noise_until = 0;
    memset(run->tolerances.noise, 0, (size_t)lag_size(&run->system) * sizeof(double));
}

int lag_excuse_rounding(lag_run *run, double h, int attempt, lag_propagation *propagate)
{
    lag_tolerances *tolerances = &run->tolerances;
    const int nq = run->system.nq, n = lag_size(&run->system);
    const int known = run->step.steps < tolerances->noise_until;
    double *change = tolerances->change;
    if (attempt == 0 ? !known : find_noise_of_step(run, h))
        return 0;
    if (propagate) {
        propagate(run, tolerances->noise, change);
        return raise_tolerances(run, change);
    }
    for (int m = nq; m < n; ++m)
        change[m] = h * tolerances->noise[m];
    for (int i = 0; i < nq; ++i)
        change[i] = h * change[nq + i];
    for (int k = 0; k < run->derivatives.n; ++k) {
        double *of_q = change + 2 * nq + 1 + 2 * k * nq;
        for (int i = 0; i < nq; ++i)
            of_q[i] += h * of_q[nq + i];
    }
    return raise_tolerances(run, change);
}

int lag_scale_rounding(lag_run *run, double factor)
{
    lag_tolerances *tolerances = &run->tolerances;
    const int n = lag_size(&run->system);
    for (int m = 0; m < n && tolerances->raised; ++m) {
        const double *strict = tolerances->strict + m;
        tolerances->atol[m] = strict[0] + factor * (tolerances->atol[m] - strict[0]);
        tolerances->rounding[m] = strict[n] + factor * (tolerances->rounding[m] - strict[n]);
    }
    return tolerances->raised;
}

void lag_be_strict(lag_run *run)
{
    const int n = lag_size(&run->system);
    if (run->tolerances.noise_until == run->step.steps + KNOWN)
        forget_noise(run);
    if (!run->tolerances.raised)
        return;
    run->tolerances.raised = 0;
    memcpy(run->tolerances.atol, run->tolerances.strict, (size_t)n * sizeof(double));
    memcpy(run->tolerances.rounding, run->tolerances.strict + n, (size_t)n * sizeof(double));
}

void lag_reject_step(lag_run *run, const double *errors)
{
    const double rtol = run->settings.rtol, *y = run->step.y, *z = run->step.y_new, *atol = run->tolerances.atol;
    double most = 0.0;
    lag_be_strict(run);
    for (int m = 0; m < 2 * run->system.nq; ++m) {
        const double error = fabs(errors[m]) / (atol[m] + rtol * fmax(fabs(y[m]), fabs(z[m])));
        if (error > most) {
            most = error;
            run->tolerances.limiting = m;
        }
    }
}

void lag_sizes_start(lag_run *run)
{
    const int nq = run->system.nq;
    double *change = run->tolerances.change;
    forget_noise(run);
    const int undefined = difference_of_sides(run, 0, run->step.t, run->step.y, change);
    for (int i = 0; i < nq; ++i) {
        const double noise = undefined ? 0.0 : fabs(change[nq + i]);
        const double a = fmax(fabs(run->step.f[nq + i]), noise / DBL_EPSILON);
        run->tolerances.acceleration_terms[i] = fmax(run->tolerances.acceleration_terms[i], a);
    }
    count_power(run, run->tolerances.down);
    forget_values(run);
    find_again(run, count_forces(run));
    find_emerging(run);
    memcpy(run->tolerances.rest, run->step.y, (size_t)lag_size(&run->system) * sizeof(double));
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

void lag_sizes_update(lag_run *run)
{
    const int nq = run->system.nq, motion = nq / run->system.blocks;
    const double h = SUMMING * run->step.h, length = TIMING * (run->settings.t_end - run->step.t_start);
    double *size = run->tolerances.size, *largest = run->tolerances.largest;
    const double speed = EMERGED * sqrt(2.0 * size[2 * nq]);
    run->tolerances.raised = 0;
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
            const double noise = (h * run->tolerances.acceleration_terms[i] + length * run->tolerances.future_acceleration[i]
                                  + run->tolerances.emerging[i] * speed)
                                 * (part ? 1.0 : run->step.h);
            const double rounding = ROUNDING * size[m] + noise + NO_SIZE;
            run->tolerances.rounding[m] = run->tolerances.given[m] > 0.0 ? 0.0 : rounding;
            run->tolerances.atol[m] = run->tolerances.given[m] > 0.0
                               ? run->tolerances.given[m]
                               : (i < motion ? FOLLOWING : OF_DERIVATIVES) * run->settings.rtol * size[m] + rounding;
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
