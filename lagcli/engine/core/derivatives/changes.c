#include "derivatives/changes.h"

#include <math.h>
#include <string.h>

#include "linear/dense.h"
#include "equations.h"
#include "switching/kinks.h"
#include "switching/rows.h"

#define SINGULAR 1e-11      /* of the largest pivot: rows that depend on each other */
#define EQUILIBRATIONS 4
#define LOOSE 1e-6          /* of a unit force: a share in forces that are not unique */

double *lag_change(const lag_run *run, double *y, int k)
{
    const int nq = run->system.nq;
    return y + 2 * nq + 1 + 2 * nq * k;
}

lag_direction lag_direction_of(const lag_run *run, const double *y, int k, double time)
{
    const int nq = run->system.nq;
    const double *q = y + 2 * nq + 1 + 2 * nq * k;
    return (lag_direction){time, q, q + nq, run->derivatives.p + k * run->derivatives.np};
}

/* Copy numbers and return where the next ones go. */
static double *put(double *to, const double *from, int count)
{
    if (count)
        memcpy(to, from, (size_t)count * sizeof(double));
    return to + count;
}

void lag_evaluate_along(const lag_run *run, const lag_tape *tape, double t, const double *y, lag_direction d)
{
    const int nq = run->system.nq;
    double *r = tape->registers;
    *r++ = t;
    r = put(r, y, 2 * nq);
    *r++ = d.t;
    r = put(r, d.q, nq);
    r = put(r, d.v, nq);
    put(r, d.p, run->derivatives.np);
    lag_tape_run(tape, &tape->stream);
}

void lag_evaluate_laws_along(const lag_run *run, const lag_tape *tape, double t, const double *y, lag_direction d,
                             const double *of_a, const double *of_z)
{
    const lag_derivatives *w = &run->derivatives;
    const lag_switching *sw = &run->switching;
    const int nq = run->system.nq, nc = sw->nc, signs = sw->signs;
    double *r = tape->registers;
    if (signs && !sw->holds_sides)
        lag_find_sides(run, t, y, w->a, w->multipliers);
    *r++ = t;
    r = put(r, y, 2 * nq);
    r = put(r, w->a, nq);
    r = put(r, w->multipliers, nc);
    r = put(r, sw->holds_sides ? sw->side : sw->found_side, signs);
    *r++ = d.t;
    r = put(r, d.q, nq);
    r = put(r, d.v, nq);
    r = put(r, of_a, nq);
    lag_gather_multipliers(run, of_a + nq, of_z, r);
    memset(r + nc, 0, (size_t)signs * sizeof(double));
    put(r + nc + signs, d.p, w->np);
    lag_tape_run(tape, &tape->stream);
}

/* Divide rows and columns, which may have any units, so that their largest entries are about 1: what multiplies them to
 * `scale`, that of the rows first. */
static void equilibrate(int n, double *matrix, double *scale)
{
    for (int i = 0; i < 2 * n; ++i)
        scale[i] = 1.0;
    for (int round = 0; round < EQUILIBRATIONS; ++round)
        for (int k = 0; k < 2 * n; ++k) {
            const int first = k < n ? k * n : k - n, step = k < n ? 1 : n;
            double largest = 0.0;
            for (int i = 0; i < n; ++i)
                largest = fmax(largest, fabs(matrix[first + i * step]));
            if (!(largest > 0.0) || !isfinite(largest))
                continue;
            const double factor = 1.0 / sqrt(largest);
            scale[k] *= factor;
            for (int i = 0; i < n; ++i)
                matrix[first + i * step] *= factor;
        }
}

