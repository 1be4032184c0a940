/* Distribution of forces among redundant contacts. */
#include <math.h>
#include <string.h>

#include "contact/modes.h"

#define SHARED 1e-9    /* of a law's coefficients: changes by other distributions, and prices, that count */
#define PIVOT 1e-9     /* of the largest entry: pivots that are rounding errors */
#define OPTIMAL 4e-15  /* of the forces: a reduced cost that counts as zero */
#define PIVOTS 50      /* per column */
#define MOST_SIGNS 8   /* number of forces whose other signs are tried, too */

/*
 * The largest s <= 1 for which some z has g_i . z + b_i >= s for all i, n of them, is the least
 *
 *     sum_i p_i b_i + r   with   sum_i p_i g_i = 0,   sum_i p_i + r = 1,   p, r >= 0,
 *
 * found by the simplex method with Bland's rule. Rows of the tableau: the equations; then the reduced costs,
 * which end with minus the objective. Columns: p, r, right side.
 */
typedef struct simplex {
    int equations, columns; /* columns without the right side */
    double *table;          /* (equations + 1) * (columns + 1) */
    int *basis;             /* equations; -1 of one that depends on the others */
} simplex;

static double *row_of(const simplex *x, int i)
{
    return x->table + i * (x->columns + 1);
}

static void pivot(simplex *x, int at, int column)
{
    double *row = row_of(x, at);
    const double inverse = 1.0 / row[column];
    for (int j = 0; j <= x->columns; ++j)
        row[j] *= inverse;
    for (int i = 0; i <= x->equations; ++i) {
        double *other = row_of(x, i);
        const double factor = other[column];
        if (i == at || factor == 0.0)
            continue;
        for (int j = 0; j <= x->columns; ++j)
            other[j] -= factor * row[j];
        other[column] = 0.0;
    }
    x->basis[at] = column;
}

/* Begin at p = 0, r = 1: in an equation with right side 0, any pivot is possible. */
static void begin(simplex *x)
{
    const int last = x->equations - 1;
    pivot(x, last, x->columns - 1);
    for (int i = 0; i < last; ++i) {
        const double *row = row_of(x, i);
        int column = -1;
        double largest = PIVOT;
        for (int j = 0; j < x->columns; ++j)
            if (fabs(row[j]) > largest) {
                largest = fabs(row[j]);
                column = j;
            }
        x->basis[i] = -1;
        if (column >= 0)
            pivot(x, i, column);
    }
}

/* The equation whose variable leaves the basis for a column; -1 if none does. */
static int leaving(const simplex *x, int column)
{
    int leaving = -1;
    double least = INFINITY;
    for (int i = 0; i < x->equations; ++i) {
        const double *row = row_of(x, i);
        if (x->basis[i] < 0 || !(row[column] > PIVOT))
            continue;
        const double ratio = fmax(row[x->columns], 0.0) / row[column];
        if (ratio < least || (ratio == least && x->basis[i] < x->basis[leaving])) {
            least = ratio;
            leaving = i;
        }
    }
    return leaving;
}

/* Return the largest s; the prices p take the places of the reduced costs. */
static double largest_slack(simplex *x)
{
    double *cost = row_of(x, x->equations);
    begin(x);
    for (int k = 0; k < PIVOTS * x->columns; ++k) {
        int column = 0, row;
        while (column < x->columns && !(cost[column] < -OPTIMAL))
            ++column;
        if (column == x->columns || (row = leaving(x, column)) < 0)
            break;
        pivot(x, row, column);
    }
    memset(cost, 0, (size_t)x->columns * sizeof *cost);
    for (int i = 0; i < x->equations; ++i)
        if (x->basis[i] >= 0)
            cost[x->basis[i]] = row_of(x, i)[x->columns];
    return -cost[x->columns];
}

/* The laws that other shares change, normal . x >= bound, are moved to the front; returns how many there
 * are. `along` (freedom each) is what the vectors of `null` change in them, by unit of the force itself. */
static int shared_laws(lag_contact_work *w, int count, double *along)
{
    const int n = w->n, freedom = w->freedom;
    int shared = 0;
    for (int i = 0; i < count; ++i) {
        const double *normal = w->normal + i * n, d = w->scale[w->owner[i]];
        double size = 0.0, changed = 0.0, slack = -w->bound[i], *out = along + shared * freedom;
        for (int j = 0; j < n; ++j) {
            size = fmax(size, fabs(normal[j]));
            slack += normal[j] * w->force[j];
        }
        for (int f = 0; f < freedom; ++f) {
            out[f] = 0.0;
            for (int j = 0; j < n; ++j)
                out[f] += d * normal[j] * w->null[f * n + j];
            changed = fmax(changed, fabs(out[f]));
        }
        if (!(changed > SHARED * d * size))
            continue;
        w->bound[shared] = d * slack;
        w->owner[shared++] = w->owner[i];
    }
    return shared;
}

