#include "derivatives/jumps.h"

#include <math.h>
#include <string.h>

#include "derivatives/changes.h"
#include "motion.h"
#include "switching/rows.h"

#define GRAZES 1e-6         /* of a function's size over the run: its rate where it only touches zero */
#define SAME_TIME 1e-6      /* relative difference of times that count as equal */
#define NONE 1e-9           /* of the run: changes of time that count as zero */
#define APART 1e-6          /* of its terms: change of a gap in an impact that is rounding error ... */
#define NO_GAP 1e-9         /* ... or of its scale */
#define SMOOTH 1e-8         /* of accelerations: jumps that are rounding errors */
#define LEAVES 1e-6         /* of its terms: changes of a row that are rounding errors */
#define ROUNDING 1e-12      /* of the largest change: rounding error of any other */

static void blame(lag_cause *cause, int reason, int what, int which)
{
    if (cause->reason != LAG_NO_REASON && cause->reason != reason)
        return;
    cause->reason = reason;
    for (int i = 0; i < cause->count; ++i)
        if (cause->what[i] == what && cause->which[i] == which)
            return;
    if (cause->count < MOST_CULPRITS) {
        cause->what[cause->count] = what;
        cause->which[cause->count++] = which;
    }
}

/* End the derivatives in a direction. */
static void lose(lag_run *run, int k, const lag_cause *cause)
{
    lag_derivatives *w = &run->derivatives;
    if (w->lost[k])
        return;
    w->lost[k] = 1;
    --w->live;
    w->lost_at[k] = run->step.t;
    w->why[k] = *cause;
    memset(lag_change(run, run->step.y, k), 0, 2 * (size_t)run->system.nq * sizeof(double));
}

static void lose_for(lag_run *run, int k, int reason, int what, int which)
{
    lag_cause cause = {0};
    blame(&cause, reason, what, which);
    lose(run, k, &cause);
}

/* Whether a mode ends by a force that is not unique. */
static int is_shared(const lag_run *run, const lag_watched_function *f)
{
    return run->derivatives.redundant && (f->what == LAG_WATCH_FORCE || f->what == LAG_WATCH_STICK);
}

/* The largest size of a function over the run. */
static double size_of(const lag_run *run, const lag_watched_function *f)
{
    const lag_switching *sw = &run->switching;
    const double span = run->settings.t_end - run->step.t_start;
    switch (f->what) {
    case LAG_WATCH_GAP:
        return sw->speed[f->which] * span;
    case LAG_WATCH_SLIP:
        return sw->speed[f->which];
    case LAG_WATCH_FORCE:
    case LAG_WATCH_STICK:
        return sw->strength;
    case LAG_WATCH_SIGN:
        return sw->sign_size[f->which];
    case LAG_WATCH_KINK:
        return sw->kinks.size[f->which];
    case LAG_WATCH_SURFACE:
    case LAG_WATCH_MARGIN:
        return 1.0;
    default:
        return sw->condition[f->which].largest;
    }
}

static int decides(const lag_run *run, const lag_watched_function *f)
{
    return f->what < LAG_WATCH_CONDITION || run->derivatives.decides[f->which];
}

