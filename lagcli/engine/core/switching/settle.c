#include "switching/settle.h"

#include <math.h>
#include <string.h>

#include "equations.h"
#include "switching/rows.h"

#define NO_SPEED 1e-11      /* of the largest terms of psi so far: zero velocity ... */
#define TWICE 2.0           /* the velocity that a row has as an instant begins without projection, and its rounding */
#define ROUNDING_ERROR 4e-15 /* of the terms of accelerations and velocities of rows */
#define FORCE_STEPS 50      /* iterations for forces that depend on multipliers */
#define FORCE_EXACT 1e-13
#define PLAIN_STEPS 5       /* of these, before Broyden's method */
#define LEAST_PRODUCT 1e-12 /* of a step, in which the forces may change as if they were parallel to it */
#define INERT_ERROR 1e-10   /* of the terms of the acceleration of a row that nothing moves */
#define SECANTS 8           /* steps by secants of curved limits, before those by tangents */
#define LIMIT_EXACT 1e-13   /* of a limit: convergence of those that are curved in multipliers */
#define SMALL 0x1p-100      /* multipliers of which one is far larger than another, in any unit */
#define LARGE 0x1p100
#define LEAST_FORCE 1e-9    /* of the largest force: a smaller one, where slopes are asked for */

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

/* The slopes of the limits of n rows, as evaluated last. */
static void take_slopes(const lag_switching *sw, int n, const lag_problem_arrays *p, int part)
{
    for (int k = 0; k < sw->pattern_count; ++k)
        for (int i = 0; i < n; ++i)
            for (int j = 0; j < n; ++j)
                if (sw->limit[p->rows[i]] == sw->pattern_limit[k] && p->rows[j] == sw->pattern_row[k])
                    p->slope[part][i * n + j] =
                        sw->sign[p->rows[j]] * OUT(&sw->limits, 2 * sw->nl + part * sw->pattern_count + k);
}

/* The force at which slopes are asked for: they have no side at 0, and may be infinite there. */
static double force_about(const double *force, int j, double largest)
{
    return copysign(fmax(fabs(force[j]), LEAST_FORCE * largest), force[j]);
}

/* Limits and slopes about forces that are not all 0, from limits at 0 and slopes: the tangent, or the secant from 0. */
static void limits_about(const lag_switching *sw, int n, const double *force, double largest, int tangent,
                         const lag_problem_arrays *p, int part)
{
    for (int i = 0; i < n; ++i) {
        double *slope = p->slope[part] + i * n, moved = 0.0;
        const int limit = sw->limit[p->rows[i]];
        if (limit < 0)
            continue;
        const double now = OUT(&sw->limits, part * sw->nl + limit);
        for (int j = 0; j < n; ++j)
            moved += slope[j] * fabs(force_about(force, j, largest));
        const double ratio = (now - p->limit[part][i]) / moved;
        if (tangent || !isfinite(ratio)) { /* not finite where the limit is constant there */
            p->limit[part][i] = now - moved;
            continue;
        }
        for (int j = 0; j < n; ++j)
            slope[j] *= ratio;
    }
}

void lag_limits_of(lag_run *run, double t, const double *y, const double *a, int n, const double *force, int tangent,
                   const lag_problem_arrays *p)
{
    lag_switching *sw = &run->switching;
    double largest = 0.0;
    for (int part = 0; part < 2; ++part)
        memset(p->slope[part], 0, (size_t)n * n * sizeof(double));
    if (!sw->nl)
        return;
    for (int j = 0; j < n; ++j)
        largest = fmax(largest, force ? fabs(force[j]) : 0.0);
    memset(sw->multipliers, 0, (size_t)sw->nc * sizeof(double));
    lag_evaluate_laws(run, &sw->limits, t, y, a, sw->multipliers, LAG_OF_FORCES);
    for (int part = 0; part < 2; ++part)
        for (int i = 0; i < n; ++i)
            if (sw->limit[p->rows[i]] >= 0)
                p->limit[part][i] = OUT(&sw->limits, part * sw->nl + sw->limit[p->rows[i]]);
    for (int i = 0; i < sw->rows; ++i)
        sw->multipliers[sw->constraint[i]] = largest > 0.0 ? 0.0 : sw->sign[i];
    for (int j = 0; largest > 0.0 && j < n; ++j)
        sw->multipliers[sw->constraint[p->rows[j]]] = sw->sign[p->rows[j]] * force_about(force, j, largest);
    lag_evaluate_laws(run, &sw->limits, t, y, a, sw->multipliers, LAG_OF_FORCES);
    for (int part = 0; part < 2; ++part) {
        take_slopes(sw, n, p, part);
        for (int i = 0; i < n * n && largest > 0.0; ++i) /* with respect to the magnitude */
            p->slope[part][i] = copysign(1.0, force[i % n]) * p->slope[part][i];
        if (largest > 0.0)
            limits_about(sw, n, force, largest, tangent, p, part);
    }
}

