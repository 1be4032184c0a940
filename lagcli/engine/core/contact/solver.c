#include "contact/contact.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "contact/modes.h"

#define SAME 1e-7    /* of the problem's size: motions that coincide */
#define MOST 1024    /* number of mode combinations that are tried one by one */
#define ATTEMPTS 4   /* steps of the mode Newton method per row ... */
#define FEWEST 8     /* ... and at least */
#define CLEAR 2.0    /* rounding errors of the offset: beyond them its sign is known */

typedef struct search {
    lag_contact_work work;
    lag_contact_motion *first, *second;
    int count;     /* of solutions: 0, 1 or 2 */
    int sticking;  /* rows of the solution that stick and whose static limit exceeds the kinetic one */
    int preferred; /* whether such rows exist */
    int enough;    /* number of solutions after which the search ends */
    int64_t tried;
} search;

static int sticks_longer(const lag_contacts *p, int k)
{
    if (p->law[k] != LAG_LIMITED)
        return 0;
    if (p->static_limit[k] > p->kinetic_limit[k])
        return 1;
    for (int j = 0; j < p->n; ++j)
        if (p->static_slope[k * p->n + j] > p->kinetic_slope[k * p->n + j])
            return 1;
    return 0;
}

/* Whether all solutions of the problem have the same motion: it is one of convex optimization where no
 * force limits another. */
static int convex(const lag_contacts *p)
{
    for (int k = 0; k < p->n; ++k) {
        if (p->law[k] == LAG_UNILATERAL || p->law[k] == LAG_FREE)
            continue;
        if (sticks_longer(p, k))
            return 0;
        for (int j = 0; j < p->n; ++j)
            if (p->kinetic_slope[k * p->n + j] != 0.0)
                return 0;
    }
    return 1;
}

static void keep(const lag_contact_work *w, lag_contact_motion *to)
{
    memcpy(to->force, w->force, w->n * sizeof *w->force);
    memcpy(to->motion, w->motion, w->n * sizeof *w->motion);
    memcpy(to->mode, w->mode, w->n * sizeof *w->mode);
}

static int same(const lag_contact_work *w, const lag_contact_motion *other)
{
    double size = 0.0, difference = 0.0;
    for (int i = 0; i < w->n; ++i) {
        const double d = w->scale[i];
        size = fmax(size, fmax(fabs(w->problem->offset[i]) * d, fabs(w->force[i]) / d));
        difference = fmax(difference, fabs(w->motion[i] - other->motion[i]) * d);
    }
    return difference <= SAME * size + w->floor;
}

/* Record the current solution. */
static void enter(search *s)
{
    const lag_contact_work *w = &s->work;
    int sticking = 0;
    if (s->preferred)
        for (int k = 0; k < w->n; ++k)
            sticking += w->mode[k] == LAG_HOLDS && sticks_longer(w->problem, k);
    if (s->count == 0 || sticking > s->sticking) {
        keep(w, s->first);
        s->count = 1;
        s->sticking = sticking;
    } else if (s->count == 1 && sticking == s->sticking && !same(w, s->first)) {
        keep(w, s->second);
        s->count = 2;
    }
}

/* Change the modes of violated rows, from the current modes. */
static void newton(search *s)
{
    lag_contact_work *w = &s->work;
    lag_contact_rouse(w, w->mode);
    for (int k = 0; k < FEWEST + ATTEMPTS * w->n; ++k) {
        if (lag_contact_try(w)) {
            lag_contact_close(w);
            enter(s);
            return;
        }
        memcpy(w->mode, w->next, w->n * sizeof *w->mode);
        memcpy(w->sign, w->turned, w->n * sizeof *w->sign);
    }
}

/* Start in one mode for unilateral rows and one for limited rows; slips have the sign of the offset. */
static void start(lag_contact_work *w, int unilateral, int limited)
{
    for (int i = 0; i < w->n; ++i) {
        const int law = w->problem->law[i];
        w->mode[i] = law == LAG_UNILATERAL ? unilateral : LAG_HOLDS;
        if (law == LAG_LIMITED && limited != LAG_HOLDS)
            w->mode[i] = w->problem->offset[i] < 0.0 ? LAG_SLIPS_BACKWARD : LAG_SLIPS_FORWARD;
    }
}

