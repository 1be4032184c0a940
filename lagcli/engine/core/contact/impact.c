#include <math.h>
#include <string.h>

#include "contact/modes.h"
#include "settings.h"

#define APPROACH 1e-12 /* of the first approach: slower ones end a sequence */
#define ROUNDING 1e-14 /* of the terms of a velocity */
#define RESTS 1e4      /* rounding errors: a contact that opens more slowly rests */
#define SHARED 1e-9    /* of the terms of a velocity: a smaller one, which another share of the impulses gives, is none */
#define SEQUENCE 200   /* impacts of a sequence per contact, after which the remaining ones occur together */

typedef struct phases {
    const lag_impact *impact;
    double *offset, *limit, *none;  /* n each; `none` are zeros */
    double *rounding;               /* n, of the offset */
    double *matrix, *slope;         /* n * n each: of the rows of a sequence's impact */
    double *before, *restitution;   /* n each, likewise */
    double *error;                  /* n, likewise: of `before` */
    double *taken, *changed;        /* n each, likewise */
    double *shared, *share;         /* n * n, n: of redundant contacts, and their diagonal */
    lag_contact_motion first, second;
    void *memory;
    int *law, *row, *tied;
    int contacts;                   /* unilateral rows */
} phases;

static size_t reals(int n)
{
    return 14 * (size_t)n + 3 * (size_t)n * n;
}

size_t lag_impact_memory(int n)
{
    const size_t whole = 5 * (size_t)n * sizeof(int);
    return lag_contact_memory(n) + reals(n) * sizeof(double) + whole;
}

static phases prepare(const lag_impact *impact, void *memory)
{
    const int n = impact->n;
    phases p = {.impact = impact};
    double *next = memory;
    double **const parts[] = {
        &p.offset, &p.limit, &p.none, &p.before, &p.restitution, &p.taken, &p.changed,
        &p.rounding, &p.error, &p.share, &p.first.force, &p.first.motion, &p.second.force, &p.second.motion};
    for (size_t i = 0; i < sizeof parts / sizeof *parts; ++i, next += n)
        *parts[i] = next;
    p.matrix = next;
    p.slope = p.matrix + n * n;
    p.shared = p.slope + n * n;
    p.memory = p.shared + n * n;
    int *whole = (int *)((char *)p.memory + lag_contact_memory(n));
    int **const lists[] = {&p.first.mode, &p.second.mode, &p.law, &p.row, &p.tied};
    for (size_t i = 0; i < sizeof lists / sizeof *lists; ++i, whole += n)
        *lists[i] = whole;
    memset(p.none, 0, n * sizeof *p.none);
    for (int i = 0; i < n; ++i)
        p.contacts += impact->law[i] == LAG_UNILATERAL;
    return p;
}

/* One phase: the contact problem with an offset and constant parts of limits, after given impulses. */
static int phase(phases *p, const lag_impact *of, const double *limit, const double *impulse)
{
    const int n = of->n;
    for (int i = 0; i < n; ++i) {
        double terms = fabs(of->before[i]);
        for (int j = 0; j < n; ++j)
            terms += fabs(of->matrix[i * n + j] * impulse[j]);
        p->rounding[i] = ROUNDING * terms + (of->rounding ? of->rounding[i] : 0.0);
    }
    const lag_contacts problem = {n,     of->matrix,   p->offset, of->law,      limit, of->friction,
                                  limit, of->friction, p->rounding};
    return lag_solve_contacts(&problem, NULL, p->memory, &p->first, &p->second);
}

/* Pass on a phase that has been solved. `of` is the whole impact, or that of the gathered rows. */
static void pass_on(const phases *p, const lag_impact *of, int part)
{
    const lag_impact *whole = p->impact;
    if (whole->phase)
        whole->phase(whole->context, part, of->n, of == whole ? NULL : p->row, p->first.mode, p->first.force);
}

static int worse(int a, int b)
{
    return a == LAG_NO_MOTION || b == LAG_NO_MOTION ? LAG_NO_MOTION : a > b ? a : b;
}

/* Newton's law: the problem of y + e y_before. What opens is not moved back; of what rests, all velocities are taken as
 * they are, so that those of redundant contacts do not contradict each other. */
