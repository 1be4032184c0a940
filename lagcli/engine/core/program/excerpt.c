#include "program/excerpt.h"

#include "lagprogram.h"
#include "program/nodes.h"

/* A scalar or vector operation of a stream. */
typedef struct {
    int op, vector;
    int32_t size;
    const int32_t *numbers;            /* its own, without the operation and the size */
    int64_t length;
} step;

/* A place in a stream: the next number, and the operations of the present run that follow. */
typedef struct {
    const int32_t *at;
    int op;
    int32_t left;
} reader;

/* The next operation, if there is one. */
static int next_step(reader *r, step *s)
{
    while (!r->left) {
        r->op = r->at[0];
        r->left = r->at[1];
        if (r->op == OP_END)
            return 0;
        r->at += 2;
        if (r->op < LAG_VECTOR)
            continue;
        *s = (step){r->op - LAG_VECTOR, 1, r->left, r->at, 1};
        for (int i = 0; i < lag_tape_kinds.operands[s->op]; ++i)
            s->length += 2 + (s->numbers[s->length + 1] == LAG_INDEXED ? s->size : 0);
        r->at += s->length;
        r->left = 0;
        return 1;
    }
    --r->left;
    *s = (step){r->op, 0, 1, r->at, lag_places(&lag_tape_kinds, r->op)};
    r->at += s->length;
    return 1;
}

/* The registers of a vector's operand from a place of its numbers on; returns the place of the next one's. */
static const int32_t *operand(const int32_t *at, int32_t size, int32_t *registers)
{
    const int listed = at[1] == LAG_INDEXED;
    for (int32_t i = 0; i < size; ++i)
        registers[i] = listed ? at[2 + i] : at[0] + i * at[1];
    return at + 2 + (listed ? size : 0);
}

/* Whether results of an operation are live; if so, their operands are live before it. */
static int is_live(const step *s, unsigned char *live)
{
    const int results = lag_results(&lag_tape_kinds, s->op), operands = lag_tape_kinds.operands[s->op];
    const int32_t count = s->vector ? s->size : results;
    int found = 0;
    for (int32_t i = 0; i < count; ++i)
        found |= live[s->vector ? s->numbers[0] + i : s->numbers[i]];
    if (!found)
        return 0;
    for (int32_t i = 0; i < count; ++i)
        live[s->vector ? s->numbers[0] + i : s->numbers[i]] = 0;
    int32_t registers[LAG_LONGEST];
    const int32_t *at = s->numbers + (s->vector ? 1 : results);
    for (int k = 0; k < operands; ++k) {
        if (s->vector) {
            at = operand(at, s->size, registers);
            for (int32_t i = 0; i < s->size; ++i)
                live[registers[i]] = 1;
        } else {
            live[*at++] = 1;
        }
    }
    return 1;
}

/* What is written, with adjacent operations of a kind as one run. */
typedef struct {
    int32_t *to;
    int64_t length, head;
    int run;                           /* the kind of the present run, or -1 */
} writer;

/* Write the head of an operation. Without `to`, only the length is counted. */
static void begin(writer *w, int op, int vector, int32_t size)
{
    if (vector || op != w->run) {
        w->run = vector ? -1 : op;
        if (w->to) {
            w->to[w->length] = vector ? LAG_VECTOR + op : op;
            w->to[w->length + 1] = 0;
        }
        w->head = w->length + 1;
        w->length += 2;
    }
    if (w->to)
        w->to[w->head] += size;
}

static void put(writer *w, int32_t number)
{
    if (w->to)
        w->to[w->length] = number;
    ++w->length;
}

static void finish(writer *w)
{
    put(w, OP_END);
    put(w, 0);
}

lag_stream lag_excerpt(lag_pool *pool, const lag_stream *stream, const int32_t *registers, int64_t count,
                       int64_t register_count)
{
    lag_pool own = lag_pool_of(&pool->from);
    unsigned char *live = lag_get(&own, (size_t)register_count, 1);
    step *steps = lag_get(&own, (size_t)stream->length, sizeof *steps);
    unsigned char *kept = lag_get(&own, (size_t)stream->length, 1);
    writer w = {.to = lag_integers(&own, stream->length), .run = -1};
    lag_stream made = {0};
    if (!own.failed) {
        int64_t n = 0;
        for (reader r = {stream->code, 0, 0}; next_step(&r, steps + n);)
            ++n;
        for (int64_t i = 0; i < count; ++i)
            live[registers[i]] = 1;
        for (int64_t i = n - 1; i >= 0; --i)
            kept[i] = (unsigned char)is_live(steps + i, live);
        for (int64_t i = 0; i < n; ++i) {
            if (!kept[i])
                continue;
            begin(&w, steps[i].op, steps[i].vector, steps[i].size);
            for (int64_t k = 0; k < steps[i].length; ++k)
                put(&w, steps[i].numbers[k]);
        }
        finish(&w);
        made = (lag_stream){lag_copy_integers(pool, w.to, w.length), w.length};
    }
    pool->failed |= own.failed;
    lag_release(&own);
    return made;
}

int64_t lag_unpack(const lag_stream *stream, int32_t *to)
{
    writer w = {.to = to, .run = -1};
    step s;
    for (reader r = {stream->code, 0, 0}; next_step(&r, &s);) {
        begin(&w, s.op, 0, s.vector ? s.size : 1);
        if (!s.vector) {
            for (int64_t k = 0; k < s.length; ++k)
                put(&w, s.numbers[k]);
            continue;
        }
        int32_t registers[3][LAG_LONGEST];
        const int operands = lag_tape_kinds.operands[s.op];
        const int32_t *at = s.numbers + 1;
        for (int k = 0; k < operands; ++k)
            at = operand(at, s.size, registers[k]);
        for (int32_t i = 0; i < s.size; ++i) {
            put(&w, s.numbers[0] + i);
            for (int k = 0; k < operands; ++k)
                put(&w, registers[k][i]);
        }
    }
    finish(&w);
    return w.length;
}
