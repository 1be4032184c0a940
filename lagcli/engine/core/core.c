#include "core.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "dop853.h"
#include "linear.h"

#define PROJECTIONS 10      /* Newton steps of a projection; the drift of one step takes two */
#define RESIDUAL 2e-15      /* of the constraint's scale: where a projection ends */
#define NEGLIGIBLE 0.01     /* of the tolerance: a projection that moves less leaves f as it is */
#define BAUMGARTE_STEP 0.1  /* alpha = beta times the step size */
#define NOT_REACHED 1e-10   /* of the scale: beyond it there is no consistent state nearby */
#define NEAR 0.3            /* of its largest value: the weakest pivot next to a singular place */
#define OVER 0.05           /* of its largest value: the weakest pivot that is looked at again */
#define GOLDEN 0.6180339887498949

static int size_of(const lag_system *s)
{
    return 2 * s->nq + 1;
}

/* Evaluate a tape at a state; the outputs' registers can be read afterwards. */
static void evaluate(const lag_tape *tape, const lag_system *s, double t, const double *y)
{
    tape->registers[0] = t;
    memcpy(tape->registers + 1, y, 2 * (size_t)s->nq * sizeof(double));
    lag_tape_run(tape->steps, tape->length, tape->registers);
}

/* Read output i of a tape. */
#define OUT(tape, i) ((tape)->registers[(tape)->outputs[i]])

/* Order of the linear system. */
static int order_of(const lag_run *run)
{
    return run->system->nq + 2 * run->system->nc - run->rank;
}

/* B's rows over their lengths, from a tape whose B entries begin at output `first`. */
static int scaled_rows(lag_run *run, const lag_tape *tape, int first)
{
    const lag_system *s = run->system;
    double sum = 0.0;
    memset(run->rows, 0, (size_t)s->nq * s->nc * sizeof(double));
    for (int i = 0; i < s->nb; ++i) {
        const double x = OUT(tape, first + i) / run->lengths[s->jacobian_places[i] / s->nq];
        run->rows[s->jacobian_places[i]] = x;
        sum += x;
    }
    return !isfinite(sum);
}

/*
 * Set up and factor [[M, B'], [B, 0]], B's rows brought to M's magnitude. Returns 0, or 1.
 *
 * Where B's rows depend on each other by N, N'B = 0, the system is bordered: what of the right side
 * contradicts is taken up by N, and N' lambda = 0 makes lambda the one of least norm.
 */
static int factor(lag_run *run)
{
    const lag_system *s = run->system;
    const lag_tape *d = &s->dynamics;
    const int nq = s->nq, nc = s->nc, n = order_of(run), first = s->nm + nq;
    double largest = 0.0, *k = run->kkt, *w = run->weight;
    memset(k, 0, (size_t)n * n * sizeof(double));
    for (int i = 0; i < s->nm; ++i) {
        const int row = s->mass_places[i] / nq, column = s->mass_places[i] % nq;
        const double x = OUT(d, i);
        k[row * n + column] = x;
        if (x > largest)
            largest = x;
    }
    if (largest == 0.0)
        largest = 1.0;
    memset(w, 0, (size_t)nc * sizeof(double));
    for (int i = 0; i < s->nb; ++i) {
        const double x = OUT(d, first + i);
        w[s->jacobian_places[i] / nq] += x * x;
    }
    for (int i = 0; i < nc; ++i)
        w[i] = w[i] > 0.0 ? largest / sqrt(w[i]) : 1.0;
    for (int i = 0; i < s->nb; ++i) {
        const int row = s->jacobian_places[i] / nq, column = s->jacobian_places[i] % nq;
        const double x = OUT(d, first + i) * w[row];
        k[(nq + row) * n + column] = x;
        k[column * n + nq + row] = x;
    }
    if (run->rank < nc) {
        if (scaled_rows(run, d, first))
            return 1;
        lag_pivot(run->rows, nq, nc, run->rank, run->order, run->components);
        lag_dependencies(nc, run->rank, run->order, run->components, run->dependencies);
        for (int j = 0; j < nc - run->rank; ++j)
            for (int i = 0; i < nc; ++i) {
                const double x = run->dependencies[j * nc + i] / run->lengths[i];
                k[(nq + i) * n + nq + nc + j] = x / w[i] * largest * largest;
                k[(nq + nc + j) * n + nq + i] = x * w[i];
            }
    }
    memcpy(run->lu, k, (size_t)n * n * sizeof(double));
    return lag_lu(run->lu, run->pivots, n);
}

