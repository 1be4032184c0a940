/* Absolute tolerances that follow the sizes, and the first step, in eight lanes; see sizes.c for one. */

/* The largest kinetic energy in some lanes, of the velocities in y, or h (of lanes) later, with the
 * dynamics tape's M. */
static void lanes_sizes_energy(lag_lanes *s, int lanes, const double *y, const double *h)
{
    const lag_system *system = s->system;
    const int nq = system->nq;
    if (s->single->given[2 * nq] > 0.0)
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
                    const vec more = READ(h + k) * (READ(s->gross + i) + READ(s->later + i));
                    v = choose(v < 0.0, v - more, v + more);
                }
                part *= v;
            }
            sum += part;
        }
        const vec found = larger(0.5 * magnitude(sum), READ(size + k));
        AT(size + k) = choose(lanes_of(lanes, k), found, READ(size + k));
    }
}

/* y' at (t, y), in the step's last stage. */
static double *lanes_slope(lag_lanes *s, const double *t, const double *y)
{
    double *f = s->stages + DOP_STAGES * lag_size(s->system) * LAG_LANES;
    lanes_evaluate(&s->moving.dynamics, s->system, t, y, LAG_ALL);
    lanes_derivative(&s->moving, f);
    return f;
}

/* Raise R in some lanes to what the accelerations of coordinates at rest will be. */
static void lanes_look_ahead(lag_lanes *s, int lanes)
{
    const int nq = s->system->nq;
    for (int i = 0; i < LOOKS; ++i) {
        double t[LAG_LANES];
        EACH_LANE (l)
            t[l] = s->t[l] + (i + 0.5) / LOOKS * (s->t_end - s->t[l]);
        const double *f = lanes_slope(s, t, s->y);
        EACH_PART (k)
            for (int m = 0; m < nq; ++m) {
                const int q = m * LAG_LANES + k, v = q + nq * LAG_LANES;
                const vec a = magnitude(READ(f + v)), kept = READ(s->later + q);
                const mask chosen = lanes_of(lanes, k) & (READ(s->y + q) == 0.0)
                                    & (READ(s->y + v) == 0.0) & (READ(s->stages + v) == 0.0)
                                    & (a <= DBL_MAX);
                AT(s->later + q) = choose(chosen, larger(a, kept), kept);
            }
    }
}

/* Find A and R in some lanes, where y' at y is the first stage: lag_sizes_start. sin and cos of the
 * lanes rely on rounding to nearest; so a small change of the state shows A here. */
static void lanes_sizes_start(lag_lanes *s, int lanes)
{
    const int nq = s->system->nq;
    const lag_lane_tape *d = &s->moving.dynamics;
    int at_rest = 0;
    memcpy(s->before, s->y, (size_t)lag_size(s->system) * LAG_LANES * sizeof(double));
    for (int i = 0; i < 2 * nq; ++i) /* no two entries alike, lest their changes cancel too */
        EACH_PART (k)
            AT(s->before + i * LAG_LANES + k) *= 1.0 + PERTURBATION * cos(1.0 + i);
    const double *f = lanes_slope(s, s->t, s->before);
    double *forces = s->before, *inertia = s->largest + s->single->kinds * LAG_LANES;
    EACH_PART (k) {
        for (int i = 0; i < nq; ++i)
            AT(forces + i * LAG_LANES + k) = magnitude(READ(OUTPUT(d, lag_first_forcing(s->system) + i) + k));
        for (int m = 0; m < s->system->nm; ++m) {
            const vec a = READ(s->stages + (nq + s->system->mass_column[m]) * LAG_LANES + k);
            AT(forces + s->system->mass_row[m] * LAG_LANES + k) += magnitude(READ(OUTPUT(d, m) + k) * a);
        }
    }
    memset(s->largest, 0, 2 * (size_t)s->single->kinds * LAG_LANES * sizeof(double));
    EACH_PART (k) {
        const mask chosen = lanes_of(lanes, k);
        for (int i = 0; i < nq; ++i) {
            const int q = i * LAG_LANES + k, v = q + nq * LAG_LANES;
            double *largest = s->largest + s->single->kind[i] * LAG_LANES + k;
            const vec a = magnitude(READ(s->stages + v));
            const vec noise = magnitude(READ(f + v) - READ(s->stages + v)) / PERTURBATION;
            const vec gross = choose(noise <= DBL_MAX, larger(a, noise), a);
            AT(largest) = larger(gross, READ(largest));
            AT(s->later + q) = choose(chosen, all(0.0), READ(s->later + q));
            at_rest |= set_of((READ(s->y + q) == 0.0) & (READ(s->y + v) == 0.0) & (a == 0.0), k);
        }
        /* what balances: count_forces of sizes.c */
        for (int i = 0; i < nq; ++i)
            if (s->system->mass_diagonal[i] >= 0) {
                double *of_kind = inertia + s->single->kind[i] * LAG_LANES + k;
                AT(of_kind) = larger(READ(OUTPUT(d, s->system->mass_diagonal[i]) + k), READ(of_kind));
            }
        for (int i = 0; i < nq; ++i) {
            double *largest = s->largest + s->single->kind[i] * LAG_LANES + k;
            const vec balanced = READ(forces + i * LAG_LANES + k)
                                 / READ(inertia + s->single->kind[i] * LAG_LANES + k);
            const mask hidden = (READ(largest) < HIDDEN * balanced) & (balanced <= DBL_MAX);
            AT(largest) = choose(hidden, balanced, READ(largest));
        }
        for (int i = 0; i < nq; ++i) {
            const vec gross = READ(s->largest + s->single->kind[i] * LAG_LANES + k);
            AT(s->gross + i * LAG_LANES + k) = choose(chosen, gross, READ(s->gross + i * LAG_LANES + k));
        }
    }
    if (at_rest & lanes)
        lanes_look_ahead(s, at_rest & lanes);
}

