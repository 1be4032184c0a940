#include "switching/rows.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "solution.h"

#define RANK 1e-10          /* of the largest pivot: rows below it are linearly dependent */
#define INERT 1e-13 /* of the inverse inertia of a row without constraints: none */
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

void lag_along_each(const lag_run *run, int n, const int *rows, const double *x, double *out, int stride)
{
    const lag_switching *sw = &run->switching;
    const int nq = run->system.nq;
    int undefined = 0;
    for (int i = 0; i < nq; ++i)
        undefined |= !(fabs(x[i]) <= DBL_MAX);
    for (int k = 0; k < n; ++k) {
        const int row = rows[k];
        const double *b = sw->jacobian + row * nq;
        double sum = undefined ? NAN : 0.0;
        for (int e = sw->first_entry[row]; e < sw->first_entry[row + 1]; ++e) {
            const int i = sw->column[sw->entry[e]];
            sum += b[i] * x[i];
        }
        out[k * stride] = sum;
    }
}

int lag_find_rows(lag_run *run, double t, const double *y)
{
    lag_switching *sw = &run->switching;
    const lag_tape *f = &sw->functions;
    const int n = sw->rows, nq = run->system.nq, b = sw->nh, drift = b + sw->nb;
    double sum = 0.0;
    lag_evaluate(f, &run->system, t, y, LAG_ALL);
    memset(sw->psi, 0, (size_t)n * sizeof(double));
    for (int i = 0; i < sw->nb; ++i) {
        const int row = sw->row[i], column = sw->column[i];
        const double x = sw->jacobian[row * nq + column] = sw->sign[row] * OUT(f, b + i);
        sw->psi[row] += x * y[nq + column];
        sum += x;
    }
    for (int i = 0; i < n; ++i) {
        sw->phi[i] = sw->place[i] < 0 ? 0.0 : sw->sign[i] * OUT(f, sw->place[i]);
        sw->drift[i] = sw->sign[i] * OUT(f, drift + i);
        sw->gamma[i] = sw->sign[i] * OUT(f, drift + n + i);
        sw->psi[i] += sw->drift[i];
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

/* Whether nothing moves along a row, but for rounding errors: its inverse inertia is none of what it is without
 * constraints. Rows may have any units, so that others do not tell. */
static int is_inert(const lag_run *run, const double *along, const double *response)
{
    double entry = 0.0, whole = 0.0;
    for (int k = 0; k < run->system.nq; ++k) {
        entry += along[k] * response[k];
        whole += (along[k] * run->rows.sizes[k]) * (along[k] * run->rows.sizes[k]);
    }
    return entry <= INERT * whole;
}

const double *lag_row_response(lag_run *run, int k)
{
    lag_switching *sw = &run->switching;
    const int nq = run->system.nq;
    double *out = sw->response + k * (nq + run->system.nc), *direction = sw->direction;
    if (k < sw->rows) {
        lag_respond(run, sw->jacobian + k * nq, out);
        if (is_inert(run, sw->jacobian + k * nq, out))
            memset(out, 0, (size_t)nq * sizeof(double));
        return out;
    }
    memset(direction, 0, (size_t)nq * sizeof(double));
    direction[sw->force_coordinate[k - sw->rows]] = 1.0;
    lag_respond(run, direction, out);
    return out;
}

/* Pass t, q, v, a, lambda to a tape; returns where its next inputs are. */
static double *pass_forces(const lag_run *run, const lag_tape *tape, double t, const double *y, const double *a,
                           const double *multipliers)
{
    const size_t nq = (size_t)run->system.nq, nc = (size_t)run->switching.nc;
    double *r = tape->registers;
    r[0] = t;
    memcpy(r + 1, y, 2 * nq * sizeof(double));
    memcpy(r + 1 + 2 * nq, a, nq * sizeof(double));
    memcpy(r + 1 + 3 * nq, multipliers, nc * sizeof(double));
    return r + 1 + 3 * nq + nc;
}

void lag_evaluate_forces(const lag_run *run, const lag_tape *tape, double t, const double *y,
                         const double *a, const double *multipliers)
{
    pass_forces(run, tape, t, y, a, multipliers);
    lag_tape_run(tape, &tape->stream);
}

void lag_find_sides(const lag_run *run, double t, const double *y, const double *a, const double *multipliers)
{
    const lag_switching *sw = &run->switching;
    for (int s = 0; s < sw->signs; ++s)
        sw->found_side[s] = 1.0;
    for (int pass = 0, changed = 1; changed && pass <= sw->signs; ++pass) {
        double *side = pass_forces(run, &sw->sign_tape, t, y, a, multipliers);
        memcpy(side, sw->found_side, (size_t)sw->signs * sizeof(double));
        lag_tape_run(&sw->sign_tape, &sw->sign_tape.stream);
        changed = 0;
        for (int s = 0; s < sw->signs; ++s) {
            const double now = OUT(&sw->sign_tape, s) < 0.0 ? -1.0 : 1.0;
            changed |= now != sw->found_side[s];
            sw->found_side[s] = now;
        }
    }
}

void lag_evaluate_laws(const lag_run *run, const lag_tape *tape, double t, const double *y, const double *a,
                       const double *multipliers, enum lag_sides sides)
{
    const lag_switching *sw = &run->switching;
    const double *side = sw->side;
    if (sw->signs && !(sides == LAG_OF_STEP && sw->holds_sides)) {
        lag_find_sides(run, t, y, a, multipliers);
        side = sw->found_side;
    }
    memcpy(pass_forces(run, tape, t, y, a, multipliers), side, (size_t)sw->signs * sizeof(double));
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

/* Cholesky's factors of A with pivots in place: column k of `lower` belongs to row order[k]. What is left is compared
 * with what there was, row by row, as rows may have different units. Returns the rank. */
static int factor_semidefinite(int n, const double *matrix, double *left, double *lower, int *order)
{
    int rank = 0;
    memcpy(left, matrix, (size_t)n * n * sizeof(double));
    memset(lower, 0, (size_t)n * n * sizeof(double));
    while (rank < n) {
        int pivot = -1;
        double largest = RANK;
        for (int i = 0; i < n; ++i) {
            const double whole = matrix[i * n + i];
            if (whole > 0.0 && left[i * n + i] > largest * whole) {
                largest = left[i * n + i] / whole;
                pivot = i;
            }
        }
        if (pivot < 0)
            break;
        const double root = sqrt(left[pivot * n + pivot]);
        for (int i = 0; i < n; ++i)
            lower[i * n + rank] = left[i * n + pivot] / root;
        for (int i = 0; i < n; ++i) {
            const double x = lower[i * n + rank];
            for (int j = 0; x != 0.0 && j < n; ++j)
                left[i * n + j] -= x * lower[j * n + rank];
        }
        for (int i = 0; i < n; ++i)
            left[i * n + pivot] = left[pivot * n + i] = 0.0;
        order[rank++] = pivot;
    }
    return rank;
}

/* Add to x what takes away the residual r of the pivots' rows. */
static void solve_pivots(int n, int rank, const double *lower, const int *order, const double *r, double *u, double *x)
{
    for (int i = 0; i < rank; ++i) {
        u[i] = r[order[i]];
        for (int k = 0; k < i; ++k)
            u[i] -= lower[order[i] * n + k] * u[k];
        u[i] /= lower[order[i] * n + i];
    }
    for (int i = rank - 1; i >= 0; --i) {
        for (int k = i + 1; k < rank; ++k)
            u[i] -= lower[order[k] * n + i] * u[k];
        u[i] /= lower[order[i] * n + i];
        x[order[i]] += u[i];
    }
}

/* Take from z, n, its parts along `count` orthonormal vectors. */
static void take_along(int n, int count, const double *vectors, double *z)
{
    for (int e = 0; e < count; ++e) {
        double along = 0.0;
        for (int i = 0; i < n; ++i)
            along += z[i] * vectors[e * n + i];
        for (int i = 0; i < n; ++i)
            z[i] -= along * vectors[e * n + i];
    }
}

/* An orthonormal basis of the null space: row j that is no pivot, and what the pivots' rows do against it. */
static void null_vectors(int n, int rank, const double *lower, const int *order, double *vectors)
{
    int count = 0;
    for (int j = 0; j < n; ++j) {
        double *z = vectors + count * n, length = 0.0;
        int k = 0;
        while (k < rank && order[k] != j)
            ++k;
        if (k < rank)
            continue;
        memset(z, 0, (size_t)n * sizeof(double));
        z[j] = 1.0;
        for (int i = rank - 1; i >= 0; --i) {
            double sum = -lower[j * n + i];
            for (k = i + 1; k < rank; ++k)
                sum -= lower[order[k] * n + i] * z[order[k]];
            z[order[i]] = sum / lower[order[i] * n + i];
        }
        for (int pass = 0; pass < 2; ++pass) /* two passes are sufficient */
            take_along(n, count, vectors, z);
        for (int i = 0; i < n; ++i)
            length += z[i] * z[i];
        length = sqrt(length);
        for (int i = 0; i < n; ++i)
            z[i] /= length;
        ++count;
    }
}

int lag_least_norm(int n, const double *matrix, const double *b, double *x, double *memory)
{
    double *left = memory, *lower = left + n * n, *r = lower + n * n, *u = r + n;
    int *order = (int *)(u + n);
    const int rank = factor_semidefinite(n, matrix, left, lower, order);
    memset(x, 0, (size_t)n * sizeof(double));
    memcpy(r, b, (size_t)n * sizeof(double));
    for (int pass = 0; pass < 2; ++pass) { /* the second removes rounding */
        solve_pivots(n, rank, lower, order, r, u, x);
        for (int k = 0; k < n; ++k) {
            r[k] = b[k];
            for (int j = 0; j < n; ++j)
                r[k] -= matrix[k * n + j] * x[j];
        }
    }
    if (rank < n) {
        null_vectors(n, rank, lower, order, left);
        take_along(n, n - rank, left, x);
    }
    return rank;
}
