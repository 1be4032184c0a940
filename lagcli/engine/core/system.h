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
    lag_tape dynamics;                 /* M entries, f, B entries, gamma, power */
    lag_tape constraint;               /* phi, B entries, b_0, scale of phi, scale of psi, psi */
} lag_system;

#endif
