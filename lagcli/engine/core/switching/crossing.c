#include "switching/crossing.h"

#include <math.h>
#include <string.h>

#include "linear/dense.h"
#include "roots.h"

#define DEGREE (NODES - 1)
#define RESOLVED 1e-9       /* of the largest value: the last coefficients of a resolved function */
#define NARROW 1e-10        /* of the interval: brackets with several roots are not halved further */
#define ESTIMATE 1e-15      /* of the interval: accuracy of a polynomial's root */

/* cos(k pi / 8) */
static double cosine(int k)
{
    static const double quarter[] = {1.0, 0.92387953251128676, 0.70710678118654752, 0.38268343236508977, 0.0};
    k %= 2 * DEGREE;
    k = k > DEGREE ? 2 * DEGREE - k : k;
    return k <= DEGREE / 2 ? quarter[k] : -quarter[DEGREE - k];
}

double lag_node(int k)
{
    return 0.5 - 0.5 * cosine(k);
}

void lag_bernstein_matrix(double *matrix)
{
    double values[NODES * NODES], column[NODES];
    int pivots[NODES];
    for (int i = 0; i < NODES; ++i) {
        const double x = lag_node(i);
        double binomial = 1.0;
        for (int k = 0; k < NODES; ++k) {
            values[i * NODES + k] = binomial * pow(x, k) * pow(1.0 - x, DEGREE - k);
            binomial *= (double)(DEGREE - k) / (k + 1);
        }
    }
    lag_lu(values, pivots, NODES);
    for (int j = 0; j < NODES; ++j) {
        memset(column, 0, sizeof column);
        column[j] = 1.0;
        lag_lu_solve(values, pivots, NODES, column);
        for (int i = 0; i < NODES; ++i)
            matrix[i * NODES + j] = column[i];
    }
}

int lag_resolved(const double *values)
{
    double last = 0.0, largest = 0.0;
    for (int m = DEGREE - 1; m <= DEGREE; ++m) {
        double sum = 0.0;
        for (int k = 0; k < NODES; ++k) {
            const double weight = k == 0 || k == DEGREE ? 0.5 : 1.0;
            sum += weight * values[k] * cosine(m * (DEGREE - k));
        }
        last = fmax(last, fabs(sum) / (m == DEGREE ? DEGREE : 0.5 * DEGREE));
    }
    for (int k = 0; k < NODES; ++k)
        largest = fmax(largest, fabs(values[k]));
    return last <= RESOLVED * largest;
}

/* Number of sign changes among coefficients; zeros have the preceding sign. */
static int changes(const double *b)
{
    int count = 0, before = 1;
    for (int i = 0; i < NODES; ++i) {
        const int now = b[i] > 0.0 ? 1 : b[i] < 0.0 ? -1 : before;
        count += now != before;
        before = now;
    }
    return count;
}

/* Halve a polynomial of Bernstein coefficients: de Casteljau. */
static void halve(const double *b, double *left, double *right)
{
    double work[NODES];
    memcpy(work, b, sizeof work);
    for (int i = 0; i < NODES; ++i) {
        left[i] = work[0];
        right[DEGREE - i] = work[DEGREE - i];
        for (int k = 0; k < DEGREE - i; ++k)
            work[k] = 0.5 * (work[k] + work[k + 1]);
    }
}

static int search(const double *b, double begin, double end, double from, double *low, double *high)
{
    double left[NODES], right[NODES];
    const int count = changes(b);
    if (end <= from || count == 0)
        return 0;
    if (b[0] < 0.0) { /* it is negative from a rounding error before this part on */
        *low = begin;
        *high = begin + 0.5 * fmin(end - begin, NARROW);
        if (*high > from)
            return 1;
        if (count <= 2 || end - begin < NARROW) /* it has been: now it may become positive, but not negative again */
            return 0;
    } else if ((count == 1 && begin >= from && b[DEGREE] < 0.0) || end - begin < NARROW) {
        *low = fmax(begin, from);
        *high = end;
        return 1;
    }
    const double middle = 0.5 * (begin + end);
    halve(b, left, right);
    if (search(left, begin, middle, from, low, high))
        return 1;
    /* zero at the middle, or rounded to less: the left part has not changed its sign before */
    return search(right, middle, end, from, low, high);
}

int lag_first_change(const double *bernstein, double from, double *low, double *high)
{
    double b[NODES];
    memcpy(b, bernstein, sizeof b);
    b[0] = fmax(b[0], 0.0);
    return search(b, 0.0, 1.0, from, low, high);
}

/* A polynomial at x. */
static double value_at(const double *b, double x)
{
    const double rest = 1.0 - x;
    double power = 1.0, binomial = 1.0, sum = b[0] * rest;
    for (int i = 1; i < DEGREE; ++i) {
        power *= x;
        binomial *= (double)(DEGREE - i + 1) / i;
        sum = (sum + power * binomial * b[i]) * rest;
    }
    return sum + power * x * b[DEGREE];
}

static double polynomial(void *context, double x)
{
    return value_at(*(const double **)context, x);
}

double lag_estimate_root(const double *b, double low, double high)
{
    const double before = value_at(b, low), after = value_at(b, high);
    if (!(before > 0.0) || !(after < 0.0))
        return 0.5 * (low + high);
    return lag_bracketed_root(polynomial, &b, low, high, before, after, ESTIMATE);
}
