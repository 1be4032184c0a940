#include "switching/search.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "breaks.h"
#include "methods/method.h"
#include "motion.h"
#include "roots.h"
#include "step.h"
#include "switching/clock.h"
#include "switching/crossing.h"
#include "switching/enclosure.h"
#include "switching/rows.h"
#include "switching/watched.h"

#define CLEAR 0.5           /* of a cubic's range: a function above that is positive */
#define NEAREST 4.0         /* of the error of a root: first bracket around the root of the polynomial, ... */
#define WIDER 64.0          /* ... growth of the bracket, ... */
#define FARTHEST 0.01       /* ... up to this part of the bracket */
#define HALVINGS 7          /* of a step, if values at the nodes do not determine a function */
#define TRIES 20            /* brackets without a root, due to rounding, after which a function counts as positive */
#define PARTS 256           /* intervals that wait */
#define MOST_PARTS 1000000  /* intervals of one function in one step after which its sign cannot be determined */
#define NARROW 2.3e-16      /* of the time, or of a hundredth of the step: width of an interval that is not halved */
#define TOUCHES 4.0         /* of the error of a value: a function within that is not negative */
#define EARLY 0.25          /* of an interval: where a concave function is looked for above zero; after an impact, steps
                               are twice a flight */
#define SHARP 60            /* halvings in the location of a minimum */
#define EARLIEST 0x1p-40    /* of a step: where it is asked first to which side a function leaves zero */

/* Accuracy of a root before t, in the last step. */
static double exact_in(const lag_run *run, double t)
{
    return EXACT_TIME * run->step.h_old + DBL_EPSILON * fabs(t);
}

/* A watched function along the last step. */
typedef struct {
    lag_run *run;
    int k;
    double noise;                      /* it is negative below minus that: until it has been positive beyond, ... */
    double rounding;                   /* ... and after that */
    int64_t parts;                     /* intervals that were looked at */
} along_step;

static double value_inside(void *context, double t)
{
    const along_step *f = context;
    lag_run *run = f->run;
    lag_switching *sw = &run->switching;
    const lag_watched_function *w = sw->watched + f->k;
    if (lag_is_of_time(sw, w))
        return lag_watched_value(run, w, t, run->step.y_new);
    lag_dense_often(run, t, sw->y);
    if (lag_is_enclosed(w->what))
        return lag_watched_value(run, w, t, sw->y);
    return lag_watched_values(run, LAG_SAMPLED, t, sw->y, sw->values) ? NAN : sw->values[f->k];
}

/* The first time at which a function is negative, between one at which it counts as positive and one at
 * which it is negative. Functions of time alone are followed to the last digit, and so is, within the accuracy of a root,
 * what depends on time besides the state: times in compound conditions are exact. */
static double locate(along_step *f, double low, double high, double b)
{
    lag_run *run = f->run;
    if (!(low < high))
        return high;
    if (lag_is_of_time(&run->switching, run->switching.watched + f->k))
        return lag_last_digit_root(value_inside, f, low, high);
    const lag_watched_function *w = run->switching.watched + f->k;
    const double a = fmax(value_inside(f, low), 0.0), exact = exact_in(run, high);
    const double root = lag_bracketed_root(value_inside, f, low, high, a == 0.0 ? -b : a, b, exact);
    if (w->what != LAG_WATCH_CONDITION || run->switching.condition[w->which].time == LAG_NO_TIME)
        return root;
    const double before = fmax(low, root - 2.0 * exact);
    return value_inside(f, before) > 0.0 ? lag_last_digit_root(value_inside, f, before, root) : root;
}

/*
 * Functions of (t, q, v): enclosed by interval evaluation of their tapes. M. Park and P. I. Barton, State event
 * location in differential-algebraic models, ACM TOMACS 6 (1996), doi:10.1145/232807.232809.
 */

