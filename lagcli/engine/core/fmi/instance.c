#include "fmi/instance.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bind.h"
#include "breaks.h"
#include "evaluate.h"
#include "fmi/file.h"
#include "model/reader.h"
#include "model/simulation.h"
#include "motion.h"
#include "project.h"

#define METHODS 8  /* more than there are */
#define SAME_TIME 1e-9 /* of a step, or of the time: a difference of times that is rounding */
#define LARGE 400  /* unknowns of a model whose dense matrices are allocated only where they are needed */
#define DRIFT 1e-9 /* of the constraint's scale: residual at which model exchange brings the state back */

static const char *const reasons[] = {
    [LAG_UNDEFINED] = "the equations have no finite value",
    [LAG_FLOOR] = "the step size fell to its minimum, near a singular configuration or where a force is not smooth",
    [LAG_OVER] = "the constraints have become singular",
    [LAG_OFF] = "the motion cannot be brought back to the constraints",
    [LAG_INACCURATE] = "the linear equations cannot be solved accurately",
    [LAG_CONTRADICTED] = "redundant constraints contradict each other",
    [LAG_JUMPED] = "a constraint jumps",
    [LAG_ENDLESS] = "events do not end",
    [LAG_NO_MODE] = "no motion of the contacts is possible",
    [LAG_TWO_MODES] = "more than one motion of the contacts is possible",
    [LAG_NO_IMPACT] = "an impact has no solution",
    [LAG_GAINS] = "an impact would gain energy",
    [LAG_VIOLATED] = "an event moves a contact beyond its surface",
    [LAG_JAMMED] = "a contact jams: its force grows without bound",
    [LAG_SURFACES] = "the motion is pushed onto more than one surface at which forces jump",
    [LAG_FORKED] = "more than one motion leaves a surface at which forces jump",
    [LAG_NO_SIDE] = "a force jumps with a multiplier, and there are no forces on either side of the jump",
    [LAG_CORNER] = "a constraint has a corner, at which the velocities jump",
    [LAG_UNRESOLVED] = "the sign of a watched function cannot be determined",
    [LAG_CONFLICT] = "the constraints cannot hold at the values that an event sets",
    [LAG_NO_MEMORY] = "there is no memory",
};

int lag_fmu_fail(const lag_fmu *fmu, const char *format, ...)
{
    char text[LAG_MESSAGE];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    if (fmu->message)
        fmu->message(fmu->context, text);
    return 1;
}

/* The contents of a file, aligned as numbers; NULL, and a message, if it cannot be read, unless it is optional and missing. */
static const void *contents(lag_fmu *fmu, const char *folder, const char *name, int optional, int64_t *bytes)
{
    char path[4096];
    if (snprintf(path, sizeof path, "%s%s", folder, name) >= (int)sizeof path)
        return lag_fmu_fail(fmu, "the path of %s has more than %d bytes", name, (int)sizeof path), NULL;
    FILE *file = lag_open_file(path);
    if (!file && optional)
        return NULL;
    if (!file)
        return lag_fmu_fail(fmu, "cannot open %s", path), NULL;
    int64_t size = -1;
    if (!fseek(file, 0, SEEK_END))
        size = ftell(file);
    void *data = size < 0 ? NULL : lag_get(&fmu->pool, (size_t)size, 1);
    rewind(file);
    const int complete = data && fread(data, 1, (size_t)size, file) == (size_t)size;
    fclose(file);
    if (!complete)
        return lag_fmu_fail(fmu, "cannot read %s", path), NULL;
    *bytes = size;
    return data;
}

/* Take the angular velocities that are given. Returns 0, or 1 if they are damaged. */
static int read_spins(lag_fmu *fmu, const int32_t *from, int count, int nq)
{
    int damaged = count % LAG_SPIN_NUMBERS;
    for (int i = 0; i < count; ++i)
        damaged |= from[i] < 0 || from[i] >= (i % LAG_SPIN_NUMBERS < 4 ? nq : 2);
    return damaged || lag_start_take_spins(&fmu->search, &fmu->pool, from, count);
}

/* Take the equations with the constraints that hold at the start. */
static void read_constraints(lag_reader *in, const lag_equations *of_model, lag_equations *e)
{
    *e = *of_model;
    if (!lag_read_int(in, 0, 1))
        return;
    e->nc = lag_read_int(in, 0, LAG_MODEL_LARGEST);
    e->nh = lag_read_int(in, 0, e->nc);
    e->nb = lag_read_int(in, 0, INT32_MAX);
    e->np = lag_read_int(in, 0, of_model->np);
    e->holonomic = lag_read_integers(in, e->nh, 0, e->nc);
    e->jacobian_row = lag_read_integers(in, e->nb, 0, e->nc);
    e->jacobian_column = lag_read_integers(in, e->nb, 0, e->nq);
    e->constraint = lag_read_program(in, 1 + 2 * (int64_t)e->nq + e->np, 2 * (int64_t)e->nh + e->nb + 3 * (int64_t)e->nc);
}