/* The multiplier of a row in a trial of limits, over the row's sign: 1 in the first; then, for each bit of the rows'
 * numbers, two in which it tells rows with far larger ones from those with far smaller ones, and rows with the other
 * sign, where they may have it. So any two rows differ in both orders and in their signs. */
static double multiplier_of_trial(const lag_switching *sw, int row, int trial)
{
    if (!trial)
        return 1.0;
    const int set = (row + 1) >> (trial - 1) / 2 & 1;
    return copysign(set == trial % 2 ? LARGE : SMALL, set && sw->law[row] != LAG_UNILATERAL ? -1.0 : 1.0);
}

/* Whether limits are more than constants and parts that are proportional to the multipliers' magnitudes: their slopes
 * with respect to these differ among the trials. */
static int are_curved(lag_run *run, double t, const double *y, const double *a)
{
    lag_switching *sw = &run->switching;
    const int first = 2 * sw->nl, count = 2 * sw->pattern_count;
    double *slope = sw->work;
    int curved = 0, trials = 1;
    for (int bits = sw->rows; bits; bits >>= 1)
        trials += 2;
    for (int k = 0; k < trials && count && !curved; ++k) {
        memset(sw->multipliers, 0, (size_t)sw->nc * sizeof(double));
        for (int i = 0; i < sw->rows; ++i)
            sw->multipliers[sw->constraint[i]] = sw->sign[i] * multiplier_of_trial(sw, i, k);
        lag_evaluate_laws(run, &sw->limits, t, y, a, sw->multipliers, LAG_OF_FORCES);
        for (int j = 0; j < count; ++j) {
            const int row = sw->pattern_row[j % sw->pattern_count];
            const double now = copysign(1.0, multiplier_of_trial(sw, row, k)) * OUT(&sw->limits, first + j);
            curved |= k && !(now == slope[j]);
            slope[j] = now;
        }
    }
    return curved;
}

void lag_matrix_of(lag_run *run, int n, const int *rows, double *matrix)
{
    for (int j = 0; j < n; ++j) {
        const double *u = lag_row_response(run, rows[j]);
        lag_along_each(run, n, rows, u, matrix + j, n);
    }
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < i; ++j)
            matrix[i * n + j] = matrix[j * n + i] = 0.5 * (matrix[i * n + j] + matrix[j * n + i]);
    for (int i = 0; i < n; ++i)
        for (int j = 0; matrix[i * n + i] <= 0.0 && j < n; ++j)
            matrix[i * n + j] = matrix[j * n + i] = 0.0;
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
    const double time = LAG_HORIZON * (run->settings.t_end - run->step.t_start);
    double *terms = sw->terms;
    memset(terms, 0, (size_t)sw->rows * sizeof *terms);
    for (int i = 0; i < sw->nb; ++i)
        terms[sw->row[i]] += fabs(sw->jacobian[sw->row[i] * nq + sw->column[i]] * a[sw->column[i]]);
    for (int i = 0; i < sw->rows; ++i)
        if (isfinite(terms[i]))
            sw->speed[i] = fmax(sw->speed[i], time * terms[i]);
}

/* The modes to try first. */
static void present_modes(int n, const lag_problem_arrays *p, const int *mode)
{
    for (int i = 0; i < n; ++i)
        p->mode[0][i] = p->law[i] == LAG_FORWARD    ? LAG_SLIPS_FORWARD
                        : p->law[i] == LAG_BACKWARD ? LAG_SLIPS_BACKWARD
                        : p->law[i] == LAG_FREE     ? LAG_HOLDS
                                                    : mode[p->rows[i]];
}

/* The limits of n rows as linearized, at the forces of the first solution: `part` of those. */
static void limits_at(int n, const lag_problem_arrays *p, int part, double *limit)
{
    for (int i = 0; i < n; ++i) {
        limit[i] = p->limit[part][i];
        for (int j = 0; j < n; ++j)
            limit[i] += p->slope[part][i * n + j] * fabs(p->force[0][j]);
    }
}

/* Linearize the limits about the forces of the first solution. Returns whether they were right there. The second
 * solution, of which there is none, has space. */
static int linearize_limits(lag_run *run, double t, const double *y, const double *a, int n, int tangent,
                            const lag_problem_arrays *p)
{
    double *before[2] = {p->force[1], p->motion[1]}, *now = p->offset; /* which is found anew */
    int exact = 1;
    for (int part = 0; part < 2; ++part)
        limits_at(n, p, part, before[part]);
    lag_limits_of(run, t, y, a, n, p->force[0], tangent, p);
    for (int part = 0; part < 2; ++part) {
        limits_at(n, p, part, now);
        for (int i = 0; i < n; ++i)
            exact &= fabs(now[i] - before[part][i]) <= LIMIT_EXACT * fabs(now[i]);
    }
    return exact;
}

/* Go on from forces that depend on multipliers, `present`, to those that follow from them: or, where these do not
 * settle soon, by Broyden's method, as they may grow with each step. Returns whether they were right. */