/* Solve with the factors, with one step of iterative refinement. */
static void solve_refined(lag_run *run)
{
    const int n = order_of(run);
    double *x = run->solution, *r = run->work;
    memcpy(x, run->right, (size_t)n * sizeof(double));
    lag_lu_solve(run->lu, run->pivots, n, x);
    for (int i = 0; i < n; ++i) {
        double sum = run->right[i];
        const double *row = run->kkt + i * n;
        for (int j = 0; j < n; ++j)
            sum -= row[j] * x[j];
        r[i] = sum;
    }
    lag_lu_solve(run->lu, run->pivots, n, r);
    for (int i = 0; i < n; ++i)
        x[i] += r[i];
}

/* a, lambda (in `solution`: a, then -lambda over the weights) and the power at a state.
 * Returns 0, or 1 where they are undefined. */
static int accelerate(lag_run *run, double t, const double *y, int refined, double *power)
{
    const lag_system *s = run->system;
    const int nq = s->nq, nc = s->nc, n = order_of(run), first = s->nm + nq + s->nb;
    ++run->evaluations;
    if (run->baumgarte)
        evaluate(&s->constraint, s, t, y);
    evaluate(&s->dynamics, s, t, y);
    int bad = factor(run);
    if (!bad) {
        double *right = run->right;
        for (int i = 0; i < nq; ++i)
            right[i] = OUT(&s->dynamics, s->nm + i);
        for (int i = 0; i < nc; ++i)
            right[nq + i] = OUT(&s->dynamics, first + i);
        if (run->baumgarte) {
            const lag_tape *c = &s->constraint;
            double *psi = run->work;
            for (int i = 0; i < nc; ++i)
                psi[i] = OUT(c, s->nh + s->nb + i);
            for (int i = 0; i < s->nb; ++i)
                psi[s->jacobian_places[i] / nq] +=
                    OUT(c, s->nh + i) * y[nq + s->jacobian_places[i] % nq];
            for (int i = 0; i < nc; ++i)
                right[nq + i] -= run->alpha * psi[i];
            for (int i = 0; i < s->nh; ++i) {
                const int k = s->holonomic[i];
                right[nq + k] -= run->alpha * psi[k] + run->beta * run->beta * OUT(c, i);
            }
        }
        for (int i = 0; i < nc; ++i)
            right[nq + i] *= run->weight[i];
        for (int i = nq + nc; i < n; ++i)
            right[i] = 0.0;
        if (refined) {
            solve_refined(run);
        } else {
            memcpy(run->solution, right, (size_t)n * sizeof(double));
            lag_lu_solve(run->lu, run->pivots, n, run->solution);
        }
        double sum = 0.0;
        for (int i = 0; i < n; ++i)
            sum += run->solution[i];
        bad = !isfinite(sum);
    }
    if (bad) {
        run->t_bad = t;
        memcpy(run->y_bad, y, (size_t)size_of(s) * sizeof(double));
        return 1;
    }
    double p = OUT(&s->dynamics, first + nc);
    for (int i = 0; i < s->nb; ++i) {
        const int row = s->jacobian_places[i] / nq, column = s->jacobian_places[i] % nq;
        p -= run->solution[nq + row] * run->weight[row] * OUT(&s->dynamics, s->nm + nq + i)
             * y[nq + column];
    }
    *power = p;
    return 0;
}

static int derivative(lag_run *run, double t, const double *y, double *f)
{
    const int nq = run->system->nq;
    if (accelerate(run, t, y, 0, f + 2 * nq))
        return 1;
    memcpy(f, y + nq, (size_t)nq * sizeof(double));
    memcpy(f + nq, run->solution, (size_t)nq * sizeof(double));
    return 0;
}

