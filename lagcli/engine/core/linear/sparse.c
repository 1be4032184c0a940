#include "linear/sparse.h"

#include <math.h>
#include <string.h>

int lag_sparse_factor(const lag_pivots *order, int count, const double *matrix,
                      double *factors, double *w)
{
    const int n = order->n;
    const int32_t *start = order->start, *columns = order->columns, *diagonal = order->diagonal;
    memset(factors, 0, (size_t)start[n] * sizeof(double));
    for (int k = 0; k < count; ++k)
        factors[order->places[k]] += matrix[k];
    for (int i = 0; i < n; ++i) {
        const int first = start[i], pivot = diagonal[i], end = start[i + 1];
        for (int k = first; k < end; ++k)
            w[columns[k]] = factors[k];
        for (int k = first; k < pivot; ++k) {
            const int j = columns[k];
            const double factor = w[j] / factors[diagonal[j]];
            w[j] = factor;
            if (factor == 0.0)
                continue;
            for (int l = diagonal[j] + 1; l < start[j + 1]; ++l)
                w[columns[l]] -= factor * factors[l];
        }
        for (int k = first; k < end; ++k)
            factors[k] = w[columns[k]];
        if (!(fabs(factors[pivot]) > 0.0) || isinf(factors[pivot]))
            return 1;
    }
    return 0;
}

void lag_sparse_solve(const lag_pivots *order, const double *factors, double *x, double *w)
{
    const int n = order->n;
    const int32_t *start = order->start, *columns = order->columns, *diagonal = order->diagonal;
    for (int i = 0; i < n; ++i) {
        double sum = x[order->row[i]];
        for (int k = start[i]; k < diagonal[i]; ++k)
            sum -= factors[k] * w[columns[k]];
        w[i] = sum;
    }
    for (int i = n - 1; i >= 0; --i) {
        double sum = w[i];
        for (int k = diagonal[i] + 1; k < start[i + 1]; ++k)
            sum -= factors[k] * w[columns[k]];
        w[i] = sum / factors[diagonal[i]];
    }
    for (int i = 0; i < n; ++i)
        x[order->column[i]] = w[i];
}

int lag_sparse_factor_complex(const lag_pivots *order, int count, const double *re,
                              const double *im, double *fr, double *fi, double *work)
{
    const int n = order->n;
    const int32_t *start = order->start, *columns = order->columns, *diagonal = order->diagonal;
    double *wr = work, *wi = work + n;
    memset(fr, 0, (size_t)start[n] * sizeof(double));
    memset(fi, 0, (size_t)start[n] * sizeof(double));
    for (int k = 0; k < count; ++k) {
        fr[order->places[k]] += re[k];
        fi[order->places[k]] += im[k];
    }
    for (int i = 0; i < n; ++i) {
        const int first = start[i], pivot = diagonal[i], end = start[i + 1];
        for (int k = first; k < end; ++k) {
            wr[columns[k]] = fr[k];
            wi[columns[k]] = fi[k];
        }
        for (int k = first; k < pivot; ++k) {
            const int j = columns[k], d = diagonal[j];
            /* the diagonal contains the pivots' inverses */
            const double a = wr[j] * fr[d] - wi[j] * fi[d], b = wr[j] * fi[d] + wi[j] * fr[d];
            wr[j] = a;
            wi[j] = b;
            if (a == 0.0 && b == 0.0)
                continue;
            for (int l = d + 1; l < start[j + 1]; ++l) {
                wr[columns[l]] -= a * fr[l] - b * fi[l];
                wi[columns[l]] -= a * fi[l] + b * fr[l];
            }
        }
        for (int k = first; k < end; ++k) {
            fr[k] = wr[columns[k]];
            fi[k] = wi[columns[k]];
        }
        const double square = fr[pivot] * fr[pivot] + fi[pivot] * fi[pivot];
        if (!(square > 0.0) || isinf(square))
            return 1;
        fr[pivot] /= square;
        fi[pivot] /= -square;
    }
    return 0;
}

void lag_sparse_solve_complex(const lag_pivots *order, const double *fr, const double *fi,
                              double *xr, double *xi, double *work)
{
    const int n = order->n;
    const int32_t *start = order->start, *columns = order->columns, *diagonal = order->diagonal;
    double *wr = work, *wi = work + n;
    for (int i = 0; i < n; ++i) {
        double a = xr[order->row[i]], b = xi[order->row[i]];
        for (int k = start[i]; k < diagonal[i]; ++k) {
            const int j = columns[k];
            a -= fr[k] * wr[j] - fi[k] * wi[j];
            b -= fr[k] * wi[j] + fi[k] * wr[j];
        }
        wr[i] = a;
        wi[i] = b;
    }
    for (int i = n - 1; i >= 0; --i) {
        const int d = diagonal[i];
        double a = wr[i], b = wi[i];
        for (int k = d + 1; k < start[i + 1]; ++k) {
            const int j = columns[k];
            a -= fr[k] * wr[j] - fi[k] * wi[j];
            b -= fr[k] * wi[j] + fi[k] * wr[j];
        }
        wr[i] = a * fr[d] - b * fi[d];
        wi[i] = a * fi[d] + b * fr[d];
    }
    for (int i = 0; i < n; ++i) {
        xr[order->column[i]] = wr[i];
        xi[order->column[i]] = wi[i];
    }
}
