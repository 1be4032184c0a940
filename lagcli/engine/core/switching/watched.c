#include "switching/watched.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "methods/method.h"
#include "motion.h"
#include "step.h"
#include "switching/crossing.h"
#include "switching/kinks.h"
#include "switching/rows.h"
#include "switching/settle.h"

#define NOISE 1e-14         /* of the terms of phi and psi: their rounding error */
#define FORCE_NOISE 1e-13   /* of the largest force so far */
#define SOON 1e-3           /* of a step: when a function that grows is positive in spite of rounding */
#define CLEAR 0.1           /* of a cubic's spread: where it stays above that, its function is positive */
#define SHIFT 1e-7          /* of a step: what rates are differences over */
#define TOGETHER 1e-12      /* of the time, or of the step: roots of one instant */
#define EXACT 1e-14         /* of the step, beyond the rounding of the time: where a root is located */
#define ITERATIONS 200
#define NEAREST 4.0         /* of the error of a root: what is tried around the one of a polynomial, ... */
#define WIDER 64.0          /* ... then so much more, ... */
#define FARTHEST 0.01       /* ... up to this part of the bracket */
#define HALVINGS 7          /* of a step, where values at the nodes do not determine a function */
#define TRIES 20            /* brackets without a root, by rounding, until a function counts as positive */

/* The signed value of a condition's function at the state that its tape holds. */
static double condition_output(const lag_switching *sw, int which)
{
    return which < sw->conditions ? OUT(&sw->condition_tape, which)
                                  : OUT(&sw->force_condition_tape, which - sw->conditions);
}

static void evaluate_force_conditions(lag_run *run, double t, const double *y)
{
    const lag_switching *sw = &run->switching;
    lag_evaluate_forces(run, &sw->force_condition_tape, t, y, run->solver.a, sw->multipliers);
}

int lag_all_forces(lag_run *run, double t, const double *y)
{
    lag_switching *sw = &run->switching;
    double power;
    if (lag_accelerate(run, t, y, 0, &power))
        return 1;
    --run->step.evaluations;
    if (!sw->acting) {
        memset(sw->force, 0, (size_t)(sw->rows + sw->nf) * sizeof(double));
        sw->redundant = 0;
        lag_gather_multipliers(run, run->solver.multipliers, sw->force, sw->multipliers);
    } else if (sw->redundant) {
        lag_share_forces(run, t, y);
    }
    return 0;
}

double lag_condition_value(lag_run *run, int which, double t, const double *y)
{
    const lag_switching *sw = &run->switching;
    if (which < sw->conditions) {
        lag_evaluate(&sw->condition_tape, &run->system, t, y, LAG_ALL);
    } else {
        if (lag_all_forces(run, t, y))
            return NAN;
        evaluate_force_conditions(run, t, y);
    }
    return condition_output(sw, which);
}

/* Whether a function needs a and lambda. */
static int needs_forces(enum lag_watched what)
{
    return what == LAG_WATCH_FORCE || what == LAG_WATCH_SURFACE || what == LAG_WATCH_STICK || what == LAG_WATCH_SIGN
           || what == LAG_WATCH_MARGIN || what == LAG_WATCH_FORCE_CONDITION;
}

/* Whether a function belongs to a law that redundant rows obey together. */
static int shared(const lag_switching *sw, const lag_watched_function *w)
{
    const int of_row = w->what == LAG_WATCH_FORCE || w->what == LAG_WATCH_STICK || w->what == LAG_WATCH_SIGN;
    return of_row && sw->redundant && isfinite(sw->slack[w->which]);
}

