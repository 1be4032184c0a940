"""Location of the first time in a step at which one of several functions falls through zero.

Between samples of a step, cubics through values and slopes indicate where a function may have a
minimum below zero; the minimum is then computed, so that grazing and double crossings are found.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from lagcli.arrays import Array

#: Number of parts of a step, and interval of difference quotients relative to the step.
_PARTS, _SLOPE = 8, 1e-5
#: A minimum of the cubic below this part of the neighbouring values is examined.
_LOW = 0.5
#: Roots closer than this, relative to max(|t|, h), coincide.
_SAME = 1e-12
_HALVINGS = 60

Functions = Callable[[float], Array]


class Crossings(NamedTuple):
    """A time, s, and the functions that fall through zero there."""

    time: float
    numbers: tuple[int, ...]


def first_crossings(
    functions: Functions,
    low: float,
    high: float,
    noise: Array,
    counted: Callable[[Array], Array],
    seen: Callable[[float], bool],
) -> Crossings | None:
    """Return the first time between two at which functions fall through zero, or None.

    Parameters
    ----------
    functions : callable
        t → values; NaN is never a crossing.
    low, high : float
        s.
    noise : (n,) array
        A function that falls below zero by no more than this has not fallen.
    counted : callable
        Values at ``low`` → the same, with those that count as positive made positive.
    seen : callable
        Called at each sample without a crossing; returns whether it changes the functions.
    """
    step = high - low
    times = np.linspace(low, high, _PARTS + 1)

    def slope(at: float, values: Array, offset: float) -> Array:
        return np.asarray((functions(at + offset) - values) / offset)

    before = functions(low)
    rate = slope(low, before, _SLOPE * step)
    before = counted(before)
    for begin, end in zip(times[:-1].tolist(), times[1:].tolist(), strict=True):
        after = functions(end)
        later = slope(end, after, -_SLOPE * step)
        found: dict[int, float] = {}
        for k in np.flatnonzero((before >= -noise) & np.isfinite(after)).tolist():
            ends, rates = (before[k], after[k]), (rate[k], later[k])
            root = _root(functions, k, (begin, end), ends, rates, noise[k])
            if root is not None:
                found[k] = root
        if found:
            first = min(found.values())
            allowed = _SAME * max(abs(first), step)
            return Crossings(first, tuple(k for k, t in found.items() if t <= first + allowed))
        if seen(end):
            after = functions(end)
            later = slope(end, after, -_SLOPE * step)
        before, rate = after, later
    return None


def _root(
    functions: Functions,
    k: int,
    times: tuple[float, float],
    values: tuple[float, float],
    slopes: tuple[float, float],
    noise: float,
) -> float | None:
    """Return where a function falls through zero between two times, or None."""

    def value(t: float) -> float:
        return float(functions(t)[k])

    begin, end = times
    if values[1] >= -noise:
        lowest = _minimum(value, times, values, slopes)
        if lowest is None or value(lowest) >= -noise:
            return None
        end = lowest
    width = end - begin
    if value(begin) <= noise:  # it first rises, or falls immediately
        for _ in range(_HALVINGS):
            width /= 2
            if value(begin + width) > noise:
                break
        else:
            return begin
        begin += width
    return float(brentq(value, begin, end, xtol=1e-300, rtol=8.9e-16, maxiter=200))


def _minimum(
    value: Callable[[float], float],
    times: tuple[float, float],
    values: tuple[float, float],
    slopes: tuple[float, float],
) -> float | None:
    """Return a time between two at which a function is negative, if it has a minimum there."""
    if not slopes[0] < 0 < slopes[1]:
        return None
    h = times[1] - times[0]
    x = np.linspace(0, 1, 33)
    cubic = (
        values[0] * (1 + 2 * x) * (1 - x) ** 2
        + h * slopes[0] * x * (1 - x) ** 2
        + values[1] * x**2 * (3 - 2 * x)
        + h * slopes[1] * x**2 * (x - 1)
    )
    if cubic.min() > _LOW * min(values):
        return None
    found = minimize_scalar(value, bounds=times, method="bounded", options={"xatol": 1e-12 * h})
    return float(found.x) if found.fun < 0 else None
