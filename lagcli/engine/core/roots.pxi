# Roots inside a bracket, for tests; see roots.h.


cdef extern from "roots.h":
    ctypedef double (*lag_scalar_function)(void *context, double x) noexcept
    double lag_bracketed_root(
        lag_scalar_function f, void *context, double low, double high, double a, double b, double exact)
    double lag_last_digit_root(lag_scalar_function f, void *context, double low, double high)


cdef double _scalar_value(void *context, double x) noexcept:
    return (<object>context)(x)


def bracketed_root(function, double low, double high, double exact):
    """Return where a function is found negative, after values that are not."""
    a, b = function(low), function(high)
    return lag_bracketed_root(_scalar_value, <void *>function, low, high, a, b, exact)


def last_digit_root(function, double low, double high):
    """Return the first number at which a function is not positive."""
    return lag_last_digit_root(_scalar_value, <void *>function, low, high)