int lag_watched_values(lag_run *run, double t, const double *y, double *values)
{
    lag_switching *sw = &run->switching;
    int rows = 0, forces = 0, conditions = 0, force_conditions = 0, sticks = 0, kinks = 0;
    for (int k = 0; k < sw->watched_count; ++k) {
        const enum lag_watched what = sw->watched[k].what;
        rows |= what == LAG_WATCH_GAP || what == LAG_WATCH_SLIP;
        forces |= needs_forces(what);
        conditions |= what == LAG_WATCH_CONDITION || what == LAG_WATCH_TIME;
        force_conditions |= what == LAG_WATCH_FORCE_CONDITION;
        sticks |= what == LAG_WATCH_STICK;
        kinks |= what == LAG_WATCH_KINK;
    }
    if (forces && lag_all_forces(run, t, y))
        return 1;
    if (rows && (!forces || !sw->acting) && lag_find_rows(run, t, y))
        return 1;
    if (conditions)
        lag_evaluate(&sw->condition_tape, &run->system, t, y, LAG_ALL);
    if (kinks) /* after the forces, which may use the tape elsewhere */
        lag_evaluate(&sw->kinks.tape, &run->system, t, y, LAG_ALL);
    if (force_conditions)
        evaluate_force_conditions(run, t, y);
    if (sticks)
        lag_evaluate_forces(run, &sw->limits, t, y, run->solver.a, sw->multipliers);
    for (int k = 0; k < sw->watched_count; ++k) {
        const lag_watched_function *w = sw->watched + k;
        double value = 0.0;
        switch (w->what) {
        case LAG_WATCH_GAP:
            value = sw->phi[w->which];
            break;
        case LAG_WATCH_SLIP:
            value = sw->psi[w->which];
            break;
        case LAG_WATCH_FORCE:
        case LAG_WATCH_SIGN:
            value = sw->force[w->which];
            break;
        case LAG_WATCH_STICK:
            value = OUT(&sw->limits, sw->limit[w->which]) - fabs(sw->force[w->which]);
            break;
        case LAG_WATCH_MARGIN:
            value = sw->margin;
            break;
        case LAG_WATCH_KINK:
            value = lag_kink_distance(run, w->which, w->sign);
            sw->kinks.size[w->which] = fmax(sw->kinks.size[w->which], lag_kink_size(run, w->which));
            break;
        case LAG_WATCH_SURFACE:
            value = w->sign > 0.0 ? sw->kinks.weight : sw->kinks.weight - 1.0;
            break;
        default:
            value = condition_output(sw, w->which);
        }
        if (shared(sw, w)) /* laws that the same forces obey: another share may obey them longer */
            value = w->sign * sw->slack[w->which];
        values[k] = w->sign * value + w->shift;
    }
    return 0;
}

/* The rates of the watched functions at (t, y), where y' is f, by a difference; `values` are there. */
static int rates(lag_run *run, double t, const double *y, const double *f, const double *values,
                 double *out)
{
    lag_switching *sw = &run->switching;
    const int moving = 2 * run->system.nq;
    int gaps = 1;
    for (int k = 0; k < sw->watched_count; ++k)
        gaps &= sw->watched[k].what == LAG_WATCH_GAP;
    if (gaps) { /* whose rates are at hand */
        for (int k = 0; k < sw->watched_count; ++k)
            out[k] = sw->psi[sw->watched[k].which];
        return 0;
    }
    const double shift = SHIFT * (run->step.h > 0.0 ? run->step.h : 1.0);
    for (int i = 0; i < moving; ++i)
        sw->y[i] = y[i] + shift * f[i];
    sw->y[moving] = y[moving];
    if (lag_watched_values(run, t + shift, sw->y, out))
        return 1;
    for (int k = 0; k < sw->watched_count; ++k)
        out[k] = (out[k] - values[k]) / shift;
    return 0;
}

static void add(lag_switching *sw, enum lag_watched what, int which, double sign)
{
    sw->watched[sw->watched_count++] = (lag_watched_function){.what = what, .which = which, .sign = sign};
}

