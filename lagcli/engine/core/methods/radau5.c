/* Radau IIA of order 5 with simplified Newton steps, after Hairer & Wanner's RADAU5. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "methods/control.h"
#include "methods/implicit.h"
#include "methods/method.h"
#include "motion.h"
#include "methods/radau5_tableau.h"
#include "polynomial.h"
#include "sizes.h"
#include "step.h"
#include "watch.h"

#define NEWTON 7            /* iterations */
#define FAST 1e-3           /* rate of convergence up to which the Jacobian is kept */
#define RELAXED 1.1         /* growth per step, towards a size at which Newton's method did not converge */
#define SAFETY 0.9
#define LEAST 0.2           /* smallest factor of the step size */
#define LARGEST 8.0
#define KEPT 1.2            /* growth up to which step and factors are kept */

/* The error estimate is of order 3: tolerance for the requested error. */
static double looseness(const lag_run *run)
{
    return 0.1 * pow(run->settings.rtol, -1.0 / 3.0);
}

/* A norm against the estimate's own tolerance, without what rounding errors need; y_new is near the step's end. */
static double norm(const lag_run *run, const double *x)
{
    const lag_tolerances *given = &run->tolerances;
    const int n = lag_size(&run->system);
    const double looser = looseness(run);
    double *atol = run->implicit->atol;
    for (int i = 0; i < n; ++i)
        atol[i] = looser * (given->atol[i] - given->rounding[i]) + given->rounding[i];
    return sqrt(run->system.vectors->scaled_square(n, x, run->step.y, run->step.y_new, atol,
                                                   looser * run->settings.rtol));
}

/*
 * The dense output of a step at 1 + x of its size, less its value at the end: the collocation polynomial u and the
 * integral of its defect F(t, u) - u', which vanishes at the nodes and at the start follows from the error estimate,
 * (radau_real / h - J)^-1 (F - u'). This makes its order 4, where that of u is 3.
 */
static double continued(const double *d, int n, int m, double x)
{
    const double start = x + 1.0;
    return x * (d[m] + (start - radau_c[1]) * (d[n + m] + (start - radau_c[0]) * d[2 * n + m])
                + radau_defect * start * x * (start - radau_zero) * d[3 * n + m]);
}

/* z = T w, transformed stages to stages; and the inverse. */
static void transform(const double matrix[3][3], int n, const double *from, double *to)
{
    for (int i = 0; i < 3; ++i)
        for (int m = 0; m < n; ++m)
            to[i * n + m] = matrix[i][0] * from[m] + matrix[i][1] * from[n + m] + matrix[i][2] * from[2 * n + m];
}

/* Let z and w be the solution of the equations linearized at the beginning of the step, y' = f + J (y - y_0) + t F_t. */
static void follow_time(lag_run *run, double h, double *z, double *w)
{
    const int n = lag_size(&run->system);
    double ones[3], tau[3];
    for (int i = 0; i < 3; ++i) {
        const double *row = radau_t_inverse[i];
        ones[i] = row[0] + row[1] + row[2];
        tau[i] = h * (row[0] * radau_c[0] + row[1] * radau_c[1] + row[2] * radau_c[2]);
        for (int m = 0; m < n; ++m)
            w[i * n + m] = ones[i] * run->step.f[m];
    }
    lag_shifted_solve(run, w, tau[0], w);
    lag_shifted_solve_complex(run, w + n, w + 2 * n, tau[1], tau[2]);
    transform(radau_t, n, w, z);
}

/*
 * Newton's initial guess: the last step's dense output; or, without one, zero, at which stiff forces such as the friction
 * of a belt that speeds up have changed with time: then the guess follows time.
 */
