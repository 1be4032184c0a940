/* Reading of models: the order of their parts, and what each must be. */
#include <math.h>
#include <string.h>

#include "contact/contact.h"
#include "linear/ldl.h"
#include "memory.h"
#include "model/check.h"
#include "model/reader.h"
#include "system.h"

#define HIGHEST_DEGREE 64 /* of pieces of functions of time */
#define CHANGES 5         /* of a row: lag_switching_rules.reported */

static lag_equations equations(lag_reader *in)
{
    lag_equations e = {0};
    e.nq = lag_read_count(in);
    e.nc = lag_read_count(in);
    e.nh = lag_read_count(in);
    e.np = lag_read_count(in);
    if (in->status == LAG_MODEL_READ
        && (e.nq < 1 || e.nq + 2 * (int64_t)e.nc > LAG_MODEL_LARGEST || e.nh > e.nc))
        lag_reject(in, LAG_MODEL_SIZES);
    e.holonomic = lag_read_integers(in, e.nh, 0, e.nc);
    e.nm = lag_read_count(in);
    e.nb = lag_read_count(in);
    e.mass_row = lag_read_integers(in, e.nm, 0, e.nq);
    e.mass_column = lag_read_integers(in, e.nm, 0, e.nq);
    e.jacobian_row = lag_read_integers(in, e.nb, 0, e.nc);
    e.jacobian_column = lag_read_integers(in, e.nb, 0, e.nq);
    e.unit = lag_read_integers(in, e.nq, 0, e.nq);
    const lag_system counts = {.nq = e.nq, .nc = e.nc, .nh = e.nh, .nm = e.nm, .nb = e.nb};
    e.constraint = lag_read_program(in, 1 + 2 * (int64_t)e.nq + e.np, lag_constraint_size(&counts));
    return e;
}

static lag_settings settings(lag_reader *in)
{
    lag_settings s = {0};
#define REAL(name) s.name = lag_read_number(in);
#define COUNT(name) s.name = lag_read_word(in);
#define CHOICE(name, choices) s.name = lag_read_int(in, 0, choices - 1);
    LAG_SETTINGS(REAL, COUNT, CHOICE)
#undef REAL
#undef COUNT
#undef CHOICE
    return s;
}

static lag_problem problem(lag_reader *in, const lag_equations *e)
{
    lag_problem p = {0};
    p.settings = settings(in);
    p.t = lag_read_number(in);
    p.y = lag_read_finite(in, 2 * (int64_t)e->nq + 1);
    p.parameters = lag_read_finite(in, e->np);
    p.atol = lag_read_finite(in, 2 * (int64_t)e->nq + 1);
    p.kind = lag_read_integers(in, e->nq, 0, e->nq);
    p.rank = lag_read_int(in, 0, e->nc < e->nq ? e->nc : e->nq);
    p.sizes = lag_read_finite(in, e->nq);
    p.lengths = lag_read_finite(in, e->nc);
    p.plain_lengths = lag_read_finite(in, e->nc);
    p.watching = lag_read_int(in, LAG_IGNORE, LAG_STOP);
    p.detecting = lag_read_int(in, 0, 1);
    p.refinable = lag_read_int(in, 0, 1);
    p.times = lag_read_numbers(in, &p.times_count);
    if (lag_read_word(in) != p.times_count)
        lag_reject(in, LAG_MODEL_SIZES);
    lag_read_nothing(in); /* the block is the caller's */
    p.block_rows = lag_read_int(in, 0, INT32_MAX);
    p.extra = lag_read_count(in);
    p.directions = lag_read_int(in, 0, 0);
    p.kernel = lag_read_int(in, LAG_PORTABLE, LAG_PORTABLE);
    return p;
}

/* Whether numbers increase, or do not decrease. */
static int increase(const double *x, int64_t n, int strictly)
{
    for (int64_t i = 1; i < n; ++i)
        if (strictly ? !(x[i] > x[i - 1]) : !(x[i] >= x[i - 1]))
            return 0;
    return 1;
}

