#include "fmi/directional.h"

#include <math.h>
#include <string.h>

#include "bind.h"
#include "breaks.h"
#include "derivatives/changes.h"
#include "evaluate.h"
#include "linear/dense.h"
#include "model/simulation.h"
#include "motion.h"
#include "solution.h"
#include "switching/rows.h"

/* Bind the programs for the present simulation. Returns 0, or 1 where there is no memory. */
static int bind(lag_fmu *fmu)
{
    lag_fmu_directions *d = &fmu->directions;
    lag_run *run = lag_run_of(fmu->simulation);
    if (d->bound == fmu->simulation)
        return 0;
    const int switches = fmu->model.contents & LAG_MODEL_SWITCHING;
    lag_bind_program(&fmu->run_pool, &d->parameter_tape, &d->of_parameters, run->kernel);
    if (fmu->run_pool.failed || (switches ? lag_use_directions(run, &d->along) : lag_bind(run, &fmu->run_pool, &d->equation_tape, &d->of_equations))
        || lag_bind(run, &fmu->run_pool, &d->column_tape, &d->of_columns))
        return 1;
    d->bound = fmu->simulation;
    return 0;
}

/* Copy numbers and return where the next ones go. */
static double *put(double *to, const double *from, int64_t count)
{
    memcpy(to, from, (size_t)count * sizeof *to);
    return to + count;
}

/* delta p, from those of the parameters that can be set: after their values in d->seeds. */
static void change_parameters(lag_fmu *fmu)
{
    lag_fmu_directions *d = &fmu->directions;
    const lag_tape *tape = &d->parameter_tape;
    memcpy(d->seeds, fmu->taken, (size_t)fmu->settable * sizeof(double));
    put(tape->registers, d->seeds, 2 * (int64_t)fmu->settable);
    tape->vectors->run(tape->prelude, tape->registers);
    lag_tape_run(tape, &tape->stream);
    memset(d->p, 0, (size_t)d->parameters * sizeof *d->p);
    for (int i = 0; i < fmu->own; ++i)
        d->p[i] = OUT(tape, i);
}

/* delta (f - M a + B' lambda) and delta (gamma - B a) at fixed a and lambda: to d->right. */
static void right_side(lag_fmu *fmu, const double *state, const double *multipliers, const double *of_state)
{
    const lag_run *run = lag_run_of(fmu->simulation);
    const lag_system *s = &run->system;
    lag_fmu_directions *d = &fmu->directions;
    const lag_tape *tape = &d->equation_tape;
    const double *a = state + 1 + 2 * s->nq;
    double *right = d->right;
    lag_tape_set(tape, run->np, run->parameters);
    double *r = put(tape->registers, state, 1 + 2 * (int64_t)s->nq);
    r = put(r, of_state, 1 + 2 * (int64_t)s->nq);
    put(r, d->p, d->parameters);
    lag_tape_run(tape, &tape->stream);
    for (int i = 0; i < s->nq; ++i)
        right[i] = OUT(tape, s->nm + i);
    for (int i = 0; i < s->nc; ++i)
        right[s->nq + i] = OUT(tape, s->nm + s->nq + s->nb + i);
    for (int i = 0; i < s->nm; ++i)
        right[s->mass_row[i]] -= OUT(tape, i) * a[s->mass_column[i]];
    for (int i = 0; i < s->nb; ++i) {
        const int row = s->jacobian_row[i], column = s->jacobian_column[i];
        const double change = OUT(tape, s->nm + s->nq + i);
        right[column] += change * multipliers[row];
        right[s->nq + row] -= change * a[column];
    }
}

/* X = A B of n rows and m columns, with sums of `inner` terms: A has entries A[i * ai + k * ak], B has B[k * bk + j * bj]. */
static void multiply(int n, int inner, int m, const double *A, int ai, int ak, const double *B, int bk, int bj, double *X)
{
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < m; ++j) {
            double sum = 0.0;
            for (int k = 0; k < inner; ++k)
                sum += A[i * ai + k * ak] * B[k * bk + j * bj];
            X[i * m + j] = sum;
        }
}

/* Factor what the changes of redundant constraints need at the present values, and find mu. Returns 0, or 1 where the
 * independent rows depend on each other. */
