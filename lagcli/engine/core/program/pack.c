#include "program/pack.h"

#include <string.h>

/* Operations that are executed together, as a vector or one after the other. */
typedef struct {
    int32_t op;
    int vector;
    int64_t first, count;              /* among the nodes */
} unit;

/* A stream in units, before it is written. */
typedef struct {
    lag_pool pool;
    lag_node *nodes;
    int64_t node_count;
    unit *units;
    int64_t unit_count;
    int32_t *place;                    /* registers of values, as if none were used again */
    int32_t end;
} draft;

lag_packing lag_packing_of(lag_pool *pool, const lag_tape *tape, int64_t values, int32_t *place, int32_t count)
{
    lag_packing made = {.pool = pool, .tape = tape, .values = values, .place = place};
    for (int64_t i = 0; i < tape->family_count; ++i)
        if (tape->families[i] >= made.families)
            made.families = tape->families[i] + 1;
    made.slots = lag_slots_from(pool, count);
    made.moved = lag_get(pool, (size_t)made.families, 1);
    return made;
}

static int is_on_vectors(int op)
{
    switch (op) {
#define CASE(operation, places, value) case operation:
        LAG_VECTOR_OPERATIONS(CASE)
#undef CASE
        return 1;
    default:
        return 0;
    }
}

static int results_of(const lag_node *node)
{
    return lag_results(&lag_tape_kinds, node->op);
}

static int places_of(const lag_node *node)
{
    return lag_places(&lag_tape_kinds, node->op);
}

/* Add a unit without nodes. */
static unit *add_unit(draft *d, int32_t op, int vector)
{
    d->units[d->unit_count] = (unit){op, vector, d->node_count, 0};
    return &d->units[d->unit_count++];
}

static void add_node(draft *d, unit *u, lag_node node)
{
    d->nodes[d->node_count++] = node;
    ++u->count;
}

/* Give the results of units contiguous registers, as if none were used again. */
static void place_units(draft *d, int64_t first)
{
    for (int64_t i = first; i < d->unit_count; ++i) {
        int32_t at = d->end;
        for (int64_t k = d->units[i].first; k < d->units[i].first + d->units[i].count; ++k)
            for (int r = 0; r < results_of(d->nodes + k); ++r)
                d->place[d->nodes[k].value[r]] = at++;
        d->end += ((at - d->end + LAG_LINE - 1) / LAG_LINE + 1) * LAG_LINE;
    }
}

/* The number of equal parts that are at most as long as a vector. */
static int64_t pieces(int64_t count)
{
    return (count + LAG_LONGEST - 1) / LAG_LONGEST;
}

/* Add the operations that make values contiguous. */
static void add_moves(draft *d, const int32_t *values, int64_t count)
{
    const int64_t parts = pieces(count);
    for (int64_t part = 0; part < parts; ++part) {
        unit *moves = add_unit(d, OP_MOVE, 1);
        for (int64_t i = count * part / parts; i < count * (part + 1) / parts; ++i)
            add_node(d, moves, (lag_node){OP_MOVE, {values[i], values[i]}});
    }
}

/* Add the operations that make the inputs of families contiguous. */
static void add_inputs(lag_packing *p, draft *d, const lag_node *nodes, int64_t n)
{
    const lag_tape *const tape = p->tape;
    unsigned char *used = lag_get(&d->pool, (size_t)p->families, 1);
    int32_t *members = lag_integers(&d->pool, tape->family_count);
    if (d->pool.failed)
        return;
    for (int64_t i = 0; i < n; ++i)
        for (int k = results_of(nodes + i); k < places_of(nodes + i); ++k) {
            const int32_t x = nodes[i].value[k];
            if (x < tape->family_count && tape->families[x] >= 0)
                used[tape->families[x]] = 1;
        }
    for (int32_t family = 0; family < p->families; ++family) {
        if (p->moved[family] || !used[family])
            continue;
        p->moved[family] = 1;
        int64_t count = 0;
        for (int64_t x = 0; x < tape->family_count; ++x)
            if (tape->families[x] == family)
                members[count++] = (int32_t)x;
        if (count >= LAG_SHORTEST)
            add_moves(d, members, count);
    }
}

