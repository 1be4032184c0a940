#include "watch.h"

#include <float.h>
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "linear/dense.h"
#include "methods/method.h"
#include "motion.h"
#include "step.h"
#include "tape/vectors.h"

#define LARGE 20000.0       /* number of operations above which the rows of B are not orthogonalized */
#define OVER 0.05           /* of its largest value: the least pivot below which a minimum is examined more closely ... */
#define BELOW 0.9           /* ... if it is below this part of those at the ends of the step ... */
#define SINGULAR 1e-4       /* ... or below this part of the largest one */
#define PROBES 40           /* largest number of states at which a step is examined */
#define SPOTS 8             /* places of a part of a step at which the determinant is computed ... */
#define HALVINGS 6          /* ... of the step until a part is left to a closer examination ... */
#define MOST_PARTS 40       /* ... and number of parts, at most */
#define ROUGH 0.1           /* what ln |det| deviates from a polynomial where B may lose rank ... */
#define ROUGH_OF_FEW 0.02   /* ... at FEW places */
#define FEW 5
#define ASIDE_OF_ENDS 0.15  /* distance of two of them from the ends of a step */
#define SEARCHED 4          /* states that a search would examine, about: in Taylor's method it has to */
#define SLOWER 0.5          /* ratio of steps, the later to the earlier, from which the least pivot is computed */
#define ASIDE 0.1           /* weight of all rows in the initial vector of inverse iteration */
#define ITERATIONS 8        /* largest number of iterations ... */
#define SETTLED 0.9         /* ... and ratio of successive values at convergence; ... */
#define MORE_ITERATIONS 30  /* ... of the value that limits steps, ... */
#define CLOSELY 0.9999      /* ... which is needed closely */
#define LARGER 2.0          /* growth of the least pivot after which the largest least singular value is determined again */
#define SHORTER_BELOW 0.2   /* of its largest value: least singular value below which steps are limited, ... */
#define DESCENT 0.02        /* ... so that each reduces it by at most this part of the largest */
#define AHEAD_BELOW 0.04    /* of its largest value: where the path ahead is to be examined. Not later, because the rounding
                             * errors of a and lambda grow with the inverse square of the value ... */
#define FALLEN 0.85         /* ... again after the value has fallen to this part: where the motion ends, at a turning point,
                             * it does so in small steps; ... */
#define HALVED 0.5          /* ... or to this part, where the last values lead to a minimum that is not small: ... */
#define NOT_SMALL 0.71      /* ... at least this part of the value. Where it vanishes like a power of time, they lead below it */
#define PROGRESS 1e-3       /* smallest relative change of the value that counts as progress, ... */
#define STUCK 20            /* ... and number of steps without it that end an approach limited by rounding errors: one step
                             * changes the value by several hundredths */

/* Normalize x; returns its previous length. */
static double normalize(double *x, int n)
{
    double sum = 0.0;
    for (int i = 0; i < n; ++i)
        sum += x[i] * x[i];
    const double length = sqrt(sum);
    for (int i = 0; i < n; ++i)
        x[i] /= length;
    return length;
}

/* Apply the inverse of (rows of B over their lengths) M^-1 (the same)' by the last factors. */
static int by_factors_of_motion(lag_run *run, double *x)
{
    const int nc = run->system.nc / run->system.blocks;
    for (int i = 0; i < nc; ++i)
        x[i] *= run->rows.lengths[i];
    lag_oppose(run, x);
    for (int i = 0; i < nc; ++i)
        x[i] *= run->rows.lengths[i];
    return 0;
}

/* Apply the inverse of the products of the rows of B that are pivots, after lag_pivot_of_products. */
static int by_factors_of_products(lag_run *run, double *x)
{
    const int nc = run->system.nc / run->system.blocks, rank = run->rows.rank / run->system.blocks;
    for (int k = rank; k < nc; ++k)
        x[run->rows.order[k]] = 0.0;
    return lag_solve_products(run->rows.components, nc, rank, run->rows.order, x, x + nc);
}

