#include "program/nodes.h"

#include <string.h>

#include "program/excerpt.h"
#include "program/pack.h"

#define PARTS 4        /* the main part and the deferred ones */
#define MAIN 1         /* 1 + the main part */
#define WORTH 0.5      /* required fraction of the operations of a tape in vectors */
/* Fraction of operations that are repeated often enough for a vector, below which none are sought: on models whose
 * programs gain from vectors it is 0.63 to 1, on others 0.18 to 0.58. */
#define REPEATED 0.6

/* Operations in their order. */
typedef struct {
    lag_node *nodes;
    int64_t count;
} part;

/* A tape on the way to a program. */
typedef struct {
    const lag_tape *tape;
    lag_pool *pool;                    /* of what is returned */
    lag_pool scratch;
    int64_t fixed, values;             /* inputs and constants; all registers of the tape */
    int parts;
    part prelude, part[PARTS];
    int32_t *place;                    /* of values: the register in the program, or -1 */
    int32_t registers;
    int *needed;                       /* of values: the last part after which, or in which, they are needed */
    unsigned char *kept;
} assembly;

/* Whether a tape has known operations, on registers that are ready, and outputs that exist. */
static int is_valid(const lag_tape *tape, int64_t fixed, int64_t values, unsigned char *ready)
{
    if (tape->deferred_count > PARTS - 1 || tape->subset_count > 2 || tape->family_count > tape->inputs)
        return 0;
    memset(ready, 1, (size_t)fixed);
    for (int64_t i = 0; i < tape->code_count; ++i) {
        const int32_t *line = tape->code + 5 * i;
        if (line[0] < 0 || line[0] >= OP_END || line[0] == OP_SINCOS || line[1] < fixed || line[1] >= values || ready[line[1]])
            return 0;
        for (int k = 0; k < lag_tape_kinds.operands[line[0]]; ++k)
            if (line[2 + k] < 0 || line[2 + k] >= values || !ready[line[2 + k]])
                return 0;
        ready[line[1]] = 1;
    }
    int64_t deferred = 0;
    for (int i = 0; i < tape->deferred_count; ++i)
        deferred += tape->deferred[i];
    if (deferred > tape->output_count)
        return 0;
    for (int64_t i = 0; i < tape->output_count; ++i)
        if (tape->outputs[i] < 0 || tape->outputs[i] >= values || !ready[tape->outputs[i]])
            return 0;
    for (int i = 0; i < tape->subset_count; ++i)
        for (int32_t k = i ? tape->subset_ends[i - 1] : 0; k < tape->subset_ends[i]; ++k)
            if (tape->subset[k] < 0 || tape->subset[k] >= tape->output_count)
                return 0;
    const int64_t isomorphic = tape->isomorphic_count ? tape->isomorphic_ends[tape->isomorphic_count - 1] : 0;
    for (int64_t i = 0; i < isomorphic; ++i)
        if (tape->isomorphic[i] < 0 || tape->isomorphic[i] >= values)
            return 0;
    return 1;
}

/* The part of an output: 0, or the number of its deferred group. */
static int part_of_output(const lag_tape *tape, int64_t output)
{
    int64_t end = tape->output_count;
    for (int i = tape->deferred_count; i > 0; --i) {
        end -= tape->deferred[i - 1];
        if (output >= end)
            return i;
    }
    return 0;
}

/* Divide operations among the prelude, for those that depend only on parameters, and the part that needs them: the
 * main one if several do, since a deferred one may run without the others. Unused ones are omitted. */
