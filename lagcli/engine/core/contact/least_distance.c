/* C. L. Lawson, R. J. Hanson, Solving Least Squares Problems, 1974, chapter 23: NNLS and LDP. */
#include "contact/modes.h"

#include <math.h>
#include <string.h>

#define INDEPENDENT 1e-13 /* of a column's squared length: the remainder of an independent column */
#define ASCENT 1e-12      /* a gradient that counts as positive */
#define LEAST_RESIDUAL 1e-6 /* a smaller one: the inequalities are infeasible */
#define ROUNDS 10         /* per inequality */

/*
 * Columns of E are (normal, bound) of each inequality, each of length 1; f = (0, ..., 0, 1). With
 * u >= 0 that makes |E u - f| least and r = f - E u, z = -r[:n] / r[n] is the shortest.
 */
typedef struct columns {
    int n, m;
    const double *normal, *bound;
} columns;

static double product(const columns *e, int i, int j)
{
    double sum = e->bound[i] * e->bound[j];
    for (int k = 0; k < e->n; ++k)
        sum += e->normal[i * e->n + k] * e->normal[j * e->n + k];
    return sum;
}

/* Least squares with the columns in `chosen`: u of these, by Cholesky's factors of their products.
 * Returns 0 if the last one depends on the others. */
static int fit(const columns *e, const int *chosen, int count, double *factor, double *u)
{
    const int width = e->n + 1;
    for (int i = 0; i < count; ++i) {
        double sum = e->bound[chosen[i]];
        for (int j = 0; j <= i; ++j) {
            double entry = product(e, chosen[i], chosen[j]);
            const double whole = entry;
            for (int k = 0; k < j; ++k)
                entry -= factor[i * width + k] * factor[j * width + k];
            if (j < i) {
                factor[i * width + j] = entry / factor[j * width + j];
                sum -= factor[i * width + j] * u[j];
            } else {
                if (!(entry > INDEPENDENT * whole))
                    return 0;
                factor[i * width + i] = sqrt(entry);
            }
        }
        u[i] = sum / factor[i * width + i];
    }
    for (int i = count - 1; i >= 0; --i) {
        for (int k = i + 1; k < count; ++k)
            u[i] -= factor[k * width + i] * u[k];
        u[i] /= factor[i * width + i];
    }
    return 1;
}

/* r = f - E u */
static void residual(const columns *e, const int *chosen, int count, const double *u, double *r)
{
    memset(r, 0, (size_t)e->n * sizeof *r);
    r[e->n] = 1.0;
    for (int i = 0; i < count; ++i) {
        for (int k = 0; k < e->n; ++k)
            r[k] -= u[i] * e->normal[chosen[i] * e->n + k];
        r[e->n] -= u[i] * e->bound[chosen[i]];
    }
}

static double ascent(const columns *e, int j, const double *r)
{
    double sum = e->bound[j] * r[e->n];
    for (int k = 0; k < e->n; ++k)
        sum += e->normal[j * e->n + k] * r[k];
    return sum;
}

/* Move from u towards the least-squares solution of the chosen columns while all stay positive, and drop those that
 * become 0. Returns 0 if the last column depends on the others. */
static int descend(const columns *e, int *chosen, int *count, double *factor, double *u, double *to)
{
    while (*count > 0) {
        if (!fit(e, chosen, *count, factor, to))
            return 0;
        double part = 1.0;
        for (int i = 0; i < *count; ++i)
            if (!(to[i] > 0.0))
                part = fmin(part, u[i] > to[i] ? u[i] / (u[i] - to[i]) : 0.0);
        int kept = 0;
        for (int i = 0; i < *count; ++i) {
            const double value = u[i] + part * (to[i] - u[i]);
            if (part < 1.0 && !(to[i] > 0.0) && value <= ASCENT * fabs(u[i]))
                continue;
            chosen[kept] = chosen[i];
            u[kept++] = value;
        }
        if (part == 1.0)
            return 1;
        if (kept == *count) /* a step that overflows moves nothing */
            return 0;
        *count = kept;
    }
    return 1;
}

int lag_least_distance(
    int n, int m, double *normal, const double *given, double *z, double *scratch, int *chosen)
{
    const int width = n + 1;
    double *factor = scratch, *u = factor + width * width, *to = u + width, *r = to + width;
    double *bound = r + width, *refused = bound + m;
    const columns e = {n, m, normal, bound};
    for (int i = 0; i < m; ++i) {
        double length = given[i] * given[i];
        for (int k = 0; k < n; ++k)
            length += normal[i * n + k] * normal[i * n + k];
        length = length > 0.0 ? 1.0 / sqrt(length) : 0.0;
        for (int k = 0; k < n; ++k)
            normal[i * n + k] *= length;
        bound[i] = given[i] * length;
        refused[i] = 0.0;
    }
    int count = 0;
    residual(&e, chosen, 0, u, r);
    for (int round = 0; round < ROUNDS * m; ++round) {
        int best = -1;
        double largest = ASCENT;
        for (int j = 0; j < m; ++j) {
            const double w = ascent(&e, j, r);
            if (w > largest && refused[j] == 0.0) {
                best = j;
                largest = w;
            }
        }
        if (best < 0 || count == width)
            break;
        chosen[count] = best;
        u[count++] = 0.0;
        if (descend(&e, chosen, &count, factor, u, to)) {
            for (int j = 0; j < m; ++j)
                refused[j] = 0.0;
        } else {
            int kept = 0;
            for (int i = 0; i < count; ++i)
                if (chosen[i] != best) {
                    chosen[kept] = chosen[i];
                    u[kept++] = u[i];
                }
            count = kept;
            refused[best] = 1.0;
        }
        residual(&e, chosen, count, u, r);
    }
    if (!(r[n] > LEAST_RESIDUAL * LEAST_RESIDUAL))
        return 0;
    for (int k = 0; k < n; ++k)
        z[k] = -r[k] / r[n];
    return 1;
}
