/*
 * The end of infinitely many impacts. They happen at nearly one place: B, the inverse inertia A, and what the forces
 * do besides those of the contacts, b, are taken as constant. Between impacts, gaps are then parabolas of time,
 *
 *     phi'' = A z + b,   z by the laws of the contacts that are closed,
 *
 * and impacts obey the law of the run. After a number of impacts, all velocities are R times, all gaps R^2 times,
 * those of some state before; then all that follows repeats, R times as fast: what takes the time T takes T / (1 - R)
 * until its end. One ball has R = e after each impact; two contacts that strike in turn, after each second one.
 */
#include "switching/accumulation.h"

#include <math.h>
#include <string.h>

#include "motion.h"
#include "switching/impulse.h"
#include "switching/rows.h"
#include "switching/settle.h"

#define COUPLED 1e-12   /* of the roots of A's diagonal entries: rows that move each other */
#define STILL 1e-10     /* of the largest velocity: none */
#define TOGETHER 1e-9   /* of a flight: contacts that strike together */
#define SIMILAR 1e-12   /* of velocities: those of similar states */
#define SMALL 1e-9      /* of the velocities at first: the end, if no states are similar */
#define STATES 16       /* that are compared: the longest period that is found */
#define STRIKES 1000    /* at one instant, likewise */
#define FLIGHTS 2000    /* after which the sequence counts as one that does not end */

/* A system of rows at constant coefficients, and a part of it: the rows that take part in one problem. */
typedef struct {
    int n, m;                       /* rows; of the part */
    int *rows, *law, *part, *part_law, *mode[2];
    double *matrix, *friction, *slope[2];       /* n * n */
    double *b, *limit[2], *restitution;
    double *phi, *psi, *acceleration, *none;    /* n; none: velocities that count as zero */
    double *impulse;                /* n: of impacts and of forces, so far */
    double *part_matrix, *part_friction, *part_slope[2];
    double *offset, *part_limit[2], *part_restitution, *force[2], *motion[2], *loss;
    double *kept;                   /* STATES * (3 n + 2): time, size, impulse, phi, psi */
    void *memory;
    int law_of_impact;
} patch;

int64_t lag_accumulation_doubles(int64_t rows)
{
    return 8 * rows * rows + 17 * rows + STATES * (3 * rows + 2);
}

int64_t lag_accumulation_integers(int64_t rows)
{
    return 6 * rows;
}

static patch prepare(const lag_run *run)
{
    const lag_switching *sw = &run->switching;
    patch p = {.memory = sw->memory, .law_of_impact = run->settings.impacts};
    const int n = sw->rows;
    double *next = sw->accumulation;
    double **const square[] = {&p.matrix,        &p.friction,      &p.slope[0],      &p.slope[1],
                               &p.part_matrix,   &p.part_friction, &p.part_slope[0], &p.part_slope[1]};
    double **const vector[] = {&p.b,      &p.limit[0],      &p.limit[1],      &p.restitution,
                               &p.phi,    &p.psi,           &p.acceleration,  &p.none,           &p.impulse,
                               &p.offset, &p.part_limit[0], &p.part_limit[1], &p.part_restitution,
                               &p.force[0], &p.force[1],    &p.motion[0],     &p.motion[1]};
    int **const list[] = {&p.rows, &p.law, &p.part, &p.part_law, &p.mode[0], &p.mode[1]};
    for (size_t i = 0; i < sizeof square / sizeof *square; ++i, next += n * n)
        *square[i] = next;
    for (size_t i = 0; i < sizeof vector / sizeof *vector; ++i, next += n)
        *vector[i] = next;
    p.kept = next;
    p.loss = p.force[1]; /* impacts and flights do not overlap */
    for (size_t i = 0; i < sizeof list / sizeof *list; ++i)
        *list[i] = sw->accumulation_lists + i * (size_t)n;
    return p;
}

