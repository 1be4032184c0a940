/* Operations on arrays, with the processor's best instructions; all variants give the same results. */
#ifndef LAGCLI_VECTORS_H
#define LAGCLI_VECTORS_H

#include <stdint.h>

typedef struct {
    /* Run a stream on a register file. */
    void (*run)(const int32_t *stream, double *registers);

    /* y = base + the sum of `terms` rows times weights and a factor, n elements each. Of rows that lie `apart` numbers
     * from each other, those with the given numbers. */
    void (*combine)(int n, const double *base, int terms, const double *rows, int apart, const int *number,
                    const double *weight, double factor, double *y);

    /* y[i] = x[places[i]], n of them. Returns their sum: it is finite if they are. */
    double (*pick)(int n, const double *x, const int32_t *places, double *y);

    /* Update scales to current values; return the largest magnitude of x over its scale, n of each, or NaN if one is
     * NaN. */
    double (*largest)(int n, const double *x, const double *now, double *scale);

    /* The sum of the squares of x over the tolerances at y and z, n of each, atol among them. */
    double (*scaled_square)(int n, const double *x, const double *y, const double *z,
                            const double *atol, double rtol);

    /* Subtract `terms` vectors x times weights from y, one after the other, n elements each. */
    void (*subtract)(int n, double *y, int terms, const double *const *x, const double *weight);
} lag_vector_kernel;

extern const lag_vector_kernel lag_vectors_default, lag_vectors_avx2;

/* The functions of a lag_kernel. */
const lag_vector_kernel *lag_vectors(int kernel);

#endif
