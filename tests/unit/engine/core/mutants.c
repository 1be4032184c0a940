/*
 * Read models whose data have been damaged, and run those that are accepted for some steps: whatever they are, the
 * core must stay within its memory. Arguments: the file of a model, a method, the number of mutants, and a seed. Prints
 * how many were rejected by each status.
 */
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

/* Simulate a model for some steps. Returns a lag_model_status. */
static int run(lag_model *model, const char *method)
{
    static const double times[] = {0.1, 0.2};
    lag_problem *p = &model->problem;
    const int width = 2 + 3 * model->equations.nq + model->equations.nc + p->extra;
    double *block = malloc(2 * (size_t)width * sizeof *block);
    lag_simulation *made;
    p->settings.t_end = p->t + 1.0;
    p->times = times;
    p->times_count = 2;
    p->block = block;
    p->block_rows = 2;
    const int status = lag_make_simulation(NULL, model, method, &made);
    if (status == LAG_MODEL_READ) {
        lag_simulate(made, 3);
        void *saved = malloc(lag_simulation_size(made));
        lag_save_simulation(made, saved);
        for (int i = 0; i < 4; ++i) {
            lag_simulate(made, 5);
            lag_take(lag_run_of(made));
        }
        if (lag_restore_simulation(made, saved) == 0)
            lag_simulate(made, 5);
        free(saved);
        lag_destroy_simulation(made);
    }
    free(block);
    return status;
}

int main(int argc, char **argv)
{
    FILE *file = argc == 5 ? fopen(argv[1], "rb") : NULL;
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
    if (lag_read_model(NULL, data, (int64_t)bytes, &model) != LAG_MODEL_READ || run(&model, argv[2]) != LAG_MODEL_READ)
        return 3;
    lag_release_model(&model);
    state ^= (uint64_t)strtol(argv[4], NULL, 10) << 32;
    for (long k = strtol(argv[3], NULL, 10); k > 0; --k) {
        memcpy(data, given, bytes);
        damage(data, bytes);
        /* sometimes a part alone, in memory of its own, so that what is beyond is noticed */
        const size_t part = chosen(8) ? bytes : 8 * (size_t)chosen(bytes / 8);
        char *alone = malloc(part ? part : 1);
        memcpy(alone, data, part);
        int status = lag_read_model(NULL, alone, (int64_t)part, &model);
        if (status == LAG_MODEL_READ)
            status = run(&model, argv[2]);
        lag_release_model(&model);
        ++results[status];
        free(alone);
    }
    for (int i = 0; i <= LAG_MODEL_MEMORY; ++i)
        printf("%ld\n", results[i]);
    free(given);
    free(data);
    return 0;
}
