"""Event location along a step: the reference engine's counterpart of ``core/events.c``."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from lagcli.arrays import Array
from lagcli.engine.system import System
from lagcli.engine.tape.interpreter import ScalarTape

Path = Callable[[float], Array]  # t → (q, v, W) inside the last step

_PARTS = 8  # number of parts of a step at whose ends signs are compared
_EXACT = 1e-14  # accuracy of a root, relative to the time or the step
_ITERATIONS = 200


class EventCrossing(NamedTuple):
    """A sign change: index of the function, 1 if it rises and −1 if it falls, and time, s."""

    number: int
    direction: int
    time: float


class EventSearch:
    """Finds the sign changes of a System's event functions in order.

    Parameters
    ----------
    system : System
        Without ``events``, there are none.
    p : tuple of float
        Values of its parameters.
    """

    def __init__(self, system: System, p: tuple[float, ...]):
        self._tape = None if system.events is None else ScalarTape(system.events)
        self._parameters = p
        self._signs: list[int] = []  # at `_since`; 0 if unknown
        self._since = math.nan
        self._last: EventCrossing | None = None

    def start(self, t: float, y: Array) -> None:
        """Start at a state: an event that has just occurred does not occur again."""
        if self._tape is None:
            return
        self._signs = [_sign(x) for x in self._values(t, y)]
        self._since = t
        if self._last is not None and self._last.time == t:
            self._signs[self._last.number] = 0

    def first(self, path: Path, t_old: float, t: float, end: float) -> EventCrossing | None:
        """Return the first sign change of the step from t_old to t that has not been returned yet.

        Parameters
        ----------
        path : callable
        t_old, t : float
            The ends of the step, s.
        end : float
            End of the valid part of the step, s.
        """
        if self._tape is None:
            return None
        low = self._since
        for part in range(1, _PARTS + 1):
            high = end if part == _PARTS else min(end, t_old + (t - t_old) * part / _PARTS)
            if high <= low:
                continue
            after = [_sign(x) for x in self._values(high, path(high))]
            found = [
                EventCrossing(k, now, self._locate(path, k, low, high, t - t_old))
                for k, (before, now) in enumerate(zip(self._signs, after, strict=True))
                if before * now < 0
            ]
            if found:
                self._last = first = min(found, key=lambda crossing: crossing.time)
                self._since = first.time
                self._signs[first.number] = first.direction
                return first
            self._signs = [now or before for before, now in zip(self._signs, after, strict=True)]
            low = self._since = high
        return None

    def _values(self, t: float, y: Array) -> list[float]:
        assert self._tape is not None
        return self._tape((t, *y[:-1].tolist(), *self._parameters))

    def _locate(self, path: Path, number: int, low: float, high: float, step: float) -> float:
        """Return the first time at which a function has its new sign.

        Regula falsi (Illinois), and bisection where that does not halve the interval.
        """

        def value(t: float) -> float:
            return self._values(t, path(t))[number]

        a, b = value(low), value(high)
        after = _sign(b)
        exact = _EXACT * max(abs(high), step)
        for i in range(_ITERATIONS):
            width = high - low
            if width <= exact:
                break
            t = low + 0.5 * width if i % 3 == 2 else high - b * width / (b - a)
            # a step beyond the root, so that the interval shrinks from both sides
            t = min(max(t, low + 0.5 * exact), high - 0.5 * exact)
            g = value(t)
            if _sign(g) == after:
                high, b, a = t, g, 0.5 * a
            else:
                low, a, b = t, g, 0.5 * b
        return high


def _sign(x: float) -> int:
    return (x > 0.0) - (x < 0.0)