static void divide(assembly *a)
{
    const lag_tape *const tape = a->tape;
    int *of = lag_get(&a->scratch, (size_t)a->values, sizeof *of); /* of registers: 1 + the part, or 0 */
    unsigned char *invariant = lag_get(&a->scratch, (size_t)a->values, 1);
    a->prelude.nodes = lag_get(&a->scratch, (size_t)tape->code_count, sizeof(lag_node));
    if (a->scratch.failed)
        return;
    for (int64_t i = 0; i < tape->output_count; ++i) {
        const int own = 1 + part_of_output(tape, i);
        int *const to = of + tape->outputs[i];
        *to = *to && *to != own ? MAIN : own;
    }
    for (int64_t i = tape->code_count - 1; i >= 0; --i) {
        const int32_t *line = tape->code + 5 * i;
        const int own = of[line[1]];
        for (int k = 0; own && k < lag_tape_kinds.operands[line[0]]; ++k)
            of[line[2 + k]] = of[line[2 + k]] && of[line[2 + k]] != own ? MAIN : own;
    }
    const int64_t first = tape->inputs - tape->rhs_inputs;
    for (int64_t x = 0; x < a->fixed; ++x)
        invariant[x] = (x >= first - tape->parameters && x < first) || x >= tape->inputs;
    int64_t counts[PARTS] = {0};
    for (int64_t i = 0; i < tape->code_count; ++i)
        if (of[tape->code[5 * i + 1]])
            ++counts[of[tape->code[5 * i + 1]] - 1];
    for (int i = 0; i < a->parts; ++i)
        a->part[i].nodes = lag_get(&a->scratch, (size_t)counts[i], sizeof(lag_node));
    if (a->scratch.failed)
        return;
    for (int64_t i = 0; i < tape->code_count; ++i) {
        const int32_t *line = tape->code + 5 * i;
        if (!of[line[1]])
            continue;
        int known = 1;
        lag_node node = {line[0], {line[1]}};
        for (int k = 0; k < lag_tape_kinds.operands[line[0]]; ++k) {
            node.value[1 + k] = line[2 + k];
            known &= invariant[line[2 + k]];
        }
        invariant[line[1]] = (unsigned char)known;
        part *to = known ? &a->prelude : &a->part[of[line[1]] - 1];
        to->nodes[to->count++] = node;
    }
}

/* Find the parts after which values are needed. */
static void find_needed(assembly *a)
{
    a->needed = lag_get(&a->scratch, (size_t)a->values, sizeof *a->needed);
    a->kept = lag_get(&a->scratch, (size_t)a->values, 1);
    if (a->scratch.failed)
        return;
    for (int i = 0; i < a->parts; ++i)
        for (int64_t k = 0; k < a->part[i].count; ++k) {
            const lag_node *const node = a->part[i].nodes + k;
            for (int v = 1; v <= lag_tape_kinds.operands[node->op]; ++v)
                a->needed[node->value[v]] = i;
        }
    for (int64_t i = 0; i < a->tape->output_count; ++i)
        a->needed[a->tape->outputs[i]] = PARTS;
}

/* The values that are needed after a part. */
static const unsigned char *kept_after(assembly *a, int part)
{
    for (int64_t x = 0; x < a->values; ++x)
        a->kept[x] = a->needed[x] > part;
    return a->kept;
}

/* Merge each product that is used once, in a sum, with that sum. */
static void merge_products(assembly *a, part *p, const unsigned char *kept)
{
    int32_t *uses = lag_integers(&a->scratch, a->values);
    int32_t *product = lag_unset(&a->scratch, a->values); /* of its result: where it is */
    if (a->scratch.failed)
        return;
    for (int64_t x = 0; x < a->values; ++x)
        uses[x] = kept[x] ? 2 : 0;
    for (int64_t i = 0; i < p->count; ++i)
        for (int v = 1; v <= lag_tape_kinds.operands[p->nodes[i].op]; ++v)
            ++uses[p->nodes[i].value[v]];
    for (int64_t i = 0; i < p->count; ++i)
        if (p->nodes[i].op == OP_MUL && uses[p->nodes[i].value[0]] == 1)
            product[p->nodes[i].value[0]] = (int32_t)i;
    for (int64_t i = 0; i < p->count; ++i) {
        lag_node *const node = p->nodes + i;
        const int32_t x = node->value[1], y = node->value[2];
        if ((node->op != OP_ADD && node->op != OP_SUB) || x == y)
            continue;
        const int second = product[y] >= 0;
        if (!second && product[x] < 0)
            continue;
        lag_node *const merged = p->nodes + product[second ? y : x];
        node->op = node->op == OP_ADD ? OP_MULADD : second ? OP_SUBMUL : OP_MULSUB;
        node->value[3] = second ? x : y;
        node->value[1] = merged->value[1];
        node->value[2] = merged->value[2];
        merged->value[0] = -1;
    }
    int64_t count = 0;
    for (int64_t i = 0; i < p->count; ++i)
        if (p->nodes[i].value[0] >= 0)
            p->nodes[count++] = p->nodes[i];
    p->count = count;
}

