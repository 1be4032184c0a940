#include "project.h"

#include <math.h>
#include <string.h>

#include "motion.h"
#include "vectors.h"


int lag_project(lag_run *run, double t, double *y)
{
    const lag_system *s = run->system;
    const lag_tape *c = &s->constraint;
    const int nq = s->nq, nc = s->nc, nh = s->nh;
    const int scale_position = nh + s->nb + nc;
    const int scale_velocity = scale_position + nh, first_velocity = lag_first_velocity(s);
    const lag_vector_kernel *vectors = lag_vectors();
    double *rhs = run->work, *residual = rhs + nc, *scale = residual + nc, *x = run->a;
    double best = INFINITY;
    int met = 0;
    if (nc == 0)
        return LAG_RUNNING;
    run->t_bad = t;
    memcpy(run->y_bad, y, (size_t)lag_size(s) * sizeof(double));
    if (lag_factor(run, t, y))
        return LAG_UNDEFINED;
    for (int iteration = 0; iteration < PROJECTIONS; ++iteration) {
        lag_evaluate(c, s, t, y, LAG_POSITIONS);
        if (!isfinite(vectors->pick(nh, c->registers, c->outputs, residual)))
            return LAG_UNDEFINED;
        vectors->pick(nh, c->registers, c->outputs + scale_position, scale);
        const double worst = vectors->largest(nh, residual, scale, run->scale_position);
        met = worst <= RESIDUAL;
        if (best <= NOT_REACHED && worst >= 0.5 * best && !met) {
            /* rounding error is reached: the better of the last two */
            if (worst > best)
                memcpy(y, run->trial, (size_t)nq * sizeof(double));
            met = 1;
        }
        if (met)
            break;
        best = worst;
        memcpy(run->trial, y, (size_t)nq * sizeof(double));
        memset(rhs, 0, (size_t)nc * sizeof(double));
        for (int i = 0; i < nh; ++i)
            rhs[s->holonomic[i]] = -residual[i];
        if (!isfinite(lag_correction(run, rhs, x)))
            return LAG_UNDEFINED;
        for (int i = 0; i < nq; ++i)
            y[i] += x[i];
    }
    if (!met)
        return LAG_OFF;
    /* linear in the velocities: the second time removes rounding, and what B has turned by since it
     * was factored */
    for (int iteration = 0; iteration < 2; ++iteration) {
        lag_evaluate(c, s, t, y, LAG_VELOCITIES);
        if (!isfinite(vectors->pick(nc, c->registers, c->outputs + first_velocity, residual)))
            return LAG_UNDEFINED;
        vectors->pick(nc, c->registers, c->outputs + scale_velocity, scale);
        if (vectors->largest(nc, residual, scale, run->scale_velocity) <= RESIDUAL)
            break;
        for (int i = 0; i < nc; ++i)
            rhs[i] = -residual[i];
        if (!isfinite(lag_correction(run, rhs, x)))
            return LAG_UNDEFINED;
        for (int i = 0; i < nq; ++i)
            y[nq + i] += x[i];
    }
    return LAG_RUNNING;
}
