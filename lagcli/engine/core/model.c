#include "lagmodel.h"

#include <math.h>
#include <string.h>

#include "system.h"

/* Where the data are read. */
typedef struct {
    const char *at;
    int64_t words;                     /* left */
    int status;
} reader;

static void reject(reader *in, int status)
{
    if (in->status == LAG_MODEL_READ)
        in->status = status;
    in->words = 0;
}

static int64_t word(reader *in)
{
    int64_t value = 0;
    if (in->words < 1) {
        reject(in, LAG_MODEL_LENGTH);
        return 0;
    }
    memcpy(&value, in->at, sizeof value);
    in->at += sizeof value;
    --in->words;
    return value;
}

/* A number of things that must be at least 0. */
static int count(reader *in)
{
    const int64_t value = word(in);
    if (value < 0 || value > 1 << 24)
        reject(in, LAG_MODEL_SIZES);
    return in->status == LAG_MODEL_READ ? (int)value : 0;
}

/* `per` to a word, as many as the data say; their number to *number. Never NULL. */
static const void *items(reader *in, int per, int64_t *number)
{
    const int64_t n = word(in), words = n / per + (n % per != 0);
    const char *at = in->at;
    if (n < 0 || words > in->words) {
        reject(in, LAG_MODEL_LENGTH);
        *number = 0;
        return at;
    }
    in->at += 8 * words;
    in->words -= words;
    *number = n;
    return at;
}

/* Exactly n integers, from `low` to below `high`. */
static const int32_t *integers(reader *in, int64_t n, int64_t low, int64_t high)
{
    int64_t number;
    const int32_t *at = items(in, 2, &number);
    if (number != n)
        reject(in, LAG_MODEL_SIZES);
    for (int64_t i = 0; in->status == LAG_MODEL_READ && i < n; ++i)
        if (at[i] < low || at[i] >= high)
            reject(in, LAG_MODEL_INDEX);
    return at;
}

/* Exactly n finite numbers. */
static const double *numbers(reader *in, int64_t n)
{
    int64_t number;
    const double *at = items(in, 1, &number);
    if (number != n)
        reject(in, LAG_MODEL_SIZES);
    for (int64_t i = 0; in->status == LAG_MODEL_READ && i < n; ++i)
        if (!isfinite(at[i]))
            reject(in, LAG_MODEL_NUMBER);
    return at;
}

static lag_stream stream(reader *in)
{
    lag_stream made;
    made.code = items(in, 2, &made.length);
    if (!made.length)
        made.code = NULL;
    return made;
}

static lag_program program(reader *in)
{
    lag_program made;
    made.inputs = count(in);
    made.prelude = stream(in);
    made.main = stream(in);
    for (int i = 0; i < 3; ++i)
        made.deferred[i] = stream(in);
    for (int i = 0; i < 2; ++i)
        made.output_subsets[i] = stream(in);
    made.outputs = items(in, 2, &made.output_count);
    made.registers = items(in, 1, &made.register_count);
    if (in->status == LAG_MODEL_READ && lag_check_program(&made) != LAG_MODEL_READ)
        reject(in, LAG_MODEL_PROGRAM);
    return made;
}

/* Whether places are registers. */
static int are_registers(const int32_t *places, int64_t n, int64_t registers)
{
    for (int64_t i = 0; i < n; ++i)
        if (places[i] < 0 || places[i] >= registers)
            return 0;
    return 1;
}

/* The number of words of a vector operation after the number of its elements, or 0 if it is invalid. */
static int64_t vector_length(int op, int n, const int32_t *p, int64_t left, int64_t registers)
{
    int operands = 0;
    switch (op) {
#define OPERANDS(operation, places, value) \
    case operation:                        \
        operands = (places)-1;             \
        break;
        LAG_VECTOR_OPERATIONS(OPERANDS)
#undef OPERANDS
    default:
        return 0;
    }
    if (n < 1 || n > LAG_LONGEST || left < 1 || p[0] < 0 || p[0] > registers - n)
        return 0;
    int64_t at = 1;
    for (int i = 0; i < operands; ++i) {
        if (left - at < 2)
            return 0;
        const int64_t first = p[at], step = p[at + 1], last = first + (n - 1) * step;
        at += 2;
        if (step == LAG_INDEXED) {
            if (left - at < n || !are_registers(p + at, n, registers))
                return 0;
            at += n;
        } else if (first < 0 || first >= registers || last < 0 || last >= registers) {
            return 0;
        }
    }
    return at;
}