/* The changes of the functions that vanish along direction k of `count`, to `slopes`. */
static void find_slopes(lag_run *run, double t, const double *y, int count, const lag_direction *directions)
{
    lag_derivatives *w = &run->derivatives;
    const lag_switching *sw = &run->switching;
    const int nq = run->system.nq, size = nq + run->system.nc, all = sw->rows + sw->nf;
    for (int k = 0; k < count; ++k) {
        const lag_direction d = directions[k];
        const double *of_a = w->of_a + k * size, *of_z = w->of_z + k * all;
        if (sw->rows)
            lag_evaluate_along(run, &w->functions, t, y, d);
        if (sw->kinks.count)
            lag_evaluate_along(run, &w->kinks, t, y, d);
        if (sw->conditions)
            lag_evaluate_along(run, &w->conditions, t, y, d);
        if (sw->nl)
            lag_evaluate_laws_along(run, &w->limits, t, y, d, of_a, of_z);
        if (sw->signs)
            lag_evaluate_laws_along(run, &w->signs, t, y, d, of_a, of_z);
        if (sw->force_conditions)
            lag_evaluate_laws_along(run, &w->force_conditions, t, y, d, of_a, of_z);
        for (int i = 0; i < sw->watched_count; ++i) {
            const lag_watched_function *f = sw->watched + i;
            double *slope = w->slopes + i * (w->n + 1) + k;
            if (!f->hit)
                continue;
            switch (f->what) {
            case LAG_WATCH_GAP:
                *slope = sw->sign[f->which] * OUT(&w->functions, sw->place[f->which]);
                break;
            case LAG_WATCH_SLIP:
                *slope = lag_change_of_speed(run, f->which, y + nq, d.v);
                break;
            case LAG_WATCH_SIGN:
                *slope = OUT(&w->signs, f->which);
                break;
            case LAG_WATCH_FORCE:
                *slope = of_z[f->which];
                break;
            case LAG_WATCH_STICK:
                *slope = OUT(&w->limits, sw->limit[f->which]) - copysign(1.0, w->z[f->which]) * of_z[f->which];
                break;
            case LAG_WATCH_KINK:
                *slope = OUT(&w->kinks, f->which);
                break;
            case LAG_WATCH_SURFACE:
                *slope = w->of_weight[k];
                break;
            case LAG_WATCH_CONDITION:
            case LAG_WATCH_TIME:
                *slope = OUT(&w->conditions, f->which);
                break;
            case LAG_WATCH_FORCE_CONDITION:
                *slope = OUT(&w->force_conditions, f->which - sw->conditions);
                break;
            default:
                *slope = 0.0;
            }
        }
    }
}

/* The change of the time in each live direction, by the slopes; `which` are the directions. */
static void find_times(lag_run *run, int count, const int *which)
{
    lag_derivatives *w = &run->derivatives;
    const lag_switching *sw = &run->switching;
    const double span = run->settings.t_end - run->step.t_start;
    int first = -1, decisive = 0;
    for (int i = 0; i < sw->watched_count; ++i) {
        const lag_watched_function *f = sw->watched + i;
        double *slope = w->slopes + i * (w->n + 1), rate = slope[count], size = size_of(run, f);
        if (!f->hit)
            continue;
        for (int k = 0; k < count; ++k) {
            if (is_shared(run, f)) {
                slope[k] = NAN;
            } else if (fabs(rate) * span <= GRAZES * size) {
                slope[k] = fabs(slope[k]) <= GRAZES * NONE * size ? 0.0 : NAN;
                if (isnan(slope[k]) && decides(run, f))
                    blame(&w->cause, LAG_GRAZES, f->what, f->which);
            } else {
                slope[k] = -slope[k] / rate;
            }
            if (f->what >= LAG_WATCH_CONDITION)
                w->of_condition[f->which * w->n + which[k]] = slope[k];
        }
        if (decides(run, f)) {
            if (is_shared(run, f))
                blame(&w->cause, LAG_SHARES, f->what, f->which);
            if (!decisive++)
                first = i;
        } else if (first < 0) {
            first = i;
        }
    }
    for (int k = 0; k < count; ++k) {
        double least = INFINITY, most = -INFINITY;
        int bad = 0;
        w->time[which[k]] = first < 0 ? 0.0 : w->slopes[first * (w->n + 1) + k];
        for (int i = 0; i < sw->watched_count && decisive; ++i) {
            if (!sw->watched[i].hit || !decides(run, sw->watched + i))
                continue;
            const double time = w->slopes[i * (w->n + 1) + k];
            bad |= isnan(time);
            least = fmin(least, time);
            most = fmax(most, time);
        }
        const int apart = most - least > SAME_TIME * fmax(fabs(most), fabs(least)) + NONE * span;
        for (int i = 0; i < sw->watched_count && apart; ++i)
            if (sw->watched[i].hit && decides(run, sw->watched + i))
                blame(&w->cause, LAG_COINCIDE, sw->watched[i].what, sw->watched[i].which);
        if (decisive && (bad || apart))
            w->time[which[k]] = NAN;
    }
}

