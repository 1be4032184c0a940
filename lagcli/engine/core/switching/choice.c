#include "switching/choice.h"

#include <math.h>
#include <string.h>

#include "switching/rows.h"
#include "switching/settle.h"

#define FALLS_BACK 1e-9     /* of an acceleration: a contact that has opened and closes again */

void lag_states_of(const lag_run *run, int *state)
{
    const lag_switching *sw = &run->switching;
    for (int i = 0; i < sw->rows; ++i) {
        state[i] = LAG_AT_REST;
        if (sw->law[i] == LAG_UNILATERAL && (sw->ended[i] == FORCE_ENDED || sw->psi[i] > lag_no_speed(sw, i)
                                             || (sw->phi[i] > lag_no_gap(run, i) && sw->mode[i] != LAG_HOLDS)))
            state[i] = LAG_APART;
        if (sw->ended[i] == STICKING_ENDED_FORWARD)
            state[i] = LAG_GOES_FORWARD;
        if (sw->ended[i] == STICKING_ENDED_BACKWARD)
            state[i] = LAG_GOES_BACKWARD;
        if (sw->ended[i] == SLIPPING_ENDED)
            state[i] = LAG_STOPS;
    }
}

/* Whether a contact that has opened would close at once: it approaches, with an acceleration that is no rounding
 * error next to its terms and to what the largest force so far does. */
static int returns(lag_run *run, int row)
{
    const lag_switching *sw = &run->switching;
    const double a = lag_along(run, row, sw->acceleration), gamma = sw->gamma[row];
    const double by_force = sw->strength * lag_along(run, row, lag_row_response(run, row));
    return a - gamma < -FALLS_BACK * (fabs(a) + fabs(gamma) + by_force);
}

/* What slips goes on at an instant of other functions, also while its velocity is still zero but for rounding: there, the
 * static limit could hold it again. */
static void go_on(const lag_run *run, int *state)
{
    const lag_switching *sw = &run->switching;
    for (int i = 0; i < sw->rows && !sw->moved && !sw->impacts; ++i) {
        const int direction = sw->ended[i] == NOTHING_ENDED ? lag_row_slips(sw, i) : 0;
        if (direction && direction * sw->psi[i] >= -lag_no_speed(sw, i))
            state[i] = direction > 0 ? LAG_GOES_FORWARD : LAG_GOES_BACKWARD;
    }
}

int lag_choose_modes(lag_run *run)
{
    lag_switching *sw = &run->switching;
    const double t = run->step.t, *y = run->step.y;
    for (int again = 0;; ++again) {
        lag_states_of(run, sw->state);
        go_on(run, sw->state);
        memcpy(sw->trial_mode, sw->mode, (size_t)sw->rows * sizeof(int));
        sw->motions = lag_settle(run, t, y, sw->state, sw->trial_mode, sw->trial_force, sw->acceleration);
        if (sw->motions < 0)
            return LAG_UNDEFINED;
        if (sw->motions != LAG_ONE_MOTION)
            return sw->motions == LAG_NO_MOTION ? LAG_NO_MODE : LAG_TWO_MODES;
        int closes = 0;
        for (int i = 0; i < sw->rows; ++i)
            if (sw->ended[i] == FORCE_ENDED && returns(run, i)) {
                sw->ended[i] = NOTHING_ENDED;
                closes = 1;
            }
        if (!closes || again)
            break;
    }
    memcpy(sw->mode, sw->trial_mode, (size_t)sw->rows * sizeof(int));
    memcpy(sw->force, sw->trial_force, (size_t)sw->rows * sizeof(double));
    sw->acting = sw->nf > 0 || sw->kinks.slides >= 0;
    for (int i = 0; i < sw->rows; ++i)
        sw->acting |= sw->mode[i] != LAG_OPEN;
    return LAG_RUNNING;
}
