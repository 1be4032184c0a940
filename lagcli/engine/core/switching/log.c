#include "switching/log.h"

#include <math.h>
#include <string.h>

#define HEAD 6 /* numbers before the modes: time, occurrence, row, loss, supplied, work */

int lag_log_has_room(const lag_run *run)
{
    const lag_switching *sw = &run->switching;
    return sw->log_used + 4 * sw->rows + 1 <= sw->log_rows;
}

void lag_log(lag_run *run, double t, enum lag_occurrence what, int row, const double *before,
             const double *after, const double *impulse, double loss, double supplied)
{
    lag_switching *sw = &run->switching;
    const size_t nq = (size_t)run->system.nq, nc = (size_t)sw->nc, modes = (size_t)sw->exported;
    const size_t width = HEAD + modes + 3 * nq + nc;
    double *entry = sw->log + (size_t)sw->log_used++ * (width + (size_t)run->derivatives.n);
    for (int i = 0; i < run->derivatives.n; ++i) /* the limit of impacts is not at this instant */
        entry[width + (size_t)i] = what == LAG_REST ? NAN : run->derivatives.time[i];
    const double head[HEAD] = {t, what, sw->constraint[row], loss, supplied, 0.0};
    memcpy(entry, head, sizeof head);
    entry += HEAD + modes;
    memcpy(entry, run->step.y, nq * sizeof(double));
    memcpy(entry + nq, before, nq * sizeof(double));
    memcpy(entry + 2 * nq, after, nq * sizeof(double));
    if (impulse)
        memcpy(entry + 3 * nq, impulse, nc * sizeof(double));
    else
        memset(entry + 3 * nq, 0, nc * sizeof(double));
}

void lag_log_redundant(lag_run *run)
{
    lag_switching *sw = &run->switching;
    const double *v = run->step.y + run->system.nq;
    for (int i = 0; i < sw->exported; ++i) {
        const int shares = sw->acting && sw->redundant && sw->mode[i] != LAG_OPEN && isfinite(sw->slack[i]);
        if (shares && !sw->shares[i] && sw->log_used < sw->log_rows)
            lag_log(run, run->step.t, LAG_REDUNDANT, i, v, v, NULL, 0.0, 0.0);
        sw->shares[i] = shares;
    }
    lag_log_modes(run);
}

void lag_log_modes(lag_run *run)
{
    lag_switching *sw = &run->switching;
    const int width = HEAD + sw->exported + 3 * run->system.nq + sw->nc + run->derivatives.n;
    for (; sw->log_open < sw->log_used; ++sw->log_open)
        for (int i = 0; i < sw->exported; ++i)
            sw->log[sw->log_open * width + HEAD + i] = sw->mode[i];
}