void lag_begin_first_jump(lag_run *run)
{
    lag_derivatives *w = &run->derivatives;
    const size_t conditions = (size_t)(run->switching.conditions + run->switching.force_conditions);
    memset(w->time, 0, (size_t)w->n * sizeof(double));
    memset(w->of_condition, 0, conditions * (size_t)w->n * sizeof(double));
    memcpy(w->left, lag_change(run, run->step.y, 0), 2 * (size_t)(run->system.nq * w->n) * sizeof(double));
    w->jumped = 0;
    w->rested = -1;
    w->cause = (lag_cause){0};
}

int lag_begin_jump(lag_run *run)
{
    lag_derivatives *w = &run->derivatives;
    const lag_switching *sw = &run->switching;
    const int nq = run->system.nq, conditions = sw->conditions + sw->force_conditions;
    const double t = run->step.t;
    double *y = run->step.y, power;
    int *which = w->which, count = 0;
    if (lag_project_changes(run, t, y) || lag_accelerate(run, t, y, 0, &power))
        return 1;
    lag_begin_first_jump(run);
    for (int k = 0; k < w->n; ++k) {
        w->time[k] = NAN;
        if (!w->lost[k]) {
            which[count] = k;
            w->directions[count++] = lag_direction_of(run, y, k, 0.0);
        }
    }
    if (!count)
        return 0;
    memcpy(w->now, run->solver.a, (size_t)nq * sizeof(double));
    w->directions[count] = (lag_direction){1.0, y + nq, w->now, w->none};
    if (lag_differentiate(run, t, y, count + 1, w->directions))
        return 1;
    find_slopes(run, t, y, count + 1, w->directions);
    find_times(run, count, which);
    for (int k = 0; k < w->n; ++k) {
        for (int c = 0; c < conditions; ++c) {
            int happens = 0;
            for (int i = 0; i < sw->watched_count; ++i)
                happens |= sw->watched[i].hit && sw->watched[i].what >= LAG_WATCH_CONDITION
                           && sw->watched[i].which == c;
            if (!happens)
                w->of_condition[c * w->n + k] = w->time[k];
        }
        if (w->lost[k])
            continue;
        double *change = lag_change(run, y, k);
        for (int i = 0; i < nq; ++i) {
            change[i] += y[nq + i] * w->time[k];
            change[nq + i] += w->now[i] * w->time[k];
        }
    }
    return 0;
}

/* End derivatives that leave a row that holds from here on. */
static void check_rows(lag_run *run, int started)
{
    lag_derivatives *w = &run->derivatives;
    const lag_switching *sw = &run->switching;
    const double t = run->step.t;
    const int nq = run->system.nq, reason = started ? LAG_WITHIN_TOLERANCE : LAG_ONLY_HERE;
    const double *sizes = run->rows.sizes;
    double *y = run->step.y;
    if (!sw->acting || !sw->rows || lag_find_rows(run, t, y))
        return;
    for (int k = 0; k < w->n; ++k) {
        if (w->lost[k])
            continue;
        const lag_direction d = lag_direction_of(run, y, k, 0.0);
        lag_evaluate_along(run, &w->functions, t, y, d);
        double all_q = 0.0, all_v = 0.0; /* without units */
        for (int j = 0; j < nq; ++j) {
            all_q = fmax(all_q, fabs(d.q[j]) / sizes[j]);
            all_v = fmax(all_v, fabs(d.v[j]) / sizes[j]);
        }
        for (int i = 0; i < sw->rows && !w->lost[k]; ++i) {
            double of_q = 0.0, of_v = 0.0;
            if (sw->mode[i] != LAG_HOLDS)
                continue;
            for (int j = 0; j < nq; ++j) {
                const double b = sw->jacobian[i * nq + j], rounding = ROUNDING / LEAVES * sizes[j];
                of_q += fabs(b) * fmax(fabs(d.q[j]), rounding * all_q);
                of_v += fabs(b) * fmax(fabs(d.v[j]), rounding * all_v);
            }
            const double gap = sw->place[i] < 0 ? 0.0 : fabs(OUT(&w->functions, sw->place[i]));
            const double speed = fabs(lag_change_of_speed(run, i, y + nq, d.v));
            if ((speed > LEAVES * of_v && speed > LEAVES * sw->speed[i])
                || (gap > LEAVES * of_q && gap > LEAVES * sw->size[i]))
                lose_for(run, k, reason, LAG_WATCH_FORCE, i);
        }
    }
}

