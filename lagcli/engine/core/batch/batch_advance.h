/* Runs in lanes: start, steps, and end; see advance.c and dop853.c for a single run. */

#define WORTH 300           /* remaining steps that justify another method, as in engine/integrate/methods.py */

/* Remove the runs in some lanes; return the other lanes. */
static int batch_leave_all(lag_batch *s, int lanes, int leaving)
{
    EACH_LANE (l)
        if (HAS(leaving & lanes, l))
            lag_batch_leave(s, l);
    return lanes & ~leaving;
}

static void batch_finish(lag_batch *s, int l)
{
    if (batch_complete_samples(s, l, 1)) {
        lag_batch_leave(s, l);
        return;
    }
    s->status[s->run[l]] = LAG_LANE_DONE;
    s->finished[s->finished_count] = s->run[l];
    s->finished_slots[s->finished_count++] = s->slot[l];
    s->run[l] = -1;
}

static int batch_occupied(const lag_batch *s)
{
    int lanes = 0;
    EACH_LANE (l)
        lanes |= (s->run[l] >= 0) << l;
    return lanes;
}

/* The lanes in which n numbers are not all finite. */
static int batch_undefined(const double *x, int n)
{
    int which = 0;
    EACH_PART (k) {
        vec sum = all(0.0);
        for (int m = k; m < n * LAG_LANES; m += LAG_LANES)
            sum += READ(x + m);
        which |= set_of(~(magnitude(sum) <= DBL_MAX), k);
    }
    return which;
}

/* Copy some lanes of n rows. */
static void batch_copy(double *to, const double *from, int n, int lanes)
{
    EACH_PART (k) {
        const mask chosen = lanes_of(lanes, k);
        for (int m = k; m < n * LAG_LANES; m += LAG_LANES)
            AT(to + m) = choose(chosen, READ(from + m), READ(to + m));
    }
}

/* Keep the largest length that each row of B has had in some lanes; the constraint tape holds the
 * state. Returns the lanes in which a row has none. */
static int batch_measure(lag_batch *s, int lanes)
{
    const lag_system *system = s->system;
    const lag_batch_tape *c = &s->moving.constraint;
    double *sum = s->moving.work;
    int none = 0;
    EACH_PART (k) {
        const mask measured = lanes_of(lanes, k);
        for (int i = 0; i < system->nc; ++i)
            AT(sum + i * LAG_LANES + k) = all(0.0);
        for (int i = 0; i < system->nb; ++i) {
            const vec x = READ(OUTPUT(c, lag_constraint_jacobian(system) + i) + k);
            AT(sum + system->jacobian_row[i] * LAG_LANES + k) += x * x;
        }
        vec ratio = all(1.0);
        for (int i = 0; i < system->nc; ++i) {
            double *kept = s->lengths + i * LAG_LANES + k;
            const vec length = larger(root(READ(sum + i * LAG_LANES + k)), READ(kept));
            ratio = smaller(READ(kept) / length, ratio);
            AT(kept) = choose(measured, length, READ(kept));
            none |= set_of(~(length > 0.0), k);
        }
        AT(s->margin + k) *= choose(measured, ratio, all(1.0)); /* of the watch */
    }
    return none & lanes;
}

/* Put waiting runs into empty lanes, as long as there are slots for their samples; return those
 * lanes. */
static int batch_fill(lag_batch *s)
{
    const lag_system *system = s->system;
    const int moving = 2 * system->nq, n = moving + 1, count = s->parameters_count;
    int filled = 0;
    EACH_LANE (l) {
        if (s->run[l] >= 0 || s->next == s->runs || !s->free_count)
            continue;
        const int64_t run = s->next++;
        s->run[l] = run;
        s->slot[l] = s->free_slots[--s->free_count];
        s->status[run] = LAG_LANE_UNDER_WAY;
        s->times_next[l] = s->samples_done[l] = 0;
        s->t[l] = s->t_start;
        s->error_old[l] = LEAST_ERROR;
        s->after_rejection[l] = s->stiff[l] = s->not_stiff[l] = 0;
        for (int i = 0; i < count; ++i) {
            const double x = s->parameters[run * count + i];
            s->moving.dynamics.registers[(n + i) * LAG_LANES + l] = x;
            s->moving.constraint.registers[(n + i) * LAG_LANES + l] = x;
        }
        for (int i = 0; i < moving; ++i)
            s->y[i * LAG_LANES + l] = s->states[run * moving + i];
        s->y[moving * LAG_LANES + l] = 0.0;
        for (int i = 0; i < system->nh; ++i)
            s->moving.scale_position[i * LAG_LANES + l] = 0.0;
        for (int i = 0; i < system->nc; ++i)
            s->moving.scale_velocity[i * LAG_LANES + l] = s->lengths[i * LAG_LANES + l] = 0.0;
        for (int i = 0; i < n; ++i)
            s->size[i * LAG_LANES + l] = 0.0;
        s->enough[l] = 0.0;
        s->poor[l] = 0;
        s->doubted &= ~(1 << l);
        filled |= 1 << l;
    }
    if (filled) {
        batch_run(s->moving.dynamics.prelude, s->moving.dynamics.registers);
        batch_run(s->moving.constraint.prelude, s->moving.constraint.registers);
    }
    return filled;
}

