/* Samples: taken from the dense output of the steps in the lanes, then brought onto the constraints
 * eight at a time for each run; see sample.c for one. */

#define TOGETHER 64         /* number of samples of a run that are collected */

/* The address of a sample of a lane's run. */
static double *batch_row(const lag_batch *s, int l, int64_t sample)
{
    const int64_t width = lag_sample_size(s->system);
    return s->samples + (s->slot[l] * s->times_count + sample) * width;
}

/* Write t, q, v and W of a lane's next sample in a step of size h, and h times v' of its dense output, which are 0 and NULL at
 * the start; y and slope are of lanes. */
static void batch_take(lag_batch *s, int l, double h, const double *y, const double *slope)
{
    const int moving = 2 * s->system->nq;
    double *row = batch_row(s, l, s->times_next[l]);
    row[0] = s->times[s->times_next[l]];
    for (int i = 0; i < moving; ++i)
        row[lag_sample_q(s->system) + i] = y[i * LAG_LANES + l];
    for (int i = 0; i < s->system->nq; ++i)
        row[lag_sample_a(s->system) + i] = slope ? slope[i * LAG_LANES + l] : 0.0;
    row[lag_sample_work(s->system)] = y[moving * LAG_LANES + l];
    s->sample_steps[s->slot[l] * s->times_count + s->times_next[l]] = h;
    ++s->times_next[l];
}

static int batch_due(const lag_batch *s, int l, double end)
{
    return s->times_next[l] < s->times_count && s->times[s->times_next[l]] <= end;
}

/* Take the samples in the steps of size h of some lanes. */
static void batch_sample_steps(lag_batch *s, int lanes, const double *h, const double *end)
{
    double x[LAG_LANES] = {0.0};
    int due = 0;
    EACH_LANE (l)
        if (HAS(lanes, l) && batch_due(s, l, end[l])) {
            due |= 1 << l;
            s->counts[3 * s->run[l] + 2] += DOP_ALL_STAGES - DOP_STAGES - 1;
        }
    if (!due)
        return;
    batch_dense(s, h);
    while (due) {
        EACH_LANE (l)
            if (HAS(due, l))
                x[l] = (s->times[s->times_next[l]] - s->t[l]) / h[l];
        batch_dense_at(s, x, s->dense_y);
        batch_dense_slope(s, x, s->dense_slope);
        EACH_LANE (l)
            if (HAS(due, l)) {
                batch_take(s, l, h[l], s->dense_y, s->dense_slope);
                if (!batch_due(s, l, end[l]))
                    due &= ~(1 << l);
            }
    }
}

/* Whether the dense output of a lane's run strays at sample i of its slot, where a is now known: lag_strays for one. */
static int batch_strays(const lag_batch *s, int l, int64_t sample, const double *x, int i)
{
    const int nq = s->system->nq;
    const double *row = batch_row(s, l, sample), *slope = row + lag_sample_a(s->system);
    const double *v = row + lag_sample_q(s->system) + nq, h = s->sample_steps[s->slot[l] * s->times_count + sample];
    double square = 0.0;
    for (int m = 0; m < nq; ++m) {
        const double tolerance = s->atol[(nq + m) * LAG_LANES + l] + s->settings->rtol * fabs(v[m]);
        const double off = (slope[m] - h * x[m * LAG_LANES + i]) / tolerance;
        square += off * off;
    }
    return square > MOST_STRAY * MOST_STRAY * nq;
}

/* Copy the parameters and scales of a lane to all lanes of the samples. */
static void batch_spread(lag_batch *s, int l)
{
    const lag_octet *from = &s->moving, *to = &s->sampled;
    const int first = lag_sample_a(s->system), last = first + s->parameters_count;
    EACH_PART (k)
        for (int i = first; i < last; ++i) {
            AT(to->dynamics.registers + i * LAG_LANES + k) =
                all(from->dynamics.registers[i * LAG_LANES + l]);
            AT(to->constraint.registers + i * LAG_LANES + k) =
                all(from->constraint.registers[i * LAG_LANES + l]);
        }
    batch_run(to->dynamics.prelude, to->dynamics.registers);
    batch_run(to->constraint.prelude, to->constraint.registers);
}

/* Bring `count` samples, at most eight, of a lane's run onto the constraints, and find their a and
 * lambda. Returns 0, or 1 where that fails, or the dense output strays. */
static int batch_complete(lag_batch *s, int l, int64_t first, int count)
{
    const lag_system *system = s->system;
    const lag_octet *o = &s->sampled;
    const int nq = system->nq, nc = system->nc, n = nq + nc;
    double t[LAG_LANES], *y = s->dense_y, total = 0.0;
    EACH_LANE (i) {
        const double *row = batch_row(s, l, first + (i < count ? i : count - 1));
        t[i] = row[0];
        for (int m = 0; m < 2 * nq; ++m)
            y[m * LAG_LANES + i] = row[lag_sample_q(system) + m];
    }
    if (nc) {
        for (int i = 0; i < system->nh * LAG_LANES; ++i)
            o->scale_position[i] = s->moving.scale_position[i / LAG_LANES * LAG_LANES + l];
        for (int i = 0; i < nc * LAG_LANES; ++i)
            o->scale_velocity[i] = s->moving.scale_velocity[i / LAG_LANES * LAG_LANES + l];
        batch_evaluate(&o->dynamics, system, t, y, LAG_FACTORS);
        memcpy(s->before, y, 2 * (size_t)nq * sizeof t);
        const int failed = batch_project(o, t, y, ALL_LANES);
        EACH_LANE (i)
            if (HAS(failed, i)
                && (!lag_left_out(s->single) || batch_project_by_all_rows(s, l, t[i], s->before, i, y)))
                return 1;
    }
    batch_evaluate(&o->dynamics, system, t, y, LAG_ALL);
    batch_refined(o, o->x);
    const int inaccurate = nc ? batch_inaccurate(o, o->x, s->settings->rtol) : 0;
    batch_respond(o);
    for (int i = 0; i < count; ++i) {
        if (HAS(inaccurate, i) || batch_strays(s, l, first + i, o->x, i))
            return 1;
        double *row = batch_row(s, l, first + i);
        double *state = row + lag_sample_q(system), *unknowns = row + lag_sample_a(system);
        for (int m = 0; m < 2 * nq; ++m)
            state[m] = y[m * LAG_LANES + i];
        for (int m = 0; m < n; ++m) {
            const double x = o->x[m * LAG_LANES + i];
            unknowns[m] = m < nq ? x : -x;
            total += x;
        }
        if (batch_share(s, l, i, unknowns + nq) && batch_accelerate_by_all_rows(s, l, t[i], y, i, unknowns))
            return 1;
    }
    return !isfinite(total);
}

/* Complete the samples of a lane's run that can be done eight at a time, or all that were taken.
 * Returns 0, or 1 where that fails. */
static int batch_complete_samples(lag_batch *s, int l, int all_taken)
{
    int64_t waiting = s->times_next[l] - s->samples_done[l];
    if (!waiting || (waiting < TOGETHER && !all_taken))
        return 0;
    batch_spread(s, l);
    while (waiting >= LAG_LANES || (all_taken && waiting)) {
        const int count = waiting < LAG_LANES ? (int)waiting : LAG_LANES;
        if (batch_complete(s, l, s->samples_done[l], count))
            return 1;
        s->samples_done[l] += count;
        s->counts[3 * s->run[l] + 2] += count;
        waiting -= count;
    }
    return 0;
}
