/* C. E. Lemke's method with lexicographic pivoting; R. W. Cottle, J.-S. Pang, R. E. Stone, The Linear
 * Complementarity Problem, 2009, algorithm 4.4.5 and section 4.9. */
#include "contact/modes.h"

#include <math.h>
#include <string.h>

#define PIVOT 1e-11     /* of a column's largest entry: entries that count as 0 */
#define PIVOTS 100      /* per variable */
#define TIE 1e-12       /* of the larger one: ratios that count as equal */

/*
 * w = M z + q, w >= 0, z >= 0, w z = 0, with the pairs (scaled as in modes.h)
 *   unilateral rows: w = y, z = x
 *   limited rows: w = y + m, z = p = limit + x; and w = limit - x = p - 2 x, z = m, the part of -y
 *   free rows that limit others: w and z are the positive and negative parts of x.
 * All x follow from z: x = F z + g. Static limits are ignored: the modes are improved afterwards.
 */
typedef struct lcp {
    lag_contact_work *work;
    int size;        /* of z */
    double *tableau; /* size * (2 size + 2): w, z, z0, right side */
    double *force;   /* n * (size + 1): F, g */
    int *row;        /* size: the row of the problem of each pair */
    int *basis;      /* size: columns */
} lcp;

static int pairs(lcp *l)
{
    const lag_contact_work *w = l->work;
    l->size = 0;
    for (int i = 0; i < w->n; ++i) {
        const int law = w->problem->law[i];
        if (law == LAG_UNILATERAL || (law == LAG_FREE && w->referred[i]))
            l->row[l->size++] = i;
        else if (law == LAG_LIMITED) {
            l->row[l->size++] = i;
            l->row[l->size++] = i;
        }
        if (law != LAG_UNILATERAL && law != LAG_FREE && w->referred[i])
            return 0;
    }
    return 1;
}

static int first_of_two(const lcp *l, int k)
{
    return k + 1 < l->size && l->row[k + 1] == l->row[k];
}

/* x = F z + g: unilateral forces are variables, limited ones p - limit, free rows do not move. */
static void forces(lcp *l)
{
    lag_contact_work *w = l->work;
    const lag_contacts *p = w->problem;
    const int n = w->n, width = l->size + 1;
    const double *d = w->scale;
    double *scratch = l->tableau; /* not yet used */
    memset(w->equation, 0, (size_t)n * n * sizeof *w->equation);
    memset(scratch, 0, (size_t)n * width * sizeof *scratch);
    for (int k = 0; k < l->size; k += 1 + first_of_two(l, k))
        if (p->law[l->row[k]] != LAG_FREE)
            scratch[l->row[k] * width + k] = 1.0;
    for (int i = 0; i < n; ++i) {
        double *row = w->equation + i * n, *right = scratch + i * width;
        const int law = p->law[i];
        if (law == LAG_FREE) {
            for (int j = 0; j < n; ++j)
                row[j] = d[i] * p->matrix[i * n + j] * d[j];
            right[l->size] = -d[i] * p->offset[i];
            continue;
        }
        row[i] = 1.0;
        if (law == LAG_UNILATERAL)
            continue;
        const double direction = law == LAG_BACKWARD ? -1.0 : 1.0;
        right[l->size] = -direction * p->kinetic_limit[i] / d[i];
        for (int j = 0; j < n; ++j)
            row[j] += direction * p->kinetic_slope[i * n + j] * d[j] / d[i];
        for (int k = 0; k < l->size; ++k) /* |x| = x + 2 z of free rows */
            if (p->law[l->row[k]] == LAG_FREE)
                right[k] -= 2.0 * direction * p->kinetic_slope[i * n + l->row[k]] * d[l->row[k]] / d[i];
    }
    int *columns = l->basis;
    const int rank = lag_contact_reduce(w, scratch, width, columns);
    for (int k = 0; k < n; ++k)
        for (int j = 0; j < width; ++j)
            l->force[columns[k] * width + j] = k < rank ? scratch[k * width + j] : 0.0;
}

/* The tableau of w - M z - z0 = q. */
static void fill(lcp *l)
{
    const lag_contact_work *w = l->work;
    const lag_contacts *p = w->problem;
    const int n = w->n, size = l->size, width = 2 * size + 2;
    memset(l->tableau, 0, (size_t)size * width * sizeof *l->tableau);
    for (int k = 0; k < size; ++k) {
        double *row = l->tableau + k * width;
        const int i = l->row[k], law = p->law[i], second = k > 0 && l->row[k - 1] == i;
        const double *force = l->force + i * (size + 1);
        row[k] = 1.0;
        row[2 * size] = -1.0;
        for (int j = 0; j <= size; ++j) {
            double value = j == size ? p->offset[i] * w->scale[i] : 0.0;
            if (law == LAG_FREE) {
                value = force[j] + (j == k);
            } else if (second) {
                value = (j == k - 1) - 2.0 * force[j];
            } else {
                for (int h = 0; h < n; ++h)
                    value += w->scale[i] * p->matrix[i * n + h] * w->scale[h] * l->force[h * (size + 1) + j];
                value += law == LAG_LIMITED && j == k + 1;
            }
            row[j == size ? width - 1 : size + j] = j == size ? value : -value;
        }
        l->basis[k] = k;
    }
}

