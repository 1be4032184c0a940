#include "start/start.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "bind.h"
#include "linear/dense.h"
#include "linear/dependent_rows.h"

#define ITERATIONS 200      /* Newton steps */
#define WEIGHTED 30         /* number of those of least length by M after which plain ones are taken: where a light part
                             * could close a gap, they move it far */
#define HALVINGS 30         /* of one that does not reduce the residual */
#define RESIDUAL 1e-15      /* of the constraint's scale: end of the search */
#define ACCEPTED 1e-10      /* of the scale: largest residual of a state that counts as consistent */
#define INDEPENDENT 1e-6    /* part of a row that is independent where it is used, at least; below it, velocities hardly change it */
#define LEAST_PART 1e-3     /* as in engine/scales.py: part of the size of the state that a scale is, at least */
#define ROUNDING DBL_MIN    /* residuals below the normal numbers are rounding errors, of any relative size */
#define OF_GUESS 1e-5       /* part of the scale at the guess that a scale is, at least */
#define OF_RANK 1e-8        /* part of a row that is independent of the rows before it, at least */
#define CERTAINLY 1e-3      /* part of a row that is independent of those before it, for rows that need no singular values */
#define NOTHING 1e-14       /* part of its terms that a sum is, at least, unless it vanishes */
#define LONGEST 2.0         /* of the coordinates' size: longest step */
static const double aside[] = {0.0, 1e-3, 0.1}; /* of it: displacements of a guess without a solution */

int lag_start_take_spins(lag_start_search *s, lag_pool *pool, const int32_t *numbers, int count)
{
    s->spin_count = count / LAG_SPIN_NUMBERS;
    s->spins = lag_get(pool, (size_t)s->spin_count, sizeof *s->spins);
    for (int i = 0; s->spins && i < s->spin_count; ++i, numbers += LAG_SPIN_NUMBERS) {
        memcpy(s->spins[i].place, numbers, sizeof s->spins[i].place);
        memcpy(s->spins[i].fixed, numbers + 4, sizeof s->spins[i].fixed);
        s->spins[i].given = 1;
    }
    return !s->spins;
}

int lag_start_bind(lag_pool *pool, lag_start_search *s, int rows)
{
    const lag_equations *e = &s->equations;
    const int nq = e->nq, nc = e->nc > rows ? e->nc : rows;
    s->pool = pool;
    s->all = lag_get(pool, (size_t)nc + 1, sizeof *s->all);
    s->place = lag_get(pool, (size_t)nc + 1, sizeof *s->place);
    s->rows = lag_doubles(pool, (int64_t)nc * nq);
    s->right = lag_doubles(pool, nc);
    s->lengths = lag_doubles(pool, nc);
    s->sizes = lag_doubles(pool, nq);
    s->inertia = lag_doubles(pool, nq);
    s->x = lag_doubles(pool, nq);
    s->guess = lag_doubles(pool, nq);
    s->begin = lag_doubles(pool, nq);
    s->tried = lag_doubles(pool, nq);
    s->nearest = lag_doubles(pool, nq);
    s->fixed = lag_get(pool, (size_t)nq, sizeof *s->fixed);
    s->unit = lag_doubles(pool, nq);
    s->own = lag_doubles(pool, nc);
    s->least = lag_doubles(pool, nc);
    s->scale = lag_doubles(pool, nc);
    lag_bind_program(pool, &s->constraint, &e->constraint, LAG_PORTABLE);
    if (pool->failed)
        return 1;
    s->constraint.parameters = s->constraint.registers + e->constraint.inputs - e->np;
    for (int i = 0; i < e->nc; ++i) {
        s->all[i] = 1;
        s->place[i] = -1;
    }
    for (int i = 0; i < e->nh; ++i)
        s->place[e->holonomic[i]] = i;
    return 0;
}

/* What the metric needs. Returns 0, or 1 where there is no memory. */
static int bind_metric(lag_start_search *s)
{
    const int64_t nq = s->equations.nq, nc = s->equations.nc, n = nq + nc;
    if (s->measures)
        return 0;
    s->tested = lag_doubles(s->pool, nc * nq);
    s->mass = lag_doubles(s->pool, nq * nq);
    s->matrix = lag_doubles(s->pool, n * n);
    s->solution = lag_doubles(s->pool, n);
    s->pivots = lag_get(s->pool, (size_t)n, sizeof *s->pivots);
    lag_bind_program(s->pool, &s->dynamics, &s->dynamics_program, LAG_PORTABLE);
    if (s->pool->failed)
        return 1;
    s->dynamics.parameters = s->dynamics.registers + s->dynamics_program.inputs - s->np;
    s->measures = 1;
    return 0;
}