/*
 * The least singular value of B's rows, by inverse iteration; from above, and the closer the further it is below the
 * others. It begins with what was found last, which differs little, and with something of all rows.
 */
static double least_singular(lag_run *run, int (*apply_inverse)(lag_run *run, double *x), int iterations, double settled)
{
    const int nc = run->system.nc / run->system.blocks;
    double *x = run->watch.combination, value = INFINITY;
    for (int i = 0; i < nc; ++i)
        x[i] += ASIDE * cos(i) / sqrt(nc);
    normalize(x, nc);
    for (int k = 0; k < iterations; ++k) {
        const double before = value;
        const int failed = apply_inverse(run, x);
        value = 1.0 / sqrt(normalize(x, nc));
        if (failed || !(value > 0.0) || !isfinite(value)) { /* the factors are not accurate enough */
            memset(x, 0, (size_t)nc * sizeof(double));
            return 0.0;
        }
        if (value > settled * before)
            break;
    }
    return value;
}

/* Whether the last factors can tell how near a singular configuration is: not those of a bordered matrix. */
static int by_factors(const lag_run *run)
{
    const int whole = run->rows.rank == run->system.nc && run->system.blocks == 1 && !run->switching.used;
    return whole || lag_solving_by(run) != LAG_BY_LU;
}

int lag_many_rows(const lag_run *run)
{
    const int nq = run->system.nq / run->system.blocks, nc = run->system.nc / run->system.blocks;
    return (double)nc * nc * nq > LARGE;
}

/* Whether the determinant tells whether B loses rank. */
static int by_determinant(const lag_run *run)
{
    return lag_many_rows(run) && by_factors(run);
}

/* The products of the rows of B, times sizes over lengths, with each other: nc * nc; B is that of the constraint tape.
 * Returns 0, or 1 where they are not finite. */
static int multiply_rows(lag_run *run, double *products)
{
    const lag_system *s = &run->system;
    const int nc = s->nc / s->blocks, nb = s->nb / s->blocks;
    const double *sizes = run->rows.sizes, *lengths = run->rows.lengths;
    double *entries = run->rows.scaled, sum = 0.0;
    memset(products, 0, (size_t)nc * nc * sizeof(double));
    for (int i = 0; i < nb; ++i) {
        const int row = s->jacobian_row[i], column = s->jacobian_column[i];
        sum += entries[i] = OUT(&s->constraint, lag_constraint_jacobian(s) + i) * sizes[column] / lengths[row];
    }
    for (int i = 0; i < nb; ++i) {
        double *row = products + s->jacobian_row[i] * nc;
        const double x = entries[i];
        row[s->jacobian_row[i]] += x * x;
        for (int k = run->rows.same_column[i]; k >= 0; k = run->rows.same_column[k]) {
            const double product = x * entries[k];
            row[s->jacobian_row[k]] += product;
            products[s->jacobian_row[k] * nc + s->jacobian_row[i]] += product;
        }
    }
    return !isfinite(sum);
}

/* In the metric of M where B is large, else relative to the coordinates' sizes. */
double lag_least_pivot(lag_run *run, double t, const double *y)
{
    const lag_system *s = &run->system;
    const int nc = s->nc / s->blocks; /* of the motion, whose B is that of all blocks */
    double *products = run->rows.components;
    if (run->rows.rank == 0)
        return 1.0;
    ++run->watch.examined;
    if (by_determinant(run))
        return lag_factor(run, t, y) ? 0.0 : least_singular(run, by_factors_of_motion, ITERATIONS, SETTLED);
    lag_evaluate(&s->constraint, s, t, y, LAG_VELOCITIES);
    if (multiply_rows(run, products))
        return 1.0;
    return lag_pivot_of_products(products, nc, run->rows.rank / s->blocks, run->rows.order);
}

