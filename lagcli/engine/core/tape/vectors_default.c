/* Operations on arrays for any processor. */
#define NAME lag_vectors_default
#include "tape/vectors_kernel.h"