/* Evaluate a tape at a state. */
static void evaluate_tape(const lag_start_search *s, const lag_tape *tape, double t, const double *y)
{
    tape->registers[0] = t;
    memcpy(tape->registers + 1, y, 2 * (size_t)s->equations.nq * sizeof *y);
    lag_tape_run(tape, &tape->stream);
}

/* Evaluate the constraints at a state. */
static void evaluate(const lag_start_search *s, double t, const double *y)
{
    evaluate_tape(s, &s->constraint, t, y);
}

/* angular velocities */

/* G / 2 of e' = G omega / 2. */
static void rates_of_spin(const lag_spin *spin, const double *q, double g[4][3])
{
    const double a = 0.5 * q[spin->place[0]], b = 0.5 * q[spin->place[1]], c = 0.5 * q[spin->place[2]],
                 d = 0.5 * q[spin->place[3]];
    const double made[4][3] = {{-b, -c, -d}, {a, -d, c}, {d, a, -b}, {-c, b, a}};
    memcpy(g, made, sizeof made);
}

void lag_turn_quaternion(const lag_spin *spin, const double *omega, const double *q, double *v)
{
    double g[4][3];
    rates_of_spin(spin, q, g);
    for (int i = 0; i < 4; ++i)
        v[spin->place[i]] = g[i][0] * omega[0] + g[i][1] * omega[1] + g[i][2] * omega[2];
}

void lag_angular_velocity(const lag_spin *spin, const double *q, const double *v, double *omega)
{
    double g[4][3], square = 0.0;
    rates_of_spin(spin, q, g);
    for (int i = 0; i < 4; ++i)
        square += q[spin->place[i]] * q[spin->place[i]];
    for (int k = 0; k < 3; ++k) {
        omega[k] = 0.0;
        for (int i = 0; i < 4; ++i)
            omega[k] += 4.0 * g[i][k] * v[spin->place[i]] / square;
    }
}

/* Make the columns of a matrix of so many rows, for changes of v, those for changes of the angular velocities that are
 * given, which are at the first three places of e. */
static void take_spins(const lag_start_search *s, const double *q, double *matrix, int rows)
{
    const int nq = s->equations.nq;
    for (const lag_spin *spin = s->spins; spin < s->spins + s->spin_count; ++spin) {
        double g[4][3];
        if (!spin->given)
            continue;
        rates_of_spin(spin, q, g);
        for (int r = 0; r < rows; ++r) {
            double *row = matrix + r * nq, made[4] = {0.0};
            for (int k = 0; k < 3; ++k) {
                double terms = 0.0;
                for (int i = 0; i < 4; ++i) {
                    made[k] += row[spin->place[i]] * g[i][k];
                    terms += fabs(row[spin->place[i]] * g[i][k]);
                }
                if (fabs(made[k]) <= NOTHING * terms) /* all are tangent to |e| = 1 */
                    made[k] = 0.0;
            }
            for (int k = 0; k < 4; ++k)
                row[spin->place[k]] = made[k];
        }
    }
}

/* The unknowns of a change of positions, or of velocities at q: which of them are fixed, and their units. */
static void set_unknowns(lag_start_search *s, const int *fixed, const double *q)
{
    const double *sizes = s->sizes;
    for (int j = 0; j < s->equations.nq; ++j) {
        s->fixed[j] = fixed[j];
        s->unit[j] = sizes[j];
    }
    for (const lag_spin *spin = s->spins; q && spin < s->spins + s->spin_count; ++spin) {
        double g[4][3];
        if (!spin->given)
            continue;
        rates_of_spin(spin, q, g);
        s->fixed[spin->place[3]] = 1;
        for (int k = 0; k < 3; ++k) {
            double square = 0.0;
            for (int i = 0; i < 4; ++i)
                square += g[i][k] / sizes[spin->place[i]] * (g[i][k] / sizes[spin->place[i]]);
            s->fixed[spin->place[k]] = spin->fixed[k];
            s->unit[spin->place[k]] = square > 0.0 ? 1.0 / sqrt(square) : 1.0;
        }
    }
}

/* changes */