/* Whether a stream has an end, known operations, and no place but registers. */
static int is_stream(const lag_stream *s, int64_t registers)
{
    static const int places[] = LAG_PLACES;
    int64_t at = 0;
    while (s->length - at >= 2) {
        const int32_t op = s->code[at], n = s->code[at + 1];
        const int64_t left = s->length - at - 2;
        const int32_t *p = s->code + at + 2;
        if (op == OP_END)
            return 1;
        if (op < 0 || n < 0)
            return 0;
        if (op >= LAG_VECTOR) {
            const int64_t length = vector_length(op - LAG_VECTOR, n, p, left, registers);
            if (!length)
                return 0;
            at += 2 + length;
        } else {
            if (op > OP_END || (int64_t)places[op] * n > left || !are_registers(p, (int64_t)places[op] * n, registers))
                return 0;
            at += 2 + (int64_t)places[op] * n;
        }
    }
    return 0;
}

int lag_check_program(const lag_program *p)
{
    const int64_t registers = p->register_count;
    int valid = p->inputs >= 1 && p->inputs <= registers && p->output_count >= 0
                && is_stream(&p->prelude, registers) && is_stream(&p->main, registers)
                && are_registers(p->outputs, p->output_count, registers);
    for (int i = 0; i < 3; ++i)
        valid = valid && (!p->deferred[i].length || is_stream(&p->deferred[i], registers));
    for (int i = 0; i < 2; ++i)
        valid = valid && (!p->output_subsets[i].length || is_stream(&p->output_subsets[i], registers));
    return valid ? LAG_MODEL_READ : LAG_MODEL_PROGRAM;
}

/* Whether the dynamics have the outputs, and the room for other right sides, that their solution needs. */
static int has_solution(const lag_model *model, const lag_system *s)
{
    const lag_program *d = &model->dynamics;
    if (model->solution != LAG_MODEL_UNROLLED)
        return d->output_count > lag_first_power(s);
    for (int i = 0; i < 3; ++i)
        if (!d->deferred[i].length)
            return 0;
    return d->output_count >= lag_first_cancellation(s) + s->nc + 2 * (int64_t)s->nq + s->nc
           && d->register_count >= d->inputs + (int64_t)s->nq + 2 * s->nc;
}

/* Whether starts ascend from 0 to a number. */
static int ascend(const int32_t *start, int n, int64_t to)
{
    for (int k = 0; k < n; ++k)
        if (start[k] > start[k + 1])
            return 0;
    return start[0] == 0 && start[n] == to;
}

static lag_elimination elimination(reader *in, const lag_equations *e)
{
    lag_elimination made = {.n = e->nq + e->nc};
    const int n = made.n;
    made.order = integers(in, n, 0, n);
    made.paired = integers(in, n, 0, 2);
    made.start = integers(in, n + 1, 0, INT32_MAX);
    const int entries = in->status == LAG_MODEL_READ ? made.start[n] : 0;
    made.row = integers(in, entries, 0, n);
    made.left_start = integers(in, n + 1, 0, (int64_t)entries + 1);
    made.left_column = integers(in, entries, 0, n);
    made.left_entry = integers(in, entries, 0, entries);
    made.mass_targets = integers(in, e->nm, -1, 2 * (int64_t)n + entries);
    made.jacobian_targets = integers(in, e->nb, -1, 2 * (int64_t)n + entries);
    if (in->status != LAG_MODEL_READ)
        return made;
    if (!ascend(made.start, n, entries) || !ascend(made.left_start, n, entries))
        reject(in, LAG_MODEL_INDEX);
    /* a pair of pivots has two columns of equal length, and no other pair in it */
    for (int k = 0; in->status == LAG_MODEL_READ && k < n; ++k)
        if (made.paired[k] && (k + 1 == n || made.paired[k + 1]
                               || made.start[k + 2] - made.start[k + 1] != made.start[k + 1] - made.start[k]))
            reject(in, LAG_MODEL_INDEX);
    return made;
}

