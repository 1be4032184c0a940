#include "switching/watched.h"

#include <float.h>
#include <math.h>

#include "methods/method.h"
#include "motion.h"
#include "switching/enclosure.h"
#include "switching/kinks.h"
#include "switching/rows.h"
#include "switching/settle.h"
#include "switching/surfaces.h"

#define NOISE 1e-14         /* of the terms of phi and psi: their rounding error */
#define FORCE_NOISE 1e-13   /* of the largest force so far */
#define CONDITION_NOISE 1e-14 /* of the largest value of a condition */
#define TOGETHER 1e-12      /* of the run, ... */
#define TOGETHER_IN_STEP 1e-13 /* ... or of the step, in addition to ... */
#define TOGETHER_IN_TIME (8.0 * DBL_EPSILON) /* ... the rounding of the time: roots at one instant */
#define LOOSE 100.0         /* of the tolerances: how far dense outputs of implicit methods may be off within a step */
#define TWICE 2.0           /* the error of a root: what it still may be after the instant */
#define BEYOND_ROOT 16.0    /* the error of a root: of a sign, whose slope may change there */
#define LARGEST_ERROR 1e3   /* times the rounding error of a sign: its root's error is not larger */
#define SHIFT 1e-7          /* of a step: interval of difference quotients */

/* The signed value of a condition's function at the state of its tape. */
static double condition_output(const lag_switching *sw, int which)
{
    return which < sw->conditions ? OUT(&sw->condition_tape, which)
                                  : OUT(&sw->force_condition_tape, which - sw->conditions);
}

static void evaluate_force_conditions(lag_run *run, double t, const double *y)
{
    const lag_switching *sw = &run->switching;
    lag_evaluate_laws(run, &sw->force_condition_tape, t, y, run->solver.a, sw->multipliers, LAG_OF_STEP);
}

/* The functions of signs, of forces as the laws have them, and their largest sizes. */
static void evaluate_signs(lag_run *run, double t, const double *y)
{
    lag_switching *sw = &run->switching;
    if (sw->holds_sides)
        lag_evaluate_laws(run, &sw->sign_tape, t, y, run->solver.a, sw->multipliers, LAG_OF_STEP);
    else
        lag_find_sides(run, t, y, run->solver.a, sw->multipliers);
    for (int s = 0; s < sw->signs; ++s) {
        sw->sign_value[s] = OUT(&sw->sign_tape, s);
        sw->sign_size[s] = fmax(sw->sign_size[s], OUT(&sw->sign_tape, sw->signs + s));
    }
    for (int i = 0; i < sw->nc; ++i)
        sw->strength = fmax(sw->strength, fabs(sw->multipliers[i]));
}

static double noise_of_sign(const lag_switching *sw, int which)
{
    return FORCE_NOISE * fmax(sw->sign_size[which], sw->strength);
}

int lag_all_forces(lag_run *run, double t, const double *y)
{
    lag_switching *sw = &run->switching;
    double power;
    if (lag_accelerate_alone(run, t, y, 0, &power))
        return 1;
    --run->step.evaluations;
    if (!sw->acting) /* and all forces are zero */
        lag_gather_multipliers(run, run->solver.multipliers, sw->force, sw->multipliers);
    if (sw->signs)
        evaluate_signs(run, t, y);
    if (sw->acting && sw->redundant)
        lag_share_forces(run, t, y);
    return 0;
}

/* What a sign may be off zero: its rounding error or, where it has turned at this instant, that of the root. */
static double error_of_sign(const lag_switching *sw, int which)
{
    const double noise = noise_of_sign(sw, which);
    if (!sw->turned[which])
        return noise;
    return fmax(noise, fmin(BEYOND_ROOT * fabs(sw->sign_before[which]), LARGEST_ERROR * noise));
}

/* Change signs until they are those of the functions, with the forces that follow from them. Returns LAG_RUNNING, or
 * LAG_NO_SIDE or LAG_UNDEFINED. */
static int settle_sides(lag_run *run)
{
    lag_switching *sw = &run->switching;
    for (int pass = 0; pass <= sw->signs + 1; ++pass) {
        int changed = 0;
        if (lag_all_forces(run, run->step.t, run->step.y))
            return LAG_UNDEFINED;
        for (int s = 0; s < sw->signs; ++s) {
            const double value = sw->sign_value[s], noise = error_of_sign(sw, s);
            const int reached = sw->side[s] < 0.0 && sw->sign_before[s] < -noise && value >= -noise; /* by a jump */
            if (reached || sw->side[s] * value < -noise) {
                sw->side[s] = -sw->side[s];
                sw->turned[s] = -sw->turned[s];
                changed = 1;
            }
        }
        if (!changed)
            return LAG_RUNNING;
    }
    return LAG_NO_SIDE;
}

