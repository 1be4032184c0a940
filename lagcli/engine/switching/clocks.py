"""Clocks of events: instants that are counted, offset + k·period."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

from lagcli.engine.switching.switching import Switching
from lagcli.engine.tape.interpreter import ScalarTape

#: Smallest period, relative to |t|: four times the difference of times that coincide
#: (core/breaks.c).
_LEAST_PERIOD = 64 * sys.float_info.epsilon
#: Numerators and denominators of periods are below this, so that k ticks are counted exactly.
_LARGEST = 2**31


class Ticks(NamedTuple):
    """The ticks of a clock: (first + k step) / per, for k = 0, 1, 2, …

    For 10 ms, they are k/100, each rounded once: the numbers that tables and lists of samples have
    for these times.
    """

    first: float
    step: float
    per: float


def ticks_of(period: float, offset: float) -> Ticks:
    """Return the ticks of a clock, in whole numbers if period and offset are simple fractions.

    Parameters
    ----------
    period, offset : float
        s.
    """
    step, first = _simplest(period), _simplest(offset)
    per = math.lcm(step.denominator, first.denominator)
    whole = (first * per, step * per, Fraction(per))
    if max(map(abs, whole)) >= _LARGEST:
        return Ticks(offset, period, 1.0)
    return Ticks(*map(float, whole))


def _simplest(value: float) -> Fraction:
    """Return the fraction of the least denominator that rounds to a number."""
    if value <= 0:
        return -_simplest(-value) if value < 0 else Fraction(0)
    neighbours = (math.nextafter(value, x) for x in (0.0, math.inf))
    return _between(*((Fraction(value) + Fraction(x)) / 2 for x in neighbours))


def _between(low: Fraction, high: Fraction) -> Fraction:
    """Return the fraction of the least denominator between two, by continued fractions."""
    whole = math.ceil(low)
    if whole <= high:
        return Fraction(whole)
    return whole - 1 + 1 / _between(1 / (high - whole + 1), 1 / (low - whole + 1))


class Clock(NamedTuple):
    """A clock in a run.

    Parameters
    ----------
    name : str
        Name of the event.
    period, offset : float
        s.
    most : int
        Largest number of ticks; 0 without a limit.
    """

    name: str
    period: float
    offset: float
    most: int

    def fault(self, span: tuple[float, float]) -> str:
        """Return what is wrong with its times in a run between two times; empty if nothing is."""
        largest = max(*map(abs, span), abs(self.offset))
        if not math.isfinite(self.offset):
            return f"the offset of event `{self.name}` is {self.offset:.6g}, but must be finite"
        if not 0 < self.period < math.inf:
            return f"the period of event `{self.name}` is {self.period:.6g} s, but must be positive"
        if self.period < _LEAST_PERIOD * largest:
            return (
                f"the period of event `{self.name}`, {self.period:.6g} s, is below the rounding"
                f" errors of times near {largest:.6g} s"
            )
        return ""


def clocks_of(switching: Switching, p: Sequence[float]) -> list[Clock]:
    """Return the clocks of the events, for values of the parameters."""
    if switching.clocks is None:
        return []
    values = ScalarTape(switching.clocks)(p[: switching.clocks.parameters])
    return [
        Clock(rule.name, values[2 * rule.clock], values[2 * rule.clock + 1], rule.times or 0)
        for rule in switching.events
        if rule.clock is not None
    ]
