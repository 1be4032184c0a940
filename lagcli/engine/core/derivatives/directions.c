/* Set-up and access of the derivatives of a run. */
#include <math.h>
#include <string.h>

#include "bind.h"
#include "derivatives/changes.h"
#include "motion.h"
#include "switching/rows.h"

int lag_use_directions(lag_run *run, const lag_directions *given)
{
    lag_derivatives *w = &run->derivatives;
    const lag_switching *sw = &run->switching;
    lag_pool *pool = &run->pool;
    const int nq = run->system.nq, n = run->system.carried / (2 * nq), size = nq + run->system.nc;
    const int all = sw->rows + sw->nf, conditions = sw->conditions + sw->force_conditions;
    const int watched = 2 * sw->rows + 2 + conditions + 2 * sw->kinks.count;
    w->n = w->live = n;
    w->np = given->parameters;
    w->p = lag_copy_doubles(pool, given->p, (int64_t)n * w->np);
    w->none = lag_doubles(pool, w->np);
    w->decides = lag_copy_integers(pool, given->decides, conditions);
    w->lost = lag_get(pool, (size_t)n, sizeof(int));
    w->lost_at = lag_doubles(pool, n);
    w->why = lag_get(pool, (size_t)n, sizeof *w->why);
    w->a = lag_doubles(pool, size);
    w->multipliers = lag_doubles(pool, sw->nc);
    w->z = lag_doubles(pool, all);
    w->lu = lag_scratch(pool, (size_t)all * all, sizeof(double));
    w->square = lag_scratch(pool, 6 * (size_t)all * all + 6 * (size_t)all, sizeof(double));
    w->pivots = lag_get(pool, (size_t)all, sizeof(int));
    w->acts = lag_get(pool, (size_t)all, sizeof(int));
    w->of_a = lag_doubles(pool, (n + INT64_C(1)) * size);
    w->of_z = lag_doubles(pool, (n + INT64_C(1)) * all);
    w->of_weight = lag_doubles(pool, n + 1);
    w->side = lag_doubles(pool, size + sw->nc + all + INT64_C(2) * ((n + INT64_C(2)) * (size + all) + n + 2));
    w->time = lag_doubles(pool, n);
    w->of_condition = lag_doubles(pool, (int64_t)conditions * n);
    w->left = lag_doubles(pool, INT64_C(2) * nq * n);
    w->now = lag_doubles(pool, nq);
    w->after = lag_doubles(pool, nq);
    w->compression = lag_doubles(pool, all);
    w->of_compression = lag_doubles(pool, (int64_t)n * all);
    w->impact_count = (int)given->impact.output_count;
    w->of_impact = lag_doubles(pool, (int64_t)n * w->impact_count);
    w->slopes = lag_doubles(pool, watched * (n + INT64_C(1)));
    w->directions = lag_get(pool, (size_t)n + 1, sizeof *w->directions);
    w->which = lag_get(pool, (size_t)n, sizeof(int));
    w->right = lag_doubles(pool, size);
    w->x = lag_doubles(pool, INT64_C(2) * size);
    w->row = lag_doubles(pool, INT64_C(8) * all);
    w->rested = -1;
    if (pool->failed)
        return 1;
    const lag_program *programs[] = {&given->dynamics, &given->constraint, &given->functions, &given->limits,
                                     &given->impact, &given->forces, &given->signs, &given->conditions,
                                     &given->force_conditions, &given->kinks, &given->kink_rates};
    lag_tape *tapes[] = {&w->dynamics, &w->constraint, &w->functions, &w->limits, &w->impact, &w->forces,
                         &w->signs, &w->conditions, &w->force_conditions, &w->kinks, &w->kink_rates};
    for (size_t i = 0; i < sizeof tapes / sizeof *tapes; ++i)
        if (lag_bind(run, pool, tapes[i], programs[i]))
            return 1;
    return 0;
}

lag_loss_report lag_loss_of(const lag_run *run, int k)
{
    const lag_derivatives *w = &run->derivatives;
    return (lag_loss_report){w->lost[k], w->why[k].reason, w->why[k].count, w->lost_at[k], w->why[k].what,
                             w->why[k].which};
}

int lag_read_changes(lag_run *run, double *of_state, double *of_parameters, double *of_forces)
{
    lag_derivatives *w = &run->derivatives;
    const int nq = run->system.nq, size = nq + run->system.nc, nc = run->switching.nc;
    const int all = run->switching.rows + run->switching.nf;
    double *y = run->step.y, power;
    memcpy(of_state, lag_change(run, y, 0), 2 * (size_t)(nq * w->n) * sizeof(double));
    memcpy(of_parameters, w->p, (size_t)(w->n * w->np) * sizeof(double));
    for (int k = 0; k < w->n; ++k)
        w->directions[k] = lag_direction_of(run, y, k, w->time[k]);
    if (lag_accelerate(run, run->step.t, y, 0, &power))
        return 1;
    lag_differentiate(run, run->step.t, y, w->n, w->directions); /* NaN where there are none */
    for (int k = 0; k < w->n; ++k) {
        double *out = of_forces + k * (nq + nc);
        memcpy(out, w->of_a + k * size, (size_t)nq * sizeof(double));
        lag_gather_multipliers(run, w->of_a + k * size + nq, w->of_z + k * all, out + nq);
    }
    return 0;
}

const double *lag_change_of_time(const lag_run *run, int condition)
{
    const lag_derivatives *w = &run->derivatives;
    return condition < 0 ? w->time : w->of_condition + condition * w->n;
}

void lag_set_changes(lag_run *run, const double *of_state, const double *of_parameters)
{
    lag_derivatives *w = &run->derivatives;
    const int nq = run->system.nq;
    memcpy(lag_change(run, run->step.y, 0), of_state, 2 * (size_t)(nq * w->n) * sizeof(double));
    memcpy(w->p, of_parameters, (size_t)(w->n * w->np) * sizeof(double));
    w->jumped = 1;
}