int lag_end_jump(lag_run *run, int started)
{
    lag_derivatives *w = &run->derivatives;
    const lag_switching *sw = &run->switching;
    const int nq = run->system.nq;
    const double t = run->step.t, *before = sw->begin;
    double *y = run->step.y, jump = 0.0, old = 0.0, now = 0.0, power;
    if (!w->live)
        return 0;
    if (started) {
        if (lag_accelerate(run, t, y, 0, &power))
            return 1;
        const double *a = run->solver.a;
        for (int i = 0; i < nq; ++i) {
            jump = fmax(jump, fabs(a[i] - before[i]));
            old = fmax(old, fabs(before[i]));
            now = fmax(now, fabs(a[i]));
        }
        for (int k = 0; k < w->n; ++k) {
            double *change = lag_change(run, y, k);
            if (w->lost[k])
                continue;
            if (jump <= SMOOTH * (old + now) && !w->jumped) {
                memcpy(change, w->left + 2 * nq * k, 2 * (size_t)nq * sizeof(double));
            } else if (isnan(w->time[k])) {
                lose(run, k, &w->cause);
            } else {
                for (int i = 0; i < nq; ++i) {
                    change[i] -= y[nq + i] * w->time[k];
                    change[nq + i] -= a[i] * w->time[k];
                }
            }
        }
    }
    for (int k = 0; k < w->n; ++k)
        if (w->rested >= 0)
            lose_for(run, k, LAG_RESTS, LAG_WATCH_GAP, w->rested);
    check_rows(run, started);
    return lag_project_changes(run, t, y);
}

void lag_begin_impact(lag_run *run, double t, double *y, int n, const int *rows, int inelastic)
{
    lag_derivatives *w = &run->derivatives;
    const lag_switching *sw = &run->switching;
    const int nq = run->system.nq, all = sw->rows + sw->nf;
    w->jumped = 1;
    w->taking = rows;
    w->inelastic = inelastic;
    w->struck = y;
    w->struck_at = t;
    memcpy(w->now, y + nq, (size_t)nq * sizeof(double));
    memset(w->compression, 0, (size_t)all * sizeof(double));
    memset(w->of_compression, 0, (size_t)(w->n * all) * sizeof(double));
    for (int k = 0; k < w->n; ++k) {
        if (w->lost[k])
            continue;
        const lag_direction d = lag_direction_of(run, y, k, w->time[k]);
        lag_evaluate_along(run, &w->functions, t, y, d);
        for (int i = 0; i < n; ++i) {
            const int row = rows[i];
            double terms = 0.0, rate = 0.0;
            if (sw->law[row] != LAG_UNILATERAL)
                continue;
            for (int j = 0; j < nq; ++j) {
                terms += fabs(sw->jacobian[row * nq + j] * d.q[j]);
                rate += sw->jacobian[row * nq + j] * y[nq + j];
            }
            terms += fabs(rate * w->time[k]);
            const double gap = fabs(OUT(&w->functions, sw->place[row]));
            if (gap > fmax(APART * terms, NO_GAP * sw->size[row])) {
                w->cause = (lag_cause){0};
                blame(&w->cause, LAG_CLOSE_TOGETHER, LAG_WATCH_GAP, row);
                w->time[k] = NAN; /* lost at the end of the instant */
            }
        }
        lag_evaluate_along(run, &w->impact, t, y, d);
        for (int i = 0; i < w->impact_count; ++i)
            w->of_impact[k * w->impact_count + i] = OUT(&w->impact, i);
    }
}