/* Isomorphic results, by the set of operations after which they are all there. */
typedef struct {
    int32_t *after;                    /* of groups: the set, or -1 */
    int32_t *own, *ends;               /* the results that there are, and the ends of the groups */
    int64_t count;
} isomorphic;

static isomorphic find_isomorphic(const lag_packing *p, draft *d, const lag_node *nodes, const int32_t *members,
                                  const int32_t *set_ends, int64_t sets)
{
    const lag_tape *const tape = p->tape;
    const int64_t groups = tape->isomorphic_count, all = groups ? tape->isomorphic_ends[groups - 1] : 0;
    isomorphic found = {lag_unset(&d->pool, groups), lag_integers(&d->pool, all), lag_integers(&d->pool, groups),
                        groups};
    int32_t *made = lag_unset(&d->pool, p->values);
    if (d->pool.failed)
        return found;
    for (int64_t set = 0, i = 0; set < sets; ++set)
        for (; i < set_ends[set]; ++i)
            for (int r = 0; r < results_of(nodes + members[i]); ++r)
                made[nodes[members[i]].value[r]] = (int32_t)set;
    int32_t end = 0;
    for (int64_t group = 0, i = 0; group < groups; ++group) {
        const int32_t begin = end;
        int32_t after = -1;
        for (; i < tape->isomorphic_ends[group]; ++i) {
            const int32_t x = tape->isomorphic[i];
            if (made[x] < 0)
                continue;
            found.own[end++] = x;
            after = made[x] > after ? made[x] : after;
        }
        found.ends[group] = end;
        if (end - begin >= LAG_SHORTEST)
            found.after[group] = after;
    }
    return found;
}

/* Add the vectors of a set of operations, and a unit of the others. */
static void add_set(lag_packing *p, draft *d, const lag_node *nodes, const int32_t *set, int64_t n, int32_t *points,
                    int32_t *order, int32_t *ends)
{
    const int op = nodes[set[0]].op;
    int64_t runs = 0, done = 0;
    if (n >= LAG_SHORTEST && is_on_vectors(op)) {
        const int operands = lag_tape_kinds.operands[op];
        for (int64_t i = 0; i < n; ++i)
            for (int k = 0; k < operands; ++k)
                points[i * operands + k] = d->place[nodes[set[i]].value[1 + k]];
        runs = lag_progressions(points, n, operands, order, ends);
        if (runs < 0) {
            d->pool.failed = 1;
            return;
        }
    } else {
        for (int64_t i = 0; i < n; ++i)
            order[i] = (int32_t)i;
    }
    for (int64_t run = 0; run < runs; ++run) {
        const int64_t count = ends[run] - done, parts = pieces(count);
        for (int64_t part = 0; part < parts; ++part) {
            unit *vector = add_unit(d, op, 1);
            for (int64_t i = count * part / parts; i < count * (part + 1) / parts; ++i)
                add_node(d, vector, nodes[set[order[done + i]]]);
        }
        done = ends[run];
        p->packed += count;
    }
    if (done < n) {
        unit *rest = add_unit(d, op, 0);
        for (int64_t i = done; i < n; ++i)
            add_node(d, rest, nodes[set[order[i]]]);
    }
}