/* Begin the runs in some lanes. */
static void batch_begin(lag_batch *s, int lanes)
{
    const lag_system *system = s->system;
    const int n = lag_size(system);
    double *f = s->stages + DOP_STAGES * n * LAG_LANES;
    if (system->nc) {
        batch_evaluate(&s->moving.dynamics, system, s->t, s->y, LAG_FACTORS);
        lanes = batch_leave_all(s, lanes, batch_project(&s->moving, s->t, s->y, lanes));
        lanes = batch_leave_all(s, lanes, batch_measure(s, lanes));
    }
    batch_evaluate(&s->moving.dynamics, system, s->t, s->y, LAG_ALL);
    batch_derivative(&s->moving, f);
    lanes = batch_leave_all(s, lanes, batch_undefined(f, n));
    lanes = batch_leave_all(s, lanes, batch_contradicting(s, lanes, s->t, s->y));
    batch_copy(s->stages, f, n, lanes);
    EACH_LANE (l)
        if (HAS(lanes, l)) {
            s->counts[3 * s->run[l] + 2] += 3;
            if (s->watching)
                batch_watch_start(s, l);
            while (batch_due(s, l, s->t[l]))
                batch_take(s, l, 0.0, s->y, NULL);
        }
    batch_sizes_start(s, lanes);
    batch_first_steps(s, lanes);
}

/* The size of a lane's next step, limited by t_end; 0 if it is below the minimum. */
static double batch_step_size(const lag_batch *s, int l)
{
    const double t = s->t[l], h = s->h[l];
    if (!(h > 10.0 * DBL_EPSILON * fabs(t)) || !(h > DBL_MIN * 1e10))
        return 0.0;
    const double t_end = s->settings->t_end;
    return t + 1.01 * h >= t_end ? t_end - t : lag_exact_step(t, h, s->t_start, t_end);
}

/* The lanes in which an error is too large, and finite. */
static int batch_too_large(int lanes, const double *error)
{
    int which = 0;
    EACH_LANE (l)
        which |= (HAS(lanes, l) && error[l] > 1.0 && error[l] < INFINITY) << l;
    return which;
}

/* The errors of steps beside tolerances that rounding errors do not exceed; without rounding errors where they are
 * small enough. See dop853.c. */
static void batch_judged_errors(lag_batch *s, int lanes, const double *h, double *error)
{
    const int n = lag_size(s->system);
    const int flat = batch_errors(s, h, error) & lanes;
    int large = batch_too_large(lanes, error), raised = 0;
    if (!(large | flat))
        return;
    memcpy(s->strict, s->atol, (size_t)n * LAG_LANES * sizeof(double));
    for (int attempt = 0; (large | (flat & ~raised)) && attempt < ATTEMPTS; ++attempt) {
        const int excused = batch_excuse(s, large | (flat & ~raised), h, attempt);
        raised |= excused;
        if (!excused)
            continue;
        batch_errors(s, h, error);
        large = batch_too_large(large, error);
    }
    batch_copy(s->atol, s->strict, n, large);
    batch_be_strict(s, large);
    raised &= ~large;
    if (!raised)
        return;
    double other[LAG_LANES];
    batch_scale_rounding(s, IGNORED);
    batch_errors(s, h, other);
    batch_scale_rounding(s, 1.0 / IGNORED);
    EACH_LANE (l)
        if (HAS(raised, l))
            error[l] = other[l];
}