static int newton(phases *p, const lag_impact *of, double *impulse, double *after)
{
    for (int i = 0; i < of->n; ++i) {
        const int opens = of->before[i] > (of->rounding ? RESTS * of->rounding[i] : 0.0);
        const int bounces = of->law[i] == LAG_UNILATERAL && !opens;
        p->offset[i] = of->before[i] + (bounces ? of->restitution[i] * of->before[i] : 0.0);
    }
    const int motions = phase(p, of, p->none, p->none);
    if (motions != LAG_NO_MOTION)
        pass_on(p, of, LAG_NEWTON_PHASE);
    if (motions != LAG_NO_MOTION)
        for (int i = 0; i < of->n; ++i) {
            impulse[i] = p->first.force[i];
            after[i] = p->first.motion[i] + of->before[i] - p->offset[i];
        }
    return motions;
}

/* The velocity of row i by impulses of listed contacts, or of their returned parts, if it is not zero but for
 * rounding. */
static double velocity(const lag_impact *of, int i, int count, const int *rows, const double *impulse, int returned)
{
    double sum = 0.0, terms = 0.0;
    for (int k = 0; k < count; ++k) {
        const int j = rows[k];
        const double x = of->matrix[i * of->n + j] * impulse[k] * (returned ? of->restitution[j] : 1.0);
        sum += x;
        terms += fabs(x);
    }
    return fabs(sum) > SHARED * terms ? sum : 0.0;
}

/* Eliminate rows of a matrix, m * m, from those that depend least on others: those not yet `done`. Marks the pivots
 * there. own: m, the diagonal. */
static void eliminate(double *a, int m, const double *own, int *done)
{
    for (;;) {
        double most = SHARED;
        int at = -1;
        for (int k = 0; k < m; ++k) {
            const double part = a[k * m + k] / own[k];
            if (!done[k] && part > most)
                most = part, at = k;
        }
        if (at < 0)
            return;
        done[at] = 1;
        for (int j = 0, pivot = at * m + at; j < m; ++j)
            if (j != at)
                a[at * m + j] /= a[pivot];
        for (int i = 0; i < m; ++i)
            for (int j = 0; i != at && j < m; ++j)
                if (j != at)
                    a[i * m + j] -= a[i * m + at] * a[at * m + j];
    }
}

/* A where the free rows do not move: zero of these, and of rows that do not move without them. own, done: n. */
static void hold_free(const lag_impact *of, double *own, int *done, double *a)
{
    const int n = of->n;
    memcpy(a, of->matrix, (size_t)n * n * sizeof *a);
    for (int i = 0; i < n; ++i) {
        own[i] = a[i * n + i];
        done[i] = of->law[i] != LAG_FREE;
    }
    eliminate(a, n, own, done);
    for (int i = 0; i < n; ++i)
        for (int j = 0; (of->law[i] == LAG_FREE || !(a[i * n + i] > SHARED * own[i])) && j < n; ++j)
            a[i * n + j] = a[j * n + i] = 0.0;
}

/* The z of m redundant contacts' impulses with A z = 0, by the columns that `eliminate` left: `count` rows of m, each
 * with z/d = 1 of another of these columns, and without rounding errors. */
static int shares(const phases *p, const lag_impact *of, int m, const int *rows, const int *done, double *z)
{
    const int n = of->n;
    int count = 0;
    for (int f = 0; f < m; ++f) {
        double *own = z + count * m;
        const double unit = sqrt(of->matrix[rows[f] * (n + 1)]);
        int moves = 0;
        if (done[f])
            continue;
        for (int k = 0; k < m; ++k) {
            const double part = k == f ? 1.0 : done[k] ? -p->shared[k * m + f] : 0.0;
            own[k] = fabs(part) * sqrt(of->matrix[rows[k] * (n + 1)]) > SHARED * unit ? part / unit : 0.0;
        }
        for (int i = 0; i < n; ++i)
            moves |= velocity(of, i, m, rows, own, 0) != 0.0;
        count += !moves;
    }
    return count;
}

/* Whether the velocities after the expansion depend on how redundant contacts share the impulses of the compression:
 * z with A z = 0, by which these may change without that one of them pulls, but A (e z) is not 0. */