/* Merge the sine and the cosine of one operand. */
static void merge_sines(assembly *a, part *p)
{
    int32_t *sine = lag_unset(&a->scratch, a->values), *cosine = lag_unset(&a->scratch, a->values); /* of operands */
    if (a->scratch.failed)
        return;
    for (int64_t i = 0; i < p->count; ++i) {
        if (p->nodes[i].op == OP_SIN)
            sine[p->nodes[i].value[1]] = p->nodes[i].value[0];
        if (p->nodes[i].op == OP_COS)
            cosine[p->nodes[i].value[1]] = p->nodes[i].value[0];
    }
    int64_t count = 0;
    for (int64_t i = 0; i < p->count; ++i) {
        lag_node node = p->nodes[i];
        if (node.op == OP_SIN || node.op == OP_COS) {
            const int32_t x = node.value[1];
            if (sine[x] == -2)
                continue; /* merged already */
            if (sine[x] >= 0 && cosine[x] >= 0) {
                node = (lag_node){OP_SINCOS, {sine[x], cosine[x], x}};
                sine[x] = -2;
            }
        }
        p->nodes[count++] = node;
    }
    p->count = count;
}

/* The stream of operations with registers, which lasts. */
static lag_stream stream_of(assembly *a, const lag_node *nodes, int64_t n)
{
    int32_t *numbers = lag_integers(&a->scratch, lag_stream_bound(n));
    if (!numbers)
        return (lag_stream){0};
    const int64_t length = lag_write_stream(nodes, n, &lag_tape_kinds, numbers);
    return (lag_stream){lag_copy_integers(a->pool, numbers, length), length};
}

/* Write the streams of vectors, if they are worthwhile; returns whether they are. */
static int pack(assembly *a, lag_stream *streams[PARTS])
{
    int64_t operations = 0;
    for (int i = 0; i < a->parts; ++i)
        operations += a->part[i].count;
    if (operations < a->tape->vectors_from)
        return 0;
    lag_node *all = lag_get(&a->scratch, (size_t)operations, sizeof *all);
    int32_t *place = lag_copy_integers(&a->scratch, a->place, a->values);
    int32_t *after = lag_integers(&a->scratch, a->values);
    if (a->scratch.failed)
        return 0;
    operations = 0;
    for (int i = 0; i < a->parts; ++i) {
        memcpy(all + operations, a->part[i].nodes, (size_t)a->part[i].count * sizeof *all);
        operations += a->part[i].count;
    }
    const int64_t repeated = lag_repeated(all, operations, a->values);
    if (repeated < 0)
        a->scratch.failed = 1;
    if ((double)repeated < REPEATED * (double)operations)
        return 0;
    lag_packing packing = lag_packing_of(a->pool, a->tape, a->values, place, a->registers);
    unsigned char *moved = lag_get(&a->scratch, (size_t)packing.families, 1);
    if (a->scratch.failed || a->pool->failed)
        return 0;
    for (int i = 0; i < a->parts && !a->pool->failed; ++i) {
        *streams[i] = lag_pack(&packing, a->part[i].nodes, a->part[i].count, kept_after(a, i));
        if (!i) {
            memcpy(after, place, (size_t)a->values * sizeof *after);
            memcpy(moved, packing.moved, (size_t)packing.families);
            continue;
        }
        /* values moved by a deferred part are not available to the others */
        memcpy(packing.moved, moved, (size_t)packing.families);
        for (int64_t x = 0; x < a->values; ++x)
            if (after[x] >= 0)
                place[x] = after[x];
    }
    if ((double)packing.packed < WORTH * (double)operations)
        return 0;
    a->place = place;
    a->registers = packing.slots.end;
    return 1;
}

/* The stream for a subset of the outputs, instead of the main one. */
static lag_stream subset_of(assembly *a, const lag_stream *main, const int32_t *outputs, int64_t count)
{
    const lag_tape *const tape = a->tape;
    unsigned char *asked = lag_get(&a->scratch, (size_t)a->values, 1);
    int32_t *registers = lag_integers(&a->scratch, a->values);
    int wanted[PARTS] = {0};
    if (a->scratch.failed)
        return (lag_stream){0};
    for (int64_t i = 0; i < count; ++i) {
        const int of = part_of_output(tape, outputs[i]);
        wanted[of] = 1;
        if (!of)
            asked[tape->outputs[outputs[i]]] = 1;
    }
    for (int i = 1; i < a->parts; ++i) {
        if (!wanted[i])
            continue;
        const part *const p = &a->part[i];
        unsigned char *own = lag_get(&a->scratch, (size_t)a->values, 1);
        if (!own)
            return (lag_stream){0};
        for (int64_t k = 0; k < p->count; ++k)
            for (int v = 0; v < lag_results(&lag_tape_kinds, p->nodes[k].op); ++v)
                own[p->nodes[k].value[v]] = 1;
        for (int64_t k = 0; k < p->count; ++k)
            for (int v = lag_results(&lag_tape_kinds, p->nodes[k].op); v < lag_places(&lag_tape_kinds, p->nodes[k].op); ++v)
                if (!own[p->nodes[k].value[v]])
                    asked[p->nodes[k].value[v]] = 1;
    }
    int64_t n = 0;
    for (int64_t x = 0; x < a->values; ++x)
        if (asked[x])
            registers[n++] = a->place[x];
    return lag_excerpt(a->pool, main, registers, n, a->registers);
}

