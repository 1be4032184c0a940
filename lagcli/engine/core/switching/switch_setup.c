/* Setup of the switching part of a run. */
#include <math.h>
#include <string.h>

#include "bind.h"
#include "breaks.h"
#include "derivatives/jumps.h"
#include "left_out.h"
#include "motion.h"
#include "switching/accumulation.h"
#include "switching/crossing.h"
#include "switching/enclosure.h"
#include "switching/kinks.h"
#include "switching/log.h"
#include "switching/rows.h"
#include "switching/settle.h"

static double *scratch(lag_pool *pool, int64_t count)
{
    return lag_scratch(pool, (size_t)count, sizeof(double));
}

static void allocate(lag_run *run)
{
    lag_switching *sw = &run->switching;
    lag_pool *pool = &run->pool;
    const int rows = sw->rows, all = rows + sw->nf, nq = run->system.nq, n = lag_size(&run->system);
    const int size = nq + run->system.nc, conditions = sw->conditions + sw->force_conditions;
    /* of each row two at most: both limits of its force, or its slip and the margin */
    const int watched = 2 * rows + sw->signs + conditions + 2 * sw->kinks.count;
    int **lists[] = {&sw->mode, &sw->active, &sw->mode_before, &sw->ended, &sw->state, &sw->trial_mode,
                     &sw->takes_part, &sw->rests, &sw->ends, &sw->member, &sw->came_to_rest, &sw->first_mode,
                     &sw->tight, &sw->shares};
    double **by_row[] = {&sw->phi, &sw->psi, &sw->drift, &sw->gamma, &sw->size, &sw->speed, &sw->tried,
                          &sw->stray, &sw->trial_force, &sw->slack, &sw->rest_time, &sw->rest_friction, &sw->terms};
    double **by_state[] = {&sw->saved, &sw->direction, &sw->y, &sw->slope, &sw->before, &sw->start,
                           &sw->struck, &sw->acceleration};
    for (size_t i = 0; i < sizeof lists / sizeof *lists; ++i)
        *lists[i] = lag_get(pool, (size_t)rows, sizeof(int));
    for (size_t i = 0; i < sizeof by_row / sizeof *by_row; ++i)
        *by_row[i] = lag_doubles(pool, rows);
    for (size_t i = 0; i < sizeof by_state / sizeof *by_state; ++i)
        *by_state[i] = lag_doubles(pool, n);
    sw->jacobian = lag_doubles(pool, (int64_t)rows * nq);
    sw->first_entry = lag_get(pool, (size_t)rows + 1, sizeof(int));
    sw->entry = lag_get(pool, (size_t)sw->nb, sizeof(int));
    sw->response = lag_doubles(pool, (int64_t)all * size);
    sw->force = lag_doubles(pool, all);
    sw->kept = lag_doubles(pool, all + rows);
    sw->matrix = scratch(pool, (int64_t)all * all);
    sw->lu = scratch(pool, (int64_t)all * all);
    sw->multipliers = lag_doubles(pool, sw->nc);
    sw->work = scratch(pool, INT64_C(2) * size + INT64_C(10) * all + INT64_C(5) * all * all);
    sw->pivots = lag_get(pool, (size_t)all, sizeof(int));
    sw->acts = lag_get(pool, 2 * (size_t)all, sizeof(int));
    sw->watched = lag_get(pool, (size_t)watched, sizeof *sw->watched);
    sw->condition = lag_get(pool, (size_t)conditions, sizeof *sw->condition);
    sw->clock = lag_get(pool, (size_t)sw->clocks, sizeof *sw->clock);
    sw->values = lag_doubles(pool, watched);
    sw->times = lag_doubles(pool, watched);
    sw->node_values = lag_doubles(pool, (int64_t)NODES * watched);
    sw->impulse = lag_doubles(pool, INT64_C(2) * rows + sw->nc);
    sw->contacts = scratch(pool, INT64_C(3) * all * all + INT64_C(8) * all + size);
    sw->integers = lag_get(pool, 5 * (size_t)all, sizeof(int));
    const size_t one = lag_contact_memory(rows), other = lag_impact_memory(rows);
    sw->memory = lag_scratch(pool, one > other ? one : other, 1);
    sw->accumulation = scratch(pool, lag_accumulation_doubles(rows));
    sw->accumulation_lists = lag_get(pool, (size_t)lag_accumulation_integers(rows), sizeof(int));
    sw->begin = lag_doubles(pool, nq + sw->nc);
    sw->side = lag_doubles(pool, sw->signs);
    sw->found_side = lag_doubles(pool, sw->signs);
    sw->turned = lag_get(pool, (size_t)sw->signs, sizeof(int));
    sw->sign_before = lag_doubles(pool, sw->signs);
    sw->sign_value = lag_doubles(pool, sw->signs);
    sw->sign_size = lag_doubles(pool, sw->signs);
    lag_kinks *k = &sw->kinks;
    double **by_kink[] = {&k->branch, &k->bound, &k->size,     &k->growth,  &k->rounding,
                          &k->held,   &k->drift, &k->vanished, &k->recurred};
    for (size_t i = 0; i < sizeof by_kink / sizeof *by_kink; ++i)
        *by_kink[i] = lag_doubles(pool, k->count);
    k->state = lag_get(pool, (size_t)k->count, sizeof(int));
    k->both = lag_doubles(pool, INT64_C(2) * (size + sw->nc + all + 1));
    k->y = lag_doubles(pool, n);
}