/* Try all modes of the rows from this place of the order on; without `solving` only count them, up to one more than
 * MOST. */
static void enumerate(search *s, int place, int solving)
{
    lag_contact_work *w = &s->work;
    if (solving ? s->count == s->enough && !s->preferred : s->tried > MOST)
        return;
    if (place == w->n) {
        if (!solving)
            ++s->tried;
        else if (lag_contact_try(w))
            enter(s);
        return;
    }
    const int i = w->order[place], law = w->problem->law[i];
    static const int slips[] = {LAG_SLIPS_FORWARD, LAG_SLIPS_BACKWARD};
    if (law == LAG_FORWARD || law == LAG_BACKWARD || lag_contact_idle(w, w->mode, i)) {
        w->mode[i] = lag_contact_idle(w, w->mode, i) ? LAG_OPEN : slips[law == LAG_BACKWARD];
        enumerate(s, place + 1, solving);
        return;
    }
    for (int sign = 1; sign >= (law != LAG_UNILATERAL && w->referred[i] ? -1 : 1); sign -= 2) {
        w->mode[i] = LAG_HOLDS;
        w->sign[i] = sign;
        enumerate(s, place + 1, solving);
    }
    if (law == LAG_UNILATERAL) {
        w->mode[i] = LAG_OPEN;
        enumerate(s, place + 1, solving);
    }
    for (int k = 0; law == LAG_LIMITED && k < 2; ++k) {
        w->mode[i] = slips[k];
        enumerate(s, place + 1, solving);
    }
}

/* Solve for one contact, 0 <= x and 0 <= A x + b, where rounding does not decide. Returns whether that is so. */
static int solve_single(const lag_contacts *p, lag_contact_motion *to)
{
    if (p->n != 1 || p->law[0] != LAG_UNILATERAL)
        return 0;
    const double a = p->matrix[0], b = p->offset[0];
    if (!(a > 0.0) || !(fabs(b) > (p->rounding ? CLEAR * p->rounding[0] : 0.0)))
        return 0;
    const int holds = b < 0.0;
    to->force[0] = holds ? -b / a : 0.0;
    to->motion[0] = holds ? 0.0 : b;
    to->mode[0] = holds ? LAG_HOLDS : LAG_OPEN;
    return 1;
}

int lag_solve_contacts(
    const lag_contacts *problem, const int *present, void *memory, lag_contact_motion *first,
    lag_contact_motion *second)
{
    search s = {.first = first, .second = second};
    if (solve_single(problem, first))
        return LAG_ONE_MOTION;
    lag_contact_prepare(&s.work, problem, memory);
    for (int k = 0; k < problem->n; ++k)
        s.preferred |= sticks_longer(problem, k);
    static const int starts[][2] = {
        {LAG_HOLDS, LAG_HOLDS}, {LAG_OPEN, LAG_HOLDS}, {LAG_HOLDS, LAG_SLIPS_FORWARD}};
    s.enough = convex(problem) ? 1 : 2;

    if (present) {
        memcpy(s.work.mode, present, problem->n * sizeof *present);
        newton(&s);
    }
    for (int k = 0; k < 3 && s.count == 0; ++k) {
        start(&s.work, starts[k][0], starts[k][1]);
        newton(&s);
    }
    if (s.count == s.enough && !s.preferred)
        return LAG_ONE_MOTION;
    enumerate(&s, 0, 0);
    if (s.tried <= MOST) {
        enumerate(&s, 0, 1);
    } else {
        for (int k = 0; k < 3 && s.count < s.enough; ++k) {
            start(&s.work, starts[k][0], starts[k][1]);
            newton(&s);
        }
        if (s.count < s.enough && lag_contact_lemke(&s.work))
            newton(&s);
    }
    return s.count == 0 ? LAG_NO_MOTION : s.count == 1 ? LAG_ONE_MOTION : LAG_TWO_MOTIONS;
}
