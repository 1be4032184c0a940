/* Functions of single numbers, as the interpreter calls them. */
#define _GNU_SOURCE /* sincos */
#include "native/calls.h"

#include <math.h>

#include "tape/sincos.h"

#define SIN(x) sin(x)
#define COS(x) cos(x)
#define LARGER(x, y) fmax(x, y)
#define CHOOSE(condition, x, y) ((condition) ? (x) : (y))
#define DEFINE(op, places, value) \
    static inline double value_##op(double A, double B) \
    { \
        const double C = B; \
        (void)B, (void)C; \
        return value; \
    }
LAG_LIBRARY_OPERATIONS(DEFINE)
LAG_BATCH_OPERATIONS(DEFINE)

static void sine_and_cosine(double x, double *sine, double *cosine)
{
    SINCOS(x, sine, cosine);
}

#define CALL(op) [op] = (lag_called *)value_##op
#define CALLED(op, places, value) CALL(op),
const lag_calls lag_calls_of_one = {
    {LAG_LIBRARY_OPERATIONS(CALLED) CALL(OP_SIN), CALL(OP_COS), CALL(OP_OR), [OP_SINCOS] = (lag_called *)sine_and_cosine}};
