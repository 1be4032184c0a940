/* The lanes for processors with AVX2: vectors of four. Without fused operations, so that all
 * processors give the same numbers. */
#if defined(__x86_64__)
#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2"))), apply_to = function)
#else
#pragma GCC target("avx2")
#endif
#define VEC_BYTES 32
#define NAME lag_batch_avx2
#include "batch/batch_kernel.h"
#if defined(__clang__)
#pragma clang attribute pop
#endif
#else
typedef int lag_batch_no_avx2; /* ISO C forbids empty files */
#endif
