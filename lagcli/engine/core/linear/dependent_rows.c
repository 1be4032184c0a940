#include "linear/dependent_rows.h"

#include <math.h>

#define SWEEPS 60           /* of rotations; some ten suffice */
#define ORTHOGONAL 1e-15    /* a product of rows, of their lengths */
#define NEGLIGIBLE 1e-3     /* length of a row that is not rotated any more, of that of one that is kept */

double lag_product(int n, const double *x, const double *y)
{
    double sum[4] = {0.0};
    int j = 0;
    for (; j + 4 <= n; j += 4)
        for (int k = 0; k < 4; ++k)
            sum[k] += x[j + k] * y[j + k];
    for (; j < n; ++j)
        sum[0] += x[j] * y[j];
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

int lag_orthogonalize(double least, int m, int n, double *a, double *length)
{
    int rank = 0;
    for (; rank < m && rank < n; ++rank) {
        int next = -1;
        double largest = least, rest = 0.0;
        for (int i = 0; i < m; ++i) {
            if (!(length[i] > 0.0))
                continue;
            const double square = lag_product(n, a + i * n, a + i * n);
            if (sqrt(square) > largest * length[i]) {
                next = i;
                rest = sqrt(square);
                largest = rest / length[i];
            }
        }
        if (next < 0)
            break;
        double *row = a + next * n;
        length[next] = 0.0; /* done */
        for (int j = 0; j < n; ++j)
            row[j] /= rest;
        for (int i = 0; i < m; ++i) {
            if (!(length[i] > 0.0))
                continue;
            for (int pass = 0; pass < 2; ++pass) { /* the second one removes rounding */
                const double product = lag_product(n, row, a + i * n);
                for (int j = 0; j < n; ++j)
                    a[i * n + j] -= product * row[j];
            }
        }
    }
    return rank;
}

/* Rotate x and y, of n entries. */
static void rotate(double c, double s, int n, double *x, double *y)
{
    for (int j = 0; j < n; ++j) {
        const double of_x = x[j];
        x[j] = c * of_x - s * y[j];
        y[j] = s * of_x + c * y[j];
    }
}

static void swap(int n, double *x, double *y)
{
    for (int j = 0; j < n; ++j) {
        const double of_x = x[j];
        x[j] = y[j];
        y[j] = of_x;
    }
}

int lag_combine(double least, int m, int n, double *a, int k, double *with, double *square)
{
    const double nothing = NEGLIGIBLE * least * (NEGLIGIBLE * least); /* such rows are rounding errors of the others */
    int rank = 0, turned = 1;
    for (int sweep = 0; sweep < SWEEPS && turned; ++sweep) {
        turned = 0;
        for (int i = 0; i < m; ++i)
            square[i] = lag_product(n, a + i * n, a + i * n);
        for (int i = 0; i < m; ++i)
            for (int l = i + 1; l < m && square[i] > nothing; ++l) {
                double *x = a + i * n, *y = a + l * n;
                if (!(square[l] > nothing))
                    continue;
                const double xy = lag_product(n, x, y);
                if (!(fabs(xy) > ORTHOGONAL * sqrt(square[i] * square[l])))
                    continue;
                const double ratio = (square[l] - square[i]) / (2.0 * xy);
                const double tangent = copysign(1.0, ratio) / (fabs(ratio) + sqrt(1.0 + ratio * ratio));
                const double c = 1.0 / sqrt(1.0 + tangent * tangent), s = c * tangent;
                rotate(c, s, n, x, y);
                rotate(c, s, k, with + i * k, with + l * k);
                square[i] = fmax(square[i] - tangent * xy, 0.0);
                square[l] += tangent * xy;
                turned = 1;
            }
    }
    for (int i = 0; i < m; ++i)
        if (sqrt(lag_product(n, a + i * n, a + i * n)) > least) {
            swap(n, a + rank * n, a + i * n);
            swap(k, with + rank * k, with + i * k);
            ++rank;
        }
    return rank;
}