/* Find the sizes of coordinates without inertia, those that make their parts in the rows of B as large as those of others. */
static void complete_sizes(lag_start_search *s)
{
    const lag_equations *e = &s->equations;
    const int nq = e->nq;
    double *part = s->unit, *square = s->own;
    for (;;) {
        int lacking = 0, coupled = 0;
        memset(part, 0, (size_t)nq * sizeof *part);
        memset(square, 0, (size_t)e->nc * sizeof *square);
        for (int i = 0; i < e->nb; ++i) {
            const double b = OUT(&s->constraint, e->nh + i) * s->sizes[e->jacobian_column[i]];
            square[e->jacobian_row[i]] += b * b;
        }
        for (int i = 0; i < e->nb; ++i) {
            const int j = e->jacobian_column[i];
            const double length = sqrt(square[e->jacobian_row[i]]);
            if (s->sizes[j] == 0.0 && length > 0.0)
                part[j] = fmax(part[j], fabs(OUT(&s->constraint, e->nh + i)) / length);
        }
        for (int j = 0; j < nq; ++j) {
            lacking |= s->sizes[j] == 0.0;
            coupled |= part[j] > 0.0;
        }
        if (!lacking)
            return;
        for (int i = 0; i < e->nb && !coupled; ++i) { /* those that are left are coupled only to each other */
            const int j = e->jacobian_column[i];
            part[j] = fmax(part[j], fabs(OUT(&s->constraint, e->nh + i)));
        }
        for (int j = 0; j < nq; ++j)
            if (s->sizes[j] == 0.0 && (part[j] > 0.0 || !coupled))
                s->sizes[j] = part[j] > 0.0 ? 1.0 / part[j] : 1.0;
    }
}

/* Evaluate M at the state of the constraint tape, and the sizes of the coordinates there: the inertia of those with the same
 * unit is the largest of them. */
static void measure(lag_start_search *s, double t, const double *y)
{
    const lag_equations *e = &s->equations;
    const int nq = e->nq;
    int lacking = 0;
    double *largest = s->solution;
    evaluate_tape(s, &s->dynamics, t, y);
    memset(largest, 0, (size_t)nq * sizeof *largest);
    for (int i = 0; i < e->nm; ++i)
        if (e->mass_row[i] == e->mass_column[i]) {
            double *of_unit = largest + e->unit[e->mass_row[i]];
            *of_unit = fmax(*of_unit, OUT(&s->dynamics, i));
        }
    for (int j = 0; j < nq; ++j) {
        const double inertia = s->inertia[j] = largest[e->unit[j]];
        s->sizes[j] = inertia > 0.0 && isfinite(inertia) ? 1.0 / sqrt(inertia) : 0.0;
        lacking |= s->sizes[j] == 0.0;
    }
    if (lacking)
        complete_sizes(s);
}

/* Write M, as it has been evaluated, of the unknowns, in their units; q where they are velocities. Returns 0, or 1 where it is
 * undefined. */
static int weigh(lag_start_search *s, const double *q)
{
    const lag_equations *e = &s->equations;
    const int nq = e->nq;
    double *m = s->mass, sum = 0.0;
    memset(m, 0, (size_t)nq * (size_t)nq * sizeof *m);
    for (int i = 0; i < e->nm; ++i)
        m[e->mass_row[i] * nq + e->mass_column[i]] = OUT(&s->dynamics, i);
    for (int pass = 0; q && s->spin_count && pass < 2; ++pass) { /* G'M G: the columns, then the rows */
        take_spins(s, q, m, nq);
        for (int i = 0; i < nq; ++i)
            for (int j = 0; j < i; ++j) {
                const double x = m[i * nq + j];
                m[i * nq + j] = m[j * nq + i];
                m[j * nq + i] = x;
            }
    }
    for (int i = 0; i < nq; ++i)
        for (int j = 0; j < nq; ++j)
            sum += m[i * nq + j] *= s->unit[i] * s->unit[j];
    return !isfinite(sum);
}