/* The least singular value, closely, where the least pivot was computed last; of redundant rows, that of the pivots. */
static double least_value(lag_run *run, double pivot)
{
    if (by_determinant(run) || !(pivot > 0.0))
        return pivot;
    return least_singular(run, by_factors_of_products, MORE_ITERATIONS, CLOSELY);
}

/* Determine the least singular value where the least pivot was computed last, if that is small, or larger than before. */
static void measure_value(lag_run *run, double pivot)
{
    lag_approach *a = &run->watch.approach;
    a->value = INFINITY;
    if (pivot > LARGER * a->largest_pivot || pivot < NEAR * run->watch.largest_pivot) {
        a->value = least_value(run, pivot);
        a->largest = fmax(a->largest, a->value);
        a->largest_pivot = fmax(a->largest_pivot, pivot);
    }
}

int lag_is_near(lag_run *run)
{
    if (!run->watch.mode)
        return 0;
    const double pivot = lag_least_pivot(run, run->step.t, run->step.y);
    return least_value(run, pivot) < SHORTER_BELOW * run->watch.approach.largest;
}

/* The weights of entries of B in the length of its path. */
static void weigh_path(lag_run *run)
{
    const lag_system *s = &run->system;
    for (int i = 0; i < s->nb / s->blocks; ++i)
        run->watch.path.weight[i] = run->rows.sizes[s->jacobian_column[i]] / run->rows.lengths[s->jacobian_row[i]];
}

/* Limit steps further than the settings do; INFINITY: no further. */
static void limit(lag_run *run, double step)
{
    run->step.h_max = fmin(step, run->settings.max_step);
    run->step.h = fmin(run->step.h, run->step.h_max);
}

/* Forget the states that led towards a singular configuration. */
static void end_approach(lag_run *run)
{
    run->watch.approach.states = 0;
    limit(run, INFINITY);
}

void lag_watch_restart(lag_run *run)
{
    const lag_system *s = &run->system;
    lag_path *path = &run->watch.path;
    if (!run->watch.mode)
        return;
    lag_evaluate(&s->dynamics, s, run->step.t, run->step.y, LAG_ALL);
    for (int i = 0; i < s->nb / s->blocks; ++i)
        path->begin[i] = OUT(&s->dynamics, lag_first_jacobian(s) + i);
    weigh_path(run);
    run->watch.pivot = lag_least_pivot(run, run->step.t, run->step.y);
    run->watch.largest_pivot = fmax(run->watch.largest_pivot, run->watch.pivot);
    measure_value(run, run->watch.pivot);
    end_approach(run);
    path->margin = CERTAIN * run->watch.pivot;
    run->watch.determinant.begin = NAN;
    run->watch.largest_step = 0.0;
    run->watch.approaching = 0;
    path->exceeded = 0;
}

void lag_watch_step(lag_run *run)
{
    lag_path *path = &run->watch.path;
    lag_determinant *d = &run->watch.determinant;
    path->length = path->speed = 0.0;
    path->t = run->step.t;
    path->entries = path->begin;
    d->count = 0;
    if (d->by == lag_solving_by(run) && !isnan(d->begin)) {
        d->t[0] = run->step.t;
        d->value[d->count++] = d->begin;
    }
    d->by = lag_solving_by(run);
    d->kept = by_factors(run) && (lag_many_rows(run) || (path->exceeded && !run->method->uses_series));
}

void lag_watch_stage(lag_run *run, double t)
{
    const lag_system *s = &run->system;
    const double *entries = s->dynamics.registers;
    const int32_t *places = s->dynamics.outputs + lag_first_jacobian(s);
    lag_path *path = &run->watch.path;
    double sum = 0.0;
    for (int i = 0; i < s->nb / s->blocks; ++i) {
        const double x = entries[places[i]];
        const double part = (x - path->entries[i]) * path->weight[i];
        sum += part * part;
        path->last[i] = x;
    }
    const double length = sqrt(sum), speed = length / fabs(t - path->t);
    path->entries = path->last;
    path->length += length;
    if (t != path->t)
        path->speed = fmax(path->speed, speed);
    path->t = t;
}

