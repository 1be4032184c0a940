/*
 * Read models whose data have been damaged, and run those that are accepted for some steps: whatever they are, the
 * core must stay within its memory. Arguments: the file of a model, and the number of mutants. Prints how many were
 * rejected by each status.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lagmodel.h"

static uint64_t state = 88172645463325252u;

static uint64_t chosen(uint64_t below)
{
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return state % below;
}

/* Damage some bytes: bits, small integers, large ones, copies of other places. */
static void damage(char *data, size_t bytes)
{
    for (uint64_t k = 1 + chosen(3); k > 0; --k) {
        const size_t at = 4 * (size_t)chosen(bytes / 4);
        int32_t value;
        memcpy(&value, data + at, sizeof value);
        switch (chosen(5)) {
        case 0: value ^= (int32_t)1 << chosen(31); break;
        case 1: value = (int32_t)((uint32_t)value + (uint32_t)chosen(5) - 2u); break;
        case 2: value = (int32_t)chosen(64); break;
        case 3: value = (int32_t)(chosen(2) ? INT32_MAX : INT32_MIN); break;
        default: memcpy(&value, data + 4 * chosen(bytes / 4), sizeof value);
        }
        memcpy(data + at, &value, sizeof value);
    }
}

/* Run a model for some steps. Returns a lag_model_status. */
static int run(lag_model *model)
{
    static const double times[] = {0.1, 0.2};
    const int nq = model->equations.nq, n = 2 * nq + 1, width = 1 + 3 * nq + model->equations.nc + 1;
    double *atol = malloc((size_t)n * sizeof *atol), *block = malloc(2 * (size_t)width * sizeof *block);
    lag_settings *s = &model->settings;
    lag_run *made;
    for (int i = 0; i < n; ++i)
        atol[i] = 0.0;
    s->t_end = s->t_start + 1.0;
    s->h_max = INFINITY;
    s->rtol = 1e-6;
    s->atol = atol;
    s->projecting = 1;
    s->watching = LAG_PASS;
    s->alpha = s->beta = -1.0;
    s->detecting = 1;
    s->refinable = 1;
    s->times = times;
    s->times_count = 2;
    s->block = block;
    s->block_rows = 2;
    int status = lag_run_model(NULL, model, &made);
    if (status == LAG_MODEL_READ) {
        const size_t bytes = lag_state_size(made);
        void *saved = malloc(bytes);
        lag_start(made);
        lag_save(made, saved);
        lag_advance(made, 20);
        lag_take(made);
        if (lag_restore(made, saved) == 0)
            lag_advance(made, 5);
        free(saved);
        lag_destroy(made);
    }
    free(atol);
    free(block);
    return status;
}

int main(int argc, char **argv)
{
    FILE *file = argc == 3 ? fopen(argv[1], "rb") : NULL;
    if (!file)
        return 2;
    fseek(file, 0, SEEK_END);
    const size_t bytes = (size_t)ftell(file);
    rewind(file);
    char *given = malloc(bytes), *data = malloc(bytes);
    if (fread(given, 1, bytes, file) != bytes)
        return 2;
    fclose(file);
    long results[LAG_MODEL_MEMORY + 1] = {0};
    lag_model model;
    memcpy(data, given, bytes);
    if (lag_read_model(data, (int64_t)bytes, &model) != LAG_MODEL_READ || run(&model) != LAG_MODEL_READ)
        return 3;
    for (long k = strtol(argv[2], NULL, 10); k > 0; --k) {
        memcpy(data, given, bytes);
        damage(data, bytes);
        /* sometimes a part alone, in memory of its own, so that what is beyond is noticed */
        const size_t part = chosen(8) ? bytes : 8 * (size_t)chosen(bytes / 8);
        char *alone = malloc(part ? part : 1);
        memcpy(alone, data, part);
        int status = lag_read_model(alone, (int64_t)part, &model);
        if (status == LAG_MODEL_READ)
            status = run(&model);
        ++results[status];
        free(alone);
    }
    for (int i = 0; i <= LAG_MODEL_MEMORY; ++i)
        printf("%ld\n", results[i]);
    free(given);
    free(data);
    return 0;
}
