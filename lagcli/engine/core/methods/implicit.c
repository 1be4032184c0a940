#include "methods/implicit.h"

#include <math.h>
#include <string.h>

#include "motion.h"

#define BACKWARD_ERROR 1e-8 /* of a solution: beyond it, a new order of pivots is needed */
#define ORDERS 4            /* number of orders of pivots that one step may request */
#define ROUNDING 1e-15      /* of a solution: beyond it, the solution is refined */

/* Add a block times a vector to a vector. */
static void add_product(const lag_part_of_jacobian *block, const double *values, int nq, const double *x,
                        double *out)
{
    for (int i = 0; i < block->count; ++i)
        out[block->places[i] / nq] += values[block->first + i] * x[block->places[i] % nq];
}

int lag_linearize(lag_run *run, double t, const double *y, double *f)
{
    const lag_system *s = &run->system;
    lag_implicit *m = run->implicit;
    const lag_tape *d = &s->dynamics, *w = &m->variation, *e;
    const int nq = s->nq, nc = s->nc, nd = nc - run->rows.rank;
    if (lag_accelerate(run, t, y, 1, f + 2 * nq))
        return 1;
    memcpy(f, y + nq, (size_t)nq * sizeof(double));
    memcpy(f + nq, run->solver.a, (size_t)nq * sizeof(double));
    memcpy(m->velocity, y + nq, (size_t)nq * sizeof(double));
    e = lag_equations_tape(s);
    for (int i = 0; i < s->nm; ++i)
        m->mass[i] = OUT(e, i);
    for (int i = 0; i < s->nb; ++i)
        m->jacobian[i] = OUT(d, lag_first_jacobian(s) + i);
    for (int j = 0; j < nd; ++j)
        for (int i = 0; i < nc; ++i)
            m->border[j * nc + i] = lag_left_out(run) ? i == run->rows.left_out[j]
                                                      : run->rows.dependencies[j * nc + i] / run->rows.lengths[i];
    double *r = w->registers;
    r[0] = t;
    memcpy(r + lag_sample_q(s), y, 2 * (size_t)nq * sizeof(double));
    memcpy(r + lag_sample_a(s), run->solver.a, (size_t)nq * sizeof(double));
    memcpy(r + lag_sample_multipliers(s), run->solver.multipliers, (size_t)nc * sizeof(double));
    lag_tape_run(w, &w->stream);
    const int outputs = m->power_velocity.first + m->power_velocity.count + nq + nc + 1;
    for (int i = 0; i < outputs; ++i) {
        /* if a derivative does not exist (sqrt at 0), error control limits the effect */
        const double x = OUT(w, i);
        m->derivatives[i] = isfinite(x) ? x : 0.0;
    }
    m->shift = m->shift_re = m->shift_im = 0.0;
    return 0;
}

/* Add a part of the matrix; returns the next place. */
static const int32_t *add_part(double *matrix, const int32_t *place, int count,
                               const double *values, double factor)
{
    for (int i = 0; i < count; ++i)
        matrix[place[i]] += factor * values[i];
    return place + count;
}

/* The matrix for 1/s = a (+ i b) and 1/s^2 = aa (+ i bb); the imaginary part has no M, B, N. */
static void assemble(lag_run *run, double one, double a, double aa, double *matrix)
{
    const lag_system *s = &run->system;
    lag_implicit *m = run->implicit;
    const int nd = s->nc - run->rows.rank;
    const double *x = m->derivatives;
    const int32_t *p = m->parts;
    memset(matrix, 0, (size_t)m->count * sizeof(double));
    p = add_part(matrix, p, s->nm, m->mass, one);
    p = add_part(matrix, p, m->force_velocity.count, x + m->force_velocity.first, -a);
    p = add_part(matrix, p, m->force_position.count, x + m->force_position.first, -aa);
    p = add_part(matrix, p, s->nb, m->jacobian, one);
    p = add_part(matrix, p, s->nb, m->jacobian, one);
    p = add_part(matrix, p, m->rhs_velocity.count, x + m->rhs_velocity.first, -a);
    p = add_part(matrix, p, m->rhs_position.count, x + m->rhs_position.first, -aa);
    p = add_part(matrix, p, nd * s->nc, m->border, one);
    add_part(matrix, p, nd * s->nc, m->border, one);
}

