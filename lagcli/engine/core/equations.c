#include "equations.h"

#include <math.h>
#include <string.h>

#include "switching/rows.h"
#include "tape/vectors.h"

/* The part of a residual that exceeds its rounding errors, which stabilization would amplify: with the short steps of
 * a start from rest, beta is large. */
static double beyond_rounding(double residual, double scale)
{
    const double floor = DAMPED * scale;
    return residual > floor ? residual - floor : residual < -floor ? residual + floor : 0.0 * residual;
}

/* The right side (f, gamma) at the state that the tapes hold, to run->solver.right; of the derivatives, what
 * stabilizes them alone. */
static void right_side(lag_run *run)
{
    const lag_system *s = &run->system;
    const lag_tape *d = &s->dynamics, *c = &s->constraint;
    const int nq = s->nq, nc = s->nc;
    double *right = run->solver.right;
    const lag_tape *e = lag_equations_tape(s);
    e->vectors->pick(nq, e->registers, e->outputs + lag_first_forcing(s), right);
    d->vectors->pick(nc, d->registers, d->outputs + lag_first_rhs(s), right + nq);
    if (!lag_stabilizes(run))
        return;
    const double alpha = run->baumgarte.alpha, beta = run->baumgarte.beta;
    const int psi = lag_constraint_velocity(s), psi_scale = lag_constraint_velocity_scale(s);
    const int scale = lag_constraint_position_scale(s);
    for (int i = 0; i < nc; ++i)
        right[nq + i] -= alpha * beyond_rounding(OUT(c, psi + i), OUT(c, psi_scale + i));
    for (int i = 0; i < s->nh; ++i) {
        const int k = s->holonomic[i];
        right[nq + k] -= alpha * beyond_rounding(OUT(c, psi + k), OUT(c, psi_scale + k))
                         + beta * beta * beyond_rounding(OUT(c, i), OUT(c, scale + i));
    }
}

/* Add f and gamma of the derivatives, which the tangent tape holds. */
static void add_derivatives_side(lag_run *run)
{
    const lag_system *s = &run->system;
    const lag_tape *w = &s->tangent;
    const int nq = s->nq / s->blocks, nc = s->nc / s->blocks;
    double *right = run->solver.right;
    for (int k = 1, i = 0; k < s->blocks; ++k) {
        for (int j = 0; j < nq; ++j)
            right[k * nq + j] += OUT(w, i++);
        for (int j = 0; j < nc; ++j)
            right[s->nq + k * nc + j] += OUT(w, i++);
    }
}

/* Evaluate f and gamma of the derivatives, for a and lambda of the motion in x. */
static void evaluate_tangent(const lag_system *s, double t, const double *y, const double *x)
{
    const int nq = s->nq, mq = nq / s->blocks, mc = s->nc / s->blocks;
    double *r = s->tangent.registers;
    r[0] = t;
    memcpy(r + 1, y, 2 * (size_t)nq * sizeof(double));
    memcpy(r + 1 + 2 * nq, x, (size_t)mq * sizeof(double));
    memcpy(r + 1 + 2 * nq + mq, x + nq, (size_t)mc * sizeof(double));
    lag_tape_run(&s->tangent, &s->tangent.stream);
}

/* The accelerations and multipliers of the derivatives, to x, with the last factors and those of the motion,
 * which are there. Returns a number that is finite if they are. */
static double accelerate_derivatives(lag_run *run, double t, const double *y, int refined, double *x)
{
    const lag_system *s = &run->system;
    const int nq = s->nq, nc = s->nc, mc = nc / s->blocks;
    double sum = 0.0;
    evaluate_tangent(s, t, y, x);
    if (lag_solving_by(run) == LAG_BY_TAPE && !refined && !lag_stabilizes(run))
        return lag_solve_tangent(run, x);
    right_side(run);
    add_derivatives_side(run);
    lag_turn(x + nq, mc);
    lag_solve_blocks(run, 1, s->blocks, run->solver.right, x, refined);
    lag_turn(x + nq, nc);
    for (int i = 0; i < nq + nc; ++i)
        sum += x[i];
    return sum;
}