static lag_function function(lag_reader *in, int np)
{
    lag_function f = {0};
    int64_t knots;
    f.first = lag_read_int(in, 0, np);
    f.degree = lag_read_int(in, 0, HIGHEST_DEGREE);
    f.count = lag_read_count(in);
    f.knots = lag_read_any(in, &knots);
    f.origins = lag_read_finite(in, f.count);
    f.coefficients = lag_read_finite(in, f.count * (f.degree + 1));
    f.period = lag_read_one(in);
    if (in->status != LAG_MODEL_READ)
        return f;
    if (f.count < 1 || knots != f.count || (int64_t)f.first + f.degree + 2 > np)
        lag_reject(in, LAG_MODEL_SIZES);
    else if (isnan(f.knots[0]) || f.knots[0] == INFINITY || (f.count > 1 && !isfinite(f.knots[f.count - 1]))
             || !increase(f.knots, f.count, 0) || !(f.period >= 0.0) || (f.period > 0.0 && !isfinite(f.knots[0])))
        lag_reject(in, LAG_MODEL_NUMBER);
    return f;
}

/* Whether starts ascend from 0 to a number. */
static int ascend(const int32_t *start, int n, int64_t to)
{
    for (int k = 0; k < n; ++k)
        if (start[k] > start[k + 1])
            return 0;
    return start[0] == 0 && start[n] == to;
}

/* The starts of n rows, whose number of entries goes to *entries. */
static const int32_t *starts(lag_reader *in, int n, int *entries)
{
    const int32_t *start = lag_read_integers(in, n + INT64_C(1), 0, INT32_MAX);
    *entries = in->status == LAG_MODEL_READ ? start[n] : 0;
    if (in->status == LAG_MODEL_READ && !ascend(start, n, *entries))
        lag_reject(in, LAG_MODEL_INDEX);
    return start;
}

static lag_elimination elimination(lag_reader *in, const lag_equations *e, int rank)
{
    lag_elimination made = {0};
    int entries = 0;
    const int n = made.n = lag_read_int(in, e->nq + rank, e->nq + rank);
    made.order = lag_read_integers(in, n, 0, e->nq + e->nc);
    made.paired = lag_read_integers(in, n, 0, 2);
    made.start = starts(in, n, &entries);
    made.row = lag_read_integers(in, entries, 0, n);
    made.mass_targets = lag_read_integers(in, e->nm, -1, 2 * (int64_t)n + entries);
    made.jacobian_targets = lag_read_integers(in, e->nb, -1, 2 * (int64_t)n + entries);
    /* a pair of pivots has two columns of equal length, and no other pair in it */
    for (int k = 0; in->status == LAG_MODEL_READ && k < n; ++k)
        if (made.paired[k] && (k + 1 == n || made.paired[k + 1]
                               || made.start[k + 2] - made.start[k + 1] != made.start[k + 1] - made.start[k]))
            lag_reject(in, LAG_MODEL_INDEX);
    if (in->status == LAG_MODEL_READ && !lag_ldl_closed(&made))
        lag_reject(in, LAG_MODEL_INDEX);
    return made;
}

/* The dynamics; unrolled, with the outputs, and the space for other right sides, that this needs. */
static lag_program dynamics(lag_reader *in, const lag_equations *e, int unrolled)
{
    const lag_system s = {.nq = e->nq, .nc = e->nc, .nh = e->nh, .nm = e->nm, .nb = e->nb};
    const int64_t others = e->nq + 2 * (int64_t)e->nc;
    const lag_program d = lag_read_program(
        in, 1 + 2 * (int64_t)e->nq + e->np,
        unrolled ? lag_first_others(&s) + 2 * (int64_t)e->nq + e->nc : lag_first_power(&s) + INT64_C(1));
    if (!unrolled || in->status != LAG_MODEL_READ)
        return d;
    for (int i = 0; i < 3; ++i)
        if (!d.deferred[i].length)
            lag_reject(in, LAG_MODEL_OUTPUTS);
    if (d.register_count < d.inputs + others)
        lag_reject(in, LAG_MODEL_OUTPUTS);
    return d;
}

