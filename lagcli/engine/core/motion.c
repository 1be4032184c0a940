#include "motion.h"

#include <math.h>
#include <string.h>

#include "linear.h"

int lag_size(const lag_system *s)
{
    return 2 * s->nq + 1;
}

void lag_evaluate(const lag_tape *tape, const lag_system *s, double t, const double *y)
{
    tape->registers[0] = t;
    memcpy(tape->registers + 1, y, 2 * (size_t)s->nq * sizeof(double));
    lag_stream_run(tape->stream, tape->registers);
}

int lag_order(const lag_run *run)
{
    return run->system->nq + 2 * run->system->nc - run->rank;
}

int lag_scaled_rows(lag_run *run, const lag_tape *tape, int first)
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
int lag_factor(lag_run *run)
{
    const lag_system *s = run->system;
    const lag_tape *d = &s->dynamics;
    const int nq = s->nq, nc = s->nc, n = lag_order(run), first = s->nm + nq;
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
        if (lag_scaled_rows(run, d, first))
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
    const int n = lag_order(run);
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

int lag_accelerate(lag_run *run, double t, const double *y, int refined, double *power)
{
    const lag_system *s = run->system;
    const int nq = s->nq, nc = s->nc, n = lag_order(run), first = s->nm + nq + s->nb;
    ++run->evaluations;
    if (run->baumgarte)
        lag_evaluate(&s->constraint, s, t, y);
    lag_evaluate(&s->dynamics, s, t, y);
    int bad = lag_factor(run);
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
        memcpy(run->y_bad, y, (size_t)lag_size(s) * sizeof(double));
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

int lag_derivative(lag_run *run, double t, const double *y, double *f)
{
    const int nq = run->system->nq;
    if (lag_accelerate(run, t, y, 0, f + 2 * nq))
        return 1;
    memcpy(f, y + nq, (size_t)nq * sizeof(double));
    memcpy(f + nq, run->solution, (size_t)nq * sizeof(double));
    return 0;
}

double lag_scaled_norm(const lag_run *run, const double *x, const double *y, const double *z)
{
    const int n = lag_size(run->system);
    double sum = 0.0;
    for (int i = 0; i < n; ++i) {
        const double e = x[i] / (run->atol + run->rtol * fmax(fabs(y[i]), fabs(z[i])));
        sum += e * e;
    }
    return sqrt(sum);
}
