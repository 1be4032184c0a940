/* Projection onto the constraints in eight lanes; see project_system.c for one. */

/* Put the largest residual over its scale to worst, that of rows that are left out to left, and the
 * residuals' sum to sum (of lanes); measure the scales of some lanes. */
static void batch_positions(const lag_octet *o, int lanes, double *worst, double *left, double *sum)
{
    const lag_system *s = o->system;
    const lag_batch_tape *c = &o->constraint;
    EACH_PART (k) {
        const mask measured = lanes_of(lanes, k);
        vec largest = all(0.0), aside = all(0.0), total = all(0.0);
        for (int i = 0; i < s->nh; ++i) {
            double *kept = o->scale_position + i * LAG_LANES + k;
            const vec phi = READ(OUTPUT(c, i) + k);
            const vec scale = larger(READ(OUTPUT(c, lag_constraint_position_scale(s) + i) + k), READ(kept));
            AT(kept) = choose(measured, scale, READ(kept));
            const vec relative = magnitude(phi) / larger(scale, all(1e-300));
            if (batch_leaves_out(o, o->single->rows.place_left_out, i))
                aside = larger(relative, aside);
            else
                largest = larger(relative, largest);
            total += phi;
        }
        AT(worst + k) = largest;
        AT(left + k) = aside;
        AT(sum + k) = total;
    }
}

/* Raise the scales of phi in some lanes to the least ones at y (of lanes): see project_system.c. The dynamics
 * tape holds the same factors afterwards: what other lanes do with them does not depend on it. */
static void batch_raise_scales(const lag_octet *o, const double *t, const double *y, int lanes)
{
    const lag_system *s = o->system;
    const lag_batch_tape *d = &o->dynamics;
    double *own = o->work, *square = own + s->nc * LAG_LANES, *compliance = o->x;
    double *factored = square + s->nc * LAG_LANES, factored_at[LAG_LANES];
    memcpy(factored_at, d->registers, sizeof factored_at);
    memcpy(factored, d->registers + LAG_LANES, 2 * (size_t)s->nq * sizeof factored_at);
    batch_evaluate(d, s, t, y, LAG_ALL);
    EACH_PART (k) {
        vec size = all(0.0);
        for (int i = k; i < 2 * s->nc * LAG_LANES; i += LAG_LANES)
            AT(own + i) = all(0.0);
        for (int j = 0; j < s->nq; ++j) {
            vec mass = all(0.0);
            if (s->mass_diagonal[j] >= 0)
                mass = READ(OUTPUT(d, s->mass_diagonal[j]) + k);
            double *inertia = compliance + s->unit[j] * LAG_LANES + k; /* so far */
            AT(compliance + j * LAG_LANES + k) = all(0.0);
            AT(inertia) = larger(mass, READ(inertia));
        }
        for (int j = s->nq - 1; j >= 0; --j) {
            const vec inertia = READ(compliance + s->unit[j] * LAG_LANES + k);
            const vec q = READ(y + j * LAG_LANES + k);
            size = larger(inertia * q * q, size);
            AT(compliance + j * LAG_LANES + k) =
                choose(inertia > all(0.0), all(1.0) / inertia, all(0.0));
        }
        for (int i = 0; i < s->nb; ++i) {
            const int row = s->jacobian_row[i] * LAG_LANES + k;
            const int column = s->jacobian_column[i] * LAG_LANES + k;
            const vec b = READ(OUTPUT(d, lag_first_jacobian(s) + i) + k);
            AT(own + row) += magnitude(b * READ(y + column));
            AT(square + row) += b * b * READ(compliance + column);
        }
        for (int i = 0; i < s->nh; ++i) {
            const int row = s->holonomic[i] * LAG_LANES + k;
            double *kept = o->scale_position + i * LAG_LANES + k;
            const vec part = all(LEAST_PART) * root(size) * root(READ(square + row));
            const vec least = larger(READ(own + row), part);
            const mask raised = lanes_of(lanes, k) & (least > READ(kept));
            AT(kept) = choose(raised, least, READ(kept));
        }
    }
    batch_evaluate(d, s, factored_at, factored, LAG_FACTORS);
}

/* Put -psi in the right side, and the largest residual of rows that are left out over its scale to left (of
 * lanes); measure the scales of some lanes, and return those of them in which psi is not yet met. */