/* Read what values.bin has. Returns 0, or 1 if it is damaged. */
static int read_values(lag_fmu *fmu, const void *data, int64_t bytes)
{
    const lag_model *m = &fmu->model;
    const lag_equations *e = &m->equations;
    lag_reader in = {.at = data, .words = bytes / 8, .status = LAG_MODEL_READ};
    if (bytes < 24 || bytes % 8 || lag_read_word(&in) != LAG_VALUES_MAGIC || lag_read_word(&in) != bytes / 8)
        return 1;
    int64_t settable = 0, inputs = 0, spins = 0;
    fmu->method = lag_method_at(lag_read_int(&in, 0, METHODS));
    fmu->own = lag_read_int(&in, 0, e->np);
    fmu->place = lag_read_list(&in, &settable);
    fmu->input = lag_read_list(&in, &inputs);
    fmu->fixed = lag_read_integers(&in, 2 * (int64_t)e->nq, 0, 2);
    const int32_t *spin = lag_read_list(&in, &spins);
    if (in.status != LAG_MODEL_READ || !fmu->method || settable > fmu->own || inputs > settable || spins > LAG_SPIN_NUMBERS * (int64_t)e->nq
        || read_spins(fmu, spin, (int)spins, e->nq))
        return 1;
    for (int64_t i = 0; i < settable; ++i)
        if (fmu->place[i] < 0 || fmu->place[i] >= fmu->own)
            return 1;
    fmu->nq = e->nq;
    fmu->nc = m->contents & LAG_MODEL_SWITCHING ? m->rules.nc : e->nc;
    fmu->settable = (int)settable;
    fmu->inputs = (int)inputs;
    read_constraints(&in, e, &fmu->search.equations);
    const lag_program start = lag_read_program(&in, settable, (int64_t)fmu->own + 2 * e->nq);
    fmu->columns_program = lag_read_program(&in, 1 + 3 * (int64_t)e->nq + fmu->nc + e->np, 0);
    if (in.status != LAG_MODEL_READ || in.words)
        return 1;
    fmu->derived = fmu->columns_program.output_count;
    fmu->count = 1 + 3 * (int64_t)e->nq + fmu->nc + fmu->derived + fmu->own;
    lag_bind_program(&fmu->pool, &fmu->start, &start, LAG_PORTABLE);
    return 0;
}

/* Read what the directions of a model that switches have. What they are not used for has any program. */
static void read_switching_directions(lag_reader *in, lag_fmu *fmu)
{
    const lag_equations *e = &fmu->model.equations;
    const lag_switching_rules *r = &fmu->model.rules;
    lag_fmu_directions *d = &fmu->directions;
    lag_directions *along = &d->along;
    const int64_t p = d->parameters, state = 1 + 2 * (int64_t)e->nq;
    const int64_t forces = 2 * (state + e->nq + fmu->nc + r->signs) + p + e->np;
    if (!(fmu->model.contents & LAG_MODEL_SWITCHING))
        return;
    along->parameters = d->parameters;
    along->decides = lag_get(&fmu->pool, (size_t)(r->conditions + r->force_conditions), sizeof *along->decides);
    along->dynamics = along->constraint = along->functions = along->limits = along->impact = along->forces =
        along->signs = along->conditions = along->force_conditions = along->kinks = along->kink_rates = d->of_equations;
    if (r->rows)
        along->functions = lag_read_program(in, 2 * state + p + e->np, r->nh + r->nb + 2 * (int64_t)r->rows);
    if (r->nl)
        along->limits = lag_read_program(in, forces, 2 * (int64_t)r->nl);
    if (r->nf)
        along->forces = lag_read_program(in, forces, r->nf);
    if (r->kinks)
        along->kink_rates = lag_read_program(in, 3 * state + p + 2 * (int64_t)e->nq + e->np, 2 * (int64_t)r->kinks);
}