static lag_series_program series(lag_reader *in, const lag_equations *e)
{
    lag_series_program s = {0};
    s.values = lag_read_program(in, 1 + 2 * (int64_t)e->nq + e->np, 0);
    s.stream = lag_read_stream(in);
    s.convolutions = lag_read_count(in);
    s.order = lag_read_count(in);
    s.invariant = lag_read_count(in);
    s.numbers = lag_read_count(in);
    int64_t begins;
    s.begins = lag_read_list(in, &begins);
    s.begin_count = lag_read_count(in);
    s.origin = lag_read_count(in);
    s.layer = lag_read_count(in);
    s.state = lag_read_integers(in, 2 * (int64_t)e->nq + 2, 0, INT32_MAX);
    s.size = lag_read_count(in);
    if (in->status == LAG_MODEL_READ && (begins != s.begin_count || !lag_series_is_valid(&s, e->nq)))
        lag_reject(in, LAG_MODEL_PROGRAM);
    return s;
}

/* A block of derivatives whose places are below a number. */
static lag_block block(lag_reader *in, int64_t below)
{
    lag_block made;
    int64_t n;
    made.places = lag_read_list(in, &n);
    if (n > INT32_MAX)
        lag_reject(in, LAG_MODEL_SIZES);
    made.count = in->status == LAG_MODEL_READ ? (int)n : 0;
    for (int i = 0; i < made.count; ++i)
        if (made.places[i] < 0 || made.places[i] >= below)
            lag_reject(in, LAG_MODEL_INDEX);
    return made;
}

static lag_jacobians jacobians(lag_reader *in, const lag_equations *e, int rank)
{
    lag_jacobians j = {0};
    const int64_t nq = e->nq, nc = e->nc, border = 2 * (nc - rank) * nc;
    j.program = lag_read_program(in, 1 + 3 * nq + nc + e->np, 0);
    j.force_position = block(in, nq * nq);
    j.force_velocity = block(in, nq * nq);
    j.rhs_position = block(in, nc * nq);
    j.rhs_velocity = block(in, nc * nq);
    j.power_position = block(in, nq);
    j.power_velocity = block(in, nq);
    const int n = j.n = lag_read_int(in, nq + 2 * nc - rank, nq + 2 * nc - rank);
    int entries = 0;
    j.start = starts(in, n, &entries);
    j.columns = lag_read_integers(in, entries, 0, n);
    const int64_t derivatives = (int64_t)j.force_position.count + j.force_velocity.count + j.rhs_position.count
                                + j.rhs_velocity.count;
    const int64_t parts = e->nm + 2 * (int64_t)e->nb + derivatives + border;
    j.parts = lag_read_integers(in, parts, 0, entries);
    j.parts_count = lag_read_word(in);
    if (in->status == LAG_MODEL_READ && j.parts_count != parts)
        lag_reject(in, LAG_MODEL_SIZES);
    if (in->status == LAG_MODEL_READ
        && j.program.output_count < derivatives + j.power_position.count + j.power_velocity.count + nq + nc + 1)
        lag_reject(in, LAG_MODEL_OUTPUTS);
    return j;
}

static lag_method_pivots pivots(lag_reader *in, const lag_model *model)
{
    lag_method_pivots made = {0};
    lag_pivots p = {0};
    const int n = model->jacobians.n;
    int entries = 0;
    made.method = lag_read_count(in);
    p.n = lag_read_int(in, n, n);
    p.row = lag_read_integers(in, n, 0, n);
    p.column = lag_read_integers(in, n, 0, n);
    p.start = starts(in, n, &entries);
    p.columns = lag_read_integers(in, entries, 0, n);
    p.diagonal = lag_read_integers(in, n, 0, entries);
    p.places = lag_read_integers(in, model->jacobians.start ? model->jacobians.start[n] : 0, 0, entries);
    made.pivots = p;
    if (in->status != LAG_MODEL_READ)
        return made;
    for (int i = 0; i < n; ++i)
        if (p.diagonal[i] < p.start[i] || p.diagonal[i] >= p.start[i + 1])
            lag_reject(in, LAG_MODEL_INDEX);
    return made;
}