static void pivot(lcp *l, int at, int column)
{
    const int width = 2 * l->size + 2;
    double *row = l->tableau + at * width;
    const double inverse = 1.0 / row[column];
    for (int j = 0; j < width; ++j)
        row[j] *= inverse;
    for (int i = 0; i < l->size; ++i) {
        double *other = l->tableau + i * width;
        const double factor = other[column];
        if (i == at || factor == 0.0)
            continue;
        for (int j = 0; j < width; ++j)
            other[j] -= factor * row[j];
        other[column] = 0.0;
    }
    l->basis[at] = column;
}

/* Whether row a of (right side, inverse basis) over its entry in `column` comes before row b's. */
static int before(const lcp *l, int a, int b, double over_a, double over_b)
{
    const int width = 2 * l->size + 2;
    const double *x = l->tableau + a * width, *y = l->tableau + b * width;
    for (int j = -1; j < l->size; ++j) {
        const double u = x[j < 0 ? width - 1 : j] / over_a, v = y[j < 0 ? width - 1 : j] / over_b;
        if (fabs(u - v) > TIE * fmax(1.0, fmax(fabs(u), fabs(v))))
            return u < v;
    }
    return 0;
}

/* The row that leaves when the column enters; z0 as soon as possible. -1 on a ray. */
static int leaving(const lcp *l, int column)
{
    const int width = 2 * l->size + 2;
    double largest = 0.0;
    int best = -1;
    for (int i = 0; i < l->size; ++i)
        largest = fmax(largest, fabs(l->tableau[i * width + column]));
    for (int i = 0; i < l->size; ++i) {
        const double entry = l->tableau[i * width + column];
        if (!(entry > PIVOT * largest))
            continue;
        if (best < 0 || before(l, i, best, entry, l->tableau[best * width + column]))
            best = i;
    }
    return best;
}

static int solve(lcp *l)
{
    const int size = l->size, width = 2 * size + 2;
    double largest = 0.0;
    for (int i = 0; i < size; ++i)
        largest = fmax(largest, fabs(l->tableau[i * width + width - 1]));
    int at = -1;
    for (int i = 0; i < size; ++i) {
        double *right = l->tableau + i * width + width - 1;
        *right /= largest > 0.0 ? largest : 1.0; /* ratios are then compared relative to 1 */
        if (*right < 0.0 && (at < 0 || before(l, i, at, 1.0, 1.0)))
            at = i;
    }
    if (at < 0)
        return 1; /* no entry is negative */
    int column = 2 * size;
    for (int count = 0; at >= 0 && count < PIVOTS * size; ++count) {
        const int left = l->basis[at];
        pivot(l, at, column);
        if (left == 2 * size)
            return 1;
        column = left < size ? left + size : left - size;
        at = leaving(l, column);
    }
    return 0;
}

/* The modes of the basis, in which z0 is no more. */
static void modes(lcp *l)
{
    lag_contact_work *w = l->work;
    const int size = l->size;
    for (int i = 0; i < w->n; ++i) {
        const int law = w->problem->law[i];
        w->mode[i] = law == LAG_UNILATERAL ? LAG_OPEN : LAG_HOLDS;
        w->sign[i] = 1;
    }
    for (int i = 0; i < size; ++i) {
        const int column = l->basis[i], k = column % size, row = l->row[k];
        const int law = w->problem->law[row], z = column >= size;
        if (law == LAG_UNILATERAL && z)
            w->mode[row] = LAG_HOLDS;
        else if (law == LAG_FREE && z)
            w->sign[row] = -1;
        else if (law == LAG_LIMITED && !first_of_two(l, k) && z)
            w->mode[row] = LAG_SLIPS_BACKWARD;
        else if (law == LAG_LIMITED && first_of_two(l, k) && !z)
            w->mode[row] = LAG_SLIPS_FORWARD;
    }
}

int lag_contact_lemke(lag_contact_work *w)
{
    const int n = w->n;
    lcp l = {.work = w, .row = w->place, .basis = w->place + 2 * n};
    if (!pairs(&l))
        return 0;
    l.tableau = w->scratch;
    const int rows = 2 * l.size > n ? 2 * l.size : n; /* forces() has n rows in the tableau's place */
    l.force = l.tableau + rows * (l.size + 1);
    forces(&l);
    fill(&l);
    if (!solve(&l))
        return 0;
    modes(&l);
    return 1;
}