int lag_project(lag_run *run, double t, double *y)
{
    const lag_system *s = run->system;
    const lag_tape *c = &s->constraint;
    const int nq = s->nq, nc = s->nc, nh = s->nh, n = order_of(run);
    double *x = run->solution, best = INFINITY;
    int met = 0;
    if (nc == 0)
        return LAG_RUNNING;
    run->t_bad = t;
    memcpy(run->y_bad, y, (size_t)size_of(s) * sizeof(double));
    evaluate(&s->dynamics, s, t, y);
    if (factor(run))
        return LAG_UNDEFINED;
    for (int iteration = 0; iteration < PROJECTIONS; ++iteration) {
        evaluate(c, s, t, y);
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
                evaluate(c, s, t, y);
            }
            met = 1;
        }
        if (met)
            break;
        best = worst;
        memcpy(run->trial, y, (size_t)nq * sizeof(double));
        memset(x, 0, (size_t)n * sizeof(double));
        for (int i = 0; i < nh; ++i)
            x[nq + s->holonomic[i]] = -OUT(c, i) * run->weight[s->holonomic[i]];
        lag_lu_solve(run->lu, run->pivots, n, x);
        for (int i = 0; i < nq; ++i)
            y[i] += x[i];
    }
    if (!met)
        return LAG_OFF;
    /* linear in the velocities: the second time removes rounding */
    for (int iteration = 0; iteration < 2; ++iteration) {
        met = 1;
        memset(x, 0, (size_t)n * sizeof(double));
        for (int i = 0; i < nc; ++i)
            x[nq + i] = OUT(c, nh + s->nb + i);
        for (int i = 0; i < s->nb; ++i)
            x[nq + s->jacobian_places[i] / nq] +=
                OUT(c, nh + i) * y[nq + s->jacobian_places[i] % nq];
        for (int i = 0; i < nc; ++i) {
            const double scale = OUT(c, nh + s->nb + nc + nh + i);
            if (scale > run->scale_velocity[i])
                run->scale_velocity[i] = scale;
            if (!(fabs(x[nq + i]) <= RESIDUAL * run->scale_velocity[i]))
                met = 0;
            x[nq + i] *= -run->weight[i];
        }
        if (met)
            break;
        lag_lu_solve(run->lu, run->pivots, n, x);
        for (int i = 0; i < nq; ++i)
            y[nq + i] += x[i];
    }
    return LAG_RUNNING;
}

double lag_weakest(lag_run *run, double t, const double *y)
{
    const lag_system *s = run->system;
    const lag_tape *c = &s->constraint;
    if (run->rank == 0)
        return 1.0;
    evaluate(c, s, t, y);
    if (scaled_rows(run, c, s->nh))
        return 1.0;
    return lag_pivot(run->rows, s->nq, s->nc, run->rank, run->order, run->components);
}

/* Keep the largest length that each row of B has had; the constraint tape holds the state. */
static void measure(lag_run *run)
{
    const lag_system *s = run->system;
    double *sum = run->work;
    memset(sum, 0, (size_t)s->nc * sizeof(double));
    for (int i = 0; i < s->nb; ++i) {
        const double x = OUT(&s->constraint, s->nh + i);
        sum[s->jacobian_places[i] / s->nq] += x * x;
    }
    for (int i = 0; i < s->nc; ++i)
        if (sqrt(sum[i]) > run->lengths[i])
            run->lengths[i] = sqrt(sum[i]);
}

/* The 2-norm of x over the tolerances at y and z: every component within its own where <= 1. */
static double scaled_norm(const lag_run *run, const double *x, const double *y, const double *z)
{
    const int n = size_of(run->system);
    double sum = 0.0;
    for (int i = 0; i < n; ++i) {
        const double e = x[i] / (run->atol + run->rtol * fmax(fabs(y[i]), fabs(z[i])));
        sum += e * e;
    }
    return sqrt(sum);
}

