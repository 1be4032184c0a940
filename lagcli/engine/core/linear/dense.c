#include "linear/dense.h"

#include <math.h>
#include <string.h>

int lag_lu(double *m, int *pivots, int n)
{
    for (int k = 0; k < n; ++k) {
        int best = k;
        double largest = fabs(m[k * n + k]);
        for (int i = k + 1; i < n; ++i) {
            const double x = fabs(m[i * n + k]);
            if (x > largest) {
                largest = x;
                best = i;
            }
        }
        pivots[k] = best;
        if (!(largest > 0.0))
            return 1; /* zero or NaN */
        double *row = m + k * n;
        if (best != k) {
            double *other = m + best * n;
            for (int j = 0; j < n; ++j) {
                const double x = row[j];
                row[j] = other[j];
                other[j] = x;
            }
        }
        const double inverse = 1.0 / row[k];
        for (int i = k + 1; i < n; ++i) {
            double *below = m + i * n;
            const double factor = below[k] * inverse;
            below[k] = factor;
            if (factor != 0.0) /* B's zeros remain zeros */
                for (int j = k + 1; j < n; ++j)
                    below[j] -= factor * row[j];
        }
    }
    return 0;
}

void lag_lu_solve(const double *lu, const int *pivots, int n, double *x)
{
    for (int k = 0; k < n; ++k) {
        const int p = pivots[k];
        const double t = x[p];
        x[p] = x[k];
        x[k] = t;
    }
    for (int i = 1; i < n; ++i) {
        double sum = x[i];
        const double *row = lu + i * n;
        for (int j = 0; j < i; ++j)
            sum -= row[j] * x[j];
        x[i] = sum;
    }
    for (int i = n - 1; i >= 0; --i) {
        double sum = x[i];
        const double *row = lu + i * n;
        for (int j = i + 1; j < n; ++j)
            sum -= row[j] * x[j];
        x[i] = sum / row[i];
    }
}

double lag_pivot(double *vectors, int size, int count, int rank, int *order, double *r)
{
    double length = 0.0;
    for (int j = 0; j < count; ++j)
        order[j] = j;
    for (int k = 0; k < rank; ++k) {
        int best = k;
        double largest = -1.0;
        for (int j = k; j < count; ++j) {
            double sum = 0.0;
            const double *v = vectors + j * size;
            for (int i = 0; i < size; ++i)
                sum += v[i] * v[i];
            if (sum > largest) {
                largest = sum;
                best = j;
            }
        }
        length = sqrt(largest);
        if (!(length > 0.0))
            return 0.0;
        double *pivot = vectors + k * size, *other = vectors + best * size;
        for (int i = 0; i < size; ++i) {
            const double x = other[i] / length;
            other[i] = pivot[i];
            pivot[i] = x;
        }
        const int number = order[best];
        order[best] = order[k];
        order[k] = number;
        for (int i = 0; i < k; ++i) {
            const double x = r[i * count + best];
            r[i * count + best] = r[i * count + k];
            r[i * count + k] = x;
        }
        r[k * count + k] = length;
        for (int j = k + 1; j < count; ++j) {
            double *v = vectors + j * size, sum = 0.0;
            for (int i = 0; i < size; ++i)
                sum += v[i] * pivot[i];
            for (int i = 0; i < size; ++i)
                v[i] -= sum * pivot[i];
            r[k * count + j] = sum;
        }
    }
    return length;
}

double lag_pivot_of_products(double *products, int count, int rank, int *order)
{
    double square = 0.0;
    for (int j = 0; j < count; ++j)
        order[j] = j;
    for (int k = 0; k < rank; ++k) {
        int place = k;
        square = 0.0;
        for (int m = k; m < count; ++m) { /* what is left is ascending */
            const double own = products[order[m] * count + order[m]];
            if (own > square) {
                square = own;
                place = m;
            }
        }
        if (!(square > 0.0))
            return 0.0;
        const int best = order[place];
        memmove(order + k + 1, order + k, (size_t)(place - k) * sizeof *order);
        order[k] = best;
        const double *pivot = products + best * count;
        for (int m = k + 1; m < count && k + 1 < rank; ++m) {
            if (pivot[order[m]] == 0.0)
                continue;
            double *row = products + order[m] * count;
            const double part = pivot[order[m]] / square;
            for (int i = 0; i < count; ++i)
                row[i] -= part * pivot[i];
        }
    }
    return sqrt(square);
}

int lag_solve_products(const double *products, int count, int rank, const int *order, double *x, double *work)
{
    double sum = 0.0;
    for (int k = 0; k < rank; ++k) { /* U' D^-1 U x, where row k of U is that of pivot k */
        sum = x[order[k]];
        for (int m = 0; m < k; ++m)
            sum -= products[order[m] * count + order[k]] * work[m];
        work[k] = sum / products[order[k] * count + order[k]];
    }
    for (int k = rank - 1; k >= 0; --k) {
        const double *row = products + order[k] * count;
        sum = work[k] * row[order[k]];
        for (int m = k + 1; m < rank; ++m)
            sum -= row[order[m]] * x[order[m]];
        x[order[k]] = sum / row[order[k]];
    }
    return !isfinite(sum);
}

void lag_dependencies(int count, int rank, const int *order, const double *r, double *out)
{
    for (int j = rank; j < count; ++j) {
        double *row = out + (j - rank) * count, sum = 1.0;
        for (int i = 0; i < count; ++i)
            row[i] = 0.0;
        row[order[j]] = 1.0;
        for (int k = rank - 1; k >= 0; --k) {
            double x = r[k * count + j];
            for (int i = k + 1; i < rank; ++i)
                x += r[k * count + i] * row[order[i]];
            row[order[k]] = -x / r[k * count + k];
            sum += row[order[k]] * row[order[k]];
        }
        for (int i = 0; i < count; ++i)
            row[i] /= sqrt(sum);
    }
}