int lag_choose_sides(lag_run *run)
{
    lag_switching *sw = &run->switching;
    if (!sw->signs)
        return LAG_RUNNING;
    if (!sw->begun) {
        if (lag_all_forces(run, run->step.t, run->step.y))
            return LAG_UNDEFINED;
        for (int s = 0; s < sw->signs; ++s)
            sw->side[s] = sw->sign_value[s] < 0.0 ? -1.0 : 1.0;
    }
    for (int s = 0; s < sw->signs; ++s)
        if (sw->turned[s])
            sw->side[s] = -sw->side[s];
    sw->holds_sides = 1;
    int status = settle_sides(run);
    for (int s = 0; s < sw->signs; ++s) {
        /* it is back, where it was about to leave */
        if (status == LAG_RUNNING && sw->turned[s] < 0 && fabs(sw->sign_value[s]) <= error_of_sign(sw, s))
            status = LAG_NO_SIDE;
        sw->turned[s] = 0;
        sw->sign_before[s] = sw->sign_value[s];
    }
    return status;
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

/* Whether a function belongs to a law that redundant rows satisfy together. */
static int shared(const lag_switching *sw, const lag_watched_function *w)
{
    const int of_row = w->what == LAG_WATCH_FORCE || w->what == LAG_WATCH_STICK;
    return of_row && sw->redundant && isfinite(sw->slack[w->which]);
}

/* The value of a function of (t, q, v) by its tape, which holds the state. */
static double value_of(const lag_run *run, const lag_watched_function *w)
{
    const lag_switching *sw = &run->switching;
    switch (w->what) {
    case LAG_WATCH_GAP:
        return sw->phi[w->which];
    case LAG_WATCH_SLIP:
        return sw->psi[w->which];
    case LAG_WATCH_KINK:
        return lag_kink_distance(run, w->which, w->sign);
    default:
        return condition_output(sw, w->which);
    }
}

double lag_watched_value(lag_run *run, const lag_watched_function *w, double t, const double *y)
{
    lag_switching *sw = &run->switching;
    double value;
    ++sw->looks;
    if (w->what == LAG_WATCH_GAP) {
        value = sw->sign[w->which] * lag_gap_at(run, w->which, t, y);
    } else if (w->what == LAG_WATCH_SLIP) {
        value = lag_find_rows(run, t, y) ? NAN : value_of(run, w);
    } else {
        lag_evaluate(w->what == LAG_WATCH_KINK ? &sw->kinks.tape : &sw->condition_tape, &run->system, t, y, LAG_ALL);
        value = value_of(run, w);
    }
    return w->sign * value + w->shift;
}

int lag_watched_values(lag_run *run, enum lag_of which, double t, const double *y, double *values)
{
    lag_switching *sw = &run->switching;
    int forces = 0, sticks = 0;
    ++sw->looks;
    for (int k = 0; k < sw->watched_count; ++k) {
        forces |= !lag_is_enclosed(sw->watched[k].what);
        sticks |= sw->watched[k].what == LAG_WATCH_STICK;
    }
    if (forces && lag_all_forces(run, t, y))
        return 1;
    if (which == LAG_WATCHED) { /* after the forces, which may evaluate the tapes at other states */
        if (sw->rows && lag_find_rows(run, t, y))
            return 1;
        if (sw->conditions)
            lag_evaluate(&sw->condition_tape, &run->system, t, y, LAG_ALL);
        if (sw->kinks.count)
            lag_evaluate(&sw->kinks.tape, &run->system, t, y, LAG_ALL);
    }
    if (sw->force_conditions)
        evaluate_force_conditions(run, t, y);
    if (sticks)
        lag_evaluate_laws(run, &sw->limits, t, y, run->solver.a, sw->multipliers, LAG_OF_STEP);
    for (int k = 0; k < sw->watched_count; ++k) {
        const lag_watched_function *w = sw->watched + k;
        double value = 0.0;
        if (which == LAG_SAMPLED && lag_is_enclosed(w->what))
            continue;
        switch (w->what) {
        case LAG_WATCH_FORCE:
            value = sw->force[w->which];
            break;
        case LAG_WATCH_SIGN:
            value = sw->sign_value[w->which];
            break;
        case LAG_WATCH_STICK:
            value = w->sign * OUT(&sw->limits, sw->limit[w->which]) - sw->force[w->which];
            break;
        case LAG_WATCH_MARGIN:
            value = sw->margin;
            break;
        case LAG_WATCH_SURFACE:
            value = w->sign > 0.0 ? sw->kinks.weight : sw->kinks.weight - 1.0;
            break;
        default:
            value = value_of(run, w);
        }
        if (shared(sw, w)) /* laws for the same forces: another distribution may satisfy them longer */
            value = w->sign * sw->slack[w->which];
        values[k] = w->sign * value + w->shift;
    }
    return 0;
}

/* Update the largest sizes of gaps and of functions of branches at a state of the motion, but not at a trial state
 * beyond an instant. Returns 0, or 1 where a gap is undefined. */
static int measure(lag_run *run, double t, const double *y)
{
    lag_switching *sw = &run->switching;
    if (sw->rows && lag_measure_rows(run, t, y))
        return 1;
    if (!sw->kinks.count)
        return 0;
    lag_evaluate(&sw->kinks.tape, &run->system, t, y, LAG_ALL);
    for (int k = 0; k < sw->kinks.count; ++k)
        sw->kinks.size[k] = fmax(sw->kinks.size[k], lag_kink_size(run, k));
    return 0;
}

/* The rates of watched functions at (t, y), where y' is f; `values` are there. Those of gaps are their psi,
 * so that a gap of rounding size does not seem to grow; the others are differences, undefined if no step follows. */
static int rates(lag_run *run, enum lag_of which, double t, const double *y, const double *f, const double *values,
                 double *out)
{
    lag_switching *sw = &run->switching;
    const int moving = 2 * run->system.nq;
    const double shift = SHIFT * run->step.h;
    int gaps = 1;
    for (int k = 0; k < sw->watched_count; ++k)
        gaps &= sw->watched[k].what == LAG_WATCH_GAP;
    if (!gaps) {
        for (int i = 0; i < moving; ++i)
            sw->y[i] = y[i] + shift * f[i];
        sw->y[moving] = y[moving];
        if (lag_watched_values(run, which, t + shift, sw->y, out))
            return 1;
    }
    for (int k = 0; k < sw->watched_count; ++k) {
        const lag_watched_function *w = sw->watched + k;
        out[k] = w->what == LAG_WATCH_GAP ? sw->psi[w->which] : (out[k] - values[k]) / shift;
    }
    return 0;
}

static void add(lag_switching *sw, enum lag_watched what, int which, double sign)
{
    sw->watched[sw->watched_count++] = (lag_watched_function){.what = what, .which = which, .sign = sign};
}

/* List the functions of the current modes. */
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
            add(sw, LAG_WATCH_STICK, i, -1.0);
        }
    }
    for (int s = 0; s < sw->signs; ++s)
        add(sw, LAG_WATCH_SIGN, s, sw->side[s]);
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
            : sw->condition[c].time == LAG_TIME_ALONE ? LAG_WATCH_TIME
                                                      : LAG_WATCH_CONDITION,
            c, sw->condition[c].holds ? 1.0 : -1.0);
}