void lag_solve_square(int n, const double *given, int *pivots, double *right, double *memory)
{
    double *matrix = memory, *lu = matrix + n * n, *square = lu + n * n, *x = square + n * n, *scale = x + n;
    double *rest = scale + 2 * n, least = INFINITY, largest = 0.0;
    memcpy(matrix, given, (size_t)n * n * sizeof(double));
    equilibrate(n, matrix, scale);
    for (int i = 0; i < n; ++i)
        right[i] *= scale[i];
    memcpy(lu, matrix, (size_t)n * n * sizeof(double));
    const int singular = lag_lu(lu, pivots, n);
    for (int i = 0; i < n && !singular; ++i) {
        least = fmin(least, fabs(lu[i * n + i]));
        largest = fmax(largest, fabs(lu[i * n + i]));
    }
    if (!singular && least > SINGULAR * largest)
        lag_lu_solve(lu, pivots, n, right);
    else {
        for (int i = 0; i < n; ++i)
            for (int j = 0; j < n; ++j) {
                square[i * n + j] = 0.0;
                for (int k = 0; k < n; ++k)
                    square[i * n + j] += matrix[i * n + k] * matrix[j * n + k];
            }
        lag_least_norm(n, square, right, x, rest);
        for (int j = 0; j < n; ++j) {
            right[j] = 0.0;
            for (int i = 0; i < n; ++i)
                right[j] += matrix[i * n + j] * x[i];
        }
    }
    for (int j = 0; j < n; ++j)
        right[j] *= scale[n + j];
}

static const double *response_of(const lag_run *run, int k)
{
    return run->switching.response + k * (run->system.nq + run->system.nc);
}

/* Take over the motion's a, lambda and z, the forces that act, and the matrix of their laws. */
static void take_motion(lag_run *run, double t, const double *y)
{
    lag_derivatives *w = &run->derivatives;
    const lag_switching *sw = &run->switching;
    const int all = sw->rows + sw->nf, size = run->system.nq + run->system.nc;
    memcpy(w->a, run->solver.a, (size_t)size * sizeof(double));
    memset(w->z, 0, (size_t)all * sizeof(double));
    w->acting = w->redundant = 0;
    if (sw->acting) {
        for (int k = 0; k < all; ++k)
            if (k >= sw->rows || lag_row_acts(sw, k)) {
                w->acts[w->acting++] = k;
                w->z[k] = sw->force[k];
            }
        w->redundant = sw->redundant;
    }
    lag_gather_multipliers(run, w->a + run->system.nq, w->z, w->multipliers);
    if (w->acting)
        lag_laws_matrix(run, t, y, w->a, w->multipliers, w->acting, w->acts, w->lu);
}

/* The changes along one direction on the current branches: to x (a and lambda of the system) and z. */
static double differentiate_once(lag_run *run, double t, const double *y, lag_direction d, double *x, double *z)
{
    lag_derivatives *w = &run->derivatives;
    const lag_system *s = &run->system;
    const lag_switching *sw = &run->switching;
    const lag_tape *e = &w->dynamics, *g = &w->functions;
    const int nq = s->nq, nc = s->nc, all = sw->rows + sw->nf, n = w->acting;
    const double *a = w->a, *multipliers = a + nq;
    double *right = run->solver.right, *of_row = w->row, sum = 0.0;
    lag_evaluate_along(run, e, t, y, d);
    const int jacobian = s->nm + nq, rhs = jacobian + s->nb;
    for (int i = 0; i < nq; ++i)
        right[i] = OUT(e, s->nm + i);
    for (int i = 0; i < nc; ++i)
        right[nq + i] = OUT(e, rhs + i);
    for (int m = 0; m < s->nm; ++m)
        right[s->mass_row[m]] -= OUT(e, m) * a[s->mass_column[m]];
    for (int b = 0; b < s->nb; ++b) {
        const int row = s->jacobian_row[b], column = s->jacobian_column[b];
        right[column] += OUT(e, jacobian + b) * multipliers[row];
        right[nq + row] -= OUT(e, jacobian + b) * a[column];
    }
    memset(z, 0, (size_t)all * sizeof(double));
    if (n && sw->rows) {
        lag_evaluate_along(run, g, t, y, d);
        for (int i = 0; i < sw->rows; ++i)
            of_row[i] = sw->sign[i] * OUT(g, sw->nh + sw->nb + sw->rows + i);
        for (int b = 0; b < sw->nb; ++b) {
            const int row = sw->row[b], column = sw->column[b];
            const double change = sw->sign[row] * OUT(g, sw->nh + b);
            right[column] += change * w->z[row];
            of_row[row] -= change * a[column];
        }
    }
    lag_solve(run, right, x, 0);
    lag_turn(x + nq, nc);
    if (n) {
        double *change = of_row + all;
        int slips = 0;
        for (int i = 0; i < n; ++i)
            slips |= w->acts[i] < sw->rows && lag_row_slips(sw, w->acts[i]);
        if (slips)
            lag_evaluate_laws_along(run, &w->limits, t, y, d, x, z);
        if (sw->nf)
            lag_evaluate_laws_along(run, &w->forces, t, y, d, x, z);
        for (int i = 0; i < n; ++i) {
            const int k = w->acts[i];
            if (k >= sw->rows)
                change[i] = OUT(&w->forces, k - sw->rows);
            else if (lag_row_slips(sw, k))
                change[i] = -lag_row_slips(sw, k) * OUT(&w->limits, sw->nl + sw->limit[k]);
            else
                change[i] = of_row[k] - lag_along(run, k, x);
        }
        lag_solve_square(n, w->lu, w->pivots, change, w->square);
        for (int i = 0; i < n; ++i) {
            const double *u = response_of(run, w->acts[i]);
            z[w->acts[i]] = change[i];
            for (int j = 0; j < nq + nc; ++j)
                x[j] += u[j] * change[i];
        }
    }
    for (int i = 0; i < nq + nc; ++i)
        sum += x[i];
    return sum;
}

