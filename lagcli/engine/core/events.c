#include "events.h"

#include <math.h>
#include <string.h>

#include "motion.h"
#include "project.h"
#include "sample.h"
#include "step.h"

#define PARTS 8             /* of a step, at whose ends the signs are compared */
#define EXACT 1e-14         /* of the time, or of the step: where a root is located */
#define ITERATIONS 200

static int sign_of(double x)
{
    return (x > 0.0) - (x < 0.0);
}

/* An event's function at a state. */
static double value(lag_run *run, int which, double t, const double *y)
{
    lag_evaluate(&run->events.tape, &run->system, t, y, LAG_ALL);
    return OUT(&run->events.tape, which);
}

/* An event's function on the last step's dense output. */
static double value_inside(lag_run *run, int which, double t)
{
    lag_dense(run, t, run->samples.y);
    return value(run, which, t, run->samples.y);
}

void lag_events_start(lag_run *run)
{
    lag_events *e = &run->events;
    for (int k = 0; k < e->count; ++k)
        e->sign[k] = sign_of(value(run, k, run->step.t, run->step.y));
    if (e->count && e->time == run->step.t)
        e->sign[e->which] = 0;
    e->since = run->step.t;
    e->located = 0;
}

/* The first time at which an event's function has its new sign: regula falsi with halved ends
 * (Illinois), and a bisection where that does not halve the interval. */
static double locate(lag_run *run, int which, double low, double high)
{
    double a = value_inside(run, which, low), b = value_inside(run, which, high);
    const int after = sign_of(b);
    const double exact = EXACT * fmax(fabs(high), run->step.h_old);
    for (int i = 0; i < ITERATIONS && high - low > exact; ++i) {
        const double width = high - low;
        double t = i % 3 == 2 ? low + 0.5 * width : high - b * width / (b - a);
        /* a step beyond the root, so that the interval closes from both sides */
        t = fmin(fmax(t, low + 0.5 * exact), high - 0.5 * exact);
        const double g = value_inside(run, which, t);
        if (sign_of(g) == after) {
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

/* Find the first event in (since, t]. Returns whether there is one. */
static int find(lag_run *run)
{
    lag_events *e = &run->events;
    double low = e->since;
    for (int part = 1; part <= PARTS; ++part) {
        const double high =
            part == PARTS ? run->step.t : run->step.t_old + run->step.h_old * part / (double)PARTS;
        if (high <= low)
            continue;
        lag_dense(run, high, run->samples.y);
        lag_evaluate(&e->tape, &run->system, high, run->samples.y, LAG_ALL);
        int found = 0;
        for (int k = 0; k < e->count; ++k) {
            const int now = sign_of(OUT(&e->tape, k));
            e->after[k] = now;
            found |= e->sign[k] * now < 0;
        }
        if (found) {
            e->time = INFINITY;
            for (int k = 0; k < e->count; ++k) {
                if (e->sign[k] * e->after[k] >= 0)
                    continue;
                const double t = locate(run, k, low, high);
                if (t < e->time) {
                    e->time = t;
                    e->which = k;
                    e->direction = e->after[k];
                }
            }
            return 1;
        }
        for (int k = 0; k < e->count; ++k)
            if (e->after[k])
                e->sign[k] = e->after[k];
        low = e->since = high;
    }
    return 0;
}

int lag_events_look(lag_run *run)
{
    lag_events *e = &run->events;
    if (!e->located && !find(run))
        return LAG_RUNNING;
    e->located = 1;
    int status = lag_sample_until(run, e->time);
    if (status != LAG_RUNNING)
        return status;
    lag_dense(run, e->time, e->y);
    if (run->projection.active && (status = lag_project(run, e->time, e->y)) != LAG_RUNNING)
        return status;
    e->located = 0;
    e->since = e->time;
    e->sign[e->which] = e->direction;
    return LAG_EVENT;
}