/* List the entries of B by row, in their order. */
static void list_entries(lag_switching *sw)
{
    int *first = sw->first_entry;
    memset(first, 0, ((size_t)sw->rows + 1) * sizeof(int));
    for (int i = 0; i < sw->nb; ++i)
        ++first[sw->row[i] + 1];
    for (int row = 0; row < sw->rows; ++row)
        first[row + 1] += first[row];
    for (int i = 0; i < sw->nb; ++i)
        sw->entry[first[sw->row[i]]++] = i;
    for (int row = sw->rows; row > 0; --row) /* each is now where the next row begins */
        first[row] = first[row - 1];
    first[0] = 0;
}

int lag_use_switching(lag_run *run, const lag_switching_rules *given)
{
    lag_switching *sw = &run->switching;
    lag_pool *pool = &run->pool;
    const int rows = given->rows;
    *sw = (lag_switching){
        .rows = rows,
        .exported = given->exported,
        .nc = given->nc,
        .constraint = lag_copy_integers(pool, given->constraint, rows),
        .base = lag_copy_integers(pool, given->base, run->system.nc),
        .law = lag_copy_integers(pool, given->law, rows),
        .limit = lag_copy_integers(pool, given->limit, rows),
        .normal = lag_copy_integers(pool, given->normal, rows),
        .place = lag_copy_integers(pool, given->place, rows),
        .sign = lag_copy_doubles(pool, given->sign, rows),
        .nb = given->nb,
        .nh = given->nh,
        .row = lag_copy_integers(pool, given->row, given->nb),
        .column = lag_copy_integers(pool, given->column, given->nb),
        .signs = given->signs,
        .nl = given->nl,
        .pattern_count = given->pattern_count,
        .pattern_limit = lag_copy_integers(pool, given->pattern_limit, given->pattern_count),
        .pattern_row = lag_copy_integers(pool, given->pattern_row, given->pattern_count),
        .friction = lag_copy_integers(pool, given->friction, rows),
        .restitution = lag_copy_integers(pool, given->restitution, rows),
        .nf = given->nf,
        .force_count = given->force_count,
        .force_coordinate = lag_copy_integers(pool, given->force_coordinate, given->nf),
        .force_row = lag_copy_integers(pool, given->force_row, given->force_count),
        .force_constraint = lag_copy_integers(pool, given->force_constraint, given->force_count),
        .conditions = given->conditions,
        .force_conditions = given->force_conditions,
        .clocks = given->clocks,
        .reported = lag_copy_integers(pool, given->reported, INT64_C(5) * rows),
        .kinks = {.count = given->kinks,
                  .first = given->first_branch,
                  .whole = lag_copy_integers(pool, given->whole, given->kinks),
                  .time = lag_copy_integers(pool, given->of_time, given->kinks),
                  .slides = -1},
        .chosen = run->method,
        .log = given->log,
        .log_rows = given->log_rows,
        .used = 1,
    };
    allocate(run);
    if (pool->failed)
        return 1;
    list_entries(sw);
    if (lag_bind(run, pool, &sw->functions, &given->functions)
        || lag_bind(run, pool, &sw->limits, &given->limits) || lag_bind(run, pool, &sw->impact, &given->impact)
        || lag_bind(run, pool, &sw->forces, &given->forces)
        || lag_bind(run, pool, &sw->sign_tape, &given->sign_functions)
        || lag_bind(run, pool, &sw->condition_tape, &given->condition_functions)
        || lag_bind(run, pool, &sw->force_condition_tape, &given->force_condition_functions)
        || lag_bind(run, pool, &sw->kinks.tape, &given->kink_functions))
        return 1;
    lag_enclosure_bind(run, given);
    if (pool->failed)
        return 1;
    memcpy(sw->kinks.branch, run->parameters + sw->kinks.first, (size_t)sw->kinks.count * sizeof(double));
    lag_bernstein_matrix(sw->to_bernstein);
    sw->acting = sw->nf > 0;
    for (int i = 0; i < rows; ++i)
        sw->active[i] = given->active[i];
    for (int i = 0; i < sw->conditions + sw->force_conditions; ++i) {
        sw->condition[i].either = given->either[i];
        sw->condition[i].time = given->time[i];
    }
    for (int i = 0; i < sw->clocks; ++i)
        sw->clock[i] = (lag_clock){.first = given->ticks[3 * i],
                                   .step = given->ticks[3 * i + 1],
                                   .per = given->ticks[3 * i + 2],
                                   .left = given->most[i] ? given->most[i] : INT64_MAX};
    return 0;
}

