/* The watch for singular configurations in eight lanes: what shows at the stages of a step is kept
 * lane by lane; what raises an alarm is looked at by the functions of watch.c, one lane at a time. */

/* The square of what the pivots keep, and the rows of B of their lengths: watch.c has it for one. */
static void lanes_watch_stage(lag_lanes *s)
{
    const lag_system *system = s->system;
    const lag_lane_tape *d = &s->moving.dynamics;
    const int first = lag_first_kept(system), rows = first + s->single->kept_count - system->nc;
    lanes_run(d->later[0], d->registers);
    EACH_PART (k) {
        vec least = all(1.0);
        for (int i = first; i < rows + system->nc; ++i) {
            vec part = READ(OUTPUT(d, i) + k);
            if (i >= rows) {
                const vec length = READ(s->lengths + (i - rows) * LAG_LANES + k);
                part /= length * length;
            }
            least = choose(part >= least, least, part); /* also where it is undefined */
        }
        AT(s->kept + k) = smaller(least, READ(s->kept + k));
        AT(s->most_kept + k) = larger(least, READ(s->most_kept + k));
        AT(s->usually_kept + k) = larger(least, READ(s->usually_kept + k));
    }
}

/* Whether the stages of a lane's last step may have come near to a singular configuration. */
static int lanes_alarmed(const lag_lanes *s, int l)
{
    return !(s->kept[l] > NEAR * NEAR * s->usually_kept[l]
             && s->kept[l] >= STEADY * STEADY * s->most_kept[l]);
}

/* Give the parameters of a lane to the tapes of a single run. */
static void single_parameters(const lag_lane_tape *from, const lag_tape *to,
                              const int32_t *prelude, int first, int count, int l)
{
    for (int i = first; i < first + count; ++i)
        to->registers[i] = from->registers[i * LAG_LANES + l];
    to->registers[0] = NAN; /* no state yet */
    lag_stream_run(prelude, to->registers);
}

/* A single run with the parameters and the watch of a lane; y is its state. */
static lag_run *lanes_single(const lag_lanes *s, int l, const double *y)
{
    const lag_system *system = s->system;
    lag_run *run = s->single;
    const int n = lag_size(system), inputs = lag_sample_a(system);
    single_parameters(&s->moving.dynamics, &run->system->dynamics, s->single_dynamics_prelude,
                      inputs, s->parameters_count, l);
    single_parameters(&s->moving.constraint, &run->system->constraint,
                      s->single_constraint_prelude, inputs, s->parameters_count, l);
    run->t = s->t[l];
    for (int i = 0; i < n; ++i)
        run->y[i] = y[i * LAG_LANES + l];
    for (int i = 0; i < system->nc; ++i)
        run->lengths[i] = run->plain_lengths[i] = s->lengths[i * LAG_LANES + l];
    run->weakest = s->weakest[l];
    run->usual = s->usual[l];
    run->kept = sqrt(s->kept[l]);
    run->most_kept = sqrt(s->most_kept[l]);
    run->usually_kept = sqrt(s->usually_kept[l]);
    return run;
}

/* Measure the weakest pivot at the state of a lane from which its run begins. */
static void lanes_watch_start(lag_lanes *s, int l)
{
    s->weakest[l] = s->usual[l] = s->usually_kept[l] = 0.0;
    lag_run *run = lanes_single(s, l, s->y);
    s->weakest[l] = s->usual[l] = lag_weakest(run, run->t, run->y);
}

/* Whether the step of size h that a lane takes, to y_new and projected, goes over or towards a
 * singular configuration; `alarmed`, or not. */
static int lanes_singular(lag_lanes *s, int l, double h, int alarmed)
{
    const int n = lag_size(s->system);
    if (!alarmed) {
        s->weakest[l] = s->usual[l];
        return 0;
    }
    lag_run *run = lanes_single(s, l, s->projected);
    run->t_old = run->t;
    run->h_old = h;
    run->t += h;
    for (int i = 0; i < n; ++i) {
        run->y_old[i] = s->y[i * LAG_LANES + l];
        run->y_new[i] = s->y_new[i * LAG_LANES + l];
    }
    if (lag_goes_over(run) || lag_approaches(run))
        return 1;
    s->weakest[l] = run->weakest;
    s->usual[l] = run->usual;
    return 0;
}