void lag_watch_determinant(lag_run *run, double t)
{
    lag_determinant *d = &run->watch.determinant;
    if (!d->kept)
        return;
    d->t[d->count] = t;
    d->value[d->count++] = lag_log_determinant(run);
}

void lag_watch_accept(lag_run *run)
{
    lag_path *path = &run->watch.path;
    double *last = path->last;
    path->last = path->begin;
    path->entries = path->begin = last;
    path->margin = path->margin_at_end;
    const lag_determinant *d = &run->watch.determinant;
    const int known = d->count && d->t[d->count - 1] == run->step.t_old + run->step.h_old;
    run->watch.determinant.begin = known ? d->value[d->count - 1] : NAN;
}

int lag_stage(lag_run *run, double t, const double *y, double *f)
{
    if (lag_derivative(run, t, y, f))
        return 1;
    if (run->watch.mode)
        lag_watch_stage(run, t);
    return 0;
}

/* Record the largest length of each row of B times sizes, or of B; returns the least ratio of the lengths before and
 * after. */
static double measure(lag_run *run, const double *sizes, double *lengths)
{
    const lag_system *s = &run->system;
    double *sum = run->step.work, ratio = 1.0;
    lag_row_squares(s, &s->constraint, lag_constraint_jacobian(s), sizes, sum);
    for (int i = 0; i < s->nc; ++i)
        if (sum[i] > lengths[i] * lengths[i]) {
            const double length = sqrt(sum[i]);
            ratio = fmin(ratio, lengths[i] / length);
            lengths[i] = length;
        }
    return ratio;
}

void lag_measure(lag_run *run)
{
    if (lag_solving_by(run) != LAG_BY_LU)
        measure(run, NULL, run->rows.plain_lengths);
    const double ratio = measure(run, run->rows.sizes, run->rows.lengths);
    if (ratio < 1.0) {
        run->watch.path.margin *= ratio;
        weigh_path(run);
    }
}

/* A state inside the last step, on the cubic through its ends, with its slope: B depends on v, too, where constraints are
 * nonlinear in it. Returns its time. */
static double inside(lag_run *run, double x, double *y)
{
    const int nq = run->system.nq;
    const double h = run->step.h_old, z = 1.0 - x;
    const double *q0 = run->step.y_old, *v0 = q0 + nq, *q1 = run->step.y_new, *v1 = q1 + nq;
    if (run->stepped->uses_series) { /* its steps are too long for a cubic, and provide all states */
        lag_dense(run, run->step.t_old + x * h, y);
        return run->step.t_old + x * h;
    }
    for (int m = 0; m < nq; ++m) {
        y[m] = z * z * ((1.0 + 2.0 * x) * q0[m] + x * h * v0[m])
               + x * x * ((1.0 + 2.0 * z) * q1[m] - z * h * v1[m]);
        y[nq + m] = 6.0 * x * z * (q1[m] - q0[m]) / h + z * (1.0 - 3.0 * x) * v0[m] + x * (1.0 - 3.0 * z) * v1[m];
    }
    return run->step.t_old + x * h;
}

static double least_pivot_inside(lag_run *run, double x)
{
    const double t = inside(run, x, run->samples.y);
    return lag_least_pivot(run, t, run->samples.y);
}

/* Whether n values at places x (at most LAG_DETERMINANTS) deviate from a polynomial of a degree by less than `rough`, as
 * ln |det| does where B keeps its rank. The deviations replace the values. */