/* Enclosures of a function, its slope and its curvature (half the second derivative) on an interval. */
typedef struct {
    lag_interval value, slope, curvature;
    double error;                      /* width of the enclosure of the value at a point */
    int undefined;                     /* whether an operation is undefined in all of the interval */
} enclosed;

static lag_interval meet(lag_interval a, lag_interval b)
{
    const lag_interval r = {fmax(a.low, b.low), fmin(a.high, b.high)};
    return r.low <= r.high ? r : a;
}

/* The sign of an enclosure: a function is negative only beyond its noise. */
static int sign_of(const along_step *f, lag_interval value)
{
    return value.low > 0.0 ? 1 : value.high < -f->noise ? -1 : 0;
}

static lag_interval enclosed_at(const along_step *f, double t)
{
    lag_interval value;
    lag_enclose(f->run, f->k, t, t, 0, &value);
    return value;
}

static int sign_at(const along_step *f, double t)
{
    return sign_of(f, enclosed_at(f, t));
}

/* The function is positive until t: what it was at the beginning does not matter any longer. */
static double positive_until(along_step *f, double t)
{
    if (f->noise > f->rounding && enclosed_at(f, t).low > f->noise)
        f->noise = f->rounding;
    return t;
}

/* Enclose by Taylor's formula around the middle of [a, b]: jets there, and one order higher on the interval; these alone
 * where the function is concave, as its values at the ends decide then. */
static void enclose(const along_step *f, double a, double b, int order, enclosed *e)
{
    const double middle = a + 0.5 * (b - a), r = fmax(b - middle, middle - a) * (1.0 + 4.0 * DBL_EPSILON);
    lag_interval at[JET], on[JET], power = {-r, r}, before = {1.0, 1.0};
    lag_enclose(f->run, f->k, a, b, order, on);
    e->value = meet(e->value, on[0]);
    e->slope = meet(e->slope, on[1]);
    e->curvature = on[2];
    e->undefined = lag_is_undefined(f->run, f->k);
    e->error = 0.0;
    if (e->curvature.high < 0.0)
        return;
    lag_enclose(f->run, f->k, middle, middle, order - 1, at);
    e->error = at[0].high - at[0].low;
    lag_interval sum = at[0], slope = {0.0, 0.0};
    for (int k = 1; k <= order; ++k) {
        e->value = meet(e->value, lag_interval_add(sum, lag_interval_multiply(on[k], power)));
        if (k > 1)
            e->slope = meet(e->slope, lag_interval_add(slope, lag_interval_multiply(lag_interval_scale(on[k], k), before)));
        if (k == order)
            break;
        sum = lag_interval_add(sum, lag_interval_multiply(at[k], power));
        slope = lag_interval_add(slope, lag_interval_multiply(lag_interval_scale(at[k], k), before));
        before = power;
        const double largest = before.high * r; /* r is larger than it needs to be by more than this is rounded */
        power = (lag_interval){(k + 1) % 2 ? -largest : 0.0, largest};
    }
}

/* Whether a smooth function is zero on the interval but for rounding errors. */
static int vanishes(const along_step *f, const enclosed *e)
{
    return lag_interval_size(e->slope) < INFINITY
           && lag_interval_size(e->value) <= fmax(TOUCHES * e->error, f->noise);
}

/* A place in [a, b], where the function is convex, at which it is negative or next to its least value. */
static double lowest(const along_step *f, double a, double b)
{
    double low = a, high = b;
    for (int i = 0; i < SHARP; ++i) {
        const double middle = low + 0.5 * (high - low);
        lag_interval jet[JET];
        if (!(middle > low && middle < high))
            break;
        lag_enclose(f->run, f->k, middle, middle, 2, jet);
        const int slope = lag_interval_sign(jet[1]);
        if (sign_of(f, jet[0]) < 0 || slope == 0)
            return middle;
        *(slope < 0 ? &low : &high) = middle;
        /* the minimum of the parabola there, where it is inside */
        const double guess = middle - 0.5 * (jet[1].low + jet[1].high) / (jet[2].low + jet[2].high);
        const double reach = 1e-3 * fabs(guess - middle) + 1e-6 * (high - low);
        for (int side = -1; side <= 1; side += 2) {
            const double x = guess + side * reach;
            if (!(x > low && x < high))
                continue;
            lag_enclose(f->run, f->k, x, x, 1, jet);
            if (lag_interval_sign(jet[1]))
                *(lag_interval_sign(jet[1]) < 0 ? &low : &high) = x;
        }
    }
    return low + 0.5 * (high - low);
}