/* Find operations in vectors and runs, in an order in which every operand is ready. */
static void find_units(lag_packing *p, draft *d, const lag_node *nodes, int64_t n)
{
    int32_t *members = lag_integers(&d->pool, n), *set_ends = lag_integers(&d->pool, n);
    int32_t *points = lag_integers(&d->pool, 3 * n), *order = lag_integers(&d->pool, n);
    int32_t *ends = lag_integers(&d->pool, n);
    if (d->pool.failed)
        return;
    add_inputs(p, d, nodes, n);
    if (d->pool.failed)
        return;
    place_units(d, 0);
    const int64_t sets = lag_levels(nodes, n, &lag_tape_kinds, p->values, members, set_ends);
    if (sets < 0) {
        d->pool.failed = 1;
        return;
    }
    const isomorphic groups = find_isomorphic(p, d, nodes, members, set_ends, sets);
    for (int64_t set = 0, begin = 0; set < sets && !d->pool.failed; begin = set_ends[set++]) {
        const int64_t first = d->unit_count;
        add_set(p, d, nodes, members + begin, set_ends[set] - begin, points, order, ends);
        for (int64_t group = 0; group < groups.count; ++group)
            if (groups.after[group] == set) {
                const int32_t from = group ? groups.ends[group - 1] : 0;
                add_moves(d, groups.own + from, groups.ends[group] - from);
            }
        place_units(d, first);
    }
}

/* Edges from units to those that wait for them. */
typedef struct {
    int32_t *first, *last;             /* of units, or -1 */
    int32_t *to, *next;
    int32_t count;
} edges;

static void add_edge(edges *e, int32_t *waiting, int32_t from, int32_t to)
{
    if (from == to || (e->first[from] >= 0 && e->to[e->last[from]] == to))
        return;
    e->to[e->count] = to;
    e->next[e->count] = -1;
    if (e->first[from] < 0)
        e->first[from] = e->count;
    else
        e->next[e->last[from]] = e->count;
    e->last[from] = e->count++;
    ++waiting[to];
}

/* The order of units in which results are used soon, while they are in the cache. */
static int32_t *depth_first(const lag_packing *p, draft *d)
{
    const int64_t n = d->unit_count, links = (int64_t)LAG_NODE_VALUES * d->node_count;
    int32_t *order = lag_integers(&d->pool, n), *stack = lag_integers(&d->pool, n);
    int32_t *waiting = lag_integers(&d->pool, n), *maker = lag_unset(&d->pool, p->values);
    /* the units that read a value since it was made or moved: a list */
    int32_t *readers = lag_unset(&d->pool, p->values), *reader = lag_integers(&d->pool, links);
    int32_t *next_reader = lag_integers(&d->pool, links);
    /* each reading is followed by at most one edge, and waits for one at most */
    edges e = {lag_unset(&d->pool, n), lag_integers(&d->pool, n), lag_integers(&d->pool, 2 * links),
               lag_integers(&d->pool, 2 * links), 0};
    if (d->pool.failed)
        return NULL;
    int32_t read = 0;
    for (int32_t i = 0; i < n; ++i) {
        const int64_t begin = d->units[i].first, end = begin + d->units[i].count;
        for (int64_t k = begin; k < end; ++k) {
            const lag_node *const node = d->nodes + k;
            const int results = results_of(node), places = places_of(node);
            for (int v = results; v < places; ++v) {
                const int32_t x = node->value[v];
                if (maker[x] >= 0)
                    add_edge(&e, waiting, maker[x], i);
                reader[read] = i;
                next_reader[read] = readers[x];
                readers[x] = read++;
            }
            for (int v = 0; v < results; ++v) { /* only units after a move wait for it */
                const int32_t x = node->value[v];
                for (int32_t at = readers[x]; at >= 0; at = next_reader[at])
                    add_edge(&e, waiting, reader[at], i);
                readers[x] = -1;
            }
        }
        for (int64_t k = begin; k < end; ++k)
            for (int v = 0; v < results_of(d->nodes + k); ++v)
                maker[d->nodes[k].value[v]] = i;
    }
    int64_t height = 0, done = 0;
    for (int64_t i = n - 1; i >= 0; --i)
        if (!waiting[i])
            stack[height++] = (int32_t)i;
    while (height) {
        const int32_t i = stack[--height];
        order[done++] = i;
        const int64_t bottom = height;
        for (int32_t at = e.first[i]; at >= 0; at = e.next[at])
            if (!--waiting[e.to[at]])
                stack[height++] = e.to[at];
        for (int64_t low = bottom, high = height - 1; low < high; ++low, --high) { /* the first one on top */
            const int32_t swapped = stack[low];
            stack[low] = stack[high];
            stack[high] = swapped;
        }
    }
    return order;
}