/* The least change x by M, or by the units, by which independent rows become `right`. Returns 0, or 1 if there is none. */
static int solve_least(lag_start_search *s, int rank, int by_mass)
{
    const int nq = s->equations.nq, n = nq + rank;
    double *k = s->matrix, *z = s->solution, sum = 0.0;
    memset(k, 0, (size_t)n * (size_t)n * sizeof *k);
    memset(z, 0, (size_t)nq * sizeof *z);
    for (int i = 0; i < nq; ++i)
        if (s->fixed[i] || !by_mass)
            k[i * n + i] = 1.0;
        else
            for (int j = 0; j < nq; ++j)
                k[i * n + j] = s->fixed[j] ? 0.0 : s->mass[i * nq + j];
    for (int r = 0; r < rank; ++r) {
        const double *row = s->rows + r * nq, length = sqrt(lag_product(nq, row, row));
        for (int j = 0; j < nq; ++j)
            k[(nq + r) * n + j] = k[j * n + nq + r] = row[j] / length;
        z[nq + r] = s->right[r] / length;
    }
    if (lag_lu(k, s->pivots, n))
        return 1;
    lag_lu_solve(k, s->pivots, n, z);
    for (int j = 0; j < nq; ++j)
        sum += z[j];
    if (!isfinite(sum))
        return 1;
    memcpy(s->x, z, (size_t)nq * sizeof *z);
    return 0;
}

/* The lengths of m rows. */
static void write_lengths(lag_start_search *s, int m)
{
    const int nq = s->equations.nq;
    for (int i = 0; i < m; ++i) {
        double square = 0.0;
        for (int j = 0; j < nq; ++j)
            square += s->rows[i * nq + j] * s->rows[i * nq + j];
        s->lengths[i] = sqrt(square);
    }
}

/* The least change x of the unknowns, in their units, by which m rows become `right`, as well as possible where they depend
 * on each other: where a singular value of the rows over their lengths is less than `least`; q where they are velocities. By M,
 * which has been evaluated, if it is `weighted`, or by the units. */
static void find_least_change(lag_start_search *s, int m, double least, const double *q, int weighted)
{
    const int nq = s->equations.nq;
    for (int i = 0; i < m; ++i) {
        const double length = s->lengths[i] > 0.0 ? s->lengths[i] : 1.0;
        for (int j = 0; j < nq; ++j)
            s->rows[i * nq + j] /= length;
        s->right[i] /= length;
        s->lengths[i] = 1.0;
    }
    memset(s->x, 0, (size_t)nq * sizeof *s->x);
    memcpy(s->tested, s->rows, (size_t)m * (size_t)nq * sizeof *s->rows);
    int rank = lag_orthogonalize(CERTAINLY, m, nq, s->tested, s->lengths);
    if (rank < m)
        rank = lag_combine(least, m, nq, s->rows, 1, s->right, s->lengths);
    if (rank && (!weighted || weigh(s, q) || solve_least(s, rank, 1)))
        solve_least(s, rank, 0);
}

/* Write the rows of B times sizes, and their lengths, of equations whose tape of constraints has been evaluated. */
static void write_rows_of(lag_start_search *s, const lag_equations *e, const lag_tape *tape)
{
    memset(s->rows, 0, (size_t)e->nc * (size_t)e->nq * sizeof *s->rows);
    memset(s->lengths, 0, (size_t)e->nc * sizeof *s->lengths);
    for (int i = 0; i < e->nb; ++i) {
        const int j = e->jacobian_column[i], row = e->jacobian_row[i];
        const double b = s->sizes[j] * OUT(tape, e->nh + i);
        s->lengths[row] += b * b;
        s->rows[row * e->nq + j] = b;
    }
    for (int i = 0; i < e->nc; ++i)
        s->lengths[i] = sqrt(s->lengths[i]);
}

/* Those of the constraints that hold at the start. */
static void write_rows(lag_start_search *s)
{
    write_rows_of(s, &s->equations, &s->constraint);
}

/* The same of the unknowns, in their units, and of those that are not fixed alone; q where they are velocities. */
static void write_rows_of_unknowns(lag_start_search *s, const double *q)
{
    const lag_equations *e = &s->equations;
    const int nq = e->nq;
    const double *sizes = s->sizes;
    write_rows(s);
    for (int i = 0; q && s->spin_count && i < e->nc; ++i)
        for (int j = 0; j < nq; ++j)
            s->rows[i * nq + j] /= sizes[j];
    if (q && s->spin_count)
        take_spins(s, q, s->rows, e->nc);
    for (int i = 0; i < e->nc; ++i)
        for (int j = 0; j < nq; ++j)
            if (s->fixed[j])
                s->rows[i * nq + j] = 0.0;
            else if (q && s->spin_count)
                s->rows[i * nq + j] *= s->unit[j];
}

/* residuals */