static int is_smooth(int n, const double *x, double *values, int degree, double rough)
{
    double before[LAG_DETERMINANTS] = {0.0}, now[LAG_DETERMINANTS], norm = sqrt(n), far = 0.0;
    for (int i = 0; i < n; ++i)
        now[i] = 1.0 / norm;
    for (int k = 0;; ++k) { /* polynomials that are orthogonal at these places, by Stieltjes' recurrence */
        double part = 0.0;
        for (int i = 0; i < n; ++i)
            part += now[i] * values[i];
        for (int i = 0; i < n; ++i)
            values[i] -= part * now[i];
        if (k == degree)
            break;
        double next[LAG_DETERMINANTS], middle = 0.0;
        for (int i = 0; i < n; ++i)
            middle += x[i] * now[i] * now[i];
        const double last = norm;
        norm = 0.0;
        for (int i = 0; i < n; ++i) {
            next[i] = (x[i] - middle) * now[i] - last * before[i];
            norm += next[i] * next[i];
        }
        norm = sqrt(norm);
        for (int i = 0; i < n; ++i) {
            before[i] = now[i];
            now[i] = next[i] / norm;
        }
    }
    for (int i = 0; i < n; ++i)
        far = !(fabs(values[i]) <= far) ? fabs(values[i]) : far;
    return far < rough; /* not if it is NaN */
}

int lag_is_smooth_in_step(const lag_determinant *d)
{
    double values[LAG_DETERMINANTS];
    memcpy(values, d->value, sizeof values);
    return d->count >= FEW && is_smooth(d->count, d->t, values, 2, d->count > FEW ? ROUGH : ROUGH_OF_FEW);
}

int lag_slows(double largest_step, double h)
{
    return h < SLOWER * largest_step;
}

/* ln |det| inside the last step. */
static double determinant_inside(lag_run *run, double x)
{
    const double t = inside(run, x, run->samples.y);
    return lag_factor(run, t, run->samples.y) ? INFINITY : lag_log_determinant(run);
}

/* Whether B keeps its rank at all stages of the last step. */
static int is_smooth_at_stages(lag_run *run)
{
    lag_determinant d = run->watch.determinant;
    for (int i = 0; i < 2 && run->stepped->uses_series; ++i) { /* besides its middle and its ends */
        const double x = i ? 1.0 - ASIDE_OF_ENDS : ASIDE_OF_ENDS;
        d.t[d.count] = run->step.t_old + x * run->step.h_old;
        d.value[d.count++] = determinant_inside(run, x);
    }
    return lag_is_smooth_in_step(&d);
}

/*
 * Whether B may lose rank inside the last step, and where: in parts of it, as long as ln |det| is not nearly a cubic in
 * them. Where two branches of the motion miss each other, it becomes one in shorter parts.
 */
static int loses_rank(lag_run *run)
{
    static const double spots[SPOTS] = {0.0, /* Chebyshev's, with the ends */
                                        0.04951556604879043, 0.18825509907063326, 0.38873953302184278,
                                        0.61126046697815722, 0.81174490092936674, 0.95048443395120957, 1.0};
    const double shortest = ldexp(1.0, -HALVINGS);
    double from[HALVINGS + 2] = {0.0}, width[HALVINGS + 2] = {1.0}, first = INFINITY, last = 0.0;
    int waiting = 1;
    for (int parts = 0; waiting && parts < MOST_PARTS; ++parts) {
        const double low = from[--waiting], length = width[waiting];
        double values[SPOTS];
        for (int i = 0; i < SPOTS; ++i)
            values[i] = determinant_inside(run, low + length * spots[i]);
        if (is_smooth(SPOTS, spots, values, 3, ROUGH))
            continue;
        if (length <= shortest) { /* the states on the cubic are not quite those of the motion */
            first = fmin(first, fmax(low - shortest, 0.0));
            last = fmin(low + 2.0 * shortest, 1.0);
            continue;
        }
        from[waiting] = low + 0.5 * length;
        width[waiting++] = 0.5 * length;
        from[waiting] = low;
        width[waiting++] = 0.5 * length;
    }
    run->watch.suspect[0] = waiting ? fmin(first, from[waiting - 1]) : first;
    run->watch.suspect[1] = waiting ? 1.0 : last;
    return run->watch.suspect[0] <= 1.0;
}

