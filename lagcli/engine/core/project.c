#include "project.h"

#include <math.h>
#include <string.h>

#include "motion.h"


int lag_project(lag_run *run, double t, double *y)
{
    const lag_system *s = run->system;
    const lag_tape *c = &s->constraint;
    const int nq = s->nq, nc = s->nc, nh = s->nh;
    double *right = run->right, *x = run->a, best = INFINITY;
    int met = 0;
    if (nc == 0)
        return LAG_RUNNING;
    run->t_bad = t;
    memcpy(run->y_bad, y, (size_t)lag_size(s) * sizeof(double));
    lag_evaluate(&s->dynamics, s, t, y);
    if (lag_factor(run))
        return LAG_UNDEFINED;
    for (int iteration = 0; iteration < PROJECTIONS; ++iteration) {
        lag_evaluate(c, s, t, y);
        double worst = 0.0, sum = 0.0;
        for (int i = 0; i < nh; ++i) {
            const double phi = OUT(c, i), scale = OUT(c, nh + s->nb + nc + i);
            if (scale > run->scale_position[i])
                run->scale_position[i] = scale;
            const double part = fabs(phi) / fmax(run->scale_position[i], 1e-300);
            if (part > worst)
                worst = part;
            sum += phi;
        }
        if (!isfinite(sum))
            return LAG_UNDEFINED;
        met = worst <= RESIDUAL;
        if (best <= NOT_REACHED && worst >= 0.5 * best && !met) {
            /* rounding error is reached: the better of the last two */
            if (worst > best) {
                memcpy(y, run->trial, (size_t)nq * sizeof(double));
                lag_evaluate(c, s, t, y);
            }
            met = 1;
        }
        if (met)
            break;
        best = worst;
        memcpy(run->trial, y, (size_t)nq * sizeof(double));
        memset(right, 0, (size_t)(nq + nc) * sizeof(double));
        for (int i = 0; i < nh; ++i)
            right[nq + s->holonomic[i]] = -OUT(c, i);
        lag_solve(run, right, x, 0);
        for (int i = 0; i < nq; ++i)
            y[i] += x[i];
    }
    if (!met)
        return LAG_OFF;
    /* linear in the velocities: the second time removes rounding */
    for (int iteration = 0; iteration < 2; ++iteration) {
        met = 1;
        double *psi = right + nq;
        memset(right, 0, (size_t)nq * sizeof(double));
        lag_velocity_residual(s, y, psi);
        for (int i = 0; i < nc; ++i) {
            const double scale = OUT(c, nh + s->nb + nc + nh + i);
            if (scale > run->scale_velocity[i])
                run->scale_velocity[i] = scale;
            if (!(fabs(psi[i]) <= RESIDUAL * run->scale_velocity[i]))
                met = 0;
            psi[i] = -psi[i];
        }
        if (met)
            break;
        lag_solve(run, right, x, 0);
        for (int i = 0; i < nq; ++i)
            y[nq + i] += x[i];
    }
    return LAG_RUNNING;
}