/* Read what derivatives.bin has. Returns 0, or 1 if it is damaged. */
static int read_directions(lag_fmu *fmu, const void *data, int64_t bytes)
{
    const lag_equations *e = &fmu->model.equations;
    lag_fmu_directions *d = &fmu->directions;
    lag_reader in = {.at = data, .words = bytes / 8, .status = LAG_MODEL_READ};
    if (bytes < 24 || bytes % 8 || lag_read_word(&in) != LAG_DERIVATIVES_MAGIC || lag_read_word(&in) != bytes / 8)
        return 1;
    const int64_t p = d->parameters = lag_read_int(&in, fmu->own, e->np), state = 1 + 2 * (int64_t)e->nq;
    const int64_t entries = (int64_t)e->nm + e->nq + e->nb + e->nc;
    int64_t rank = 0;
    d->rows = lag_read_list(&in, &rank);
    d->rank = (int)rank;
    if (in.status != LAG_MODEL_READ || rank != fmu->model.problem.rank || rank > e->nc
        || (fmu->model.contents & LAG_MODEL_SWITCHING && rank < e->nc))
        return 1;
    for (int i = 0; i < d->rank; ++i)
        if (d->rows[i] < (i ? d->rows[i - 1] + 1 : 0) || d->rows[i] >= e->nc)
            return 1;
    d->of_parameters = lag_read_program(&in, 2 * (int64_t)fmu->settable, fmu->own);
    d->of_equations = lag_read_program(&in, 2 * state + p + e->np, entries);
    read_switching_directions(&in, fmu);
    d->of_columns = lag_read_program(&in, 2 * (state + e->nq + fmu->nc) + p + e->np, fmu->derived);
    if (in.status != LAG_MODEL_READ || in.words)
        return 1;
    d->changes = lag_doubles(&fmu->pool, fmu->count);
    d->seeds = lag_doubles(&fmu->pool, 2 * (int64_t)fmu->settable);
    d->right = lag_doubles(&fmu->pool, 2 * ((int64_t)e->nq + fmu->nc));
    d->p = lag_doubles(&fmu->pool, p);
    if (rank < e->nc) {
        const int64_t n = e->nq + rank;
        d->independent = lag_doubles(&fmu->pool, rank * e->nq);
        d->matrix = lag_doubles(&fmu->pool, n * n);
        d->weight = lag_doubles(&fmu->pool, rank);
        d->square = lag_doubles(&fmu->pool, rank * rank);
        d->shares = lag_doubles(&fmu->pool, e->nc * rank);
        d->inner = lag_doubles(&fmu->pool, rank * rank);
        d->solution = lag_doubles(&fmu->pool, n);
        d->mu = lag_doubles(&fmu->pool, e->nc);
        d->least = lag_doubles(&fmu->pool, e->nq);
        d->pivots = lag_get(&fmu->pool, (size_t)(n + 2 * rank), sizeof *d->pivots);
    }
    d->has = !fmu->pool.failed;
    return 0;
}

static int place_of_parameters(const lag_fmu *fmu)
{
    return (int)(fmu->count - fmu->own);
}

/* An instance without a model. */
static lag_fmu *new_instance(int exchange, lag_fmu_message *message, void *context)
{
    lag_pool pool = lag_pool_of(NULL);
    lag_fmu *fmu = lag_get(&pool, 1, sizeof *fmu);
    if (fmu)
        *fmu = (lag_fmu){.pool = pool, .run_pool = lag_pool_of(NULL), .exchange = exchange, .message = message, .context = context};
    return fmu;
}

/* Read the model and the values, and allocate what a simulation needs. Returns 0, or 1, and a message. */
static int complete(lag_fmu *fmu, const void *model, int64_t model_bytes, const void *values, int64_t values_bytes)
{
    const int status = lag_read_model(NULL, model, model_bytes, &fmu->model);
    if (status != LAG_MODEL_READ || read_values(fmu, values, values_bytes))
        return lag_fmu_fail(fmu, "%s is damaged, or of another version of lagcli",
                    status != LAG_MODEL_READ ? "model.bin" : "values.bin");
    lag_model *m = &fmu->model;
    const int nq = fmu->nq, nc = m->equations.nc;
    const char *library = lag_fingerprint();
    fmu->identity = lag_fmu_hash(LAG_FMU_NO_HASH, library, strlen(library));
    fmu->identity = lag_fmu_hash(fmu->identity, model, (size_t)model_bytes);
    fmu->identity = lag_fmu_hash(fmu->identity, values, (size_t)values_bytes) & ~UINT64_C(1);
    /* the solution that the run ends with from its start: nothing is allocated later */
    if (m->contents & LAG_MODEL_UNROLLED)
        m->contents &= ~(LAG_MODEL_PLAIN | LAG_MODEL_LOOP);
    m->problem.kernel = lag_best_kernel();
    m->problem.times_count = 0;
    m->problem.block_rows = 1;
    fmu->given = lag_doubles(&fmu->pool, fmu->settable);
    fmu->taken = lag_doubles(&fmu->pool, fmu->settable);
    fmu->initial = lag_doubles(&fmu->pool, 2 * nq);
    fmu->is_given = lag_get(&fmu->pool, 2 * (size_t)nq, sizeof *fmu->is_given);
    fmu->is_fixed = lag_get(&fmu->pool, 2 * (size_t)nq, sizeof *fmu->is_fixed);
    fmu->begin = lag_doubles(&fmu->pool, 2 * nq);
    fmu->parameters = lag_doubles(&fmu->pool, m->equations.np);
    fmu->y = lag_doubles(&fmu->pool, 2 * nq + 1);
    fmu->lengths = lag_doubles(&fmu->pool, nc);
    fmu->plain_lengths = lag_doubles(&fmu->pool, nc);
    fmu->held = lag_doubles(&fmu->pool, m->equations.np);
    fmu->row = lag_doubles(&fmu->pool, 2 + 3 * (int64_t)nq + fmu->nc);
    fmu->values = lag_doubles(&fmu->pool, fmu->count);
    const int with_whole = LAG_MODEL_UNROLLED | LAG_MODEL_RECURSIVE;
    fmu->search.dynamics_program = (m->contents & with_whole) == LAG_MODEL_UNROLLED ? m->unrolled : m->dynamics;
    fmu->search.np = m->equations.np;
    fmu->search.first_branch = m->rules.first_branch;
    lag_bind_program(&fmu->pool, &fmu->lasting, &m->equations.constraint, LAG_PORTABLE);
    if (lag_start_bind(&fmu->pool, &fmu->search, m->equations.nc))
        return lag_fmu_fail(fmu, "there is no memory");
    fmu->lasting.parameters = fmu->lasting.registers + m->equations.constraint.inputs - m->equations.np;
    lag_fmu_reset(fmu);
    return 0;
}

