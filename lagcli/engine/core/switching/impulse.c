#include "switching/impulse.h"

#include <math.h>
#include <string.h>

#include "derivatives/jumps.h"
#include "left_out.h"
#include "motion.h"
#include "switching/rows.h"
#include "switching/settle.h"

#define GAINED 1e-9         /* of the terms of the energy: gain of an impact due to rounding */
#define LEAST_GAIN 1e-13    /* of the energy of the largest velocities so far: likewise */
#define ROUNDING_ERROR 4e-15 /* of the largest velocity of a row so far */

int lag_is_closed(const lag_run *run, int row)
{
    const lag_switching *sw = &run->switching;
    return sw->active[row] && (sw->phi[row] <= lag_no_gap(run, row) || sw->mode[row] == LAG_HOLDS);
}

int lag_meets(const lag_run *run, int row)
{
    const lag_switching *sw = &run->switching;
    return lag_is_closed(run, row) && sw->psi[row] <= lag_no_speed(sw, row);
}

/* Whether a contact takes part in an impact. By Poisson's law, all that are closed as the instant begins are subject to
 * its first impact, also those that open: they may have to close again. Newton's law gives those that open no velocity
 * without a gain of energy. Later impacts of the instant leave out what the ones before have opened. */
static int takes_part(const lag_run *run, int row, int together)
{
    const lag_switching *sw = &run->switching;
    const int first = !sw->impacts && run->settings.impacts == LAG_POISSON;
    return lag_meets(run, row)
           || (lag_is_closed(run, row) && (together || (first && (!sw->begun || sw->mode[row] == LAG_HOLDS))));
}

int lag_may_act(const lag_run *run, int row, const int *rests)
{
    const lag_switching *sw = &run->switching;
    if (!sw->active[row])
        return 0;
    if (sw->law[row] == LAG_UNILATERAL)
        return rests[row] || lag_meets(run, row);
    return sw->law[row] == LAG_FREE || sw->normal[row] < 0 || lag_may_act(run, sw->normal[row], rests);
}

/* Raise the scales of psi to what impulses of n listed rows do: their sum may be zero but for rounding. */
static void measure_speeds(lag_run *run, int n, const int *rows, const double *impulse)
{
    lag_switching *sw = &run->switching;
    const int nq = run->system.nq, size = nq + run->system.nc;
    for (int i = 0; i < sw->rows; ++i) {
        double terms = 0.0;
        for (int k = 0; k < nq; ++k)
            for (int j = 0; j < n && sw->jacobian[i * nq + k] != 0.0; ++j)
                terms += fabs(sw->jacobian[i * nq + k] * sw->response[rows[j] * size + k] * impulse[j]);
        sw->speed[i] = fmax(sw->speed[i], terms);
    }
}

/* Apply impulses of n listed rows, whose responses are known, to the velocities and the work in y; `added` (nq + nc)
 * are the changes of the velocities and the impulses of the system's constraints. Returns the energy supplied by
 * moving constraints: the power of an impulse is that of the mean velocity. */
static double apply(lag_run *run, double *y, int n, const int *rows, const double *impulse, double *added)
{
    lag_switching *sw = &run->switching;
    const lag_system *s = &run->system;
    const int nq = s->nq, size = nq + s->nc;
    double supplied = 0.0, work = 0.0;
    measure_speeds(run, n, rows, impulse);
    memset(added, 0, (size_t)size * sizeof(double));
    for (int j = 0; j < n; ++j) {
        const double *u = sw->response + rows[j] * size;
        for (int i = 0; i < size; ++i)
            added[i] += u[i] * impulse[j];
    }
    for (int j = 0; j < n; ++j) {
        const int row = rows[j];
        supplied -= impulse[j] * sw->drift[row];
        work += impulse[j] * (lag_along(run, row, y + nq) + 0.5 * lag_along(run, row, added));
    }
    for (int i = 0; i < s->nb; ++i) {
        const int column = s->jacobian_column[i];
        const double part = added[nq + s->jacobian_row[i]] * OUT(&s->dynamics, lag_first_jacobian(s) + i)
                            * (y[nq + column] + 0.5 * added[column]);
        supplied += part;
        work += part;
    }
    for (int i = 0; i < nq; ++i)
        y[nq + i] += added[i];
    y[2 * nq] += work;
    return supplied;
}