/* List the rows that move `row`, and each other; with all rows' A in p->part_matrix. Returns how many. */
static int gather(lag_run *run, patch *p, int row, const int *rests, int *member)
{
    const lag_switching *sw = &run->switching;
    int n = 0, grown = 1;
    int *all = p->part;
    for (int i = 0; i < sw->rows; ++i) {
        member[i] = i == row;
        if (lag_may_act(run, i, rests))
            all[n++] = i;
    }
    lag_matrix_of(run, n, all, p->part_matrix);
    while (grown) {
        grown = 0;
        for (int i = 0; i < n; ++i)
            for (int j = 0; j < n && !member[all[i]]; ++j) {
                const double own = p->part_matrix[i * n + i] * p->part_matrix[j * n + j];
                if (member[all[j]]
                    && (fabs(p->part_matrix[i * n + j]) > COUPLED * sqrt(fmax(own, 0.0))
                        || sw->normal[all[i]] == all[j] || sw->normal[all[j]] == all[i]))
                    grown = member[all[i]] = 1;
            }
    }
    int count = 0;
    for (int i = 0; i < n; ++i)
        if (member[all[i]])
            p->rows[count++] = all[i];
    return count;
}

/* Fill in the coefficients at (t, y). Returns 0, or 1 where something is undefined. */
static int fill(lag_run *run, double t, const double *y, int row, const int *rests, int *member, patch *p)
{
    lag_switching *sw = &run->switching;
    const int nq = run->system.nq, size = nq + run->system.nc;
    double power, *free = lag_arrays_of(sw).extra;
    if (lag_find_rows(run, t, y) || lag_accelerate_system(run, t, y, 0, &power) || lag_factor(run, t, y))
        return 1;
    --run->step.evaluations;
    memcpy(free, run->solver.a, (size_t)size * sizeof(double));
    for (int k = 0; k < sw->nf; ++k) {
        const double *u = lag_row_response(run, sw->rows + k);
        for (int i = 0; i < size; ++i)
            free[i] += sw->force[sw->rows + k] * u[i];
    }
    const int n = p->n = gather(run, p, row, rests, member);
    lag_matrix_of(run, n, p->rows, p->matrix);
    const lag_problem_arrays limits = {.rows = p->rows, .limit = {p->limit[0], p->limit[1]},
                                       .slope = {p->slope[0], p->slope[1]}};
    lag_limits_of(run, t, y, free, n, NULL, 0, &limits);
    lag_evaluate(&sw->impact, &run->system, t, y, LAG_ALL);
    memset(p->friction, 0, (size_t)n * n * sizeof(double));
    for (int i = 0; i < n; ++i) {
        const int of = p->rows[i];
        p->law[i] = sw->law[of];
        p->b[i] = lag_along(run, of, free) - sw->gamma[of];
        p->psi[i] = fabs(sw->psi[of]) <= lag_no_speed(sw, of) ? 0.0 : sw->psi[of];
        p->phi[i] = p->acceleration[i] = p->impulse[i] = 0.0;
        p->restitution[i] = sw->restitution[of] < 0 ? 0.0 : OUT(&sw->impact, sw->restitution[of]);
        for (int j = 0; j < n; ++j)
            if (sw->law[of] == LAG_LIMITED && sw->friction[of] >= 0 && p->rows[j] == sw->normal[of])
                p->friction[i * n + j] = OUT(&sw->impact, sw->friction[of]);
    }
    return 0;
}

/* Whether a row takes part now: a contact that is closed and does not open, a limit unless all contacts that give it
 * are open, a free row. slope: of limits. */
static int takes_part(const patch *p, int i, const double *slope, const double *limit)
{
    const int n = p->n;
    if (p->law[i] == LAG_UNILATERAL)
        return p->phi[i] == 0.0 && p->psi[i] <= p->none[i];
    if (p->law[i] == LAG_FREE || (limit && limit[i] != 0.0))
        return 1;
    for (int j = 0; j < n; ++j)
        if (slope[i * n + j] != 0.0 && takes_part(p, j, slope, limit))
            return 1;
    return 0;
}

static void copy(const patch *p, const double *from, double *to)
{
    for (int i = 0; i < p->m; ++i)
        for (int j = 0; j < p->m; ++j)
            to[i * p->m + j] = from[p->part[i] * p->n + p->part[j]];
}

