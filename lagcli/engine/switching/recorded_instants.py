"""One-sided limits of the motion at the instants of events that record columns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.contract import EventEntry, OneSidedLimits
from lagcli.engine.switching.switching import EventRule


class RecordedInstants:
    """Collects the limits of a run, instant by instant.

    Parameters
    ----------
    rules : sequence of EventRule

    Attributes
    ----------
    records : bool
        Whether there is such an event.
    limits : list of OneSidedLimits
        One-sided limits of the completed instants.
    open : bool
        Whether an instant is in progress.
    first : int
        Index of the first log entry of an event at this instant.
    """

    def __init__(self, rules: Sequence[EventRule]):
        self.rules = rules
        self.records = any(rule.record != () for rule in rules)
        self.limits: list[OneSidedLimits] = []
        self.open, self.first = False, 0
        self._entries: list[int] = []

    def begin(self, left: Array, p: tuple[float, ...]) -> None:
        """Begin an instant, with its limit from the left."""
        self.open, self._left, self._p, self._entries = True, left, p, []

    def add(self, count: int, entries: Sequence[EventEntry]) -> None:
        """Add entries to the first ``count`` ones of the log."""
        if not self._entries:
            self.first = count
        self._entries += [
            k
            for k, entry in enumerate(entries, count)
            if entry.occurrence == "event" and self.rules[entry.which].record != ()
        ]

    def end(self, right: Array | None, p: tuple[float, ...]) -> None:
        """End the instant, with its limit from the right; None if there is none."""
        if right is None:
            right = np.full_like(self._left, np.nan)
            right[0] = self._left[0]
        self.limits += [OneSidedLimits(k, self._left, right, self._p, p) for k in self._entries]
        self.open = False
