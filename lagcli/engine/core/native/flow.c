#include "native/flow.h"

#include <string.h>

#include "tape/stream.h"

static const int places_of[] = LAG_PLACES;

static int results_of(int op)
{
    return op == OP_SINCOS ? 2 : 1;
}

/* The next instruction of a stream: an operation, on as many numbers one by one or, on a vector, together. */
typedef struct {
    int32_t op, n;
    const int32_t *words;
} instruction;

static const int32_t *next_instruction(const int32_t *at, instruction *found)
{
    *found = (instruction){at[0], at[1], at + 2};
    if (found->op < LAG_VECTOR)
        return found->words + (int64_t)places_of[found->op] * found->n;
    at = found->words + 1;
    for (int i = places_of[found->op - LAG_VECTOR]; i > 1; --i)
        at = lag_after(at, found->n);
    return at;
}

/* Mark in `kept` the registers that a stream reads before it writes them. */
static void mark_read(const int32_t *at, uint8_t *kept, uint8_t *written, int64_t registers, int lanes)
{
    instruction i;
    memset(written, 0, (size_t)registers);
    for (at = next_instruction(at, &i); i.op != OP_END; at = next_instruction(at, &i)) {
        const int32_t *p = i.words;
        if (i.op >= LAG_VECTOR) {
            const int32_t *x = p + 1;
            for (int operands = places_of[i.op - LAG_VECTOR] - 1; operands > 0; --operands, x = lag_after(x, i.n))
                for (int k = 0; k < i.n; ++k)
                    kept[lag_element(x, k)] |= !written[lag_element(x, k)];
            memset(written + p[0], 1, (size_t)i.n);
            continue;
        }
        const int places = places_of[i.op], results = results_of(i.op);
        for (int k = 0; k < i.n; ++k, p += places) {
            for (int j = results; j < places; ++j)
                kept[p[j] / lanes] |= !written[p[j] / lanes];
            for (int j = 0; j < results; ++j)
                written[p[j] / lanes] = 1;
        }
    }
}

/* The registers that are read after a stream: outputs, and what streams begin with. */
static void mark_kept(const lag_source *source, uint8_t *kept, uint8_t *written)
{
    for (int64_t i = 0; i < source->output_count; ++i)
        kept[source->outputs[i] / source->lanes] = 1;
    for (int i = 0; i < LAG_ROUTINES; ++i)
        if (source->routines[i]->code)
            mark_read(source->routines[i]->code, kept, written, source->register_count, source->lanes);
}

static int is_valid(const lag_source *source)
{
    if (source->lanes == 1 && !lag_are_registers(source->outputs, source->output_count, source->register_count))
        return 0;
    for (int i = 0; i < LAG_ROUTINES; ++i) {
        const lag_stream stream = {source->routines[i]->code, source->routines[i]->length};
        if (stream.code && !lag_is_stream(&stream, source->register_count * source->lanes))
            return 0;
    }
    return 1;
}

/* The numbers of nodes and of results of a stream. */
static void measure(const int32_t *at, int64_t *nodes, int64_t *results)
{
    instruction i;
    for (at = next_instruction(at, &i); i.op != OP_END; at = next_instruction(at, &i)) {
        const int vector = i.op >= LAG_VECTOR;
        *nodes += vector ? 1 : i.n;
        *results += vector ? i.n : (int64_t)results_of(i.op) * i.n;
    }
}

/* What is known while a stream is read. */
typedef struct {
    lag_flow *flow;
    int32_t *now;                      /* the value in each place */
    int32_t *born;                     /* the segment whose numbers a value is among; 0: it is in its place */
    int32_t *touched;                  /* per place: the last segment that reads it there */
    int32_t segment;                   /* from 1 on */
} reading;

static lag_node *new_node(reading *r, int op)
{
    lag_node *node = r->flow->node + r->flow->nodes++;
    *node = (lag_node){.op = op, .segment = r->segment, .result = {LAG_NO_VALUE, LAG_NO_VALUE}};
    for (int j = 0; j < 3; ++j)
        node->operand[j] = LAG_NO_VALUE;
    return node;
}

static int32_t new_value(reading *r, int32_t place)
{
    const int32_t value = r->flow->values++;
    r->flow->place[value] = place;
    return value;
}