/* Write the operands of a vector: the first register and the step, or the registers. Returns how many numbers. */
static int64_t write_operands(const lag_packing *p, const draft *d, const unit *u, int v, int32_t *to)
{
    const lag_node *const nodes = d->nodes + u->first;
    const int32_t first = p->place[nodes[0].value[v]];
    const int32_t step = u->count > 1 ? p->place[nodes[1].value[v]] - first : 1;
    int equidistant = 1;
    for (int64_t i = 1; i < u->count && equidistant; ++i)
        equidistant = p->place[nodes[i].value[v]] - p->place[nodes[i - 1].value[v]] == step;
    to[0] = equidistant ? first : 0;
    to[1] = equidistant ? step : LAG_INDEXED;
    if (equidistant)
        return 2;
    for (int64_t i = 0; i < u->count; ++i)
        to[2 + i] = p->place[nodes[i].value[v]];
    return 2 + u->count;
}

/* Allocate the results of a unit; return the first register. */
static int32_t take(lag_packing *p, const draft *d, const unit *u)
{
    int32_t count = 0;
    for (int64_t i = 0; i < u->count; ++i)
        count += results_of(d->nodes + u->first + i);
    const int32_t first = lag_slots_take(&p->slots, count);
    count = 0;
    for (int64_t i = 0; i < u->count; ++i)
        for (int r = 0; r < results_of(d->nodes + u->first + i); ++r)
            p->place[d->nodes[u->first + i].value[r]] = first + count++;
    return first;
}

/* Write a unit, and allocate its results; returns how many numbers. `before` has room for a register of each node. */
static int64_t write_unit(lag_packing *p, const draft *d, const unit *u, int32_t *before, int32_t *to)
{
    const lag_node *const nodes = d->nodes + u->first;
    int64_t at = 2;
    if (!u->vector) {
        take(p, d, u);
        to[0] = u->op;
        to[1] = (int32_t)u->count;
        for (int64_t i = 0; i < u->count; ++i)
            for (int v = 0; v < places_of(nodes + i); ++v)
                to[at++] = p->place[nodes[i].value[v]];
        return at;
    }
    to[0] = LAG_VECTOR + u->op;
    to[1] = (int32_t)u->count;
    ++at;
    for (int v = 1; v < places_of(nodes); ++v)
        at += write_operands(p, d, u, v, to + at);
    for (int64_t i = 0; i < u->count; ++i)
        before[i] = p->place[nodes[i].value[0]];
    to[2] = take(p, d, u);
    if (u->op == OP_MOVE)
        for (int64_t i = 0; i < u->count; ++i)
            if (before[i] >= p->slots.begin) /* else it is an input's own */
                lag_slots_release(&p->slots, before[i]);
    return at;
}

/* Write units in an order, releasing the registers of results after their last use. */
static lag_stream write_units(lag_packing *p, draft *d, const int32_t *order, const lag_node *nodes, int64_t n,
                              const unsigned char *kept)
{
    unsigned char *own = lag_get(&d->pool, (size_t)p->values, 1);
    int32_t *last = lag_unset(&d->pool, p->values); /* of values: the place of their last unit in the order */
    int32_t *dying = lag_unset(&d->pool, d->unit_count), *next = lag_integers(&d->pool, p->values);
    int32_t *before = lag_integers(&d->pool, LAG_LONGEST);
    int32_t *numbers = lag_integers(&d->pool, (LAG_NODE_VALUES)*d->node_count + 12 * d->unit_count + 2);
    if (d->pool.failed)
        return (lag_stream){0};
    for (int64_t i = 0; i < n; ++i)
        for (int r = 0; r < results_of(nodes + i); ++r)
            own[nodes[i].value[r]] = 1;
    for (int32_t at = 0; at < d->unit_count; ++at) {
        const unit *const u = d->units + order[at];
        for (int64_t k = u->first; k < u->first + u->count; ++k)
            for (int v = 0; v < places_of(d->nodes + k); ++v)
                if (own[d->nodes[k].value[v]])
                    last[d->nodes[k].value[v]] = at;
    }
    for (int32_t x = 0; x < p->values; ++x)
        if (last[x] >= 0 && !kept[x]) {
            next[x] = dying[last[x]];
            dying[last[x]] = x;
        }
    int64_t length = 0;
    for (int64_t at = 0; at < d->unit_count; ++at) {
        length += write_unit(p, d, d->units + order[at], before, numbers + length);
        for (int32_t x = dying[at]; x >= 0; x = next[x])
            lag_slots_release(&p->slots, p->place[x]);
    }
    numbers[length++] = OP_END;
    numbers[length++] = 0;
    return (lag_stream){lag_copy_integers(p->pool, numbers, length), length};
}