/* Complete a program. */
static void assemble(assembly *a, lag_assembled *to)
{
    const lag_tape *const tape = a->tape;
    lag_program *const program = &to->program;
    divide(a);
    find_needed(a);
    a->place = lag_unset(&a->scratch, a->values);
    if (a->scratch.failed)
        return;
    for (a->registers = 0; a->registers < a->fixed; ++a->registers)
        a->place[a->registers] = a->registers;
    for (int64_t i = 0; i < a->prelude.count; ++i) {
        lag_node *const node = a->prelude.nodes + i;
        a->place[node->value[0]] = a->registers++;
        for (int v = 0; v < lag_places(&lag_tape_kinds, node->op); ++v)
            node->value[v] = a->place[node->value[v]];
    }
    program->prelude = stream_of(a, a->prelude.nodes, a->prelude.count);
    for (int i = 0; i < a->parts; ++i) {
        merge_products(a, &a->part[i], kept_after(a, i));
        merge_sines(a, &a->part[i]);
    }
    if (a->scratch.failed)
        return;
    to->size = a->part[0].count;
    lag_stream *streams[PARTS] = {&program->main, &program->deferred[0], &program->deferred[1], &program->deferred[2]};
    if (!pack(a, streams))
        for (int i = 0; i < a->parts && !a->scratch.failed; ++i) {
            /* which registers subsets need is asked by values, which `lag_allocate` replaces */
            const int64_t n = a->part[i].count;
            lag_node *nodes = lag_copy(&a->scratch, a->part[i].nodes, (size_t)n, sizeof *nodes);
            if (nodes && lag_in_runs(nodes, n, &lag_tape_kinds, a->values) &&
                lag_allocate(nodes, n, &lag_tape_kinds, a->values, a->place, &a->registers, kept_after(a, i)))
                *streams[i] = stream_of(a, nodes, n);
            else
                a->scratch.failed = 1;
        }
    if (a->scratch.failed || a->pool->failed)
        return;
    for (int i = 0; i < tape->subset_count; ++i) {
        const int32_t begin = i ? tape->subset_ends[i - 1] : 0;
        program->output_subsets[i] =
            subset_of(a, &program->main, tape->subset + begin, tape->subset_ends[i] - begin);
    }
    double *registers = lag_doubles(a->pool, a->registers);
    int32_t *outputs = lag_get(a->pool, (size_t)tape->output_count, sizeof *outputs);
    if (a->pool->failed)
        return;
    memcpy(registers + tape->inputs, tape->constants, (size_t)tape->constant_count * sizeof *registers);
    for (int64_t i = 0; i < tape->output_count; ++i)
        outputs[i] = a->place[tape->outputs[i]];
    program->inputs = tape->inputs - tape->rhs_inputs;
    program->registers = registers;
    program->register_count = a->registers;
    program->outputs = outputs;
    program->output_count = tape->output_count;
}

/* What lag_assemble returns, and its memory. */
typedef struct {
    lag_assembled public;
    lag_pool pool;
} owner;

lag_assembled *lag_assemble(const lag_memory *memory, const lag_tape *tape, int *valid)
{
    lag_pool pool = lag_pool_of(memory);
    owner *made = lag_get(&pool, 1, sizeof *made);
    assembly a = {.tape = tape, .pool = &pool, .scratch = lag_pool_of(memory), .parts = 1 + tape->deferred_count};
    a.fixed = tape->inputs + tape->constant_count;
    a.values = a.fixed + tape->code_count;
    unsigned char *ready = lag_get(&a.scratch, (size_t)a.values, 1);
    *valid = !ready || is_valid(tape, a.fixed, a.values, ready);
    if (made && ready && *valid)
        assemble(&a, &made->public);
    const int failed = !*valid || pool.failed || a.scratch.failed;
    lag_release(&a.scratch);
    if (failed) {
        lag_release(&pool);
        return NULL;
    }
    made->pool = pool;
    return &made->public;
}

void lag_assembled_destroy(lag_assembled *assembled)
{
    if (assembled) {
        lag_pool pool = ((owner *)assembled)->pool;
        lag_release(&pool);
    }
}
