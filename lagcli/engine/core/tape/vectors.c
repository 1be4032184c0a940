#include "tape/vectors.h"

#include "lagcore.h"

#if defined(__x86_64__)
#include <cpuid.h>

/* Whether the processor has AVX2 and the system saves its registers. Not __builtin_cpu_supports: some compilers take
 * that from a library that brings mathematical functions of its own along. */
static int has_avx2(void)
{
    unsigned a, b, c, d, low, high;
    const unsigned needed = bit_OSXSAVE | bit_AVX;
    if (!__get_cpuid(1, &a, &b, &c, &d) || (c & needed) != needed)
        return 0;
    __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    return (low & 6) == 6 && __get_cpuid_count(7, 0, &a, &b, &c, &d) && (b & bit_AVX2);
}
#endif

int lag_best_kernel(void)
{
#if defined(__x86_64__)
    if (has_avx2())
        return LAG_NATIVE;
#endif
    return LAG_PORTABLE;
}

const lag_vector_kernel *lag_vectors(int kernel)
{
#if defined(__x86_64__)
    if (kernel >= LAG_AVX2)
        return &lag_vectors_avx2;
#endif
    (void)kernel;
    return &lag_vectors_default;
}
