#include "batch/batch.h"

#include <string.h>

#include "left_out.h"
#include "methods/method.h"
#include "solution.h"

const lag_batch_kernel *lag_batch_lanes(int kernel)
{
#if defined(__x86_64__)
    if (kernel >= LAG_AVX2)
        return &lag_batch_avx2;
#endif
    (void)kernel;
    return &lag_batch_default;
}

static double *lanes(lag_pool *pool, int64_t count)
{
    return lag_doubles(pool, count * LAG_LANES);
}

/* Copy a stream, its registers times LAG_LANES. */
static const int32_t *copy_stream(lag_pool *pool, const lag_stream *stream)
{
    /* destinations and operands of each operation */
    static const int places[] = LAG_PLACES;
    int32_t *code = lag_copy_integers(pool, stream->code, stream->length), *p = code;
    while (p && *p != OP_END) {
        const int32_t *end = p + 2 + (int64_t)places[p[0]] * p[1];
        for (p += 2; p != end; ++p)
            *p *= LAG_LANES;
    }
    return code;
}

static lag_routine routine(lag_pool *pool, const lag_stream *stream, int kernel)
{
    return lag_routine_of(pool, stream->code ? copy_stream(pool, stream) : NULL, stream->length, kernel);
}

void lag_batch_bind(lag_pool *pool, lag_batch_tape *tape, const lag_program *program, int kernel)
{
    tape->prelude = copy_stream(pool, &program->prelude);
    tape->stream = routine(pool, &program->main, kernel);
    for (int i = 0; i < 3; ++i)
        tape->deferred[i] = routine(pool, &program->deferred[i], kernel);
    for (int i = 0; i < 2; ++i)
        tape->output_subsets[i] = routine(pool, &program->output_subsets[i], kernel);
    tape->output_count = program->output_count;
    tape->register_count = program->register_count;
    int32_t *outputs = lag_copy_integers(pool, program->outputs, program->output_count);
    tape->registers = lanes(pool, program->register_count);
    if (pool->failed)
        return;
    for (int64_t i = 0; i < program->output_count; ++i)
        outputs[i] *= LAG_LANES;
    tape->outputs = outputs;
    for (int64_t i = 0; i < program->register_count; ++i)
        for (int l = 0; l < LAG_LANES; ++l)
            tape->registers[i * LAG_LANES + l] = program->registers[i];
}

static void bind_octet(lag_batch *s, lag_octet *o, const lag_program *dynamics,
                       const lag_program *constraint, int kernel)
{
    lag_pool *pool = &s->pool;
    const int nq = s->system->nq, nc = s->system->nc;
    o->system = s->system;
    o->single = s->single;
    lag_batch_bind(pool, &o->dynamics, dynamics, kernel);
    lag_batch_bind(pool, &o->constraint, constraint, kernel);
    o->scale_position = lanes(pool, s->system->nh);
    o->scale_velocity = lanes(pool, nc);
    o->right = lanes(pool, nq + nc);
    o->x = lanes(pool, nq + nc);
    o->work = lanes(pool, 2 * (nq + nc));
    o->responses = lanes(pool, (int64_t)lag_left_out(s->single) * nc);
    o->trial = lanes(pool, nq);
}

static void allocate(lag_batch *s, int64_t slots)
{
    lag_pool *pool = &s->pool;
    const int nq = s->system->nq, n = 2 * nq + 1;
    s->free_slots = lag_get(pool, (size_t)slots, sizeof(int64_t));
    s->finished = lag_get(pool, (size_t)slots, sizeof(int64_t));
    s->finished_slots = lag_get(pool, (size_t)slots, sizeof(int64_t));
    s->sample_steps = lag_doubles(pool, slots * s->times_count);
    s->y = lanes(pool, n);
    s->y_new = lanes(pool, n);
    s->before = lanes(pool, n);
    s->projected = lanes(pool, n);
    s->dense_y = lanes(pool, n);
    s->dense_slope = lanes(pool, nq);
    s->stages = lanes(pool, 16 * n);
    s->dense = lanes(pool, 7 * n);
    s->lengths = lanes(pool, s->system->nc);
    s->path_begin = lanes(pool, s->system->nb);
    s->path_last = lanes(pool, s->system->nb);
    s->atol = lanes(pool, n);
    s->rest = lanes(pool, n);
    s->noise = lanes(pool, n);
    s->strict = lanes(pool, n);
    s->size = lanes(pool, n);
    s->acceleration_terms = lanes(pool, nq + 1);
    s->future_acceleration = lanes(pool, nq);
    s->emerging = lanes(pool, nq);
    s->largest = lanes(pool, 2 * s->single->tolerances.kinds);
}

