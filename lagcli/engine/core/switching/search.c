#include "switching/search.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "methods/method.h"
#include "motion.h"
#include "roots.h"
#include "step.h"
#include "switching/crossing.h"
#include "switching/rows.h"
#include "switching/watched.h"

#define CLEAR 0.1           /* of a cubic's range: a function above that is positive */
#define TOGETHER 1e-12      /* of the time, or of the step: roots at one instant */
#define EXACT 1e-14         /* of the step, in addition to the rounding of the time: accuracy of a root */
#define NEAREST 4.0         /* of the error of a root: first bracket around the root of the polynomial, ... */
#define WIDER 64.0          /* ... growth of the bracket, ... */
#define FARTHEST 0.01       /* ... up to this part of the bracket */
#define HALVINGS 7          /* of a step, if values at the nodes do not determine a function */
#define TRIES 20            /* brackets without a root, due to rounding, after which a function counts as positive */

/* Accuracy of a root before t, in the last step. */
static double exact_in(const lag_run *run, double t)
{
    return EXACT * run->step.h_old + DBL_EPSILON * fabs(t);
}

/* A watched function along the last step. */
typedef struct {
    lag_run *run;
    int k;
} along_step;

static double value_inside(void *context, double t)
{
    const along_step *f = context;
    lag_run *run = f->run;
    lag_switching *sw = &run->switching;
    if (lag_is_of_time(sw, sw->watched + f->k))
        return lag_value_at_time(run, sw->watched + f->k, t);
    lag_dense_often(run, t, sw->y);
    return lag_watched_values(run, t, sw->y, sw->values) ? NAN : sw->values[f->k];
}

/* The first time at which a function is negative, between one at which it counts as positive and one at
 * which it is negative. Functions of time alone are followed to the last digit. */
static double locate(along_step *f, double low, double high, double b)
{
    lag_run *run = f->run;
    if (lag_is_of_time(&run->switching, run->switching.watched + f->k))
        return lag_last_digit_root(value_inside, f, low, high);
    const double a = fmax(value_inside(f, low), 0.0);
    return lag_bracketed_root(value_inside, f, low, high, a == 0.0 ? -b : a, b, exact_in(run, high));
}

/* The same with an expected root `guess`: brackets around it are tried first. */
static double locate_near(along_step *f, double low, double high, double b, double guess)
{
    const double least = exact_in(f->run, high), whole = high - low;
    for (double width = NEAREST * least; width < FARTHEST * whole; width *= WIDER) {
        const double before = guess - width, after = guess + width;
        const double value = after < high && after > low ? value_inside(f, after) : b;
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
        if (b < (soon ? -sw->watched[f->k].noise : 0.0)) {
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
 * nodes, where they are known. */
static double first_between(along_step *f, double low, double high, const double *given, int halvings)
{
    double values[NODES];
    if (given)
        memcpy(values, given, sizeof values);
    else
        for (int i = 0; i < NODES; ++i)
            values[i] = value_inside(f, i == NODES - 1 ? high : low + lag_node(i) * (high - low));
    for (int i = 0; i < NODES; ++i)
        if (isnan(values[i]))
            return INFINITY;
    if (low <= f->run->switching.since)
        values[0] = fmax(values[0], 0.0);
    if (!lag_resolved(values) && halvings > 0) {
        if (clearly_positive(values))
            return INFINITY;
        const double middle = 0.5 * (low + high);
        const double before = first_between(f, low, middle, 0, halvings - 1);
        return before < INFINITY ? before : first_between(f, middle, high, 0, halvings - 1);
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
    return least > CLEAR * (most - least) && least > 0.0;
}

/* When function k first becomes negative after `since`, passing over conditions that end without anything
 * happening. */
static double first_of(lag_run *run, int k, const double *nodes)
{
    lag_switching *sw = &run->switching;
    lag_watched_function *w = sw->watched + k;
    along_step f = {run, k};
    const double found = first_between(&f, sw->since, run->step.t, nodes, HALVINGS);
    if (!lag_ends_silently(sw, w))
        return found;
    if (!(found < run->step.t))
        return INFINITY;
    w->sign = -w->sign; /* it may become true again */
    const double again = first_between(&f, found, run->step.t, 0, HALVINGS);
    w->sign = -w->sign;
    return again;
}

/* The first time at which one of the functions that are not idle becomes negative, or infinity; `hit` says
 * which do so then. */
static double first_of_all(lag_run *run, const double *nodes)
{
    lag_switching *sw = &run->switching;
    double first = INFINITY;
    for (int k = 0; k < sw->watched_count; ++k) {
        sw->times[k] = sw->watched[k].hit ? first_of(run, k, nodes + k * NODES) : INFINITY;
        first = fmin(first, sw->times[k]);
    }
    const double together = first + TOGETHER * fmax(fabs(first), run->step.h_old);
    for (int k = 0; k < sw->watched_count; ++k)
        sw->watched[k].hit = sw->times[k] <= together;
    return first;
}

int lag_find_instant(lag_run *run)
{
    lag_switching *sw = &run->switching;
    const int count = sw->watched_count;
    const double t = run->step.t, low = sw->since, h = t - low;
    double *found = sw->values, *slopes = sw->node_values, *nodes = sw->node_values;
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
    if (lag_watched_ends(run, t, y, f, found, slopes))
        return -1;
    for (int k = 0; k < count; ++k)
        busy |= sw->watched[k].hit = !idle(sw->watched + k, found[k], slopes[k], h);
    if (busy) {
        for (int k = 0; k < count; ++k) {
            nodes[k * NODES] = sw->watched[k].value;
            nodes[k * NODES + NODES - 1] = found[k];
        }
        for (int i = 1; i < NODES - 1; ++i) {
            const double at = low + lag_node(i) * h;
            lag_dense_often(run, at, sw->y);
            if (lag_watched_values(run, at, sw->y, sw->values))
                return -1;
            for (int k = 0; k < count; ++k)
                nodes[k * NODES + i] = sw->values[k];
        }
        if (run->step.dense_inaccurate)
            return 0;
        sw->instant = first_of_all(run, nodes);
        if (sw->instant < INFINITY)
            return 1;
        if (lag_watched_ends(run, t, y, f, found, slopes))
            return -1;
    }
    lag_watch_on(run, t, y, found, slopes);
    return 0;
}
