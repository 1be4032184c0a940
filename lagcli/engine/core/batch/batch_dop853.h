/* A step of DOP853 in eight lanes, each with its own size; see dop853.c for one. */

/* y = base + h times a sum of stages; `rows` of n. */
static void batch_add_stages(const double *base, const double *stages, const dop_sum *of, const double *h, int n,
                             int rows, double *y)
{
    const double *w = of->weight, *used[DOP_TERMS];
    for (int j = 0; j < of->terms; ++j)
        used[j] = stages + of->stage[j] * n * LAG_LANES;
    for (int m = 0; m < rows * LAG_LANES; m += LAG_LANES)
        EACH_PART (k) {
            vec sum = w[0] * READ(used[0] + m + k);
            for (int j = 1; j < of->terms; ++j)
                sum += w[j] * READ(used[j] + m + k);
            AT(y + m + k) = READ(base + m + k) + READ(h + k) * sum;
        }
}

/* y' at a stage: y = base + h times a sum of the stages before it. */
static void batch_stage(lag_batch *s, int stage, int end, const double *h)
{
    const int n = lag_size(s->system), n8 = n * LAG_LANES;
    const lag_batch_tape *d = &s->moving.dynamics;
    const double c = end ? 1.0 : dop_c[stage];
    /* q and v are written to the tape's inputs */
    EACH_PART (k)
        AT(d->registers + k) = READ(s->t + k) + c * READ(h + k);
    batch_add_stages(s->y, s->stages, end ? &dop_b : dop_a + stage, h, n, n - 1, d->registers + LAG_LANES);
    batch_tape_run(d, &d->stream);
    batch_derivative(&s->moving, s->stages + stage * n8);
    batch_derive_by_all_rows(s, s->all_rows, d->registers, d->registers + LAG_LANES, s->stages + stage * n8);
}

/* All stages of a step; y_new is its end, at which the dynamics tape is then evaluated. */
static void batch_stages(lag_batch *s, const double *h)
{
    const int n = lag_size(s->system);
    const size_t moving = 2 * (size_t)s->system->nq * LAG_LANES * sizeof(double);
    const double *y = s->moving.dynamics.registers + LAG_LANES;
    if (s->watching)
        batch_watch_step(s);
    for (int i = 1; i <= DOP_STAGES; ++i) {
        batch_stage(s, i, i == DOP_STAGES, h);
        if (s->detecting && i == DOP_STAGES - 1)
            memcpy(s->before, y, moving);
        if (s->watching)
            batch_watch_stage(s, i);
    }
    memcpy(s->y_new, y, moving);
    const int work = (n - 1) * LAG_LANES;
    batch_add_stages(s->y + work, s->stages + work, &dop_b, h, n, 1, s->y_new + work);
}

/* The errors of a step over the tolerances (of lanes). Returns the lanes in which those of different orders are alike:
 * is_flat of dop853.c. */
static int batch_errors(const lag_batch *s, const double *h, double *error)
{
    int flat = 0;
    const int n8 = lag_size(s->system) * LAG_LANES;
    EACH_PART (k) {
        vec e5 = all(0.0), e3 = all(0.0);
        for (int m = k; m < n8; m += LAG_LANES) {
            vec x5 = all(0.0), x3 = all(0.0);
            for (int i = 0; i < dop_e5.terms; ++i) { /* both have the same stages */
                const vec stage = READ(s->stages + dop_e5.stage[i] * n8 + m);
                x5 += dop_e5.weight[i] * stage;
                x3 += dop_e3.weight[i] * stage;
            }
            const vec size = larger(magnitude(READ(s->y + m)), magnitude(READ(s->y_new + m)));
            const vec scale = 1.0 / (READ(s->atol + m) + s->settings->rtol * size);
            x5 *= scale;
            x3 *= scale;
            e5 += x5 * x5;
            e3 += x3 * x3;
        }
        const vec below = e5 + 0.01 * e3;
        const vec estimate = READ(h + k) * e5 / root(below);
        /* overflow is not a small error */
        const vec defined = choose(below > 0.0, estimate, all(0.0));
        const vec judged = choose(below <= DBL_MAX, defined, all(INFINITY));
        AT(error + k) = judged;
        flat |= set_of((judged > SEEN) & (e3 < FLAT * FLAT * e5), k);
    }
    return flat;
}