double lag_condition_noise(const lag_condition *condition)
{
    return condition->time == LAG_TIME_ALONE ? 0.0 : CONDITION_NOISE * condition->largest;
}

double lag_watched_noise(lag_run *run, const lag_watched_function *w)
{
    lag_switching *sw = &run->switching;
    switch (w->what) {
    case LAG_WATCH_GAP:
        return NOISE * sw->size[w->which];
    case LAG_WATCH_SLIP:
        return NOISE * sw->speed[w->which];
    case LAG_WATCH_KINK:
        return NOISE * sw->kinks.size[w->which];
    case LAG_WATCH_SURFACE:
        return FORCE_NOISE;
    case LAG_WATCH_SIGN:
        return noise_of_sign(sw, w->which);
    case LAG_WATCH_FORCE:
    case LAG_WATCH_STICK:
        for (int i = 0; i < sw->rows; ++i)
            sw->strength = fmax(sw->strength, fabs(sw->force[i]));
        return FORCE_NOISE * sw->strength;
    case LAG_WATCH_CONDITION:
    case LAG_WATCH_FORCE_CONDITION:
        return lag_condition_noise(sw->condition + w->which);
    default:
        return 0.0;
    }
}

int lag_watched_ends(lag_run *run, enum lag_of which, double t, const double *y, const double *f, double *values,
                     double *slopes)
{
    if (lag_watched_values(run, which, t, y, values))
        return 1;
    return rates(run, which, t, y, f, values, slopes);
}