static int depends_on_shares(phases *p, const lag_impact *whole, const double *impulse)
{
    const int n = whole->n;
    int m = 0, differ = 0, bounds = 0, *rows = p->tied, *done = p->second.mode; /* which is not read */
    double largest = 0.0;
    double *z = p->memory, *normal = z + n * n, *bound = normal + (n + 1) * n, *found = bound + n + 1;
    double *scratch = found + n, *a = scratch + (n + 1) * (n + 4) + 2 * (n + 1);
    int *place = (int *)(a + n * n), *bounded = place + n + 1;
    lag_impact held = *whole, *of = &held;
    held.matrix = a;
    hold_free(whole, p->share, done, a);
    for (int i = 0; i < n; ++i) {
        if (of->law[i] != LAG_LIMITED)
            largest = fmax(largest, fabs(impulse[i]) * sqrt(whole->matrix[i * n + i]));
        if (of->law[i] != LAG_UNILATERAL || p->first.mode[i] == LAG_OPEN || !(a[i * n + i] > 0.0))
            continue;
        rows[m++] = i;
        differ |= of->restitution[i] != of->restitution[rows[0]];
    }
    if (!differ)
        return 0;
    for (int i = 0; i < m; ++i) {
        for (int j = 0; j < m; ++j)
            p->shared[i * m + j] = a[rows[i] * n + rows[j]];
        p->share[i] = p->shared[i * m + i];
        done[i] = 0;
    }
    eliminate(p->shared, m, p->share, done);
    const int count = shares(p, of, m, rows, done, z);
    for (int k = 0; k < m; ++k)
        if (!(impulse[rows[k]] * sqrt(a[rows[k] * (n + 1)]) > SHARED * largest))
            bounded[bounds++] = k;
    for (int i = 0; count && i < n; ++i)
        for (int side = -1; side <= 1 && a[i * n + i] > 0.0; side += 2) { /* z >= 0 of these, side (A e z)_i >= 1 */
            for (int b = 0; b < bounds; ++b)
                for (int f = 0; f < count; ++f)
                    normal[b * count + f] = z[f * m + bounded[b]];
            for (int f = 0; f < count; ++f)
                normal[bounds * count + f] = side * velocity(of, i, m, rows, z + f * m, 1) / sqrt(a[i * (n + 1)]);
            memset(bound, 0, bounds * sizeof *bound);
            bound[bounds] = 1.0;
            if (lag_least_distance(count, bounds + 1, normal, bound, found, scratch, place))
                return 1;
        }
    return 0;
}

/* Poisson's law: compression; then expansion, a problem of x - e x_C. */
static int poisson(phases *p, const lag_impact *of, double *impulse, double *after)
{
    const int n = of->n;
    memcpy(p->offset, of->before, n * sizeof *p->offset);
    int motions = phase(p, of, p->none, p->none), expands = 0;
    if (motions == LAG_NO_MOTION)
        return motions;
    pass_on(p, of, LAG_COMPRESSION);
    memcpy(impulse, p->first.force, n * sizeof *impulse);
    memcpy(after, p->first.motion, n * sizeof *after);
    if (depends_on_shares(p, of, impulse))
        motions = LAG_TWO_MOTIONS;
    memcpy(p->offset, after, n * sizeof *after);
    memset(p->limit, 0, n * sizeof *p->limit);
    for (int j = 0; j < n; ++j) {
        if (of->law[j] != LAG_UNILATERAL)
            continue;
        const double returned = of->restitution[j] * impulse[j];
        if (!(returned > 0.0))
            continue;
        expands = 1;
        impulse[j] += returned;
        for (int i = 0; i < n; ++i) {
            p->offset[i] += of->matrix[i * n + j] * returned;
            p->limit[i] += of->friction[i * n + j] * returned;
        }
    }
    if (!expands)
        return motions;
    motions = worse(motions, phase(p, of, p->limit, impulse));
    if (motions == LAG_NO_MOTION)
        return motions;
    pass_on(p, of, LAG_EXPANSION);
    for (int i = 0; i < n; ++i)
        impulse[i] += p->first.force[i];
    memcpy(after, p->first.motion, n * sizeof *after);
    return motions;
}

/* The rows of one unilateral row's impact: itself, free rows, and what they give a limit. -1: only free rows. */
static int gather(phases *p, int unilateral)
{
    const lag_impact *whole = p->impact;
    const int n = whole->n;
    int count = 0;
    for (int i = 0; i < n; ++i) {
        int takes_part = i == unilateral || whole->law[i] == LAG_FREE;
        for (int j = 0; whole->law[i] == LAG_LIMITED && j < n; ++j)
            takes_part |= whole->friction[i * n + j] != 0.0 &&
                          (j == unilateral || whole->law[j] != LAG_UNILATERAL);
        if (takes_part)
            p->row[count++] = i;
    }
    return count;
}