double lag_largest_residual(const lag_tape *tape, int n, int first, int scale)
{
    double largest = 0.0;
    for (int i = 0; i < n; ++i) {
        const double value = OUT(tape, first + i), size = OUT(tape, scale + i);
        if (!isfinite(value))
            return INFINITY;
        if (value != 0.0)
            largest = fmax(largest, size > 0.0 ? fabs(value) / size : INFINITY);
    }
    return largest;
}

/* The largest of |x| (q or v), in sizes. */
static double largest_in_sizes(const lag_start_search *s, const double *x)
{
    double size = 0.0;
    for (int j = 0; j < s->equations.nq; ++j)
        size = fmax(size, fabs(x[j]) / s->sizes[j]);
    return size;
}

/*
 * The largest of n residuals, outputs from `first` on, over their scales; INFINITY where one is not finite. All terms of
 * a constraint may vanish at a state: a scale is at least what the sizes of the coordinates x (q or v) imply, and a
 * part of that at the guess, where the search begins. `constraint` are the numbers of the constraints; NULL: from 0 on.
 * The scales go to s->scale.
 */
static double residual_at(lag_start_search *s, int n, int first, int scale, const int32_t *constraint, const double *x,
                          int begins)
{
    const lag_equations *e = &s->equations;
    double largest = 0.0, size = 0.0;
    for (int j = 0; j < e->nq; ++j)
        size = fmax(size, s->inertia[j] * x[j] * x[j]);
    memset(s->own, 0, (size_t)e->nc * sizeof *s->own);
    memset(s->lengths, 0, (size_t)e->nc * sizeof *s->lengths);
    for (int i = 0; i < e->nb; ++i) {
        const int j = e->jacobian_column[i], row = e->jacobian_row[i];
        const double b = OUT(&s->constraint, e->nh + i);
        s->own[row] += fabs(b * x[j]);
        s->lengths[row] += s->inertia[j] > 0.0 ? b * b / s->inertia[j] : 0.0;
    }
    for (int i = 0; i < n; ++i) {
        const int row = constraint ? constraint[i] : i;
        const double value = OUT(&s->constraint, first + i);
        s->scale[i] = 1.0;
        if (!s->holds[row])
            continue;
        double terms = fmax(OUT(&s->constraint, scale + i), s->own[row]);
        terms = fmax(terms, LEAST_PART * sqrt(size) * sqrt(s->lengths[row]));
        if (begins)
            s->least[row] = OF_GUESS * terms;
        terms = fmax(terms, s->least[row]);
        if (terms > 0.0)
            s->scale[i] = terms;
        if (!isfinite(value))
            return INFINITY;
        if (fabs(value) > ROUNDING)
            largest = fmax(largest, fabs(value) / s->scale[i]);
    }
    return largest;
}

/* Whether the rows of B of constraints that hold are finite; those of positions, or all. */
static int is_defined(const lag_start_search *s, int positions)
{
    const lag_equations *e = &s->equations;
    for (int i = 0; i < e->nb; ++i) {
        const int row = e->jacobian_row[i];
        if (s->holds[row] && (!positions || s->place[row] >= 0) && !isfinite(OUT(&s->constraint, e->nh + i)))
            return 0;
    }
    return 1;
}

/* The largest residual of the positions at a state; INFINITY where it is undefined. */
static double position_residual(lag_start_search *s, double t, const double *y, int begins)
{
    const lag_equations *e = &s->equations;
    evaluate(s, t, y);
    measure(s, t, y);
    const double residual = residual_at(s, e->nh, 0, e->nh + e->nb + e->nc, e->holonomic, y, begins);
    return is_defined(s, 1) ? residual : INFINITY;
}

/* The squared norm of phi, which the tape holds, over the scales; INFINITY where it is undefined. */
static double norm_over_scales(const lag_start_search *s)
{
    double sum = 0.0;
    for (int i = 0; i < s->equations.nh; ++i) {
        const double part = OUT(&s->constraint, i) / s->scale[i];
        sum += s->holds[s->equations.holonomic[i]] ? part * part : 0.0;
    }
    return isfinite(sum) && is_defined(s, 1) ? sum : INFINITY;
}

/* The size of the coordinates, in their sizes; where all are 0, that of those by which the constraints change by their terms. */
static double reach(lag_start_search *s, const double *q)
{
    const lag_equations *e = &s->equations;
    const int scale = e->nh + e->nb + e->nc;
    double size = largest_in_sizes(s, q);
    if (size > 0.0)
        return size;
    write_rows(s);
    for (int i = 0; i < e->nh; ++i) {
        const double length = s->lengths[e->holonomic[i]];
        if (s->holds[e->holonomic[i]])
            size = fmax(size, OUT(&s->constraint, scale + i) / (length > 0.0 ? length : 1.0));
    }
    return size > 0.0 ? size : 1.0;
}