static void predict(lag_run *run, double h, double *z, double *w)
{
    const int n = lag_size(&run->system);
    if (run->implicit->h_accepted > 0.0) {
        for (int i = 0; i < 3; ++i)
            for (int m = 0; m < n; ++m)
                z[i * n + m] = continued(run->step.dense, n, m, radau_c[i] * h / run->implicit->h_accepted);
        transform(radau_t_inverse, n, z, w);
    } else if (lag_depends_on_time(run)) {
        follow_time(run, h, z, w);
    } else {
        memset(z, 0, 3 * (size_t)n * sizeof(double));
        memset(w, 0, 3 * (size_t)n * sizeof(double));
    }
}

/* F at the stages y + z, transformed, less what w stands for: the right sides of Newton's systems.
 * Returns 0, or 1 where it is undefined. */
static int defects(lag_run *run, double h, const double *z, const double *w, double *r)
{
    const int n = lag_size(&run->system);
    double *f = run->step.stages + 9 * n;
    lag_watch_step(run);
    for (int i = 0; i < 3; ++i) {
        for (int m = 0; m < n; ++m)
            run->step.y_new[m] = run->step.y[m] + z[i * n + m];
        if (lag_stage(run, run->step.t + radau_c[i] * h, run->step.y_new, f + i * n))
            return 1;
    }
    const double real = radau_real / h, re = radau_re / h, im = radau_im / h;
    for (int m = 0; m < n; ++m) {
        double g[3];
        for (int i = 0; i < 3; ++i)
            g[i] = radau_t_inverse[i][0] * f[m] + radau_t_inverse[i][1] * f[n + m]
                   + radau_t_inverse[i][2] * f[2 * n + m];
        r[m] = g[0] - real * w[m];
        r[n + m] = g[1] - re * w[n + m] + im * w[2 * n + m];
        r[2 * n + m] = g[2] - re * w[2 * n + m] - im * w[n + m];
    }
    return 0;
}

/* The change, over the tolerances, at which Newton's iteration ends. */
static double last_change(const lag_run *run)
{
    const double tolerance = looseness(run) * run->settings.rtol;
    return fmax(10.0 * DBL_EPSILON / tolerance, fmin(0.03, sqrt(tolerance)));
}

/* Tolerances of which that change is what rounding errors do. */
static void noise_of_newton(lag_run *run, const double *rates, double *change)
{
    lag_shifted_noise(run, rates, change);
    const double enough = last_change(run);
    for (int m = 0; m < lag_size(&run->system); ++m)
        change[m] /= 100.0 * enough;
}

/* Results of a Newton iteration. */
enum newton { CONVERGED, DIVERGED, NOT_DEFINED };

/* Solve for z. `factor` is by what to change a step that did not converge. */
static enum newton solve_stages(lag_run *run, double h, double *z, int *iterations, double *factor)
{
    const int n = lag_size(&run->system);
    const double enough = last_change(run);
    double *w = run->step.stages + 3 * n, *r = run->step.stages + 6 * n;
    double change = 0.0, before = 0.0, rate = 0.0;
    predict(run, h, z, w);
    run->implicit->contraction = pow(fmax(run->implicit->contraction, DBL_EPSILON), 0.8);
    run->implicit->theta = FAST;
    *factor = 0.5;
    for (int k = 0; k < NEWTON; ++k) {
        if (defects(run, h, z, w, r))
            return NOT_DEFINED;
        if (k == 0 && run->implicit->h_accepted == 0.0) /* z is zero: where the step goes shows how large y becomes */
            for (int m = 0; m < n; ++m)
                run->step.y_new[m] = run->step.y[m] + h * run->step.f[m];
        lag_shifted_solve(run, r, 0.0, r);
        lag_shifted_solve_complex(run, r + n, r + 2 * n, 0.0, 0.0);
        double sum = 0.0;
        for (int i = 0; i < 3; ++i) {
            const double part = norm(run, r + i * n);
            sum += part * part;
        }
        change = sqrt(sum / 3.0);
        if (!isfinite(change))
            return DIVERGED;
        if (k > 0) {
            const double ratio = change / before;
            run->implicit->theta = k == 1 ? ratio : sqrt(ratio * rate);
            rate = ratio;
            if (run->implicit->theta >= 0.99)
                return DIVERGED;
            run->implicit->contraction = run->implicit->theta / (1.0 - run->implicit->theta);
            /* predicted error after the last iteration */
            const double left =
                run->implicit->contraction * change * pow(run->implicit->theta, NEWTON - 2 - k) / enough;
            if (left >= 1.0 && k < NEWTON - 1) {
                const double q = fmax(1e-4, fmin(20.0, left));
                *factor = 0.8 * pow(q, -1.0 / (4 + NEWTON - 2 - k));
                return DIVERGED;
            }
        }
        before = fmax(change, DBL_EPSILON);
        for (int i = 0; i < 3 * n; ++i)
            w[i] += r[i];
        transform(radau_t, n, w, z);
        if (run->implicit->contraction * change <= enough) {
            *iterations = k + 1;
            return CONVERGED;
        }
    }
    return DIVERGED;
}

