/* What is integrated: tapes, sizes and sparsity; engine/system.py says what each tape holds. */
#ifndef LAGCLI_SYSTEM_H
#define LAGCLI_SYSTEM_H

#include "tape/tape.h"

/* M a = f + B' lambda, B a = gamma, phi = 0, psi = 0. */
typedef struct {
    int nq, nc, nh;
    const int32_t *holonomic;          /* nh indices of constraints */
    int nm, nb;                        /* nonzero entries of M and B */
    const int32_t *mass_row, *mass_column;         /* nm each */
    const int32_t *jacobian_row, *jacobian_column; /* nb each */
    const int32_t *mass_diagonal;      /* nq: M's entries on its diagonal; -1: zero */
    const int32_t *unit;               /* nq: the first coordinate that has the same unit with certainty */
    lag_tape dynamics, constraint;     /* their outputs lie as layout.h says */
    int blocks;                        /* the motion, and its derivatives in each direction */
    int complete;                      /* whether the unrolled dynamics have the solution of all blocks */
    lag_tape tangent;                  /* f and gamma of the derivatives; where there are any */
} lag_system;

#include "layout.h"

#endif
