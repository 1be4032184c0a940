/* Vectors of the processor's width, VEC_BYTES, which divides LAG_LANES numbers. */
#include <float.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "batch/batch.h"

#define VEC (VEC_BYTES / 8)
typedef double vec __attribute__((vector_size(VEC_BYTES)));
typedef int64_t mask __attribute__((vector_size(VEC_BYTES)));
/* the same in memory, unaligned */
typedef double vec_at __attribute__((vector_size(VEC_BYTES), aligned(8), may_alias));
typedef int64_t mask_at __attribute__((vector_size(VEC_BYTES), aligned(8), may_alias));

/* The parts of eight lanes, one after the other. */
#define EACH_PART(k) for (int k = 0; k < LAG_LANES; k += VEC)
#define EACH_LANE(l) for (int l = 0; l < LAG_LANES; ++l)
#define AT(pointer) (*(vec_at *)(pointer))
#define READ(pointer) ((vec)*(const vec_at *)(pointer))
#define INLINE static inline __attribute__((always_inline))

INLINE vec all(double x)
{
    return x - (vec){0.0};
}

INLINE vec choose(mask m, vec a, vec b)
{
    return (vec)((m & (mask)a) | (~m & (mask)b));
}

INLINE vec larger(vec a, vec b)
{
    return choose(a > b, a, b);
}

INLINE vec smaller(vec a, vec b)
{
    return choose(a < b, a, b);
}

INLINE vec magnitude(vec x)
{
    return (vec)((mask)x & INT64_MAX);
}

INLINE vec root(vec x)
{
    for (int i = 0; i < VEC; ++i)
        x[i] = sqrt(x[i]);
    return x;
}

INLINE int any(mask m)
{
    int64_t any = 0;
    for (int i = 0; i < VEC; ++i)
        any |= m[i];
    return any != 0;
}

/* A set of lanes (one bit each) as a mask of the lanes from k on. */
INLINE mask lanes_of(int set, int k)
{
    mask m = {0};
    for (int i = 0; i < VEC; ++i)
        m[i] = -(int64_t)((set >> (k + i)) & 1);
    return m;
}

/* The lanes from k on in which a mask is true, as a set. */
INLINE int set_of(mask m, int k)
{
    int set = 0;
    for (int i = 0; i < VEC; ++i)
        set |= (m[i] != 0) << (k + i);
    return set;
}

#define HAS(set, l) (((set) >> (l)) & 1)
#define ALL_LANES ((1 << LAG_LANES) - 1)
