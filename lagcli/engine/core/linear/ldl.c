#include "linear/ldl.h"

/* The first row of a column of L: that of its pair's other pivot is not among them. */
static int first_row(const lag_elimination *f, int k)
{
    return k + 1 + f->paired[k];
}

static int equal(const int32_t *a, const int32_t *b, int count)
{
    for (int i = 0; i < count; ++i)
        if (a[i] != b[i])
            return 0;
    return 1;
}

/* Whether a column has exactly the rows of the one before, without its own. */
static int continues(const lag_elimination *f, int k)
{
    const int32_t *before = f->row + f->start[k - 1], *own = f->row + f->start[k];
    const int count = f->start[k + 1] - f->start[k];
    if (f->paired[k - 1]) /* pairs are not divided */
        return 1;
    int skipped = 1;
    if (f->paired[k]) /* its partner's row is not among its own */
        skipped = 2;
    if (f->start[k] - f->start[k - 1] != count + skipped || before[0] != k || before[skipped - 1] != k + skipped - 1)
        return 0;
    return equal(before + skipped, own, count);
}

int lag_ldl_closed(const lag_elimination *f)
{
    for (int k = 0; k < f->n; ++k) {
        const int32_t *row = f->row + f->start[k], *end = f->row + f->start[k + 1];
        for (const int32_t *one = row; one < end; ++one)
            if (*one < (one == row ? first_row(f, k) : one[-1] + 1) || *one >= f->n)
                return 0;
        if (f->paired[k] && (end - row != f->start[k + 2] - f->start[k + 1]
                             || !equal(row, end, (int)(end - row))))
            return 0;
        if (row == end)
            continue;
        /* what is left of it after its first row is part of that column */
        const int next = *row++;
        if (f->paired[next] && row < end && *row == next + 1)
            ++row;
        const int32_t *above = f->row + f->start[next], *last = f->row + f->start[next + 1];
        for (; row < end; ++row) {
            while (above < last && *above < *row)
                ++above;
            if (above == last || *above != *row)
                return 0;
        }
    }
    return 1;
}

/* The place of L's entry in a row of a column, or of D's where the row is that of its pivot. */
static int place(const lag_elimination *f, int k, int row, int after)
{
    const int n = f->n;
    if (row == k)
        return k;
    if (f->paired[k] && row == k + 1)
        return n + k;
    return 2 * n + after;
}

int lag_supernodes_of(lag_pool *pool, const lag_elimination *f, lag_supernodes *found)
{
    const int n = f->n;
    int32_t *first = lag_copy_integers(pool, NULL, n + 1);
    if (pool->failed)
        return 1;
    int count = 0, longest = 1, most = 1;
    int64_t updates = 0;
    for (int k = 0; k < n; ++k)
        if (!k || !continues(f, k))
            first[count++] = k;
    first[count] = n;
    for (int s = 0; s < count; ++s) {
        const int end = first[s + 1], below = f->start[end] - f->start[end - 1];
        updates += (int64_t)below * (below + 1) / 2;
        longest = end - first[s] > longest ? end - first[s] : longest;
        most = below > most ? below : most;
    }
    int32_t *target = lag_copy_integers(pool, NULL, updates);
    *found = (lag_supernodes){
        .count = count, .first = first, .target = target,
        .source = lag_get(pool, (size_t)longest, sizeof *found->source),
        .weight = lag_doubles(pool, longest),
        .column = lag_doubles(pool, most),
    };
    if (pool->failed)
        return 1;
    for (int s = 0; s < count; ++s) {
        const int last = first[s + 1] - 1;
        for (const int32_t *c = f->row + f->start[last], *end = f->row + f->start[last + 1]; c < end; ++c) {
            int e = f->start[*c];
            for (const int32_t *row = c; row < end; ++row) {
                while (e < f->start[*c + 1] && f->row[e] < *row) /* it is among them: the columns are closed */
                    ++e;
                *target++ = place(f, *c, *row, e);
            }
        }
    }
    return 0;
}

/* Update a column of a supernode by those before it. */
static void update_inside(const lag_elimination *f, const lag_supernodes *nodes, const lag_vector_kernel *vectors,
                          int k0, int k1, int pivot, int column, double *diagonal, double *beside, double *lower,
                          const double *product)
{
    const int following = first_row(f, column), below = f->start[k1] - f->start[k1 - 1];
    double d = diagonal[column], b = beside[column];
    for (int k = k0; k < pivot; ++k) {
        const int e = f->start[k] + column - first_row(f, k);
        const double x = product[e];
        d -= lower[e] * x;
        if (f->paired[column])
            b -= lower[e + 1] * x;
        nodes->source[k - k0] = lower + e + following - column;
        nodes->weight[k - k0] = x;
    }
    diagonal[column] = d;
    beside[column] = b;
    vectors->subtract(k1 - following + below, lower + f->start[column], pivot - k0, nodes->source, nodes->weight);
}

