/* Values that an event sets: the others follow onto the constraints. */
#include "start/start.h"

#include <math.h>
#include <string.h>

#include "linear/dependent_rows.h"

#define TOUCHES 10.0        /* multiple of a gap that counts as none, below which a closed contact stays closed */
#define NO_SPEED 1e-11      /* part of the terms of psi: approaches of contacts below it are rounding errors */
#define OF_RANK 1e-8        /* singular value of rows of length one that count as independent, at least */
#define SETS 64             /* of contacts that are tried */

struct lag_adjustment {
    lag_pool pool;
    lag_start_search search;
    int *holds;                        /* nc: the constraints that hold in an attempt */
    int *touches;                      /* nc: 1 or -1 of contacts that may act, 0 */
    char *tried;                       /* SETS * nc: the constraints of each attempt so far */
    double *given, *without;           /* nq: q or v before an attempt; after the one without contacts ... */
    double *impulse, *impulse_without; /* nc: ... with the impulses */
    /* of impulses: the rows of B, over their lengths; how they are combined; momenta, changes of v */
    double *rows, *lengths, *turn, *right, *change; /* nc * nq, nc, nc * nc, nq, nq */
    double *share, *scratch;           /* nc */
};

lag_adjustment *lag_make_adjustment(const lag_memory *memory, const lag_equations *equations, const lag_program *dynamics)
{
    lag_pool pool = lag_pool_of(memory);
    const int nq = equations->nq, nc = equations->nc;
    lag_adjustment *a = lag_get(&pool, 1, sizeof *a);
    if (!a)
        return NULL;
    a->search.equations = *equations;
    a->search.dynamics_program = *dynamics;
    a->search.np = equations->np;
    a->holds = lag_get(&pool, (size_t)nc, sizeof *a->holds);
    a->touches = lag_get(&pool, (size_t)nc, sizeof *a->touches);
    a->tried = lag_get(&pool, (size_t)nc, SETS);
    a->given = lag_doubles(&pool, nq);
    a->without = lag_doubles(&pool, nq);
    a->impulse = lag_doubles(&pool, nc);
    a->impulse_without = lag_doubles(&pool, nc);
    a->rows = lag_doubles(&pool, (int64_t)nc * nq);
    a->lengths = lag_doubles(&pool, nc);
    a->turn = lag_doubles(&pool, (int64_t)nc * nc);
    a->right = lag_doubles(&pool, nq);
    a->change = lag_doubles(&pool, nq);
    a->share = lag_doubles(&pool, nc);
    a->scratch = lag_doubles(&pool, nc);
    a->pool = pool;
    if (lag_start_bind(&a->pool, &a->search, 0)) {
        lag_destroy_adjustment(a);
        return NULL;
    }
    return a;
}

void lag_destroy_adjustment(lag_adjustment *a)
{
    lag_pool pool = a->pool; /* it is allocated in it */
    lag_release(&pool);
}

/* The outputs of the tape of constraints from which on psi, and its scales, are. */
static int first_rate(const lag_equations *e)
{
    return 2 * e->nh + e->nb + 2 * e->nc;
}

static int first_scale_of_rates(const lag_equations *e)
{
    return 2 * e->nh + e->nb + e->nc;
}

/* Whether the velocities violate constraints that hold by no more than their errors, at the state of the tapes. */
static int are_accurate(const lag_adjustment *a, const double *accuracy)
{
    const lag_start_search *s = &a->search;
    const lag_equations *e = &s->equations;
    double *allowed = a->lengths;
    memset(allowed, 0, (size_t)e->nc * sizeof *allowed);
    for (int i = 0; i < e->nb; ++i)
        allowed[e->jacobian_row[i]] += fabs(OUT(&s->constraint, e->nh + i)) * accuracy[e->jacobian_column[i]];
    for (int i = 0; i < e->nc; ++i)
        if (a->holds[i] && !(fabs(OUT(&s->constraint, first_rate(e) + i)) <= allowed[i]))
            return 0;
    return 1;
}

/* The impulse of the constraints that hold, by which the velocities that are not fixed change, of least norm, at the state of the
 * tapes. */