static int factor_redundant(lag_fmu *fmu)
{
    const lag_system *s = &lag_run_of(fmu->simulation)->system;
    const lag_tape *of = &s->dynamics;
    lag_fmu_directions *d = &fmu->directions;
    const int nq = s->nq, nc = s->nc, rank = d->rank, n = nq + rank;
    const double *multipliers = fmu->values + 1 + 3 * nq;
    double *own = d->independent, largest = 0.0;
    memset(own, 0, (size_t)rank * (size_t)nq * sizeof *own);
    memset(d->matrix, 0, (size_t)n * (size_t)n * sizeof *d->matrix);
    memset(d->shares, 0, (size_t)nc * (size_t)rank * sizeof *d->shares);
    lag_evaluate(of, s, fmu->values[0], fmu->values + 1, LAG_ALL);
    for (int i = 0; i < s->nm; ++i) {
        d->matrix[s->mass_row[i] * n + s->mass_column[i]] = OUT(of, i);
        largest = fmax(largest, OUT(of, i));
    }
    for (int i = 0, k = 0; i < s->nb; ++i) {
        for (k = 0; k < rank && d->rows[k] != s->jacobian_row[i]; ++k)
            ;
        if (k < rank)
            own[k * nq + s->jacobian_column[i]] = OUT(of, lag_first_jacobian(s) + i);
    }
    for (int k = 0; k < rank; ++k) {
        double sum = 0.0;
        for (int j = 0; j < nq; ++j)
            sum += own[k * nq + j] * own[k * nq + j];
        d->weight[k] = largest / sqrt(sum);
        for (int j = 0; j < nq; ++j)
            d->matrix[(nq + k) * n + j] = d->matrix[j * n + nq + k] = d->weight[k] * own[k * nq + j];
    }
    /* rows of C: (B_r B_r')^-1 B_r times rows of B */
    for (int i = 0; i < s->nb; ++i)
        for (int k = 0; k < rank; ++k)
            d->shares[s->jacobian_row[i] * rank + k] +=
                own[k * nq + s->jacobian_column[i]] * OUT(of, lag_first_jacobian(s) + i);
    multiply(rank, nq, rank, own, nq, 1, own, 1, nq, d->square);
    if (lag_lu(d->matrix, d->pivots, n) || lag_lu(d->square, d->pivots + n, rank))
        return 1;
    for (int i = 0; i < nc; ++i)
        lag_lu_solve(d->square, d->pivots + n, rank, d->shares + i * rank);
    multiply(rank, nc, rank, d->shares, 1, rank, d->shares, rank, 1, d->inner);
    if (lag_lu(d->inner, d->pivots + n + rank, rank))
        return 1;
    double *mu = d->solution;
    multiply(rank, nc, 1, d->shares, 1, rank, multipliers, 1, 1, mu);
    memset(d->mu, 0, (size_t)nc * sizeof *d->mu);
    for (int k = 0; k < rank; ++k)
        d->mu[d->rows[k]] = mu[k];
    /* B_r' (B_r B_r')^-1 (C' C)^-1 mu: changes of B times it are those of C times (C' C)^-1 mu, but for rows of C */
    lag_lu_solve(d->inner, d->pivots + n + rank, rank, mu);
    lag_lu_solve(d->square, d->pivots + n, rank, mu);
    multiply(nq, rank, 1, own, 1, nq, mu, 1, 1, d->least);
    return 0;
}