/* List what the modes ask for. */
static void list(lag_switching *sw)
{
    int slipping = 0;
    sw->watched_count = 0;
    for (int i = 0; i < sw->rows; ++i) {
        const int direction = lag_row_slips(sw, i);
        if (!sw->active[i])
            continue;
        if (direction) {
            add(sw, LAG_WATCH_SLIP, i, direction);
            slipping = 1;
        } else if (sw->law[i] == LAG_UNILATERAL) {
            add(sw, sw->mode[i] == LAG_OPEN ? LAG_WATCH_GAP : LAG_WATCH_FORCE, i, 1.0);
        } else if (sw->law[i] == LAG_LIMITED && sw->mode[i] == LAG_HOLDS) {
            add(sw, LAG_WATCH_STICK, i, 1.0);
        } else if (sw->law[i] == LAG_FREE && i >= sw->exported) {
            add(sw, LAG_WATCH_SIGN, i, sw->force[i] < 0.0 ? -1.0 : 1.0);
        }
    }
    if (slipping)
        add(sw, LAG_WATCH_MARGIN, 0, 1.0);
    for (int k = 0; k < sw->kinks.count; ++k) {
        const enum lag_watched what = k == sw->kinks.slides ? LAG_WATCH_SURFACE : LAG_WATCH_KINK;
        const int both = what == LAG_WATCH_SURFACE || sw->kinks.whole[k];
        if (both || sw->kinks.branch[k] > 0.0)
            add(sw, what, k, 1.0);
        if (both || sw->kinks.branch[k] < 0.0)
            add(sw, what, k, -1.0);
    }
    for (int c = 0; c < sw->conditions + sw->force_conditions; ++c)
        add(sw,
            c >= sw->conditions ? LAG_WATCH_FORCE_CONDITION
            : sw->condition[c].time ? LAG_WATCH_TIME
                                    : LAG_WATCH_CONDITION,
            c, sw->condition[c].holds ? 1.0 : -1.0);
}

/* The rounding error of a watched function. */
static double rounding_of(lag_switching *sw, const lag_watched_function *w)
{
    if (needs_forces(w->what) && w->what != LAG_WATCH_FORCE_CONDITION && w->what != LAG_WATCH_SURFACE)
        for (int i = 0; i < sw->rows; ++i)
            sw->strength = fmax(sw->strength, fabs(sw->force[i]));
    switch (w->what) {
    case LAG_WATCH_GAP:
        return NOISE * sw->size[w->which];
    case LAG_WATCH_SLIP:
        return NOISE * sw->speed[w->which];
    case LAG_WATCH_KINK:
        return NOISE * sw->kinks.size[w->which];
    case LAG_WATCH_SURFACE:
        return FORCE_NOISE;
    case LAG_WATCH_FORCE:
    case LAG_WATCH_STICK:
    case LAG_WATCH_SIGN:
        return FORCE_NOISE * sw->strength;
    default:
        return 0.0;
    }
}

int lag_watch_modes(lag_run *run, double t, const double *y, const double *f)
{
    lag_switching *sw = &run->switching;
    list(sw);
    if (!sw->watched_count)
        return LAG_RUNNING;
    double *found = sw->values, *slopes = sw->node_values;
    if (lag_watched_values(run, t, y, found) || rates(run, t, y, f, found, slopes))
        return LAG_UNDEFINED;
    for (int k = 0; k < sw->watched_count; ++k) {
        lag_watched_function *w = sw->watched + k;
        const double rounding = rounding_of(sw, w);
        if (found[k] + SOON * slopes[k] * run->step.h < rounding) /* and it stays so */
            w->shift = rounding - fmin(found[k], 0.0);
        w->noise = found[k] < rounding ? rounding : 0.0;
        w->value = fmax(found[k] + w->shift, 0.0);
        w->rate = slopes[k];
    }
    sw->since = t;
    return LAG_RUNNING;
}

/* Whether a watched function depends on t alone. */
static int is_of_time(const lag_switching *sw, const lag_watched_function *w)
{
    return w->what == LAG_WATCH_TIME || (w->what == LAG_WATCH_KINK && sw->kinks.time[w->which]);
}

/* A watched function inside the last step. */
static double value_inside(lag_run *run, int k, double t)
{
    lag_switching *sw = &run->switching;
    const lag_watched_function *w = sw->watched + k;
    if (is_of_time(sw, w)) {
        memcpy(sw->y, run->step.y_new, (size_t)lag_size(&run->system) * sizeof(double));
        const lag_tape *tape = w->what == LAG_WATCH_TIME ? &sw->condition_tape : &sw->kinks.tape;
        lag_evaluate(tape, &run->system, t, sw->y, LAG_ALL);
        return w->sign * (w->what == LAG_WATCH_TIME ? condition_output(sw, w->which)
                                                    : lag_kink_distance(run, w->which, w->sign));
    }
    lag_dense(run, t, sw->y);
    return lag_watched_values(run, t, sw->y, sw->values) ? NAN : sw->values[k];
}

/* The first time at which a function is negative, between one at which it counts as positive and one at
 * which it is negative: regula falsi with halved ends (Illinois), and bisections. Functions of time alone are
 * followed to the last digit. */