lag_fmu *lag_fmu_make(const void *model, int64_t model_bytes, const void *values, int64_t values_bytes, int exchange,
                      lag_fmu_message *message, void *context)
{
    lag_fmu *fmu = new_instance(exchange, message, context);
    if (fmu && complete(fmu, model, model_bytes, values, values_bytes)) {
        lag_fmu_close(fmu);
        return NULL;
    }
    return fmu;
}

lag_fmu *lag_fmu_open(const char *resources, int exchange, lag_fmu_message *message, void *context)
{
    lag_fmu *fmu = new_instance(exchange, message, context);
    if (!fmu)
        return NULL;
    int64_t model_bytes = 0, values_bytes = 0;
    const void *model = contents(fmu, resources, "model.bin", 0, &model_bytes);
    const void *values = model ? contents(fmu, resources, "values.bin", 0, &values_bytes) : NULL;
    if (!values || complete(fmu, model, model_bytes, values, values_bytes)) {
        lag_fmu_close(fmu);
        return NULL;
    }
    int64_t bytes = 0;
    const void *derivatives = contents(fmu, resources, "derivatives.bin", 1, &bytes);
    if (derivatives && read_directions(fmu, derivatives, bytes)) {
        lag_fmu_fail(fmu, "derivatives.bin is damaged, or of another version of lagcli");
        lag_fmu_close(fmu);
        return NULL;
    }
    return fmu;
}

void lag_fmu_end_simulation(lag_fmu *fmu)
{
    if (fmu->simulation)
        lag_destroy_simulation(fmu->simulation);
    lag_release(&fmu->run_pool);
    fmu->simulation = NULL;
    fmu->directions.bound = NULL;
    fmu->current = 0;
}

void lag_fmu_close(lag_fmu *fmu)
{
    lag_fmu_end_simulation(fmu);
    lag_release_model(&fmu->model);
    lag_pool pool = fmu->pool; /* the instance is in it */
    lag_release(&pool);
}

void lag_fmu_reset(lag_fmu *fmu)
{
    lag_fmu_end_simulation(fmu);
    for (int i = 0; i < fmu->settable; ++i)
        fmu->given[i] = fmu->model.problem.parameters[fmu->place[i]];
    memset(fmu->is_given, 0, 2 * (size_t)fmu->nq * sizeof *fmu->is_given);
    fmu->started_at = fmu->model.problem.t;
    fmu->stop = INFINITY;
    fmu->phase = LAG_FMU_MADE;
    fmu->changed = 0;
}

int lag_fmu_initialize(lag_fmu *fmu, double start, double stop)
{
    if (fmu->model.function_count && start != fmu->model.problem.t)
        return lag_fmu_fail(fmu, "the tables of the model begin a simulation at t = %g s, not at %g s", fmu->model.problem.t,
                    start);
    fmu->started_at = start;
    fmu->stop = stop;
    fmu->phase = LAG_FMU_INITIALIZING;
    fmu->current = 0;
    return 0;
}

/* Angular velocities hold where components of quaternions are set: their rates follow. They do not where rates are set.
 * Returns a lag_start_status. */
static int turn_spins(lag_fmu *fmu)
{
    double *q = fmu->begin, *v = q + fmu->nq;
    for (lag_spin *spin = fmu->search.spins; spin < fmu->search.spins + fmu->search.spin_count; ++spin) {
        double omega[3], own = 0.0;
        int turned = 0;
        spin->given = 1;
        for (int i = 0; i < 4; ++i) {
            const int at = spin->place[i];
            own = fmax(own, fabs(q[at]));
            turned |= fmu->is_given[at] && fmu->initial[at] != q[at];
            spin->given &= !fmu->is_given[fmu->nq + at];
        }
        if (!turned)
            continue;
        if (spin->given && !(own > 0.0)) /* its rates are 0 for any angular velocity */
            return LAG_START_UNTURNED;
        lag_angular_velocity(spin, q, v, omega);
        for (int i = 0; i < 4; ++i)
            if (fmu->is_given[spin->place[i]])
                q[spin->place[i]] = fmu->initial[spin->place[i]];
        lag_turn_quaternion(spin, omega, q, v);
    }
    return LAG_START_FOUND;
}