static int differentiate_on_branches(lag_run *run, double t, const double *y, int count,
                                     const lag_direction *directions, double *x, double *z)
{
    const int size = run->system.nq + run->system.nc, all = run->switching.rows + run->switching.nf;
    double sum = 0.0;
    take_motion(run, t, y);
    for (int k = 0; k < count; ++k)
        sum += differentiate_once(run, t, y, directions[k], x + k * size, z + k * all);
    return isnan(sum);
}

/* Take a side of the surface on which the motion slides. */
static void take_side(lag_run *run, int upper)
{
    lag_kinks *k = &run->switching.kinks;
    const int kink = k->slides;
    k->branch[kink] = !k->whole[kink] ? (upper ? 1.0 : -1.0)
                                      : k->bound[kink] + (upper ? 0.0 : -1.0) + (k->whole[kink] < 0);
    lag_keep_branches(run);
    lag_renew_tapes(run);
}

/* The rate of the surface's function along the motion, and its change along a direction. */
static double rate_of_surface(lag_run *run, double t, const double *y, lag_direction d, const double *of_a,
                              double *change)
{
    const lag_derivatives *w = &run->derivatives;
    const lag_tape *rates = &w->kink_rates;
    const int nq = run->system.nq, kink = run->switching.kinks.slides;
    const lag_direction along = {1.0, y + nq, w->a, NULL};
    double *r = rates->registers;
    *r++ = t;
    r = put(r, y, 2 * nq);
    *r++ = along.t;
    r = put(r, along.q, nq);
    r = put(r, along.v, nq);
    *r++ = d.t;
    r = put(r, d.q, nq);
    r = put(r, d.v, nq);
    r = put(r, d.p, w->np);
    r = put(r, d.v, nq);
    put(r, of_a, nq);
    lag_tape_run(rates, &rates->stream);
    *change = OUT(rates, run->switching.kinks.count + kink);
    return OUT(rates, kink);
}

/* The changes of a motion that slides along a surface by Filippov's rule: the weight w of the upper side follows from
 * g_0' + w (g_1' - g_0') = 0, and so does its change. */
