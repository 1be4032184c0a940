#include "contact/modes.h"

#include <math.h>
#include <string.h>

#define RANK 1e-11      /* of the largest pivot: linearly dependent equations */
#define TOLERANCE 1e-10 /* of the problem's size: inequalities of forces, and equations that must be consistent; of
                         * the terms of a row's motion: its inequalities */
#define RELAXED 1e-13   /* of it: inequalities used to select redundant forces */

/* of lag_least_distance with n columns and 3 n rows; Lemke's tableau and the forces in terms of its
 * variables, 2 n at most */
#define SCRATCH(n) (2 * (n) * (4 * (n) + 2) + 4 * (n) * (n) + 16 * (n) + 8)

size_t lag_contact_memory(int n)
{
    const size_t reals = 5 * n + 2 * n * n + 6 * n * n + 3 * n + SCRATCH(n);
    return reals * sizeof(double) + 13 * (size_t)n * sizeof(int);
}

static int limited(int law)
{
    return law == LAG_LIMITED || law == LAG_FORWARD || law == LAG_BACKWARD;
}

void lag_contact_prepare(lag_contact_work *w, const lag_contacts *problem, void *memory)
{
    const int n = problem->n;
    double *next = memory;
    *w = (lag_contact_work){.problem = problem, .n = n};
    double **const parts[] = {&w->scale, &w->force, &w->motion, &w->right, &w->allowed};
    for (size_t i = 0; i < sizeof parts / sizeof *parts; ++i, next += n)
        *parts[i] = next;
    w->equation = next;
    w->null = w->equation + n * n;
    w->normal = w->null + n * n;
    w->reduced = w->normal + 3 * n * n;
    w->bound = w->reduced + 3 * n * n;
    w->scratch = w->bound + 3 * n;
    int *whole = (int *)(w->scratch + SCRATCH(n));
    int **const lists[] = {&w->sign, &w->turned, &w->referred, &w->mode, &w->next, &w->order};
    for (size_t i = 0; i < sizeof lists / sizeof *lists; ++i, whole += n)
        *lists[i] = whole;
    w->place = whole;
    w->owner = w->place + 4 * n;

    double largest = 0.0;
    for (int i = 0; i < n; ++i)
        largest = fmax(largest, problem->matrix[i * n + i]);
    for (int i = 0; i < n; ++i) {
        const double entry = problem->matrix[i * n + i];
        w->scale[i] = largest > 0.0 ? 1.0 / sqrt(entry > 0.0 ? entry : largest) : 1.0;
        if (problem->rounding)
            w->floor = fmax(w->floor, problem->rounding[i] * w->scale[i]);
        w->sign[i] = 1;
        w->referred[i] = 0;
    }
    for (int k = 0; k < n; ++k) {
        double refers = 0.0;
        for (int j = 0; limited(problem->law[k]) && j < n; ++j)
            if (problem->static_slope[k * n + j] != 0.0 || problem->kinetic_slope[k * n + j] != 0.0) {
                w->referred[j] = 1;
                refers = fmax(refers, problem->matrix[j * n + j] > 0.0 ? w->scale[j] : 0.0);
            }
        if (!(problem->matrix[k * n + k] > 0.0) && refers > 0.0) /* friction that moves nothing, as where x is given */
            w->scale[k] = refers;
    }
    int count = 0;
    for (int pass = 0; pass < 3; ++pass)
        for (int i = 0; i < n; ++i) {
            const int law = problem->law[i];
            if ((law == LAG_UNILATERAL ? 0 : law == LAG_FREE ? 1 : 2) == pass)
                w->order[count++] = i;
        }
}