/* Evaluate the parameters that depend on those that are given. */
static void evaluate_parameters(lag_fmu *fmu, const double *given)
{
    const lag_model *m = &fmu->model;
    memcpy(fmu->parameters, m->problem.parameters, (size_t)m->equations.np * sizeof(double));
    memcpy(fmu->start.registers, given, (size_t)fmu->settable * sizeof(double));
    fmu->start.vectors->run(fmu->start.prelude, fmu->start.registers);
    lag_tape_run(&fmu->start, &fmu->start.stream);
    for (int i = 0; i < fmu->own; ++i)
        fmu->parameters[i] = OUT(&fmu->start, i);
}

/* The same with the initial values that depend on what was set. Returns a lag_start_status. */
static int evaluate_start(lag_fmu *fmu)
{
    const int nq = fmu->nq;
    evaluate_parameters(fmu, fmu->given);
    for (int i = 0; i < 2 * nq; ++i)
        fmu->begin[i] = OUT(&fmu->start, fmu->own + i);
    const int status = turn_spins(fmu);
    for (int i = 0; i < 2 * nq; ++i) {
        if (fmu->is_given[i])
            fmu->begin[i] = fmu->initial[i];
        fmu->is_fixed[i] = fmu->is_given[i] ? fmu->is_given[i] == LAG_FMU_FIXED : fmu->fixed[i];
    }
    memcpy(fmu->y, fmu->begin, 2 * (size_t)nq * sizeof *fmu->y);
    fmu->y[2 * nq] = 0.0;
    return status;
}

/* Whether nothing was set to another value than that of the data. */
static int is_nominal(const lag_fmu *fmu)
{
    const lag_problem *p = &fmu->model.problem;
    for (int i = 0; i < fmu->settable; ++i)
        if (fmu->given[i] != p->parameters[fmu->place[i]])
            return 0;
    for (int i = 0; i < 2 * fmu->nq; ++i)
        if (fmu->is_given[i] && fmu->initial[i] != p->y[i])
            return 0;
    return fmu->started_at == p->t;
}

/* Measure the rows of B of the run at its start; returns their rank. */
static int measure_rows(lag_fmu *fmu)
{
    const lag_equations *e = &fmu->model.equations;
    lag_tape *tape = &fmu->lasting;
    lag_tape_set(tape, e->np, fmu->parameters);
    tape->registers[0] = fmu->started_at;
    memcpy(tape->registers + 1, fmu->y, 2 * (size_t)fmu->nq * sizeof *fmu->y);
    lag_tape_run(tape, &tape->stream);
    return lag_start_rank(&fmu->search, e, tape, fmu->model.problem.sizes, fmu->lengths, fmu->plain_lengths);
}

int lag_fmu_prepare(lag_fmu *fmu)
{
    lag_model model = fmu->model;
    const lag_problem *nominal = &fmu->model.problem;
    lag_fmu_end_simulation(fmu);
    int found = evaluate_start(fmu);
    memcpy(fmu->taken, fmu->given, (size_t)fmu->settable * sizeof *fmu->taken);
    if (found == LAG_START_FOUND && is_nominal(fmu)) {
        memcpy(fmu->parameters, nominal->parameters, (size_t)fmu->own * sizeof(double));
        memcpy(fmu->y, nominal->y, (2 * (size_t)fmu->nq + 1) * sizeof(double));
    } else {
        if (found == LAG_START_FOUND)
            found = lag_start_find(&fmu->search, fmu->started_at, fmu->parameters, fmu->is_fixed, fmu->y);
        if (found == LAG_START_FOUND && measure_rows(fmu) != nominal->rank)
            found = LAG_START_SINGULAR;
        if (found == LAG_START_CONTRADICTED)
            return lag_fmu_fail(fmu, "the initial values that are set do not satisfy the constraints");
        if (found == LAG_START_UNDEFINED)
            return lag_fmu_fail(fmu, "the constraints have no finite value at the initial state");
        if (found == LAG_START_SINGULAR)
            return lag_fmu_fail(fmu, "the constraints are singular at the initial state");
        if (found == LAG_START_UNTURNED)
            return lag_fmu_fail(fmu, "the initial values of a quaternion are all 0, which is no orientation");
        if (found == LAG_START_NO_MEMORY)
            return lag_fmu_fail(fmu, "there is no memory");
        model.problem.lengths = fmu->lengths;
        model.problem.plain_lengths = fmu->plain_lengths;
    }
    model.problem.t = fmu->started_at;
    model.problem.y = fmu->y;
    model.problem.parameters = fmu->parameters;
    if (isfinite(fmu->stop) && fmu->stop > model.problem.settings.t_end)
        model.problem.settings.t_end = fmu->stop;
    if (!(model.problem.settings.t_end > fmu->started_at))
        model.problem.settings.t_end = fmu->started_at + 1.0;
    return lag_fmu_make_simulation(fmu, &model);
}

