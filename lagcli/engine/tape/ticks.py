"""Equally spaced times, counted in whole numbers, so that each is rounded once."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

from lagcli.arrays import Array

#: Numerators and denominators of periods are below this, so that k ticks are counted exactly.
_LARGEST = 2**31


class Ticks(NamedTuple):
    """Equally spaced times: (first + k step) / per, for k = 0, 1, 2, …

    For 10 ms, they are k/100, each rounded once: the numbers that tables and lists of samples have
    for these times.
    """

    first: float
    step: float
    per: float

    def times(self, k: Array) -> Array:
        """Return the times of numbers below 2²²."""
        return (self.first + k * self.step) / self.per


def ticks_of(period: float, offset: float) -> Ticks:
    """Return equally spaced times, in whole numbers if period and offset are simple fractions.

    Parameters
    ----------
    period, offset : float
        s.
    """
    return counted(simplest(offset), simplest(period)) or Ticks(offset, period, 1.0)


def counted(first: Fraction, step: Fraction) -> Ticks | None:
    """Return equally spaced times in whole numbers, or None if these are too large."""
    per = math.lcm(step.denominator, first.denominator)
    whole = (first * per, step * per, Fraction(per))
    return None if max(map(abs, whole)) >= _LARGEST else Ticks(*map(float, whole))


def simplest(value: float) -> Fraction:
    """Return the fraction of the least denominator that rounds to a number."""
    if value <= 0:
        return -simplest(-value) if value < 0 else Fraction(0)
    neighbours = (math.nextafter(value, x) for x in (0.0, math.inf))
    return _between(*((Fraction(value) + Fraction(x)) / 2 for x in neighbours))


def _between(low: Fraction, high: Fraction) -> Fraction:
    """Return the fraction of the least denominator between two, by continued fractions."""
    whole = math.ceil(low)
    if whole <= high:
        return Fraction(whole)
    return whole - 1 + 1 / _between(1 / (high - whole + 1), 1 / (low - whole + 1))
