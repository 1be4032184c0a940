/* Creation of a run: arrays are copied and memory is allocated only here. */
#include <math.h>
#include <string.h>

#include "methods/implicit.h"
#include "bind.h"
#include "evaluate.h"
#include "motion.h"
#include "memory.h"
#include "methods/method.h"
#include "run.h"
#include "tape/tape.h"
#include "watch.h"

#define CALLS_OF_STEPS 100 /* calls of a tape that runs make at least, beside those of their samples */

static void copy_equations(lag_run *run, const lag_equations *given)
{
    lag_pool *pool = &run->pool;
    lag_system *s = &run->system;
    const int nq = given->nq, nm = given->nm, nb = given->nb;
    s->nq = nq;
    s->nc = given->nc;
    s->nh = given->nh;
    s->nm = nm;
    s->nb = nb;
    s->blocks = 1;
    s->holonomic = lag_copy_integers(pool, given->holonomic, given->nh);
    s->mass_row = lag_copy_integers(pool, given->mass_row, nm);
    s->mass_column = lag_copy_integers(pool, given->mass_column, nm);
    s->jacobian_row = lag_copy_integers(pool, given->jacobian_row, nb);
    s->jacobian_column = lag_copy_integers(pool, given->jacobian_column, nb);
    s->unit = lag_copy_integers(pool, given->unit, nq);
    int32_t *diagonal = lag_copy_integers(pool, NULL, nq);
    if (pool->failed)
        return;
    for (int i = 0; i < nq; ++i)
        diagonal[i] = -1;
    for (int i = 0; i < nm; ++i)
        if (given->mass_row[i] == given->mass_column[i])
            diagonal[given->mass_row[i]] = i;
    s->mass_diagonal = diagonal;
}

static void copy_problem(lag_run *run, const lag_problem *given)
{
    lag_pool *pool = &run->pool;
    const int nq = run->system.nq, nc = run->system.nc, n = 2 * nq + 1;
    run->settings = given->settings;
    run->system.carried = 2 * nq * given->directions;
    run->parameters = lag_copy_doubles(pool, given->parameters, run->np);
    run->step.t = run->step.t_start = given->t;
    run->step.t_stop = given->settings.t_end;
    run->step.h_max = given->settings.max_step;
    run->step.y = lag_doubles(pool, lag_whole_vectors(lag_size(&run->system)));
    run->tolerances.given = lag_copy_doubles(pool, given->atol, n);
    run->tolerances.atol = lag_doubles(pool, lag_size(&run->system));
    if (!pool->failed) {
        memcpy(run->step.y, given->y, (size_t)lag_size(&run->system) * sizeof(double));
        memcpy(run->tolerances.atol, given->atol, (size_t)n * sizeof(double));
    }
    run->tolerances.kind = lag_copy_integers(pool, given->kind, nq);
    for (int i = 0; i < nq; ++i)
        if (run->tolerances.kinds <= given->kind[i])
            run->tolerances.kinds = given->kind[i] + 1;
    run->rows.rank = given->rank;
    run->rows.sizes = lag_copy_doubles(pool, given->sizes, nq);
    run->rows.lengths = lag_copy_doubles(pool, given->lengths, nc);
    run->rows.plain_lengths = lag_copy_doubles(pool, given->plain_lengths, nc);
    run->baumgarte.alpha = isnan(given->settings.alpha) ? 0.0 : given->settings.alpha; /* 0 until there is a step */
    run->baumgarte.beta = isnan(given->settings.beta) ? run->baumgarte.alpha : given->settings.beta;
    run->watch.mode = given->watching;
    run->stiffness.detecting = given->detecting;
    run->solver.refinable = given->refinable;
    run->samples.times = lag_copy_doubles(pool, given->times, given->times_count);
    run->samples.count = given->times_count;
    run->samples.block = given->block;
    run->samples.rows = given->block_rows;
    run->samples.extra = given->extra;
}

