# Roots inside a bracket, for tests; see roots.h.

from libc.math cimport NAN


cdef extern from "roots.h":
    ctypedef double (*lag_scalar_function)(void *context, double x) noexcept
    double lag_bracketed_root(
        lag_scalar_function f, void *context, double low, double high, double a, double b, double exact)
    double lag_last_digit_root(lag_scalar_function f, void *context, double low, double high)


cdef class _Watched:
    """A function, and what it has raised: after that it is not called again."""

    cdef object function, error

    def __init__(self, function):
        self.function, self.error = function, None


cdef double _scalar_value(void *context, double x) noexcept:
    cdef _Watched watched = <_Watched>context
    if watched.error is not None:
        return NAN
    try:
        return watched.function(x)
    except BaseException as error:
        watched.error = error
        return NAN


def bracketed_root(function, double low, double high, double exact):
    """Return where a function is found negative, after values that are not; raise what it raises."""
    cdef _Watched watched = _Watched(function)
    a, b = function(low), function(high)
    found = lag_bracketed_root(_scalar_value, <void *>watched, low, high, a, b, exact)
    if watched.error is not None:
        raise watched.error
    return found


def last_digit_root(function, double low, double high):
    """Return the first number at which a function is not positive; raise what it raises."""
    cdef _Watched watched = _Watched(function)
    found = lag_last_digit_root(_scalar_value, <void *>watched, low, high)
    if watched.error is not None:
        raise watched.error
    return found