/* delta a and delta lambda, to x, from d->right for mu in place of lambda, and the changes of B that the tape holds. */
static void solve_redundant(lag_fmu *fmu, double *x)
{
    const lag_system *s = &lag_run_of(fmu->simulation)->system;
    lag_fmu_directions *d = &fmu->directions;
    const int nq = s->nq, nc = s->nc, rank = d->rank, n = nq + rank;
    const double *multipliers = fmu->values + 1 + 3 * nq;
    double *of_multipliers = x + nq, *solution = d->solution, *across = d->right, *turn = d->right + nq;
    memcpy(solution, d->right, (size_t)nq * sizeof *solution);
    for (int k = 0; k < rank; ++k)
        solution[nq + k] = d->weight[k] * d->right[nq + d->rows[k]];
    lag_lu_solve(d->matrix, d->pivots, n, solution);
    memcpy(x, solution, (size_t)nq * sizeof *x);
    memset(d->right, 0, (size_t)(nq + nc) * sizeof *d->right);
    for (int i = 0; i < s->nb; ++i) {
        const int row = s->jacobian_row[i], column = s->jacobian_column[i];
        const double change = OUT(&d->equation_tape, s->nm + nq + i);
        across[column] += change * (multipliers[row] - d->mu[row]);
        turn[row] += change * d->least[column];
    }
    double *change = of_multipliers, *back = solution; /* rank each */
    for (int k = 0; k < rank; ++k)
        change[k] = -solution[nq + k] * d->weight[k];
    multiply(rank, nq, 1, d->independent, nq, 1, across, 1, 1, back);
    lag_lu_solve(d->square, d->pivots + n, rank, back);
    for (int k = 0; k < rank; ++k)
        change[k] -= back[k];
    for (int k = 0; k < rank; ++k)
        back[k] = turn[d->rows[k]];
    for (int i = 0; i < nc; ++i)
        for (int k = 0; k < rank; ++k)
            turn[i] -= d->shares[i * rank + k] * back[k];
    multiply(rank, nc, 1, d->shares, 1, rank, turn, 1, 1, back);
    for (int k = 0; k < rank; ++k)
        back[k] = change[k] - back[k];
    lag_lu_solve(d->inner, d->pivots + n + rank, rank, back);
    multiply(nc, rank, 1, d->shares, rank, 1, back, 1, 1, of_multipliers);
    for (int i = 0; i < nc; ++i)
        of_multipliers[i] += turn[i];
}

/* delta a and delta lambda, to x, of a model that switches, in its present modes. Returns 0, or 1 where there are none, or
 * a force that rows share is not unique. */
static int solve_in_modes(lag_fmu *fmu, double *x)
{
    lag_run *run = lag_run_of(fmu->simulation);
    lag_derivatives *w = &run->derivatives;
    const lag_fmu_directions *d = &fmu->directions;
    const int nq = run->system.nq;
    const double t = fmu->values[0], *y = fmu->values + 1, *changes = d->changes;
    const lag_direction along = {changes[0], changes + 1, changes + 1 + nq, d->p};
    double power;
    const lag_tape *tapes[] = {&w->dynamics, &w->functions, &w->limits, &w->forces, &w->kink_rates};
    for (size_t i = 0; i < sizeof tapes / sizeof *tapes; ++i)
        lag_tape_set(tapes[i], run->np, run->parameters);
    if (lag_accelerate(run, t, y, 0, &power) || lag_differentiate(run, t, y, 1, &along) || w->redundant)
        return 1;
    memcpy(x, w->of_a, (size_t)nq * sizeof *x);
    lag_gather_multipliers(run, w->of_a + nq, w->of_z, x + nq);
    return 0;
}

/* The changes of all values along those of t, q, v, in d->changes, and of the parameters that can be set. */
static int change_all(lag_fmu *fmu)
{
    lag_run *run = lag_run_of(fmu->simulation);
    const lag_system *s = &run->system;
    lag_fmu_directions *d = &fmu->directions;
    const int nq = s->nq, nc = fmu->nc, state = 1 + 2 * nq, known = state + nq + nc;
    double *x = d->right + nq + nc, *changes = d->changes, sum = 0.0, power;
    change_parameters(fmu);
    if (fmu->model.contents & LAG_MODEL_SWITCHING) {
        if (solve_in_modes(fmu, x))
            return 1;
    } else if (d->rank < nc) {
        if (factor_redundant(fmu))
            return 1;
        right_side(fmu, fmu->values, d->mu, changes);
        solve_redundant(fmu, x);
    } else {
        if (lag_accelerate(run, fmu->values[0], fmu->values + 1, 1, &power)
            || lag_factor(run, fmu->values[0], fmu->values + 1))
            return 1;
        right_side(fmu, fmu->values, fmu->values + state + nq, changes);
        lag_solve(run, d->right, x, 1);
        lag_turn(x + nq, nc);
    }
    put(changes + state, x, nq + nc);
    const lag_tape *tape = &d->column_tape;
    memcpy(fmu->held, lag_parameters_of(fmu->simulation), (size_t)run->np * sizeof(double));
    lag_pieces_at(run, fmu->values[0], fmu->held);
    lag_tape_set(tape, run->np, fmu->held);
    double *r = put(tape->registers, fmu->values, known);
    r = put(r, changes, known);
    put(r, d->p, d->parameters);
    lag_tape_run(tape, &tape->stream);
    for (int64_t i = 0; i < fmu->derived; ++i)
        changes[known + i] = OUT(tape, i);
    put(changes + known + fmu->derived, d->p, fmu->own);
    for (int i = state; i < known; ++i)
        sum += changes[i];
    return !isfinite(sum);
}