int lag_accelerate_system(lag_run *run, double t, const double *y, int refined, double *power)
{
    const lag_system *s = &run->system;
    const lag_tape *d = &s->dynamics;
    const int nq = s->nq, nc = s->nc, n = nq + nc;
    double *x = run->solver.a; /* a, followed by lambda */
    int bad = 0;
    ++run->step.evaluations;
    if (s->blocks > 1)
        memset(x, 0, (size_t)n * sizeof(double)); /* the motion's are computed first */
    if (lag_stabilizes(run))
        lag_evaluate(&s->constraint, s, t, y, LAG_ALL);
    lag_evaluate(d, s, t, y, LAG_ALL);
    /* the unrolled tape computes a, lambda and their power, for its own right side */
    const int own = lag_solving_by(run) == LAG_BY_TAPE && !lag_stabilizes(run);
    bad = own ? !isfinite(d->vectors->pick(n, d->registers, d->outputs + lag_first_solution(s), x))
              : lag_factor(run, t, y);
    if (!bad && (refined || !own)) {
        right_side(run);
        if (own) {
            lag_turn(x + nq, nc);
            lag_refine(run, run->solver.right, x);
        } else {
            lag_solve_blocks(run, 0, 1, run->solver.right, x, refined);
        }
        lag_turn(x + nq, nc);
        double sum = 0.0;
        for (int i = 0; i < n; ++i)
            sum += x[i];
        bad = !isfinite(sum);
    }
    if (!bad && s->blocks > 1 && !(own && s->complete && !refined))
        bad = !isfinite(accelerate_derivatives(run, t, y, refined, x));
    if (bad)
        return lag_failed(run, t, y);
    if (run->solver.verifies && nc && lag_inaccuracy_of_last(run, t, y) > lag_allowed_inaccuracy(run)) {
        if (lag_allow_dense(run, 0))
            return 1;
        run->solver.dense_steps = 1;
        --run->step.evaluations;
        return lag_accelerate_system(run, t, y, 1, power);
    }
    if (own) {
        *power = OUT(d, lag_first_total_power(s));
        return 0;
    }
    double p = OUT(d, lag_first_power(s));
    for (int i = 0; i < s->nb / s->blocks; ++i) /* of the motion */
        p += x[nq + s->jacobian_row[i]] * OUT(d, lag_first_jacobian(s) + i)
             * y[nq + s->jacobian_column[i]];
    *power = p;
    return 0;
}

int lag_accelerate_on_branch(lag_run *run, double t, const double *y, int refined, double *power)
{
    if (lag_accelerate_system(run, t, y, refined, power))
        return 1;
    return run->switching.acting && lag_add_forces(run, t, y, power) ? lag_failed(run, t, y) : 0;
}

double lag_inaccuracy_of_last(lag_run *run, double t, const double *y)
{
    const lag_system *s = &run->system;
    const int nq = s->nq, n = nq + s->nc;
    double *r = run->step.work, *size = run->step.work + n, *x = run->solver.solution, all = 0.0;
    if (lag_solving_by(run) == LAG_BY_LU)
        return 0.0;
    right_side(run);
    if (s->blocks > 1) {
        if (s->complete)
            evaluate_tangent(s, t, y, run->solver.a);
        add_derivatives_side(run);
    }
    for (int i = 0; i < n; ++i)
        x[i] = i < nq ? run->solver.a[i] : -run->solver.a[i];
    lag_residual(run, run->solver.right, x, r, size);
    for (int j = lag_left_out(run) - 1; j >= 0; --j)
        r[nq + run->rows.left_out[j]] = 0.0; /* lag_contradiction is about these */
    for (int i = 0; i < n; ++i)
        all = size[i] > all ? size[i] : all;
    for (int i = 0; i < n; ++i)
        size[i] += NEXT_TO_ALL * all;
    const double most = run->system.vectors->largest(n, r, size, size);
    return isnan(most) ? INFINITY : most;
}

double lag_inaccuracy(lag_run *run, double t, const double *y, int refined)
{
    double power;
    if (lag_solving_by(run) == LAG_BY_LU || lag_accelerate_system(run, t, y, refined, &power))
        return 0.0;
    --run->step.evaluations;
    return lag_inaccuracy_of_last(run, t, y);
}

double lag_contradiction(lag_run *run, double t, const double *y)
{
    const lag_system *s = &run->system;
    const lag_tape *d = &s->dynamics;
    const int nq = s->nq, nc = s->nc, extra = nc - run->rows.rank;
    /* the unknowns besides a and lambda: the component of gamma along each dependency */
    const double *taken = run->solver.solution + nq + nc;
    double most = 0.0, terms = 0.0, power;
    if (!extra || lag_accelerate_system(run, t, y, 0, &power))
        return 0.0;
    --run->step.evaluations;
    if (lag_left_out(run)) {
        double *defect = run->step.work;
        for (int i = 0; i < nc; ++i)
            defect[i] = OUT(d, lag_first_rhs(s) + i);
        for (int i = 0; i < s->nb; ++i)
            defect[s->jacobian_row[i]] -= OUT(d, lag_first_jacobian(s) + i) * run->solver.a[s->jacobian_column[i]];
        for (int j = 0; j < extra; ++j) {
            const int i = run->rows.left_out[j];
            most = fmax(most, fabs(defect[i]) / run->rows.lengths[i]);
        }
    } else {
        for (int i = 0; i < nc; ++i) {
            double part = 0.0;
            for (int j = 0; j < extra; ++j)
                part += run->rows.dependencies[j * nc + i] * taken[j];
            most = fmax(most, fabs(part));
        }
    }
    for (int i = 0; i < nc; ++i)
        terms = fmax(terms, fabs(OUT(d, lag_first_rhs(s) + i)) / run->rows.lengths[i]);
    for (int i = 0; i < nq; ++i)
        terms = fmax(terms, fabs(run->solver.a[i]) / run->rows.sizes[i]);
    return terms > 0.0 ? most / terms : 0.0;
}

double lag_allowed_inaccuracy(const lag_run *run)
{
    return fmin(fmax(ACCURATE * run->settings.rtol, MOST_ACCURATE), LEAST_ACCURATE);
}

int lag_is_accurate(lag_run *run, double t, const double *y)
{
    return lag_inaccuracy(run, t, y, 0) <= lag_allowed_inaccuracy(run) || !lag_failed(run, t, y);
}

