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

int lag_supernodes_of(lag_pool *pool, const lag_elimination *f, lag_supernodes *found)
{
    const int n = f->n;
    int32_t *first = lag_copy_integers(pool, NULL, n + 1), *node = lag_copy_integers(pool, NULL, n);
    int32_t *begin = lag_copy_integers(pool, NULL, n + 1);
    if (pool->failed)
        return 1;
    int count = 0, longest = 1, most = 1, groups = 0;
    int64_t places = 0;
    for (int k = 0; k < n; ++k) {
        if (!k || !continues(f, k))
            first[count++] = k;
        node[k] = count - 1;
    }
    first[count] = n;
    for (int s = 0; s < count; ++s) {
        const int end = first[s + 1], below = f->start[end] - f->start[end - 1];
        const int32_t *row = f->row + f->start[end - 1];
        begin[s] = groups;
        for (int c = 0; c < below; ++c)
            if (!c || node[row[c]] != node[row[c - 1]]) {
                ++groups;
                places += below - c;
            }
        longest = end - first[s] > longest ? end - first[s] : longest;
        most = below > most ? below : most;
    }
    begin[count] = groups;
    int32_t *group = lag_copy_integers(pool, NULL, groups), *at = lag_copy_integers(pool, NULL, places);
    int64_t *place = lag_get(pool, (size_t)groups, sizeof *place);
    *found = (lag_supernodes){
        .count = count, .first = first, .begin = begin, .group = group, .place = place, .places = at,
        .source = lag_get(pool, (size_t)longest, sizeof *found->source),
        .weight = lag_doubles(pool, longest),
        .column = lag_doubles(pool, most),
    };
    if (pool->failed)
        return 1;
    groups = 0;
    places = 0;
    for (int s = 0; s < count; ++s) {
        const int end = first[s + 1], below = f->start[end] - f->start[end - 1];
        const int32_t *row = f->row + f->start[end - 1];
        for (int c = 0; c < below; ++c) {
            if (c && node[row[c]] == node[row[c - 1]])
                continue;
            const int from = first[node[row[c]]], to = first[node[row[c]] + 1];
            const int32_t *own = f->row + f->start[to - 1];
            group[groups] = c;
            place[groups++] = places;
            int beyond = 0;
            for (int i = c; i < below; ++i) {
                if (row[i] >= to)
                    while (own[beyond] < row[i]) /* it is among them: the columns are closed */
                        ++beyond;
                at[places++] = row[i] < to ? row[i] - from : to - from + beyond;
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

/* Update a later column by a supernode, whose rows below begin with `row` from that column on. */
static void update_later(const lag_elimination *f, const lag_supernodes *nodes, const lag_vector_kernel *vectors,
                         int k0, int k1, const int32_t *row, int count, const int32_t *at, int first,
                         double *diagonal, double *beside, double *lower, const double *product)
{
    const int column = *row, width = k1 - k0, pair = count > 1 && f->paired[column] && row[1] == column + 1;
    const int n = count - 1 - pair;
    double d = diagonal[column], b = beside[column];
    for (int k = k0; k < k1; ++k) {
        const int e = f->start[k + 1] - count;
        const double x = product[e];
        d -= lower[e] * x;
        if (pair)
            b -= lower[e + 1] * x;
        nodes->source[k - k0] = lower + e + 1 + pair;
        nodes->weight[k - k0] = x;
    }
    diagonal[column] = d;
    if (pair)
        beside[column] = b;
    if (!n)
        return;
    at += 1 + pair;
    double *target = lower + (f->start[column] - first_row(f, column) + first + at[0]);
    if (at[n - 1] - at[0] == n - 1) {
        vectors->subtract(n, target, width, nodes->source, nodes->weight);
    } else if (width < 3) {
        for (int k = 0; k < width; ++k) {
            const double x = nodes->weight[k], *from = nodes->source[k];
            for (int i = 0; i < n; ++i)
                target[at[i] - at[0]] -= from[i] * x;
        }
    } else {
        double *together = nodes->column;
        for (int i = 0; i < n; ++i)
            together[i] = target[at[i] - at[0]];
        vectors->subtract(n, together, width, nodes->source, nodes->weight);
        for (int i = 0; i < n; ++i)
            target[at[i] - at[0]] = together[i];
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
                    double *diagonal, double *beside, double *lower, double *product)
{
    for (int s = 0; s < nodes->count; ++s) {
        const int k0 = nodes->first[s], k1 = nodes->first[s + 1], below = f->start[k1] - f->start[k1 - 1];
        for (int k = k0; k < k1; k += 1 + f->paired[k]) {
            for (int p = 0; p <= f->paired[k]; ++p)
                update_inside(f, nodes, vectors, k0, k1, k, k + p, diagonal, beside, lower, product);
            if (f->paired[k])
                divide_pair(f, k, diagonal, beside, lower, product);
            else
                divide(f, k, diagonal, lower, product);
        }
        const int32_t *row = f->row + f->start[k1 - 1];
        for (int g = nodes->begin[s], c = 0; g < nodes->begin[s + 1]; ++g) {
            const int end = g + 1 < nodes->begin[s + 1] ? nodes->group[g + 1] : below;
            const int32_t *at = nodes->places + nodes->place[g];
            int from = row[c] - at[0]; /* the first column of the group's supernode */
            for (; c < end; ++c, ++at)
                update_later(f, nodes, vectors, k0, k1, row + c, below - c, at, from, diagonal, beside, lower,
                             product);
        }
    }
}

void lag_ldl_solve(const lag_elimination *f, const double *diagonal, const double *beside,
                   const double *lower, double *z, double *x)
{
    const int n = f->n;
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