/* The accelerations of all rows, with the forces of those that are closed. Returns whether they are unique. */
static int accelerate(patch *p)
{
    p->m = 0;
    for (int i = 0; i < p->n; ++i) {
        if (!takes_part(p, i, p->slope[1], p->limit[1]))
            continue;
        p->part_law[p->m] = p->law[i];
        if (p->law[i] == LAG_LIMITED && fabs(p->psi[i]) > p->none[i])
            p->part_law[p->m] = p->psi[i] > 0.0 ? LAG_FORWARD : LAG_BACKWARD;
        p->offset[p->m] = p->b[i];
        for (int part = 0; part < 2; ++part)
            p->part_limit[part][p->m] = p->limit[part][i];
        p->part[p->m++] = i;
    }
    copy(p, p->matrix, p->part_matrix);
    for (int part = 0; part < 2; ++part)
        copy(p, p->slope[part], p->part_slope[part]);
    const lag_contacts problem = {p->m,             p->part_matrix,   p->offset,        p->part_law, p->part_limit[0],
                                  p->part_slope[0], p->part_limit[1], p->part_slope[1], NULL};
    lag_contact_motion first = {p->force[0], p->motion[0], p->mode[0]};
    lag_contact_motion second = {p->force[1], p->motion[1], p->mode[1]};
    if (p->m && lag_solve_contacts(&problem, NULL, p->memory, &first, &second) != LAG_ONE_MOTION)
        return 0;
    for (int i = 0; i < p->n; ++i) {
        p->acceleration[i] = p->b[i];
        for (int j = 0; j < p->m; ++j)
            p->acceleration[i] += p->matrix[i * p->n + p->part[j]] * p->force[0][j];
    }
    for (int j = 0; j < p->m; ++j)
        p->acceleration[p->part[j]] = p->motion[0][j];
    return 1;
}

/* When a row ends its parabola: an open contact strikes, friction stops. */
static double duration(const patch *p, int i)
{
    const double a = p->acceleration[i], v = p->psi[i];
    if (p->law[i] == LAG_LIMITED)
        return fabs(v) > p->none[i] && a * v < 0.0 ? -v / a : INFINITY;
    if (p->law[i] != LAG_UNILATERAL || (p->phi[i] == 0.0 && v <= p->none[i]))
        return INFINITY;
    const double root = v * v - 2.0 * a * p->phi[i];
    if (!(root >= 0.0) || (a >= 0.0 && v >= 0.0))
        return INFINITY;
    return v >= 0.0 ? (v + sqrt(root)) / -a : 2.0 * p->phi[i] / (sqrt(root) - v);
}

/* Move on to the next change. Returns its duration; infinite if nothing changes. */
static double fly(patch *p)
{
    double least = INFINITY;
    for (int i = 0; i < p->n; ++i)
        least = fmin(least, duration(p, i));
    if (!isfinite(least))
        return least;
    for (int i = 0; i < p->n; ++i) {
        const int ends = duration(p, i) <= (1.0 + TOGETHER) * least;
        p->phi[i] += least * (p->psi[i] + 0.5 * least * p->acceleration[i]);
        p->psi[i] += least * p->acceleration[i];
        if (ends && p->law[i] == LAG_LIMITED)
            p->psi[i] = 0.0;
        if (ends || (p->law[i] == LAG_UNILATERAL && takes_part(p, i, NULL, NULL)))
            p->phi[i] = 0.0;
    }
    return least;
}

/* Add the forces of the part, for a time, or its impulses to those so far. */
static void push(patch *p, double time)
{
    for (int j = 0; j < p->m; ++j)
        p->impulse[p->part[j]] += time * p->force[0][j];
}

/* One impact, of contacts that approach. Returns 1, -1 where none does, or 0 where it has no solution. */
static int strike_once(patch *p)
{
    int approaches = 0;
    p->m = 0;
    for (int i = 0; i < p->n; ++i) {
        if (!takes_part(p, i, p->friction, NULL))
            continue;
        approaches |= p->law[i] == LAG_UNILATERAL && p->psi[i] < -p->none[i];
        p->part_law[p->m] = p->law[i];
        p->offset[p->m] = p->psi[i];
        p->part_restitution[p->m] = p->restitution[i];
        p->part[p->m++] = i;
    }
    if (!approaches)
        return -1;
    copy(p, p->matrix, p->part_matrix);
    copy(p, p->friction, p->part_friction);
    const lag_impact impact = {p->m, p->part_matrix, p->offset, p->part_law, p->part_restitution, p->part_friction,
                               NULL, NULL, NULL};
    lag_impact_result result = {p->force[0], p->motion[0], p->loss};
    if (lag_solve_impact(&impact, p->law_of_impact, p->memory, &result) == LAG_NO_MOTION)
        return 0;
    push(p, 1.0);
    for (int i = 0; i < p->n; ++i)
        for (int j = 0; j < p->m; ++j)
            p->psi[i] += p->matrix[i * p->n + p->part[j]] * p->force[0][j];
    for (int i = 0; i < p->n; ++i)
        if (fabs(p->psi[i]) <= p->none[i])
            p->psi[i] = 0.0;
    return 1;
}