static int next_forces(lag_switching *sw, int size, int step, double *present)
{
    const int n = sw->nf;
    double *inverse = sw->work, *moved = inverse + n * n, *left = moved + n, *now = left + n, *along = now + n;
    double change = 0.0, largest = 0.0, whole = 0.0, product = 0.0;
    for (int k = 0; k < n; ++k) {
        now[k] = OUT(&sw->forces, k) - present[k];
        change = fmax(change, fabs(now[k]));
        largest = fmax(largest, fabs(OUT(&sw->forces, k)));
    }
    if (step == PLAIN_STEPS) /* minus the identity */
        for (int i = 0; i < n * n; ++i)
            inverse[i] = i % (n + 1) ? 0.0 : -1.0;
    if (step > PLAIN_STEPS) {
        for (int j = 0; j < n; ++j)
            along[j] = 0.0;
        for (int k = 0; k < n; ++k) { /* products by inverse inertias have one unit */
            const double weight = sw->response[(sw->rows + k) * size + sw->force_coordinate[k]] * moved[k];
            whole += weight * moved[k];
            for (int j = 0; j < n; ++j) {
                along[j] += weight * inverse[k * n + j];
                product += weight * inverse[k * n + j] * (now[j] - left[j]);
            }
        }
        for (int k = 0; k < n && fabs(product) > LEAST_PRODUCT * whole; ++k) {
            double off = moved[k];
            for (int j = 0; j < n; ++j)
                off -= inverse[k * n + j] * (now[j] - left[j]);
            for (int j = 0; j < n; ++j)
                inverse[k * n + j] += off * along[j] / product;
        }
    }
    for (int k = 0; k < n; ++k) {
        moved[k] = step < PLAIN_STEPS ? now[k] : 0.0;
        for (int j = 0; j < n && step >= PLAIN_STEPS; ++j)
            moved[k] -= inverse[k * n + j] * now[j];
        left[k] = now[k];
    }
    for (int k = 0; k < n; ++k)
        present[k] = step < PLAIN_STEPS ? OUT(&sw->forces, k) : present[k] + moved[k];
    return change <= FORCE_EXACT * largest;
}

/* The size of the accelerations of a row that the constraint forces cause, and may take away: their errors remain. */
static double terms_by_constraints(const lag_run *run, int row)
{
    const lag_system *s = &run->system;
    const double *along = run->switching.jacobian + row * s->nq;
    double sum = 0.0;
    for (int i = 0; i < s->nb; ++i) {
        const int k = s->jacobian_column[i];
        const double force = OUT(&s->dynamics, lag_first_jacobian(s) + i) * run->solver.a[s->nq + s->jacobian_row[i]];
        sum += fabs(along[k] * run->rows.sizes[k] * run->rows.sizes[k] * force);
    }
    return sum;
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
    const int curved = sw->nl && are_curved(run, t, y, free);
    lag_limits_of(run, t, y, free, n, NULL, 0, &p);
    for (int part = 0; part < 2 && curved; ++part) { /* forces about which limits are linearized are those without */
        memset(p.limit[part], 0, (size_t)n * sizeof(double));
        memset(p.slope[part], 0, (size_t)n * n * sizeof(double));
    }
    const lag_contacts problem = {
        .n = n, .matrix = p.matrix, .offset = p.offset, .law = p.law,
        .static_limit = p.limit[0], .static_slope = p.slope[0],
        .kinetic_limit = p.limit[1], .kinetic_slope = p.slope[1], .rounding = p.rounding,
    };
    lag_contact_motion first = {p.force[0], p.motion[0], p.mode[0]};
    lag_contact_motion second = {p.force[1], p.motion[1], p.mode[1]};
    int motions = LAG_ONE_MOTION, guess = 1, settled = 0;
    present_modes(n, &p, mode);
    for (int iteration = 0; iteration < FORCE_STEPS && !settled; ++iteration) {
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
            if (!(p.matrix[i * n + i] > 0.0))
                p.rounding[i] += INERT_ERROR * terms_by_constraints(run, row);
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
        const int exact = !curved || linearize_limits(run, t, y, free, n, iteration >= SECANTS, &p);
        if (!exact && iteration == 0)
            present_modes(n, &p, mode);
        settled = !sw->nf && exact;
        if (settled)
            break;
        lag_gather_multipliers(run, run->solver.a + nq, force, sw->multipliers);
        lag_evaluate_laws(run, &sw->forces, t, y, a, sw->multipliers, LAG_OF_FORCES);
        settled = next_forces(sw, size, iteration, present) && exact;
    }
    if (n && !settled && motions == LAG_ONE_MOTION)
        motions = LAG_NO_MOTION; /* the forces of the rows do not follow from themselves; without rows a step says so */
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
    lag_limits_of(run, t, y, run->solver.a, n, are_curved(run, t, y, run->solver.a) ? force : NULL, 1, &p);
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