/* F_t: of the forces, of B a = gamma, and of the power. */
static const double *rates_of(const lag_implicit *m)
{
    return m->derivatives + m->power_velocity.first + m->power_velocity.count;
}

int lag_depends_on_time(const lag_run *run)
{
    const double *rate = rates_of(run->implicit);
    for (int i = 0; i < run->system.nq + run->system.nc + 1; ++i)
        if (rate[i] != 0.0)
            return 1;
    return 0;
}

/* The right side over s, and what the solution then says; x holds M r_v + ... */
static void right_side(lag_run *run, const double *rv, const double *rq_over_s, double tau,
                       double *x)
{
    const lag_system *s = &run->system;
    const lag_implicit *m = run->implicit;
    const int nq = s->nq, nc = s->nc;
    const double *d = m->derivatives;
    const double *rate = rates_of(m);
    for (int i = 0; i < nq + nc; ++i)
        x[i] = tau * rate[i];
    for (int i = nq + nc; i < m->n; ++i)
        x[i] = 0.0;
    for (int i = 0; i < s->nm; ++i)
        x[s->mass_row[i]] += m->mass[i] * rv[s->mass_column[i]];
    for (int i = 0; i < s->nb; ++i)
        x[nq + s->jacobian_row[i]] += m->jacobian[i] * rv[s->jacobian_column[i]];
    add_product(&m->force_position, d, nq, rq_over_s, x);
    add_product(&m->rhs_position, d, nq, rq_over_s, x + nq);
}

/* The change of the power along (u_q, u_v) and mu = scale times what the solver returns. */
static double power_change(lag_run *run, const double *uq, const double *uv, const double *multipliers,
                           double scale)
{
    const lag_system *s = &run->system;
    const lag_implicit *m = run->implicit;
    double sum = 0.0, reaction = 0.0;
    add_product(&m->power_position, m->derivatives, s->nq, uq, &sum);
    add_product(&m->power_velocity, m->derivatives, s->nq, uv, &sum);
    for (int i = 0; i < s->nb; ++i)
        reaction += m->jacobian[i] * m->velocity[s->jacobian_column[i]]
                    * multipliers[s->jacobian_row[i]];
    return sum + scale * reaction;
}

/* right - matrix x in `residual`; returns the largest backward error of a row. */
static double residual(lag_implicit *m, const double *right, const double *x, double *out)
{
    double worst = 0.0;
    for (int i = 0; i < m->n; ++i) {
        double sum = right[i], size = fabs(sum);
        for (int k = m->start[i]; k < m->start[i + 1]; ++k) {
            const double part = m->matrix[k] * x[m->columns[k]];
            sum -= part;
            size += fabs(part);
        }
        out[i] = sum;
        if (!(fabs(sum) <= worst * size))
            worst = fabs(sum) / size;
    }
    return worst;
}

int lag_shift(lag_run *run, double s)
{
    lag_implicit *m = run->implicit;
    assemble(run, 1.0, 1.0 / s, 1.0 / (s * s), m->matrix);
    m->shift = 0.0;
    if (m->order.n == 0
        || lag_sparse_factor(&m->order, m->count, m->matrix, m->factors, m->work))
        return 1;
    /* the solution for a right side of ones, scaled by rows, checks the order of pivots */
    for (int i = 0; i < m->n; ++i) {
        double size = 0.0;
        for (int k = m->start[i]; k < m->start[i + 1]; ++k)
            size = fmax(size, fabs(m->matrix[k]));
        m->right[i] = m->right_im[i] = i % 3 == 1 ? -size : size;
    }
    lag_sparse_solve(&m->order, m->factors, m->right_im, m->work);
    const double error = residual(m, m->right, m->right_im, m->residual);
    if (!(error <= BACKWARD_ERROR))
        return 1;
    m->refine = error > ROUNDING;
    m->shift = s;
    return 0;
}