/* Impacts at one instant, until no contact approaches. Returns 0 where one has no solution, or they do not end. */
static int strike(patch *p)
{
    for (int k = 0; k <= STRIKES; ++k) {
        const int done = strike_once(p);
        if (done <= 0)
            return done != 0;
    }
    return 0;
}

/* The largest velocity of a contact, or velocity with which it will strike, next to the root of its A. */
static double size(const patch *p)
{
    double largest = 0.0;
    for (int i = 0; i < p->n; ++i)
        if (p->law[i] == LAG_UNILATERAL) {
            const double energy = p->psi[i] * p->psi[i] + 2.0 * fabs(p->acceleration[i]) * p->phi[i];
            largest = fmax(largest, sqrt(energy / p->matrix[i * p->n + i]));
        }
    return largest;
}

/* Whether the contacts move like those of a state before, but slower. */
static int similar(const patch *p, const double *other, double now)
{
    const double ratio = now / other[1], *phi = other + 2 + p->n, *psi = phi + p->n;
    if (!(ratio < 1.0 - SIMILAR))
        return 0;
    for (int i = 0; i < p->n; ++i) {
        const double gap = ratio * ratio * phi[i], speed = ratio * psi[i];
        if (p->law[i] == LAG_UNILATERAL
            && (fabs(p->phi[i] - gap) > SIMILAR * (p->phi[i] + gap)
                || fabs(p->psi[i] - speed) > SIMILAR * now * sqrt(p->matrix[i * p->n + i])))
            return 0;
    }
    return 1;
}

/* The end of a sequence that repeats `ratio` times as fast since another state, and the impulses until then. */
static double extrapolate(patch *p, const double *other, double time, double ratio)
{
    for (int i = 0; i < p->n; ++i)
        p->impulse[i] = other[2 + i] + (p->impulse[i] - other[2 + i]) / (1.0 - ratio);
    return other[0] + (time - other[0]) / (1.0 - ratio);
}

/* Subtract the impulses of the forces at rest, for a time. Returns whether they are unique. */
static int subtract_rest(patch *p, double time)
{
    for (int i = 0; i < p->n; ++i)
        if (p->law[i] == LAG_UNILATERAL)
            p->phi[i] = p->psi[i] = 0.0;
    if (!accelerate(p))
        return 0;
    push(p, -time);
    return 1;
}

/* The time from a state until its impacts end, with their impulses; NAN where they do not end. */
static double follow(patch *p)
{
    const int n = p->n, width = 3 * n + 2;
    const double first = size(p);
    double time = 0.0;
    for (int i = 0; i < n; ++i)
        p->none[i] = STILL * first * sqrt(fmax(p->matrix[i * n + i], 0.0));
    for (int k = 0; k < FLIGHTS; ++k) {
        const double now = size(p);
        if (now <= SMALL * first)
            return time;
        for (int j = 0; j < STATES && j < k; ++j) {
            const double *other = p->kept + j * width;
            if (similar(p, other, now))
                return extrapolate(p, other, time, now / other[1]);
        }
        double *state = p->kept + k % STATES * width;
        state[0] = time;
        state[1] = now;
        memcpy(state + 2, p->impulse, (size_t)n * sizeof(double));
        memcpy(state + 2 + n, p->phi, (size_t)n * sizeof(double));
        memcpy(state + 2 + 2 * n, p->psi, (size_t)n * sizeof(double));
        if (!accelerate(p))
            return NAN;
        const double flight = fly(p);
        if (!isfinite(flight))
            return NAN;
        push(p, flight);
        if (!strike(p))
            return NAN;
        time += flight;
    }
    return NAN;
}

double lag_end_of_impacts(
    lag_run *run, double t, const double *y, int row, const int *rests, int *member, double *friction)
{
    patch whole = prepare(run), *p = &whole;
    if (fill(run, t, y, row, rests, member, p))
        return NAN;
    const double time = follow(p);
    if (isfinite(time) && subtract_rest(p, time))
        for (int i = 0; i < p->n; ++i)
            if (p->law[i] == LAG_LIMITED)
                friction[p->rows[i]] = p->impulse[i];
    return t + time;
}