int lag_read_model(const void *data, int64_t bytes, lag_model *model)
{
    reader in = {.at = data, .words = bytes / 8, .status = LAG_MODEL_READ};
    *model = (lag_model){0};
    if (bytes < 24 || bytes % 8 || (uintptr_t)data % sizeof(double))
        return LAG_MODEL_FORMAT;
    if (word(&in) != LAG_MODEL_MAGIC || word(&in) != LAG_MODEL_VERSION)
        return LAG_MODEL_FORMAT;
    if (word(&in) != bytes / 8)
        return LAG_MODEL_LENGTH;
    lag_equations *e = &model->equations;
    lag_settings *s = &model->settings;
    e->nq = count(&in);
    e->nc = count(&in);
    e->nh = count(&in);
    e->np = count(&in);
    e->nm = count(&in);
    e->nb = count(&in);
    s->rank = count(&in);
    model->solution = count(&in);
    if (in.status != LAG_MODEL_READ)
        return in.status;
    if (e->nq < 1 || e->nq + 2 * (int64_t)e->nc > LAG_MODEL_LARGEST || e->nh > e->nc || s->rank > e->nc
        || s->rank > e->nq || model->solution > LAG_MODEL_ELIMINATION
        || (model->solution != LAG_MODEL_DENSE && s->rank < e->nc))
        return LAG_MODEL_SIZES;
    e->holonomic = integers(&in, e->nh, 0, e->nc);
    e->mass_row = integers(&in, e->nm, 0, e->nq);
    e->mass_column = integers(&in, e->nm, 0, e->nq);
    e->jacobian_row = integers(&in, e->nb, 0, e->nc);
    e->jacobian_column = integers(&in, e->nb, 0, e->nq);
    e->unit = integers(&in, e->nq, 0, e->nq);
    s->kind = integers(&in, e->nq, 0, e->nq);
    const double *t = numbers(&in, 1);
    s->y = numbers(&in, 2 * (int64_t)e->nq + 1);
    s->parameters = numbers(&in, e->np);
    s->sizes = numbers(&in, e->nq);
    s->lengths = numbers(&in, e->nc);
    s->plain_lengths = numbers(&in, e->nc);
    e->constraint = program(&in);
    model->dynamics = program(&in);
    if (model->solution == LAG_MODEL_ELIMINATION)
        model->elimination = elimination(&in, e);
    if (in.status != LAG_MODEL_READ)
        return in.status;
    if (in.words)
        return LAG_MODEL_LENGTH;
    s->t_start = *t;
    const lag_system counts = {.nq = e->nq, .nc = e->nc, .nh = e->nh, .nm = e->nm, .nb = e->nb};
    const int64_t inputs = 1 + 2 * (int64_t)e->nq + e->np;
    if (e->constraint.inputs != inputs || model->dynamics.inputs != inputs
        || e->constraint.output_count < lag_constraint_size(&counts) || !has_solution(model, &counts))
        return LAG_MODEL_OUTPUTS;
    return LAG_MODEL_READ;
}

/* Whether the settings that the caller adds can be used. */
static int are_settings(const lag_model *model)
{
    const lag_settings *s = &model->settings;
    const int n = 2 * model->equations.nq + 1;
    if (!s->atol || s->times_count < 0 || (s->times_count && (!s->times || !s->block)) || s->block_rows < 1 || s->extra
        || s->directions || !(s->rtol >= 0.0) || !isfinite(s->t_end) || !(s->t_end >= s->t_start) || !(s->h_max > 0.0))
        return 0;
    for (int i = 0; i < n; ++i)
        if (!(s->atol[i] >= 0.0))
            return 0;
    for (int64_t i = 0; i < s->times_count; ++i)
        if (!isfinite(s->times[i]) || (i && !(s->times[i] > s->times[i - 1])))
            return 0;
    return 1;
}

int lag_run_model(const lag_memory *memory, const lag_model *model, lag_run **run)
{
    *run = NULL;
    if (!are_settings(model))
        return LAG_MODEL_NUMBER;
    lag_run *made = lag_create(memory, &model->equations, &model->settings);
    if (!made)
        return LAG_MODEL_MEMORY;
    const int failed = model->solution == LAG_MODEL_UNROLLED ? lag_use_unrolled(made, &model->dynamics)
                       : model->solution == LAG_MODEL_ELIMINATION
                           ? lag_use_elimination(made, &model->dynamics, &model->elimination)
                           : lag_use_dense(made, &model->dynamics);
    if (failed) {
        lag_destroy(made);
        return LAG_MODEL_MEMORY;
    }
    *run = made;
    return LAG_MODEL_READ;
}