/* What orthogonalizes the rows of B. */
static void allocate_rows(lag_run *run)
{
    lag_pool *pool = &run->pool;
    const int64_t nq = run->system.nq, nc = run->system.nc;
    run->rows.scaled = lag_doubles(pool, nq * nc);
    run->rows.order = lag_get(pool, (size_t)nc, sizeof(int));
    run->rows.components = lag_doubles(pool, nc * nc);
    run->rows.dependencies = lag_doubles(pool, (nc - run->rows.rank) * nc);
    int32_t *next = lag_copy_integers(pool, NULL, run->system.nb), *first = lag_copy_integers(pool, NULL, nq);
    if (pool->failed)
        return;
    for (int64_t j = 0; j < nq; ++j)
        first[j] = -1;
    for (int i = run->system.nb - 1; i >= 0; --i) {
        next[i] = first[run->system.jacobian_column[i]];
        first[run->system.jacobian_column[i]] = i;
    }
    run->rows.same_column = next;
}

static void release_enclosed(void *enclosed)
{
    for (int i = 0; i < 2; ++i)
        lag_release(&((lag_enclosed *)enclosed)[i].pool);
}

static void allocate(lag_run *run)
{
    lag_pool *pool = &run->pool;
    const int nq = run->system.nq, nc = run->system.nc, n = lag_size(&run->system), rank = run->rows.rank;
    const int size = nq + 2 * nc - rank, kinds = run->tolerances.kinds;
    lag_step *step = &run->step;
    const int whole = lag_whole_vectors(n);
    step->f = lag_doubles(pool, n);
    step->y_old = lag_doubles(pool, whole);
    step->y_new = lag_doubles(pool, whole);
    step->f_new = lag_doubles(pool, n);
    step->trial = lag_doubles(pool, whole);
    step->stages = lag_doubles(pool, 16 * (n + 7));
    step->dense = lag_doubles(pool, 7 * (n + 7));
    step->work = lag_doubles(pool, 2 * (n + size) + 3 * nc);
    run->tolerances.size = lag_doubles(pool, n);
    run->tolerances.rounding = lag_doubles(pool, n);
    run->tolerances.acceleration_terms = lag_doubles(pool, nq + 1);
    run->tolerances.future_acceleration = lag_doubles(pool, nq);
    run->tolerances.emerging = lag_doubles(pool, nq);
    run->tolerances.rest = lag_doubles(pool, n);
    run->tolerances.noise_at_rest = lag_doubles(pool, n);
    run->tolerances.largest = lag_doubles(pool, 2 * kinds);
    run->tolerances.terms = lag_doubles(pool, nq);
    run->tolerances.down = lag_doubles(pool, n);
    run->tolerances.beside = lag_doubles(pool, n);
    run->tolerances.change = lag_doubles(pool, n);
    run->tolerances.noise = lag_doubles(pool, n);
    run->tolerances.limiting = -1;
    run->tolerances.enclosed = lag_own(pool, 2 * sizeof(lag_enclosed), release_enclosed);
    for (int i = 0; run->tolerances.enclosed && i < 2; ++i)
        run->tolerances.enclosed[i].pool = lag_pool_of(&pool->from);
    run->tolerances.strict = lag_doubles(pool, INT64_C(2) * n);
    run->projection.scale_position = lag_doubles(pool, run->system.nh);
    run->projection.scale_velocity = lag_doubles(pool, nc);
    run->solver.a = lag_doubles(pool, nq + nc);
    run->solver.right = lag_doubles(pool, size);
    run->solver.solution = lag_doubles(pool, size);
    run->solver.block = lag_doubles(pool, nq + nc);
    run->dense.weight = lag_doubles(pool, nc);
    run->dense.pivots = lag_get(pool, (size_t)size, sizeof(int));
    if (!lag_many_rows(run))
        allocate_rows(run);
    run->watch.combination = lag_doubles(pool, 2 * nc);
    run->watch.approach.y = lag_doubles(pool, (int64_t)LAG_APPROACH_STATES * n);
    run->watch.path.entries = run->watch.path.begin = lag_doubles(pool, run->system.nb);
    run->watch.path.last = lag_doubles(pool, run->system.nb);
    run->watch.path.weight = lag_doubles(pool, run->system.nb);
    run->samples.y = lag_doubles(pool, n);
    run->samples.kept = lag_doubles(pool, run->system.nq + run->system.nc);
    run->failure.y = lag_doubles(pool, n);
    if (!pool->failed)
        run->solver.multipliers = run->solver.a + nq;
}