/* Evaluate what impulses at (t, y) need. Returns 0, or 1 where something is undefined. */
static int evaluate(lag_run *run, double t, const double *y)
{
    lag_evaluate(&run->system.dynamics, &run->system, t, y, LAG_ALL);
    if (lag_find_rows(run, t, y) || lag_factor(run, t, y))
        return 1;
    lag_evaluate(&run->switching.impact, &run->system, t, y, LAG_ALL);
    return 0;
}

/* The coefficient of restitution of a row, as evaluated last. */
static double restitution_of(const lag_switching *sw, int row)
{
    return sw->restitution[row] < 0 ? 0.0 : OUT(&sw->impact, sw->restitution[row]);
}

/* The coefficient of friction of a row in impacts, as evaluated last. */
static double friction_of(const lag_switching *sw, int row)
{
    return sw->friction[row] < 0 || sw->normal[row] < 0 ? 0.0 : OUT(&sw->impact, sw->friction[row]);
}

int lag_collide(lag_run *run, double t, double *y, lag_impact_report *report)
{
    lag_switching *sw = &run->switching;
    lag_problem_arrays p = lag_arrays_of(sw);
    double *restitution = p.limit[0], *friction = p.slope[0];
    int n = 0;
    if (evaluate(run, t, y)) {
        lag_failed(run, t, y);
        return -1;
    }
    for (int i = 0; i < sw->rows; ++i) /* sequences that lose no energy do not end */
        report->together &= !lag_is_closed(run, i) || restitution_of(sw, i) < 1.0;
    for (int i = 0; i < sw->rows; ++i) {
        report->impulse[i] = report->loss[i] = 0.0;
        if (sw->law[i] == LAG_UNILATERAL)
            report->takes_part[i] = takes_part(run, i, report->together);
        else
            report->takes_part[i] = sw->active[i] && (sw->law[i] == LAG_FREE || !(friction_of(sw, i) <= 0.0));
    }
    for (int i = 0; i < sw->rows; ++i) {
        if (sw->law[i] == LAG_LIMITED && report->takes_part[i])
            report->takes_part[i] = report->takes_part[sw->normal[i]];
        if (report->takes_part[i])
            p.rows[n++] = i;
    }
    lag_matrix_of(run, n, p.rows, p.matrix);
    memset(friction, 0, (size_t)n * n * sizeof(double));
    double least = INFINITY, most = -INFINITY, sum = 0.0;
    for (int i = 0; i < n; ++i) {
        const int row = p.rows[i];
        p.law[i] = sw->law[row];
        p.offset[i] = sw->psi[row];
        p.rounding[i] = ROUNDING_ERROR * sw->speed[row];
        restitution[i] = report->together ? 0.0 : restitution_of(sw, row);
        report->with_friction |= sw->law[row] == LAG_LIMITED;
        if (sw->law[row] == LAG_UNILATERAL) {
            least = fmin(least, restitution[i]);
            most = fmax(most, restitution[i]);
        }
        for (int j = 0; j < n; ++j)
            if (sw->law[row] == LAG_LIMITED && p.rows[j] == sw->normal[row])
                friction[i * n + j] = friction_of(sw, row);
        for (int j = 0; j < n; ++j)
            sum += p.matrix[i * n + j] + friction[i * n + j];
        sum += restitution[i];
    }
    if (!isfinite(sum)) {
        lag_failed(run, t, y);
        return -1;
    }
    report->equal_restitution = !(least < most);
    lag_impact impact = {.n = n, .matrix = p.matrix, .before = p.offset, .law = p.law,
                         .restitution = restitution, .friction = friction, .rounding = p.rounding};
    if (run->derivatives.n) {
        lag_begin_impact(run, t, y, n, p.rows, report->together);
        impact.phase = lag_impact_phase;
        impact.context = run;
    }
    lag_impact_result result = {p.force[0], p.motion[0], p.force[1]};
    const int law = report->together ? LAG_POISSON : run->settings.impacts;
    const int motions = lag_solve_impact(&impact, law, sw->memory, &result);
    if (motions == LAG_NO_MOTION)
        return motions;
    double lost = 0.0, terms = 0.0;
    for (int j = 0; j < n; ++j) {
        const int row = p.rows[j];
        const double speed = sw->speed[row], inertia = p.matrix[j * n + j];
        /* what changes the row's own velocity by no more than what counts as none is due to rounding */
        const int counts = sw->law[row] != LAG_UNILATERAL
                           || result.impulse[j] * inertia > (1.0 + restitution[j]) * lag_no_speed(sw, row);
        report->impulse[row] = counts ? result.impulse[j] : 0.0;
        report->loss[row] = result.loss[j];
        lost += result.loss[j];
        terms += GAINED * fabs(result.impulse[j]) * (fabs(p.offset[j]) + fabs(result.after[j]));
        if (inertia > 0.0)
            terms += LEAST_GAIN * speed * speed / inertia;
    }
    report->gained = lost < -terms ? -lost : 0.0;
    double *added = p.extra;
    report->supplied = apply(run, y, n, p.rows, result.impulse, added);
    if (lag_left_out(run))
        lag_share_multipliers(run, added + run->system.nq);
    lag_gather_multipliers(run, added + run->system.nq, report->impulse, report->all);
    return motions;
}

