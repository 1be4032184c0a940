/* The integrated system: tapes, sizes and sparsity; engine/system.py describes the tapes. */
#ifndef LAGCLI_SYSTEM_H
#define LAGCLI_SYSTEM_H

#include "tape/tape.h"

/* M a = f + B' lambda, B a = gamma, phi = 0, psi = 0. */
typedef struct {
    const lag_vector_kernel *vectors;  /* for the processor */
    int nq, nc, nh;
    const int32_t *holonomic;          /* nh indices of constraints */
    int nm, nb;                        /* nonzero entries of M and B */
    const int32_t *mass_row, *mass_column;         /* nm each */
    const int32_t *jacobian_row, *jacobian_column; /* nb each */
    const int32_t *mass_diagonal;      /* nq: M's entries on its diagonal; -1: zero */
    const int32_t *unit;               /* nq: the first coordinate known to have the same unit */
    lag_tape dynamics, constraint;     /* outputs in the order of layout.h */
    lag_tape equations;                /* M and f where the dynamics do not compute them; otherwise without registers */
    int blocks;                        /* the motion, and its derivatives in each direction */
    int complete;                      /* whether the unrolled dynamics contain the solution of all blocks */
    lag_tape tangent;                  /* f and gamma of the derivatives, if any */
    int carried;                       /* numbers after W in the state: changes, derivatives/derivatives.h */
} lag_system;

#include "layout.h"

#endif
