"""Conditions of a System's events: their signs, and when they trigger."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lagcli.arrays import Array, Numbers
from lagcli.engine.switching.switching import EventRule

#: Hysteresis: a condition must fall by this part of its largest value before it can trigger again.
_REARMED = 1e-10


class Conditions:
    """Tracks the conditions of events.

    Parameters
    ----------
    rules : sequence of EventRule

    Attributes
    ----------
    numbers : list of int
        The event rules with conditions.
    side : (n,) array of int
        Sign of each condition: −1 false, 1 true, 0 uncertain.
    counts : list of int
        Number of occurrences of each rule.
    largest : (n,) array
        The largest magnitude of each condition so far.
    """

    def __init__(self, rules: Sequence[EventRule]):
        self.rules = rules
        self.numbers = [k for k, rule in enumerate(rules) if rule.condition is not None]
        self._of = [rules[k].condition or 0 for k in self.numbers]
        self.side: Numbers = np.zeros(len(self.numbers), dtype=int)
        self.counts = [0] * len(rules)
        self.largest = np.zeros(len(self.numbers))

    def values(self, conditions: Array) -> Array:
        """Return the functions of the rules with conditions, from those of all conditions."""
        return conditions[self._of] if self._of else np.zeros(0)

    def start(self, values: Array) -> None:
        """Set the initial signs: conditions that are true now do not trigger."""
        self.follow(values)
        self.side = np.where(values >= 0, 1, -1)

    def follow(self, values: Array) -> bool:
        """Update the signs without triggering; return whether a sign changes."""
        before = self.side
        self.largest = np.fmax(self.largest, np.abs(values))
        clear = np.abs(values) > _REARMED * self.largest
        self.side = np.where(clear & ((self.side != -1) | self._either), np.sign(values), self.side)
        return bool((self.side != before).any())

    @property
    def _either(self) -> Array:
        return np.array([self.rules[k].either for k in self.numbers], dtype=bool)

    def watched(self, values: Array) -> Array:
        """Return functions that fall through zero when a rule triggers; NaN if it cannot."""
        exhausted = np.array([self.exhausted(k) for k in self.numbers], dtype=bool)
        ready = ((self.side == -1) | (self._either & (self.side != 0))) & ~exhausted
        return np.where(ready, self.side * values, np.nan)

    def exhausted(self, rule: int) -> bool:
        """Return whether a rule has occurred the maximum number of times."""
        times = self.rules[rule].times
        return times is not None and self.counts[rule] >= times

    def fired(self, rule: int) -> None:
        """Count an occurrence of a rule."""
        self.counts[rule] += 1
        if rule in self.numbers:
            k = self.numbers.index(rule)
            self.side[k] = -self.side[k] if self.rules[rule].either else 1

    def jumped(self, values: Array) -> list[int]:
        """Return the rules whose conditions have become true by a jump of the state."""
        functions = self.watched(values)
        self.follow(values)  # conditions that are no longer true can trigger again
        return [k for k, x in zip(self.numbers, functions, strict=True) if x < 0]
