#include "roots.h"

#include <math.h>

#define ITERATIONS 200

double lag_bracketed_root(lag_scalar_function f, void *context, double low, double high, double a, double b,
                          double exact)
{
    double last = INFINITY, older = INFINITY; /* widths of the bracket, one and two iterations ago */
    int side = 0;
    for (int i = 0; i < ITERATIONS && high - low > exact; ++i) {
        const double width = high - low;
        double x = width > 0.5 * older ? low + 0.5 * width : high - b * width / (b - a);
        older = last;
        last = width;
        /* a step beyond the root, so that the interval shrinks from both sides */
        x = fmin(fmax(x, low + 0.5 * exact), high - 0.5 * exact);
        const double g = f(context, x);
        if (g < 0.0) {
            high = x;
            b = g;
            a *= side < 0 ? 0.5 : 1.0; /* an end that remains twice */
            side = -1;
        } else {
            low = x;
            a = g;
            b *= side > 0 ? 0.5 : 1.0;
            side = 1;
        }
    }
    return high;
}

double lag_last_digit_root(lag_scalar_function f, void *context, double low, double high)
{
    for (int i = 0; i < ITERATIONS; ++i) {
        const double x = low + 0.5 * (high - low);
        if (!(x > low && x < high))
            break;
        if (f(context, x) <= 0.0)
            high = x;
        else
            low = x;
    }
    return high;
}
