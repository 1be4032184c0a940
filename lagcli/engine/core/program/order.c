#include "program/nodes.h"

#define WINDOW 4096 /* operations that are ordered at a time: values that are alive together stay close */
#define KINDS 64    /* more than there are operations */

typedef struct {
    int32_t first, last, length;
} queue;

/* What is needed to order a window. */
typedef struct {
    int32_t *producer;                 /* of values: the operation in the window, or -1 */
    int32_t *first, *last;             /* of each operation's users, in `user` and `next_user` */
    int32_t *user, *next_user;
    int32_t *waiting;                  /* operands that are not ready */
    int32_t *next;                     /* in a queue */
    queue ready[KINDS];
    int order[KINDS], kinds;           /* the kinds of operations that are ready, in the order of their first one */
    lag_node *sorted;
} window;

static void append(window *w, queue *q, int32_t i)
{
    w->next[i] = -1;
    if (q->length++)
        w->next[q->last] = i;
    else
        q->first = i;
    q->last = i;
}

static void make_ready(window *w, int op, int32_t i)
{
    if (!w->ready[op].length)
        w->order[w->kinds++] = op;
    append(w, &w->ready[op], i);
}

/* Remove the kind of which most operations are ready, the first of them. */
static int most_ready(window *w)
{
    int best = 0;
    for (int i = 1; i < w->kinds; ++i)
        if (w->ready[w->order[i]].length > w->ready[w->order[best]].length)
            best = i;
    const int op = w->order[best];
    --w->kinds;
    for (int i = best; i < w->kinds; ++i)
        w->order[i] = w->order[i + 1];
    return op;
}

static void find_users(window *w, const lag_node *nodes, int32_t n, const lag_kinds *kinds)
{
    for (int32_t i = 0; i < n; ++i) {
        w->first[i] = -1;
        w->waiting[i] = 0;
        for (int r = 0; r < lag_results(kinds, nodes[i].op); ++r)
            w->producer[nodes[i].value[r]] = i;
    }
    int32_t edges = 0;
    for (int32_t i = 0; i < n; ++i) {
        const int results = lag_results(kinds, nodes[i].op), places = lag_places(kinds, nodes[i].op);
        for (int k = results; k < places; ++k) {
            const int32_t from = w->producer[nodes[i].value[k]];
            if (from < 0 || (w->first[from] >= 0 && w->user[w->last[from]] == i))
                continue;
            w->user[edges] = i;
            w->next_user[edges] = -1;
            if (w->first[from] < 0)
                w->first[from] = edges;
            else
                w->next_user[w->last[from]] = edges;
            w->last[from] = edges++;
            ++w->waiting[i];
        }
    }
}

/* Order operations so that those of a kind are adjacent where possible. */
static void order_window(window *w, lag_node *nodes, int32_t n, const lag_kinds *kinds)
{
    find_users(w, nodes, n, kinds);
    w->kinds = 0;
    for (int32_t i = 0; i < n; ++i)
        if (!w->waiting[i])
            make_ready(w, nodes[i].op, i);
    int32_t done = 0;
    while (w->kinds) {
        const int op = most_ready(w);
        queue now = w->ready[op];
        w->ready[op].length = 0;
        for (int32_t i = now.first; i >= 0; i = w->next[i]) {
            w->sorted[done++] = nodes[i];
            for (int32_t edge = w->first[i]; edge >= 0; edge = w->next_user[edge]) {
                const int32_t user = w->user[edge];
                if (--w->waiting[user])
                    continue;
                if (nodes[user].op == op)
                    append(w, &now, user);
                else
                    make_ready(w, nodes[user].op, user);
            }
        }
    }
    for (int32_t i = 0; i < n; ++i) {
        nodes[i] = w->sorted[i];
        for (int r = 0; r < lag_results(kinds, nodes[i].op); ++r)
            w->producer[nodes[i].value[r]] = -1;
    }
}

