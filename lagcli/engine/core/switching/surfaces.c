#include "switching/surfaces.h"

#include "equations.h"

double lag_kink_size(const lag_run *run, int kink)
{
    const lag_kinks *k = &run->switching.kinks;
    return OUT(&k->tape, k->count + kink) + (k->whole[kink] ? 1.0 : 0.0);
}

double lag_kink_bound(const lag_run *run, int kink, double direction)
{
    const lag_kinks *k = &run->switching.kinks;
    return k->whole[kink] ? k->branch[kink] + ((direction < 0.0) - (k->whole[kink] < 0)) : 0.0;
}

double lag_kink_distance(const lag_run *run, int kink, double direction)
{
    return OUT(&run->switching.kinks.tape, kink) - lag_kink_bound(run, kink, direction);
}

double lag_off_surface(lag_run *run, double t, const double *y)
{
    const lag_kinks *k = &run->switching.kinks;
    lag_evaluate(&k->tape, &run->system, t, y, LAG_ALL);
    return OUT(&k->tape, k->slides) - (k->whole[k->slides] ? k->bound[k->slides] : 0.0);
}