static void find_impulse(lag_adjustment *a, const int *fixed)
{
    lag_start_search *s = &a->search;
    const lag_equations *e = &s->equations;
    const int nq = e->nq;
    int m = 0;
    memset(a->impulse, 0, (size_t)e->nc * sizeof *a->impulse);
    memset(a->right, 0, (size_t)nq * sizeof *a->right);
    memset(a->rows, 0, (size_t)e->nc * (size_t)nq * sizeof *a->rows);
    for (int i = 0; i < e->nm; ++i)
        a->right[e->mass_row[i]] += OUT(&s->dynamics, i) * a->change[e->mass_column[i]];
    for (int j = 0; j < nq; ++j)
        a->right[j] *= fixed[j] ? 0.0 : s->sizes[j];
    for (int i = 0; i < e->nb; ++i) {
        const int j = e->jacobian_column[i];
        a->rows[e->jacobian_row[i] * nq + j] = fixed[j] ? 0.0 : s->sizes[j] * OUT(&s->constraint, e->nh + i);
    }
    for (int i = 0; i < e->nc; ++i) {
        double *row = a->rows + m * nq;
        if (!a->holds[i])
            continue;
        memmove(row, a->rows + i * nq, (size_t)nq * sizeof *row);
        const double length = sqrt(lag_product(nq, row, row));
        a->lengths[m] = length > 0.0 ? length : 1.0;
        for (int j = 0; j < nq; ++j)
            row[j] /= a->lengths[m];
        ++m;
    }
    memset(a->turn, 0, (size_t)m * (size_t)m * sizeof *a->turn);
    for (int k = 0; k < m; ++k)
        a->turn[k * m + k] = 1.0;
    const int rank = lag_combine(OF_RANK, m, nq, a->rows, m, a->turn, a->scratch);
    memset(a->share, 0, (size_t)m * sizeof *a->share);
    for (int k = 0; k < rank; ++k) {
        const double *row = a->rows + k * nq;
        const double part = lag_product(nq, row, a->right) / lag_product(nq, row, row);
        for (int i = 0; i < m; ++i)
            a->share[i] += part * a->turn[k * m + i] / a->lengths[i];
    }
    /* impulses without effect */
    double *idle = a->turn + rank * m;
    for (int k = 0; k < m - rank; ++k) {
        for (int i = 0; i < m; ++i)
            idle[k * m + i] /= a->lengths[i];
        a->scratch[k] = sqrt(lag_product(m, idle + k * m, idle + k * m));
    }
    lag_orthogonalize(0.0, m - rank, m, idle, a->scratch);
    for (int k = 0; k < m - rank; ++k) {
        const double product = lag_product(m, idle + k * m, a->share);
        for (int i = 0; i < m; ++i)
            a->share[i] -= product * idle[k * m + i];
    }
    for (int i = 0, k = 0; i < e->nc; ++i)
        if (a->holds[i])
            a->impulse[i] = a->share[k++];
}

double lag_supplied(lag_adjustment *a, double t, const double *p, const double *y, const double *impulse)
{
    lag_start_search *s = &a->search;
    const lag_equations *e = &s->equations;
    double sum = 0.0;
    int any = 0;
    for (int i = 0; i < e->nc; ++i)
        any |= impulse[i] != 0.0;
    if (!any || lag_start_begin(s, p))
        return 0.0;
    lag_start_evaluate(s, t, y);
    for (int i = 0; i < e->nc; ++i)
        sum -= impulse[i] * OUT(&s->constraint, e->nh + e->nb + i);
    return sum;
}

/* Find free positions, or free velocities with the impulse. Returns a lag_start_status. */
static int attempt(lag_adjustment *a, int of_velocities, double t, const double *p, const lag_held_rows *held, const int *fixed,
                   double *y)
{
    lag_start_search *s = &a->search;
    const int nq = s->equations.nq;
    int found;
    if (!of_velocities) {
        lag_find_positions(s, t, 1, p, a->holds, fixed, y, &found);
        lag_start_evaluate(s, t, y);
        return found;
    }
    lag_find_velocities(s, t, 1, p, a->holds, fixed, y, &found);
    lag_start_evaluate(s, t, y);
    if (found == LAG_START_CONTRADICTED && are_accurate(a, held->accuracy))
        found = LAG_START_FOUND;
    if (found == LAG_START_FOUND) {
        for (int j = 0; j < nq; ++j)
            a->change[j] = y[nq + j] - a->given[j];
        find_impulse(a, fixed);
    }
    return found;
}