/* positions and velocities */

/* Take Newton steps towards phi = 0, each the least by M if they are `weighted`, or by the units; whether there are more than
 * are taken goes to `slow`. y is the guess where the search `begins`. Returns a lag_start_status: LAG_START_CONTRADICTED where they do not reach it. */
static int descend(lag_start_search *s, double t, const int *fixed, double *y, int weighted, int begins, int *slow)
{
    const lag_equations *e = &s->equations;
    const int nq = e->nq, most = weighted ? WEIGHTED : ITERATIONS;
    int steps = 0;
    double residual = position_residual(s, t, y, begins);
    *slow = 0;
    if (!isfinite(residual))
        return LAG_START_UNDEFINED;
    for (; steps < most && residual > RESIDUAL; ++steps) {
        int m = 0;
        set_unknowns(s, fixed, NULL);
        const double size = reach(s, y);
        write_rows_of_unknowns(s, NULL);
        for (int i = 0; i < e->nh; ++i) {
            if (!s->holds[e->holonomic[i]])
                continue;
            memmove(s->rows + m * nq, s->rows + e->holonomic[i] * nq, (size_t)nq * sizeof *s->rows);
            s->right[m++] = -OUT(&s->constraint, i);
        }
        write_lengths(s, m); /* of what can be changed: next to a double root, all of it is small */
        find_least_change(s, m, INDEPENDENT, NULL, weighted);
        double longest = 0.0, part = 1.0;
        for (int j = 0; j < nq; ++j)
            longest = fmax(longest, fabs(s->x[j]) / size);
        if (longest > LONGEST)
            part = LONGEST / longest;
        const double before = norm_over_scales(s);
        double after = INFINITY;
        memcpy(s->tried, y, (size_t)nq * sizeof *y);
        for (int k = 0; k < HALVINGS && !(after < before); ++k, part *= 0.5) {
            for (int j = 0; j < nq; ++j)
                y[j] = s->tried[j] + part * s->unit[j] * s->x[j];
            evaluate(s, t, y);
            after = norm_over_scales(s);
        }
        if (!(after < before)) { /* rounding errors, or the least residual, are reached */
            memcpy(y, s->tried, (size_t)nq * sizeof *y);
            evaluate(s, t, y);
            break;
        }
        residual = position_residual(s, t, y, 0);
    }
    *slow = steps == most;
    return residual <= ACCEPTED ? LAG_START_FOUND : LAG_START_CONTRADICTED;
}

/* Move a guess beside itself, as its free coordinates allow. */
static void displace(lag_start_search *s, double t, const int *fixed, double part, double *y)
{
    position_residual(s, t, y, 0);
    set_unknowns(s, fixed, NULL);
    const double size = reach(s, y);
    for (int j = 0; j < s->equations.nq; ++j)
        if (!s->fixed[j])
            y[j] += part * size * s->unit[j] * cos(1.0 + j);
}

/* Move the free positions to phi = 0: from the guess, or else from beside it, as next to a singular one. */
static int find_positions(lag_start_search *s, double t, const int *fixed, double *y)
{
    const size_t size = (size_t)s->equations.nq * sizeof *y;
    int found = LAG_START_CONTRADICTED;
    memcpy(s->guess, y, size);
    for (size_t i = 0; i < sizeof aside / sizeof *aside && found == LAG_START_CONTRADICTED; ++i) {
        int slow;
        memcpy(y, s->guess, size);
        if (i)
            displace(s, t, fixed, aside[i], y);
        memcpy(s->begin, y, size);
        found = descend(s, t, fixed, y, 1, !i, &slow);
        if (slow) {
            memcpy(y, s->begin, size);
            found = descend(s, t, fixed, y, 0, 0, &slow);
        }
        if (!i)
            memcpy(s->nearest, y, size);
    }
    if (found == LAG_START_CONTRADICTED)
        memcpy(y, s->nearest, size);
    return found;
}