lag_batch *lag_batch_create(const lag_memory *memory, lag_run *single, const lag_program *dynamics,
                            const lag_program *constraint, const lag_batch_settings *given)
{
    lag_pool pool = lag_pool_of(memory);
    lag_batch *s = lag_get(&pool, 1, sizeof *s);
    if (!s)
        return NULL;
    s->pool = pool;
    s->kernel = lag_batch_lanes(given->kernel);
    s->single = single;
    s->system = &single->system;
    for (int i = 0; i < s->system->nq; ++i)
        single->rows.sizes[i] = 1.0; /* each lane has its own parameters, and so its own inertia */
    s->settings = &single->settings;
    s->t_start = single->step.t;
    s->watching = single->watch.mode;
    s->detecting = single->stiffness.detecting;
    s->times = lag_copy_doubles(&s->pool, given->times, given->times_count);
    s->times_count = given->times_count;
    s->runs = given->runs;
    s->parameters_count = single->np;
    s->parameters = lag_copy_doubles(&s->pool, given->parameters, given->runs * single->np);
    s->states = lag_copy_doubles(&s->pool, given->states, given->runs * 2 * s->system->nq);
    s->status = given->status;
    s->counts = given->counts;
    s->samples = given->samples;
    bind_octet(s, &s->moving, dynamics, constraint, given->kernel);
    bind_octet(s, &s->sampled, dynamics, constraint, given->kernel);
    allocate(s, given->slots);
    if (s->pool.failed) {
        lag_batch_destroy(s);
        return NULL;
    }
    for (int64_t i = 0; i < given->slots; ++i)
        s->free_slots[s->free_count++] = given->slots - 1 - i;
    for (int l = 0; l < LAG_LANES; ++l)
        s->run[l] = -1;
    return s;
}

void lag_batch_destroy(lag_batch *s)
{
    lag_pool pool = s->pool; /* the batch is allocated in it */
    lag_release(&pool);
}

int lag_batch_advance(lag_batch *s, int64_t attempts)
{
    return s->kernel->advance(s, attempts);
}

int64_t lag_batch_take(lag_batch *s, int64_t *runs, int64_t *slots)
{
    const int64_t count = (int64_t)s->finished_count;
    for (int64_t i = 0; i < count; ++i) {
        runs[i] = s->finished[i];
        slots[i] = s->finished_slots[i];
        s->free_slots[s->free_count++] = slots[i];
    }
    s->finished_count = 0;
    return count;
}

const int64_t *lag_batch_runs(const lag_batch *s)
{
    return s->run;
}

void lag_batch_leave(lag_batch *s, int l)
{
    s->status[s->run[l]] = LAG_LANE_LEFT;
    s->free_slots[s->free_count++] = s->slot[l];
    s->run[l] = -1;
}

void lag_batch_emit(const lag_batch_tape *tape, const lag_routine *routine, const lag_calls *calls)
{
    const lag_routine *deferred = tape->deferred, *subsets = tape->output_subsets;
    const lag_source source = {
        .routines = {&tape->stream, deferred, deferred + 1, deferred + 2, subsets, subsets + 1},
        .outputs = tape->outputs,
        .output_count = tape->output_count,
        .register_count = tape->register_count,
        .lanes = LAG_LANES,
    };
    lag_native_emit(&source, routine, calls);
}

struct lag_table {
    lag_pool pool;
    const lag_batch_kernel *kernel;
    lag_batch_tape tape;
    int columns, np, outputs;
};

lag_table *lag_table_create(const lag_memory *memory, const lag_program *program, int columns, int np,
                            int kernel)
{
    lag_pool pool = lag_pool_of(memory);
    lag_table *table = lag_get(&pool, 1, sizeof *table);
    if (!table)
        return NULL;
    table->pool = pool;
    table->kernel = lag_batch_lanes(kernel);
    table->columns = columns;
    table->np = np;
    table->outputs = (int)program->output_count;
    lag_batch_bind(&table->pool, &table->tape, program, kernel);
    if (table->pool.failed) {
        lag_table_destroy(table);
        return NULL;
    }
    return table;
}

void lag_table_destroy(lag_table *table)
{
    lag_pool pool = table->pool; /* the table is allocated in it */
    lag_release(&pool);
}

void lag_table_evaluate(const lag_table *table, const double *parameters, const double *values,
                        int64_t rows, int64_t width, double *out)
{
    table->kernel->table(&table->tape, parameters, table->np, values, rows, table->columns, width,
                         table->outputs, out);
}

void lag_batch_sincos(const double *x, double *sine, double *cosine, int kernel)
{
    lag_batch_lanes(kernel)->sincos(x, sine, cosine);
}
