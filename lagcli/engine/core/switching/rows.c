#include "switching/rows.h"

#include <math.h>
#include <string.h>

#include "solution.h"

#define RANK 1e-10          /* of the largest pivot: rows below it are linearly dependent */
#define WAY 1e-6            /* of the duration of the run: gaps that may all be zero are as large as what a contact moves in it */

int lag_row_acts(const lag_switching *sw, int row)
{
    return sw->mode[row] != LAG_OPEN;
}

int lag_row_slips(const lag_switching *sw, int row)
{
    return sw->mode[row] == LAG_SLIPS_FORWARD ? 1 : sw->mode[row] == LAG_SLIPS_BACKWARD ? -1 : 0;
}

double lag_along(const lag_run *run, int row, const double *x)
{
    const int nq = run->system.nq;
    const double *b = run->switching.jacobian + row * nq;
    double sum = 0.0;
    for (int i = 0; i < nq; ++i)
        sum += b[i] * x[i];
    return sum;
}

int lag_find_rows(lag_run *run, double t, const double *y)
{
    lag_switching *sw = &run->switching;
    const lag_tape *f = &sw->functions;
    const int n = sw->rows, nq = run->system.nq, b = sw->nh, drift = b + sw->nb;
    double sum = 0.0;
    lag_evaluate(f, &run->system, t, y, LAG_ALL);
    for (int i = 0; i < sw->nb; ++i) {
        const int row = sw->row[i];
        sum += sw->jacobian[row * nq + sw->column[i]] = sw->sign[row] * OUT(f, b + i);
    }
    for (int i = 0; i < n; ++i) {
        sw->phi[i] = sw->place[i] < 0 ? 0.0 : sw->sign[i] * OUT(f, sw->place[i]);
        sw->drift[i] = sw->sign[i] * OUT(f, drift + i);
        sw->gamma[i] = sw->sign[i] * OUT(f, drift + n + i);
        sw->psi[i] = lag_along(run, i, y + nq) + sw->drift[i];
        sw->tried[i] = fmax(sw->tried[i], OUT(f, drift + 2 * n + i));
        sum += sw->phi[i] + sw->psi[i] + sw->gamma[i];
    }
    return !isfinite(sum);
}

int lag_measure_rows(lag_run *run, double t, const double *y)
{
    lag_switching *sw = &run->switching;
    const int speed = sw->nh + sw->nb + 2 * sw->rows, size = speed + sw->rows;
    double sum = 0.0;
    lag_evaluate(&sw->functions, &run->system, t, y, LAG_ALL);
    for (int i = 0; i < sw->rows; ++i) {
        sw->speed[i] = fmax(sw->speed[i], OUT(&sw->functions, speed + i));
        if (sw->place[i] < 0)
            continue;
        const double moved = WAY * (run->settings.t_end - run->step.t_start) * sw->speed[i];
        sw->size[i] = fmax(fmax(sw->size[i], OUT(&sw->functions, size + sw->place[i])), moved);
        sum += sw->active[i] ? OUT(&sw->functions, sw->place[i]) : 0.0;
    }
    return !isfinite(sum);
}

void lag_forget_speeds(lag_run *run)
{
    memset(run->switching.tried, 0, (size_t)run->switching.rows * sizeof(double));
}

void lag_keep_speeds(lag_run *run)
{
    lag_switching *sw = &run->switching;
    for (int i = 0; i < sw->rows; ++i)
        sw->speed[i] = fmax(sw->speed[i], sw->tried[i]);
}

const double *lag_row_response(lag_run *run, int k)
{
    lag_switching *sw = &run->switching;
    const int nq = run->system.nq;
    double *out = sw->response + k * (nq + run->system.nc), *direction = sw->direction;
    if (k < sw->rows) {
        lag_respond(run, sw->jacobian + k * nq, out);
        return out;
    }
    memset(direction, 0, (size_t)nq * sizeof(double));
    direction[sw->force_coordinate[k - sw->rows]] = 1.0;
    lag_respond(run, direction, out);
    return out;
}

