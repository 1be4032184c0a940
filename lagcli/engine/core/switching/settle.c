#include "switching/settle.h"

#include <math.h>
#include <string.h>

#include "equations.h"
#include "switching/rows.h"

#define NO_SPEED 1e-11      /* of the largest terms of psi so far: zero velocity ... */
#define TWICE 2.0           /* the velocity that a row has as an instant begins without projection, and its rounding */
#define HORIZON 1e-3        /* of the duration of the run: how long an acceleration acts in these terms */
#define ROUNDING_ERROR 4e-15 /* of the terms of accelerations and velocities of rows */
#define FORCE_STEPS 50      /* iterations for forces that depend on multipliers */
#define FORCE_EXACT 1e-13

double lag_no_gap(const lag_run *run, int row)
{
    return run->settings.closed * run->switching.size[row];
}

double lag_no_speed(const lag_switching *sw, int row)
{
    return fmax(NO_SPEED * sw->speed[row], TWICE * sw->stray[row]);
}

lag_problem_arrays lag_arrays_of(lag_switching *sw)
{
    lag_problem_arrays p;
    const int n = sw->rows + sw->nf;
    double *next = sw->contacts;
    int *integers = sw->integers;
    p.matrix = next, next += n * n;
    for (int i = 0; i < 2; ++i) {
        p.slope[i] = next, next += n * n;
        p.limit[i] = next, next += n;
        p.force[i] = next, next += n;
        p.motion[i] = next, next += n;
        p.mode[i] = integers, integers += n;
    }
    p.offset = next, next += n;
    p.rounding = next, next += n;
    p.extra = next;
    p.law = integers, integers += n;
    p.rows = integers;
    return p;
}

void lag_limits_of(lag_run *run, double t, const double *y, const double *a, int n, const lag_problem_arrays *p)
{
    lag_switching *sw = &run->switching;
    const lag_tape *tape = &sw->limits;
    for (int part = 0; part < 2; ++part)
        memset(p->slope[part], 0, (size_t)n * n * sizeof(double));
    if (!sw->nl)
        return;
    memset(sw->multipliers, 0, (size_t)sw->nc * sizeof(double));
    lag_evaluate_forces(run, tape, t, y, a, sw->multipliers);
    for (int i = 0; i < n; ++i)
        for (int part = 0; part < 2; ++part)
            if (sw->limit[p->rows[i]] >= 0)
                p->limit[part][i] = OUT(tape, part * sw->nl + sw->limit[p->rows[i]]);
    for (int i = 0; i < sw->rows; ++i)
        sw->multipliers[sw->constraint[i]] = sw->sign[i];
    lag_evaluate_forces(run, tape, t, y, a, sw->multipliers);
    for (int k = 0; k < sw->pattern_count; ++k)
        for (int i = 0; i < n; ++i)
            for (int j = 0; j < n; ++j)
                if (sw->limit[p->rows[i]] == sw->pattern_limit[k] && p->rows[j] == sw->pattern_row[k])
                    for (int part = 0; part < 2; ++part)
                        p->slope[part][i * n + j] =
                            sw->sign[p->rows[j]]
                            * OUT(tape, 2 * sw->nl + part * sw->pattern_count + k);
}

void lag_matrix_of(lag_run *run, int n, const int *rows, double *matrix)
{
    for (int j = 0; j < n; ++j) {
        const double *u = lag_row_response(run, rows[j]);
        for (int i = 0; i < n; ++i)
            matrix[i * n + j] = lag_along(run, rows[i], u);
    }
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < i; ++j)
            matrix[i * n + j] = matrix[j * n + i] = 0.5 * (matrix[i * n + j] + matrix[j * n + i]);
}

