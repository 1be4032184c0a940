#include "program/slices.h"

#include <string.h>

#include "lagprogram.h"
#include "program/nodes.h"

/* The operations of a program one by one, and what each needs. */
typedef struct {
    int32_t *code;          /* the stream, of scalar operations */
    int32_t *first, *op;    /* of each operation: its first number in the stream, and what it is */
    int32_t *from;          /* of each number that is an operand: the operation that has made it; -1: it was there before */
    int32_t *writer;        /* of each register: the last operation that writes it; -1 */
    int32_t count;
} operations;

/* What belongs to the present function. */
typedef struct {
    int32_t *list, count;   /* operations */
    int32_t *waiting, top;  /* operations whose operands are still to be looked at */
    int32_t *inputs, read;
    int32_t *stamp, *seen;  /* of operations, of inputs: 1 + the last function that has them */
    int32_t first_parameter;
} selection;

static int results_of(int op)
{
    return lag_results(&lag_tape_kinds, op);
}

static void list_operations(const lag_program *program, operations *o)
{
    lag_unpack(&program->main, o->code);
    for (int64_t i = 0; i < program->register_count; ++i)
        o->writer[i] = -1;
    for (const int32_t *p = o->code; *p != OP_END;) {
        const int op = *p++, n = *p++, places = lag_places(&lag_tape_kinds, op), results = results_of(op);
        for (int k = 0; k < n; ++k, p += places) {
            for (int i = results; i < places; ++i)
                o->from[p + i - o->code] = o->writer[p[i]];
            for (int i = 0; i < results; ++i)
                o->writer[p[i]] = o->count;
            o->op[o->count] = op;
            o->first[o->count++] = (int32_t)(p - o->code);
        }
    }
}

/* Function f needs a register, which an operation has made, or which was there before. */
static void need(selection *s, int32_t f, int32_t from, int32_t place)
{
    if (from >= 0) {
        s->waiting[s->top++] = from;
    } else if (place < s->first_parameter && s->seen[place] != f + 1) {
        s->seen[place] = f + 1;
        s->inputs[s->read++] = place;
    }
}

static void select_operations(const operations *o, selection *s, int32_t f)
{
    while (s->top) {
        const int32_t one = s->waiting[--s->top];
        if (s->stamp[one] == f + 1)
            continue;
        s->stamp[one] = f + 1;
        s->list[s->count++] = one;
        for (int i = results_of(o->op[one]); i < lag_places(&lag_tape_kinds, o->op[one]); ++i)
            need(s, f, o->from[o->first[one] + i], o->code[o->first[one] + i]);
    }
}

/* Ascending. */
static void sort(int32_t *x, int32_t n)
{
    for (int32_t gap = n / 2; gap > 0; gap /= 2)
        for (int32_t i = gap; i < n; ++i) {
            const int32_t v = x[i];
            int32_t j = i;
            for (; j >= gap && x[j - gap] > v; j -= gap)
                x[j] = x[j - gap];
            x[j] = v;
        }
}

/* The selected operations as a stream; returns its length. */
static int64_t write(const operations *o, selection *s, int32_t *to)
{
    int64_t at = 0, head = -1;
    sort(s->list, s->count);
    for (int32_t i = 0; i < s->count; ++i) {
        const int op = o->op[s->list[i]], places = lag_places(&lag_tape_kinds, op);
        if (head < 0 || to[head] != op) {
            head = at;
            to[at++] = op;
            to[at++] = 0;
        }
        ++to[head + 1];
        memcpy(to + at, o->code + o->first[s->list[i]], (size_t)places * sizeof *to);
        at += places;
    }
    to[at++] = OP_END;
    to[at++] = 0;
    return at;
}

const lag_slice *lag_slices(lag_pool *pool, const lag_program *program, int inputs, int functions, const int32_t *outputs,
                            const int32_t *ends)
{
    lag_pool own = lag_pool_of(&pool->from);
    const int64_t length = lag_unpack(&program->main, NULL), registers = program->register_count;
    const int64_t most = 4 * length + ends[functions - 1] + 1; /* operands of all operations, and outputs */
    operations o = {lag_integers(&own, length), lag_integers(&own, length), lag_integers(&own, length),
                    lag_integers(&own, length), lag_integers(&own, registers), 0};
    selection s = {.list = lag_integers(&own, length), .waiting = lag_integers(&own, most),
                   .inputs = lag_integers(&own, inputs + INT64_C(1)), .stamp = lag_integers(&own, length),
                   .seen = lag_integers(&own, inputs + INT64_C(1)), .first_parameter = inputs};
    int32_t *to = lag_integers(&own, 3 * length + 2);
    lag_slice *slices = lag_get(&own, (size_t)functions, sizeof *slices);
    int64_t total = 0;
    if (!own.failed)
        list_operations(program, &o);
    for (int32_t f = 0; f < functions && !own.failed && total <= LAG_SLICES * length; ++f) {
        s.count = s.read = 0;
        for (int32_t i = f ? ends[f - 1] : 0; i < ends[f]; ++i) {
            const int32_t place = program->outputs[outputs[i]];
            need(&s, f, o.writer[place], place);
        }
        select_operations(&o, &s, f);
        const int64_t size = write(&o, &s, to);
        total += size;
        slices[f] = (lag_slice){{lag_copy_integers(pool, to, size), size}, lag_copy_integers(pool, s.inputs, s.read), s.read};
    }
    const int use = !own.failed && total <= LAG_SLICES * length;
    const lag_slice *made = use ? lag_copy(pool, slices, (size_t)functions, sizeof *slices) : NULL;
    pool->failed |= own.failed;
    lag_release(&own);
    return made;
}