/* Hairer, Norsett & Wanner, II.4: a first step from the sizes of y, y' and y''. */
static int first_step(lag_run *run)
{
    const int n = size_of(run->system);
    const double d0 = scaled_norm(run, run->y, run->y, run->y);
    const double d1 = scaled_norm(run, run->f, run->y, run->y);
    double h = d0 < 1e-5 || d1 < 1e-5 ? 1e-6 : 0.01 * d0 / d1;
    h = fmin(h, fmin(run->h_max, run->t_end - run->t));
    double *f1 = run->stages;
    for (int i = 0; i < n; ++i)
        run->y_new[i] = run->y[i] + h * run->f[i];
    if (derivative(run, run->t + h, run->y_new, f1)) {
        run->h = h; /* the step itself will find a size that is defined */
        return 0;
    }
    for (int i = 0; i < n; ++i)
        f1[i] -= run->f[i];
    const double d2 = scaled_norm(run, f1, run->y, run->y) / h;
    const double d = fmax(d1, d2);
    const double h1 = d <= 1e-15 ? fmax(1e-6, h * 1e-3) : pow(0.01 / d, 1.0 / 8.0);
    run->h = fmin(fmin(100.0 * h, h1), run->h_max);
    return 0;
}

/* Set the damping of the next step, and the derivative with it. */
static int damp(lag_run *run)
{
    if (!run->alpha_from_step)
        return LAG_RUNNING;
    run->alpha = BAUMGARTE_STEP / run->h;
    if (run->beta_from_alpha)
        run->beta = run->alpha;
    return derivative(run, run->t, run->y, run->f) ? LAG_UNDEFINED : LAG_RUNNING;
}

int lag_start(lag_run *run)
{
    if (run->projecting) {
        const int status = lag_project(run, run->t, run->y);
        if (status != LAG_RUNNING)
            return status;
    }
    if (derivative(run, run->t, run->y, run->f))
        return LAG_UNDEFINED;
    run->weakest = lag_weakest(run, run->t, run->y);
    run->usual = fmax(run->usual, run->weakest);
    run->error_old = 1e-4;
    run->finishing = 0;
    first_step(run);
    return damp(run);
}

/* One accepted step from (t, y, f) to (t + h, y_new, stage 12). */
static int step(lag_run *run)
{
    const int n = size_of(run->system);
    double *stage = run->stages;
    int rejected = 0, undefined = 0;
    for (;;) {
        double h = run->h;
        if (!(h > 10.0 * DBL_EPSILON * fabs(run->t)) || !(h > DBL_MIN * 1e10))
            return undefined ? LAG_UNDEFINED : LAG_FLOOR;
        int last = 0;
        if (run->t + 1.01 * h >= run->t_end) {
            h = run->t_end - run->t;
            last = 1;
        }
        memcpy(stage, run->f, (size_t)n * sizeof(double));
        int bad = 0;
        for (int i = 1; i <= DOP_STAGES && !bad; ++i) {
            const double *a = i < DOP_STAGES ? dop_a[i] : dop_b;
            double *y = run->y_new;
            for (int m = 0; m < n; ++m)
                y[m] = 0.0;
            for (int j = 0; j < i; ++j) {
                const double w = h * a[j];
                if (w == 0.0)
                    continue;
                const double *kj = stage + j * n;
                for (int m = 0; m < n; ++m)
                    y[m] += w * kj[m];
            }
            for (int m = 0; m < n; ++m)
                y[m] += run->y[m];
            const double c = i < DOP_STAGES ? dop_c[i] : 1.0;
            bad = derivative(run, run->t + c * h, y, stage + i * n);
        }
        double factor = 0.2;
        if (!bad) {
            double e5 = 0.0, e3 = 0.0;
            for (int m = 0; m < n; ++m) {
                double x5 = 0.0, x3 = 0.0;
                for (int i = 0; i <= DOP_STAGES; ++i) {
                    x5 += dop_e5[i] * stage[i * n + m];
                    x3 += dop_e3[i] * stage[i * n + m];
                }
                const double tolerance =
                    run->atol + run->rtol * fmax(fabs(run->y[m]), fabs(run->y_new[m]));
                x5 /= tolerance;
                x3 /= tolerance;
                e5 += x5 * x5;
                e3 += x3 * x3;
            }
            const double below = e5 + 0.01 * e3;
            const double error = below > 0.0 ? h * e5 / sqrt(below) : 0.0;
            /* PI control, Hairer & Wanner IV.2, with beta = 0.04 */
            factor = error > 0.0
                         ? 0.9 * pow(error, -1.0 / 8.0 + 0.03) * pow(run->error_old, 0.04)
                         : 10.0;
            if (error <= 1.0) {
                factor = fmin(fmax(factor, 0.2), rejected ? 1.0 : 10.0);
                run->error_old = fmax(error, 1e-4);
                run->t_old = run->t;
                run->h_old = h;
                memcpy(run->y_old, run->y, (size_t)n * sizeof(double));
                run->t = last ? run->t_end : run->t + h;
                run->h = fmin(h * factor, run->h_max);
                run->dense_ready = 0;
                ++run->steps;
                return LAG_RUNNING;
            }
            factor = fmax(0.9 * pow(error, -1.0 / 8.0), 0.2);
        }
        undefined |= bad;
        run->h = h * factor;
        rejected = 1;
        ++run->rejected;
    }
}