static int batch_velocities(const lag_octet *o, int lanes, double *left)
{
    const lag_system *s = o->system;
    const lag_batch_tape *c = &o->constraint;
    const int nc = s->nc, first = lag_constraint_velocity(s);
    const int scales = lag_constraint_velocity_scale(s);
    int open = 0;
    EACH_PART (k) {
        const mask measured = lanes_of(lanes, k);
        mask unmet = {0};
        vec aside = all(0.0);
        for (int i = 0; i < nc; ++i) {
            double *kept = o->scale_velocity + i * LAG_LANES + k;
            const vec psi = READ(OUTPUT(c, first + i) + k);
            const vec given = READ(OUTPUT(c, scales + i) + k);
            const vec scale = larger(given, READ(kept));
            AT(kept) = choose(measured, scale, READ(kept));
            if (batch_leaves_out(o, o->single->rows.left_out, i))
                aside = larger(magnitude(psi) / larger(scale, all(1e-300)), aside);
            else
                unmet |= ~(magnitude(psi) <= RESIDUAL * scale);
            AT(o->right + i * LAG_LANES + k) = -psi;
        }
        AT(left + k) = aside;
        open |= set_of(unmet & measured, k);
    }
    return open;
}

/* Add a change to `count` rows in some lanes. */
static void batch_move(double *y, const double *change, int count, int lanes)
{
    EACH_PART (k) {
        const mask moving = lanes_of(lanes, k);
        for (int i = k; i < count * LAG_LANES; i += LAG_LANES)
            AT(y + i) += choose(moving, READ(change + i), all(0.0));
    }
}

/*
 * Bring y at t (of lanes) onto the constraints, in some lanes; the dynamics tape holds the factors at
 * y or nearby. The constraint tape then holds the state reached. Returns the lanes in which that
 * failed, or violates rows that are left out.
 */
static int batch_project(const lag_octet *o, const double *t, double *y, int lanes)
{
    const lag_system *s = o->system;
    const lag_batch_tape *c = &o->constraint;
    const int nq = s->nq, nh = s->nh;
    int open = lanes, failed = 0;
    double best[LAG_LANES], worst[LAG_LANES], left[LAG_LANES], sum[LAG_LANES];
    EACH_LANE (l)
        best[l] = INFINITY;
    for (int iteration = 0; iteration < PROJECTIONS && open; ++iteration) {
        batch_evaluate(c, s, t, y, LAG_POSITIONS);
        batch_positions(o, lanes, worst, left, sum);
        if (iteration == RAISE) {
            batch_raise_scales(o, t, y, open);
            batch_positions(o, lanes, worst, left, sum);
        }
        EACH_LANE (l) {
            if (!HAS(open, l))
                continue;
            int met = worst[l] <= RESIDUAL;
            if (!isfinite(sum[l])) {
                failed |= 1 << l;
                met = 1;
            } else if (best[l] <= NOT_REACHED && worst[l] >= 0.5 * best[l] && !met) {
                /* rounding errors are reached: keep the better of the last two */
                met = 1;
                if (worst[l] > best[l])
                    for (int i = l; i < nq * LAG_LANES; i += LAG_LANES)
                        y[i] = o->trial[i];
            }
            best[l] = worst[l];
            open &= ~(met << l);
            failed |= (met && left[l] > NOT_REACHED) << l;
        }
        if (!open)
            break;
        memcpy(o->trial, y, (size_t)nq * LAG_LANES * sizeof(double));
        memset(o->right, 0, (size_t)s->nc * LAG_LANES * sizeof(double));
        EACH_PART (k)
            for (int i = 0; i < nh; ++i)
                AT(o->right + s->holonomic[i] * LAG_LANES + k) = -READ(OUTPUT(c, i) + k);
        batch_correct(o, o->right);
        batch_move(y, o->right, nq, open);
    }
    failed |= open;
    /* linear in the velocities: see project_system.c */
    for (int iteration = 0; iteration < 2; ++iteration) {
        batch_evaluate(c, s, t, y, LAG_VELOCITIES);
        open = batch_velocities(o, lanes & ~failed, left);
        EACH_LANE (l)
            failed |= ((iteration || !open) && HAS(lanes, l) && left[l] > LEFT_OUT) << l;
        if (!open)
            break;
        batch_correct(o, o->right);
        batch_move(y + nq * LAG_LANES, o->right, nq, open);
    }
    return failed;
}
