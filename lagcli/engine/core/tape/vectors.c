#include "tape/vectors.h"

const lag_vector_kernel *lag_vectors(void)
{
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2"))
        return &lag_vectors_avx2;
#endif
    return &lag_vectors_default;
}