/* Add an impact of `count` gathered rows by Poisson's law, at the current velocities. */
static int add(phases *p, int count, lag_impact_result *result)
{
    const lag_impact *whole = p->impact;
    const int n = whole->n;
    for (int i = 0; i < count; ++i) {
        const int row = p->row[i];
        p->law[i] = whole->law[row];
        p->before[i] = result->after[row];
        p->restitution[i] = whole->restitution[row];
        p->error[i] = whole->rounding ? whole->rounding[row] : 0.0;
        for (int j = 0; j < n; ++j)
            p->error[i] += ROUNDING * fabs(whole->matrix[row * n + j] * result->impulse[j]);
        for (int j = 0; j < count; ++j) {
            p->matrix[i * count + j] = whole->matrix[row * n + p->row[j]];
            p->slope[i * count + j] = whole->friction[row * n + p->row[j]];
        }
    }
    const lag_impact part = {
        count, p->matrix, p->before, p->law, p->restitution, p->slope, p->error, NULL, NULL};
    const int motions = poisson(p, &part, p->taken, p->changed);
    if (motions == LAG_NO_MOTION)
        return motions;
    for (int i = 0; i < count; ++i) {
        const int row = p->row[i];
        result->impulse[row] += p->taken[i];
        result->loss[row] -= p->taken[i] * (p->before[i] + p->changed[i]) / 2.0;
    }
    for (int i = 0; i < n; ++i) {
        result->after[i] = whole->before[i];
        for (int k = 0; k < n; ++k)
            result->after[i] += whole->matrix[i * n + k] * result->impulse[k];
    }
    return motions;
}

/* The unilateral row whose approach has the largest energy, above `least` squared; -1 if none does. */
static int fastest(const phases *p, const double *velocity, double *least)
{
    const lag_impact *whole = p->impact;
    int next = -1;
    for (int i = 0; i < whole->n; ++i) {
        if (whole->law[i] != LAG_UNILATERAL || !(velocity[i] < 0.0))
            continue;
        const double speed = -velocity[i] / sqrt(whole->matrix[i * whole->n + i]);
        if (speed > *least * (1.0 + APPROACH)) {
            *least = speed;
            next = i;
        }
    }
    return next;
}

/* Whether a free row has a velocity before the impact. */
static int unmet(const lag_impact *whole)
{
    for (int i = 0; i < whole->n; ++i)
        if (whole->law[i] == LAG_FREE && fabs(whole->before[i]) > (whole->rounding ? whole->rounding[i] : 0.0))
            return 1;
    return 0;
}

static int sequential(phases *p, lag_impact_result *result)
{
    const int n = p->impact->n;
    double rest = 0.0;
    int motions = LAG_ONE_MOTION;
    memset(result->impulse, 0, n * sizeof *result->impulse);
    memset(result->loss, 0, n * sizeof *result->loss);
    memcpy(result->after, p->impact->before, n * sizeof *result->after);
    if (unmet(p->impact)) { /* also without a contact that strikes, as where a constraint is engaged */
        motions = add(p, gather(p, -1), result);
        if (motions == LAG_NO_MOTION)
            return motions;
    }
    for (int round = 0; round <= SEQUENCE * p->contacts; ++round) {
        double speed = rest;
        const int next = fastest(p, result->after, &speed);
        if (next < 0)
            return motions;
        if (round == 0)
            rest = APPROACH * speed;
        int count = n;
        if (round < SEQUENCE * p->contacts)
            count = gather(p, next);
        else /* the remainder of an infinite sequence */
            for (int i = 0; i < n; ++i)
                p->row[i] = i;
        motions = worse(motions, add(p, count, result));
        if (motions == LAG_NO_MOTION)
            return motions;
    }
    return motions;
}

int lag_solve_impact(const lag_impact *impact, int law, void *memory, lag_impact_result *result)
{
    phases p = prepare(impact, memory);
    if (law == LAG_SEQUENTIAL)
        return sequential(&p, result);
    const int motions =
        (law == LAG_NEWTON ? newton : poisson)(&p, impact, result->impulse, result->after);
    if (motions != LAG_NO_MOTION)
        for (int i = 0; i < impact->n; ++i)
            result->loss[i] = -result->impulse[i] * (impact->before[i] + result->after[i]) / 2.0;
    return motions;
}
