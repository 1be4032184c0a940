#include "linear/ldl.h"

#include <string.h>

void lag_ldl_factor(const lag_elimination *f, double *diagonal, double *beside, double *lower,
                    double *product, double *work)
{
    const int n = f->n;
    int k = 0;
    memset(work, 0, 2 * (size_t)n * sizeof(double));
    while (k < n) {
        const int width = f->paired[k] ? 2 : 1;
        for (int p = 0; p < width; ++p) {
            /* the current column, reduced by the columns to the left */
            const int at = k + p;
            double *w = work + p * n;
            w[at] = diagonal[at];
            if (width == 2 && p == 0)
                w[k + 1] = beside[k];
            for (int e = f->start[at]; e < f->start[at + 1]; ++e)
                w[f->row[e]] = lower[e];
            for (int l = f->left_start[at]; l < f->left_start[at + 1]; ++l) {
                const int column = f->left_column[l], first = f->left_entry[l];
                const double x = product[first];
                for (int e = first; e < f->start[column + 1]; ++e)
                    w[f->row[e]] -= lower[e] * x;
            }
        }
        if (width == 1) {
            const double inverse = 1.0 / work[k];
            for (int e = f->start[k]; e < f->start[k + 1]; ++e) {
                product[e] = work[f->row[e]];
                lower[e] = product[e] * inverse;
                work[f->row[e]] = 0.0;
            }
            diagonal[k] = inverse;
            work[k] = 0.0;
        } else {
            double *one = work, *other = work + n;
            const double a = one[k], b = one[k + 1], c = other[k + 1];
            const double inverse = 1.0 / (a * c - b * b);
            const double ia = c * inverse, ib = -b * inverse, ic = a * inverse;
            const int shift = f->start[k + 1] - f->start[k];
            for (int e = f->start[k]; e < f->start[k + 1]; ++e) {
                const int row = f->row[e];
                product[e] = one[row];
                product[e + shift] = other[row];
                lower[e] = one[row] * ia + other[row] * ib;
                lower[e + shift] = one[row] * ib + other[row] * ic;
                one[row] = other[row] = 0.0;
            }
            diagonal[k] = ia;
            diagonal[k + 1] = ic;
            beside[k] = ib;
            one[k] = one[k + 1] = other[k] = other[k + 1] = 0.0;
        }
        k += width;
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