int lag_watch_on(lag_run *run, double t, const double *y, const double *values, const double *slopes)
{
    lag_switching *sw = &run->switching;
    if (measure(run, t, y))
        return 1;
    for (int k = 0; k < sw->watched_count; ++k) {
        lag_watched_function *w = sw->watched + k;
        if (lag_is_enclosed(w->what)) {
            if (w->clear)
                w->noise = 0.0;
            w->stray = 0.0;
            if (w->what >= LAG_WATCH_CONDITION && sw->condition[w->which].rests == LAG_LEAVES_ZERO)
                sw->condition[w->which].rests = LAG_OFF_ZERO;
            continue;
        }
        if (w->what == LAG_WATCH_FORCE_CONDITION)
            sw->condition[w->which].largest = fmax(sw->condition[w->which].largest, fabs(values[k]));
        w->value = fmax(values[k], 0.0);
        w->rate = slopes[k];
    }
    sw->since = t;
    return 0;
}

int lag_penetrates(lag_run *run)
{
    for (int k = 0; k < run->switching.watched_count; ++k) {
        const lag_watched_function *w = run->switching.watched + k;
        if (w->what == LAG_WATCH_GAP && w->stray > 0.0
            && lag_watched_value(run, w, run->step.t, run->step.y_new) < -fmax(w->noise, lag_watched_noise(run, w)))
            return 1;
    }
    return 0;
}

int lag_ends_silently(const lag_switching *sw, const lag_watched_function *w)
{
    return w->what >= LAG_WATCH_CONDITION && sw->condition[w->which].holds
           && !sw->condition[w->which].either;
}

double lag_one_instant(const lag_run *run, double t)
{
    return fmax(TOGETHER * (t - run->step.t_start), TOGETHER_IN_STEP * run->step.h_old) + TOGETHER_IN_TIME * fabs(t);
}

/* The time until which a function that has just changed its sign may do so again, due to rounding or because it is
 * a bit later than others at this instant. */
static double resolved_from(const lag_run *run, const lag_watched_function *w, double t)
{
    const lag_switching *sw = &run->switching;
    const int just_now = w->what >= LAG_WATCH_CONDITION ? sw->condition[w->which].happened
                         : w->what == LAG_WATCH_KINK    ? sw->kinks.state[w->which] != LAG_OFF_SURFACE
                                                        : 0;
    return just_now ? t + 2.0 * lag_one_instant(run, t) : t;
}

/* How far the dense output may be off a gap that opens from zero, or another function that does not leave zero at once.
 * Those of implicit methods do not have the slope of the step's start there. */
static double error_of_dense(lag_run *run, int k, double t, const double *y, int stays)
{
    const lag_switching *sw = &run->switching;
    const lag_watched_function *w = sw->watched + k;
    if (run->method->uses_slope || run->method->uses_series || !lag_is_enclosed(w->what) || lag_is_of_time(sw, w)
        || !(stays || w->what == LAG_WATCH_GAP))
        return 0.0;
    const double error = lag_error_of_states(run, k, t, y, LOOSE);
    return isfinite(error) ? error : 0.0;
}

/* Whether a condition begins at its value: it has just happened, or rests there, or the run starts. */
static int begins(const lag_run *run, const lag_watched_function *w, double t)
{
    const lag_condition *condition = run->switching.condition + w->which;
    return condition->happened || condition->rests || !(t > run->step.t_start);
}

/* What a condition may be off zero where it begins at zero: its rounding error or, where it has just happened, that of
 * the root. */
static double error_at_zero(const lag_condition *condition, double rounding)
{
    const double noise = lag_condition_noise(condition);
    return fmax(rounding, condition->happened ? fmax(noise, TWICE * condition->off) : noise);
}

/* Whether a condition that happens either way is zero at the beginning, but for its error there, and leaves zero
 * towards its other side: it has just happened and turns back, or begins at zero. The difference, which may be rounding
 * or reach beyond another root, is for functions that have no slope there. */
static int turns_back(const lag_run *run, const lag_watched_function *w, double value, double difference,
                      lag_interval slope, double rounding)
{
    const lag_condition *condition = run->switching.condition + w->which;
    const double along = lag_interval_sign(slope) ? 0.5 * (slope.low + slope.high) : difference;
    if (!condition->either || !begins(run, w, run->step.t) || !(along < 0.0))
        return 0;
    return fabs(value) <= -along * (w->resolved - run->step.t) + error_at_zero(condition, rounding);
}