void lag_set_parameters(lag_run *run, const double *parameters)
{
    memcpy(run->parameters, parameters, (size_t)run->np * sizeof(double));
    lag_keep_branches(run);
    lag_renew_tapes(run);
    run->switching.moved = 1;
}

void lag_place(lag_run *run, const double *y)
{
    memcpy(run->step.y, y, (2 * (size_t)run->system.nq + 1) * sizeof(double));
    memset(run->switching.ended, 0, (size_t)run->switching.rows * sizeof(int));
    for (int i = 0; i < run->switching.kinks.count; ++i)
        if (run->switching.kinks.state[i] == LAG_SIDE_KNOWN)
            run->switching.kinks.state[i] = LAG_ON_SURFACE;
    run->switching.moved = 1;
}

void lag_activate(lag_run *run, int row, int active)
{
    lag_switching *sw = &run->switching;
    sw->active[row] = active;
    sw->ended[row] = 0;
    if (!active)
        sw->mode[row] = sw->mode_before[row] = LAG_OPEN;
}

int lag_push(lag_run *run, const double *impulse, const double *changes, double *reaction)
{
    const int nq = run->system.nq;
    double *y = run->step.y, *work = run->switching.response, sum = 0.0;
    if (run->switching.rows + run->switching.nf == 0)
        work = run->switching.work;
    if (lag_factor(run, run->step.t, y))
        return LAG_UNDEFINED;
    lag_respond(run, impulse, work);
    if (run->derivatives.n && changes)
        lag_jump_by_push(run, work, changes);
    for (int i = 0; i < nq; ++i)
        sum += impulse[i] * (y[nq + i] + 0.5 * work[i]);
    for (int i = 0; i < nq; ++i)
        y[nq + i] += work[i];
    y[2 * nq] += sum;
    run->switching.moved = 1;
    if (lag_left_out(run))
        lag_share_multipliers(run, work + nq);
    memcpy(reaction, work + nq, (size_t)run->system.nc * sizeof(double));
    return LAG_RUNNING;
}

lag_instant_report lag_instant_of(lag_run *run)
{
    lag_switching *sw = &run->switching;
    const lag_watched_function *w = sw->watched + sw->unresolved;
    const enum lag_undetermined kind = w->what >= LAG_WATCH_CONDITION                              ? LAG_OF_CONDITION
                                       : w->what == LAG_WATCH_KINK || w->what == LAG_WATCH_SURFACE ? LAG_OF_KINK
                                                                                                   : LAG_OF_ROW;
    return (lag_instant_report){run->step.t, run->step.y, sw->mode, sw->active, sw->phi, sw->psi,
                                sw->trial_force, sw->gained, sw->with_friction, sw->equal_restitution,
                                sw->takes_part, sw->motions, sw->begun, sw->first_mode,
                                sw->before, sw->begin, sw->begin + run->system.nq,
                                sw->kinks.crossed, sw->kinks.slid, sw->kinks.state, sw->kinks.branch,
                                kind, w->which};
}

int lag_condition_happened(lag_run *run, int which)
{
    lag_condition *c = run->switching.condition + which;
    const int now = c->happened == 1;
    if (now)
        c->happened = 2;
    return now;
}

int lag_clock_ticks(lag_run *run, int which)
{
    lag_clock *c = run->switching.clock + which;
    const int now = c->ticks == 1;
    if (now)
        c->ticks = 2;
    return now;
}

int lag_condition_holds(const lag_run *run, int which)
{
    return run->switching.condition[which].holds;
}

double lag_gap_of_none(const lag_run *run, int row)
{
    return lag_no_gap(run, row);
}

int64_t lag_take_log(lag_run *run)
{
    lag_switching *sw = &run->switching;
    lag_log_modes(run);
    const int64_t used = sw->log_used;
    sw->log_used = sw->log_open = 0;
    return used;
}
