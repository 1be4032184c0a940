#include "switching/hold.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "project_system.h"
#include "solution.h"
#include "switching/rows.h"

#define HOLD_STEPS 10       /* Newton steps of a projection */
#define HOLD_RESIDUAL 4e-15 /* of the largest of B's entries times q: convergence */

/* The active rows, only those with a phi if `positions`. Returns their number. */
static int list(const lag_switching *sw, int positions, int *rows)
{
    int n = 0;
    for (int i = 0; i < sw->rows; ++i)
        if (sw->mode[i] == LAG_HOLDS && !(positions && sw->place[i] < 0))
            rows[n++] = i;
    return n;
}

/* Move x by the least change that takes away `residual` of the rows; B x' is what it is of the system's. */
static void correct(lag_run *run, int n, const int *rows, double *residual, double *x)
{
    lag_switching *sw = &run->switching;
    const int nq = run->system.nq;
    double *matrix = sw->matrix, *z = sw->work, *memory = z + sw->rows;
    for (int j = 0; j < n; ++j) {
        residual[j] = -residual[j];
        lag_along_each(run, n, rows, lag_row_response(run, rows[j]), matrix + j, n);
    }
    lag_least_norm(n, matrix, residual, z, memory);
    for (int j = 0; j < n; ++j)
        for (int i = 0; i < nq; ++i)
            x[i] += sw->response[rows[j] * (nq + run->system.nc) + i] * z[j];
}

/* The largest gap of rows next to the terms of phi: B's entries times q, or the largest so far. */
static double worst_gap(const lag_run *run, int n, const int *rows, const double *y, double *gap)
{
    const lag_switching *sw = &run->switching;
    const int nq = run->system.nq;
    double worst = 0.0;
    for (int i = 0; i < n; ++i) {
        double size = 0.0;
        for (int j = 0; j < nq; ++j)
            size += fabs(sw->jacobian[rows[i] * nq + j] * y[j]);
        gap[i] = sw->phi[rows[i]];
        worst = fmax(worst, fabs(gap[i]) - HOLD_RESIDUAL * size);
    }
    return worst;
}

/* Project the positions onto the active rows. */
static int hold_positions(lag_run *run, double t, double *y)
{
    lag_switching *sw = &run->switching;
    int *rows = sw->acts, status = LAG_RUNNING;
    double *gap = sw->values, before = INFINITY; /* longer than the number of rows */
    const int count = list(sw, 1, rows);
    for (int step = 0; count && step < HOLD_STEPS; ++step) {
        if (lag_find_rows(run, t, y))
            return LAG_UNDEFINED;
        const double worst = worst_gap(run, count, rows, y, gap);
        if (worst <= 0.0 || (step > 1 && worst >= 0.5 * before))
            break;
        before = worst;
        if (lag_factor(run, t, y))
            return LAG_UNDEFINED;
        correct(run, count, rows, gap, y);
        if (run->system.nc && (status = lag_project_system(run, t, y)) != LAG_RUNNING)
            return status;
    }
    return status;
}

int lag_hold(lag_run *run, double t, double *y)
{
    lag_switching *sw = &run->switching;
    const int nq = run->system.nq, n = lag_size(&run->system);
    int *rows = sw->acts;
    double *residual = sw->values;
    memcpy(sw->saved, y, (size_t)n * sizeof(double));
    const int status = hold_positions(run, t, y);
    if (status != LAG_RUNNING)
        return status;
    const int count = list(sw, 0, rows);
    for (int step = 0; count && step < 2; ++step) {
        double worst = 0.0;
        if (lag_find_rows(run, t, y) || lag_factor(run, t, y))
            return LAG_UNDEFINED;
        for (int i = 0; i < count; ++i) {
            residual[i] = sw->psi[rows[i]];
            worst = fmax(worst, fabs(residual[i]) - HOLD_RESIDUAL * sw->speed[rows[i]]);
        }
        if (worst <= 0.0)
            break;
        correct(run, count, rows, residual, y + nq);
    }
    run->failure.t = t;
    memcpy(run->failure.y, sw->saved, (size_t)n * sizeof(double));
    return LAG_RUNNING;
}
