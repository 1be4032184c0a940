/* The lanes for any processor: vectors of two, which all processors have. */
#define VEC_BYTES 16
#define NAME lag_batch_default
#include "batch/batch_kernel.h"
