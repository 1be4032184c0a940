/* What is integrated: tapes, sizes and sparsity; engine/system.py says what each tape holds. */
#ifndef LAGCLI_SYSTEM_H
#define LAGCLI_SYSTEM_H

#include "tape.h"

/* M a = f + B' lambda, B a = gamma, phi = 0, psi = 0. */
typedef struct {
    int nq, nc, nh;
    const int32_t *holonomic;          /* nh indices of constraints */
    int nm, nb;                        /* nonzero entries of M and B */
    const int32_t *mass_row, *mass_column;         /* nm each */
    const int32_t *jacobian_row, *jacobian_column; /* nb each */
    const int32_t *mass_diagonal;      /* nq: M's entries on its diagonal; -1: zero */
    const int32_t *unit;               /* nq: the first coordinate that has the same unit for certain */
    lag_tape dynamics;                 /* M entries, f, B entries, gamma, power */
    lag_tape constraint;               /* phi, B entries, b_0, scale of phi, scale of psi, psi */
} lag_system;

/* Where outputs of the dynamics tape begin: M is the first. */
static inline int lag_first_forcing(const lag_system *s)
{
    return s->nm;
}

static inline int lag_first_jacobian(const lag_system *s)
{
    return s->nm + s->nq;
}

static inline int lag_first_rhs(const lag_system *s)
{
    return s->nm + s->nq + s->nb;
}

/* What the unrolled elimination adds to them: a, lambda and the power ... */
static inline int lag_first_solution(const lag_system *s)
{
    return lag_first_rhs(s) + s->nc + 1;
}

/* ... and what its pivots keep: run->solver.cancellation_count, of which the last nc are the squares of the lengths
 * of B's rows. Then come the other solution (nq + nc) and the one for the constraints alone (nq). */
static inline int lag_first_kept(const lag_system *s)
{
    return lag_first_solution(s) + s->nq + s->nc + 1;
}

/* Where the constraint tape's outputs psi = B v + b_0 begin. */
static inline int lag_first_velocity(const lag_system *s)
{
    return 2 * (s->nh + s->nc) + s->nb;
}

#endif