/* Expect the calls of a tape at the samples, and in some steps. */
static void expect_samples(const lag_run *run, const lag_tape *tape)
{
    lag_expect(tape, run->samples.count - run->samples.next + CALLS_OF_STEPS);
}

lag_run *lag_create(const lag_memory *memory, const lag_equations *equations, const lag_problem *problem)
{
    lag_pool pool = lag_pool_of(memory);
    lag_run *run = lag_get(&pool, 1, sizeof *run);
    if (!run)
        return NULL;
    run->pool = pool;
    run->dynamics_pool.from = pool.from;
    run->kernel = problem->kernel;
    run->system.vectors = lag_vectors(run->kernel);
    run->np = equations->np;
    run->method = run->stepped = lag_method_at(0);
    copy_equations(run, equations);
    copy_problem(run, problem);
    allocate(run);
    if (run->pool.failed
        || lag_bind(run, &run->pool, &run->system.constraint, &equations->constraint)) {
        lag_destroy(run);
        return NULL;
    }
    expect_samples(run, &run->system.constraint);
    return run;
}

void lag_destroy(lag_run *run)
{
    if (run->implicit)
        lag_release(&run->implicit->pivots_pool);
    lag_release(&run->dynamics_pool);
    lag_pool pool = run->pool; /* the run is allocated in it */
    lag_release(&pool);
}

/* The pools of a run; their number. */
static int pools_of(const lag_run *run, const lag_pool *pools[3])
{
    pools[0] = &run->dynamics_pool;
    pools[1] = &run->pool;
    pools[2] = run->implicit ? &run->implicit->pivots_pool : NULL;
    return run->implicit ? 3 : 2;
}

size_t lag_state_size(const lag_run *run)
{
    const lag_pool *pools[3];
    size_t bytes = 0;
    for (int i = pools_of(run, pools) - 1; i >= 0; --i)
        bytes += lag_saved_size(pools[i]);
    return bytes;
}

void lag_save(const lag_run *run, void *to)
{
    const lag_pool *pools[3];
    char *at = to;
    for (int i = pools_of(run, pools) - 1; i >= 0; --i)
        at = lag_save_pool(pools[i], at);
}

int lag_restore(lag_run *run, const void *from)
{
    const lag_pool *pools[3];
    const int count = pools_of(run, pools);
    for (int restore = 0; restore < 2; ++restore) {
        const char *at = from;
        for (int i = count - 1; at && i >= 0; --i)
            at = lag_saved_pool(pools[i], at, restore);
        if (!at)
            return 1;
    }
    return 0;
}

/* Replace the dynamics, and everything derived from them. */
static int replace_dynamics(lag_run *run, const lag_program *dynamics, enum lag_solution by)
{
    lag_release(&run->dynamics_pool);
    run->series = (lag_series){0};
    run->system.equations = (lag_tape){0};
    run->watch.determinant.begin = NAN;
    run->solver.by = by;
    run->factors.plan.n = (run->system.nq + run->system.nc) / run->system.blocks;
    if (lag_bind(run, &run->dynamics_pool, &run->system.dynamics, dynamics))
        return 1;
    expect_samples(run, &run->system.dynamics);
    return 0;
}

int lag_use_dense(lag_run *run, const lag_program *dynamics)
{
    return replace_dynamics(run, dynamics, LAG_BY_LU) || lag_allow_dense(run, 0);
}

