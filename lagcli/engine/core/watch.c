#include "watch.h"

#include <math.h>
#include <string.h>

#include "linear.h"
#include "motion.h"

#define OVER 0.05           /* of its largest value: the weakest pivot that is looked at again */
#define GOLDEN 0.6180339887498949

double lag_weakest(lag_run *run, double t, const double *y)
{
    const lag_system *s = run->system;
    const lag_tape *c = &s->constraint;
    if (run->rank == 0)
        return 1.0;
    lag_evaluate(c, s, t, y);
    if (lag_scaled_rows(run, c, s->nh))
        return 1.0;
    return lag_pivot(run->rows, s->nq, s->nc, run->rank, run->order, run->components);
}

void lag_measure(lag_run *run)
{
    const lag_system *s = run->system;
    double *sum = run->work;
    memset(sum, 0, (size_t)s->nc * sizeof(double));
    for (int i = 0; i < s->nb; ++i) {
        const double x = OUT(&s->constraint, s->nh + i);
        sum[s->jacobian_places[i] / s->nq] += x * x;
    }
    for (int i = 0; i < s->nc; ++i)
        if (sqrt(sum[i]) > run->lengths[i])
            run->lengths[i] = sqrt(sum[i]);
}

/* The weakest pivot on the cubic through the last step's ends: B depends on q and t alone. */
static double weakest_inside(lag_run *run, double x)
{
    const int nq = run->system->nq;
    const double h = run->h_old, z = 1.0 - x;
    const double *q0 = run->y_old, *v0 = q0 + nq, *q1 = run->y_new, *v1 = q1 + nq;
    double *y = run->y_sample;
    for (int m = 0; m < nq; ++m)
        y[m] = z * z * ((1.0 + 2.0 * x) * q0[m] + x * h * v0[m])
               + x * x * ((1.0 + 2.0 * z) * q1[m] - z * h * v1[m]);
    memcpy(y + nq, v1, (size_t)nq * sizeof(double));
    return lag_weakest(run, run->t_old + x * h, y);
}

int lag_goes_over(lag_run *run)
{
    /* the places next to the ends show whether it falls or rises there */
    static const double place[] = {0.0, 0.001, 0.25, 0.5, 0.75, 0.999, 1.0};
    double value[7];
    value[0] = run->weakest;
    for (int i = 1; i < 7; ++i)
        value[i] = weakest_inside(run, place[i]);
    for (int i = 1; i < 6; ++i) {
        if (value[i] > value[i - 1] || value[i] > value[i + 1])
            continue;
        /* golden section, until the bracket is short against what a cubic can say */
        double low = place[i - 1], high = place[i + 1], least = value[i];
        double a = high - GOLDEN * (high - low), b = low + GOLDEN * (high - low);
        double fa = weakest_inside(run, a), fb = weakest_inside(run, b);
        for (int k = 0; k < 12; ++k) {
            if (fa < fb) {
                high = b, b = a, fb = fa;
                fa = weakest_inside(run, a = high - GOLDEN * (high - low));
            } else {
                low = a, a = b, fa = fb;
                fb = weakest_inside(run, b = low + GOLDEN * (high - low));
            }
            least = fmin(least, fmin(fa, fb));
        }
        if (least < OVER * run->usual)
            return 1;
    }
    return 0;
}
