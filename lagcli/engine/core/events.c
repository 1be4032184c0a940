#include "events.h"

#include <math.h>
#include <string.h>

#include "motion.h"
#include "project.h"
#include "roots.h"
#include "sample.h"
#include "step.h"

#define PARTS 8             /* of a step: signs are compared at their ends */
#define EXACT 1e-14         /* of the time, or of the step: accuracy of a root */

static int sign_of(double x)
{
    return (x > 0.0) - (x < 0.0);
}

/* The event function at a state. */
static double value(lag_run *run, int which, double t, const double *y)
{
    lag_evaluate(&run->events.tape, &run->system, t, y, LAG_ALL);
    return OUT(&run->events.tape, which);
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

/* An event's function along the last step, positive before its new sign and negative from there on. */
typedef struct {
    lag_run *run;
    int which, after;
} along_step;

static double value_inside(void *context, double t)
{
    const along_step *f = context;
    lag_dense(f->run, t, f->run->samples.y);
    return -f->after * value(f->run, f->which, t, f->run->samples.y);
}

/* The first time at which an event function has its new sign. */
static double locate(lag_run *run, int which, double low, double high)
{
    along_step f = {run, which, run->events.after[which]};
    const double exact = EXACT * fmax(fabs(high), run->step.h_old);
    const double a = value_inside(&f, low), b = value_inside(&f, high);
    return lag_bracketed_root(value_inside, &f, low, high, a, b, exact);
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