int lag_contact_idle(const lag_contact_work *w, const int *mode, int k)
{
    const lag_contacts *p = w->problem;
    const int n = w->n;
    int any = 0;
    if (!limited(p->law[k]) || p->static_limit[k] != 0.0 || p->kinetic_limit[k] != 0.0)
        return 0;
    for (int j = 0; j < n; ++j)
        if (p->static_slope[k * n + j] != 0.0 || p->kinetic_slope[k * n + j] != 0.0) {
            if (p->law[j] != LAG_UNILATERAL || mode[j] != LAG_OPEN)
                return 0;
            any = 1;
        }
    return any;
}

int lag_contact_sign(const lag_contact_work *w, int j)
{
    if (w->problem->law[j] == LAG_UNILATERAL)
        return 1;
    if (w->mode[j] == LAG_SLIPS_FORWARD)
        return -1;
    if (w->mode[j] == LAG_SLIPS_BACKWARD)
        return 1;
    return w->sign[j];
}

/* The equations of the modes for x/d: y = 0, x = 0 or the force of slip. */
static void equations(lag_contact_work *w)
{
    const lag_contacts *p = w->problem;
    const int n = w->n;
    const double *d = w->scale;
    for (int i = 0; i < n; ++i) {
        double *row = w->equation + i * n;
        if (w->mode[i] == LAG_HOLDS) {
            for (int j = 0; j < n; ++j)
                row[j] = d[i] * p->matrix[i * n + j] * d[j];
            w->right[i] = -d[i] * p->offset[i];
        } else {
            memset(row, 0, n * sizeof *row);
            w->right[i] = 0.0;
            if (w->mode[i] != LAG_OPEN) {
                const double direction = w->mode[i] == LAG_SLIPS_FORWARD ? 1.0 : -1.0;
                for (int j = 0; j < n; ++j)
                    row[j] = direction * p->kinetic_slope[i * n + j] * lag_contact_sign(w, j) * d[j] / d[i];
                w->right[i] = -direction * p->kinetic_limit[i] / d[i];
            }
            row[i] += 1.0;
        }
    }
}

static void exchange(double *a, double *b, int count)
{
    for (int k = 0; k < count; ++k) {
        const double x = a[k];
        a[k] = b[k];
        b[k] = x;
    }
}

/* The largest of n magnitudes. */
static double largest_of(const double *x, int n)
{
    double most[4] = {0.0};
    int j = 0;
    for (; j + 4 <= n; j += 4)
        for (int l = 0; l < 4; ++l)
            most[l] = fabs(x[j + l]) > most[l] ? fabs(x[j + l]) : most[l];
    for (; j < n; ++j)
        most[0] = fabs(x[j]) > most[0] ? fabs(x[j]) : most[0];
    return fmax(fmax(most[0], most[1]), fmax(most[2], most[3]));
}

int lag_contact_reduce(lag_contact_work *w, double *right, int width, int *columns)
{
    const int n = w->n;
    double *m = w->equation, first = 0.0, *largest = w->bound; /* of each row: what has not been eliminated */
    int *entry = w->owner;                   /* of the pivot's row: places other than 0 */
    for (int i = 0; i < n; ++i) {
        columns[i] = i;
        largest[i] = largest_of(m + i * n, n);
    }
    for (int k = 0; k < n; ++k) {
        int row = k, at = k, entries = 0;
        for (int i = k; i < n; ++i)
            if (largest[i] > largest[row])
                row = i;
        if (k == 0)
            first = largest[row];
        if (!(largest[row] > RANK * first))
            return k;
        while (fabs(m[row * n + columns[at]]) != largest[row])
            ++at;
        if (row != k) {
            exchange(m + k * n, m + row * n, n);
            exchange(right + k * width, right + row * width, width);
            largest[row] = largest[k];
        }
        const int column = columns[at];
        columns[at] = columns[k];
        columns[k] = column;
        const double inverse = 1.0 / m[k * n + column];
        for (int j = 0; j < n; ++j) /* the pivots before it are 0 here */
            if (m[k * n + j] != 0.0) {
                m[k * n + j] *= inverse;
                entry[entries++] = j;
            }
        for (int j = 0; j < width; ++j)
            right[k * width + j] *= inverse;
        for (int i = 0; i < n; ++i) {
            const double factor = m[i * n + column];
            if (i == k || factor == 0.0)
                continue;
            for (int e = 0; e < entries; ++e)
                m[i * n + entry[e]] -= factor * m[k * n + entry[e]];
            for (int j = 0; j < width; ++j)
                right[i * width + j] -= factor * right[k * width + j];
            if (i > k)
                largest[i] = largest_of(m + i * n, n);
        }
    }
    return n;
}

