/* The sine and the cosine of one number. */
#ifndef LAGCLI_SINCOS_H
#define LAGCLI_SINCOS_H

#if defined(__GLIBC__)
#define SINCOS(x, s, c) sincos(x, s, c)
#else
#define SINCOS(x, s, c) (*(s) = sin(x), *(c) = cos(x))
#endif

#endif
