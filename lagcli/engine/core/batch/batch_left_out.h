/* Redundant constraints in eight lanes: the rows of B that the common elimination leaves out; see left_out.c for one.
 * Where the others do not suffice, a lane's step uses the dense solution of a single run, with all rows. */

/* A single run with the parameters and scales of a lane that solves densely; batch_end_all_rows ends that. */
static lag_run *batch_begin_all_rows(lag_batch *s, int l)
{
    lag_run *run = batch_single(s, l, s->y);
    for (int i = 0; i < s->system->nh; ++i)
        run->projection.scale_position[i] = s->moving.scale_position[i * LAG_LANES + l];
    for (int i = 0; i < s->system->nc; ++i)
        run->projection.scale_velocity[i] = s->moving.scale_velocity[i * LAG_LANES + l];
    run->solver.dense_steps = 1;
    return run;
}

static void batch_end_all_rows(lag_batch *s)
{
    s->single->solver.dense_steps = 0;
}

/* A lane's state, of q and v, as a single run has it. */
static double *batch_state(lag_batch *s, const double *y, int l)
{
    double *own = s->single->samples.y;
    for (int i = 0; i < 2 * s->system->nq; ++i)
        own[i] = y[i * LAG_LANES + l];
    own[2 * s->system->nq] = 0.0;
    return own;
}

/* Put y' of some lanes to f, by all rows; t and y are of lanes. */
static void batch_derive_by_all_rows(lag_batch *s, int lanes, const double *t, const double *y, double *f)
{
    const int n = lag_size(s->system);
    EACH_LANE (l) {
        if (!HAS(lanes, l))
            continue;
        lag_run *run = batch_begin_all_rows(s, l);
        const int bad = lag_derivative(run, t[l], batch_state(s, y, l), run->step.f);
        for (int i = 0; i < n; ++i)
            f[i * LAG_LANES + l] = bad ? NAN : run->step.f[i];
        batch_end_all_rows(s);
    }
}

/* Bring the state in place `from` of y (of lanes) onto the constraints of a lane, by all rows; it goes to the same place
 * of `to`. Returns 0, or 1 where that fails. */
static int batch_project_by_all_rows(lag_batch *s, int l, double t, const double *y, int from, double *to)
{
    lag_run *run = batch_begin_all_rows(s, l);
    double *own = batch_state(s, y, from);
    const int status = lag_project_system(run, t, own);
    for (int i = 0; i < 2 * s->system->nq; ++i)
        to[i * LAG_LANES + from] = own[i];
    for (int i = 0; i < s->system->nh; ++i)
        s->moving.scale_position[i * LAG_LANES + l] = run->projection.scale_position[i];
    for (int i = 0; i < s->system->nc; ++i)
        s->moving.scale_velocity[i * LAG_LANES + l] = run->projection.scale_velocity[i];
    batch_end_all_rows(s);
    return status != LAG_RUNNING;
}

/* Put a and lambda (nq + nc) of the state in place `at` of y (of lanes) to x, by all rows. Returns 0, or 1. */
static int batch_accelerate_by_all_rows(lag_batch *s, int l, double t, const double *y, int at, double *x)
{
    double power;
    lag_run *run = batch_begin_all_rows(s, l);
    const int bad = lag_accelerate_system(run, t, batch_state(s, y, at), 1, &power);
    memcpy(x, run->solver.a, (size_t)(s->system->nq + s->system->nc) * sizeof(double));
    batch_end_all_rows(s);
    return bad;
}

/* The lanes whose next step needs all rows, since the others are almost dependent, or did not suffice in the last. */
static int batch_lacking(lag_batch *s, int lanes)
{
    int which = 0;
    if (!lag_left_out(s->single))
        return 0;
    EACH_LANE (l) {
        if (!HAS(lanes, l))
            continue;
        int lacks = HAS(s->doubted, l);
        if (!lag_many_rows(s->single) && s->enough[l] <= 0.0) {
            lacks |= lag_check_left_out(batch_single(s, l, s->y));
            s->enough[l] = s->single->rows.margin;
        }
        s->poor[l] += lacks;
        which |= lacks << l;
    }
    return which;
}