lag_stream lag_pack(lag_packing *p, const lag_node *nodes, int64_t n, const unsigned char *kept)
{
    const lag_tape *const tape = p->tape;
    const int64_t moves = tape->family_count + (tape->isomorphic_count ? tape->isomorphic_ends[tape->isomorphic_count - 1] : 0);
    draft d = {.pool = lag_pool_of(&p->pool->from), .end = p->slots.end};
    d.nodes = lag_get(&d.pool, (size_t)(n + moves), sizeof *d.nodes);
    d.units = lag_get(&d.pool, (size_t)(n + moves), sizeof *d.units);
    d.place = lag_copy_integers(&d.pool, p->place, p->values);
    lag_stream made = {0};
    if (!d.pool.failed)
        find_units(p, &d, nodes, n);
    const int32_t *order = d.pool.failed ? NULL : depth_first(p, &d);
    if (order)
        made = write_units(p, &d, order, nodes, n, kept);
    p->pool->failed |= d.pool.failed;
    lag_release(&d.pool);
    return made;
}

/* A mixture of the bits of an operation and its operands. */
static uint64_t hash(const int32_t *key, int count)
{
    uint64_t mixed = 0x9E3779B97F4A7C15u;
    for (int i = 0; i < count; ++i) {
        mixed = (mixed ^ (uint32_t)key[i]) * 0xD6E8FEB86659FD93u;
        mixed ^= mixed >> 32;
    }
    return mixed;
}

int64_t lag_repeated(const lag_node *nodes, int64_t n, int64_t values)
{
    enum { SIZE = LAG_NODE_VALUES + 1 };
    lag_pool pool = lag_pool_of(NULL);
    int64_t room = 16;
    while (room < 2 * n)
        room *= 2;
    int32_t *function = lag_unset(&pool, values); /* of results: the number of the function of inputs, and the place */
    int32_t *table = lag_unset(&pool, room), *count = lag_integers(&pool, n);
    int32_t(*keys)[SIZE] = lag_get(&pool, (size_t)n, sizeof *keys);
    int64_t repeated = -1;
    int32_t functions = 0;
    if (pool.failed)
        goto end;
    for (int64_t i = 0; i < n; ++i) {
        const int results = results_of(nodes + i), places = places_of(nodes + i);
        int32_t key[SIZE] = {nodes[i].op};
        for (int k = results; k < places; ++k)
            key[1 + k - results] = function[nodes[i].value[k]];
        const int size = 1 + places - results;
        uint64_t at = hash(key, size) & (uint64_t)(room - 1);
        while (table[at] >= 0 && memcmp(keys[table[at]], key, (size_t)size * sizeof *key))
            at = (at + 1) & (uint64_t)(room - 1);
        if (table[at] < 0) {
            memcpy(keys[functions], key, sizeof key);
            table[at] = functions++;
        }
        ++count[table[at]];
        for (int r = 0; r < results; ++r)
            function[nodes[i].value[r]] = 2 * table[at] + r;
    }
    repeated = 0;
    for (int32_t i = 0; i < functions; ++i)
        if (count[i] >= LAG_SHORTEST)
            repeated += count[i];
end:
    lag_release(&pool);
    return repeated;
}