/* Move the free velocities towards psi = 0; with `hardly`, not by those that hardly change it. */
static int change_velocities(lag_start_search *s, double t, const int *fixed, double *y, int hardly)
{
    const lag_equations *e = &s->equations;
    const int nq = e->nq, scale = 2 * e->nh + e->nb + e->nc, first = scale + e->nc;
    double residual = INFINITY, *v = y + nq;
    for (int iteration = 0; iteration < ITERATIONS; ++iteration) {
        int m = 0;
        evaluate(s, t, y);
        measure(s, t, y);
        const double now = residual_at(s, e->nc, first, scale, NULL, v, iteration == 0);
        if (!isfinite(now) || !is_defined(s, 0))
            return LAG_START_UNDEFINED;
        if (now <= RESIDUAL || (iteration > 2 && !(now < 0.5 * residual))) {
            residual = fmin(now, residual);
            break;
        }
        residual = now;
        set_unknowns(s, fixed, y);
        write_rows_of_unknowns(s, y);
        if (!hardly)
            write_lengths(s, e->nc);
        for (int i = 0; i < e->nc; ++i) {
            if (!s->holds[i])
                continue;
            memmove(s->rows + m * nq, s->rows + i * nq, (size_t)nq * sizeof *s->rows);
            s->lengths[m] = s->lengths[i];
            s->right[m++] = -OUT(&s->constraint, first + i);
        }
        find_least_change(s, m, hardly ? INDEPENDENT : OF_RANK, y, 1);
        for (int j = 0; j < nq; ++j)
            s->x[j] *= s->unit[j];
        for (const lag_spin *spin = s->spins; spin < s->spins + s->spin_count; ++spin)
            if (spin->given) {
                const double omega[3] = {s->x[spin->place[0]], s->x[spin->place[1]], s->x[spin->place[2]]};
                lag_turn_quaternion(spin, omega, y, s->x);
            }
        for (int j = 0; j < nq; ++j)
            v[j] += s->x[j];
    }
    return residual <= ACCEPTED ? LAG_START_FOUND : LAG_START_CONTRADICTED;
}

/* Whether free velocities are large only because they hardly occur in a constraint: in x^2 + y^2 = l^2 at x = l, where y = 0 is
 * known to 1e-8, another x' than 0 would need y' = -1e8 x'. The guess of the velocities replaces those of y, which go to
 * s->tried. */
static int are_hardly(lag_start_search *s, double t, const int *fixed, double *y)
{
    const lag_equations *e = &s->equations;
    const int nq = e->nq, drift = e->nh + e->nb;
    int any = 0;
    for (int j = 0; j < nq; ++j)
        any |= fixed[j];
    for (const lag_spin *spin = s->spins; spin < s->spins + s->spin_count; ++spin)
        any |= spin->given && (spin->fixed[0] || spin->fixed[1] || spin->fixed[2]);
    memcpy(s->tried, y + nq, (size_t)nq * sizeof *y);
    memcpy(y + nq, s->guess, (size_t)nq * sizeof *y);
    if (!any)
        return 0;
    evaluate(s, t, y);
    measure(s, t, y);
    double before = largest_in_sizes(s, y + nq);
    write_rows(s);
    for (int i = 0; i < e->nc; ++i)
        if (s->holds[i])
            before = fmax(before, fabs(OUT(&s->constraint, drift + i)) / (s->lengths[i] > 0.0 ? s->lengths[i] : 1.0));
    return largest_in_sizes(s, s->tried) > before / INDEPENDENT;
}

/* Move the free velocities to psi = 0. */
static int find_velocities(lag_start_search *s, double t, const int *fixed, double *y)
{
    const int nq = s->equations.nq;
    memcpy(s->guess, y + nq, (size_t)nq * sizeof *y);
    const int found = change_velocities(s, t, fixed, y, 0);
    if (found == LAG_START_UNDEFINED)
        return found;
    if (are_hardly(s, t, fixed, y))
        return change_velocities(s, t, fixed, y, 1);
    memcpy(y + nq, s->tried, (size_t)nq * sizeof *y);
    return found;
}

/* Let the angular velocities that are given be those at an orientation, as they were at the guess. Returns a lag_start_status. */
static int turn_with_positions(const lag_start_search *s, double *y)
{
    const int nq = s->equations.nq;
    for (const lag_spin *spin = s->spins; spin < s->spins + s->spin_count; ++spin) {
        int turned = 0, any = 0;
        for (int i = 0; i < 4; ++i) {
            turned |= s->guess[spin->place[i]] != y[spin->place[i]];
            any |= s->guess[spin->place[i]] != 0.0;
        }
        if (spin->given && !any)
            return LAG_START_UNTURNED;
        if (!spin->given || !turned)
            continue;
        double omega[3];
        lag_angular_velocity(spin, s->guess, y + nq, omega);
        lag_turn_quaternion(spin, omega, y, y + nq);
    }
    return LAG_START_FOUND;
}