void lag_impact_phase(void *of, int part, int n, const int *row, const int *mode, const double *force)
{
    lag_run *run = of;
    lag_derivatives *w = &run->derivatives;
    const lag_system *s = &run->system;
    const lag_switching *sw = &run->switching;
    const lag_tape *e = &w->dynamics, *c = &w->constraint, *g = &w->functions, *b_of = &s->dynamics;
    const int nq = s->nq, nc = s->nc, size = nq + nc, all = sw->rows + sw->nf;
    const double t = w->struck_at;
    double *y = w->struck, *after = w->after, *moved = w->x + size, *impulse = w->row + 3 * all, *right = w->row + 4 * all;
    double *before = w->row + 5 * all, *x = w->x;
    int *rows = w->acts;
    memset(moved, 0, (size_t)size * sizeof(double));
    memset(before, 0, (size_t)all * sizeof(double));
    for (int i = 0; i < n; ++i) {
        const int r = rows[i] = w->taking[row ? row[i] : i];
        const double *u = sw->response + r * size;
        const int bounces = part == LAG_EXPANSION && sw->restitution[r] >= 0 && w->compression[r] > 0.0
                            && !w->inelastic;
        impulse[r] = force[i] + (bounces ? OUT(&sw->impact, sw->restitution[r]) * w->compression[r] : 0.0);
        for (int j = 0; j < size; ++j)
            moved[j] += u[j] * impulse[r];
        before[r] = lag_along(run, r, w->now) + sw->drift[r];
    }
    for (int i = 0; i < nq; ++i)
        after[i] = w->now[i] + moved[i];
    for (int k = 0; k < w->n; ++k) {
        if (w->lost[k])
            continue;
        const lag_direction d = lag_direction_of(run, y, k, w->time[k]);
        double *solver = run->solver.right, *change = lag_change(run, y, k) + nq, *of_speed = w->row + 6 * all;
        const double *of_impact = w->of_impact + k * w->impact_count;
        double *of_compression = w->of_compression + k * all, *matrix = w->lu;
        lag_evaluate_along(run, e, t, y, d);
        lag_evaluate_along(run, c, t, y, d);
        lag_evaluate_along(run, g, t, y, d);
        const int jacobian = s->nm + nq;
        memset(solver, 0, (size_t)size * sizeof(double));
        for (int m = 0; m < s->nm; ++m)
            solver[s->mass_row[m]] -= OUT(e, m) * moved[s->mass_column[m]];
        for (int i = 0; i < nc; ++i)
            solver[nq + i] = -OUT(c, s->nh + s->nb + i);
        for (int b = 0; b < s->nb; ++b) {
            const int i = s->jacobian_row[b], j = s->jacobian_column[b];
            const double of_b = OUT(e, jacobian + b);
            solver[j] += of_b * moved[nq + i];
            solver[nq + i] -= of_b * after[j] + OUT(b_of, lag_first_jacobian(s) + b) * change[j];
        }
        /* changes of the rows' velocities before the phase, and after it without that of v after it */
        memset(of_speed, 0, 2 * (size_t)all * sizeof(double));
        for (int i = 0; i < sw->rows; ++i)
            of_speed[i] = of_speed[all + i] = sw->sign[i] * OUT(g, sw->nh + sw->nb + i)
                                              + lag_along(run, i, change);
        for (int b = 0; b < sw->nb; ++b) {
            const int r = sw->row[b], j = sw->column[b];
            const double of_b = sw->sign[r] * OUT(g, sw->nh + b);
            of_speed[r] += of_b * w->now[j];
            of_speed[all + r] += of_b * after[j];
            for (int i = 0; i < n; ++i)
                if (rows[i] == r)
                    solver[j] += of_b * impulse[r];
        }
        lag_solve(run, solver, x, 0);
        lag_turn(x + nq, nc);
        memset(matrix, 0, (size_t)n * n * sizeof(double));
        for (int i = 0; i < n; ++i) {
            const int r = rows[i];
            const double factor = sw->restitution[r] < 0 ? 0.0 : OUT(&sw->impact, sw->restitution[r]);
            const double of_factor = sw->restitution[r] < 0 ? 0.0 : of_impact[sw->restitution[r]];
            right[i] = 0.0;
            if (mode[i] == LAG_HOLDS) {
                const int returns = part == LAG_NEWTON_PHASE && sw->law[r] == LAG_UNILATERAL && before[r] < 0.0
                                    && !w->inelastic;
                for (int j = 0; j < n; ++j)
                    matrix[i * n + j] = lag_along(run, r, sw->response + rows[j] * size);
                right[i] = -of_speed[all + r] - lag_along(run, r, x);
                if (returns)
                    right[i] -= factor * of_speed[r] + of_factor * before[r];
                continue;
            }
            matrix[i * n + i] = 1.0;
            if (mode[i] == LAG_OPEN) {
                if (part == LAG_EXPANSION && sw->law[r] == LAG_UNILATERAL && w->compression[r] > 0.0
                    && !w->inelastic)
                    right[i] = of_factor * w->compression[r] + factor * of_compression[r];
                continue;
            }
            const double side = mode[i] == LAG_SLIPS_FORWARD ? -1.0 : 1.0;
            for (int j = 0; j < n; ++j)
                if (rows[j] == sw->normal[r]) {
                    const double sign = impulse[rows[j]] < 0.0 ? -1.0 : 1.0;
                    matrix[i * n + j] -= side * sign * OUT(&sw->impact, sw->friction[r]);
                    right[i] = side * sign * of_impact[sw->friction[r]] * impulse[rows[j]];
                }
        }
        lag_solve_square(n, matrix, w->pivots, right, w->square);
        for (int i = 0; i < n; ++i) {
            const double *u = sw->response + rows[i] * size;
            for (int j = 0; j < nq; ++j)
                x[j] += u[j] * right[i];
            if (part == LAG_COMPRESSION)
                of_compression[rows[i]] = right[i];
        }
        for (int j = 0; j < nq; ++j)
            change[j] += x[j];
    }
    if (part == LAG_COMPRESSION)
        for (int i = 0; i < n; ++i)
            w->compression[rows[i]] = impulse[rows[i]];
    memcpy(w->now, after, (size_t)nq * sizeof(double));
}

