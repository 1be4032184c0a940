/* Absolute tolerances that follow the sizes, and the first step, in eight lanes; see sizes.c for one. */

/* The largest kinetic energy in some lanes, of the velocities in y, or h (of lanes) later, with the
 * dynamics tape's M. */
static void batch_sizes_energy(lag_batch *s, int lanes, const double *y, const double *h)
{
    const lag_system *system = s->system;
    const int nq = system->nq;
    if (s->single->tolerances.given[2 * nq] > 0.0)
        return;
    double *size = s->size + 2 * nq * LAG_LANES;
    EACH_PART (k) {
        vec sum = all(0.0);
        for (int m = 0; m < system->nm; ++m) {
            vec part = READ(OUTPUT(&s->moving.dynamics, m) + k);
            const int place[] = {system->mass_row[m], system->mass_column[m]};
            for (int side = 0; side < 2; ++side) {
                vec v = READ(y + (nq + place[side]) * LAG_LANES + k);
                if (h) {
                    const int i = place[side] * LAG_LANES + k;
                    const vec more =
                        READ(h + k) * (READ(s->acceleration_terms + i) + READ(s->future_acceleration + i));
                    v = choose(v < 0.0, v - more, v + more);
                }
                part *= v;
            }
            sum += part;
        }
        const vec largest = larger(0.5 * magnitude(sum), READ(size + k));
        AT(size + k) = choose(lanes_of(lanes, k), largest, READ(size + k));
    }
}

/* Forget the rounding errors that were found in a lane. */
static void batch_forget_noise(lag_batch *s, int l)
{
    s->noise_until[l] = 0;
    for (int m = 0; m < lag_size(s->system); ++m)
        s->noise[m * LAG_LANES + l] = 0.0;
}

/* Find A and R in some lanes: as single runs do, which may round up and down (sin and cos of the lanes
 * may not). */
static void batch_sizes_start(lag_batch *s, int lanes)
{
    const int nq = s->system->nq;
    EACH_LANE (l) {
        if (!HAS(lanes, l))
            continue;
        lag_run *run = batch_single(s, l, s->y);
        memset(run->tolerances.acceleration_terms, 0, (size_t)(nq + 1) * sizeof(double));
        memset(run->tolerances.future_acceleration, 0, (size_t)nq * sizeof(double));
        run->step.steps = 0;
        if (!lag_derivative(run, run->step.t, run->step.y, run->step.f))
            lag_sizes_start(run);
        for (int i = 0; i < nq; ++i) {
            s->acceleration_terms[i * LAG_LANES + l] = run->tolerances.acceleration_terms[i];
            s->future_acceleration[i * LAG_LANES + l] = run->tolerances.future_acceleration[i];
            s->emerging[i * LAG_LANES + l] = run->tolerances.emerging[i];
        }
        s->acceleration_terms[nq * LAG_LANES + l] = run->tolerances.acceleration_terms[nq];
        for (int m = 0; m < lag_size(s->system); ++m)
            s->rest[m * LAG_LANES + l] = run->tolerances.rest[m];
        batch_forget_noise(s, l);
    }
}

/* Raise the tolerances of the steps of some lanes, of sizes h to y_new, where rounding errors may account for the errors,
 * as lag_excuse_rounding does; s->strict keeps them. Returns the lanes in which any is raised. */
static int batch_excuse(lag_batch *s, int lanes, const double *h, int attempt)
{
    const int n = lag_size(s->system);
    int which = 0;
    EACH_LANE (l) {
        if (!HAS(lanes, l))
            continue;
        lag_run *run = batch_single(s, l, s->y);
        lag_tolerances *tolerances = &run->tolerances;
        tolerances->raised = 0;
        for (int m = 0; m < n; ++m) {
            run->step.y_new[m] = s->y_new[m * LAG_LANES + l];
            run->step.f[m] = s->stages[m * LAG_LANES + l];
            tolerances->atol[m] = s->strict[m * LAG_LANES + l];
            tolerances->noise[m] = s->noise[m * LAG_LANES + l];
            tolerances->rest[m] = s->rest[m * LAG_LANES + l];
        }
        for (int i = 0; i < s->system->nq; ++i)
            tolerances->emerging[i] = s->emerging[i * LAG_LANES + l];
        tolerances->size[2 * s->system->nq] = s->size[2 * s->system->nq * LAG_LANES + l];
        run->step.steps = s->counts[3 * s->run[l]];
        tolerances->noise_until = s->noise_until[l];
        which |= lag_excuse_rounding(run, h[l], attempt, NULL) << l;
        s->noise_until[l] = tolerances->noise_until;
        for (int m = 0; m < n; ++m) {
            s->atol[m * LAG_LANES + l] = tolerances->atol[m];
            s->noise[m * LAG_LANES + l] = tolerances->noise[m];
        }
    }
    return which;
}

/* In lanes whose steps are rejected, forget the rounding errors found in these steps, as lag_be_strict does. */
static void batch_be_strict(lag_batch *s, int lanes)
{
    EACH_LANE (l)
        if (HAS(lanes, l) && s->noise_until[l] == s->counts[3 * s->run[l]] + KNOWN)
            batch_forget_noise(s, l);
}