static int differentiate_sliding(lag_run *run, double t, const double *y, int count, const lag_direction *directions)
{
    lag_derivatives *w = &run->derivatives;
    lag_switching *sw = &run->switching;
    const int size = run->system.nq + run->system.nc, all = sw->rows + sw->nf, of_one = size + all;
    const int kink = sw->kinks.slides, nc = sw->nc;
    /* the state's own solution, then of each side: a and lambda, z; the changes of these; rates and their changes */
    double *saved = w->side, *next = saved + size + nc + all, *motion[2], *changes[2], *rate[2], power;
    memcpy(saved, run->solver.a, (size_t)size * sizeof(double));
    memcpy(saved + size, sw->multipliers, (size_t)nc * sizeof(double));
    memcpy(saved + size + nc, sw->force, (size_t)all * sizeof(double));
    int bad = 0;
    for (int side = 0; side < 2; ++side) {
        motion[side] = next, next += of_one;
        changes[side] = next, next += (size_t)count * of_one;
        rate[side] = next, next += 1 + count;
        take_side(run, side == 0);
        sw->kinks.slides = -1;
        bad |= lag_accelerate_on_branch(run, t, y, 0, &power);
        --run->step.evaluations;
        if (!bad)
            bad = differentiate_on_branches(run, t, y, count, directions, changes[side], changes[side] + count * size);
        sw->kinks.slides = kink;
        memcpy(motion[side], w->a, (size_t)size * sizeof(double));
        memcpy(motion[side] + size, w->z, (size_t)all * sizeof(double));
        for (int k = 0; k < count && !bad; ++k)
            rate[side][0] = rate_of_surface(run, t, y, directions[k], changes[side] + k * size, rate[side] + 1 + k);
    }
    const double difference = rate[0][0] - rate[1][0], weight = -rate[1][0] / difference;
    for (int k = 0; k < count; ++k) {
        const double *upper = rate[0] + 1, *lower = rate[1] + 1;
        const double of_weight = -(lower[k] + weight * (upper[k] - lower[k])) / difference;
        w->of_weight[k] = of_weight;
        for (int i = 0; i < of_one; ++i) {
            const int place = i < size ? k * size + i : count * size + k * all + i - size;
            const double jump = motion[0][i] - motion[1][i];
            const double x = changes[1][place] + weight * (changes[0][place] - changes[1][place]) + jump * of_weight;
            if (i < size)
                w->of_a[k * size + i] = x;
            else
                w->of_z[k * all + i - size] = x;
        }
    }
    memcpy(run->solver.a, saved, (size_t)size * sizeof(double));
    memcpy(sw->multipliers, saved + size, (size_t)nc * sizeof(double));
    memcpy(sw->force, saved + size + nc, (size_t)all * sizeof(double));
    memcpy(w->a, saved, (size_t)size * sizeof(double));
    memcpy(w->multipliers, saved + size, (size_t)nc * sizeof(double));
    memcpy(w->z, saved + size + nc, (size_t)all * sizeof(double));
    return bad || !isfinite(weight);
}

int lag_differentiate(lag_run *run, double t, const double *y, int count, const lag_direction *directions)
{
    lag_derivatives *w = &run->derivatives;
    if (run->switching.kinks.slides >= 0)
        return differentiate_sliding(run, t, y, count, directions);
    if (lag_factor(run, t, y))
        return 1;
    return differentiate_on_branches(run, t, y, count, directions, w->of_a, w->of_z);
}

/* The directions that have derivatives, with no change of time: to `out`. Returns their number. */
static int live_directions(const lag_run *run, const double *y, lag_direction *out, int *which)
{
    int count = 0;
    for (int k = 0; k < run->derivatives.n; ++k)
        if (!run->derivatives.lost[k]) {
            which[count] = k;
            out[count++] = lag_direction_of(run, y, k, 0.0);
        }
    return count;
}

int lag_rates_of_changes(lag_run *run, double t, const double *y, double *f)
{
    const lag_derivatives *w = &run->derivatives;
    const int nq = run->system.nq, size = nq + run->system.nc;
    lag_direction *directions = run->derivatives.directions;
    int *which = run->derivatives.which;
    memset(f + 2 * nq + 1, 0, 2 * (size_t)(nq * w->n) * sizeof(double));
    const int count = live_directions(run, y, directions, which);
    if (!count)
        return 0;
    if (lag_differentiate(run, t, y, count, directions))
        return 1;
    for (int k = 0; k < count; ++k) {
        double *rates = lag_change(run, f, which[k]);
        memcpy(rates, directions[k].v, (size_t)nq * sizeof(double));
        memcpy(rates + nq, w->of_a + k * size, (size_t)nq * sizeof(double));
    }
    return 0;
}