/* Participating rows of an acceleration problem. */
static int list(const lag_switching *sw, const int *state, int *rows, int *law)
{
    int n = 0;
    for (int i = 0; i < sw->rows; ++i) {
        if (!sw->active[i] || (sw->law[i] == LAG_UNILATERAL && state[i] == LAG_APART))
            continue;
        law[n] = sw->law[i];
        if (sw->law[i] == LAG_LIMITED) {
            const int normal = sw->normal[i];
            if (normal >= 0 && (!sw->active[normal]
                                || (sw->law[normal] == LAG_UNILATERAL && state[normal] == LAG_APART)))
                continue;
            const double speed = lag_no_speed(sw, i);
            if (state[i] == LAG_GOES_FORWARD || (state[i] == LAG_AT_REST && sw->psi[i] > speed))
                law[n] = LAG_FORWARD;
            else if (state[i] == LAG_GOES_BACKWARD || (state[i] == LAG_AT_REST && sw->psi[i] < -speed))
                law[n] = LAG_BACKWARD;
        }
        rows[n++] = i;
    }
    return n;
}

/* Raise the scales of psi to what accelerations do: also where velocities are zero but for rounding. */
static void measure_speeds(lag_run *run, const double *a)
{
    lag_switching *sw = &run->switching;
    const int nq = run->system.nq;
    const double time = HORIZON * (run->settings.t_end - run->step.t_start);
    for (int i = 0; i < sw->rows; ++i) {
        double terms = 0.0;
        for (int j = 0; j < nq; ++j)
            terms += fabs(sw->jacobian[i * nq + j] * a[j]);
        if (isfinite(terms))
            sw->speed[i] = fmax(sw->speed[i], time * terms);
    }
}

int lag_settle(lag_run *run, double t, const double *y, const int *state, int *mode, double *force, double *a)
{
    lag_switching *sw = &run->switching;
    const int nq = run->system.nq, size = nq + run->system.nc;
    lag_problem_arrays p = lag_arrays_of(sw);
    double power, *free = p.extra, *present = sw->force + sw->rows;
    if (lag_find_rows(run, t, y) || lag_accelerate_system(run, t, y, 0, &power) || lag_factor(run, t, y))
        return -1;
    --run->step.evaluations;
    memcpy(free, run->solver.a, (size_t)size * sizeof(double));
    const int n = list(sw, state, p.rows, p.law);
    sw->problem = n;
    lag_matrix_of(run, n, p.rows, p.matrix);
    for (int k = 0; k < sw->nf; ++k)
        lag_row_response(run, sw->rows + k);
    lag_limits_of(run, t, y, free, n, &p);
    const lag_contacts problem = {
        .n = n, .matrix = p.matrix, .offset = p.offset, .law = p.law,
        .static_limit = p.limit[0], .static_slope = p.slope[0],
        .kinetic_limit = p.limit[1], .kinetic_slope = p.slope[1], .rounding = p.rounding,
    };
    lag_contact_motion first = {p.force[0], p.motion[0], p.mode[0]};
    lag_contact_motion second = {p.force[1], p.motion[1], p.mode[1]};
    int motions = LAG_ONE_MOTION, guess = 1;
    for (int i = 0; i < n; ++i)
        p.mode[0][i] = p.law[i] == LAG_FORWARD    ? LAG_SLIPS_FORWARD
                       : p.law[i] == LAG_BACKWARD ? LAG_SLIPS_BACKWARD
                       : p.law[i] == LAG_FREE     ? LAG_HOLDS
                                                  : mode[p.rows[i]];
    for (int iteration = 0; iteration < FORCE_STEPS; ++iteration) {
        memcpy(a, free, (size_t)nq * sizeof(double));
        memcpy(run->solver.a, free, (size_t)size * sizeof(double));
        for (int k = 0; k < sw->nf; ++k) {
            const double *u = sw->response + (sw->rows + k) * size;
            for (int i = 0; i < size; ++i)
                run->solver.a[i] += present[k] * u[i];
        }
        for (int i = 0; i < n; ++i) {
            const int row = p.rows[i];
            p.offset[i] = lag_along(run, row, run->solver.a) - sw->gamma[row];
            p.rounding[i] = fabs(sw->gamma[row]);
            for (int j = 0; j < nq; ++j)
                p.rounding[i] += fabs(sw->jacobian[row * nq + j] * run->solver.a[j]);
            p.rounding[i] *= ROUNDING_ERROR;
        }
        int *before = p.rows + n; /* space for the current modes */
        memcpy(before, p.mode[0], (size_t)n * sizeof(int));
        if (n)
            motions = lag_solve_contacts(&problem, guess ? before : NULL, sw->memory, &first, &second);
        if (n && motions != LAG_ONE_MOTION)
            break;
        memset(force, 0, (size_t)sw->rows * sizeof(double));
        for (int j = 0; j < n; ++j) {
            const double *u = sw->response + p.rows[j] * size;
            force[p.rows[j]] = first.force[j];
            for (int i = 0; i < size; ++i)
                run->solver.a[i] += first.force[j] * u[i];
        }
        memcpy(a, run->solver.a, (size_t)nq * sizeof(double));
        if (!sw->nf)
            break;
        double change = 0.0, largest = 0.0;
        lag_gather_multipliers(run, run->solver.a + nq, force, sw->multipliers);
        lag_evaluate_forces(run, &sw->forces, t, y, a, sw->multipliers);
        for (int k = 0; k < sw->nf; ++k) {
            const double now = OUT(&sw->forces, k);
            change = fmax(change, fabs(now - present[k]));
            largest = fmax(largest, fabs(now));
            present[k] = now;
        }
        if (change <= FORCE_EXACT * largest)
            break;
    }
    measure_speeds(run, a);
    for (int i = 0; i < sw->rows; ++i)
        mode[i] = LAG_OPEN;
    for (int i = 0; i < n; ++i)
        mode[p.rows[i]] = first.mode[i];
    return motions;
}

