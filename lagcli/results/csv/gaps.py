"""Gaps in the times of a CSV file: lines that are missing between equally spaced samples."""

from __future__ import annotations

import numpy as np

from lagcli.arrays import Array
from lagcli.prose import counted

#: Part of the spacing by which equally spaced times differ from it, besides their rounding.
_ROUNDING = 1e-6
#: Gaps are reported if at least this number of spacings for each of them is not one.
_REGULAR_PER_GAP = 10


class Gaps:
    """Finds gaps of whole numbers of spacings while blocks of times are added.

    Other times, such as those of ``--times``, have no gaps. The last sample may be nearer.
    """

    def __init__(self) -> None:
        self._spacing: float | None = None
        self._last: float | None = None  # the last time so far
        self._held: tuple[float, float] | None = None  # the last interval, which may be the end
        self._regular = 0
        self._gaps: list[tuple[float, float]] = []
        self._spaced = True

    def add(self, time: Array) -> None:
        """Take the next times, s, which increase."""
        if not len(time) or not self._spaced:
            return
        times = time if self._last is None else np.concatenate([[self._last], time])
        starts, ends = times[:-1], times[1:]
        if self._held is not None:
            starts, ends = np.append(self._held[0], starts), np.append(self._held[1], ends)
        self._last = float(time[-1])
        if not len(starts):
            return
        self._held = float(starts[-1]), float(ends[-1])
        self._count(starts[:-1], ends[:-1])

    def _count(self, starts: Array, ends: Array) -> None:
        """Take intervals before the last one."""
        if not len(starts):
            return
        steps = ends - starts
        if self._spacing is None:
            self._spacing = float(steps.min())
        ratio = steps / self._spacing
        whole = np.rint(ratio)
        rounding = _ROUNDING + 4 * np.spacing(np.maximum(abs(starts), abs(ends))) / self._spacing
        if ((abs(ratio - whole) > rounding) | (whole < 1)).any():
            self._spaced = False
            return
        gap = whole > 1
        self._gaps += zip(starts[gap].tolist(), ends[gap].tolist(), strict=True)
        self._regular += int(np.count_nonzero(~gap))

    def warning(self) -> str | None:
        """Return the warning of the gaps so far; None without gaps."""
        gaps = self._gaps
        if not self._spaced or not gaps or self._regular < _REGULAR_PER_GAP * len(gaps):
            return None
        start, end = gaps[0]
        more = f", and {counted(len(gaps) - 1, 'other gap')}" if len(gaps) > 1 else ""
        return (
            f"samples may be missing between t = {start:g} and {end:g} s{more}: others are"
            f" {self._spacing:g} s apart"
        )
