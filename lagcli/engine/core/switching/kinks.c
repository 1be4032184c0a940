#include "switching/kinks.h"

#include <math.h>
#include <string.h>

#include "equations.h"
#include "switching/enclosure.h"
#include "switching/rows.h"
#include "switching/surfaces.h"

#define AHEAD 1e-7          /* of a step, or of the run: look-ahead at which accelerations determine a side */
#define AROUND 1e-4         /* of a step: interval of difference quotients of a surface's function */
#define ON_SURFACE 1e-9     /* of the terms of a function: zero at its surface */
#define CONTINUOUS 1e-10    /* of the terms of accelerations: rounding error */
#define MOST_AT_ONCE 10     /* largest number of surfaces at one instant */

enum { UPPER, LOWER };

void lag_keep_branches(lag_run *run)
{
    const lag_kinks *k = &run->switching.kinks;
    memcpy(run->parameters + k->first, k->branch, (size_t)k->count * sizeof(double));
}

static void evaluate(lag_run *run, double t, const double *y)
{
    lag_evaluate(&run->switching.kinks.tape, &run->system, t, y, LAG_ALL);
}

/* The branch of a function's value that is not at a surface. */
static double branch_of(const lag_kinks *k, int kink, double g)
{
    return !k->whole[kink] ? copysign(1.0, g) : k->whole[kink] > 0 ? floor(g) : ceil(g);
}

void lag_preview_branches(lag_run *run, double t, const double *y)
{
    const lag_kinks *k = &run->switching.kinks;
    double *branch = run->parameters + k->first;
    for (int pass = 0, changed = k->count > 0; changed && pass <= k->count; ++pass) {
        changed = 0;
        evaluate(run, t, y);
        for (int i = 0; i < k->count; ++i) {
            const double now = branch_of(k, i, OUT(&k->tape, i));
            changed |= now != branch[i];
            branch[i] = now;
        }
        if (changed)
            lag_renew_tapes(run);
    }
}

void lag_end_preview(lag_run *run)
{
    if (run->switching.kinks.count == 0)
        return;
    lag_keep_branches(run);
    lag_renew_tapes(run);
}

static void take_branch(lag_run *run, int kink, double branch)
{
    lag_kinks *k = &run->switching.kinks;
    if (k->branch[kink] == branch)
        return;
    k->branch[kink] = branch;
    lag_keep_branches(run);
    lag_renew_tapes(run);
}

/* The branch above or below a surface: that of zero, or that of the whole number next to the function. */
static double branch_beside(const lag_kinks *k, int kink, int side)
{
    if (!k->whole[kink])
        return side == UPPER ? 1.0 : -1.0;
    return k->bound[kink] + (side == UPPER ? 0.0 : -1.0) + (k->whole[kink] < 0);
}

/* Up to what a function that vanishes may be off zero at its surface: also what rows that hold leave of it. */
static double on_surface(const lag_kinks *k, int kink)
{
    return fmax(ON_SURFACE * k->size[kink], k->held[kink]);
}

/* The errors of functions that rows hold at the state of the run. Returns 0, or 1. */
static int find_held(lag_run *run)
{
    lag_kinks *k = &run->switching.kinks;
    if (!run->switching.rows)
        return 0;
    if (lag_find_rows(run, run->step.t, run->step.y) || lag_enclosure_touch(run, run->step.t, run->step.y))
        return 1;
    for (int i = 0; i < k->count; ++i) {
        k->held[i] = lag_held_error_of_kink(run, i, run->step.t, run->step.y);
        k->drift[i] = k->held[i] > 0.0 ? lag_held_rate_of_kink(run, i, run->step.t, run->step.y) : 0.0;
    }
    return 0;
}