/* x of least norm, and an orthonormal basis of the null space. */
static void least_norm(lag_contact_work *w, int rank, const int *columns)
{
    const int n = w->n, count = n - rank;
    for (int k = 0; k < n; ++k)
        w->force[columns[k]] = k < rank ? w->scale[columns[k]] * w->right[k] : 0.0;
    for (int f = 0; f < count; ++f) {
        double *z = w->null + f * n;
        memset(z, 0, n * sizeof *z);
        for (int k = 0; k < rank; ++k)
            z[columns[k]] = -w->scale[columns[k]] * w->equation[k * n + columns[rank + f]];
        z[columns[rank + f]] = w->scale[columns[rank + f]];
        for (int pass = 0; pass < 2; ++pass) /* two passes are sufficient */
            for (int e = 0; e < f; ++e) {
                double along = 0.0;
                for (int i = 0; i < n; ++i)
                    along += z[i] * w->null[e * n + i];
                for (int i = 0; i < n; ++i)
                    z[i] -= along * w->null[e * n + i];
            }
        double length = 0.0, along = 0.0;
        for (int i = 0; i < n; ++i)
            length += z[i] * z[i];
        length = sqrt(length);
        for (int i = 0; i < n; ++i)
            z[i] /= length;
        for (int i = 0; i < n; ++i)
            along += z[i] * w->force[i];
        for (int i = 0; i < n; ++i)
            w->force[i] -= along * z[i];
    }
}

static void move(lag_contact_work *w)
{
    const lag_contacts *p = w->problem;
    for (int i = 0; i < w->n; ++i) {
        double sum = p->offset[i], terms = fabs(sum);
        for (int j = 0; j < w->n; ++j) {
            const double part = p->matrix[i * w->n + j] * w->force[j];
            sum += part;
            terms += fabs(part);
        }
        w->motion[i] = sum;
        w->allowed[i] = w->scale[i] * (TOLERANCE * terms + (p->rounding ? p->rounding[i] : 0.0));
    }
}

/* The largest of |x|/d and |d b|. */
static double size(const lag_contact_work *w)
{
    double largest = 0.0;
    for (int i = 0; i < w->n; ++i) {
        largest = fmax(largest, fabs(w->force[i]) / w->scale[i]);
        largest = fmax(largest, fabs(w->problem->offset[i]) * w->scale[i]);
    }
    return largest;
}

static double *inequality(lag_contact_work *w, int row, int *count)
{
    double *normal = w->normal + *count * w->n;
    memset(normal, 0, w->n * sizeof *normal);
    w->owner[*count] = row;
    w->bound[(*count)++] = 0.0;
    return normal;
}

int lag_contact_inequalities(lag_contact_work *w)
{
    const lag_contacts *p = w->problem;
    const int n = w->n;
    int count = 0;
    for (int i = 0; i < n; ++i) {
        const double d = w->scale[i];
        const int law = p->law[i], mode = w->mode[i];
        const int judged = law == LAG_UNILATERAL || (law == LAG_LIMITED && mode != LAG_OPEN);
        if (mode == LAG_HOLDS && (law == LAG_UNILATERAL || w->referred[i]))
            inequality(w, i, &count)[i] = lag_contact_sign(w, i) / d;
        if (mode == LAG_HOLDS && law == LAG_LIMITED)
            for (int side = -1; side <= 1; side += 2) {
                double *normal = inequality(w, i, &count);
                for (int j = 0; j < n; ++j)
                    normal[j] = p->static_slope[i * n + j] * lag_contact_sign(w, j) / d;
                normal[i] += side / d;
                w->bound[count - 1] = -p->static_limit[i] / d;
            }
        if (mode != LAG_HOLDS && judged) {
            const double direction = mode == LAG_SLIPS_BACKWARD ? -d : d;
            double *normal = inequality(w, i, &count);
            for (int j = 0; j < n; ++j)
                normal[j] = direction * p->matrix[i * n + j];
            w->bound[count - 1] = -direction * p->offset[i];
        }
    }
    return count;
}