int lag_shift_complex(lag_run *run, double re, double im)
{
    lag_implicit *m = run->implicit;
    const double square = re * re + im * im, a = re / square, b = -im / square;
    double *matrix = m->matrix_re;
    m->shift_re = m->shift_im = 0.0;
    assemble(run, 1.0, a, a * a - b * b, matrix);
    assemble(run, 0.0, b, 2.0 * a * b, m->matrix_im);
    if (m->order.n == 0
        || lag_sparse_factor_complex(&m->order, m->count, matrix, m->matrix_im, m->complex_re,
                                     m->complex_im, m->work))
        return 1;
    m->shift_re = re;
    m->shift_im = im;
    return 0;
}

void lag_shifted_solve(lag_run *run, const double *r, double tau, double *u)
{
    lag_implicit *m = run->implicit;
    const int nq = run->system.nq, nc = run->system.nc;
    const double s = m->shift;
    double *x = m->right_im, rw = r[2 * nq];
    for (int i = 0; i < nq; ++i)
        m->quotient[i] = r[i] / s;
    right_side(run, r + nq, m->quotient, tau, m->right);
    for (int i = 0; i < m->n; ++i)
        x[i] = m->right[i] /= s;
    lag_sparse_solve(&m->order, m->factors, x, m->work);
    if (m->refine) {
        residual(m, m->right, x, m->residual);
        lag_sparse_solve(&m->order, m->factors, m->residual, m->work);
        for (int i = 0; i < m->n; ++i)
            x[i] += m->residual[i];
    }
    for (int i = 0; i < nq; ++i) {
        u[nq + i] = x[i];
        u[i] = m->quotient[i] + x[i] / s;
    }
    u[2 * nq] = (rw + power_change(run, u, u + nq, x + nq, -s) + tau * rates_of(m)[nq + nc]) / s;
}

void lag_shifted_noise(lag_run *run, const double *rates, double *change)
{
    lag_shifted_solve(run, rates, 0.0, change);
}

void lag_shifted_solve_complex(lag_run *run, double *re, double *im, double tau_re, double tau_im)
{
    lag_implicit *m = run->implicit;
    const int nq = run->system.nq;
    const double square = m->shift_re * m->shift_re + m->shift_im * m->shift_im;
    const double a = m->shift_re / square, b = -m->shift_im / square; /* 1/s */
    double *x = m->right, *y = m->right_im;
    for (int i = 0; i < nq; ++i) {
        const double p = re[i], q = im[i];
        re[i] = a * p - b * q;
        im[i] = a * q + b * p;
    }
    right_side(run, re + nq, re, tau_re, x);
    right_side(run, im + nq, im, tau_im, y);
    for (int i = 0; i < m->n; ++i) {
        const double p = x[i], q = y[i];
        x[i] = a * p - b * q;
        y[i] = a * q + b * p;
    }
    lag_sparse_solve_complex(&m->order, m->complex_re, m->complex_im, x, y, m->work);
    for (int i = 0; i < nq; ++i) {
        re[nq + i] = x[i];
        im[nq + i] = y[i];
        re[i] += a * x[i] - b * y[i];
        im[i] += a * y[i] + b * x[i];
    }
    const double rate = rates_of(m)[nq + run->system.nc];
    /* mu = -s times what the solver returns */
    const double p = power_change(run, re, re + nq, x + nq, -m->shift_re)
                     + power_change(run, m->zero, m->zero, y + nq, m->shift_im) + re[2 * nq] + tau_re * rate;
    const double q = power_change(run, im, im + nq, y + nq, -m->shift_re)
                     + power_change(run, m->zero, m->zero, x + nq, -m->shift_im) + im[2 * nq] + tau_im * rate;
    re[2 * nq] = a * p - b * q;
    im[2 * nq] = a * q + b * p;
}

int lag_reorder(lag_run *run)
{
    lag_implicit *m = run->implicit;
    if (m->ordered != run->step.steps)
        m->orders = 0;
    m->ordered = run->step.steps;
    return m->orders++ < ORDERS ? LAG_ORDER : LAG_RUNNING;
}