/*
 * Whether the least pivot, of which the value at the end is given, may have a small minimum inside the last step:
 * Piyavskii and Shubert's search for the minimum of a function with a known Lipschitz constant, here the speed of B,
 * since no singular value changes faster.
 *
 * B. Shubert, A sequential method seeking the global maximum of a function, SIAM J. Numer. Anal. 9 (1972),
 * doi:10.1137/0709036.
 */
static int dips(lag_run *run, double end)
{
    const double speed = run->watch.path.speed * run->step.h_old, largest = run->watch.largest_pivot;
    double x[PROBES] = {0.0, 1.0}, value[PROBES] = {least_pivot_inside(run, 0.0), end};
    int after[PROBES] = {1, -1}; /* the state at which the part that begins at a state ends */
    const double least = fmin(value[0], value[1]);
    const double small = fmin(OVER * largest, fmax(BELOW * least, SINGULAR * largest));
    if (least < small)
        return 1;
    for (int count = 2; count < PROBES; ++count) {
        /* the part of the step in which the least singular value may be smallest */
        double bound = CERTAIN * small;
        int at = -1;
        for (int i = 0; i < count; ++i) {
            const int j = after[i];
            if (j < 0)
                continue;
            const double lowest = 0.5 * (CERTAIN * (value[i] + value[j]) - speed * (x[j] - x[i]));
            if (lowest < bound)
                bound = lowest, at = i;
        }
        if (at < 0)
            return 0;
        const int to = after[at];
        const double width = x[to] - x[at], middle = 0.5 * (x[at] + x[to]);
        const double aside = 0.5 * CERTAIN * (value[at] - value[to]) / speed;
        x[count] = middle + fmin(fmax(aside, -0.3 * width), 0.3 * width);
        value[count] = least_pivot_inside(run, x[count]);
        if (value[count] < small)
            return 1;
        after[count] = to;
        after[at] = count;
    }
    return 1;
}

/* Whether the last step may have passed a singular configuration, by ln |det|. Steps become shorter ahead of one where
 * the accelerations are infinite: then the least pivot is computed, too. */
static int over_by_determinant(lag_run *run)
{
    lag_watch *w = &run->watch;
    w->path.margin_at_end = 0.0;
    w->largest_step = fmax(w->largest_step, run->step.h_old);
    if (w->approaching || lag_slows(w->largest_step, run->step.h_old)) {
        w->largest_step = run->step.h_old;
        w->pivot_at_end = lag_least_pivot(run, run->step.t_old + run->step.h_old, run->step.y_new);
        w->largest_pivot = fmax(w->largest_pivot, w->pivot_at_end);
        measure_value(run, w->pivot_at_end);
    }
    return !is_smooth_at_stages(run) && loses_rank(run);
}

int lag_stepped_over(lag_run *run)
{
    lag_path *path = &run->watch.path;
    run->watch.pivot_at_end = run->watch.approach.value = INFINITY;
    if (by_determinant(run))
        return over_by_determinant(run);
    if (path->length < path->margin - CERTAIN * NEAR * run->watch.largest_pivot) {
        path->margin_at_end = path->margin - path->length;
        path->exceeded = 0;
        return 0;
    }
    const double end = lag_least_pivot(run, run->step.t_old + run->step.h_old, run->step.y_new);
    run->watch.pivot_at_end = end;
    run->watch.largest_pivot = fmax(run->watch.largest_pivot, end);
    measure_value(run, end);
    path->margin_at_end = CERTAIN * end;
    path->exceeded = path->length >= path->margin + path->margin_at_end;
    if (!path->exceeded)
        return 0;
    if (run->watch.determinant.kept && is_smooth_at_stages(run)) {
        run->watch.examined += SEARCHED;
        return 0;
    }
    run->watch.suspect[0] = 0.0;
    run->watch.suspect[1] = 1.0;
    return dips(run, end);
}