/* The largest s for which the forces obey the laws with a margin s, where other shares change them, with the signs that
 * were solved last; s <= `large`. `price` gets the laws' prices, and `laws` the number of them. */
static double margin_of_signs(lag_contact_work *w, double large, const double **price, int *laws)
{
    const int freedom = w->freedom, count = shared_laws(w, lag_contact_inequalities(w), w->reduced);
    *laws = count;
    if (!count || large == 0.0)
        return INFINITY;
    simplex x = {.equations = freedom + 1, .columns = count + 1, .table = w->scratch, .basis = w->place};
    for (int j = 0; j <= count; ++j) {
        for (int f = 0; f < freedom; ++f)
            row_of(&x, f)[j] = j < count ? w->reduced[j * freedom + f] : 0.0;
        row_of(&x, freedom)[j] = 1.0;
        row_of(&x, freedom + 1)[j] = j < count ? w->bound[j] / large : 1.0;
    }
    for (int i = 0; i <= x.equations; ++i)
        row_of(&x, i)[x.columns] = i == freedom;
    const double s = large * largest_slack(&x);
    *price = row_of(&x, x.equations);
    return s;
}

static double largest_force(const lag_contact_work *w)
{
    double large = 0.0;
    for (int i = 0; i < w->n; ++i)
        large = fmax(large, fabs(w->force[i]));
    return large;
}

/* List the rows whose forces have a sign on which limits depend and which other shares may turn; returns how many. */
static int list_signs(const lag_contact_work *w, int *rows)
{
    int count = 0;
    for (int i = 0; i < w->n && count < MOST_SIGNS; ++i) {
        double changed = 0.0;
        for (int f = 0; f < w->freedom; ++f)
            changed = fmax(changed, fabs(w->null[f * w->n + i]));
        if (w->referred[i] && w->mode[i] == LAG_HOLDS && w->problem->law[i] != LAG_UNILATERAL && changed > SHARED)
            rows[count++] = i;
    }
    return count;
}

/* Solve with the signs of forces with which some share obeys the laws: those given, or the first others; or with those
 * with which the laws are violated least. */
static void choose_signs(lag_contact_work *w, double *tolerance)
{
    int rows[MOST_SIGNS], laws, best = 0;
    const double *price;
    if (lag_contact_solve(w, tolerance) || !w->freedom)
        return;
    const int count = list_signs(w, rows);
    double largest = -INFINITY;
    for (int turned = 0, last = 0; turned < 1 << count; last = turned++) {
        for (int k = 0; k < count; ++k)
            if ((turned ^ last) >> k & 1)
                w->sign[rows[k]] = -w->sign[rows[k]];
        if (lag_contact_solve(w, tolerance))
            return;
        const double s = margin_of_signs(w, largest_force(w), &price, &laws);
        if (s > largest) {
            largest = s;
            best = turned;
        }
    }
    for (int k = 0; k < count; ++k)
        if ((((1 << count) - 1) ^ best) >> k & 1)
            w->sign[rows[k]] = -w->sign[rows[k]];
    lag_contact_solve(w, tolerance);
}

int lag_share_contacts(
    const lag_contacts *problem, const int *mode, void *memory, double *force, double *slack, int *tight)
{
    const int n = problem->n;
    lag_contact_work work, *w = &work;
    const double *price;
    double tolerance;
    int count;
    lag_contact_prepare(w, problem, memory);
    memcpy(w->mode, mode, (size_t)n * sizeof *mode);
    for (int i = 0; i < n; ++i)
        w->sign[i] = force[i] < 0.0 ? -1 : 1;
    choose_signs(w, &tolerance);
    if (!w->freedom)
        return 0;
    for (int i = 0; i < n; ++i) {
        force[i] = w->force[i];
        slack[i] = INFINITY;
        tight[i] = 0;
    }
    const double large = largest_force(w), s = margin_of_signs(w, large, &price, &count);
    if (!count || large == 0.0)
        return 1;
    for (int i = 0; i < count; ++i) {
        const int row = w->owner[i];
        slack[row] = s;
        tight[row] |= price[i] > SHARED;
        if (problem->law[row] == LAG_UNILATERAL && fabs(force[row]) <= tolerance * w->scale[row])
            force[row] = fmax(force[row], 0.0); /* smaller values are rounding errors */
    }
    return 1;
}