/* Update later columns by a single one. */
static void update_by_one(const lag_elimination *f, int k, const int32_t *target, double *factors,
                          const double *product)
{
    const double *from = factors + 2 * f->n + f->start[k], *times = product + f->start[k];
    const int below = f->start[k + 1] - f->start[k];
    for (int c = 0; c < below; ++c) {
        const double x = times[c];
        for (int i = c; i < below; ++i)
            factors[*target++] -= from[i] * x;
    }
}

/* Update later columns by those of a supernode. */
static void update_by_many(const lag_elimination *f, const lag_supernodes *nodes, const lag_vector_kernel *vectors,
                           int k0, int k1, const int32_t *target, double *factors, const double *product)
{
    double *lower = factors + 2 * f->n, *together = nodes->column;
    for (int n = f->start[k1] - f->start[k1 - 1]; n > 0; target += n--) {
        for (int k = k0; k < k1; ++k) {
            nodes->source[k - k0] = lower + f->start[k + 1] - n;
            nodes->weight[k - k0] = product[f->start[k + 1] - n];
        }
        for (int i = 0; i < n; ++i)
            together[i] = factors[target[i]];
        vectors->subtract(n, together, k1 - k0, nodes->source, nodes->weight);
        for (int i = 0; i < n; ++i)
            factors[target[i]] = together[i];
    }
}

/* Divide a column by its pivot. */
static void divide(const lag_elimination *f, int k, double *diagonal, double *lower, double *product)
{
    const double inverse = 1.0 / diagonal[k];
    for (int e = f->start[k]; e < f->start[k + 1]; ++e) {
        product[e] = lower[e];
        lower[e] = product[e] * inverse;
    }
    diagonal[k] = inverse;
}

/* The same for the two columns of a pair. */
static void divide_pair(const lag_elimination *f, int k, double *diagonal, double *beside, double *lower,
                        double *product)
{
    const double a = diagonal[k], b = beside[k], c = diagonal[k + 1];
    const double inverse = 1.0 / (a * c - b * b);
    const double ia = c * inverse, ib = -b * inverse, ic = a * inverse;
    const int shift = f->start[k + 1] - f->start[k];
    for (int e = f->start[k]; e < f->start[k + 1]; ++e) {
        product[e] = lower[e];
        product[e + shift] = lower[e + shift];
        lower[e] = product[e] * ia + product[e + shift] * ib;
        lower[e + shift] = product[e] * ib + product[e + shift] * ic;
    }
    diagonal[k] = ia;
    diagonal[k + 1] = ic;
    beside[k] = ib;
}

void lag_ldl_factor(const lag_elimination *f, const lag_supernodes *nodes, const lag_vector_kernel *vectors,
                    double *factors, double *product)
{
    double *diagonal = factors, *beside = factors + f->n, *lower = factors + 2 * f->n;
    const int32_t *target = nodes->target;
    for (int s = 0; s < nodes->count; ++s) {
        const int k0 = nodes->first[s], k1 = nodes->first[s + 1], below = f->start[k1] - f->start[k1 - 1];
        for (int k = k0; k < k1; k += 1 + f->paired[k]) {
            for (int p = 0; p <= f->paired[k] && k > k0; ++p)
                update_inside(f, nodes, vectors, k0, k1, k, k + p, diagonal, beside, lower, product);
            if (f->paired[k])
                divide_pair(f, k, diagonal, beside, lower, product);
            else
                divide(f, k, diagonal, lower, product);
        }
        if (k1 - k0 == 1)
            update_by_one(f, k0, target, factors, product);
        else
            update_by_many(f, nodes, vectors, k0, k1, target, factors, product);
        target += (int64_t)below * (below + 1) / 2;
    }
}

void lag_ldl_solve(const lag_elimination *f, const double *factors, double *z, double *x)
{
    const int n = f->n;
    const double *diagonal = factors, *beside = factors + n, *lower = factors + 2 * n;
    for (int k = 0; k < n; ++k)
        z[k] = x[f->order[k]];
    for (int k = 0; k < n; ++k) {
        const double y = z[k];
        for (int e = f->start[k]; e < f->start[k + 1]; ++e)
            z[f->row[e]] -= lower[e] * y;
    }
    for (int k = 0; k < n; ++k) {
        if (f->paired[k]) {
            const double one = z[k], other = z[k + 1];
            z[k] = diagonal[k] * one + beside[k] * other;
            z[k + 1] = beside[k] * one + diagonal[k + 1] * other;
            ++k;
        } else {
            z[k] *= diagonal[k];
        }
    }
    for (int k = n - 1; k >= 0; --k) {
        double sum = z[k];
        for (int e = f->start[k]; e < f->start[k + 1]; ++e)
            sum -= lower[e] * z[f->row[e]];
        z[k] = sum;
    }
    for (int k = 0; k < n; ++k)
        x[f->order[k]] = z[k];
}