double lag_change_of_speed(const lag_run *run, int row, const double *v, const double *of_v)
{
    const lag_switching *sw = &run->switching;
    const lag_tape *g = &run->derivatives.functions;
    double sum = OUT(g, sw->nh + sw->nb + row);
    for (int b = 0; b < sw->nb; ++b)
        if (sw->row[b] == row)
            sum += OUT(g, sw->nh + b) * v[sw->column[b]];
    return sw->sign[row] * sum + lag_along(run, row, of_v);
}

/* The least change x (nq) with B x = -residual of the system's rows, and of the `count` rows that hold. */
static int correct(lag_run *run, int count, const int *rows, double *residual, const double *of_rows, double *x)
{
    lag_derivatives *w = &run->derivatives;
    const int nq = run->system.nq, nc = run->system.nc;
    double sum = 0.0;
    memset(x, 0, (size_t)nq * sizeof(double));
    if (nc) {
        for (int i = 0; i < nc; ++i)
            residual[i] = -residual[i];
        sum = lag_correction(run, residual, x);
    }
    if (count) {
        double *matrix = w->square, *right = matrix + count * count, *z = right + count, *memory = z + count;
        for (int i = 0; i < count; ++i) {
            right[i] = -of_rows[rows[i]] - lag_along(run, rows[i], x);
            for (int j = 0; j < count; ++j)
                matrix[i * count + j] = lag_along(run, rows[i], response_of(run, rows[j]));
        }
        lag_least_norm(count, matrix, right, z, memory);
        for (int j = 0; j < count; ++j)
            for (int i = 0; i < nq; ++i)
                x[i] += response_of(run, rows[j])[i] * z[j];
    }
    return !isfinite(sum);
}

/* Correct the velocities of a change along the jump of accelerations at the surface on which the motion slides. */
static int correct_on_surface(lag_run *run, double t, double *y)
{
    const lag_kinks *k = &run->switching.kinks;
    const lag_derivatives *w = &run->derivatives;
    const int nq = run->system.nq;
    double power;
    if (lag_slide(run, t, y, 0, &power))
        return 1;
    for (int i = 0; i < w->n; ++i) {
        if (w->lost[i])
            continue;
        double *change = lag_change(run, y, i);
        lag_evaluate_along(run, &w->kinks, t, y, lag_direction_of(run, y, i, 0.0));
        const double gap = OUT(&w->kinks, k->slides);
        for (int j = 0; j < nq; ++j)
            change[nq + j] -= gap / k->rates * k->both[j];
    }
    return 0;
}