void lag_dense(lag_run *run, double t, double *y)
{
    const int n = size_of(run->system);
    const double h = run->h_old, *stage = run->stages;
    double *d = run->dense;
    if (!run->dense_ready) {
        for (int i = DOP_STAGES + 1; i < DOP_ALL_STAGES; ++i) {
            double *trial = run->trial;
            memcpy(trial, run->y_old, (size_t)n * sizeof(double));
            for (int j = 0; j < i; ++j)
                for (int m = 0; m < n; ++m)
                    trial[m] += h * dop_a[i][j] * stage[j * n + m];
            /* undefined values cannot arise: the step around it was accepted; if they do, the
             * sample's own check finds them */
            if (derivative(run, run->t_old + dop_c[i] * h, trial, run->stages + i * n))
                for (int m = 0; m < n; ++m)
                    run->stages[i * n + m] = NAN;
        }
        for (int m = 0; m < n; ++m) {
            const double delta = run->y_new[m] - run->y_old[m];
            d[m] = delta;
            d[n + m] = h * stage[m] - delta;
            d[2 * n + m] = 2.0 * delta - h * (stage[DOP_STAGES * n + m] + stage[m]);
            for (int i = 0; i < 4; ++i) {
                double sum = 0.0;
                for (int j = 0; j < DOP_ALL_STAGES; ++j)
                    sum += dop_d[i][j] * stage[j * n + m];
                d[(3 + i) * n + m] = h * sum;
            }
        }
        run->dense_ready = 1;
    }
    const double x = (t - run->t_old) / h;
    for (int m = 0; m < n; ++m) {
        double sum = 0.0;
        for (int i = 0; i < 7; ++i) {
            sum += d[(6 - i) * n + m];
            sum *= i % 2 == 0 ? x : 1.0 - x;
        }
        y[m] = run->y_old[m] + sum;
    }
}

/* Write the consistent state at a sample time, with its a and lambda. */
static int sample(lag_run *run, double t, double *y)
{
    const lag_system *s = run->system;
    const int nq = s->nq, nc = s->nc;
    double power, *row = run->block + run->block_used * (2 + 3 * nq + nc);
    if (run->projecting) {
        const int status = lag_project(run, t, y);
        if (status != LAG_RUNNING)
            return status;
    }
    if (accelerate(run, t, y, 1, &power))
        return LAG_UNDEFINED;
    row[0] = t;
    memcpy(row + 1, y, 2 * (size_t)nq * sizeof(double));
    memcpy(row + 1 + 2 * nq, run->solution, (size_t)nq * sizeof(double));
    for (int i = 0; i < nc; ++i)
        row[1 + 3 * nq + i] = -run->solution[nq + i] * run->weight[i];
    row[1 + 3 * nq + nc] = y[2 * nq];
    ++run->block_used;
    ++run->times_next;
    return LAG_RUNNING;
}

int lag_sample_until(lag_run *run, double end)
{
    const int n = size_of(run->system);
    double *y = run->y_sample;
    while (run->times_next < run->times_count && run->times[run->times_next] <= end) {
        const double t = run->times[run->times_next];
        if (run->block_used == run->block_rows)
            return LAG_BLOCK_FULL;
        if (run->finishing && t < run->t)
            lag_dense(run, t, y);
        else
            memcpy(y, run->finishing ? run->y_new : run->y, (size_t)n * sizeof(double));
        const int status = sample(run, t, y);
        if (status != LAG_RUNNING)
            return status;
    }
    return LAG_RUNNING;
}

