/* Operations on arrays for processors with AVX2, without fused operations. */
#if defined(__x86_64__)
#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2"))), apply_to = function)
#else
#pragma GCC target("avx2")
#endif
#define NAME lag_vectors_avx2
#include "tape/vectors_kernel.h"
#if defined(__clang__)
#pragma clang attribute pop
#endif
#else
typedef int lag_vectors_no_avx2; /* ISO C forbids empty files */
#endif