/* Whether the inequalities hold: those of forces but for `tolerance`, those of motions but for their own errors. */
static int obeyed(const lag_contact_work *w, int count, double tolerance)
{
    for (int i = 0; i < count; ++i) {
        const int row = w->owner[i];
        double sum = -w->bound[i];
        for (int j = 0; j < w->n; ++j)
            sum += w->normal[i * w->n + j] * w->force[j];
        if (!(sum >= -(w->mode[row] == LAG_HOLDS ? tolerance : w->allowed[row])))
            return 0;
    }
    return 1;
}

/* Select the forces of least norm that satisfy the inequalities; return whether there are any. */
static int least_within(lag_contact_work *w, int freedom, int count, double magnitude)
{
    const int n = w->n;
    double unit = 0.0;
    for (int i = 0; i < n; ++i)
        unit = fmax(unit, w->scale[i]);
    for (int i = 0; i < count; ++i) {
        const double *normal = w->normal + i * n;
        double *along = w->reduced + i * freedom;
        int entries = 0, *entry = w->place; /* most have few */
        for (int j = 0; j < n; ++j)
            if (normal[j] != 0.0) {
                w->bound[i] -= normal[j] * w->force[j];
                entry[entries++] = j;
            }
        w->bound[i] = (w->bound[i] - w->floor) / magnitude - RELAXED;
        for (int f = 0; f < freedom; ++f) {
            const double *null = w->null + f * n;
            double sum = 0.0;
            for (int e = 0; e < entries; ++e)
                sum += normal[entry[e]] * null[entry[e]] * unit;
            along[f] = sum;
        }
    }
    double *z = w->right;
    if (!lag_least_distance(freedom, count, w->reduced, w->bound, z, w->scratch, w->place))
        return 0;
    for (int f = 0; f < freedom; ++f)
        for (int j = 0; j < n; ++j)
            w->force[j] += z[f] * magnitude * unit * w->null[f * n + j];
    move(w);
    return 1;
}

/* Changes for violated rows: the neighbouring mode, the other sign. */
static void suggest(lag_contact_work *w, double tolerance)
{
    const lag_contacts *p = w->problem;
    const int n = w->n;
    memcpy(w->next, w->mode, n * sizeof *w->next);
    memcpy(w->turned, w->sign, n * sizeof *w->turned);
    for (int i = 0; i < n; ++i) {
        const double x = w->force[i] / w->scale[i], y = w->motion[i] * w->scale[i];
        const int mode = w->mode[i];
        if (p->law[i] == LAG_UNILATERAL) {
            if (mode == LAG_HOLDS ? x < -tolerance || y > tolerance : y < -w->allowed[i])
                w->next[i] = mode == LAG_HOLDS ? LAG_OPEN : LAG_HOLDS;
        } else if (p->law[i] == LAG_LIMITED && mode == LAG_HOLDS) {
            double limit = p->static_limit[i];
            for (int j = 0; j < n; ++j)
                limit += p->static_slope[i * n + j] * fabs(w->force[j]);
            if (fabs(y) > tolerance)
                w->next[i] = y > 0.0 ? LAG_SLIPS_FORWARD : LAG_SLIPS_BACKWARD;
            else if (fabs(x) > limit / w->scale[i] + tolerance)
                w->next[i] = x < 0.0 ? LAG_SLIPS_FORWARD : LAG_SLIPS_BACKWARD;
        } else if (p->law[i] == LAG_LIMITED && mode != LAG_OPEN) {
            if (mode == LAG_SLIPS_FORWARD ? y < -w->allowed[i] : y > w->allowed[i])
                w->next[i] = LAG_HOLDS;
        }
        if (fabs(x) > tolerance)
            w->turned[i] = x > 0.0 ? 1 : -1;
    }
    lag_contact_rouse(w, w->next);
}