/* The lanes in which a, of the dynamics tape, does not satisfy the rows that are left out: lag_contradiction of
 * equations.c; lengths are of lanes: nc. */
static int batch_overlooked(const lag_octet *o, const double *lengths)
{
    const lag_system *s = o->system;
    const lag_batch_tape *d = &o->dynamics;
    const int32_t *left_out = o->single->rows.left_out;
    const double allowed = lag_allowed_defect(&o->single->settings);
    double *defect = o->work;
    int which = 0;
    EACH_PART (k) {
        vec most = all(0.0), terms = all(0.0);
        for (int i = 0; i < s->nc; ++i) {
            const vec right = READ(OUTPUT(d, lag_first_rhs(s) + i) + k);
            AT(defect + i * LAG_LANES + k) = right;
            terms = larger(magnitude(right) / READ(lengths + i * LAG_LANES + k), terms);
        }
        for (int i = 0; i < s->nb; ++i)
            AT(defect + s->jacobian_row[i] * LAG_LANES + k) -=
                READ(OUTPUT(d, lag_first_jacobian(s) + i) + k)
                * READ(OUTPUT(d, lag_first_solution(s) + s->jacobian_column[i]) + k);
        for (int i = 0; i < s->nq; ++i)
            terms = larger(magnitude(READ(OUTPUT(d, lag_first_solution(s) + i) + k)), terms);
        for (int j = 0; j < lag_left_out(o->single); ++j) {
            const int i = left_out[j] * LAG_LANES + k;
            most = larger(magnitude(READ(defect + i)) / READ(lengths + i), most);
        }
        which |= set_of(~(most <= allowed * terms), k);
    }
    return which;
}

/* The lanes whose constraints contradict each other at the ends of their steps, to which the dynamics tape is set.
 * Others in which rows that are left out are not satisfied by a need all rows for the next step. */
static int batch_contradicting(lag_batch *s, int lanes, const double *t, const double *y)
{
    int which = 0;
    if (!lag_left_out(s->single))
        return 0;
    batch_evaluate(&s->moving.dynamics, s->system, t, y, LAG_ALL);
    const int doubted = lanes & (batch_overlooked(&s->moving, s->lengths) | s->all_rows);
    EACH_LANE (l)
        if (HAS(doubted, l)) {
            lag_run *run = batch_begin_all_rows(s, l);
            which |= !(lag_contradiction(run, t[l], batch_state(s, y, l)) <= MOST_DEFECT) << l;
            batch_end_all_rows(s);
        }
    s->doubted = (s->doubted & ~lanes) | (doubted & ~s->all_rows);
    return which;
}

/* The multipliers (of lanes) that oppose the force of each row that is left out, at the states of the dynamics tape. */
static void batch_respond(const lag_octet *o)
{
    const lag_system *s = o->system;
    const int nq = s->nq, nc = s->nc;
    for (int j = 0; j < lag_left_out(o->single); ++j) {
        memset(o->right, 0, (size_t)(nq + nc) * LAG_LANES * sizeof(double));
        for (int i = 0; i < s->nb; ++i)
            if (s->jacobian_row[i] == o->single->rows.left_out[j])
                memcpy(o->right + s->jacobian_column[i] * LAG_LANES,
                       OUTPUT(&o->dynamics, lag_first_jacobian(s) + i), LAG_LANES * sizeof(double));
        batch_solve(o, o->right);
        for (int i = 0; i < nc * LAG_LANES; ++i)
            o->responses[j * nc * LAG_LANES + i] = -o->right[nq * LAG_LANES + i];
    }
}

/* Make the multipliers (nc) of sample i of a lane's run those of least norm: lag_share_multipliers. Returns 0, or 1. */
static int batch_share(const lag_batch *s, int l, int i, double *multipliers)
{
    const int nc = s->system->nc, count = lag_left_out(s->single);
    const lag_rows *rows = &s->single->rows;
    if (!count)
        return 0;
    for (int m = 0; m < nc; ++m)
        rows->lengths[m] = s->lengths[m * LAG_LANES + l];
    for (int m = 0; m < count * nc; ++m)
        rows->dependencies[m] = s->sampled.responses[m * LAG_LANES + i];
    return lag_share_by_responses(s->single, multipliers);
}