static double locate(lag_run *run, int k, double low, double high, double b)
{
    const int time = is_of_time(&run->switching, run->switching.watched + k);
    const double exact = time ? 0.0 : EXACT * run->step.h_old + DBL_EPSILON * fabs(high);
    double a = fmax(value_inside(run, k, low), 0.0);
    if (a == 0.0)
        a = -b;
    for (int i = 0; i < ITERATIONS && high - low > exact; ++i) {
        const double width = high - low;
        double t = i % 3 == 2 || time ? low + 0.5 * width : high - b * width / (b - a);
        if (time && (t <= low || t >= high))
            break;
        /* a step beyond the root, so that the interval closes from both sides */
        if (!time)
            t = fmin(fmax(t, low + 0.5 * exact), high - 0.5 * exact);
        const double g = value_inside(run, k, t);
        if (g < 0.0 || (time && g == 0.0)) {
            high = t;
            b = g;
            a *= 0.5;
        } else {
            low = t;
            a = g;
            b *= 0.5;
        }
    }
    return high;
}

/* The same, where the root is expected at `guess`: brackets around it are tried first. */
static double locate_near(lag_run *run, int k, double low, double high, double b, double guess)
{
    const double least = EXACT * run->step.h_old + DBL_EPSILON * fabs(high), whole = high - low;
    for (double width = NEAREST * least; width < FARTHEST * whole; width *= WIDER) {
        const double before = guess - width, after = guess + width;
        const double value = after < high && after > low ? value_inside(run, k, after) : b;
        if (!(value < 0.0)) {
            low = after;
            continue;
        }
        if (after < high) {
            high = after;
            b = value;
        }
        if (!(before > low))
            break;
        const double earlier = value_inside(run, k, before);
        if (!(earlier < 0.0)) {
            low = before;
            break;
        }
        high = before;
        b = earlier;
    }
    return locate(run, k, low, high, b);
}

static double first_between(lag_run *run, int k, double low, double high, const double *given, int halvings);

/* By the polynomial through values at the nodes of an interval. */
static double by_polynomial(lag_run *run, int k, double low, double high, const double *values)
{
    const lag_switching *sw = &run->switching;
    double bernstein[NODES], begin, end, from = 0.0;
    for (int i = 0; i < NODES; ++i) {
        bernstein[i] = 0.0;
        for (int j = 0; j < NODES; ++j)
            bernstein[i] += sw->to_bernstein[i * NODES + j] * values[j];
    }
    bernstein[NODES - 1] = values[NODES - 1];
    for (int i = 0; i < TRIES && lag_first_change(bernstein, from, &begin, &end); ++i) {
        const double after = end == 1.0 ? high : low + end * (high - low);
        const double b = value_inside(run, k, after);
        const int soon = after - sw->since < SOON * (run->step.t - sw->since);
        if (b < (soon ? -sw->watched[k].noise : 0.0)) {
            const double guess = low + lag_estimate_root(bernstein, begin, end) * (high - low);
            return locate_near(run, k, low + begin * (high - low), after, b, guess);
        }
        from = end; /* it only touches zero, as far as that can be told */
    }
    return INFINITY;
}

/* Whether values are well above zero. */
static int clearly_positive(const double *values)
{
    double least = INFINITY, most = 0.0;
    for (int i = 0; i < NODES; ++i) {
        least = fmin(least, values[i]);
        most = fmax(most, values[i]);
    }
    return least > 0.5 * most;
}

/* The first time between two at which a function becomes negative, or infinity; `given`: its values at the
 * nodes, where they are known. */
static double first_between(lag_run *run, int k, double low, double high, const double *given, int halvings)
{
    double values[NODES];
    if (given)
        memcpy(values, given, sizeof values);
    else
        for (int i = 0; i < NODES; ++i)
            values[i] = value_inside(run, k, i == NODES - 1 ? high : low + lag_node(i) * (high - low));
    for (int i = 0; i < NODES; ++i)
        if (isnan(values[i]))
            return INFINITY;
    if (low <= run->switching.since)
        values[0] = fmax(values[0], 0.0);
    if (!lag_resolved(values) && halvings > 0) {
        if (clearly_positive(values))
            return INFINITY;
        const double middle = 0.5 * (low + high);
        const double before = first_between(run, k, low, middle, 0, halvings - 1);
        return before < INFINITY ? before : first_between(run, k, middle, high, 0, halvings - 1);
    }
    return by_polynomial(run, k, low, high, values);
}