/* Set the branches of functions that do not vanish here. */
static void take_clear_branches(lag_run *run)
{
    lag_kinks *k = &run->switching.kinks;
    for (int pass = 0, changed = 1; changed && pass <= k->count; ++pass) {
        changed = 0;
        evaluate(run, run->step.t, run->step.y);
        for (int i = 0; i < k->count; ++i) {
            k->size[i] = fmax(k->size[i], lag_kink_size(run, i));
            const double g = OUT(&k->tape, i), nearest = k->whole[i] ? floor(g + 0.5) : 0.0;
            const double zero = k->state[i] == LAG_ON_SURFACE ? on_surface(k, i) : k->held[i];
            if (k->state[i] == LAG_SIDE_KNOWN)
                continue;
            if (fabs(g - nearest) <= zero) {
                k->state[i] = LAG_ON_SURFACE;
                k->bound[i] = nearest;
                continue;
            }
            k->state[i] = LAG_OFF_SURFACE;
            const double branch = branch_of(k, i, g);
            changed |= branch != k->branch[i];
            k->branch[i] = branch;
        }
        if (changed) {
            lag_keep_branches(run);
            lag_renew_tapes(run);
        }
    }
}

/* The distance of a function from the surface at which its branch is undecided; 0 near it. */
static double off_surface(const lag_kinks *k, int kink)
{
    const double g = OUT(&k->tape, kink) - k->bound[kink];
    return fabs(g) > on_surface(k, kink) ? g : 0.0;
}

/* The functions after a time d with accelerations a + terms. */
static void evaluate_ahead(lag_run *run, double d, const double *a, const double *terms)
{
    lag_kinks *k = &run->switching.kinks;
    const int nq = run->system.nq;
    const double *y = run->step.y;
    for (int i = 0; i < nq; ++i) {
        const double x = a[i] + (terms ? terms[i] : 0.0);
        k->y[i] = y[i] + d * (y[nq + i] + 0.5 * d * x);
        k->y[nq + i] = y[nq + i] + d * x;
    }
    k->y[2 * nq] = y[2 * nq];
    evaluate(run, run->step.t + d, k->y);
}

/* How the functions leave their surfaces: what they are, where another branch has moved these, or how much they
 * grow in a short time with accelerations a, 0 if that is rounding; to `growth`. */
static void look_ahead(lag_run *run, const double *a)
{
    lag_kinks *k = &run->switching.kinks;
    const double t = run->step.t, *y = run->step.y;
    const double d = AHEAD * (run->step.h > 0.0 ? fmin(run->step.h, run->settings.t_end - run->step.t_start)
                                                : run->settings.t_end - run->step.t_start);
    evaluate_ahead(run, d, a, run->tolerances.acceleration_terms);
    for (int i = 0; i < k->count; ++i)
        k->rounding[i] = OUT(&k->tape, i);
    evaluate_ahead(run, d, a, NULL);
    for (int i = 0; i < k->count; ++i) {
        k->growth[i] = OUT(&k->tape, i);
        k->rounding[i] = CONTINUOUS * fabs(k->rounding[i] - k->growth[i]) + d * k->drift[i];
    }
    evaluate(run, t, y);
    for (int i = 0; i < k->count; ++i) {
        const double off = off_surface(k, i), grown = k->growth[i] - OUT(&k->tape, i);
        k->growth[i] = off != 0.0 ? off : fabs(grown) > k->rounding[i] ? grown : 0.0;
    }
}

/* Whether all surfaces listed but one let the motion go to the side on which it is taken to be; `clearly`: none
 * of them stays zero. */
static int leaves(const lag_kinks *k, int n, const int *list, int sides, int but, int clearly)
{
    for (int i = 0; i < n; ++i) {
        const double away = (sides >> i & 1) == UPPER ? k->growth[list[i]] : -k->growth[list[i]];
        if (list[i] != but && (away < 0.0 || (clearly && away == 0.0)))
            return 0;
    }
    return 1;
}

/* Choose the sides of the listed surfaces. */
static void take_sides(lag_run *run, int n, const int *list, int sides)
{
    const lag_kinks *k = &run->switching.kinks;
    for (int i = 0; i < n; ++i)
        take_branch(run, list[i], branch_beside(k, list[i], sides >> i & 1));
}