int lag_fmu_make_simulation(lag_fmu *fmu, const lag_model *model)
{
    const int status = lag_make_simulation(NULL, model, lag_method_name(fmu->method), &fmu->simulation);
    if (status != LAG_MODEL_READ)
        return lag_fmu_fail(fmu, status == LAG_MODEL_MEMORY ? "there is no memory" : "the initial values are not finite");
    lag_run *run = lag_run_of(fmu->simulation);
    if (lag_bind(run, &fmu->run_pool, &fmu->columns, &fmu->columns_program)
        || (fmu->nq + model->equations.nc <= LARGE && lag_allow_dense(run, 0)))
        return lag_fmu_fail(fmu, "there is no memory");
    /* the steps of another program do not show whether rows that are left out still follow from the others */
    if (fmu->exchange && model->left_out && lag_allow_dense(run, INT64_MAX - 1))
        return lag_fmu_fail(fmu, "there is no memory");
    return 0;
}

int lag_fmu_fail_at(lag_fmu *fmu, int status)
{
    const int known = status >= 0 && status < (int)(sizeof reasons / sizeof *reasons) && reasons[status];
    fmu->phase = LAG_FMU_FAILED;
    return lag_fmu_fail(fmu, "at t = %.9g s: %s", lag_run_of(fmu->simulation)->step.t,
                known ? reasons[status] : "the simulation cannot continue");
}

int lag_fmu_start(lag_fmu *fmu)
{
    const int status = lag_simulate_to(fmu->simulation, fmu->started_at);
    if (status != LAG_RUNNING && status != LAG_DONE && status != LAG_BLOCK_FULL)
        return lag_fmu_fail_at(fmu, status);
    if (lag_is_violated(fmu->simulation, fmu->y)) {
        fmu->phase = LAG_FMU_FAILED;
        return lag_fmu_fail(fmu, "a contact is violated at the initial state");
    }
    fmu->phase = status == LAG_DONE ? LAG_FMU_ENDED : LAG_FMU_STARTED;
    fmu->current = 0;
    lag_wait(fmu->simulation, fmu->has_event_mode);
    return 0;
}

int lag_fmu_begin(lag_fmu *fmu)
{
    if (fmu->phase == LAG_FMU_STARTED || fmu->phase == LAG_FMU_ENDED)
        return 0;
    if (lag_fmu_prepare(fmu)) {
        fmu->phase = LAG_FMU_FAILED;
        return 1;
    }
    return lag_fmu_start(fmu);
}

double lag_fmu_time(const lag_fmu *fmu)
{
    return fmu->simulation ? lag_run_of(fmu->simulation)->step.t : fmu->started_at;
}

/* Take what a simulation returns. Returns 0, or 1, and a message. */
static int take_status(lag_fmu *fmu, int status)
{
    if (status == LAG_DONE)
        fmu->phase = LAG_FMU_ENDED;
    return status == LAG_RUNNING || status == LAG_DONE ? 0 : lag_fmu_fail_at(fmu, status);
}

/* Make the changed inputs those of the run, which continues from its state; an event that they trigger may end it. Returns 0,
 * or 1, and a message. */
static int take_inputs(lag_fmu *fmu)
{
    lag_run *run = lag_run_of(fmu->simulation);
    const size_t bytes = (size_t)fmu->own * sizeof(double);
    int status = LAG_RUNNING;
    evaluate_parameters(fmu, fmu->taken);
    memcpy(fmu->held, fmu->parameters, bytes);
    evaluate_parameters(fmu, fmu->given);
    memcpy(fmu->taken, fmu->given, (size_t)fmu->settable * sizeof *fmu->taken);
    fmu->changed = 0;
    fmu->current = 0;
    if (fmu->exchange) { /* the state is the importing tool's */
        memcpy(run->parameters, fmu->parameters, bytes);
        lag_renew_tapes(run);
        return 0;
    }
    status = lag_change_parameters(fmu->simulation, fmu->held, fmu->parameters, fmu->own);
    return take_status(fmu, status == LAG_RUNNING ? lag_simulate(fmu->simulation, 0) : status);
}

/* Tell the importing tool of a step of the integration. */
static double update(void *context)
{
    lag_fmu *fmu = context;
    fmu->current = 0;
    const double end = fmu->update(fmu->context, lag_fmu_time(fmu));
    return fmu->may_return ? end : INFINITY;
}

