/*
 * Simulate a model that is data, by the public header alone. Arguments: the file of the model; the method; the number
 * of rows of the block, 0 for that of the model; and, to try them, a number of steps at which to save the simulation, go on, restore it, and go
 * on again, or 0. Prints the last status and the event that ended it; the number of samples, and of numbers of each; the
 * samples, and then the log, in hexadecimal.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lagmodel.h"

static long allocations; /* that are not released */

static void *allocate(void *context, size_t bytes)
{
    (void)context;
    ++allocations;
    return malloc(bytes);
}

static void release(void *context, void *memory)
{
    (void)context;
    --allocations;
    free(memory);
}

static char *contents(const char *name, size_t *bytes)
{
    FILE *file = fopen(name, "rb");
    if (!file)
        exit(2);
    fseek(file, 0, SEEK_END);
    *bytes = (size_t)ftell(file);
    rewind(file);
    char *data = malloc(*bytes);
    if (!data || fread(data, 1, *bytes, file) != *bytes)
        exit(2);
    fclose(file);
    return data;
}

static double *samples;
static long long rows, width, space;

/* Take the samples that are there. */
static void take(lag_simulation *simulation, const double *block)
{
    const long long count = lag_take(lag_run_of(simulation));
    if (rows + count > space) {
        space = 2 * (rows + count);
        samples = realloc(samples, (size_t)(space * width) * sizeof *samples);
    }
    memcpy(samples + rows * width, block, (size_t)(count * width) * sizeof *samples);
    rows += count;
}

static int64_t steps_of(lag_simulation *simulation)
{
    lag_report report;
    lag_report_of(lag_run_of(simulation), &report);
    return report.steps;
}

/* Go on to the end, or by a number of steps. */
static int go_on(lag_simulation *simulation, const double *block, int64_t steps)
{
    int status = LAG_RUNNING;
    while (status == LAG_RUNNING || status == LAG_BLOCK_FULL) {
        const int64_t before = steps_of(simulation);
        status = lag_simulate(simulation, steps < 0 ? 7 : steps);
        take(simulation, block);
        if (steps >= 0) {
            steps -= steps_of(simulation) - before;
            if (steps <= 0 && status == LAG_RUNNING)
                break;
        }
    }
    return status;
}

static void print(const double *numbers, long long count, long long each)
{
    printf("%lld %lld\n", count, each);
    for (long long i = 0; i < count * each; ++i)
        printf("%a%c", numbers[i], (i + 1) % each ? ' ' : '\n');
}

int main(int argc, char **argv)
{
    const lag_memory memory = {allocate, release, NULL};
    size_t bytes;
    lag_model model;
    lag_simulation *simulation;
    if (argc != 5)
        return 2;
    char *data = contents(argv[1], &bytes);
    int status = lag_read_model(&memory, data, (int64_t)bytes, &model);
    if (status != LAG_MODEL_READ)
        return 10 + status;
    const lag_equations *e = &model.equations;
    width = 1 + 3 * e->nq + e->nc + 1 + model.problem.extra;
    if (atoi(argv[3]))
        model.problem.block_rows = atoi(argv[3]);
    model.problem.block = malloc((size_t)(model.problem.block_rows * width) * sizeof(double));
    status = lag_make_simulation(&memory, &model, argv[2], &simulation);
    if (status != LAG_MODEL_READ)
        return 20 + status;

    const int steps = atoi(argv[4]);
    if (steps > 0) {
        go_on(simulation, model.problem.block, steps);
        const long long before = rows;
        void *saved = malloc(lag_simulation_size(simulation));
        lag_save_simulation(simulation, saved);
        go_on(simulation, model.problem.block, 50);
        if (lag_restore_simulation(simulation, saved))
            return 3;
        free(saved);
        rows = before;
    }
    status = go_on(simulation, model.problem.block, -1);

    int64_t count;
    int each;
    printf("%d %d\n", status, lag_stopped_by(simulation));
    print(samples, rows, width);
    const double *log = lag_log_of(simulation, &count, &each);
    print(log, count, each);
    lag_destroy_simulation(simulation);
    lag_release_model(&model);
    free(model.problem.block);
    free(samples);
    free(data);
    return allocations ? 4 : 0;
}
