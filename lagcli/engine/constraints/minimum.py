"""Minima of functions of one variable, without importing SciPy in the middle of a run."""

from __future__ import annotations

import math
from collections.abc import Callable

#: The smaller part of an interval in golden section.
_GOLDEN = 0.5 * (3.0 - math.sqrt(5.0))
#: Near a minimum, values of a smooth function that are closer than this, relatively, do not differ.
_RESOLUTION = math.sqrt(2.0**-52)
_MOST = 500  # evaluations


def minimum(
    function: Callable[[float], float], low: float, high: float, tolerance: float
) -> tuple[float, float]:
    """Return a local minimum of a function in an interval, and its value, by Brent's method.

    Golden section, or a step to the minimum of the parabola through the three lowest values where
    such steps become shorter.

    Parameters
    ----------
    function : callable
    low, high : float
        The ends, at which the function is not evaluated.
    tolerance : float
        Of the place.

    References
    ----------
    R. P. Brent, Algorithms for Minimization without Derivatives, Prentice-Hall (1973), chapter 5.
    """
    x = second = third = low + _GOLDEN * (high - low)
    fx = f_second = f_third = function(x)
    step = before = 0.0
    for _ in range(_MOST):
        middle = 0.5 * (low + high)
        least = _RESOLUTION * abs(x) + tolerance / 3.0
        if abs(x - middle) <= 2.0 * least - 0.5 * (high - low):
            break
        one, other = (x - second) * (fx - f_third), (x - third) * (fx - f_second)
        p, q = (x - third) * other - (x - second) * one, 2.0 * (one - other)
        p, q = (p, q) if q > 0.0 else (-p, -q)
        if abs(p) < 0.5 * q * abs(before) and q * (low - x) < p < q * (high - x):
            before, step = step, p / q
            if min(x + step - low, high - x - step) < 2.0 * least:
                step = math.copysign(least, middle - x)
        else:
            before = (low if x >= middle else high) - x
            step = _GOLDEN * before
        y = x + (step if abs(step) >= least else math.copysign(least, step))
        fy = function(y)
        if fy <= fx:
            low, high = (x, high) if y >= x else (low, x)
            third, f_third, second, f_second, x, fx = second, f_second, x, fx, y, fy
            continue
        low, high = (y, high) if y < x else (low, y)
        if fy <= f_second or second == x:
            third, f_third, second, f_second = second, f_second, y, fy
        elif fy <= f_third or third in (x, second):
            third, f_third = y, fy
    return x, fx
