"""Results of rows of a sweep, as computed, journaled and written, and the status of all rows."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lagcli.arrays import Array, Numbers

#: Statuses of rows, by number; MISSING does not occur in results.
STATUSES = ("completed", "failed", "error", "missing")
COMPLETED, FAILED, ERROR, MISSING = range(4)
#: The beginning of a completed row's message that is a warning.
WARNING = "warning: "


class Results(NamedTuple):
    """The results of n rows, as arrays.

    Parameters
    ----------
    numbers : (n,) array of int
        Numbers of the rows.
    status : (n,) array of int8
        Indices into ``STATUSES``: completed; failed, if the integration failed or, in a strict
        sweep, has warnings; error, if the values are invalid for the model.
    messages : list of n str
        Messages; empty for most completed rows. Those with values that are not finite have a
        message that begins with ``WARNING``.
    counts : (n, 3) array of int
        Steps, rejected steps and evaluations.
    measures : (n, m) array
        Measures; NaN in rows that are not completed.
    kept : (n, nt, columns) array
        Stored samples, NaN after the end of a run; (n, 0, 0) if they are not stored.
    """

    numbers: Numbers
    status: NDArray[np.int8]
    messages: list[str]
    counts: Numbers
    measures: Array
    kept: Array


_MOST_CAUSES = 1000  # largest number of causes that are counted separately
_LONGEST = 200  # largest number of characters of a cause
_NUMBER = re.compile(r"[-+−]?(?<![\w.])\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")


def cause(message: str) -> str:
    """Return a message without the numbers of its row, for counting equal causes."""
    text = message.strip().partition("\n")[0]
    text = text[text.find("error[") :] if "error[" in text else text
    text = _NUMBER.sub("…", text.partition(";")[0])
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"


class MeasureRange(NamedTuple):
    """Smallest and largest value of a measure, and the first rows that have them.

    Parameters
    ----------
    low : float
    low_row : int
    high : float
    high_row : int
    """

    low: float
    low_row: int
    high: float
    high_row: int


class RowStatus:
    """The status of each row of a sweep, the causes of failures, and the ranges of measures.

    Parameters
    ----------
    length, measures : int
        The numbers of rows and of measures.

    Attributes
    ----------
    status : (length,) array of int8
        As in `lagcli.sweeps.row_results.Results`.
    """

    def __init__(self, length: int, measures: int = 0):
        self._ranges: list[MeasureRange | None] = [None] * measures
        self.status = np.full(length, MISSING, dtype=np.int8)
        self._cause = np.zeros(length, dtype=np.int16)
        self._causes = {"": 0}

    def enter(self, results: Results) -> None:
        """Record results; later ones of a row replace earlier ones."""
        self.status[results.numbers] = results.status
        self._cause[results.numbers] = 0
        columns = zip(self._ranges, results.measures.T, strict=bool(self._ranges))
        self._ranges = [_widened(so_far, column, results.numbers) for so_far, column in columns]
        warned = np.array([text.startswith(WARNING) for text in results.messages], dtype=bool)
        for i in np.flatnonzero((results.status != COMPLETED) | warned):
            text = cause(results.messages[i])
            if text not in self._causes and len(self._causes) > _MOST_CAUSES:
                text = "other causes"
            place = self._causes.setdefault(text, len(self._causes))
            self._cause[results.numbers[i]] = place

    def forget_failures(self) -> None:
        """Mark failed rows as missing."""
        self.status[self.status != COMPLETED] = MISSING
        self._cause[self.status == MISSING] = 0

    @property
    def done(self) -> int:
        """The number of rows that have results."""
        return int(np.count_nonzero(self.status != MISSING))

    def count(self, status: int) -> int:
        """Return the number of rows of a status."""
        return int(np.count_nonzero(self.status == status))

    def ranges(self) -> list[MeasureRange | None]:
        """Return the range of each measure over the completed rows; None without a value."""
        return list(self._ranges)

    def failures(self) -> dict[str, int]:
        """Return the numbers of rows that failed, by cause, the most frequent first."""
        return self._counted(self._cause[self.status != COMPLETED])

    def warnings(self) -> dict[str, int]:
        """Return the numbers of completed rows with warnings, by warning."""
        counted = self._counted(self._cause[self.status == COMPLETED])
        return {text.removeprefix(WARNING): n for text, n in counted.items()}

    def _counted(self, causes: NDArray[np.int16]) -> dict[str, int]:
        counts = np.bincount(causes, minlength=len(self._causes))
        counted = {text: int(counts[i]) for text, i in self._causes.items() if i and counts[i]}
        return dict(sorted(counted.items(), key=lambda x: -x[1]))

    def statuses(self) -> dict[str, int]:
        """Return the numbers of rows by status."""
        return {name: self.count(i) for i, name in enumerate(STATUSES) if self.count(i)}


def _widened(so_far: MeasureRange | None, values: Array, rows: Numbers) -> MeasureRange | None:
    """Return a range that includes more values; NaN is none."""
    (known,) = np.nonzero(~np.isnan(values))
    if not len(known):
        return so_far
    low, high = known[values[known].argmin()], known[values[known].argmax()]
    new = MeasureRange(float(values[low]), int(rows[low]), float(values[high]), int(rows[high]))
    if so_far is None:
        return new
    return MeasureRange(*min(so_far[:2], new[:2]), *_larger(so_far[2:], new[2:]))


def _larger(one: tuple[float, int], other: tuple[float, int]) -> tuple[float, int]:
    """Return the larger of two values with their rows; of equal ones, that of the first row."""
    return min(one, other, key=lambda x: (-x[0], x[1]))


class MissingRows:
    """The missing rows in order, taken in blocks.

    Parameters
    ----------
    row_status : RowStatus
        Status, read once at construction: each row is returned once.
    """

    def __init__(self, row_status: RowStatus):
        self._wanted = row_status.status == MISSING
        self._next = 0
        self.left = int(np.count_nonzero(self._wanted))

    def take(self, count: int) -> Numbers:
        """Return the next rows, up to a number; none at the end."""
        blocks: list[Numbers] = []
        size = 0
        while size < count and self._next < len(self._wanted):
            block = np.flatnonzero(self._wanted[self._next : self._next + 65536])[: count - size]
            if len(block):
                block = block + self._next
                blocks.append(block)
                size += len(block)
            full = size >= count
            self._next = int(block[-1]) + 1 if full else self._next + 65536
        self.left -= size
        return np.concatenate(blocks) if blocks else np.empty(0, dtype=np.int64)


def runs_of(numbers: Numbers) -> Iterator[tuple[slice, slice]]:
    """Yield runs of consecutive numbers, with their positions."""
    starts = np.flatnonzero(np.diff(numbers, prepend=numbers[:1] - 2) != 1)
    for start, end in zip(starts, [*starts[1:], len(numbers)], strict=True):
        first = int(numbers[start])
        yield slice(int(start), int(end)), slice(first, first + int(end - start))
