"""A master of FMI 3.0 that handles events: it steps, enters event mode, and goes on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from fmi import Instance, Unpacked


class Instant(NamedTuple):
    """An event: its time, and the values before and after it."""

    time: float
    before: Any
    after: Any


class EventRun(NamedTuple):
    """The end of a simulation, whether an event has ended it, the last values, and its events."""

    time: float
    terminated: bool
    values: Any
    instants: list[Instant]


def with_events(
    fmu: Unpacked,
    names: Sequence[str],
    points: Sequence[float],
    between: Callable[[Instance], Instance] = lambda one: one,
    **options: Any,
) -> EventRun:
    """Simulate an FMU with events, by steps to each of some times.

    Parameters
    ----------
    fmu : Unpacked
    names : sequence of str
        What is read.
    points : sequence of float
        The start, communication points, the end.
    between : callable, optional
        Called whenever the instance has returned, also before it handles an event; the simulation
        goes on with what it returns.
    **options
        Of the instance.
    """
    one = fmu.instance(events=True, early=True, **options)
    one.begin(points[0])
    ended, following = one.happen()
    t, instants = points[0], list[Instant]()
    for point in points[1:]:
        early = t < point
        while early and not ended:
            step = one.step3(t, point - t)
            one = between(one)
            early = step.early
            assert early == (step.time < t + (point - t))
            assert t <= step.time <= t + (point - t)
            assert step.event or step.terminate or not step.early
            # the time of a tick is known before
            assert step.time <= following * (1 + 1e-14) + 1e-14
            t, ended = step.time, step.terminate
            if step.event:
                before = np.array(one.get(*names))
                ended, following = one.happen()
                one = between(one)
                assert following > t
                instants.append(Instant(t, before, np.array(one.get(*names))))
    values = np.array(one.get(*names))
    one.free()
    return EventRun(t, ended, values, instants)