/* The value in a place, read by an operation on numbers. */
static int32_t read_value(reading *r, int32_t place)
{
    const int32_t value = r->now[place];
    if (r->born[value] != r->segment)
        r->touched[place] = r->segment;
    return value;
}

/* A value that an operation on numbers writes. It may come to its place at once unless what is there is still read. */
static int32_t write_value(reading *r, int32_t place)
{
    const int32_t value = new_value(r, place);
    r->flow->late[value] = r->touched[place] == r->segment;
    r->born[value] = r->segment;
    r->now[place] = value;
    return value;
}

static void read_scalar(reading *r, int op, const int32_t *p, const int32_t *operands)
{
    lag_node *node = new_node(r, op);
    const int results = results_of(op), count = places_of[op] - results;
    for (int j = 0; j < count; ++j)
        node->operand[j] = read_value(r, operands[j]);
    for (int j = 0; j < results; ++j)
        node->result[j] = write_value(r, p[j]);
}

/* Returns 0, or 1 where results lie on operands: then the order of elements matters. */
static int read_vector(reading *r, const instruction *i)
{
    const int op = i->op - LAG_VECTOR, operands = places_of[op] - 1, n = i->n;
    const int32_t to = i->words[0], *x[3] = {i->words + 1};
    for (int j = 0; j < operands; ++j) {
        if (j)
            x[j] = lag_after(x[j - 1], n);
        for (int k = 0; k < n; ++k)
            if (lag_element(x[j], k) >= to && lag_element(x[j], k) < to + n)
                return 1;
    }
    ++r->segment;
    lag_node *node = new_node(r, i->op);
    node->length = n;
    node->words = i->words;
    for (int j = 0; j < operands; ++j) {
        if (x[j][1] == 0) {
            node->operand[j] = read_value(r, x[j][0]);
            continue;
        }
        for (int k = 0; k < n; ++k) /* where they lie */
            r->flow->kept[r->now[lag_element(x[j], k)]] = 1;
    }
    for (int k = 0; k < n; ++k)
        r->now[to + k] = new_value(r, to + k);
    node->result[0] = r->now[to];
    ++r->segment;
    return 0;
}

/* Put the nodes that are needed in order: each operation right before the first that uses it, so that few values are
 * needed later; vectors where they are. */
static void arrange(lag_flow *flow, const int32_t *maker, int32_t *stack, uint8_t *state)
{
    enum { NEEDED = 1, ROOT = 2, DONE = 4 };
    lag_node *const node = flow->node;
    for (int32_t i = flow->nodes - 1; i >= 0; --i) {
        lag_node *x = node + i;
        if (x->op >= LAG_VECTOR) {
            for (int k = 0; k < x->length; ++k)
                state[i] |= flow->kept[x->result[0] + k] ? NEEDED : 0;
            for (int k = 0; !state[i] && k < x->length; ++k)
                state[i] |= flow->use[x->result[0] + k] ? NEEDED : 0;
        } else {
            for (int k = 0; k < results_of(x->op); ++k)
                state[i] |= (flow->kept[x->result[k]] ? NEEDED | ROOT : 0) | (flow->use[x->result[k]] ? NEEDED : 0);
        }
        if (!state[i])
            continue;
        for (int j = 0; j < 3; ++j) {
            const int32_t v = x->operand[j], from = v == LAG_NO_VALUE ? -1 : maker[v];
            if (v == LAG_NO_VALUE)
                continue;
            flow->use[v] = 1;
            if (from >= 0 && node[from].segment != x->segment)
                state[from] |= NEEDED | ROOT;
        }
    }
    for (int32_t root = 0; root < flow->nodes; ++root) {
        if (node[root].op >= LAG_VECTOR && state[root]) {
            flow->order[flow->length++] = root;
            continue;
        }
        if (!(state[root] & ROOT) || state[root] & DONE)
            continue;
        int32_t depth = 0;
        stack[depth++] = root;
        while (depth) {
            const int32_t i = stack[depth - 1];
            const lag_node *x = node + i;
            int32_t waiting = -1;
            for (int j = 0; j < 3 && waiting < 0; ++j) {
                const int32_t from = x->operand[j] == LAG_NO_VALUE ? -1 : maker[x->operand[j]];
                if (from >= 0 && node[from].segment == x->segment && !(state[from] & DONE))
                    waiting = from;
            }
            if (waiting >= 0) {
                stack[depth++] = waiting;
                continue;
            }
            --depth;
            if (!(state[i] & DONE)) {
                state[i] |= DONE;
                flow->order[flow->length++] = i;
            }
        }
    }
}