int lag_bring_to_rest(lag_run *run, double t, double *y, const int *rests, const double *friction, double *lost)
{
    lag_switching *sw = &run->switching;
    lag_problem_arrays p = lag_arrays_of(sw);
    int n = 0;
    if (evaluate(run, t, y))
        return -1;
    for (int i = 0; i < sw->rows; ++i) {
        if (!lag_may_act(run, i, rests))
            continue;
        const int moves = fabs(sw->psi[i]) > lag_no_speed(sw, i);
        p.law[n] = sw->law[i] == LAG_UNILATERAL && !rests[i] ? LAG_UNILATERAL : LAG_FREE;
        p.limit[1][n] = 0.0;
        if (sw->law[i] == LAG_LIMITED && (moves || !(friction_of(sw, i) > 0.0))) {
            p.law[n] = friction[i] < 0.0 ? LAG_FORWARD : LAG_BACKWARD;
            p.limit[1][n] = fabs(friction[i]);
        }
        p.offset[n] = moves ? sw->psi[i] : 0.0; /* redundant rows contradict each other by less; then by as much */
        p.rounding[n] = fmax(ROUNDING_ERROR * sw->speed[i], moves ? 0.0 : fabs(sw->psi[i]));
        p.rows[n++] = i;
    }
    lag_matrix_of(run, n, p.rows, p.matrix);
    memset(p.slope[1], 0, (size_t)n * n * sizeof(double));
    /* nothing has a static limit */
    const lag_contacts problem = {n,          p.matrix,   p.offset,   p.law,     p.limit[0],
                                  p.slope[0], p.limit[1], p.slope[1], p.rounding};
    lag_contact_motion first = {p.force[0], p.motion[0], p.mode[0]};
    lag_contact_motion second = {p.force[1], p.motion[1], p.mode[1]};
    const int motions = lag_solve_contacts(&problem, NULL, sw->memory, &first, &second);
    *lost = 0.0;
    if (motions == LAG_NO_MOTION)
        return motions;
    for (int j = 0; j < n; ++j) /* what does not slide, and has an impulse, is at rest after it */
        if (p.law[j] == LAG_FREE || p.law[j] == LAG_UNILATERAL)
            *lost -= first.force[j] * p.offset[j] / 2.0;
    apply(run, y, n, p.rows, first.force, p.extra);
    return motions;
}
