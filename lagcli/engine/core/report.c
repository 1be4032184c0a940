/* Access to a run between its steps. */
#include <math.h>
#include <string.h>

#include "methods/implicit.h"
#include "run.h"

const double *lag_matrix(const lag_run *run)
{
    return run->implicit->matrix;
}

int64_t lag_take(lag_run *run)
{
    const int64_t used = run->samples.used;
    run->samples.used = 0;
    return used;
}

void lag_move(lag_run *run, double t, const double *y, int64_t times_next)
{
    run->step.t = t;
    run->step.finishing = 0;
    memcpy(run->step.y, y, (2 * (size_t)run->system.nq + 1) * sizeof(double));
    run->samples.next = times_next;
}

void lag_report_of(const lag_run *run, lag_report *report)
{
    *report = (lag_report){
        .t_old = run->step.t_old, .t = run->step.t, .y = run->step.y,
        .atol = run->tolerances.atol, .lengths = run->rows.lengths,
        .steps = run->step.steps, .rejected = run->step.rejected,
        .evaluations = run->step.evaluations, .times_next = run->samples.next,
        .t_bad = run->failure.t, .y_bad = run->failure.y,
        .examined = run->watch.examined,
        .suspect_from = run->step.t_old + run->watch.suspect[0] * run->step.h_old,
        .suspect_to = run->step.t_old + run->watch.suspect[1] * run->step.h_old,
        .limiting = run->tolerances.limiting,
    };
}

int lag_coefficients(lag_run *run, double *out)
{
    const lag_series *series = &run->series;
    const int n = 2 * run->system.nq + 1, order = series->order;
    if (order == 0 || lag_series_expand(series, run->system.nq, run->step.t, run->step.y))
        return 1;
    for (int m = 0; m < n; ++m)
        for (int k = 0; k <= order; ++k)
            out[m * (order + 1) + k] = COEFFICIENT(series, m, k);
    return 0;
}
