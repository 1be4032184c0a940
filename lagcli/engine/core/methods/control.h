/* Step size control: the rules that single runs and batches share. */
#ifndef LAGCLI_CONTROL_H
#define LAGCLI_CONTROL_H

#include <math.h>
#include <stdint.h>

/* Exponent of the error of a step in PI control. */
#define LEAST_ERROR 1e-4

/* Times the tolerance of v: what the end of a step may be off by, were v' as wrong as at a sample of the dense output. */
#define MOST_STRAY 100.0

/* The factor for the next step by PI control with beta = 0.04 (Hairer & Wanner, IV.2), after an accepted
 * step; `before` is the error of the step before it. */
static inline double lag_pi_factor(double error, double before, double order, int rejected)
{
    double factor = 10.0;
    if (error > 0.0)
        factor = 0.9 * pow(error, -1.0 / order + 0.03) * pow(before, 0.04);
    return fmin(fmax(factor, 0.2), rejected ? 1.0 : 10.0);
}

/* The factor of a rejected step. */
static inline double lag_rejected_factor(double error, double order)
{
    return fmax(0.9 * pow(error, -1.0 / order), 0.2);
}

/* The factor for the next step of an implicit method by predictive control (Gustafsson; Hairer & Wanner,
 * IV.8), from this step and the one before it. */
static inline double lag_predicted_factor(double h, double error, double h_before, double error_before,
                                          double order)
{
    return 0.9 * h / h_before * pow(error_before / (error * error), 1.0 / order);
}

/* The step that t + h makes. In a run that starts far from t = 0, the time is rounded much more than the state, and the
 * state would be that of another time; the differences would add up. */
static inline double lag_exact_step(double t, double h, double t_start, double t_end)
{
    return fabs(t_start) > t_end - t_start ? t + h - t : h;
}

/* What a first step is estimated with, in parts of the run's length, where nothing else says how
 * fast the motion is; and parts of the largest size of a kind. */
#define HORIZON 1e-4
#define BESIDE 1e-3

/*
 * The choice of a first step: Hairer, Norsett & Wanner, II.4, with sizes instead of tolerances and in the
 * motion's own time. The size of an entry is the one that it has, or will have soon by its rate.
 *
 * Entries of an array are `stride` apart: 1 for a single run.
 */
typedef struct {
    int nq, stride, kinds;
    const int32_t *kind;                       /* nq, adjacent */
    const double *y, *f;                       /* q, v and their rates at the start */
    const double *acceleration_terms, *future_acceleration, *largest;     /* as in sizes.h */
    double *weight;                            /* 2 nq: sizes */
    double length, h_max;                      /* of the run; the largest step */
    double rate;                               /* of y over its sizes */
} lag_first_step_rule;

/* The 2-norm of the rates f over the sizes. */
static inline double lag_rate(const lag_first_step_rule *s, const double *f)
{
    const double *w = s->weight;
    double sum = 0.0;
    for (int i = 0; i < 2 * s->nq * s->stride; i += s->stride)
        sum += w[i] > 0.0 ? f[i] / w[i] * (f[i] / w[i]) : 0.0;
    return sqrt(sum);
}

/* The size of a trial step by Euler's method; sets the sizes and the rate. */
static inline double lag_trial_step(lag_first_step_rule *s)
{
    const double horizon = HORIZON * s->length;
    double *w = s->weight;
    for (int i = 0; i < s->nq; ++i) {
        const int q = i * s->stride, v = q + s->nq * s->stride;
        const double *largest = s->largest + s->kind[i] * s->stride;
        const double a = s->acceleration_terms[q] + s->future_acceleration[q];
        w[q] = fabs(s->y[q]) + BESIDE * largest[0] + horizon * (fabs(s->y[v]) + horizon * a);
        w[v] = fabs(s->y[v]) + BESIDE * largest[s->kinds * s->stride] + horizon * a + sqrt(a * w[q]);
    }
    s->rate = lag_rate(s, s->f);
    const double h = s->rate > 0.0 ? 0.01 / s->rate : horizon;
    return fmin(h, fmin(s->h_max, s->length));
}

/* The first step, from the change of f in the trial step; h where that is undefined. */
static inline double lag_chosen_step(const lag_first_step_rule *s, const double *change, double h,
                                    double rtol, double order)
{
    const double second = lag_rate(s, change) / h;
    if (!isfinite(second))
        return h; /* the step itself will find an acceptable size */
    const double d = fmax(s->rate, sqrt(second));
    const double first = d > 0.0 ? pow(0.01 * rtol, 1.0 / order) / d : HORIZON * s->length;
    return fmin(fmin(100.0 * h, first), fmin(s->h_max, s->length));
}

#endif