/* The error estimate (IV.8.19, and IV.8.20 where it is large and the step follows no other): its size, and `first`
 * by IV.8.19. */
static double estimate(lag_run *run, double h, const double *z, int doubtful, double *first)
{
    const int n = lag_size(&run->system);
    double *sum = run->step.stages + 6 * n, *y = run->step.stages + 7 * n, *again = run->step.stages + 8 * n;
    for (int m = 0; m < n; ++m) {
        sum[m] = (radau_error[0] * z[m] + radau_error[1] * z[n + m] + radau_error[2] * z[2 * n + m])
                 / h;
        first[m] = run->step.f[m] + sum[m];
    }
    lag_shifted_solve(run, first, 0.0, first);
    double size = norm(run, first);
    if (size >= 1.0 && doubtful) {
        for (int m = 0; m < n; ++m)
            y[m] = run->step.y[m] + first[m];
        if (!lag_derivative(run, run->step.t, y, again)) {
            for (int m = 0; m < n; ++m)
                again[m] += sum[m];
            lag_shifted_solve(run, again, 0.0, again);
            size = norm(run, again);
        }
    }
    return fmax(size, 1e-10);
}

/* The dense output: divided differences, and the error estimate. */
static void interpolate(lag_run *run, const double *z, const double *error)
{
    const int n = lag_size(&run->system);
    const double c1 = radau_c[0], c2 = radau_c[1];
    double *d = run->step.dense;
    for (int m = 0; m < n; ++m) {
        const double middle = (z[m] - z[n + m]) / (c1 - c2);
        d[m] = (z[n + m] - z[2 * n + m]) / (c2 - 1.0);
        d[n + m] = (middle - d[m]) / (c1 - 1.0);
        d[2 * n + m] = d[n + m] - (middle - z[m] / c1) / c2;
        d[3 * n + m] = error[m];
    }
}

static void restart(lag_run *run)
{
    run->implicit->h_accepted = 0.0;
    run->implicit->h_converging = INFINITY;
    run->implicit->contraction = 1.0;
    run->implicit->theta = 1.0; /* no Jacobian that could be kept */
}

