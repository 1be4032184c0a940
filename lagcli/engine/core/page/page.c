#include "page/page.h"

#include <stdlib.h>
#include <string.h>

#include "evaluate.h"
#include "fmi/instance.h"
#include "model/simulation.h"
#include "run.h"


struct lag_page {
    lag_fmu *fmu;
    double own_t_end, own_rtol;        /* those of the model */
    int64_t width;                     /* of a sample */
    double *times, *rows;              /* of the run */
    int64_t room, used;                /* samples */
};

static char message[LAG_MESSAGE];

/* Keep a message. */
static void keep(void *context, const char *text)
{
    (void)context;
    strncpy(message, text, sizeof message - 1);
}

static int32_t no_memory(void)
{
    keep(NULL, "there is no memory");
    return 1;
}

void *lag_page_allocate(int32_t bytes)
{
    return bytes < 0 ? NULL : malloc((size_t)bytes);
}

void lag_page_release(void *memory)
{
    free(memory);
}

const char *lag_page_message(void)
{
    return message;
}

lag_page *lag_page_open(const void *model, int32_t model_bytes, const void *values, int32_t values_bytes)
{
    lag_page *page = calloc(1, sizeof *page);
    if (!page || !(page->fmu = lag_fmu_make(model, model_bytes, values, values_bytes, 0, keep, NULL))) {
        if (!page)
            no_memory();
        free(page);
        return NULL;
    }
    const lag_fmu *fmu = page->fmu;
    page->own_t_end = fmu->model.problem.settings.t_end;
    page->own_rtol = fmu->model.problem.settings.rtol;
    page->width = fmu->count - fmu->own + 1;
    return page;
}

int32_t lag_page_count(const lag_page *page, int32_t which)
{
    const lag_fmu *fmu = page->fmu;
    switch (which) {
    case LAG_PAGE_COORDINATES: return fmu->nq;
    case LAG_PAGE_CONSTRAINTS: return fmu->nc;
    case LAG_PAGE_DERIVED: return (int32_t)fmu->derived;
    case LAG_PAGE_WIDTH: return (int32_t)page->width;
    default: return fmu->own;
    }
}

/* Release what depends on the run. */
static void end_run(lag_page *page)
{
    free(page->times);
    free(page->rows);
    page->times = page->rows = NULL;
    page->room = page->used = 0;
}

void lag_page_reset(lag_page *page)
{
    lag_fmu_reset(page->fmu);
    end_run(page);
}

int32_t lag_page_set_parameter(lag_page *page, int32_t number, double value)
{
    const unsigned reference = (unsigned)(page->fmu->count - page->fmu->own + number);
    return lag_fmu_set(page->fmu, &reference, 1, &value);
}

int32_t lag_page_set_initial(lag_page *page, int32_t number, double value, int32_t guess)
{
    const unsigned reference = 1 + (unsigned)number;
    const int32_t failed = lag_fmu_set(page->fmu, &reference, 1, &value);
    if (!failed && guess)
        page->fmu->is_given[number] = LAG_FMU_GUESS;
    return failed;
}

/* Complete a sample. */
static void complete(void *context, const double *sample)
{
    lag_page *page = context;
    lag_fmu *fmu = page->fmu;
    if (page->used >= page->room)
        return;
    lag_fmu_evaluate_at(fmu, sample);
    double *row = page->rows + page->used++ * page->width;
    memcpy(row, fmu->values, (size_t)(page->width - 1) * sizeof(double));
    row[page->width - 1] = sample[1 + 3 * fmu->nq + fmu->nc];
}

int32_t lag_page_begin(lag_page *page, const double *times, int32_t count, double t_end, double rtol)
{
    lag_fmu *fmu = page->fmu;
    lag_problem *problem = &fmu->model.problem;
    end_run(page);
    page->times = malloc((size_t)count * sizeof(double) + 1);
    page->rows = malloc(((size_t)count + 1) * (size_t)page->width * sizeof(double)); /* an event may end it between samples */
    if (!page->times || !page->rows)
        return no_memory();
    memcpy(page->times, times, (size_t)count * sizeof(double));
    page->room = (int64_t)count + 1;
    if (fmu->model.break_count && t_end > page->own_t_end) {
        keep(NULL, "the tables of this page end with the model's simulation");
        return 1;
    }
    problem->settings.t_end = t_end;
    problem->settings.rtol = rtol > 0.0 ? rtol : page->own_rtol;
    problem->times = page->times;
    problem->times_count = count;
    problem->block = fmu->row;
    problem->block_rows = 1;
    if (lag_fmu_initialize(fmu, problem->t, t_end) || lag_fmu_prepare(fmu))
        return 1;
    lag_samples *samples = &lag_run_of(fmu->simulation)->samples;
    samples->written = complete;
    samples->context = page;
    return lag_fmu_start(fmu);
}


int32_t lag_page_go_on(lag_page *page, int32_t steps)
{
    lag_simulation *s = page->fmu->simulation;
    lag_run *run = lag_run_of(s);
    const int64_t until = run->step.steps + steps;
    for (;;) {
        const int64_t rest = until - run->step.steps;
        const int status = lag_simulate(s, rest > 0 ? rest : 0);
        lag_take(run);
        switch (status) {
        case LAG_BLOCK_FULL: continue;
        case LAG_RUNNING: return LAG_PAGE_UNDER_WAY;
        case LAG_DONE: return LAG_PAGE_DONE;
        default: lag_fmu_fail_at(page->fmu, status); return LAG_PAGE_FAILED;
        }
    }
}

double lag_page_given(const lag_page *page, int32_t number)
{
    return page->fmu->begin[number];
}

int32_t lag_page_samples(const lag_page *page)
{
    return (int32_t)page->used;
}

const double *lag_page_sample_values(const lag_page *page)
{
    return page->rows;
}

const double *lag_page_start_parameters(const lag_page *page)
{
    return page->fmu->parameters;
}

const double *lag_page_start_state(const lag_page *page)
{
    return page->fmu->y;
}

int32_t lag_page_steps(const lag_page *page)
{
    return page->fmu->simulation ? (int32_t)lag_run_of(page->fmu->simulation)->step.steps : 0;
}

int32_t lag_page_log_count(const lag_page *page)
{
    int64_t count;
    int width;
    lag_log_of(page->fmu->simulation, &count, &width);
    return (int32_t)count;
}

int32_t lag_page_log_width(const lag_page *page)
{
    int64_t count;
    int width;
    lag_log_of(page->fmu->simulation, &count, &width);
    return width;
}

const double *lag_page_log(const lag_page *page)
{
    int64_t count;
    int width;
    return lag_log_of(page->fmu->simulation, &count, &width);
}

int32_t lag_page_stopped_by(const lag_page *page)
{
    return lag_stopped_by(page->fmu->simulation);
}
