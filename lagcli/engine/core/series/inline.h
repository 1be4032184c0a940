/* How the loops over series are compiled. */
#ifndef LAGCLI_SERIES_INLINE_H
#define LAGCLI_SERIES_INLINE_H

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wpsabi" /* vectors are passed within one file alone */
#endif

/* Wider registers give the same numbers: the widest there are is chosen when the program is loaded. */
#if defined(__x86_64__) && defined(__gnu_linux__) && defined(__GNUC__) && !defined(__clang__)
#define FOR_WIDER __attribute__((target_clones("avx2", "default")))
#else
#define FOR_WIDER
#endif
#if defined(__GNUC__)
#define ALWAYS_INLINE static inline __attribute__((always_inline))
#else
#define ALWAYS_INLINE static inline
#endif

#endif