/* Determine the accepted steps and the sizes of the next ones; return the lanes that continue. */
static int batch_judge(lag_batch *s, int lanes, const double *h, const double *error)
{
    const double order = lag_dop853.order;
    int accepted = 0;
    EACH_LANE (l) {
        if (!HAS(lanes, l))
            continue;
        s->counts[3 * s->run[l] + 2] += DOP_STAGES;
        if (error[l] <= 1.0) {
            const double factor =
                lag_pi_factor(error[l], s->error_old[l], order, s->after_rejection[l]);
            s->error_old[l] = fmax(error[l], LEAST_ERROR);
            s->after_rejection[l] = 0;
            s->h[l] = fmin(h[l] * factor, s->settings->max_step);
            ++s->counts[3 * s->run[l]];
            accepted |= 1 << l;
        } else {
            s->h[l] = h[l] * lag_rejected_factor(error[l], order);
            s->after_rejection[l] = 1;
            ++s->counts[3 * s->run[l] + 1];
        }
    }
    return accepted;
}

/* The lanes of accepted steps in which stability, not the error, has limited the steps for a while,
 * and with many to come. */
static int batch_stiff(lag_batch *s, int lanes, const double *h)
{
    double product[LAG_LANES];
    int which = 0;
    batch_stiffness(s, h, product);
    EACH_LANE (l) {
        if (!HAS(lanes, l))
            continue;
        if (product[l] > STABLE) {
            s->not_stiff[l] = 0;
            ++s->stiff[l];
        } else if (++s->not_stiff[l] == NOT_STIFF) {
            s->stiff[l] = 0;
        }
        if (s->stiff[l] >= STIFF) {
            s->stiff[l] = 0;
            if (s->settings->t_end - s->t[l] > WORTH * h[l])
                which |= 1 << l;
        }
    }
    return which;
}

/* The lanes in which the projection changed the state so much that y' must be evaluated again. */
static int batch_moved(const lag_batch *s)
{
    const int n8 = lag_size(s->system) * LAG_LANES;
    int which = 0;
    EACH_PART (k) {
        vec sum = all(0.0);
        for (int m = k; m < n8; m += LAG_LANES) {
            const vec y = READ(s->projected + m);
            const vec e = (y - READ(s->y_new + m)) / (READ(s->atol + m) + s->settings->rtol * magnitude(y));
            sum += e * e;
        }
        which |= set_of(sum > NEGLIGIBLE * NEGLIGIBLE, k);
    }
    return which;
}

/* The lanes in which the projection moved a coordinate too far: lag_return of project.c. */
static int batch_jumped(const lag_batch *s)
{
    int which = 0;
    EACH_PART (k)
        for (int i = 0; i < s->system->nq; ++i) {
            const int m = i * LAG_LANES + k;
            const vec y = READ(s->projected + m), moved = magnitude(y - READ(s->y_new + m));
            const vec largest = READ(s->largest + s->single->tolerances.kind[i] * LAG_LANES + k);
            which |= set_of((moved > FAR * (READ(s->atol + m) + s->settings->rtol * magnitude(y)))
                                & (moved > FAR_PART * largest), k);
        }
    return which;
}

/* Advance to the ends of accepted steps; return the lanes that arrive. */
static int batch_arrive(lag_batch *s, int lanes, const double *h, double *end)
{
    const lag_system *system = s->system;
    const int n8 = lag_size(system) * LAG_LANES;
    const double t_end = s->settings->t_end;
    EACH_LANE (l)
        end[l] = h[l] == t_end - s->t[l] ? t_end : s->t[l] + h[l];
    batch_solution(&s->moving, s->moving.x);
    lanes = batch_leave_all(s, lanes, batch_inaccurate(&s->moving, s->moving.x, s->settings->rtol) & ~s->all_rows);
    batch_sizes_energy(s, lanes, s->y_new, NULL);
    if (s->detecting)
        lanes = batch_leave_all(s, lanes, batch_stiff(s, lanes, h));
    memcpy(s->projected, s->y_new, (size_t)n8 * sizeof(double));
    if (system->nc) {
        const int open = lanes & ~s->all_rows;
        int failed = (lanes & s->all_rows) | batch_project(&s->moving, end, s->projected, open);
        if (failed && lag_left_out(s->single)) {
            EACH_LANE (l)
                if (HAS(failed, l) && !batch_project_by_all_rows(s, l, end[l], s->y_new, l, s->projected))
                    failed &= ~(1 << l);
            batch_evaluate(&s->moving.constraint, system, end, s->projected, LAG_VELOCITIES);
        }
        lanes = batch_leave_all(s, lanes, failed);
        batch_measure(s, lanes);
        if (system->nh)
            lanes = batch_leave_all(s, lanes, batch_jumped(s));
    }
    if (s->watching)
        EACH_LANE (l)
            if (HAS(lanes, l) && batch_singular(s, l, h[l], batch_alarmed(s, l, h[l])))
                lanes = batch_leave_all(s, lanes, 1 << l);
    return batch_leave_all(s, lanes, batch_contradicting(s, lanes, end, s->projected));
}