int lag_fmu_advance(lag_fmu *fmu, double from, double t)
{
    if (fmu->phase == LAG_FMU_ENDED)
        return 0;
    if (fmu->phase != LAG_FMU_STARTED)
        return lag_fmu_fail(fmu, "the simulation has not begun, or has failed");
    if (!(fabs(from - lag_fmu_time(fmu)) <= SAME_TIME * fmax(fabs(t - from), fabs(t))))
        return lag_fmu_fail(fmu, "a step from t = %.9g s is not possible: the simulation is at t = %.9g s", from,
                    lag_fmu_time(fmu));
    if (fmu->model.break_count && t > fmu->model.problem.settings.t_end)
        return lag_fmu_fail(fmu, "the tables of the FMU end at t = %g s; let the model's simulation end later",
                    fmu->model.problem.settings.t_end);
    if (fmu->changed && take_inputs(fmu))
        return 1;
    if (fmu->phase == LAG_FMU_ENDED)
        return 0;
    fmu->current = 0;
    int status;
    do
        status = lag_simulate_watched(fmu->simulation, t, fmu->update ? update : NULL, fmu);
    while (status == LAG_RUNNING && !fmu->may_return && lag_fmu_time(fmu) < t);
    return take_status(fmu, status);
}

int lag_fmu_is_due(const lag_fmu *fmu)
{
    return fmu->phase == LAG_FMU_STARTED && lag_is_due(fmu->simulation);
}

int lag_fmu_happen(lag_fmu *fmu, double *next)
{
    *next = INFINITY;
    if (fmu->phase == LAG_FMU_ENDED)
        return 0;
    if (fmu->phase != LAG_FMU_STARTED)
        return lag_fmu_fail(fmu, "the simulation has not begun, or has failed");
    if (fmu->changed && take_inputs(fmu))
        return 1;
    if (lag_fmu_is_due(fmu)) {
        fmu->current = 0;
        if (take_status(fmu, lag_simulate(fmu->simulation, 0)))
            return 1;
    }
    *next = lag_next_time(fmu->simulation);
    return 0;
}

/* A sample of a state that another program integrates. Returns a lag_status. */
static int sample_without_projection(lag_fmu *fmu)
{
    lag_run *run = lag_run_of(fmu->simulation);
    const size_t nq = (size_t)fmu->nq;
    double power, *row = fmu->row;
    if (lag_accelerate_alone(run, run->step.t, run->step.y, 1, &power))
        return LAG_UNDEFINED;
    row[0] = run->step.t;
    memcpy(row + 1, run->step.y, 2 * nq * sizeof *row);
    memcpy(row + 1 + 2 * nq, run->solver.a, nq * sizeof *row);
    memcpy(row + 1 + 3 * nq, run->solver.multipliers, (size_t)fmu->nc * sizeof *row);
    return LAG_RUNNING;
}

void lag_fmu_evaluate_at(lag_fmu *fmu, const double *row)
{
    const lag_run *run = lag_run_of(fmu->simulation);
    const size_t known = 1 + 3 * (size_t)fmu->nq + (size_t)fmu->nc;
    memcpy(fmu->held, lag_parameters_of(fmu->simulation), (size_t)run->np * sizeof(double));
    lag_pieces_at(run, row[0], fmu->held); /* the step may have ended where the next ones begin */
    lag_tape_set(&fmu->columns, run->np, fmu->held);
    memcpy(fmu->columns.registers, row, known * sizeof(double));
    lag_tape_run(&fmu->columns, &fmu->columns.stream);
    memcpy(fmu->values, row, known * sizeof(double));
    for (int64_t i = 0; i < fmu->derived; ++i)
        fmu->values[known + (size_t)i] = OUT(&fmu->columns, i);
    memcpy(fmu->values + place_of_parameters(fmu), fmu->held, (size_t)fmu->own * sizeof(double));
}

/* Evaluate all values at the state. */
static int evaluate(lag_fmu *fmu)
{
    const int nq = fmu->nq;
    if (fmu->phase == LAG_FMU_INITIALIZING) {
        const int status = lag_fmu_prepare(fmu) ? -1 : lag_simulate_to(fmu->simulation, fmu->started_at);
        if (status != LAG_RUNNING && status != LAG_DONE)
            return status < 0 ? 1 : lag_fmu_fail_at(fmu, status);
    }
    if (!fmu->simulation) { /* before it begins */
        evaluate_start(fmu);
        fmu->values[0] = fmu->started_at;
        memcpy(fmu->values + 1, fmu->model.problem.y, 2 * (size_t)nq * sizeof(double));
        for (int i = 0; i < 2 * nq; ++i)
            if (fmu->is_given[i])
                fmu->values[1 + i] = fmu->initial[i];
        memcpy(fmu->values + place_of_parameters(fmu), fmu->parameters, (size_t)fmu->own * sizeof(double));
        return 0;
    }
    if (fmu->changed && take_inputs(fmu))
        return 1;
    lag_run *run = lag_run_of(fmu->simulation);
    const int status = fmu->exchange ? sample_without_projection(fmu) : lag_sample_here(run, fmu->row);
    if (status != LAG_RUNNING)
        return lag_fmu_fail_at(fmu, status);
    lag_fmu_evaluate_at(fmu, fmu->row);
    fmu->current = 1;
    return 0;
}