/* After an attempt: let contacts hold that it violates, and release those that pull. Returns whether there are any. */
static int change_contacts(lag_adjustment *a, int of_velocities, const lag_held_rows *held)
{
    const lag_start_search *s = &a->search;
    const lag_equations *e = &s->equations;
    int changes = 0;
    for (int i = 0; i < e->nc; ++i) {
        const int sign = a->touches[i];
        if (!sign)
            continue;
        const double phi = OUT(&s->constraint, s->place[i]), psi = OUT(&s->constraint, first_rate(e) + i);
        const double no_speed = NO_SPEED * OUT(&s->constraint, first_scale_of_rates(e) + i);
        const int violated = of_velocities ? sign * psi < -no_speed : sign * phi < -TOUCHES * held->no_gap[i];
        const int pulls = of_velocities && sign * a->impulse[i] < 0.0;
        changes |= (violated && !a->holds[i]) || pulls;
        a->holds[i] = (a->holds[i] && !pulls) || (violated && !a->holds[i]);
    }
    return changes;
}

/* Whether the constraints that hold have been tried before in `count` attempts; remember them. */
static int recur(lag_adjustment *a, int count)
{
    const int nc = a->search.equations.nc;
    char *now = a->tried + (size_t)count * nc;
    for (int i = 0; i < nc; ++i)
        now[i] = (char)a->holds[i];
    for (const char *one = a->tried; one < now; one += nc)
        if (!memcmp(one, now, (size_t)nc))
            return 1;
    return 0;
}

/* Move positions, or velocities, such that contacts are satisfied, if that is possible, else regardless of them. */
static int adjust(lag_adjustment *a, int of_velocities, double t, const double *p, const lag_held_rows *held, const int *fixed,
                  double *y)
{
    const int nq = a->search.equations.nq, nc = a->search.equations.nc;
    const size_t size = (size_t)nq * sizeof *y, of_impulse = (size_t)nc * sizeof *a->impulse;
    double *x = of_velocities ? y + nq : y;
    memcpy(a->given, x, size);
    memcpy(a->holds, of_velocities ? held->velocities : held->positions, (size_t)nc * sizeof *a->holds);
    for (int count = 0; count < SETS && !recur(a, count); ++count) {
        memcpy(x, a->given, size);
        const int found = attempt(a, of_velocities, t, p, held, fixed, y);
        if (found == LAG_START_CONTRADICTED && count)
            break;
        if (found != LAG_START_FOUND)
            return found;
        if (!count) {
            memcpy(a->without, x, size);
            memcpy(a->impulse_without, a->impulse, of_impulse);
        }
        if (!change_contacts(a, of_velocities, held))
            return LAG_START_FOUND;
    }
    memcpy(x, a->without, size);
    memcpy(a->impulse, a->impulse_without, of_impulse);
    return LAG_START_FOUND;
}

int lag_adjust(lag_adjustment *a, double t, const double *p, const lag_held_rows *held, const int *fixed, double *y, double *impulse)
{
    lag_start_search *s = &a->search;
    const int nq = s->equations.nq, nc = s->equations.nc;
    for (int i = 0; i < nc; ++i)
        a->touches[i] = s->place[i] < 0 ? 0 : held->sign[i];
    int found = adjust(a, 0, t, p, held, fixed, y);
    if (found != LAG_START_FOUND)
        return found;
    lag_start_evaluate(s, t, y);
    for (int i = 0; i < nc; ++i)
        if (a->touches[i] && fabs(OUT(&s->constraint, s->place[i])) > TOUCHES * held->no_gap[i])
            a->touches[i] = 0;
    found = adjust(a, 1, t, p, held, fixed + nq, y);
    memcpy(impulse, a->impulse, (size_t)nc * sizeof *impulse);
    return found;
}