/* Multiply what they were raised by, as lag_scale_rounding does. */
static void batch_scale_rounding(lag_batch *s, double factor)
{
    EACH_PART (k)
        for (int m = k; m < lag_size(s->system) * LAG_LANES; m += LAG_LANES)
            AT(s->atol + m) = READ(s->strict + m) + factor * (READ(s->atol + m) - READ(s->strict + m));
}

/* Sizes and absolute tolerances for the next steps of some lanes. */
static void batch_sizes_update(lag_batch *s, int lanes)
{
    const lag_run *single = s->single;
    const int nq = s->system->nq, kinds = single->tolerances.kinds;
    const double length = TIMING * (s->settings->t_end - s->t_start), following = FOLLOWING * s->settings->rtol;
    EACH_PART (k) {
        const mask chosen = lanes_of(lanes, k);
        for (int i = 0; i < 2 * kinds; ++i)
            AT(s->largest + i * LAG_LANES + k) = all(0.0);
        for (int m = 0; m < 2 * nq; ++m) {
            const int kind = single->tolerances.kind[m % nq] + (m < nq ? 0 : kinds);
            double *largest = s->largest + kind * LAG_LANES + k, *kept = s->size + m * LAG_LANES + k;
            const vec size = larger(magnitude(READ(s->y + m * LAG_LANES + k)), READ(kept));
            AT(kept) = choose(chosen, size, READ(kept));
            AT(largest) = larger(size, READ(largest));
        }
        const vec speed = EMERGED * root(2.0 * READ(s->size + 2 * nq * LAG_LANES + k));
        for (int m = 0; m < 2 * nq; ++m) {
            double *atol = s->atol + m * LAG_LANES + k;
            const int i = m % nq * LAG_LANES + k;
            const vec h = READ(s->h + k);
            const vec noise = SUMMING * h * READ(s->acceleration_terms + i)
                              + length * READ(s->future_acceleration + i) + READ(s->emerging + i) * speed;
            vec tolerance = following * READ(s->size + m * LAG_LANES + k)
                        + ROUNDING * READ(s->size + m * LAG_LANES + k)
                        + (m < nq ? noise * h : noise) + NO_SIZE;
            if (single->tolerances.given[m] > 0.0)
                tolerance = all(single->tolerances.given[m]);
            AT(atol) = choose(chosen, tolerance, READ(atol));
        }
        const int w = 2 * nq * LAG_LANES + k;
        const vec size = larger(magnitude(READ(s->y + w)), READ(s->size + w));
        AT(s->size + w) = choose(chosen, size, READ(s->size + w));
        const vec work = READ(s->h + k) * READ(s->acceleration_terms + nq * LAG_LANES + k);
        const vec tolerance = single->tolerances.given[2 * nq] > 0.0 ? all(single->tolerances.given[2 * nq])
                                                      : following * larger(size, work) + NO_SIZE;
        AT(s->atol + w) = choose(chosen, tolerance, READ(s->atol + w));
    }
}

/* The first steps of some lanes: lag_first_step. */
static void batch_first_steps(lag_batch *s, int lanes)
{
    const int n8 = lag_size(s->system) * LAG_LANES;
    lag_first_step_rule rule[LAG_LANES];
    double h[LAG_LANES] = {0.0}, t[LAG_LANES];
    double *f = s->stages, *change = s->stages + DOP_STAGES * n8;
    batch_sizes_update(s, lanes);
    EACH_LANE (l)
        if (HAS(lanes, l)) {
            rule[l] = (lag_first_step_rule){
                .nq = s->system->nq, .stride = LAG_LANES, .kinds = s->single->tolerances.kinds,
                .kind = s->single->tolerances.kind, .y = s->y + l, .f = f + l,
                .acceleration_terms = s->acceleration_terms + l,
                .future_acceleration = s->future_acceleration + l,
                .largest = s->largest + l, .weight = s->before + l,
                .length = s->settings->t_end - s->t[l], .h_max = s->settings->max_step,
            };
            h[l] = lag_trial_step(&rule[l]);
        }
    EACH_PART (k) {
        AT(t + k) = READ(s->t + k) + READ(h + k);
        for (int m = k; m < n8; m += LAG_LANES)
            AT(s->y_new + m) = READ(s->y + m) + READ(h + k) * READ(f + m);
    }
    batch_evaluate(&s->moving.dynamics, s->system, t, s->y_new, LAG_ALL);
    batch_derivative(&s->moving, change);
    EACH_PART (k)
        for (int m = k; m < n8; m += LAG_LANES)
            AT(change + m) -= READ(f + m);
    EACH_LANE (l)
        if (HAS(lanes, l))
            s->h[l] = lag_chosen_step(&rule[l], change + l, h[l], s->settings->rtol, lag_dop853.order);
    batch_evaluate(&s->moving.dynamics, s->system, s->t, s->y, LAG_ALL);
    batch_sizes_energy(s, lanes, s->y, s->h);
    batch_sizes_update(s, lanes);
}
