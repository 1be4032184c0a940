#include "project_system.h"

#include <math.h>
#include <string.h>

#include "solution.h"
#include "tape/vectors.h"

/* Raise the scales of phi to the least ones at y. Changes run->step.work beyond the right side, phi and its
 * scale. */
static void raise_scales(lag_run *run, double t, const double *y)
{
    const lag_system *s = &run->system;
    const lag_tape *d = &s->dynamics;
    double *own = run->step.work + 3 * s->nc, *square = own + s->nc, *compliance = square + s->nc;
    double size = 0.0;
    lag_evaluate(d, s, t, y, LAG_ALL);
    memset(own, 0, 2 * (size_t)s->nc * sizeof(double));
    for (int j = 0; j < s->nq; ++j) {
        const double mass = s->mass_diagonal[j] < 0 ? 0.0 : OUT(d, s->mass_diagonal[j]);
        compliance[j] = 0.0;
        compliance[s->unit[j]] = fmax(compliance[s->unit[j]], mass); /* the inertia, so far */
    }
    for (int j = s->nq - 1; j >= 0; --j) {
        const double inertia = compliance[s->unit[j]];
        size = fmax(size, inertia * y[j] * y[j]);
        compliance[j] = inertia > 0.0 ? 1.0 / inertia : 0.0;
    }
    for (int i = 0; i < s->nb; ++i) {
        const int row = s->jacobian_row[i], column = s->jacobian_column[i];
        const double b = OUT(d, lag_first_jacobian(s) + i);
        own[row] += fabs(b * y[column]);
        square[row] += b * b * compliance[column];
    }
    for (int i = 0; i < s->nh; ++i) {
        const int k = s->holonomic[i];
        const double least = fmax(own[k], LEAST_PART * sqrt(size) * sqrt(square[k]));
        if (least > run->projection.scale_position[i]) /* unless it is undefined */
            run->projection.scale_position[i] = least;
    }
}

double lag_position_residual(lag_run *run, double t, const double *y)
{
    const lag_system *s = &run->system;
    const lag_tape *c = &s->constraint;
    const lag_vector_kernel *vectors = s->vectors;
    double *residual = run->step.work, *scale = residual + s->nh;
    lag_evaluate(c, s, t, y, LAG_POSITIONS);
    vectors->pick(s->nh, c->registers, c->outputs, residual);
    vectors->pick(s->nh, c->registers, c->outputs + lag_constraint_position_scale(s), scale);
    return vectors->largest(s->nh, residual, scale, run->projection.scale_position);
}

/* Take the residuals of rows that are left out from those at the given places; return the largest over its scale. */
static double take_left_out(const lag_run *run, const int32_t *places, double *residual, const double *now,
                            const double *scale)
{
    double most = 0.0;
    for (int j = lag_left_out(run) - 1; j >= 0; --j) {
        const int i = places[j];
        if (i < 0)
            continue;
        most = fmax(most, fabs(residual[i]) / fmax(fmax(now[i], scale[i]), 1e-300));
        residual[i] = 0.0;
    }
    return most;
}

/* Project with the solution in use. LAG_OFF where a state on the other constraints violates those that are left out. */
static int project(lag_run *run, double t, double *y)
{
    const lag_system *s = &run->system;
    const lag_tape *c = &s->constraint;
    const int nq = s->nq, nc = s->nc, nh = s->nh;
    const int scale_position = lag_constraint_position_scale(s);
    const int scale_velocity = lag_constraint_velocity_scale(s);
    const int first_velocity = lag_constraint_velocity(s);
    const lag_vector_kernel *vectors = s->vectors;
    double *rhs = run->step.work, *residual = rhs + nc, *scale = residual + nc, *x = run->solver.a;
    double best = INFINITY, left = 0.0; /* of the rows that are left out */
    int met = 0;
    if (lag_factor(run, t, y))
        return LAG_UNDEFINED;
    for (int iteration = 0; iteration < PROJECTIONS; ++iteration) {
        lag_evaluate(c, s, t, y, LAG_POSITIONS);
        if (!isfinite(vectors->pick(nh, c->registers, c->outputs, residual)))
            return LAG_UNDEFINED;
        vectors->pick(nh, c->registers, c->outputs + scale_position, scale);
        left = take_left_out(run, run->rows.place_left_out, residual, scale, run->projection.scale_position);
        double worst = vectors->largest(nh, residual, scale, run->projection.scale_position);
        if (iteration == RAISE && worst > RESIDUAL) {
            raise_scales(run, t, y);
            worst = vectors->largest(nh, residual, scale, run->projection.scale_position);
        }
        met = worst <= RESIDUAL;
        if (best <= NOT_REACHED && worst >= 0.5 * best && !met) {
            /* rounding errors are reached: keep the better of the last two */
            if (worst > best)
                memcpy(y, run->step.trial, (size_t)nq * sizeof(double));
            met = 1;
        }
        if (met)
            break;
        best = worst;
        memcpy(run->step.trial, y, (size_t)nq * sizeof(double));
        memset(rhs, 0, (size_t)nc * sizeof(double));
        for (int i = 0; i < nh; ++i)
            rhs[s->holonomic[i]] = -residual[i];
        if (!isfinite(lag_correction(run, rhs, x)))
            return LAG_UNDEFINED;
        for (int i = 0; i < nq; ++i)
            y[i] += x[i];
    }
    if (!met || left > NOT_REACHED)
        return LAG_OFF;
    /* linear in the velocities: the second pass removes rounding, and the effect of the change of B since it was
     * factored */
    for (int iteration = 0; iteration < 2; ++iteration) {
        lag_evaluate(c, s, t, y, LAG_VELOCITIES);
        if (!isfinite(vectors->pick(nc, c->registers, c->outputs + first_velocity, residual)))
            return LAG_UNDEFINED;
        vectors->pick(nc, c->registers, c->outputs + scale_velocity, scale);
        left = take_left_out(run, run->rows.left_out, residual, scale, run->projection.scale_velocity);
        if (vectors->largest(nc, residual, scale, run->projection.scale_velocity) <= RESIDUAL)
            break;
        for (int i = 0; i < nc; ++i)
            rhs[i] = -residual[i];
        if (!isfinite(lag_correction(run, rhs, x)))
            return LAG_UNDEFINED;
        for (int i = 0; i < nq; ++i)
            y[nq + i] += x[i];
    }
    return left > LEFT_OUT ? LAG_OFF : LAG_RUNNING;
}

int lag_project_system(lag_run *run, double t, double *y)
{
    const lag_system *s = &run->system;
    if (s->nc == 0)
        return LAG_RUNNING;
    run->failure.t = t;
    memcpy(run->failure.y, y, (size_t)lag_size(s) * sizeof(double));
    int status = project(run, t, y);
    if (status == LAG_OFF && lag_left_out(run)) { /* they do not follow from the others here, or not by scales so far */
        const int64_t dense_steps = run->solver.dense_steps;
        memcpy(y, run->failure.y, (size_t)lag_size(s) * sizeof(double));
        run->solver.dense_steps = 1;
        status = project(run, t, y);
        run->solver.dense_steps = dense_steps;
    }
    return status;
}