/* Keep a state of an approach; the last LAG_APPROACH_STATES are. */
static void keep_state(lag_run *run, double t, const double *y, double value)
{
    lag_approach *a = &run->watch.approach;
    const size_t n = (size_t)lag_size(&run->system);
    if (a->states == LAG_APPROACH_STATES) {
        --a->states;
        memmove(a->t, a->t + 1, (size_t)a->states * sizeof *a->t);
        memmove(a->values, a->values + 1, (size_t)a->states * sizeof *a->values);
        memmove(a->y, a->y + n, a->states * n * sizeof *a->y);
    }
    a->t[a->states] = t;
    a->values[a->states] = value;
    memcpy(a->y + a->states * n, y, n * sizeof *y);
    ++a->states;
}

/* Whether the parabola through the squares of the last values, which are smooth, has a minimum that is not small. */
static int has_minimum_ahead(const lag_approach *a)
{
    const int k = a->states - 1;
    if (k < 2)
        return 0;
    const double *t = a->t + k, *w = a->values + k, first = t[-2] - t[0], second = t[-1] - t[0], now = w[0] * w[0];
    const double of_first = (w[-2] * w[-2] - now) / first, of_second = (w[-1] * w[-1] - now) / second;
    const double bend = (of_first - of_second) / (first - second), slope = of_first - bend * first;
    return bend > 0.0 && now - 0.25 * slope * slope / bend > NOT_SMALL * NOT_SMALL * now;
}

/* Begin to keep the states of an approach, with that before the last step. */
static void begin_approach(lag_run *run)
{
    lag_approach *a = &run->watch.approach;
    const double pivot = lag_least_pivot(run, run->step.t_old, run->step.y_old);
    keep_state(run, run->step.t_old, run->step.y_old, least_value(run, pivot));
    a->changed = INFINITY;
    a->examined = AHEAD_BELOW * a->largest;
}

/* Whether the last steps have not changed the least singular value, because of rounding errors of a, which grow with its
 * inverse square. */
static int is_stuck(lag_run *run, double value)
{
    lag_approach *a = &run->watch.approach;
    if (fabs(value - a->changed) > PROGRESS * value) {
        a->changed = value;
        a->changed_at = run->step.steps;
        return 0;
    }
    /* rows of B have a length of about 1 */
    return DBL_EPSILON > run->settings.rtol * value * value && run->step.steps - a->changed_at >= STUCK;
}

int lag_approaches(lag_run *run)
{
    const double before = run->watch.pivot, largest = run->watch.largest_pivot;
    run->watch.pivot = fmin(run->watch.pivot_at_end, largest);
    run->watch.approaching = run->watch.pivot < fmin(before, NEAR * largest);
    return run->watch.approaching;
}

int lag_follow_approach(lag_run *run)
{
    lag_approach *a = &run->watch.approach;
    const double value = a->value;
    if (!lag_approaches(run)) {
        if (a->states)
            end_approach(run);
        return LAG_RUNNING;
    }
    if (!a->states)
        begin_approach(run);
    const double fall = a->values[a->states - 1] - value, taken = run->step.t - a->t[a->states - 1];
    keep_state(run, run->step.t, run->step.y, value);
    if (is_stuck(run, value))
        return LAG_FLOOR;
    const int falls = fall > 0.0 && value < SHORTER_BELOW * a->largest;
    limit(run, falls ? DESCENT * a->largest * taken / fall : INFINITY);
    const double most = has_minimum_ahead(a) ? HALVED * a->examined : a->examined;
    if (falls && value < most) {
        a->examined = FALLEN * value;
        return LAG_NEAR;
    }
    return LAG_RUNNING;
}

int lag_approach_of(const lag_run *run, double *states)
{
    const lag_approach *a = &run->watch.approach;
    const size_t n = (size_t)(2 * run->system.nq + 1), size = (size_t)lag_size(&run->system);
    for (int i = 0; i < a->states; ++i) {
        *states++ = a->t[i];
        memcpy(states, a->y + i * size, n * sizeof *states);
        states += n;
    }
    return a->states;
}