/* The root between `open`, up to where the function counts as positive, and b, where it is negative. In between, it
 * must not be positive beyond rounding errors. */
static double root_before(along_step *f, double open, double b)
{
    const double value = value_inside(f, b);
    return locate(f, open, b, value < 0.0 ? value : -DBL_MIN);
}

typedef struct {
    double a, b;
} part;

/* The first time in (from, to] at which a function that counts as positive at `from` is negative, or infinity. No
 * change of sign of the function of the dense output is missed. Within rounding errors it keeps its sign. */
static double first_enclosed(along_step *f, double from, double to)
{
    part waiting[PARTS];
    int count = 0;
    double open = from;
    if (from < to)
        waiting[count++] = (part){from, to};
    while (count) {
        const double a = waiting[--count].a, b = waiting[count].b, middle = a + 0.5 * (b - a);
        const int small = !(middle > a && middle < b)
                          || b - a <= NARROW * fmax(fmax(fabs(a), fabs(b)), 1e-2 * (to - from));
        enclosed e = {.value = LAG_ANYTHING, .slope = LAG_ANYTHING, .curvature = LAG_ANYTHING};
        if (++f->parts > MOST_PARTS)
            return NAN;
        lag_enclose(f->run, f->k, a, b, 0, &e.value);
        int sign = sign_of(f, e.value), slope = 0;
        for (int order = 2; !sign && !slope && order <= JET_ORDER; order += 2) {
            enclose(f, a, b, order, &e);
            sign = sign_of(f, e.value);
            slope = lag_interval_sign(e.slope);
            if (e.curvature.high < 0.0 || vanishes(f, &e))
                break;
        }
        if (sign > 0) {
            open = positive_until(f, b);
            continue;
        }
        if (sign < 0)
            return root_before(f, open, a);
        if (slope) { /* one root at most, which matters if it falls */
            const int end = sign_at(f, b), start = slope > 0 ? sign_at(f, a) : 1;
            if (start < 0)
                return root_before(f, open, a);
            if (end < 0)
                return root_before(f, open, b);
            if (end > 0)
                open = positive_until(f, b);
            continue; /* it does not jump, as its slope is bounded: it touches zero at most */
        } else if (small || vanishes(f, &e) || (e.undefined && isnan(value_inside(f, middle)))) {
            continue; /* it touches zero */
        }
        const int curvature = lag_interval_sign(e.curvature);
        if (curvature < 0) { /* least at an end */
            const int start = sign_at(f, a), end = sign_at(f, b);
            if (start < 0)
                return root_before(f, open, a);
            if (end > 0)
                open = positive_until(f, b);
            if (end >= 0)
                continue;
            if (start > 0)
                return root_before(f, a, b);
            const double early = a + EARLY * (b - a);
            if (sign_at(f, early) > 0) /* it has risen before */
                return root_before(f, early, b);
            /* else it may rise before it falls */
        }
        if (curvature > 0) {
            const double x = lowest(f, a, b);
            const int least = sign_at(f, x);
            if (least < 0)
                return root_before(f, sign_at(f, a) > 0 ? a : open, x);
            if (sign_at(f, b) > 0)
                open = positive_until(f, b);
            continue;
        }
        if (count + 2 > PARTS)
            return NAN;
        waiting[count++] = (part){middle, b};
        waiting[count++] = (part){a, middle};
    }
    return INFINITY;
}

/* Functions of a and lambda: by the polynomial through values at nodes. */