int lag_allow_dense(lag_run *run, int64_t steps)
{
    const int64_t size = run->system.nq + 2 * run->system.nc - run->rows.rank;
    run->solver.dense_steps = steps ? steps + 1 : 0; /* with the dense output of the last one */
    if (!run->dense.matrix) {
        run->dense.matrix = lag_doubles(&run->pool, size * size);
        run->dense.lu = lag_doubles(&run->pool, size * size);
        if (!run->rows.scaled)
            allocate_rows(run);
    }
    return run->pool.failed;
}

int lag_leave_out(lag_run *run, const int32_t *rows)
{
    const lag_system *s = &run->system;
    lag_rows *own = &run->rows;
    const int count = s->nc - own->rank;
    if (!own->left_out) {
        own->left_out = lag_copy_integers(&run->pool, NULL, count);
        own->place_left_out = lag_copy_integers(&run->pool, NULL, count);
    }
    if (lag_allow_dense(run, 0)) /* where these rows do not follow from the others after all */
        return 1;
    own->margin = own->poor = 0;
    for (int j = 0; j < count; ++j) {
        own->left_out[j] = rows[j];
        own->place_left_out[j] = -1;
        for (int i = 0; i < s->nh; ++i)
            if (s->holonomic[i] == rows[j])
                own->place_left_out[j] = i;
    }
    return 0;
}

int lag_use_unrolled(lag_run *run, const lag_program *dynamics)
{
    run->solver.refining = 0;
    run->solver.other_right = dynamics->inputs;
    return replace_dynamics(run, dynamics, LAG_BY_TAPE);
}

int lag_use_equations(lag_run *run, const lag_program *equations)
{
    return lag_bind(run, &run->dynamics_pool, &run->system.equations, equations);
}

int lag_use_elimination(lag_run *run, const lag_program *dynamics, const lag_elimination *given)
{
    lag_pool *pool = &run->dynamics_pool;
    lag_factors *f = &run->factors;
    const int n = given->n, entries = given->start[n];
    run->solver.refining = 0;
    if (replace_dynamics(run, dynamics, LAG_BY_LDL))
        return 1;
    f->plan = (lag_elimination){
        .n = n,
        .order = lag_copy_integers(pool, given->order, n),
        .paired = lag_copy_integers(pool, given->paired, n),
        .start = lag_copy_integers(pool, given->start, n + 1),
        .row = lag_copy_integers(pool, given->row, entries),
        .mass_targets = lag_copy_integers(pool, given->mass_targets, run->system.nm / run->system.blocks),
        .jacobian_targets = lag_copy_integers(pool, given->jacobian_targets, run->system.nb / run->system.blocks),
    };
    f->factors = lag_doubles(pool, 2 * n + entries);
    f->product = lag_doubles(pool, entries);
    return pool->failed || lag_supernodes_of(pool, &f->plan, &f->nodes);
}

int lag_use_series(lag_run *run, const lag_series_program *given)
{
    lag_pool *pool = &run->dynamics_pool;
    lag_series *series = &run->series;
    *series = (lag_series){
        .stream = lag_copy_stream(pool, &given->stream),
        .known = lag_doubles(pool, given->convolutions),
        .count = given->convolutions,
        .file = lag_doubles(pool, given->size),
        .order = given->order,
        .invariant = given->invariant,
        .numbers = given->numbers,
        .begin_count = given->begin_count,
        .begins = lag_copy_integers(pool, given->begins, given->begin_count),
        .origin = given->origin,
        .layer = given->layer,
        .state = lag_copy_integers(pool, given->state, 2 * run->system.nq + 2),
    };
    if (lag_bind(run, pool, &series->values, &given->values))
        return 1;
    lag_series_invariant(series);
    return 0;
}

/* Copy a block whose values begin at an output; return where they end. */
static int copy_block(lag_pool *pool, lag_part_of_jacobian *block, const lag_block *given, int first)
{
    block->count = given->count;
    block->first = first;
    block->places = lag_copy_integers(pool, given->places, given->count);
    return first + given->count;
}