void lag_contact_rouse(const lag_contact_work *w, int *mode)
{
    for (int k = 0; k < w->n; ++k) {
        const int law = w->problem->law[k];
        if (law == LAG_FREE || (law == LAG_UNILATERAL && mode[k] != LAG_OPEN))
            mode[k] = LAG_HOLDS;
        if (!limited(law))
            continue;
        if (lag_contact_idle(w, mode, k))
            mode[k] = LAG_OPEN;
        else if (law != LAG_LIMITED)
            mode[k] = law == LAG_FORWARD ? LAG_SLIPS_FORWARD : LAG_SLIPS_BACKWARD;
        else if (mode[k] == LAG_OPEN)
            mode[k] = LAG_HOLDS;
    }
}

/* Set values that are zero by their mode to exactly zero. */
static void clean(lag_contact_work *w)
{
    for (int i = 0; i < w->n; ++i) {
        if (w->mode[i] == LAG_HOLDS)
            w->motion[i] = 0.0;
        else if (w->mode[i] == LAG_OPEN)
            w->force[i] = 0.0;
        if (w->problem->law[i] == LAG_UNILATERAL) {
            w->force[i] = fmax(w->force[i], 0.0);
            w->motion[i] = fmax(w->motion[i], 0.0);
        }
    }
}

int lag_contact_solve(lag_contact_work *w, double *tolerance)
{
    equations(w);
    const int rank = lag_contact_reduce(w, w->right, 1, w->place);
    double disagreement = 0.0;
    w->freedom = w->n - rank;
    for (int k = rank; k < w->n; ++k)
        disagreement = fmax(disagreement, fabs(w->right[k]));
    least_norm(w, rank, w->place);
    const double magnitude = size(w);
    *tolerance = TOLERANCE * magnitude + w->floor;
    move(w);
    if (!(disagreement <= *tolerance))
        return 0;
    const int count = lag_contact_inequalities(w);
    if (obeyed(w, count, *tolerance))
        return 1;
    return w->freedom && least_within(w, w->freedom, count, magnitude)
           && obeyed(w, lag_contact_inequalities(w), *tolerance);
}

int lag_contact_try(lag_contact_work *w)
{
    double tolerance;
    const int motions = lag_contact_solve(w, &tolerance);
    if (motions)
        clean(w);
    else
        suggest(w, tolerance);
    return motions;
}

void lag_contact_close(lag_contact_work *w)
{
    double tolerance;
    int closes = 0;
    memcpy(w->next, w->mode, w->n * sizeof *w->next);
    for (int i = 0; i < w->n; ++i) {
        const int law = w->problem->law[i], mode = w->mode[i];
        const int may_hold = law == LAG_UNILATERAL ? mode == LAG_OPEN : law == LAG_LIMITED && mode > LAG_HOLDS;
        if (may_hold && fabs(w->motion[i]) * w->scale[i] <= w->allowed[i]) {
            w->mode[i] = LAG_HOLDS;
            closes = 1;
        }
    }
    if (!closes)
        return;
    lag_contact_rouse(w, w->mode);
    if (!lag_contact_solve(w, &tolerance) || !w->freedom) {
        memcpy(w->mode, w->next, w->n * sizeof *w->mode);
        lag_contact_solve(w, &tolerance);
    }
    clean(w);
}