/* The weakest pivot on the cubic through the last step's ends: B depends on q and t alone. */
static double weakest_inside(lag_run *run, double x)
{
    const int nq = run->system->nq;
    const double h = run->h_old, z = 1.0 - x;
    const double *q0 = run->y_old, *v0 = q0 + nq, *q1 = run->y_new, *v1 = q1 + nq;
    double *y = run->y_sample;
    for (int m = 0; m < nq; ++m)
        y[m] = z * z * ((1.0 + 2.0 * x) * q0[m] + x * h * v0[m])
               + x * x * ((1.0 + 2.0 * z) * q1[m] - z * h * v1[m]);
    memcpy(y + nq, v1, (size_t)nq * sizeof(double));
    return lag_weakest(run, run->t_old + x * h, y);
}

/* Whether the weakest pivot passes a small minimum inside the last step. */
static int goes_over(lag_run *run)
{
    /* the places next to the ends show whether it falls or rises there */
    static const double place[] = {0.0, 0.001, 0.25, 0.5, 0.75, 0.999, 1.0};
    double value[7];
    value[0] = run->weakest;
    for (int i = 1; i < 7; ++i)
        value[i] = weakest_inside(run, place[i]);
    for (int i = 1; i < 6; ++i) {
        if (value[i] > value[i - 1] || value[i] > value[i + 1])
            continue;
        /* golden section, until the bracket is short against what a cubic can say */
        double low = place[i - 1], high = place[i + 1], least = value[i];
        double a = high - GOLDEN * (high - low), b = low + GOLDEN * (high - low);
        double fa = weakest_inside(run, a), fb = weakest_inside(run, b);
        for (int k = 0; k < 12; ++k) {
            if (fa < fb) {
                high = b, b = a, fb = fa;
                fa = weakest_inside(run, a = high - GOLDEN * (high - low));
            } else {
                low = a, a = b, fa = fb;
                fb = weakest_inside(run, b = low + GOLDEN * (high - low));
            }
            least = fmin(least, fmin(fa, fb));
        }
        if (least < OVER * run->usual)
            return 1;
    }
    return 0;
}

int lag_finish(lag_run *run)
{
    const int n = size_of(run->system);
    const int status = lag_sample_until(run, run->t);
    if (status != LAG_RUNNING)
        return status;
    run->finishing = 0;
    memcpy(run->y, run->y_new, (size_t)n * sizeof(double));
    memcpy(run->f, run->stages + DOP_STAGES * n, (size_t)n * sizeof(double));
    const int damped = damp(run);
    if (damped != LAG_RUNNING)
        return damped;
    if (run->projecting && run->system->nc) {
        const int off = lag_project(run, run->t, run->y);
        if (off != LAG_RUNNING)
            return off;
        measure(run);
        for (int i = 0; i < n; ++i)
            run->trial[i] = run->y[i] - run->y_new[i];
        if (scaled_norm(run, run->trial, run->y, run->y) > NEGLIGIBLE
            && derivative(run, run->t, run->y, run->f))
            return LAG_UNDEFINED;
        /* f holds q' = v exactly in any case */
        memcpy(run->f, run->y + run->system->nq, (size_t)run->system->nq * sizeof(double));
    }
    return LAG_RUNNING;
}

int lag_advance(lag_run *run, long slice)
{
    for (;;) {
        if (run->finishing) {
            const int status = lag_finish(run);
            if (status != LAG_RUNNING)
                return status;
            if (run->watching) {
                const double before = run->weakest;
                run->weakest = lag_weakest(run, run->t, run->y);
                run->usual = fmax(run->usual, run->weakest);
                if (run->weakest < fmin(before, NEAR * run->usual))
                    return LAG_NEAR;
            }
        }
        if (run->t >= run->t_end)
            return LAG_DONE;
        if (slice-- <= 0)
            return LAG_RUNNING;
        const int status = step(run);
        if (status != LAG_RUNNING)
            return status;
        run->finishing = 1;
        if (run->watching > 1 && goes_over(run))
            return LAG_OVER;
    }
}