int lag_project_changes(lag_run *run, double t, double *y)
{
    lag_derivatives *w = &run->derivatives;
    const lag_system *s = &run->system;
    const lag_switching *sw = &run->switching;
    const lag_tape *c = &w->constraint, *b_of = &s->constraint; /* the factors may do without some entries of B */
    const int nq = s->nq, nc = s->nc;
    double *residual = w->right, *of_rows = w->row, *x = w->x;
    int count = 0, *rows = w->acts, with_gaps = 0, *gaps = w->pivots;
    for (int i = 0; i < sw->rows && sw->acting; ++i)
        if (sw->mode[i] == LAG_HOLDS) {
            rows[count++] = i;
            if (sw->place[i] >= 0)
                gaps[with_gaps++] = i;
        }
    if (!w->live || (!nc && !count && sw->kinks.slides < 0))
        return 0;
    if (lag_factor(run, t, y) || (count && lag_find_rows(run, t, y)))
        return 1;
    if (nc)
        lag_evaluate(b_of, s, t, y, LAG_VELOCITIES);
    for (int i = 0; i < count; ++i)
        lag_row_response(run, rows[i]);
    for (int k = 0; k < w->n; ++k) {
        if (w->lost[k])
            continue;
        double *of_q = lag_change(run, y, k), *of_v = of_q + nq;
        if (s->nh || with_gaps) {
            memset(residual, 0, (size_t)nc * sizeof(double));
            if (s->nh)
                lag_evaluate_along(run, c, t, y, lag_direction_of(run, y, k, 0.0));
            for (int i = 0; i < s->nh; ++i)
                residual[s->holonomic[i]] = OUT(c, i);
            if (with_gaps)
                lag_evaluate_along(run, &w->functions, t, y, lag_direction_of(run, y, k, 0.0));
            for (int i = 0; i < with_gaps; ++i)
                of_rows[gaps[i]] = sw->sign[gaps[i]] * OUT(&w->functions, sw->place[gaps[i]]);
            if (correct(run, with_gaps, gaps, residual, of_rows, x))
                return 1;
            for (int i = 0; i < nq; ++i)
                of_q[i] += x[i];
        }
        if (!nc && !count)
            continue;
        if (nc)
            lag_evaluate_along(run, c, t, y, lag_direction_of(run, y, k, 0.0));
        for (int i = 0; i < nc; ++i)
            residual[i] = OUT(c, s->nh + s->nb + i);
        for (int b = 0; b < s->nb; ++b)
            residual[s->jacobian_row[b]] += OUT(c, s->nh + b) * y[nq + s->jacobian_column[b]]
                                            + OUT(b_of, lag_constraint_jacobian(s) + b) * of_v[s->jacobian_column[b]];
        if (count)
            lag_evaluate_along(run, &w->functions, t, y, lag_direction_of(run, y, k, 0.0));
        for (int i = 0; i < count; ++i)
            of_rows[rows[i]] = lag_change_of_speed(run, rows[i], y + nq, of_v);
        if (correct(run, count, rows, residual, of_rows, x))
            return 1;
        for (int i = 0; i < nq; ++i)
            of_v[i] += x[i];
    }
    return sw->kinks.slides >= 0 && correct_on_surface(run, t, y);
}

/* Replace the multipliers of rows that share their forces by NaN, in rows of all constraints that are `apart`. */
static void hide_shared(lag_run *run, int apart, double *out)
{
    lag_derivatives *w = &run->derivatives;
    const lag_switching *sw = &run->switching;
    int n = 0;
    for (int i = 0; i < w->acting; ++i)
        if (w->acts[i] < sw->rows && !lag_row_slips(sw, w->acts[i]))
            w->pivots[n++] = w->acts[i];
    double *matrix = w->square, *right = matrix + n * n, *z = right + n, *memory = z + n;
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j)
            matrix[i * n + j] = lag_along(run, w->pivots[i], response_of(run, w->pivots[j]));
    for (int j = 0; j < n; ++j) {
        for (int i = 0; i < n; ++i)
            right[i] = matrix[i * n + j];
        lag_least_norm(n, matrix, right, z, memory); /* what of a unit force is unique */
        if (fabs(z[j] - 1.0) > LOOSE)
            for (int k = 0; k < w->n; ++k)
                out[k * apart + sw->constraint[w->pivots[j]]] = NAN;
    }
}

int lag_write_changes(lag_run *run, double t, const double *y, double *row)
{
    lag_derivatives *w = &run->derivatives;
    const int nq = run->system.nq, size = nq + run->system.nc, nc = run->switching.nc, width = 3 * nq + nc;
    const int all = run->switching.rows + run->switching.nf;
    for (int i = 0; i < w->n * width; ++i)
        row[i] = NAN;
    const int count = live_directions(run, y, w->directions, w->which);
    if (!count)
        return 0;
    if (lag_differentiate(run, t, y, count, w->directions))
        return 1;
    for (int k = 0; k < count; ++k) {
        double *out = row + w->which[k] * width;
        memcpy(out, w->directions[k].q, 2 * (size_t)nq * sizeof(double));
        memcpy(out + 2 * nq, w->of_a + k * size, (size_t)nq * sizeof(double));
        lag_gather_multipliers(run, w->of_a + k * size + nq, w->of_z + k * all, out + 3 * nq);
    }
    if (w->redundant)
        hide_shared(run, width, row + 3 * nq);
    return 0;
}

int lag_width_of_changes(const lag_run *run)
{
    return run->derivatives.n * (3 * run->system.nq + run->switching.nc);
}

