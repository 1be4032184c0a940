#include "left_out.h"

#include <math.h>
#include <string.h>

#include "equations.h"
#include "linear/dense.h"
#include "watch.h"

#define ENOUGH 0.1          /* of all rows' least pivot: what the least singular value of those used must exceed */
#define LEAST_DEFECT 1e-10  /* of the terms of B a = gamma: allowed residual of rows that are left out: rtol, from this ... */

/*
 * Combine `count` rows of nc multipliers without forces so that each has an entry 1 where the others have 0 and its own
 * are not above, and let the given multipliers be 0 there. What least norm then adds to small ones has no cancellation.
 */
static void rest_on_long_rows(double *idle, int count, int nc, double *multipliers)
{
    for (int j = 0; j < count; ++j) {
        double *one = idle + j * nc, largest = 0.0;
        int at = 0;
        for (int i = 0; i < nc; ++i)
            if (fabs(one[i]) > largest) {
                largest = fabs(one[i]);
                at = i;
            }
        const double inverse = 1.0 / one[at], part = multipliers[at];
        for (int i = 0; i < nc; ++i) {
            one[i] *= inverse;
            multipliers[i] -= part * one[i];
        }
        multipliers[at] = 0.0;
        for (int k = 0; k < count; ++k) {
            double *other = idle + k * nc;
            const double factor = other[at];
            for (int i = 0; i < nc && k != j; ++i)
                other[i] -= factor * one[i];
            if (k != j)
                other[at] = 0.0;
        }
    }
}

int lag_share_multipliers(lag_run *run, double *multipliers)
{
    const lag_system *s = &run->system;
    const lag_tape *d = &s->dynamics;
    const int nq = s->nq, nc = s->nc, count = lag_left_out(run);
    double *force = run->step.trial, *x = run->solver.solution;
    for (int j = 0; j < count; ++j) {
        memset(force, 0, (size_t)nq * sizeof(double));
        for (int i = 0; i < s->nb; ++i)
            if (s->jacobian_row[i] == run->rows.left_out[j])
                force[s->jacobian_column[i]] = OUT(d, lag_first_jacobian(s) + i);
        lag_respond(run, force, x);
        memcpy(run->rows.dependencies + j * nc, x + nq, (size_t)nc * sizeof(double));
    }
    return lag_share_by_responses(run, multipliers);
}

int lag_share_by_responses(lag_run *run, double *multipliers)
{
    lag_rows *rows = &run->rows;
    const int nc = run->system.nc, count = lag_left_out(run);
    double *idle = rows->dependencies;
    for (int j = 0; j < count; ++j) {
        double *one = idle + j * nc;
        one[rows->left_out[j]] = 1.0;
        for (int i = 0; i < nc; ++i)
            if (!(fabs(one[i]) * rows->lengths[i] * ENOUGH <= rows->lengths[rows->left_out[j]]))
                return 1;
    }
    rest_on_long_rows(idle, count, nc, multipliers);
    lag_pivot(idle, nc, count, count, rows->order, rows->components);
    for (int j = 0; j < count; ++j) {
        const double *one = idle + j * nc;
        double sum = 0.0;
        for (int i = 0; i < nc; ++i)
            sum += one[i] * multipliers[i];
        for (int i = 0; i < nc; ++i)
            multipliers[i] -= sum * one[i];
    }
    return 0;
}

/* The least pivot of the rows that are not left out, which rows.scaled contains with the others. */
static double least_pivot_of_others(lag_run *run)
{
    lag_rows *rows = &run->rows;
    const int nq = run->system.nq, nc = run->system.nc, rank = rows->rank;
    for (int i = 0, j = 0; i < nc; ++i) /* those left out ascend */
        if (j < nc - rank && rows->left_out[j] == i)
            ++j;
        else if (j)
            memcpy(rows->scaled + (i - j) * nq, rows->scaled + i * nq, (size_t)nq * sizeof(double));
    return lag_pivot(rows->scaled, nq, rank, rank, rows->order, rows->components);
}

int lag_check_left_out(lag_run *run)
{
    const lag_system *s = &run->system;
    const lag_tape *c = &s->constraint;
    lag_rows *rows = &run->rows;
    if (!lag_left_out(run) || lag_many_rows(run) || rows->margin > 0.0)
        return 0;
    lag_evaluate(c, s, run->step.t, run->step.y, LAG_VELOCITIES);
    if (lag_scaled_rows(run, 1, c, lag_constraint_jacobian(s)))
        return 0;
    const double all = lag_pivot(rows->scaled, s->nq, s->nc, rows->rank, rows->order, rows->components);
    lag_scaled_rows(run, 1, c, lag_constraint_jacobian(s));
    rows->margin = CERTAIN * least_pivot_of_others(run) - ENOUGH * all;
    return rows->margin <= 0.0;
}

double lag_allowed_defect(const lag_settings *settings)
{
    return fmin(fmax(settings->rtol, LEAST_DEFECT), MOST_DEFECT);
}

int lag_overlooked(lag_run *run)
{
    return lag_left_out(run) && lag_contradiction(run, run->step.t, run->step.y) > lag_allowed_defect(&run->settings);
}

int lag_take_all_rows(lag_run *run, int64_t dense_steps)
{
    lag_rows *rows = &run->rows;
    run->solver.dense_steps = dense_steps;
    if (++rows->poor <= OFTEN)
        return 0;
    rows->poor = 0;
    return lag_failed(run, run->step.t, run->step.y);
}