/* Approximate h times the dominant eigenvalue of the last step (of lanes); see dop853.c. */
static void batch_stiffness(const lag_batch *s, const double *h, double *product)
{
    const int n8 = lag_size(s->system) * LAG_LANES;
    const double *last = s->stages + DOP_STAGES * n8, *k_before = last - n8;
    EACH_PART (k) {
        vec rise = all(0.0), length = all(0.0);
        for (int m = k; m < n8 - LAG_LANES; m += LAG_LANES) {
            const vec df = READ(last + m) - READ(k_before + m);
            const vec dy = READ(s->y_new + m) - READ(s->before + m);
            const vec size = larger(magnitude(READ(s->y + m)), magnitude(READ(s->y_new + m)));
            const vec scale = 1.0 / (READ(s->atol + m) + s->settings->rtol * size);
            rise += df * scale * (df * scale);
            length += dy * scale * (dy * scale);
        }
        const vec estimate = READ(h + k) * root(rise / length);
        AT(product + k) = choose(length > 0.0, estimate, all(0.0));
    }
}

/* The coefficients of the dense output of the step from y to y_new. */
static void batch_dense(lag_batch *s, const double *h)
{
    const int n8 = lag_size(s->system) * LAG_LANES;
    double *d = s->dense;
    for (int i = DOP_STAGES + 1; i < DOP_ALL_STAGES; ++i)
        batch_stage(s, i, 0, h);
    EACH_PART (k) {
        const vec size = READ(h + k);
        for (int m = k; m < n8; m += LAG_LANES) {
            const vec first = READ(s->stages + m), last = READ(s->stages + DOP_STAGES * n8 + m);
            const vec delta = READ(s->y_new + m) - READ(s->y + m);
            AT(d + m) = delta;
            AT(d + n8 + m) = size * first - delta;
            AT(d + 2 * n8 + m) = 2.0 * delta - size * (last + first);
            vec sum[4] = {all(0.0), all(0.0), all(0.0), all(0.0)};
            for (int j = 0; j < dop_d[0].terms; ++j) {
                const vec stage = READ(s->stages + dop_d[0].stage[j] * n8 + m);
                for (int i = 0; i < 4; ++i)
                    sum[i] += dop_d[i].weight[j] * stage;
            }
            for (int i = 0; i < 4; ++i)
                AT(d + (3 + i) * n8 + m) = size * sum[i];
        }
    }
}

/* v' of the dense output at the fraction x (of lanes) of the step, times its size. */
static void batch_dense_slope(const lag_batch *s, const double *x, double *slope)
{
    const int nq = s->system->nq, n8 = lag_size(s->system) * LAG_LANES;
    EACH_PART (k) {
        const vec up = READ(x + k), down = 1.0 - up;
        for (int m = k; m < nq * LAG_LANES; m += LAG_LANES) {
            const double *d = s->dense + nq * LAG_LANES + m;
            vec value = all(0.0), rate = all(0.0);
            for (int i = 6; i >= 0; --i) {
                const vec inner = value + READ(d + i * n8);
                rate = i % 2 == 0 ? rate * up + inner : rate * down - inner;
                value = inner * (i % 2 == 0 ? up : down);
            }
            AT(slope + m) = rate;
        }
    }
}

/* The dense output at the fraction x (of lanes) of the step. */
static void batch_dense_at(const lag_batch *s, const double *x, double *y)
{
    const int n8 = lag_size(s->system) * LAG_LANES;
    const double *d = s->dense;
    EACH_PART (k) {
        const vec up = READ(x + k), down = 1.0 - up;
        for (int m = k; m < n8; m += LAG_LANES) {
            vec sum = all(0.0);
            for (int i = 6; i >= 0; --i)
                sum = (sum + READ(d + i * n8 + m)) * (i % 2 == 0 ? up : down);
            AT(y + m) = READ(s->y + m) + sum;
        }
    }
}