/* Begin a search: give the tapes their parameters, the constraints those of the dynamics without the branches, which precede
 * the pieces of functions. Returns 0, or 1 where there is no memory. */
static int begin(lag_start_search *s, const double *p, const int *holds)
{
    const int np = s->equations.np, branches = s->np - np;
    const int first = branches && s->first_branch < np ? s->first_branch : np;
    if (bind_metric(s))
        return 1;
    s->holds = holds ? holds : s->all;
    memcpy(s->constraint.parameters + first, p + first + branches, (size_t)(np - first) * sizeof *p);
    lag_tape_set(&s->constraint, first, p);
    lag_tape_set(&s->dynamics, s->np, p);
    return 0;
}

typedef int finder(lag_start_search *s, double t, const int *fixed, double *y);

static void find_rows(lag_start_search *s, finder *find, double t, int64_t count, const double *p, const int *holds,
                      const int *fixed, double *y, int *found)
{
    for (int64_t i = 0; i < count; ++i, p += s->np, y += 2 * s->equations.nq)
        found[i] = begin(s, p, holds) ? LAG_START_NO_MEMORY : find(s, t, fixed, y);
}

void lag_find_positions(lag_start_search *s, double t, int64_t count, const double *p, const int *holds, const int *fixed,
                        double *y, int *found)
{
    find_rows(s, find_positions, t, count, p, holds, fixed, y, found);
}

void lag_find_velocities(lag_start_search *s, double t, int64_t count, const double *p, const int *holds, const int *fixed,
                         double *y, int *found)
{
    find_rows(s, find_velocities, t, count, p, holds, fixed, y, found);
}

int lag_start_begin(lag_start_search *s, const double *p)
{
    return begin(s, p, NULL);
}

void lag_start_evaluate(lag_start_search *s, double t, const double *y)
{
    evaluate(s, t, y);
    measure(s, t, y);
}

const double *lag_least_scales(const lag_start_search *s)
{
    return s->least;
}

int lag_start_find(lag_start_search *s, double t, const double *p, const int *fixed, double *y)
{
    int status = begin(s, p, NULL) ? LAG_START_NO_MEMORY : find_positions(s, t, fixed, y);
    if (status == LAG_START_FOUND)
        status = turn_with_positions(s, y);
    return status == LAG_START_FOUND ? find_velocities(s, t, fixed + s->equations.nq, y) : status;
}

int lag_start_rank(lag_start_search *s, const lag_equations *e, const lag_tape *tape, const double *sizes, double *lengths,
                     double *plain_lengths)
{
    const int nq = e->nq;
    memcpy(s->sizes, sizes, (size_t)nq * sizeof *sizes);
    write_rows_of(s, e, tape);
    for (int i = 0; i < e->nc; ++i) {
        double square = 0.0, plain = 0.0;
        for (int j = 0; j < nq; ++j) {
            const double b = s->rows[i * nq + j], b_j = b / sizes[j];
            square += b * b;
            plain += b_j * b_j;
        }
        lengths[i] = square > 0.0 ? sqrt(square) : 1.0;
        plain_lengths[i] = plain > 0.0 ? sqrt(plain) : 1.0;
    }
    return lag_orthogonalize(OF_RANK, e->nc, nq, s->rows, s->lengths);
}

lag_start_search *lag_make_start_search(const lag_equations *equations, const lag_program *dynamics, const int32_t *spins,
                                        int spin_count)
{
    lag_pool pool = lag_pool_of(NULL);
    lag_start_search *s = lag_get(&pool, 1, sizeof *s);
    if (!s)
        return NULL;
    s->equations = *equations;
    s->dynamics_program = *dynamics;
    s->np = equations->np;
    lag_start_take_spins(s, &pool, spins, LAG_SPIN_NUMBERS * spin_count);
    s->of_its_own = pool;
    if (lag_start_bind(&s->of_its_own, s, 0)) {
        lag_destroy_start_search(s);
        return NULL;
    }
    return s;
}

void lag_destroy_start_search(lag_start_search *s)
{
    lag_pool pool = s->of_its_own; /* the search is allocated in it */
    lag_release(&pool);
}
