#include "program/nodes.h"

#include <string.h>

#define MOST 60           /* progressions that are sought in one set */
#define REACH 4           /* largest distance, in the order of operands, of the first two elements */
#define CANDIDATES 4      /* most common differences, of which the best is used */
#define SAVED 0.1         /* gain per element of a vector with all operands in progression, in the cost of a vector */
#define SAVED_INDEXED 0.06 /* with one operand that is listed */
#define COLUMNS 4

/* Odd numbers without a pattern: the sum of their products with a point's coordinates identifies it, and
 * differences of sums identify steps. */
static const uint64_t mixed[COLUMNS] = {0x9E3779B97F4A7C15u, 0xC2B2AE3D27D4EB4Fu, 0x165667B19E3779F9u,
                                        0xD6E8FEB86659FD93u};

typedef struct {
    int k;
    const int32_t *points;             /* rows of k */
    int indexed;                       /* the column that is arbitrary, or -1 */
    int32_t *left, *again;             /* rows; those equal to others */
    int32_t *sorted;                   /* the rows whose other columns differ; below, they are numbered in this order */
    uint64_t *keys;                    /* of rows */
    uint64_t *gaps;                    /* differences of the keys of rows that are not far apart */
    int32_t *by_gap, *by_key;          /* their orders */
    int32_t *following;                /* of rows: the row that follows by a step, or -1 */
    unsigned char *inner;              /* of rows: whether one precedes */
    int32_t *run, *run_ends;           /* the runs with a step */
    int32_t *best, *best_ends;         /* those with the best one */
    unsigned char *used;
    int32_t *scratch;
} search;

/* Compare rows by their columns but the indexed one. */
static int by_row(const search *s, int32_t a, int32_t b)
{
    const int32_t *p = s->points + (int64_t)a * s->k, *q = s->points + (int64_t)b * s->k;
    for (int c = 0; c < s->k; ++c)
        if (c != s->indexed && p[c] != q[c])
            return p[c] < q[c] ? -1 : 1;
    return 0;
}

static int by_key(const search *s, int32_t a, int32_t b)
{
    return (s->keys[a] > s->keys[b]) - (s->keys[a] < s->keys[b]);
}

static int by_gap(const search *s, int32_t a, int32_t b)
{
    return (s->gaps[a] > s->gaps[b]) - (s->gaps[a] < s->gaps[b]);
}

/* The order of two rows or places: negative, 0 or positive. */
typedef int (*comparison)(const search *s, int32_t a, int32_t b);

/* Sort stably. */
static void sort(const search *s, int32_t *items, int64_t n, comparison order)
{
    for (int64_t width = 1; width < n; width *= 2) {
        for (int64_t low = 0; low < n; low += 2 * width) {
            const int64_t middle = low + width < n ? low + width : n;
            const int64_t high = low + 2 * width < n ? low + 2 * width : n;
            int64_t i = low, j = middle;
            for (int64_t to = low; to < high; ++to)
                s->scratch[to] = i < middle && (j == high || order(s, items[i], items[j]) <= 0) ? items[i++]
                                                                                                : items[j++];
        }
        memcpy(items, s->scratch, (size_t)n * sizeof *items);
    }
}

/* Sort rows, and remove those equal to another, which are returned in `again` if it is given. */
static int64_t sort_unique(const search *s, int32_t *rows, int64_t n, int32_t *again, int64_t *more)
{
    sort(s, rows, n, by_row);
    int64_t kept = 0, removed = 0;
    for (int64_t i = 0; i < n; ++i) {
        if (!kept || by_row(s, rows[i], rows[kept - 1]))
            rows[kept++] = rows[i];
        else if (again)
            again[removed++] = rows[i];
    }
    if (more)
        *more = removed;
    return kept;
}

/* The most common differences of rows that are not far apart. Returns their number. */
static int common_steps(const search *s, int64_t n, uint64_t *steps)
{
    int64_t gaps = 0, most[CANDIDATES];
    int count = 0;
    for (int64_t reach = 1; reach <= REACH; ++reach)
        for (int64_t i = reach; i < n; ++i) {
            s->by_gap[gaps] = (int32_t)gaps;
            s->gaps[gaps++] = s->keys[i] - s->keys[i - reach];
        }
    sort(s, s->by_gap, gaps, by_gap);
    for (int64_t first = 0, end; first < gaps; first = end) {
        const uint64_t step = s->gaps[s->by_gap[first]];
        for (end = first + 1; end < gaps && s->gaps[s->by_gap[end]] == step;)
            ++end;
        const int64_t times = end - first;
        int at = count;
        while (at && most[at - 1] < times)
            --at;
        if (times < LAG_SHORTEST - 1 || at == CANDIDATES)
            continue;
        count += count < CANDIDATES;
        for (int i = count - 1; i > at; --i) {
            most[i] = most[i - 1];
            steps[i] = steps[i - 1];
        }
        most[at] = times;
        steps[at] = step;
    }
    return count;
}