/* Find where values are used next: at first in flow->use, then in the nodes. */
static void find_uses(lag_flow *flow)
{
    int32_t *next = flow->use;
    for (int32_t v = 0; v < flow->values; ++v)
        next[v] = LAG_NEVER;
    for (int32_t i = flow->length - 1; i >= 0; --i) {
        lag_node *x = flow->node + flow->order[i];
        for (int j = 0; j < 2; ++j)
            if (x->op < LAG_VECTOR && x->result[j] != LAG_NO_VALUE)
                x->first[j] = next[x->result[j]];
        for (int j = 0; j < 3; ++j)
            if (x->operand[j] != LAG_NO_VALUE)
                x->later[j] = next[x->operand[j]];
        for (int j = 0; j < 3; ++j)
            if (x->operand[j] != LAG_NO_VALUE)
                next[x->operand[j]] = i;
    }
}

int lag_flow_read(lag_flow *flow, lag_pool *pool, const lag_source *source, const lag_routine *routine)
{
    const int64_t registers = source->register_count, places = registers * source->lanes;
    int64_t nodes = 0, values = places;
    *flow = (lag_flow){.values = (int32_t)places, .places = (int32_t)places};
    if (!is_valid(source))
        return 1;
    measure(routine->code, &nodes, &values);
    if (values > LAG_NEVER / 64)
        return 1;
    uint8_t *kept = lag_get(pool, (size_t)registers, 1), *written = lag_get(pool, (size_t)registers, 1);
    int32_t *now = lag_get(pool, 2 * (size_t)places, sizeof *now);
    int32_t *born = lag_get(pool, (size_t)values, sizeof *born);
    int32_t *maker = lag_get(pool, (size_t)values, sizeof *maker);
    int32_t *stack = lag_get(pool, (size_t)nodes, sizeof *stack);
    uint8_t *state = lag_get(pool, (size_t)nodes, 1);
    flow->node = lag_get(pool, (size_t)nodes, sizeof *flow->node);
    flow->order = lag_get(pool, (size_t)nodes, sizeof *flow->order);
    flow->place = lag_get(pool, (size_t)values, sizeof *flow->place);
    flow->use = lag_get(pool, (size_t)values, sizeof *flow->use);
    flow->kept = lag_get(pool, (size_t)values, 1);
    flow->late = lag_get(pool, (size_t)values, 1);
    if (pool->failed)
        return 1;
    mark_kept(source, kept, written);
    reading r = {.flow = flow, .now = now, .born = born, .touched = now + places, .segment = 1};
    for (int32_t i = 0; i < places; ++i)
        now[i] = flow->place[i] = i;
    instruction i;
    const int32_t *at = routine->code;
    for (at = next_instruction(at, &i); i.op != OP_END; at = next_instruction(at, &i)) {
        if (i.op >= LAG_VECTOR) {
            if (source->lanes > 1 || read_vector(&r, &i))
                return 1;
            continue;
        }
        const int32_t *p = i.words;
        for (int k = 0; k < i.n; ++k, p += places_of[i.op])
            read_scalar(&r, i.op, p, p + results_of(i.op));
    }
    for (int64_t k = 0; k < registers; ++k)
        if (kept[k] && now[k * source->lanes] >= places)
            flow->kept[now[k * source->lanes]] = 1;
    memset(maker, -1, (size_t)values * sizeof *maker);
    for (int32_t k = 0; k < flow->nodes; ++k)
        for (int j = 0; j < 2; ++j)
            if (flow->node[k].op < LAG_VECTOR && flow->node[k].result[j] != LAG_NO_VALUE)
                maker[flow->node[k].result[j]] = k;
    arrange(flow, maker, stack, state);
    find_uses(flow);
    return 0;
}