/* Whether a function is positive all along the last step, by its values and rates at the ends. */
static int idle(const lag_watched_function *w, double value, double rate, double h)
{
    const double b[] = {w->value, w->value + h * w->rate / 3.0, value - h * rate / 3.0, value};
    double least = b[0], most = b[0];
    for (int i = 1; i < 4; ++i) {
        least = fmin(least, b[i]);
        most = fmax(most, b[i]);
    }
    return least > CLEAR * (most - least) && least > 0.0;
}

/* Whether nothing happens as a function becomes negative: a condition ends that happens as it begins. */
static int ends_silently(const lag_switching *sw, const lag_watched_function *w)
{
    return w->what >= LAG_WATCH_CONDITION && sw->condition[w->which].holds
           && !sw->condition[w->which].either;
}

/* When a function first becomes negative after `since`, passing over conditions that end without anything
 * happening. */
static double first_of(lag_run *run, int k, const double *nodes)
{
    lag_switching *sw = &run->switching;
    lag_watched_function *w = sw->watched + k;
    const double low = sw->since, found = first_between(run, k, low, run->step.t, nodes, HALVINGS);
    if (!ends_silently(sw, w))
        return found;
    if (!(found < run->step.t))
        return INFINITY;
    w->sign = -w->sign; /* it may become true again */
    const double again = first_between(run, k, found, run->step.t, 0, HALVINGS);
    w->sign = -w->sign;
    return again;
}

int lag_find_instant(lag_run *run)
{
    lag_switching *sw = &run->switching;
    const int count = sw->watched_count;
    const double t = run->step.t, low = sw->since, h = t - low;
    double *found = sw->values, *slopes = sw->node_values;
    const double *y = run->step.y_new, *f = run->step.f_new;
    int busy = 0;
    if (!count)
        return 0;
    if (!run->stepped->uses_slope) {
        if (lag_derivative(run, t, y, sw->slope))
            return -1;
        --run->step.evaluations;
        f = sw->slope;
    }
    if (lag_watched_values(run, t, y, found) || rates(run, t, y, f, found, slopes))
        return -1;
    for (int k = 0; k < count; ++k) {
        lag_watched_function *w = sw->watched + k;
        w->hit = 0;
        if (idle(w, found[k], slopes[k], h)) {
            w->value = found[k];
            w->rate = slopes[k];
        } else {
            w->hit = -1; /* to be looked at */
            busy = 1;
        }
    }
    if (!busy) {
        for (int k = 0; k < count; ++k)
            sw->watched[k].noise = 0.0;
        sw->since = t;
        return 0;
    }
    double *nodes = sw->node_values;
    for (int i = 0; i < NODES; ++i) {
        const double at = i == NODES - 1 ? t : low + lag_node(i) * h;
        lag_dense(run, at, sw->y);
        if (lag_watched_values(run, at, sw->y, sw->values))
            return -1;
        for (int k = 0; k < count; ++k)
            nodes[k * NODES + i] = sw->values[k];
    }
    double first = INFINITY, *times = sw->times;
    for (int k = 0; k < count; ++k) {
        times[k] = sw->watched[k].hit ? first_of(run, k, nodes + k * NODES) : INFINITY;
        first = fmin(first, times[k]);
    }
    const double together = first + TOGETHER * fmax(fabs(first), run->step.h_old);
    for (int k = 0; k < count; ++k)
        sw->watched[k].hit = times[k] <= together;
    if (first < INFINITY) {
        sw->instant = first;
        return 1;
    }
    if (lag_watched_values(run, t, y, found) || rates(run, t, y, f, found, slopes))
        return -1;
    for (int k = 0; k < count; ++k) {
        lag_watched_function *w = sw->watched + k;
        const int ended = found[k] < 0.0 && ends_silently(sw, w);
        if (ended) {
            sw->condition[w->which].holds = 0;
            w->sign = -w->sign;
        }
        w->value = fmax(ended ? -found[k] : found[k], 0.0);
        w->rate = ended ? -slopes[k] : slopes[k];
        w->noise = 0.0;
    }
    sw->since = t;
    return 0;
}
