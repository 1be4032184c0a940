#include "breaks.h"

#include <math.h>
#include <string.h>

#include "methods/method.h"
#include "motion.h"
#include "sizes.h"
#include "step.h"

void lag_breaks_start(lag_run *run)
{
    lag_breaks *b = &run->breaks;
    while (b->next > 0 && b->times[b->next - 1] > run->step.t)
        --b->next; /* an event may lie before the end of its step */
    while (b->next < b->count && b->times[b->next] <= run->step.t)
        ++b->next;
    run->step.t_stop = b->next < b->count ? fmin(b->times[b->next], run->step.t_end) : run->step.t_end;
}

int lag_at_break(const lag_run *run)
{
    return run->breaks.next < run->breaks.count && run->breaks.times[run->breaks.next] <= run->step.t;
}

/* y' here, to f. */
static int slope(lag_run *run)
{
    return lag_derivative(run, run->step.t, run->step.y, run->step.f) ? LAG_UNDEFINED : LAG_RUNNING;
}

int lag_pass_break(lag_run *run)
{
    const int n = lag_size(&run->system);
    double *change = run->step.trial;
    if (!run->method->uses_slope && slope(run) != LAG_RUNNING)
        return LAG_UNDEFINED;
    memcpy(change, run->step.f, (size_t)n * sizeof(double));
    lag_breaks_start(run);
    lag_restart(run);
    if (slope(run) != LAG_RUNNING)
        return LAG_UNDEFINED;
    for (int i = 0; i < n; ++i)
        change[i] = run->step.h * (run->step.f[i] - change[i]);
    if (lag_scaled_norm(run, change, run->step.y, run->step.y) > 1.0) {
        lag_sizes_start(run);
        lag_first_step(run, run->method->order);
    }
    return LAG_RUNNING;
}
