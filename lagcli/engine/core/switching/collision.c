#include "switching/collision.h"

#include <math.h>
#include <string.h>

#include "motion.h"
#include "switching/choice.h"
#include "switching/log.h"
#include "switching/rows.h"
#include "switching/settle.h"

int lag_collides(const lag_run *run)
{
    const lag_switching *sw = &run->switching;
    for (int i = 0; i < sw->rows; ++i) {
        const double speed = lag_no_speed(sw, i);
        if (!sw->active[i])
            continue;
        if (sw->law[i] == LAG_UNILATERAL && (sw->phi[i] <= lag_no_gap(sw, i) || sw->mode[i] == LAG_HOLDS)
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
        rests[i] = a < 0.0 && sw->psi[i] * sw->psi[i] <= 2.0 * -a * lag_no_gap(sw, i);
        any |= rests[i];
    }
    return any;
}

int lag_do_collision(lag_run *run)
{
    lag_switching *sw = &run->switching;
    const int nq = run->system.nq;
    const double t = run->step.t;
    double *y = run->step.y, *before = sw->start;
    lag_impact_report report = {sw->takes_part, sw->impulse, sw->impulse + sw->rows, sw->impulse + 2 * sw->rows,
                                0.0, 0.0, 0.0, 0, 0};
    memcpy(before, y, (size_t)lag_size(&run->system) * sizeof(double));
    memset(sw->rests, 0, (size_t)sw->rows * sizeof(int));
    int found = lag_collide(run, t, y, sw->rests, &report), rest = 0;
    /* a row that comes to rest may move another, which then comes to rest too */
    while (found >= 0 && found != LAG_NO_MOTION && falls_back(run, &report, sw->rests)) {
        rest = 1;
        memcpy(y, before, (size_t)lag_size(&run->system) * sizeof(double));
        found = lag_collide(run, t, y, sw->rests, &report);
    }
    if (found < 0)
        return LAG_UNDEFINED;
    if (found == LAG_NO_MOTION)
        return LAG_NO_IMPACT;
    sw->gained = report.gained;
    sw->rubbed = report.rubbed;
    sw->alike = report.alike;
    if (report.gained > 0.0)
        return LAG_GAINS;
    double supplied = report.supplied;
    for (int i = 0; i < sw->rows; ++i) {
        sw->ended[i] = NOTHING_ENDED; /* the impact may trigger other changes */
        if (sw->law[i] != LAG_UNILATERAL || report.impulse[i] == 0.0)
            continue;
        double loss = report.loss[i], *times = sw->recent + 3 * i;
        for (int j = 0; j < sw->rows; ++j)
            if (sw->normal[j] == i)
                loss += report.loss[j];
        lag_log(run, t, LAG_IMPACT, i, before + nq, y + nq, report.all, loss, supplied);
        supplied = 0.0;
        times[0] = times[1];
        times[1] = times[2];
        times[2] = t;
        sw->report |= sw->reported[5 * i + 4];
        sw->came_to_rest[i] |= rest;
    }
    return LAG_RUNNING;
}