int lag_fmu_get(lag_fmu *fmu, const unsigned *references, size_t count, double *values)
{
    if (fmu->phase == LAG_FMU_FAILED)
        return lag_fmu_fail(fmu, "the simulation has failed");
    if (!fmu->current && evaluate(fmu))
        return 1;
    for (size_t i = 0; i < count; ++i) {
        if (references[i] >= (uint64_t)fmu->count)
            return lag_fmu_fail(fmu, "there is no variable with the value reference %u", references[i]);
        values[i] = fmu->values[references[i]];
    }
    return 0;
}

/* Set a parameter. */
static int set_parameter(lag_fmu *fmu, int place, double value)
{
    for (int i = 0; i < fmu->settable; ++i) {
        if (fmu->place[i] != place)
            continue;
        if (fmu->phase > LAG_FMU_INITIALIZING) {
            int is_input = 0;
            for (int k = 0; k < fmu->inputs; ++k)
                is_input |= fmu->input[k] == place;
            if (!is_input)
                return lag_fmu_fail(fmu, "parameters are fixed once the simulation has begun");
            fmu->changed |= fmu->given[i] != value;
        }
        fmu->given[i] = value;
        return 0;
    }
    return lag_fmu_fail(fmu, "a parameter that the model computes from others cannot be set");
}

int lag_fmu_set(lag_fmu *fmu, const unsigned *references, size_t count, const double *values)
{
    const int first = place_of_parameters(fmu);
    for (size_t i = 0; i < count; ++i) {
        const uint64_t which = references[i];
        if (!isfinite(values[i]))
            return lag_fmu_fail(fmu, "the value of a variable is not finite");
        if (which >= (uint64_t)first && which < (uint64_t)fmu->count) {
            if (set_parameter(fmu, (int)(references[i] - (unsigned)first), values[i]))
                return 1;
        } else if (which >= 1 && which < 1 + 2 * (uint64_t)fmu->nq && fmu->phase <= LAG_FMU_INITIALIZING) {
            fmu->initial[which - 1] = values[i];
            fmu->is_given[which - 1] = LAG_FMU_FIXED;
        } else {
            return lag_fmu_fail(fmu, "the variable with the value reference %u cannot be set now", references[i]);
        }
        if (fmu->phase <= LAG_FMU_INITIALIZING)
            fmu->current = 0;
        fmu->current &= !fmu->changed;
    }
    return 0;
}

void lag_fmu_move(lag_fmu *fmu, double t, const double *state)
{
    lag_run *run = lag_run_of(fmu->simulation);
    run->step.t = t;
    if (state)
        memcpy(run->step.y, state, 2 * (size_t)fmu->nq * sizeof(double));
    fmu->current = 0;
}

int lag_fmu_state_of(const lag_fmu *fmu, double *state, size_t count)
{
    if (count != 2 * (size_t)fmu->nq || !fmu->simulation)
        return lag_fmu_fail(fmu, "the state has %d entries, once the simulation has begun", 2 * fmu->nq);
    memcpy(state, lag_run_of(fmu->simulation)->step.y, count * sizeof *state);
    return 0;
}

int lag_fmu_derivatives(lag_fmu *fmu, double *derivatives)
{
    lag_run *run = lag_run_of(fmu->simulation);
    double power;
    if (fmu->changed && take_inputs(fmu))
        return 1;
    if (lag_accelerate_alone(run, run->step.t, run->step.y, 1, &power))
        return lag_fmu_fail(fmu, "at t = %.9g s: %s", run->step.t, reasons[LAG_UNDEFINED]);
    memcpy(derivatives, run->step.y + fmu->nq, (size_t)fmu->nq * sizeof(double));
    memcpy(derivatives + fmu->nq, run->solver.a, (size_t)fmu->nq * sizeof(double));
    return 0;
}

int lag_fmu_drifted(lag_fmu *fmu)
{
    lag_run *run = lag_run_of(fmu->simulation);
    const lag_system *s = &run->system;
    const lag_tape *c = &s->constraint;
    lag_evaluate(c, s, run->step.t, run->step.y, LAG_ALL);
    const double position = lag_largest_residual(c, s->nh, 0, lag_constraint_position_scale(s));
    const double velocity =
        lag_largest_residual(c, s->nc, lag_constraint_velocity(s), lag_constraint_velocity_scale(s));
    return fmax(position, velocity) > DRIFT;
}

int lag_fmu_project(lag_fmu *fmu)
{
    lag_run *run = lag_run_of(fmu->simulation);
    const int status = lag_project(run, run->step.t, run->step.y);
    fmu->current = 0;
    return status == LAG_RUNNING ? 0 : lag_fmu_fail_at(fmu, status);
}