/* The rate of a surface's function along accelerations a: by its jet, or by differences where that has no bounds. */
static double rate_along(lag_run *run, int kink, double t, const double *y, const double *a)
{
    lag_kinks *k = &run->switching.kinks;
    const int nq = run->system.nq;
    const double d = AROUND * (run->step.h > 0.0 ? fmin(run->step.h, 1.0) : 1.0);
    const double rate = lag_rate_of_kink(run, kink, t, y, a);
    double change = 0.0;
    if (isfinite(rate))
        return rate;
    for (int sign = -1; sign <= 1; sign += 2) {
        for (int i = 0; i < nq; ++i) {
            k->y[i] = y[i] + sign * d * y[nq + i];
            k->y[nq + i] = y[nq + i] + sign * d * a[i];
        }
        k->y[2 * nq] = y[2 * nq];
        evaluate(run, t + sign * d, k->y);
        change += sign * OUT(&k->tape, kink);
    }
    return change / (2.0 * d);
}

int lag_slide(lag_run *run, double t, const double *y, int refined, double *power)
{
    lag_switching *sw = &run->switching;
    lag_kinks *k = &sw->kinks;
    const int kink = k->slides, n = run->system.nq + run->system.nc, rows = sw->rows + sw->nf;
    const int size = n + sw->nc + rows + 1;
    double *of_side[] = {k->both, k->both + size}, rate[2];
    for (int side = UPPER; side <= LOWER; ++side) {
        double *out = of_side[side];
        take_branch(run, kink, branch_beside(k, kink, side));
        k->slides = -1;
        const int bad = lag_accelerate_on_branch(run, t, y, refined, out + size - 1);
        k->slides = kink;
        if (bad)
            return 1;
        memcpy(out, run->solver.a, (size_t)n * sizeof(double));
        memcpy(out + n, sw->multipliers, (size_t)sw->nc * sizeof(double));
        memcpy(out + n + sw->nc, sw->force, (size_t)rows * sizeof(double));
        rate[side] = rate_along(run, kink, t, y, out);
    }
    k->rates = rate[UPPER] - rate[LOWER];
    k->weight = -rate[LOWER] / k->rates;
    for (int i = 0; i < size; ++i) {
        of_side[UPPER][i] -= of_side[LOWER][i]; /* what the surface adds and takes */
        of_side[LOWER][i] += k->weight * of_side[UPPER][i];
    }
    memcpy(run->solver.a, of_side[LOWER], (size_t)n * sizeof(double));
    memcpy(sw->multipliers, of_side[LOWER] + n, (size_t)sw->nc * sizeof(double));
    memcpy(sw->force, of_side[LOWER] + n + sw->nc, (size_t)rows * sizeof(double));
    *power = of_side[LOWER][size - 1];
    return !isfinite(k->weight);
}

void lag_leave_surface(lag_run *run, double side)
{
    lag_kinks *k = &run->switching.kinks;
    const int kink = k->slides;
    k->slides = -1;
    k->state[kink] = LAG_SIDE_KNOWN;
    take_branch(run, kink, branch_beside(k, kink, side > 0.0 ? UPPER : LOWER));
}

/* Whether both sides of the surface that lag_slide has combined have the same accelerations except for rounding. */
static int continuous(const lag_run *run)
{
    const lag_kinks *k = &run->switching.kinks;
    for (int i = 0; i < run->system.nq; ++i)
        if (fabs(k->both[i]) > CONTINUOUS * (fabs(run->solver.a[i]) + run->tolerances.acceleration_terms[i]))
            return 0;
    return 1;
}

int lag_hold_surface(lag_run *run, double t, double *y)
{
    lag_kinks *k = &run->switching.kinks;
    const int nq = run->system.nq;
    double power;
    for (int step = 0; step < 2; ++step) {
        const double g = lag_off_surface(run, t, y);
        if (g == 0.0)
            break;
        if (lag_slide(run, t, y, 0, &power))
            return LAG_UNDEFINED;
        for (int i = 0; i < nq; ++i)
            y[nq + i] -= g / k->rates * k->both[i];
    }
    return LAG_RUNNING;
}

