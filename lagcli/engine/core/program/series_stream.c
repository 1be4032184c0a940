#include "program/nodes.h"

#include <string.h>

int64_t lag_series_stream(const lag_nodes *nodes, int64_t ordered, int32_t *place, const unsigned char *kept,
                          int32_t *count, int32_t *stream)
{
    lag_pool pool = lag_pool_of(NULL);
    lag_node *own = lag_copy(&pool, nodes->numbers, (size_t)nodes->count, sizeof *own);
    int64_t length = -1;
    if (own && lag_in_runs(own, ordered, &lag_series_kinds, nodes->values) &&
        lag_allocate(own, nodes->count, &lag_series_kinds, nodes->values, place, count, kept))
        length = lag_write_stream(own, nodes->count, &lag_series_kinds, stream);
    lag_release(&pool);
    return length;
}

int64_t lag_series_levels(const lag_nodes *nodes, int32_t *members, int32_t *ends)
{
    lag_pool pool = lag_pool_of(NULL);
    lag_node *own = lag_copy(&pool, nodes->numbers, (size_t)nodes->count, sizeof *own);
    const int64_t sets =
        own ? lag_levels(own, nodes->count, &lag_series_kinds, nodes->values, members, ends) : -1;
    lag_release(&pool);
    return sets;
}