void lag_jump_by_push(lag_run *run, const double *moved, const double *pushed)
{
    lag_derivatives *w = &run->derivatives;
    const lag_system *s = &run->system;
    const lag_tape *e = &w->dynamics;
    const int nq = s->nq, nc = s->nc, jacobian = s->nm + nq;
    double *y = run->step.y, *x = w->x, *right = run->solver.right;
    w->jumped = 1;
    for (int k = 0; k < w->n; ++k) {
        double *change = lag_change(run, y, k) + nq;
        if (w->lost[k])
            continue;
        lag_evaluate_along(run, e, run->step.t, y, lag_direction_of(run, y, k, w->time[k]));
        memcpy(right, pushed + k * nq, (size_t)nq * sizeof(double));
        memset(right + nq, 0, (size_t)nc * sizeof(double));
        for (int m = 0; m < s->nm; ++m)
            right[s->mass_row[m]] -= OUT(e, m) * moved[s->mass_column[m]];
        for (int b = 0; b < s->nb; ++b) {
            const int i = s->jacobian_row[b], j = s->jacobian_column[b];
            right[j] += OUT(e, jacobian + b) * moved[nq + i];
            right[nq + i] -= OUT(e, jacobian + b) * moved[j];
        }
        lag_solve(run, right, x, 0);
        for (int i = 0; i < nq; ++i)
            change[i] += x[i];
    }
}