/* `locate` with an expected root `guess`: brackets around it are tried first. */
static double locate_near(along_step *f, double low, double high, double b, double guess)
{
    const double least = exact_in(f->run, high), whole = high - low;
    for (double width = NEAREST * least; width < FARTHEST * whole; width *= WIDER) {
        const double before = guess - width, after = guess + width;
        const double value = after < high ? value_inside(f, after) : b;
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
        const double earlier = value_inside(f, before);
        if (!(earlier < 0.0)) {
            low = before;
            break;
        }
        high = before;
        b = earlier;
    }
    return locate(f, low, high, b);
}

static double first_between(along_step *f, double low, double high, const double *given, int halvings);

/* By the polynomial through values at the nodes of an interval. */
static double by_polynomial(along_step *f, double low, double high, const double *values)
{
    const lag_switching *sw = &f->run->switching;
    double bernstein[NODES], begin, end, from = 0.0;
    for (int i = 0; i < NODES; ++i) {
        bernstein[i] = 0.0;
        for (int j = 0; j < NODES; ++j)
            bernstein[i] += sw->to_bernstein[i * NODES + j] * values[j];
    }
    bernstein[NODES - 1] = values[NODES - 1];
    for (int i = 0; i < TRIES && lag_first_change(bernstein, from, &begin, &end); ++i) {
        const double after = end == 1.0 ? high : low + end * (high - low);
        const double b = value_inside(f, after);
        const int soon = after - sw->since < SOON * (f->run->step.t - sw->since);
        if (b < (soon || sw->watched[f->k].what == LAG_WATCH_FORCE_CONDITION ? -f->noise : 0.0)) {
            const double guess = low + lag_estimate_root(bernstein, begin, end) * (high - low);
            return locate_near(f, low + begin * (high - low), after, b, guess);
        }
        from = end; /* within rounding, it only touches zero */
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
 * nodes, where they are known. Intervals in which it is undefined in part are halved to the accuracy of a root. */
static double first_between(along_step *f, double low, double high, const double *given, int halvings)
{
    double values[NODES];
    int defined = 0;
    if (given)
        memcpy(values, given, sizeof values);
    else
        for (int i = 0; i < NODES; ++i)
            values[i] = value_inside(f, i == NODES - 1 ? high : low + lag_node(i) * (high - low));
    for (int i = 0; i < NODES; ++i)
        defined += !isnan(values[i]);
    const int everywhere = defined == NODES;
    if (!defined || (!everywhere && high - low <= exact_in(f->run, high)))
        return INFINITY;
    if (!everywhere || (!lag_resolved(values) && halvings > 0)) {
        if (everywhere && clearly_positive(values))
            return INFINITY;
        const double middle = 0.5 * (low + high);
        const double before = first_between(f, low, middle, 0, halvings - everywhere);
        return before < INFINITY ? before : first_between(f, middle, high, 0, halvings - everywhere);
    }
    return by_polynomial(f, low, high, values);
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
    return !isnan(value + rate) && least > CLEAR * (most - least);
}

/* The first time after `from` at which function k is negative, by the values at the nodes of the step if they are
 * given; NAN if its sign cannot be determined. */
static double first_after(lag_run *run, int k, double from, const double *nodes)
{
    lag_watched_function *w = run->switching.watched + k;
    along_step f = {.run = run, .k = k, .rounding = lag_watched_noise(run, w)};
    if (w->what == LAG_WATCH_CONDITION) /* the enclosures contain rounding errors */
        f.rounding = 0.0;
    f.noise = fmax(fmax(w->noise, w->stray), f.rounding);
    if (lag_is_enclosed(w->what)) {
        const double time = first_enclosed(&f, fmax(from, w->resolved), run->step.t);
        w->clear = f.noise <= f.rounding;
        return time;
    }
    return first_between(&f, from, run->step.t, nodes, HALVINGS);
}

/* When function k first becomes negative in the last step. The end of a condition that triggers when it begins has no
 * effect: it is recorded, and the search continues. */
static double first_of(lag_run *run, int k, const double *nodes)
{
    lag_switching *sw = &run->switching;
    lag_watched_function *w = sw->watched + k;
    const double time = first_after(run, k, sw->since, nodes);
    if (!lag_ends_silently(sw, w) || !(time < INFINITY))
        return time;
    w->ended = time;
    if (!(time < run->step.t))
        return INFINITY;
    w->sign = -w->sign; /* it may become true again */
    const double skipped = lag_is_of_time(sw, w) ? time : time + RESOLVED * exact_in(run, time);
    const double again = first_after(run, k, skipped, NULL);
    w->sign = -w->sign;
    return again;
}

/* Find the sides to which conditions that rest at zero leave it in the last step: where they are first beyond rounding. */
static void find_sides(lag_run *run)
{
    lag_switching *sw = &run->switching;
    for (int k = 0; k < sw->watched_count; ++k) {
        lag_watched_function *w = sw->watched + k;
        if (!w->hit || !lag_is_enclosed(w->what) || w->what < LAG_WATCH_CONDITION || !sw->condition[w->which].rests)
            continue;
        lag_condition *condition = sw->condition + w->which;
        const double low = sw->since, h = run->step.t - low, noise = fmax(fmax(w->noise, w->stray), lag_condition_noise(condition));
        double part = EARLIEST;
        int side = 0;
        for (; part <= 1.0 && !side; part *= 2.0) {
            lag_interval value;
            lag_enclose(run, k, low + part * h, low + part * h, 0, &value);
            side = value.low > noise ? 1 : value.high < -noise ? -1 : 0;
        }
        condition->rests = side ? LAG_LEAVES_ZERO : LAG_AT_ZERO;
        if (side < 0) {
            condition->holds = !condition->holds;
            w->sign = -w->sign;
        }
    }
}

/* Record conditions that have ended before t. */
static void end_conditions(lag_run *run, double t)
{
    lag_switching *sw = &run->switching;
    for (int k = 0; k < sw->watched_count; ++k) {
        lag_watched_function *w = sw->watched + k;
        if (!(w->ended < t) || w->hit)
            continue;
        sw->condition[w->which].holds = 0;
        w->sign = -w->sign;
        w->shift = w->noise = 0.0;
        w->ended = INFINITY;
    }
}

/* The first time at which one of the functions that are not idle becomes negative, infinity, or NAN; `hit` says
 * which do so then. */
static double first_of_all(lag_run *run, const double *nodes)
{
    lag_switching *sw = &run->switching;
    double first = INFINITY;
    for (int k = 0; k < sw->watched_count; ++k) {
        lag_watched_function *w = sw->watched + k;
        w->ended = INFINITY;
        sw->times[k] = w->hit ? first_of(run, k, lag_is_enclosed(w->what) ? NULL : nodes + k * NODES) : INFINITY;
        if (isnan(sw->times[k])) {
            sw->unresolved = k;
            return NAN;
        }
        first = fmin(first, sw->times[k]);
    }
    const double together = first + lag_one_instant(run, first);
    for (int k = 0; k < sw->watched_count; ++k)
        sw->watched[k].hit = sw->times[k] < INFINITY && sw->times[k] <= together;
    return first;
}

/* Whether a condition happens at the end of the run, or at a tick or a break where the step ends: so soon afterwards that
 * both are one instant. Marks those that do. */
static int happens_at_end(lag_run *run)
{
    lag_switching *sw = &run->switching;
    const double t = run->step.t, *y = run->step.y_new;
    const double late = lag_one_instant(run, t);
    int happens = 0;
    for (int k = 0; k < sw->watched_count; ++k) {
        lag_watched_function *w = sw->watched + k;
        if ((w->what != LAG_WATCH_CONDITION && w->what != LAG_WATCH_TIME) || lag_ends_silently(sw, w))
            continue;
        lag_interval jet[2];
        lag_enclose(run, k, t, t, 1, jet);
        const double value = lag_watched_value(run, w, t, y), slope = 0.5 * (jet[1].low + jet[1].high);
        const double error = lag_held_error(run, w->which, t, y);
        happens |= w->hit = late * slope < -error && value + late * slope <= 0.0;
    }
    return happens;
}

/* Whether the dense output strays at a time within the last step. */
static int strays_at(lag_run *run, double t)
{
    lag_switching *sw = &run->switching;
    if (!run->stepped->dense_slope || !(t < run->step.t))
        return 0;
    lag_dense(run, t, sw->y);
    return !lag_derivative(run, t, sw->y, sw->slope) && lag_strays(run, t, sw->slope + run->system.nq);
}

int lag_find_instant(lag_run *run)
{
    lag_switching *sw = &run->switching;
    const int count = sw->watched_count;
    const double t = run->step.t, low = sw->since, h = t - low;
    double *values = sw->values, *slopes = sw->node_values, *nodes = sw->node_values;
    const double *y = run->step.y_new, *f = run->step.f_new;
    int sampled = 0, busy = 0, enclosed_busy = 0;
    if (!count)
        return 0;
    for (int k = 0; k < count; ++k)
        sampled |= !lag_is_enclosed(sw->watched[k].what);
    lag_enclosure_begin(run, f);
    for (int k = 0; k < count; ++k) {
        lag_watched_function *w = sw->watched + k;
        if (!lag_is_enclosed(w->what))
            continue;
        const lag_interval value = lag_enclose_step(run, k);
        enclosed_busy |= w->hit = !(value.low > 0.0);
        w->clear = value.low > w->noise;
        if (w->what == LAG_WATCH_CONDITION)
            sw->condition[w->which].largest = fmax(sw->condition[w->which].largest, fmax(value.low, -value.high));
    }
    if (sampled) {
        if (!run->stepped->uses_slope) {
            if (lag_derivative(run, t, y, sw->slope))
                return -1;
            --run->step.evaluations;
            f = sw->slope;
        }
        if (lag_watched_ends(run, LAG_SAMPLED, t, y, f, values, slopes))
            return -1;
        for (int k = 0; k < count; ++k)
            if (!lag_is_enclosed(sw->watched[k].what))
                busy |= sw->watched[k].hit = !idle(sw->watched + k, values[k], slopes[k], h);
    }
    if (busy) {
        for (int k = 0; k < count; ++k) {
            nodes[k * NODES] = sw->watched[k].value;
            nodes[k * NODES + NODES - 1] = values[k];
        }
        for (int i = 1; i < NODES - 1; ++i) {
            const double at = low + lag_node(i) * h;
            lag_dense_often(run, at, sw->y);
            if (lag_watched_values(run, LAG_SAMPLED, at, sw->y, sw->values))
                return -1;
            for (int k = 0; k < count; ++k)
                nodes[k * NODES + i] = sw->values[k];
        }
        if (run->step.dense_inaccurate)
            return 0; /* the caller repeats the step */
    }
    if (enclosed_busy) {
        lag_enclosure_stray(run);
        find_sides(run);
    }
    if (busy || enclosed_busy) {
        sw->instant = first_of_all(run, nodes);
        if (run->step.dense_inaccurate)
            return 0; /* the caller repeats the step */
        if (isnan(sw->instant))
            return LAG_NOT_RESOLVED;
        if (sw->instant < INFINITY && strays_at(run, sw->instant))
            return LAG_STRAYING;
        end_conditions(run, sw->instant);
        if (sw->instant < INFINITY)
            return 1;
        if (sampled) /* again: they were defined before */
            lag_watched_ends(run, LAG_SAMPLED, t, y, f, values, slopes);
    }
    if ((t >= run->settings.t_end || lag_ticks_at(run, t) || lag_at_break(run)) && happens_at_end(run)) {
        sw->instant = t;
        return 1;
    }
    return lag_watch_on(run, t, y, values, slopes) ? -1 : 0;
}