/* Whether a condition that happens either way is zero at the beginning and remains so at first: one that begins so, or
 * that an action has put there. One that a row brings to zero and holds there has been positive or negative. The
 * difference is for slopes that have no bounds. */
static int rests_at_zero(lag_run *run, const lag_watched_function *w, double value, double difference,
                         lag_interval slope, double rounding)
{
    const lag_condition *condition = run->switching.condition + w->which;
    const double t = run->step.t;
    const double along = lag_interval_size(slope) < INFINITY ? 0.5 * (slope.low + slope.high) : difference;
    const double zero = along == 0.0 || condition->happened ? error_at_zero(condition, rounding) : rounding;
    if (!condition->either || !begins(run, w, t) || fabs(value) + fabs(SOON * along * run->step.h) > zero)
        return 0;
    return condition->rests || !(t > run->step.t_start) || !(lag_held_error(run, w->which, t, run->step.y) > 0.0);
}

/* The rounding error of a function at the beginning: that of a condition by its enclosure, unless it jumps there. */
static double rounding_at(lag_run *run, const lag_watched_function *w, lag_interval value)
{
    const double usual = lag_watched_noise(run, w), width = value.high - value.low;
    if (w->what != LAG_WATCH_CONDITION)
        return usual;
    return width <= WRONG * usual || run->switching.enclosure.held ? width : usual;
}

int lag_watch_modes(lag_run *run, double t, const double *y, const double *f)
{
    lag_switching *sw = &run->switching;
    list(sw);
    if (!sw->watched_count)
        return LAG_RUNNING;
    double *values = sw->values, *slopes = sw->node_values;
    if (lag_watched_ends(run, LAG_WATCHED, t, y, f, values, slopes) || measure(run, t, y))
        return LAG_UNDEFINED;
    for (int k = 0; k < sw->watched_count; ++k) {
        lag_watched_function *w = sw->watched + k;
        lag_interval jet[2] = {LAG_ANYTHING, LAG_ANYTHING};
        if (w->what == LAG_WATCH_CONDITION || (w->what == LAG_WATCH_TIME && sw->condition[w->which].either))
            lag_enclose_at(run, k, t, y, f, jet);
        const double rounding = rounding_at(run, w, jet[0]);
        w->resolved = resolved_from(run, w, t);
        if (w->what >= LAG_WATCH_CONDITION) {
            lag_condition *condition = sw->condition + w->which;
            if (turns_back(run, w, values[k], slopes[k], jet[1], rounding)) {
                condition->holds = !condition->holds;
                w->sign = -w->sign;
                values[k] = -values[k];
                slopes[k] = -slopes[k];
                jet[1] = lag_interval_scale(jet[1], -1.0);
            }
            condition->rests = rests_at_zero(run, w, values[k], slopes[k], jet[1], rounding);
        }
        const int other = w->what >= LAG_WATCH_CONDITION && !begins(run, w, t); /* the instant of others */
        if (!other && values[k] + SOON * slopes[k] * run->step.h < rounding) /* and it remains so */
            w->shift = rounding - fmin(values[k], 0.0);
        w->noise = values[k] < rounding ? fmax(rounding, -values[k]) : 0.0;
        if (w->what == LAG_WATCH_CONDITION && slopes[k] == 0.0 && fabs(values[k]) <= lag_watched_noise(run, w))
            w->noise = fmax(w->noise, lag_watched_noise(run, w)); /* it rests next to zero, by a rounding error */
        const double zero = fmax(rounding, lag_watched_noise(run, w));
        const int stays = fabs(values[k]) <= zero && fabs(SOON * slopes[k] * run->step.h) <= zero;
        w->stray = w->noise > 0.0 || stays ? error_of_dense(run, k, t, y, stays) : 0.0;
        if (w->what >= LAG_WATCH_CONDITION
            && w->noise > fmax(WRONG * lag_watched_noise(run, w), TWICE * sw->condition[w->which].off))
            w->noise = rounding; /* it jumps at the instant */
        if (w->what >= LAG_WATCH_CONDITION && sw->condition[w->which].rests)
            w->noise = fmax(w->noise, fabs(values[k]));
        w->value = fmax(values[k] + w->shift, 0.0);
        w->rate = slopes[k];
    }
    sw->since = t;
    return LAG_RUNNING;
}
