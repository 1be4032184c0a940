#include "program/nodes.h"

static const int tape_operands[] = LAG_ARITY, series_operands[] = LAG_SERIES_OPERANDS;
const lag_kinds lag_tape_kinds = {tape_operands, OP_SINCOS, OP_END};
const lag_kinds lag_series_kinds = {series_operands, -1, SERIES_END};

int32_t *lag_unset(lag_pool *pool, int64_t count)
{
    int32_t *made = lag_integers(pool, count);
    if (made)
        for (int64_t i = 0; i < count; ++i)
            made[i] = -1;
    return made;
}

/* Whether a value is also an earlier operand of its operation. */
static int again(const lag_node *node, int first, int k)
{
    for (int i = first; i < k; ++i)
        if (node->value[i] == node->value[k])
            return 1;
    return 0;
}

int lag_allocate(lag_node *nodes, int64_t n, const lag_kinds *kinds, int64_t values, int32_t *place, int32_t *count,
                 const unsigned char *kept)
{
    lag_pool pool = lag_pool_of(NULL);
    int64_t *last = lag_get(&pool, (size_t)values, sizeof *last); /* operation that uses it, from 1 on */
    unsigned char *own = lag_get(&pool, (size_t)values, 1);
    int32_t *free = lag_integers(&pool, values);
    int64_t free_count = 0;
    if (pool.failed) {
        lag_release(&pool);
        return 0;
    }
    for (int64_t i = 0; i < n; ++i) {
        const int results = lag_results(kinds, nodes[i].op), places = lag_places(kinds, nodes[i].op);
        for (int k = 0; k < places; ++k) {
            if (k < results)
                own[nodes[i].value[k]] = 1;
            else
                last[nodes[i].value[k]] = i + 1;
        }
    }
    for (int64_t i = 0; i < n; ++i) {
        lag_node *const node = nodes + i;
        const int results = lag_results(kinds, node->op), places = lag_places(kinds, node->op);
        for (int k = results; k < places; ++k) {
            const int32_t x = node->value[k];
            if (last[x] == i + 1 && own[x] && !kept[x] && !again(node, results, k))
                free[free_count++] = place[x];
        }
        for (int k = 0; k < results; ++k) {
            const int32_t x = node->value[k];
            if (place[x] < 0)
                place[x] = free_count ? free[--free_count] : (*count)++;
        }
        for (int k = 0; k < results; ++k) {
            const int32_t x = node->value[k];
            if (!last[x] && !kept[x])
                free[free_count++] = place[x];
        }
        for (int k = 0; k < places; ++k)
            node->value[k] = place[node->value[k]];
    }
    lag_release(&pool);
    return 1;
}

int64_t lag_write_stream(const lag_node *nodes, int64_t n, const lag_kinds *kinds, int32_t *stream)
{
    int64_t at = 0, head = 0;
    for (int64_t i = 0; i < n; ++i) {
        if (!i || nodes[i].op != nodes[i - 1].op) {
            stream[at++] = nodes[i].op;
            head = at;
            stream[at++] = 0;
        }
        ++stream[head];
        for (int k = 0; k < lag_places(kinds, nodes[i].op); ++k)
            stream[at++] = nodes[i].value[k];
    }
    stream[at++] = kinds->end;
    stream[at++] = 0;
    return at;
}
