/* What is done on vectors, for any processor. */
#define NAME lag_vectors_default
#include "tape/vectors_kernel.h"