lag_contact_report lag_contacts_of(lag_run *run)
{
    const lag_problem_arrays p = lag_arrays_of(&run->switching);
    return (lag_contact_report){
        .n = run->switching.problem, .row = p.rows, .law = p.law, .matrix = p.matrix, .offset = p.offset,
        .static_limit = p.limit[0], .static_slope = p.slope[0],
        .kinetic_limit = p.limit[1], .kinetic_slope = p.slope[1],
        .force = {p.force[0], p.force[1]}, .motion = {p.motion[0], p.motion[1]},
        .mode = {p.mode[0], p.mode[1]},
    };
}

void lag_share_forces(lag_run *run, double t, const double *y)
{
    lag_switching *sw = &run->switching;
    const int nq = run->system.nq, size = nq + run->system.nc;
    lag_problem_arrays p = lag_arrays_of(sw);
    double *force = p.force[0];
    int n = 0, *mode = p.mode[0];
    for (int i = 0; i < sw->rows; ++i) {
        const int direction = lag_row_slips(sw, i);
        sw->slack[i] = INFINITY;
        sw->tight[i] = 0;
        if (!lag_row_acts(sw, i))
            continue;
        p.rows[n] = i;
        p.law[n] = direction > 0 ? LAG_FORWARD : direction < 0 ? LAG_BACKWARD : sw->law[i];
        mode[n] = sw->mode[i];
        force[n++] = sw->force[i];
    }
    lag_matrix_of(run, n, p.rows, p.matrix);
    lag_limits_of(run, t, y, run->solver.a, n, &p);
    for (int i = 0; i < n; ++i) { /* another distribution of the forces has the same motion */
        p.offset[i] = 0.0;
        for (int j = 0; j < n && mode[i] == LAG_HOLDS; ++j)
            p.offset[i] -= p.matrix[i * n + j] * force[j];
    }
    const lag_contacts problem = {
        .n = n, .matrix = p.matrix, .offset = p.offset, .law = p.law,
        .static_limit = p.limit[0], .static_slope = p.slope[0],
        .kinetic_limit = p.limit[1], .kinetic_slope = p.slope[1],
    };
    if (lag_share_contacts(&problem, mode, sw->memory, force, p.motion[0], p.mode[1]))
        for (int j = 0; j < n; ++j) {
            const int row = p.rows[j];
            const double *u = sw->response + row * size, change = force[j] - sw->force[row];
            for (int i = nq; i < size; ++i)
                run->solver.a[i] += change * u[i];
            sw->force[row] = force[j];
            sw->slack[row] = p.motion[0][j];
            sw->tight[row] = p.mode[1][j];
        }
    lag_gather_multipliers(run, run->solver.multipliers, sw->force, sw->multipliers);
}