/* Where the change of a known goes; NULL, and a message, if it is none. */
static double *place_of(lag_fmu *fmu, unsigned reference)
{
    lag_fmu_directions *d = &fmu->directions;
    const int64_t first = fmu->count - fmu->own;
    if (reference < 1 + 2 * (unsigned)fmu->nq)
        return d->changes + reference;
    for (int i = 0; i < fmu->settable; ++i)
        if (reference == first + fmu->place[i])
            return d->seeds + fmu->settable + i;
    lag_fmu_fail(fmu, "there are no derivatives with respect to the variable with the value reference %u", reference);
    return NULL;
}

/* Returns 0, or 1, and a message, if a reference is that of no variable. */
static int check_references(const lag_fmu *fmu, const unsigned *references, size_t count)
{
    for (size_t i = 0; i < count; ++i)
        if (references[i] >= (uint64_t)fmu->count)
            return lag_fmu_fail(fmu, "there is no variable with the value reference %u", references[i]);
    return 0;
}

/* Begin a direction: values, tapes, no changes. */
static int begin(lag_fmu *fmu, const unsigned *unknowns, size_t count)
{
    lag_fmu_directions *d = &fmu->directions;
    if (!d->has)
        return lag_fmu_fail(fmu, fmu->model.contents & LAG_MODEL_SWITCHING
                                     ? "a model that switches has no directional derivatives if its constraints are redundant"
                                     : "it is not clear at the initial state which of the redundant constraints are"
                                       " independent: there are no directional derivatives");
    if (lag_fmu_get(fmu, NULL, 0, NULL))
        return 1;
    if (!fmu->simulation || !fmu->current)
        return lag_fmu_fail(fmu, "there are no derivatives before the initialization");
    if (check_references(fmu, unknowns, count))
        return 1;
    if (bind(fmu))
        return lag_fmu_fail(fmu, "there is no memory");
    memset(d->changes, 0, (size_t)fmu->count * sizeof *d->changes);
    memset(d->seeds, 0, 2 * (size_t)fmu->settable * sizeof *d->seeds);
    return 0;
}

int lag_fmu_directional(lag_fmu *fmu, const unsigned *unknowns, size_t unknown_count, const unsigned *knowns,
                        size_t known_count, const double *seed, double *changes)
{
    if (begin(fmu, unknowns, unknown_count))
        return 1;
    for (size_t i = 0; i < known_count; ++i) {
        double *place = place_of(fmu, knowns[i]);
        if (!place)
            return 1;
        *place += seed[i];
    }
    if (change_all(fmu)) {
        lag_fmu_fail(fmu, "there are no derivatives at t = %.9g s: the equations have none, or contacts share a force",
                     fmu->values[0]);
        return LAG_FMU_NO_DERIVATIVES;
    }
    for (size_t i = 0; i < unknown_count; ++i)
        changes[i] = fmu->directions.changes[unknowns[i]];
    return 0;
}

int lag_fmu_adjoint(lag_fmu *fmu, const unsigned *unknowns, size_t unknown_count, const unsigned *knowns,
                    size_t known_count, const double *seed, double *changes)
{
    const double one = 1.0;
    if (check_references(fmu, unknowns, unknown_count))
        return 1;
    for (size_t k = 0; k < known_count; ++k) {
        const int failed = lag_fmu_directional(fmu, NULL, 0, knowns + k, 1, &one, NULL);
        if (failed)
            return failed;
        changes[k] = 0.0;
        for (size_t i = 0; i < unknown_count; ++i)
            changes[k] += seed[i] * fmu->directions.changes[unknowns[i]];
    }
    return 0;
}
