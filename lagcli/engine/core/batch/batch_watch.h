/* The watch for singular configurations in eight lanes: what shows at the stages of a step is kept
 * lane by lane; what raises an alarm is looked at by the functions of watch.c, one lane at a time. */

#define LOOKING 0.1         /* part of the largest pivot above which a single run that approaches a singular configuration
                             * does not look ahead: below 0.04 of the largest singular value, of which the least pivot is
                             * at most the double (CERTAIN) */

/* Begin to monitor a step in all lanes. */
static void batch_watch_step(lag_batch *s)
{
    EACH_LANE (l) {
        s->path_length[l] = s->path_speed[l] = 0.0;
        s->path_t[l] = s->t[l];
    }
    memcpy(s->path_last, s->path_begin, (size_t)s->system->nb * LAG_LANES * sizeof(double));
}

/* Keep B of the dynamics tape, at its time, and its distance from the stage before. */
static void batch_extend_path(lag_batch *s)
{
    const lag_system *system = s->system;
    const lag_batch_tape *d = &s->moving.dynamics;
    EACH_PART (k) {
        vec sum = all(0.0);
        for (int i = 0; i < system->nb; ++i) {
            double *last = s->path_last + i * LAG_LANES + k;
            const vec x = READ(OUTPUT(d, lag_first_jacobian(system) + i) + k);
            const vec part = (x - READ(last)) / READ(s->lengths + system->jacobian_row[i] * LAG_LANES + k);
            sum += part * part;
            AT(last) = x;
        }
        const vec t = READ(d->registers + k), length = root(sum);
        const vec between = magnitude(t - READ(s->path_t + k)), speed = READ(s->path_speed + k);
        AT(s->path_length + k) += length;
        AT(s->path_speed + k) = choose(between > all(0.0), larger(length / between, speed), speed);
        AT(s->path_t + k) = t;
    }
}

/* Keep what shows at a stage that B may be losing rank. */
static void batch_watch_stage(lag_batch *s, int stage)
{
    const lag_batch_tape *d = &s->moving.dynamics;
    if (lag_many_rows(s->single)) {
        batch_tape_run(d, &d->deferred[0]);
        memcpy(s->determinant + stage * LAG_LANES, OUTPUT(d, lag_first_determinant(s->system)),
               LAG_LANES * sizeof(double));
    } else if (dop_watched[stage]) {
        batch_extend_path(s);
    }
}

/* ln |det| at the stages of a lane's last step, of size h. */
static lag_determinant batch_determinant(const lag_batch *s, int l, double h)
{
    lag_determinant made = {.begin = NAN, .by = LAG_BY_TAPE};
    for (int i = isnan(s->determinant[l]) ? 1 : 0; i <= DOP_STAGES; ++i) {
        made.t[made.count] = s->t[l] + (i < DOP_STAGES ? dop_c[i] : 1.0) * h;
        made.value[made.count++] = s->determinant[i * LAG_LANES + l];
    }
    return made;
}

/* Whether the stages of a lane's last step, of size h, indicate a singular configuration. */
static int batch_alarmed(lag_batch *s, int l, double h)
{
    if (!lag_many_rows(s->single)) {
        s->margin_at_end[l] = s->margin[l] - s->path_length[l];
        return !(s->margin_at_end[l] > CERTAIN * NEAR * s->largest_pivot[l]);
    }
    const lag_determinant d = batch_determinant(s, l, h);
    s->largest_step[l] = fmax(s->largest_step[l], h);
    return lag_slows(s->largest_step[l], h) || !lag_is_smooth_in_step(&d);
}

/* Set the parameters of a lane in the tapes of a single run. */
static void single_parameters(const lag_batch_tape *from, const lag_tape *to, int first, int count,
                              int l)
{
    for (int i = first; i < first + count; ++i)
        to->registers[i] = from->registers[i * LAG_LANES + l];
    to->registers[0] = NAN; /* no state yet */
    to->vectors->run(to->prelude, to->registers);
}

/* A single run with the parameters and the watch of a lane; y is its state. */
static lag_run *batch_single(const lag_batch *s, int l, const double *y)
{
    const lag_system *system = s->system;
    lag_run *run = s->single;
    const int n = lag_size(system), inputs = lag_sample_a(system);
    single_parameters(&s->moving.dynamics, &run->system.dynamics,
                      inputs, s->parameters_count, l);
    single_parameters(&s->moving.constraint, &run->system.constraint,
                      inputs, s->parameters_count, l);
    run->step.t = s->t[l];
    for (int i = 0; i < n; ++i)
        run->step.y[i] = y[i * LAG_LANES + l];
    for (int i = 0; i < system->nc; ++i)
        run->rows.lengths[i] = run->rows.plain_lengths[i] = s->lengths[i * LAG_LANES + l];
    run->watch.pivot = s->pivot[l];
    run->watch.largest_pivot = s->largest_pivot[l];
    run->watch.largest_step = s->largest_step[l];
    run->watch.approaching = 0;
    run->watch.path.length = s->path_length[l];
    run->watch.path.speed = s->path_speed[l];
    run->watch.path.margin = s->margin[l];
    run->rows.margin = s->enough[l];
    return run;
}

/* Begin to monitor at the initial state of a lane's run, which the dynamics tape holds. */
static void batch_watch_start(lag_batch *s, int l)
{
    for (int i = 0; i < s->system->nb; ++i)
        s->path_begin[i * LAG_LANES + l] = OUTPUT(&s->moving.dynamics, lag_first_jacobian(s->system) + i)[l];
    s->determinant[l] = NAN;
    s->pivot[l] = s->largest_pivot[l] = s->largest_step[l] = 0.0;
    lag_run *run = batch_single(s, l, s->y);
    s->pivot[l] = s->largest_pivot[l] = lag_least_pivot(run, run->step.t, run->step.y);
    s->margin[l] = CERTAIN * s->pivot[l];
}

/* Whether the step of size h that a lane takes, to y_new and projected, goes over or towards a
 * singular configuration; `alarmed`, or not. */
static int batch_singular(lag_batch *s, int l, double h, int alarmed)
{
    const int n = lag_size(s->system);
    if (!alarmed) {
        s->pivot[l] = s->largest_pivot[l];
        return 0;
    }
    lag_run *run = batch_single(s, l, s->projected);
    run->watch.determinant = batch_determinant(s, l, h);
    run->step.t_old = run->step.t;
    run->step.h_old = h;
    run->step.t += h;
    for (int i = 0; i < n; ++i) {
        run->step.y_old[i] = s->y[i * LAG_LANES + l];
        run->step.y_new[i] = s->y_new[i * LAG_LANES + l];
    }
    if (lag_stepped_over(run) || (lag_approaches(run) && run->watch.pivot < LOOKING * run->watch.largest_pivot))
        return 1;
    s->pivot[l] = run->watch.pivot;
    s->largest_pivot[l] = run->watch.largest_pivot;
    s->margin_at_end[l] = run->watch.path.margin_at_end;
    s->largest_step[l] = run->watch.largest_step;
    return 0;
}