int lag_use_jacobians(lag_run *run, const lag_jacobians *given)
{
    lag_pool *pool = &run->pool;
    lag_implicit *m = lag_get(pool, 1, sizeof *m);
    const int nq = run->system.nq, nc = run->system.nc, n = given->n, count = given->start[n];
    if (!m)
        return 1;
    int first = 0;
    first = copy_block(pool, &m->force_position, &given->force_position, first);
    first = copy_block(pool, &m->force_velocity, &given->force_velocity, first);
    first = copy_block(pool, &m->rhs_position, &given->rhs_position, first);
    first = copy_block(pool, &m->rhs_velocity, &given->rhs_velocity, first);
    first = copy_block(pool, &m->power_position, &given->power_position, first);
    copy_block(pool, &m->power_velocity, &given->power_velocity, first);
    m->mass = lag_doubles(pool, run->system.nm);
    m->jacobian = lag_doubles(pool, run->system.nb);
    m->border = lag_doubles(pool, (int64_t)(nc - run->rows.rank) * nc);
    m->derivatives = lag_doubles(pool, given->program.output_count);
    m->velocity = lag_doubles(pool, nq);
    m->quotient = lag_doubles(pool, nq);
    m->zero = lag_doubles(pool, nq);
    m->atol = lag_doubles(pool, lag_size(&run->system));
    m->n = n;
    m->count = count;
    m->start = lag_copy_integers(pool, given->start, n + 1);
    m->columns = lag_copy_integers(pool, given->columns, count);
    m->parts = lag_copy_integers(pool, given->parts, given->parts_count);
    m->matrix = lag_doubles(pool, count);
    m->matrix_re = lag_doubles(pool, count);
    m->matrix_im = lag_doubles(pool, count);
    m->right = lag_doubles(pool, n);
    m->right_im = lag_doubles(pool, n);
    m->residual = lag_doubles(pool, n);
    m->work = lag_doubles(pool, 2 * n);
    m->ordered = -1;
    m->pivots_pool.from = pool->from;
    run->implicit = m;
    return lag_bind(run, pool, &m->variation, &given->program);
}

int lag_use_pivots(lag_run *run, const lag_pivots *given)
{
    lag_implicit *m = run->implicit;
    lag_pool *pool = &m->pivots_pool;
    const int n = given->n, entries = n ? given->start[n] : 0;
    lag_release(pool);
    m->order = (lag_pivots){0};
    if (!n)
        return 0;
    m->order = (lag_pivots){
        .n = n,
        .row = lag_copy_integers(pool, given->row, n),
        .column = lag_copy_integers(pool, given->column, n),
        .start = lag_copy_integers(pool, given->start, n + 1),
        .columns = lag_copy_integers(pool, given->columns, entries),
        .diagonal = lag_copy_integers(pool, given->diagonal, n),
        .places = lag_copy_integers(pool, given->places, m->count),
    };
    m->factors = lag_doubles(pool, entries);
    m->complex_re = lag_doubles(pool, entries);
    m->complex_im = lag_doubles(pool, entries);
    return pool->failed;
}

int lag_use_tangent(lag_run *run, const lag_program *tangent, int blocks, int complete)
{
    run->system.blocks = blocks;
    run->system.complete = complete;
    if (!run->rows.scaled && !lag_many_rows(run)) /* of the motion alone */
        allocate_rows(run);
    return lag_bind(run, &run->pool, &run->system.tangent, tangent);
}

int lag_use_breaks(lag_run *run, const double *times, int64_t count)
{
    run->breaks.times = lag_copy_doubles(&run->pool, times, count);
    run->breaks.count = count;
    return run->pool.failed;
}

int lag_use_functions(lag_run *run, const lag_function *functions, int count)
{
    run->breaks.functions = lag_copy(&run->pool, functions, (size_t)count, sizeof *functions);
    run->breaks.function_count = count;
    return run->pool.failed;
}