void lag_evaluate_forces(const lag_run *run, const lag_tape *tape, double t, const double *y,
                         const double *a, const double *multipliers)
{
    const size_t nq = (size_t)run->system.nq, nc = (size_t)run->switching.nc;
    double *r = tape->registers;
    r[0] = t;
    memcpy(r + 1, y, 2 * nq * sizeof(double));
    memcpy(r + 1 + 2 * nq, a, nq * sizeof(double));
    memcpy(r + 1 + 3 * nq, multipliers, nc * sizeof(double));
    lag_tape_run(tape, &tape->stream);
}

void lag_gather_multipliers(const lag_run *run, const double *of_system, const double *z, double *out)
{
    const lag_switching *sw = &run->switching;
    for (int i = 0; i < run->system.nc; ++i)
        out[sw->base[i]] = of_system[i];
    for (int i = 0; i < sw->rows; ++i)
        out[sw->constraint[i]] = sw->sign[i] * z[i];
}

int lag_least_norm(int n, const double *matrix, const double *b, double *x, double *memory)
{
    double *left = memory, *lower = left + n * n, *square = lower + n * n; /* the last n by n at most */
    double *r = square + n * n, *u = r + n, *w = u + n, largest = 0.0;
    int rank = 0;
    memcpy(left, matrix, (size_t)n * n * sizeof(double));
    memset(lower, 0, (size_t)n * n * sizeof(double));
    for (int i = 0; i < n; ++i)
        w[i] = matrix[i * n + i]; /* what is left is compared with what there was, row by row */
    /* Cholesky's factors with pivots in place: column k of `lower` belongs to pivot k */
    while (rank < n) {
        int pivot = -1;
        largest = RANK;
        for (int i = 0; i < n; ++i)
            if (w[i] > 0.0 && left[i * n + i] > largest * w[i]) {
                largest = left[i * n + i] / w[i];
                pivot = i;
            }
        if (pivot < 0)
            break;
        const double root = sqrt(left[pivot * n + pivot]);
        for (int i = 0; i < n; ++i)
            lower[i * n + rank] = left[i * n + pivot] / root;
        for (int i = 0; i < n; ++i)
            for (int j = 0; j < n; ++j)
                left[i * n + j] -= lower[i * n + rank] * lower[j * n + rank];
        for (int i = 0; i < n; ++i)
            left[i * n + pivot] = left[pivot * n + i] = 0.0;
        ++rank;
    }
    /* A = L L', x = L (L'L)^-2 L' b; L'L is small, and its factors are found by the same rule */
    for (int i = 0; i < rank; ++i)
        for (int j = 0; j < rank; ++j) {
            double sum = 0.0;
            for (int k = 0; k < n; ++k)
                sum += lower[k * n + i] * lower[k * n + j];
            square[i * rank + j] = sum;
        }
    for (int i = 0; i < rank; ++i)
        for (int j = 0; j <= i; ++j) {
            double sum = square[i * rank + j];
            for (int k = 0; k < j; ++k)
                sum -= square[i * rank + k] * square[j * rank + k];
            square[i * rank + j] = i == j ? sqrt(sum) : sum / square[j * rank + j];
        }
    memset(x, 0, (size_t)n * sizeof(double));
    memcpy(r, b, (size_t)n * sizeof(double));
    for (int pass = 0; pass < 2; ++pass) { /* the second removes rounding */
        for (int i = 0; i < rank; ++i) {
            u[i] = 0.0;
            for (int k = 0; k < n; ++k)
                u[i] += lower[k * n + i] * r[k];
        }
        for (int twice = 0; twice < 2; ++twice) {
            for (int i = 0; i < rank; ++i) {
                for (int k = 0; k < i; ++k)
                    u[i] -= square[i * rank + k] * u[k];
                u[i] /= square[i * rank + i];
            }
            for (int i = rank - 1; i >= 0; --i) {
                for (int k = i + 1; k < rank; ++k)
                    u[i] -= square[k * rank + i] * u[k];
                u[i] /= square[i * rank + i];
            }
        }
        for (int k = 0; k < n; ++k)
            for (int i = 0; i < rank; ++i)
                x[k] += lower[k * n + i] * u[i];
        for (int k = 0; k < n; ++k) {
            r[k] = b[k];
            for (int j = 0; j < n; ++j)
                r[k] -= matrix[k * n + j] * x[j];
        }
    }
    return rank;
}