/* The longest progressions with a step, in `run`; returns their number, and how many rows they have in `covered`. */
static int64_t runs_with(const search *s, int64_t n, uint64_t step, int64_t *covered)
{
    memset(s->inner, 0, (size_t)n);
    int wrapped = 0; /* sums with the step are beyond the largest number */
    for (int64_t i = 0, at = 0; i < n; ++i) {
        const int32_t row = s->by_key[i];
        const uint64_t wanted = s->keys[row] + step;
        if (!wrapped && wanted < step) {
            wrapped = 1;
            at = 0;
        }
        while (at < n && s->keys[s->by_key[at]] < wanted)
            ++at;
        const int there = at < n && s->keys[s->by_key[at]] == wanted;
        s->following[row] = there ? s->by_key[at] : -1;
        if (there)
            s->inner[s->by_key[at]] = 1;
    }
    int64_t runs = 0, end = 0;
    for (int32_t first = 0; first < n; ++first) {
        if (s->inner[first] || s->following[first] < 0)
            continue;
        const int64_t begin = end;
        for (int32_t row = first; row >= 0 && end < n; row = s->following[row])
            s->run[end++] = row;
        if (end - begin < LAG_SHORTEST)
            end = begin;
        else
            s->run_ends[runs++] = (int32_t)end;
    }
    *covered = end;
    return runs;
}

/* The progressions with the most profitable step, in `best`; returns their number. */
static int64_t best_progressions(search *s, int64_t n)
{
    double most = 0.0;
    int64_t found = 0;
    for (s->indexed = -1; s->indexed < (s->k > 1 ? s->k : 0); ++s->indexed) {
        memcpy(s->sorted, s->left, (size_t)n * sizeof *s->sorted);
        const int64_t unique = sort_unique(s, s->sorted, n, NULL, NULL);
        for (int64_t i = 0; i < unique; ++i) {
            const int32_t *p = s->points + (int64_t)s->sorted[i] * s->k;
            s->keys[i] = 0;
            for (int c = 0, column = 0; c < s->k; ++c)
                if (c != s->indexed)
                    s->keys[i] += mixed[column++] * (uint64_t)(int64_t)p[c];
        }
        uint64_t steps[CANDIDATES];
        const int candidates = common_steps(s, unique, steps);
        for (int64_t i = 0; i < unique; ++i)
            s->by_key[i] = (int32_t)i;
        if (candidates)
            sort(s, s->by_key, unique, by_key);
        for (int i = 0; i < candidates; ++i) {
            int64_t covered;
            const int64_t runs = runs_with(s, unique, steps[i], &covered);
            const double saved = (s->indexed < 0 ? SAVED : SAVED_INDEXED) * (double)covered - (double)runs;
            if (saved <= most)
                continue;
            most = saved;
            found = runs;
            for (int64_t j = 0; j < covered; ++j)
                s->best[j] = s->sorted[s->run[j]];
            memcpy(s->best_ends, s->run_ends, (size_t)runs * sizeof *s->best_ends);
            if (s->indexed < 0 && 8 * covered > 7 * n)
                return found;
        }
    }
    return found;
}

/* Progressions among `left`, of n rows that are sorted. Returns how many rows are left. */
static int64_t take_runs(search *s, int64_t n, int32_t *members, int32_t *ends, int64_t *runs, int64_t *end)
{
    for (int64_t taken = 0; n >= LAG_SHORTEST && taken < MOST;) {
        const int64_t found = best_progressions(s, n);
        if (!found)
            break;
        const int64_t covered = s->best_ends[found - 1];
        for (int64_t i = 0; i < covered; ++i) {
            members[*end + i] = s->best[i];
            s->used[s->best[i]] = 1;
        }
        for (int64_t i = 0; i < found; ++i)
            ends[(*runs)++] = (int32_t)(*end + s->best_ends[i]);
        *end += covered;
        taken += found;
        int64_t kept = 0;
        for (int64_t i = 0; i < n; ++i)
            if (!s->used[s->left[i]])
                s->left[kept++] = s->left[i];
        n = kept;
    }
    return n;
}

int64_t lag_progressions(const int32_t *points, int64_t n, int k, int32_t *members, int32_t *ends)
{
    lag_pool pool = lag_pool_of(NULL);
    search s = {.k = k, .points = points};
    int32_t *rest = lag_integers(&pool, n);
    int32_t **const arrays[] = {&s.left, &s.again, &s.sorted, &s.by_key, &s.following, &s.run, &s.run_ends, &s.best,
                                &s.best_ends};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; ++i)
        *arrays[i] = lag_integers(&pool, n);
    s.keys = lag_get(&pool, (size_t)n, sizeof *s.keys);
    s.gaps = lag_get(&pool, (size_t)(REACH * n), sizeof *s.gaps);
    s.by_gap = lag_integers(&pool, REACH * n);
    s.scratch = lag_integers(&pool, REACH * n);
    s.inner = lag_get(&pool, (size_t)n, 1);
    s.used = lag_get(&pool, (size_t)n, 1);
    int64_t runs = -1, end = 0, rest_count = 0, left = n, again;
    if (pool.failed)
        goto end;
    runs = 0;
    for (int64_t i = 0; i < n; ++i)
        s.left[i] = (int32_t)i;
    for (int more = 1; more; left = again) {
        const int64_t before = runs;
        s.indexed = -1;
        left = sort_unique(&s, s.left, left, s.again, &again);
        left = take_runs(&s, left, members, ends, &runs, &end);
        memcpy(rest + rest_count, s.left, (size_t)left * sizeof *rest);
        rest_count += left;
        more = again >= LAG_SHORTEST && runs > before;
        memcpy(more ? s.left : rest + rest_count, s.again, (size_t)again * sizeof *rest);
        rest_count += more ? 0 : again;
    }
    memcpy(members + end, rest, (size_t)rest_count * sizeof *rest);
end:
    lag_release(&pool);
    return runs;
}