static int step(lag_run *run)
{
    const int n = lag_size(&run->system);
    lag_implicit *implicit = run->implicit;
    int rejected = 0, undefined = 0, current = 0;
    double *z = run->step.stages;
    for (;;) {
        const double h = lag_step_size(run);
        if (h == 0.0)
            return undefined ? LAG_UNDEFINED : LAG_FLOOR;
        if (run->implicit->theta > FAST && !current) {
            if (lag_linearize(run, run->step.t, run->step.y, run->step.f))
                return LAG_UNDEFINED;
            current = 1;
        } else if (!rejected && !current && lag_derivative(run, run->step.t, run->step.y, run->step.f)) {
            return LAG_UNDEFINED;
        }
        if (implicit->shift != radau_real / h
            && (lag_shift(run, radau_real / h)
                || lag_shift_complex(run, radau_re / h, radau_im / h))) {
            implicit->shift = 0.0;
            const int status = lag_reorder(run);
            if (status != LAG_RUNNING)
                return status;
            run->step.h = 0.5 * h;
            rejected = 1;
            continue;
        }
        int iterations = NEWTON;
        double factor;
        enum newton outcome = solve_stages(run, h, z, &iterations, &factor);
        for (int attempt = 0; outcome == DIVERGED && attempt < ATTEMPTS; ++attempt)
            if (lag_excuse_rounding(run, h, attempt, noise_of_newton))
                outcome = solve_stages(run, h, z, &iterations, &factor);
        lag_be_strict(run);
        if (outcome == CONVERGED) {
            double *estimated = run->step.stages + 3 * n;
            const int doubtful = rejected || run->implicit->h_accepted == 0.0;
            double error = estimate(run, h, z, doubtful, estimated);
            for (int attempt = 0; error >= 1.0 && attempt < ATTEMPTS; ++attempt)
                if (lag_excuse_rounding(run, h, attempt, lag_shifted_noise))
                    error = estimate(run, h, z, doubtful, estimated);
            const double safe = fmin(SAFETY, SAFETY * (1.0 + 2.0 * NEWTON)
                                                 / (iterations + 2.0 * NEWTON));
            factor = fmin(fmax(safe * pow(error, -0.25), LEAST), LARGEST);
            if (error < 1.0) {
                if (run->implicit->h_accepted > 0.0) {
                    const double follows = lag_predicted_factor(h, error, run->implicit->h_accepted,
                                                                run->step.error_old, lag_radau5.order);
                    factor = fmin(factor, fmax(follows, LEAST));
                }
                run->implicit->h_converging *= RELAXED;
                factor = fmin(factor, run->implicit->h_converging / h);
                if (rejected)
                    factor = fmin(factor, 1.0);
                for (int m = 0; m < n; ++m)
                    run->step.y_new[m] = run->step.y[m] + z[2 * n + m];
                interpolate(run, z, estimated);
                run->step.error_old = fmax(error, 1e-2);
                run->implicit->h_accepted = h;
                if (run->implicit->theta <= FAST && factor >= 1.0 && factor <= KEPT)
                    factor = 1.0;
                lag_accept(run, h, factor);
                return LAG_RUNNING;
            }
            lag_reject_step(run, estimated);
            if (run->implicit->h_accepted == 0.0)
                factor = 0.1;
        } else {
            undefined = outcome == NOT_DEFINED;
            run->implicit->h_converging = h * factor;
        }
        run->implicit->theta = 1.0; /* a new Jacobian may help as much as a smaller step */
        run->step.h = h * factor;
        rejected = 1;
        ++run->step.rejected;
    }
}

static void dense(lag_run *run, double t, double *y)
{
    const int n = lag_size(&run->system);
    /* relative to the end, where y_new is known */
    const double x = (t - run->step.t_old) / run->step.h_old - 1.0;
    for (int m = 0; m < n; ++m)
        y[m] = run->step.y_new[m] + continued(run->step.dense, n, m, x);
}

static int control_points(lag_run *run, int i, double *b)
{
    const int n = lag_size(&run->system);
    const double *d = run->step.dense + i, c1 = radau_c[0], c2 = radau_c[1];
    b[0] = d[2 * n];
    lag_times_linear(b, 0, -c1, 1.0 - c1, d[n]);
    lag_times_linear(b, 1, -c2, 1.0 - c2, d[0]);
    lag_times_linear(b, 2, -1.0, 0.0, run->step.y_new[i]);
    lag_times_linear(b, 3, 1.0, 1.0, 0.0);
    double defect[5] = {0.0, radau_defect * d[3 * n] / 3.0, 0.0, 0.0}; /* times x (1 - x)^2 */
    lag_times_linear(defect, 3, -radau_zero, 1.0 - radau_zero, 0.0);
    for (int j = 0; j < 5; ++j)
        b[j] += defect[j];
    return 4;
}

const lag_method lag_radau5 = {
    .name = "Radau",
    .order = 4.0,
    .step = step,
    .dense = dense,
    .control_points = control_points,
    .restart = restart};
