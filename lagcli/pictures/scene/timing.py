"""Timing of an animation: part of the motion, speed, frames."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lagcli.arrays import Array
from lagcli.errors import UsageError

#: Durations of motions that are shown in real time by default, s; others are slowed down or sped
#: up.
_SHORT, _LONG = 1.0, 60.0
#: Minimum duration of a slowed-down motion, s.
_SLOWED = 4.0
#: Length of a trail, relative to the motion, and its maximum in seconds of the animation.
TRAIL_PART, _TRAIL_SECONDS = 0.3, 3.0
#: Largest number of frames of a film: an hour and a half at 25 frames per second.
_MOST_FRAMES = 135_000


class Timing(NamedTuple):
    """The timing of an animation.

    Parameters
    ----------
    start, end : float
        Start and end time of the motion, s.
    speed : float
        Seconds of the motion per second.
    """

    start: float
    end: float
    speed: float

    @property
    def seconds(self) -> float:
        """Duration of the animation, s."""
        return (self.end - self.start) / self.speed

    @property
    def pace(self) -> str:
        """The speed in words; empty for real time."""
        if self.speed == 1:
            return ""
        factor = self.speed if self.speed > 1 else 1 / self.speed
        shown = f"{factor:.4g}"
        return f"sped up × {shown}" if self.speed > 1 else f"slowed down × {shown}"

    @property
    def trail(self) -> float:
        """Duration of the trail of a point, s."""
        return min(TRAIL_PART * (self.end - self.start), _TRAIL_SECONDS * self.speed)

    def frames(self, fps: float) -> Array:
        """Return the times of the frames, s: evenly spaced, including both ends.

        Raises
        ------
        UsageError
            There would be too many frames.
        """
        steps = self.seconds * fps
        if steps > _MOST_FRAMES:
            raise UsageError(
                f"at this speed the animation has {steps:.3g} frames and lasts"
                f" {self.seconds:.3g} s; give a higher --speed, a --duration in seconds, or a part"
                " of the motion by --from and --to"
            )
        count = math.floor(steps * (1 + 1e-9)) + 1
        times = self.start + np.arange(count, dtype=np.float64) * (self.speed / fps)
        if self.end - times[-1] > 0.01 * self.speed / fps:
            times = np.append(times, self.end)
        return times


def timing(
    first: float,
    last: float,
    *,
    start: float | None = None,
    end: float | None = None,
    speed: float | None = None,
    duration: float | None = None,
) -> Timing:
    """Return the timing for given options.

    Parameters
    ----------
    first, last : float
        Times of the first and the last sample, s.
    start, end : float, optional
        The part to show, s.
    speed : float, optional
        Seconds of the motion per second.
    duration : float, optional
        Duration of the animation, s, instead of the speed. By default real time, except for motions
        shorter than a second, which are slowed down, and longer than a minute, which are sped up.

    Raises
    ------
    UsageError
        A value is invalid, or the part is empty.
    """
    for name, value in (("--from", start), ("--to", end)):
        if value is not None and not math.isfinite(value):
            raise UsageError(f"{name} must be a time in seconds, not {value:g}")
    for name, value in (("--speed", speed), ("--duration", duration)):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise UsageError(f"{name} must be greater than 0, not {value:g}")
    if speed is not None and duration is not None:
        raise UsageError("--speed and --duration contradict each other; give one of them")
    begin = first if start is None else max(start, first)
    finish = last if end is None else min(end, last)
    if begin > finish or (begin == finish and first < last):
        wanted = f"{first if start is None else start:g} to {last if end is None else end:g} s"
        raise UsageError(
            f"there is no motion from {wanted}; the run goes from {first:g} to {last:g} s"
        )
    if duration is not None and finish > begin:
        return Timing(begin, finish, (finish - begin) / duration)
    return Timing(begin, finish, usual_speed(finish - begin) if speed is None else speed)


def usual_speed(span: float) -> float:
    """Return the speed at which a motion of so many seconds is shown unless one is requested."""
    if span > _LONG:
        return round_number(span / _LONG, up=True)
    if 0 < span < _SHORT:
        return round_number(span / _SLOWED)
    return 1.0


def round_number(value: float, *, up: bool = False) -> float:
    """Return 1, 2 or 5 times a power of ten: the largest one not greater, or the next one."""
    power = math.floor(math.log10(value))
    steps = [float(f"{n}e{p}") for p in (power, power + 1) for n in (1, 2, 5)]
    if up:
        return min(step for step in steps if step >= value * (1 - 1e-9))
    return max(step for step in steps if step <= value * (1 + 1e-9))