/* Sizes and absolute tolerances for the next steps of some lanes. */
static void lanes_sizes_update(lag_lanes *s, int lanes)
{
    const lag_run *single = s->single;
    const int nq = s->system->nq, kinds = single->kinds;
    const double length = TIMING * (s->t_end - s->t_start), following = FOLLOWING * s->rtol;
    EACH_PART (k) {
        const mask chosen = lanes_of(lanes, k);
        for (int i = 0; i < 2 * kinds; ++i)
            AT(s->largest + i * LAG_LANES + k) = all(0.0);
        for (int m = 0; m < 2 * nq; ++m) {
            const int kind = single->kind[m % nq] + (m < nq ? 0 : kinds);
            double *largest = s->largest + kind * LAG_LANES + k, *kept = s->size + m * LAG_LANES + k;
            const vec size = larger(magnitude(READ(s->y + m * LAG_LANES + k)), READ(kept));
            AT(kept) = choose(chosen, size, READ(kept));
            AT(largest) = larger(size, READ(largest));
        }
        for (int m = 0; m < 2 * nq; ++m) {
            double *atol = s->atol + m * LAG_LANES + k;
            const int kind = single->kind[m % nq] + (m < nq ? 0 : kinds);
            const int i = m % nq * LAG_LANES + k;
            const vec h = READ(s->h + k);
            const vec noise = SUMMING * h * READ(s->gross + i) + length * READ(s->later + i);
            vec found = following * READ(s->size + m * LAG_LANES + k)
                        + ROUNDING * READ(s->largest + kind * LAG_LANES + k)
                        + (m < nq ? noise * h : noise) + NO_SIZE;
            if (single->given[m] > 0.0)
                found = all(single->given[m]);
            AT(atol) = choose(chosen, found, READ(atol));
        }
        const int w = 2 * nq * LAG_LANES + k;
        const vec size = larger(magnitude(READ(s->y + w)), READ(s->size + w));
        AT(s->size + w) = choose(chosen, size, READ(s->size + w));
        const vec found = single->given[2 * nq] > 0.0 ? all(single->given[2 * nq])
                                                      : following * size + NO_SIZE;
        AT(s->atol + w) = choose(chosen, found, READ(s->atol + w));
    }
}

/* The 2-norm of a lane's rates f over sizes w. */
static double lanes_rate(int n, int l, const double *f, const double *w)
{
    double sum = 0.0;
    for (int m = l; m < n * LAG_LANES; m += LAG_LANES)
        sum += w[m] > 0.0 ? f[m] / w[m] * (f[m] / w[m]) : 0.0;
    return sqrt(sum);
}

/* The first steps of some lanes: lag_first_step. */
static void lanes_first_steps(lag_lanes *s, int lanes)
{
    const int nq = s->system->nq, n = 2 * nq, n8 = (n + 1) * LAG_LANES;
    double d1[LAG_LANES] = {0.0}, h[LAG_LANES] = {0.0}, t[LAG_LANES];
    double *f = s->stages, *f1 = s->stages + DOP_STAGES * n8, *w = s->before;
    lanes_sizes_update(s, lanes);
    EACH_LANE (l) {
        if (!HAS(lanes, l))
            continue;
        const double horizon = HORIZON * (s->t_end - s->t[l]);
        for (int i = 0; i < nq; ++i) {
            const int q = i * LAG_LANES + l, v = q + nq * LAG_LANES;
            const double *largest = s->largest + s->single->kind[i] * LAG_LANES + l;
            const double a = s->gross[q] + s->later[q];
            w[q] = fabs(s->y[q]) + BESIDE * largest[0] + horizon * (fabs(s->y[v]) + horizon * a);
            w[v] = fabs(s->y[v]) + BESIDE * largest[s->single->kinds * LAG_LANES] + horizon * a
                   + sqrt(a * w[q]);
        }
        d1[l] = lanes_rate(n, l, f, w);
        h[l] = d1[l] > 0.0 ? 0.01 / d1[l] : horizon;
        h[l] = fmin(h[l], fmin(s->h_max, s->t_end - s->t[l]));
    }
    EACH_PART (k) {
        AT(t + k) = READ(s->t + k) + READ(h + k);
        for (int m = k; m < n8; m += LAG_LANES)
            AT(s->y_new + m) = READ(s->y + m) + READ(h + k) * READ(f + m);
    }
    lanes_evaluate(&s->moving.dynamics, s->system, t, s->y_new, LAG_ALL);
    lanes_derivative(&s->moving, f1);
    EACH_PART (k)
        for (int m = k; m < n8; m += LAG_LANES)
            AT(f1 + m) -= READ(f + m);
    EACH_LANE (l) {
        if (!HAS(lanes, l))
            continue;
        const double length = s->t_end - s->t[l], d2 = lanes_rate(n, l, f1, w) / h[l];
        s->h[l] = h[l]; /* where y' is undefined there, the step itself will find a size */
        if (!isfinite(d2))
            continue;
        const double d = fmax(d1[l], sqrt(d2));
        const double h1 = d > 0.0 ? pow(0.01 * s->rtol, 1.0 / ORDER) / d : HORIZON * length;
        s->h[l] = fmin(fmin(100.0 * h[l], h1), fmin(s->h_max, length));
    }
    lanes_evaluate(&s->moving.dynamics, s->system, s->t, s->y, LAG_ALL);
    lanes_sizes_energy(s, lanes, s->y, s->h);
    lanes_sizes_update(s, lanes);
}