static lag_switching_rules rules(lag_reader *in, const lag_equations *e)
{
    lag_switching_rules r = {0};
    const int64_t state = 1 + 2 * (int64_t)e->nq + e->np;
    r.rows = lag_read_count(in);
    r.exported = lag_read_int(in, 0, r.rows);
    r.nc = lag_read_int(in, e->nc + r.rows, e->nc + r.rows);
    if (r.rows > LAG_MODEL_LARGEST)
        lag_reject(in, LAG_MODEL_SIZES);
    const int64_t n = r.rows, forces = state + e->nq + r.nc;
    r.constraint = lag_read_integers(in, n, 0, r.nc);
    r.base = lag_read_integers(in, e->nc, 0, r.nc);
    r.law = lag_read_integers(in, n, LAG_UNILATERAL, LAG_FREE + 1);
    r.limit = lag_read_integers(in, n, -1, INT32_MAX);
    r.normal = lag_read_integers(in, n, -1, n);
    r.place = lag_read_integers(in, n, -1, n);
    r.sign = lag_read_finite(in, n);
    r.active = lag_read_integers(in, n, 0, 2);
    r.friction = lag_read_integers(in, n, -1, INT32_MAX);
    r.restitution = lag_read_integers(in, n, -1, INT32_MAX);
    r.nb = lag_read_count(in);
    r.nh = lag_read_int(in, 0, n);
    r.row = lag_read_integers(in, r.nb, 0, n);
    r.column = lag_read_integers(in, r.nb, 0, e->nq);
    r.functions = lag_read_program(in, state, n ? 2 * (int64_t)r.nh + r.nb + 3 * n : 0);
    r.gaps = lag_read_program(in, state, r.nh);
    r.signs = lag_read_count(in);
    r.sign_functions = lag_read_program(in, forces + r.signs, 2 * (int64_t)r.signs);
    r.limits = lag_read_program(in, forces + r.signs, 0);
    r.nl = lag_read_count(in);
    r.pattern_count = lag_read_count(in);
    r.pattern_limit = lag_read_integers(in, r.pattern_count, 0, r.nl);
    r.pattern_row = lag_read_integers(in, r.pattern_count, 0, n);
    r.impact = lag_read_program(in, state, 0);
    r.nf = lag_read_count(in);
    r.force_count = lag_read_count(in);
    r.force_coordinate = lag_read_integers(in, r.nf, 0, e->nq);
    r.force_row = lag_read_integers(in, r.force_count, 0, r.nf);
    r.force_constraint = lag_read_integers(in, r.force_count, 0, r.nc);
    r.forces = lag_read_program(in, forces + r.signs, (int64_t)r.nf + r.force_count);
    r.conditions = lag_read_count(in);
    r.force_conditions = lag_read_count(in);
    r.condition_functions = lag_read_program(in, state, r.conditions);
    r.force_condition_functions = lag_read_program(in, forces + r.signs, r.force_conditions);
    r.either = lag_read_integers(in, (int64_t)r.conditions + r.force_conditions, 0, 2);
    r.time = lag_read_integers(in, (int64_t)r.conditions + r.force_conditions, 0, 3);
    r.clocks = lag_read_count(in);
    r.ticks = lag_read_finite(in, 3 * (int64_t)r.clocks);
    r.most = lag_read_integers(in, r.clocks, 0, INT32_MAX);
    r.reported = lag_read_integers(in, CHANGES * n, 0, 2);
    r.kinks = lag_read_count(in);
    r.first_branch = lag_read_int(in, 0, (int64_t)e->np - r.kinks);
    r.whole = lag_read_integers(in, r.kinks, -1, 2);
    r.of_time = lag_read_integers(in, r.kinks, 0, 2);
    r.kink_functions = lag_read_program(in, state, 2 * (int64_t)r.kinks);
    lag_read_nothing(in); /* the log */
    lag_read_nothing(in);
    if (in->status != LAG_MODEL_READ)
        return r;
    if (r.limits.output_count < 2 * ((int64_t)r.nl + r.pattern_count))
        lag_reject(in, LAG_MODEL_OUTPUTS);
    for (int i = 0; i < r.rows; ++i) {
        const int unilateral = r.law[i] == LAG_UNILATERAL, limited = r.law[i] == LAG_LIMITED;
        if (fabs(r.sign[i]) != 1.0)
            lag_reject(in, LAG_MODEL_NUMBER);
        if (r.place[i] >= r.nh || (unilateral && r.place[i] < 0) || limited != (r.limit[i] >= 0) || r.limit[i] >= r.nl
            || r.friction[i] >= r.impact.output_count || r.restitution[i] >= r.impact.output_count
            || (limited && r.friction[i] < 0) || (unilateral && r.restitution[i] < 0) || r.normal[i] == i)
            lag_reject(in, LAG_MODEL_INDEX);
    }
    return r;
}