/* Find the surface among the listed ones on which the motion slides. */
static int choose_surface(lag_run *run, int n, const int *list, int preferred)
{
    lag_kinks *k = &run->switching.kinks;
    double power;
    int jumps = 0;
    for (int which = 0; which < n; ++which)
        for (int sides = 0; sides < 1 << n; ++sides) {
            if (sides >> which & 1)
                continue;
            take_sides(run, n, list, sides);
            evaluate(run, run->step.t, run->step.y);
            if (off_surface(k, list[which]) != 0.0)
                continue;
            k->slides = list[which];
            const int bad = lag_slide(run, run->step.t, run->step.y, 0, &power);
            k->slides = -1;
            if (bad || continuous(run))
                continue;
            jumps = 1;
            look_ahead(run, run->solver.a);
            if (k->weight >= 0.0 && k->weight <= 1.0 && leaves(k, n, list, sides, list[which], 0)) {
                k->slides = list[which];
                ++k->slid;
                return LAG_RUNNING;
            }
        }
    if (jumps)
        return LAG_SURFACES;
    take_sides(run, n, list, preferred);
    return LAG_RUNNING;
}

/* Update the branches of functions that do not vanish but depend on branches just chosen: they may have jumped. */
static void follow_branches(lag_run *run)
{
    lag_kinks *k = &run->switching.kinks;
    for (int pass = 0, changed = 1; changed && pass <= k->count; ++pass) {
        changed = 0;
        evaluate(run, run->step.t, run->step.y);
        for (int i = 0; i < k->count; ++i) {
            const double g = OUT(&k->tape, i);
            const double branch = branch_of(k, i, g);
            if (k->state[i] != LAG_OFF_SURFACE || branch == k->branch[i]
                || fabs(g - (k->whole[i] ? floor(g + 0.5) : 0.0)) <= on_surface(k, i))
                continue;
            changed = 1;
            k->branch[i] = branch;
        }
        if (changed) {
            lag_keep_branches(run);
            lag_renew_tapes(run);
        }
    }
}

/* Whether a function on its surface is taken to be above it, where the motion does not tell: where the contact that
 * holds it opens; where it is, if another row holds it; on the other side, if it crosses; and if it begins there. */
static int may_be_above(lag_run *run, int kink, int crossed)
{
    const lag_kinks *k = &run->switching.kinks;
    const int above = k->branch[kink] == branch_beside(k, kink, UPPER);
    const int held = k->held[kink] > 0.0, side = held ? lag_side_of_kink(run, kink, run->step.t, run->step.y) : 0;
    if (side)
        return side > 0;
    return held && run->switching.begun ? above : !crossed || !above;
}

int lag_choose_branches(lag_run *run)
{
    lag_kinks *k = &run->switching.kinks;
    int list[MOST_AT_ONCE], n = 0, preferred = 0, chosen = -1, crossed = 0;
    double power;
    if (!k->count)
        return LAG_RUNNING;
    if (find_held(run))
        return LAG_UNDEFINED;
    if (k->slides >= 0 && k->state[k->slides] != LAG_SIDE_KNOWN)
        k->state[k->slides] = LAG_ON_SURFACE;
    k->slides = -1;
    for (int i = 0; i < k->count; ++i)
        crossed |= k->state[i] != LAG_OFF_SURFACE;
    take_clear_branches(run);
    for (int i = 0; i < k->count; ++i) {
        if (k->state[i] != LAG_ON_SURFACE)
            continue;
        if (n == MOST_AT_ONCE)
            return LAG_SURFACES;
        preferred |= (may_be_above(run, i, crossed) ? UPPER : LOWER) << n;
        list[n++] = i;
    }
    k->undecided = n;
    if (!n)
        return LAG_RUNNING;
    for (int i = 0; i < 1 << n; ++i) {
        const int sides = i ^ preferred;
        take_sides(run, n, list, sides);
        if (lag_accelerate_on_branch(run, run->step.t, run->step.y, 0, &power))
            continue;
        --run->step.evaluations;
        look_ahead(run, run->solver.a);
        if (!leaves(k, n, list, sides, -1, 0))
            continue;
        if (chosen >= 0 && !crossed && leaves(k, n, list, sides, -1, 1))
            return LAG_FORKED;
        if (chosen < 0)
            chosen = sides;
        if (crossed)
            break;
    }
    if (chosen < 0)
        return choose_surface(run, n, list, preferred);
    take_sides(run, n, list, chosen);
    follow_branches(run);
    return LAG_RUNNING;
}
