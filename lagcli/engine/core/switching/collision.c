#include "switching/collision.h"

#include <math.h>
#include <string.h>

#include "motion.h"
#include "switching/accumulation.h"
#include "switching/choice.h"
#include "switching/impulse.h"
#include "switching/log.h"
#include "switching/rows.h"
#include "switching/settle.h"

#define ONE_BY_ONE 100 /* impacts at one instant, for each contact, after which all that are left happen together */
#define ENDLESS 10000  /* impacts at one instant after which they count as endless ... */
#define COUNTED 100    /* ... and as how many of these one of all that are left counts */

int lag_collides(const lag_run *run)
{
    const lag_switching *sw = &run->switching;
    for (int i = 0; i < sw->rows; ++i) {
        const double speed = lag_no_speed(sw, i);
        if (!sw->active[i])
            continue;
        if (sw->law[i] == LAG_UNILATERAL && (sw->phi[i] <= lag_no_gap(run, i) || sw->mode[i] == LAG_HOLDS)
            && sw->psi[i] < -speed)
            return 1;
        if (sw->law[i] == LAG_FREE && fabs(sw->psi[i]) > speed)
            return 1;
    }
    return 0;
}

/* After an impact: which more rows would bounce no higher than a gap that counts as none. Returns whether
 * there are any. */
static int falls_back(lag_run *run, const lag_impact_report *report, int *rests)
{
    lag_switching *sw = &run->switching;
    const double t = run->step.t, *y = run->step.y;
    int *mode = sw->trial_mode, any = 0;
    if (lag_find_rows(run, t, y))
        return 0;
    lag_states_of(run, sw->state);
    memcpy(mode, sw->mode, (size_t)sw->rows * sizeof(int));
    if (lag_settle(run, t, y, sw->state, mode, sw->trial_force, sw->acceleration) != LAG_ONE_MOTION)
        return 0;
    for (int i = 0; i < sw->rows; ++i) {
        if (sw->law[i] != LAG_UNILATERAL || rests[i] || !report->takes_part[i]
            || sw->psi[i] <= lag_no_speed(sw, i))
            continue;
        const double a = lag_along(run, i, sw->acceleration) - sw->gamma[i];
        rests[i] = a < 0.0 && sw->psi[i] * sw->psi[i] <= 2.0 * -a * lag_no_gap(run, i);
        any |= rests[i];
    }
    return any;
}

/* When the impacts end that contacts at rest still would have, and the friction that these impacts have beyond that at
 * rest. */
static void follow_impacts(lag_run *run, const lag_impact_report *report)
{
    lag_switching *sw = &run->switching;
    const double t = run->step.t;
    memset(sw->ends, 0, (size_t)sw->rows * sizeof(int));
    memset(sw->rest_friction, 0, (size_t)sw->rows * sizeof(double));
    for (int i = 0; i < sw->rows; ++i) {
        if (!sw->rests[i] || sw->ends[i])
            continue;
        const double time =
            lag_end_of_impacts(run, t, sw->struck, i, sw->rests, sw->member, sw->rest_friction);
        for (int j = 0; j < sw->rows; ++j)
            if (sw->member[j] && sw->law[j] == LAG_UNILATERAL && (sw->rests[j] || report->impulse[j] != 0.0)) {
                sw->ends[j] = sw->came_to_rest[j] = 1;
                sw->rest_time[j] = isfinite(time) ? time : t;
            }
    }
}

/* Bring to rest the rows that would bounce no higher than a gap that counts as none, after an impact: those that take
 * part in it, and others that come to rest only then. Returns what lag_solve_contacts does, or -1. */
static int end_impacts(lag_run *run, const lag_impact_report *report)
{
    lag_switching *sw = &run->switching;
    const size_t size = (size_t)lag_size(&run->system) * sizeof(double);
    const double t = run->step.t;
    double *y = run->step.y, lost = 0.0;
    int motions = LAG_ONE_MOTION;
    memset(sw->rests, 0, (size_t)sw->rows * sizeof(int));
    if (!falls_back(run, report, sw->rests))
        return motions;
    memcpy(sw->struck, y, size);
    do {
        memcpy(y, sw->struck, size);
        follow_impacts(run, report);
        motions = lag_bring_to_rest(run, t, y, sw->rests, sw->rest_friction, &lost);
    } while (motions != LAG_NO_MOTION && motions >= 0 && falls_back(run, report, sw->rests));
    if (motions < 0 || motions == LAG_NO_MOTION)
        return motions;
    sw->remainder += lost;
    for (int i = 0; i < sw->rows; ++i)
        if (sw->rests[i])
            run->derivatives.rested = i;
    return motions;
}

int lag_do_collision(lag_run *run)
{
    lag_switching *sw = &run->switching;
    const int nq = run->system.nq;
    const double t = run->step.t;
    double *y = run->step.y, *before = sw->start;
    const int together = sw->impacts > ONE_BY_ONE * sw->rows;
    lag_impact_report report = {together, sw->takes_part, sw->impulse, sw->impulse + sw->rows,
                                sw->impulse + 2 * sw->rows, 0.0, 0.0, 0, 0};
    if (sw->impacts > ONE_BY_ONE * sw->rows + ENDLESS)
        return LAG_ENDLESS;
    memcpy(before, y, (size_t)lag_size(&run->system) * sizeof(double));
    int motions = lag_collide(run, t, y, &report);
    if (motions < 0)
        return LAG_UNDEFINED;
    if (motions == LAG_NO_MOTION)
        return LAG_NO_IMPACT;
    sw->impacts += report.together ? COUNTED : 1;
    sw->gained = report.gained;
    sw->with_friction = report.with_friction;
    sw->equal_restitution = report.equal_restitution;
    if (report.gained > 0.0)
        return LAG_GAINS;
    double supplied = report.supplied, of_guides = 0.0; /* the first entry has both */
    for (int i = 0; i < sw->rows; ++i)
        if (sw->law[i] != LAG_UNILATERAL && (sw->normal[i] < 0 || sw->law[sw->normal[i]] != LAG_UNILATERAL))
            of_guides += report.loss[i];
    for (int i = 0; i < sw->rows; ++i) {
        sw->ended[i] = NOTHING_ENDED; /* the impact may trigger other changes */
        if (sw->law[i] != LAG_UNILATERAL || report.impulse[i] == 0.0)
            continue;
        double loss = report.loss[i] + of_guides;
        for (int j = 0; j < sw->rows; ++j)
            if (sw->normal[j] == i)
                loss += report.loss[j];
        lag_log(run, t, LAG_IMPACT, i, before + nq, y + nq, report.all, loss, supplied);
        if (motions == LAG_TWO_MOTIONS)
            lag_log(run, t, LAG_NOT_UNIQUE, i, y + nq, y + nq, NULL, 0.0, 0.0);
        supplied = of_guides = 0.0;
        sw->report |= sw->reported[5 * i + 4];
    }
    motions = end_impacts(run, &report);
    return motions < 0 ? LAG_UNDEFINED : motions == LAG_NO_MOTION ? LAG_NO_IMPACT : LAG_RUNNING;
}
