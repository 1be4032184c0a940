/* Directional derivatives of an instance's values: of a model that switches, those of its present modes. */
#ifndef LAGCLI_DIRECTIONAL_H
#define LAGCLI_DIRECTIONAL_H

#include "fmi/instance.h"

#define LAG_FMU_NO_DERIVATIVES 2

/*
 * The changes of unknowns, any variables, along changes `seed` of knowns: of the time, coordinates, velocities, and
 * parameters that can be set. With the right sides at fixed a and lambda,
 *
 *   M delta a - B' delta lambda = delta (f - M a + B' lambda),  B delta a = delta (gamma - B a).
 *
 * With redundant constraints, B = C B_r with independent rows B_r, and lambda = C (C' C)^-1 mu is that of least norm. The
 * changes are those of a motion on the constraints; along changes that leave these, they depend on which rows B_r has.
 *
 * Returns 0; 1, and a message, if that fails; LAG_FMU_NO_DERIVATIVES, and a message, where the state has none.
 */
int lag_fmu_directional(lag_fmu *fmu, const unsigned *unknowns, size_t unknown_count, const unsigned *knowns,
                        size_t known_count, const double *seed, double *changes);

/* The changes along each of the knowns, added up with weights `seed` of the unknowns. Returns the same. */
int lag_fmu_adjoint(lag_fmu *fmu, const unsigned *unknowns, size_t unknown_count, const unsigned *knowns,
                    size_t known_count, const double *seed, double *changes);

#endif