static lag_event event(lag_reader *in, const lag_model *model)
{
    const lag_switching_rules *r = &model->rules;
    const int nq = model->equations.nq;
    lag_event e = {0};
    e.condition = lag_read_int(in, -1, (int64_t)r->conditions + r->force_conditions - 1);
    e.clock = lag_read_int(in, -1, (int64_t)r->clocks - 1);
    e.constraint = lag_read_int(in, -1, (int64_t)r->nc - 1);
    e.change = lag_read_int(in, 0, CHANGES - 1);
    e.times = lag_read_count(in);
    e.first = lag_read_count(in);
    e.target_count = lag_read_count(in);
    e.kind = lag_read_integers(in, e.target_count, 0, 3);
    e.target = lag_read_integers(in, e.target_count, 0, INT32_MAX);
    e.displaces = lag_read_int(in, 0, 1);
    e.impulse_count = lag_read_count(in);
    e.impulse = lag_read_integers(in, e.impulse_count, 0, nq);
    e.release_count = lag_read_count(in);
    e.engage_count = lag_read_count(in);
    e.release = lag_read_integers(in, e.release_count, 0, r->exported);
    e.engage = lag_read_integers(in, e.engage_count, 0, r->exported);
    e.stops = lag_read_int(in, 0, 1);
    for (int i = 0; in->status == LAG_MODEL_READ && i < e.target_count; ++i)
        if (e.target[i] >= (e.kind[i] == 2 ? r->first_branch : nq))
            lag_reject(in, LAG_MODEL_INDEX);
    if ((int64_t)e.first + e.target_count + e.impulse_count > model->actions.output_count)
        lag_reject(in, LAG_MODEL_OUTPUTS);
    return e;
}

/* Memory for a number of things, each of some words at least, that the data have. */
static void *room(lag_reader *in, lag_pool *pool, int count, size_t size)
{
    if (count > in->words)
        lag_reject(in, LAG_MODEL_LENGTH);
    void *made = in->status == LAG_MODEL_READ ? lag_get(pool, (size_t)count, size) : NULL;
    if (pool->failed)
        lag_reject(in, LAG_MODEL_MEMORY);
    return made;
}

/* What adjustments need. */
static void read_whole(lag_reader *in, lag_model *m)
{
    lag_equations *e = &m->whole;
    *e = equations(in);
    m->mass = lag_read_program(in, 1 + 2 * (int64_t)e->nq + e->np, e->nm);
    if (in->status != LAG_MODEL_READ)
        return;
    if (!(m->contents & LAG_MODEL_SWITCHING) || e->nq != m->equations.nq || e->nc != m->rules.nc
        || e->np != m->equations.np - m->rules.kinks)
        lag_reject(in, LAG_MODEL_SIZES);
    if (e->constraint.output_count < 2 * (int64_t)e->nh + e->nb + 3 * (int64_t)e->nc)
        lag_reject(in, LAG_MODEL_OUTPUTS);
}