int lag_in_runs(lag_node *nodes, int64_t n, const lag_kinds *kinds, int64_t values)
{
    lag_pool pool = lag_pool_of(NULL);
    const int64_t size = n < WINDOW ? n : WINDOW;
    window w = {.producer = lag_unset(&pool, values)};
    int32_t **const arrays[] = {&w.first, &w.last, &w.waiting, &w.next};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; ++i)
        *arrays[i] = lag_integers(&pool, size);
    w.user = lag_integers(&pool, size * LAG_NODE_VALUES);
    w.next_user = lag_integers(&pool, size * LAG_NODE_VALUES);
    w.sorted = lag_get(&pool, (size_t)size, sizeof *w.sorted);
    for (int64_t first = 0; first < n && !pool.failed; first += WINDOW)
        order_window(&w, nodes + first, (int32_t)(n - first < WINDOW ? n - first : WINDOW), kinds);
    lag_release(&pool);
    return !pool.failed;
}

/* Sort stably by keys below `bound`; `count` has room for them and one more. */
static void sort_by(const int32_t *key, int32_t *members, int32_t *sorted, int64_t n, int32_t *count, int32_t bound)
{
    for (int32_t k = 0; k <= bound; ++k)
        count[k] = 0;
    for (int64_t i = 0; i < n; ++i)
        ++count[key[members[i]] + 1];
    for (int32_t k = 0; k < bound; ++k)
        count[k + 1] += count[k];
    for (int64_t i = 0; i < n; ++i)
        sorted[count[key[members[i]]]++] = members[i];
}

int64_t lag_levels(const lag_node *nodes, int64_t n, const lag_kinds *kinds, int64_t values, int32_t *members,
                   int32_t *ends)
{
    lag_pool pool = lag_pool_of(NULL);
    int32_t *producer = lag_unset(&pool, values), *depth = lag_integers(&pool, n), *height = lag_integers(&pool, n);
    int32_t *op = lag_integers(&pool, n), *by_op = lag_integers(&pool, n);
    int32_t *count = lag_integers(&pool, n + KINDS + 3);
    int64_t sets = -1;
    if (pool.failed)
        goto end;
    for (int64_t i = 0; i < n; ++i) {
        op[i] = nodes[i].op;
        depth[i] = height[i] = 1;
        by_op[i] = (int32_t)i;
        for (int r = 0; r < lag_results(kinds, op[i]); ++r)
            producer[nodes[i].value[r]] = (int32_t)i;
    }
    for (int64_t i = 0; i < n; ++i)
        for (int k = lag_results(kinds, op[i]); k < lag_places(kinds, op[i]); ++k) {
            const int32_t x = nodes[i].value[k], from = x < 0 ? -1 : producer[x];
            if (from >= 0 && depth[from] >= depth[i])
                depth[i] = 1 + depth[from];
        }
    int32_t highest = 0;
    for (int64_t i = n - 1; i >= 0; --i) {
        for (int k = lag_results(kinds, op[i]); k < lag_places(kinds, op[i]); ++k) {
            const int32_t x = nodes[i].value[k], from = x < 0 ? -1 : producer[x];
            if (from >= 0 && height[from] <= height[i])
                height[from] = 1 + height[i];
        }
    }
    for (int64_t i = 0; i < n; ++i)
        highest = height[i] > highest ? height[i] : highest;
    int32_t *level = depth;
    for (int64_t i = 0; i < n; ++i)
        level[i] = depth[i] <= height[i] ? depth[i] : highest + 1 - height[i];
    sort_by(op, by_op, members, n, count, KINDS);
    for (int64_t i = 0; i < n; ++i)
        by_op[i] = members[i];
    sort_by(level, by_op, members, n, count, highest + 1);
    sets = 0;
    for (int64_t i = 0; i < n; ++i) {
        const int32_t a = members[i], b = i + 1 < n ? members[i + 1] : a;
        if (i + 1 == n || op[a] != op[b] || level[a] != level[b])
            ends[sets++] = (int32_t)i + 1;
    }
end:
    lag_release(&pool);
    return sets;
}