/* Prepare the next steps at the ends of the last. */
static void batch_go_on(lag_batch *s, int lanes, const double *end)
{
    const lag_system *system = s->system;
    const int n = lag_size(system), nq8 = system->nq * LAG_LANES;
    double *f = s->stages + DOP_STAGES * n * LAG_LANES;
    const int moved = system->nc ? lanes & batch_moved(s) : 0;
    if (moved) {
        batch_evaluate(&s->moving.dynamics, system, end, s->projected, LAG_ALL);
        batch_derivative(&s->moving, s->before);
        batch_derive_by_all_rows(s, moved & s->all_rows, end, s->projected, s->before);
        batch_copy(f, s->before, n, moved);
    }
    /* f holds q' = v exactly in any case */
    memcpy(f, s->projected + nq8, (size_t)nq8 * sizeof(double));
    batch_copy(s->stages, f, n, lanes);
    batch_copy(s->y, s->projected, n, lanes);
    batch_copy(s->path_begin, s->path_last, system->nb, lanes);
    batch_copy(s->margin, s->margin_at_end, 1, lanes);
    batch_copy(s->determinant, s->determinant + DOP_STAGES * LAG_LANES, 1, lanes);
    batch_sizes_update(s, lanes);
    EACH_LANE (l)
        if (HAS(lanes, l)) {
            s->counts[3 * s->run[l] + 2] += HAS(moved, l);
            s->t[l] = end[l];
            s->enough[l] -= s->path_length[l];
        }
}

/* Attempt one step in each lane. */
static void batch_attempt(lag_batch *s, int lanes)
{
    double h[LAG_LANES] = {0.0}, error[LAG_LANES], end[LAG_LANES];
    EACH_LANE (l)
        if (HAS(lanes, l) && (h[l] = batch_step_size(s, l)) == 0.0)
            lanes = batch_leave_all(s, lanes, 1 << l);
    s->all_rows = batch_lacking(s, lanes);
    if (!lanes)
        return;
    batch_stages(s, h);
    batch_judged_errors(s, lanes, h, error);
    lanes = batch_judge(s, lanes, h, error);
    if (!lanes)
        return;
    lanes = batch_arrive(s, lanes, h, end);
    batch_sample_steps(s, lanes, h, end);
    batch_go_on(s, lanes, end);
    EACH_LANE (l) {
        if (!HAS(lanes, l))
            continue;
        if (s->t[l] >= s->settings->t_end)
            batch_finish(s, l);
        else if (s->counts[3 * s->run[l]] >= s->settings->max_steps || s->poor[l] > OFTEN
                 || batch_complete_samples(s, l, 0))
            lag_batch_leave(s, l);
    }
}

static int batch_advance(lag_batch *s, int64_t attempts)
{
    for (;;) {
        const int filled = batch_fill(s);
        if (filled) {
            batch_begin(s, filled);
            continue; /* the run may already have left */
        }
        const int lanes = batch_occupied(s);
        if (lanes != ALL_LANES && s->next < s->runs)
            return LAG_BLOCK_FULL;
        if (!lanes)
            return LAG_DONE;
        if (attempts-- <= 0)
            return LAG_RUNNING;
        batch_attempt(s, lanes);
    }
}

static void batch_table(const lag_batch_tape *tape, const double *parameters, int parameters_count,
                        const double *table, int64_t rows, int columns, int64_t width, int outputs,
                        double *out)
{
    double *r = tape->registers;
    for (int i = 0; i < parameters_count; ++i)
        EACH_PART (k)
            AT(r + (columns + i) * LAG_LANES + k) = all(parameters[i]);
    batch_run(tape->prelude, r);
    for (int64_t first = 0; first < rows; first += LAG_LANES) {
        const int count = rows - first < LAG_LANES ? (int)(rows - first) : LAG_LANES;
        EACH_LANE (l) {
            const double *row = table + (first + (l < count ? l : count - 1)) * width;
            for (int i = 0; i < columns; ++i)
                r[i * LAG_LANES + l] = row[i];
        }
        batch_tape_run(tape, &tape->stream);
        for (int i = 0; i < outputs; ++i)
            for (int l = 0; l < count; ++l)
                out[i * rows + first + l] = OUTPUT(tape, i)[l];
    }
}

static void batch_sincos(const double *x, double *sine, double *cosine)
{
    EACH_PART (k) {
        vec a, b;
        vec_sincos(READ(x + k), &a, &b);
        AT(sine + k) = a;
        AT(cosine + k) = b;
    }
}
