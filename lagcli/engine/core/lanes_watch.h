/* The watch for singular configurations in eight lanes: what shows at the stages of a step is kept
 * lane by lane; what raises an alarm is looked at by the functions of watch.c, one lane at a time. */

/* The square of what the pivots keep, and the rows of B of their lengths: watch.c has it for one. */
static void lanes_watch_stage(lag_lanes *s)
{
    const lag_system *system = s->system;
    const lag_lane_tape *d = &s->moving.dynamics;
    const lag_ldl *f = s->moving.ldl;
    const int n = f->n;
    const int32_t *diagonal = d->outputs + at_factors(system);
    const int32_t *beside = diagonal + n, *lower = beside + n;
    const double *r = d->registers;
    double *taken = s->moving.work;
    EACH_PART (k) {
        vec least = all(1.0);
        for (int i = 0; i < n; ++i)
            AT(taken + i * LAG_LANES + k) = all(0.0);
        for (int i = 0; i < n; ++i) {
            const vec d0 = READ(r + diagonal[i] + k);
            vec part;
            if (f->paired[i]) {
                const vec d1 = READ(r + diagonal[i + 1] + k), off = READ(r + beside[i] + k);
                const vec inverse = d0 * d1 - off * off;
                const vec a = magnitude(d1 / inverse), b = magnitude(2.0 * off / inverse);
                const vec c = magnitude(d0 / inverse);
                const int shift = f->start[i + 1] - f->start[i];
                for (int e = f->start[i]; e < f->start[i + 1]; ++e) {
                    const vec x = READ(r + lower[e] + k), y = READ(r + lower[e + shift] + k);
                    AT(taken + f->row[e] * LAG_LANES + k) += a * x * x + b * magnitude(x * y)
                                                             + c * y * y;
                }
                part = magnitude(inverse) / (magnitude(d0 * d1) + off * off);
                ++i;
            } else {
                const vec pivot = magnitude(1.0 / d0);
                for (int e = f->start[i]; e < f->start[i + 1]; ++e) {
                    const vec x = READ(r + lower[e] + k);
                    AT(taken + f->row[e] * LAG_LANES + k) += x * x * pivot;
                }
                part = 2.0 * pivot / (pivot + READ(taken + i * LAG_LANES + k));
            }
            least = choose(part >= least, least, part); /* also where it is undefined */
        }
        for (int i = 0; i < system->nc; ++i)
            AT(taken + i * LAG_LANES + k) = all(0.0);
        for (int i = 0; i < system->nb; ++i) {
            const vec x = READ(OUTPUT(d, at_jacobian(system) + i) + k);
            AT(taken + system->jacobian_row[i] * LAG_LANES + k) += x * x;
        }
        for (int i = 0; i < system->nc; ++i) {
            const vec length = READ(s->lengths + i * LAG_LANES + k);
            const vec part = READ(taken + i * LAG_LANES + k) / (length * length);
            least = choose(part >= least, least, part);
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
    const int n = lag_size(system), inputs = 1 + 2 * system->nq;
    single_parameters(&s->moving.dynamics, &run->system->dynamics, s->single_dynamics_prelude,
                      inputs, s->parameters_count, l);
    single_parameters(&s->moving.constraint, &run->system->constraint,
                      s->single_constraint_prelude, inputs, s->parameters_count, l);
    run->t = s->t[l];
    for (int i = 0; i < n; ++i)
        run->y[i] = y[i * LAG_LANES + l];
    for (int i = 0; i < system->nc; ++i)
        run->lengths[i] = s->lengths[i * LAG_LANES + l];
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
