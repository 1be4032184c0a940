"""Sparse arrays by rows, as logs of events store impulses and changes of modes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from lagcli.arrays import Array, Indices


class SparseTable(NamedTuple):
    """Sparse (rows, columns) array in coordinate format, by increasing row, then column.

    Parameters
    ----------
    shape : (int, int)
    row, column : (n,) arrays of int
        Places of the stored values, none of them twice.
    value : (n,) array
    """

    shape: tuple[int, int]
    row: Indices
    column: Indices
    value: Any

    @classmethod
    def of(cls, dense: Any) -> SparseTable:
        """Return the nonzero values of an array; NaN is one."""
        row, column = np.nonzero(dense)
        return cls(dense.shape, row, column, dense[row, column])

    def check(self, what: str) -> None:
        """Raise ValueError unless the places are inside of the array, in order, and distinct."""
        if not len(self.row) == len(self.column) == len(self.value):
            raise ValueError(f"{what}: places and values differ in number")
        for places, size in ((self.row, self.shape[0]), (self.column, self.shape[1])):
            if len(places) and not 0 <= places.min() <= places.max() < size:
                raise ValueError(f"{what}: a place is outside of the {size} that exist")
        step = np.diff(self.row)
        if (step < 0).any() or (np.diff(self.column)[step == 0] <= 0).any():
            raise ValueError(f"{what}: places are not in order, or one appears twice")

    def dense(self) -> Any:
        """Return the array, zero where nothing is stored."""
        dense = np.zeros(self.shape, dtype=self.value.dtype)
        dense[self.row, self.column] = self.value
        return dense

    def starts(self) -> list[int]:
        """Return the index of the first stored value of each row, and the end."""
        return np.searchsorted(self.row, np.arange(self.shape[0] + 1)).tolist()

    def taken(self, order: Indices) -> SparseTable:
        """Return the array of given rows, each at most once."""
        place = np.full(self.shape[0], -1, dtype=np.intp)
        place[order] = np.arange(len(order))
        row = place[self.row]
        kept = np.argsort(row, kind="stable")[np.count_nonzero(row < 0) :]
        shape = (len(order), self.shape[1])
        return SparseTable(shape, row[kept], self.column[kept], self.value[kept])

    def of_column(self, column: int) -> tuple[Indices, Any]:
        """Return the rows and the values that are stored in a column."""
        found = np.flatnonzero(self.column == column)
        return self.row[found], self.value[found]

    def at(self, row: Sequence[int] | Indices, column: Sequence[int] | Indices) -> Array:
        """Return the numbers at given places, 0 where nothing is stored."""
        asked = np.asarray(row, dtype=np.intp) * self.shape[1] + np.asarray(column, dtype=np.intp)
        stored = self.row * self.shape[1] + self.column
        if not len(stored):
            return np.zeros(len(asked))
        place = np.minimum(np.searchsorted(stored, asked), len(stored) - 1)
        return np.where(stored[place] == asked, self.value[place], 0.0)


def changes_of(start: Indices, modes: Indices) -> SparseTable:
    """Return the changes of modes: the new mode where it differs from that of the row before.

    Parameters
    ----------
    start : (ns,) array of int
        Modes before the first entry.
    modes : (ne, ns) array of int
        Modes after each entry.
    """
    before = np.vstack([start[None], modes[:-1]]) if len(modes) else modes
    row, column = np.nonzero(modes != before)
    return SparseTable(modes.shape, row, column, modes[row, column])


def merged_changes(
    start: Indices, entries: int, entry: Indices, row: Indices, mode: Indices
) -> SparseTable:
    """Return changes of modes, given in the order in which they happen, without repetitions.

    Of several changes of a row at an entry the last one counts, and only if the mode is another
    than before the entry.

    Parameters
    ----------
    start : (ns,) array of int
        Modes before the first entry.
    entries : int
    entry, row, mode : (n,) arrays of int
        New modes; ``entry`` does not decrease.
    """
    order = np.lexsort((np.arange(len(entry)), entry, row))
    entry, row, mode = entry[order], row[order], mode[order]
    last = np.ones(len(entry), dtype=bool)
    last[:-1] = (entry[1:] != entry[:-1]) | (row[1:] != row[:-1])
    entry, row, mode = entry[last], row[last], mode[last]
    before = start[row]
    same = row[1:] == row[:-1]
    before[1:][same] = mode[:-1][same]
    changed = np.flatnonzero(mode != before)
    changed = changed[np.lexsort((row[changed], entry[changed]))]
    return SparseTable((entries, len(start)), entry[changed], row[changed], mode[changed])


def modes_after(start: Indices, changes: SparseTable, counts: Indices) -> Indices:
    """Return the modes after given numbers of entries, by replaying the changes.

    Parameters
    ----------
    start : (ns,) array of int
        Modes before the first entry.
    changes : SparseTable
        (ne, ns): the new modes.
    counts : (n,) array of int
        Numbers of entries, from 0 to ne.

    Returns
    -------
    (n, ns) array of int
    """
    modes = np.empty((len(counts), len(start)), dtype=np.intp)
    now, done = start.copy(), 0
    order = np.argsort(counts, kind="stable")
    ends = np.searchsorted(changes.row, counts[order])
    for k, end in zip(order.tolist(), ends.tolist(), strict=True):
        if end > done:
            # by increasing entry: the last assignment to a row counts
            now[changes.column[done:end]] = changes.value[done:end]
            done = end
        modes[k] = now
    return modes
