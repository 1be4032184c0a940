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

/* Find A and R in some lanes: as single runs do, which may round up and down (sin and cos of the lanes
 * may not). */
static void lanes_sizes_start(lag_lanes *s, int lanes)
{
    const int nq = s->system->nq;
    EACH_LANE (l) {
        if (!HAS(lanes, l))
            continue;
        lag_run *run = lanes_single(s, l, s->y);
        memset(run->gross, 0, (size_t)nq * sizeof(double));
        memset(run->later, 0, (size_t)nq * sizeof(double));
        if (!lag_derivative(run, run->t, run->y, run->f))
            lag_sizes_start(run);
        for (int i = 0; i < nq; ++i) {
            s->gross[i * LAG_LANES + l] = run->gross[i];
            s->later[i * LAG_LANES + l] = run->later[i];
        }
    }
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