/* The parts of the model, in their order. */
static void read_parts(lag_reader *in, lag_pool *pool, lag_model *m)
{
    const int all = LAG_MODEL_PLAIN | LAG_MODEL_LOOP | LAG_MODEL_UNROLLED | LAG_MODEL_TIME | LAG_MODEL_SERIES
                    | LAG_MODEL_JACOBIANS | LAG_MODEL_SWITCHING | LAG_MODEL_RECURSIVE | LAG_MODEL_ADJUSTS;
    const int recursive = LAG_MODEL_PLAIN | LAG_MODEL_UNROLLED;
    const int has = m->contents = lag_read_int(in, 0, all);
    const lag_equations *e = &m->equations;
    m->unroll_after = lag_read_word(in);
    m->equations = equations(in);
    m->problem = problem(in, e);
    const int left_out = e->nc - m->problem.rank;
    if (has & LAG_MODEL_TANGENT
        || (has & LAG_MODEL_RECURSIVE
            && ((has & recursive) != recursive || has & LAG_MODEL_SERIES || left_out)))
        lag_reject(in, LAG_MODEL_SIZES);
    if (!(has & (LAG_MODEL_PLAIN | LAG_MODEL_UNROLLED)) || (has & LAG_MODEL_LOOP && !(has & LAG_MODEL_PLAIN))
        || (has & LAG_MODEL_SERIES && !(has & LAG_MODEL_UNROLLED)) || m->unroll_after < 0)
        lag_reject(in, LAG_MODEL_SIZES);
    m->breaks = lag_read_numbers(in, &m->break_count);
    if (in->status == LAG_MODEL_READ && !increase(m->breaks, m->break_count, 1))
        lag_reject(in, LAG_MODEL_NUMBER);
    m->function_count = lag_read_count(in);
    lag_function *functions = room(in, pool, m->function_count, sizeof *functions);
    for (int i = 0; in->status == LAG_MODEL_READ && i < m->function_count; ++i)
        functions[i] = function(in, e->np);
    m->functions = functions;
    if (left_out && has & (LAG_MODEL_LOOP | LAG_MODEL_UNROLLED))
        m->left_out = lag_read_integers(in, left_out, 0, e->nc);
    if (has & LAG_MODEL_PLAIN)
        m->dynamics = dynamics(in, e, 0);
    if (has & LAG_MODEL_LOOP)
        m->elimination = elimination(in, e, m->problem.rank);
    if (has & LAG_MODEL_UNROLLED)
        m->unrolled = dynamics(in, e, 1);
    if (has & LAG_MODEL_TIME)
        m->explicit_time = lag_read_program(in, 1 + 2 * (int64_t)e->nq + e->np, 0);
    if (has & LAG_MODEL_SERIES)
        m->series = series(in, e);
    if (has & LAG_MODEL_JACOBIANS) {
        m->jacobians = jacobians(in, e, m->problem.rank);
        m->pivots_count = lag_read_count(in);
        lag_method_pivots *orders = room(in, pool, m->pivots_count, sizeof *orders);
        for (int i = 0; in->status == LAG_MODEL_READ && i < m->pivots_count; ++i)
            orders[i] = pivots(in, m);
        m->pivots = orders;
    }
    if (has & LAG_MODEL_SWITCHING) {
        m->rules = rules(in, e);
        const int64_t forces = 1 + 3 * (int64_t)e->nq + m->rules.nc + e->np;
        m->actions = lag_read_program(in, forces, 0);
        m->energy = lag_read_program(in, forces, 1);
        m->event_count = lag_read_count(in);
        lag_event *events = room(in, pool, m->event_count, sizeof *events);
        for (int i = 0; in->status == LAG_MODEL_READ && i < m->event_count; ++i)
            events[i] = event(in, m);
        m->events = events;
    }
    if (has & LAG_MODEL_ADJUSTS)
        read_whole(in, m);
    if (m->problem.extra != m->rules.rows)
        lag_reject(in, LAG_MODEL_SIZES);
}

int lag_read_model(const lag_memory *memory, const void *data, int64_t bytes, lag_model *model)
{
    lag_reader in = {.at = data, .words = bytes / 8, .status = LAG_MODEL_READ};
    *model = (lag_model){0};
    if (bytes < 24 || bytes % 8 || (uintptr_t)data % sizeof(double))
        return LAG_MODEL_FORMAT;
    if (lag_read_word(&in) != LAG_MODEL_MAGIC || lag_read_word(&in) != LAG_MODEL_VERSION)
        return LAG_MODEL_FORMAT;
    if (lag_read_word(&in) != bytes / 8)
        return LAG_MODEL_LENGTH;
    lag_pool pool = lag_pool_of(memory), *owned = lag_get(&pool, 1, sizeof pool);
    if (!owned)
        return LAG_MODEL_MEMORY;
    read_parts(&in, &pool, model);
    if (in.status == LAG_MODEL_READ && in.words)
        lag_reject(&in, LAG_MODEL_LENGTH);
    *owned = pool;
    model->owned = owned;
    if (in.status != LAG_MODEL_READ)
        lag_release_model(model);
    return in.status;
}

void lag_release_model(lag_model *model)
{
    if (!model->owned)
        return;
    lag_pool pool = *(lag_pool *)model->owned; /* it is allocated in it */
    lag_release(&pool);
    model->owned = NULL;
}
