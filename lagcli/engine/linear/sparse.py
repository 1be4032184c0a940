"""Sparse matrices of implicit methods: their pattern, and a static order of pivots.

The order is Markowitz's: among the entries that are large enough for their row and column, the one
with the least potential fill. It is used for all steps until it becomes inaccurate.

H. M. Markowitz, Management Science 3 (1957) 255; I. S. Duff, A. M. Erisman and J. K. Reid, Direct
Methods for Sparse Matrices, ch. 7.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from lagcli.arrays import Array, Int32

if TYPE_CHECKING:
    from lagcli.engine.system import JacobianTapes, System

Rows = list[dict[int, float]]

#: Smallest pivot relative to the largest entry in its row and in its column, after balancing.
_THRESHOLD = 0.1
#: Number of rows and columns that are searched for a pivot, those with the fewest entries first.
_SEARCHED = 4
#: Density from which the remaining matrix is treated as dense.
_FULL = 0.5


@dataclass(frozen=True, eq=False)
class MatrixPattern:
    """The entries of a sparse matrix, by rows.

    Parameters
    ----------
    start : (n + 1,) array
        Start of each row.
    columns : (entries,) array
    parts : array
        Destination of each summand of the matrix.
    """

    start: Int32
    columns: Int32
    parts: Int32

    @property
    def rows(self) -> Int32:
        """The row of each entry."""
        return np.repeat(np.arange(len(self.start) - 1, dtype=np.int32), np.diff(self.start))


@dataclass(frozen=True, eq=False)
class PivotOrder:
    """An order of pivots and the pattern of the factors L and U in it.

    Parameters
    ----------
    row, column : (n,) arrays
        The positions of the pivots.
    start, columns : arrays
        The entries of the factors, by rows with increasing columns; both in the order of the
        pivots.
    diagonal : (n,) array
        The diagonal entries.
    places : array
        Destinations of the matrix' entries.
    """

    row: Int32
    column: Int32
    start: Int32
    columns: Int32
    diagonal: Int32
    places: Int32


def matrix_pattern(system: System, variation: JacobianTapes, rank: int) -> MatrixPattern:
    """Return the pattern of the matrix in core/methods/implicit.h, bordered if B lacks rank."""
    nq, nc = len(system.coordinates), len(system.constraints)
    jacobian = [(nq + i, j) for i, j in system.jacobian_pattern]
    border = [(nq + i, nq + nc + j) for j in range(nc - rank) for i in range(nc)]
    parts: list[tuple[int, int]] = [
        *system.mass_pattern,
        *variation.force_velocity,
        *variation.force_position,
        *((j, i) for i, j in jacobian),
        *jacobian,
        *((nq + i, j) for i, j in variation.rhs_velocity),
        *((nq + i, j) for i, j in variation.rhs_position),
        *border,
        *((j, i) for i, j in border),
    ]
    n = nq + nc + (nc - rank)
    places = np.array([i * n + j for i, j in parts], dtype=np.int64)
    entries, inverse = np.unique(places, return_inverse=True)
    start = np.searchsorted(entries, np.arange(n + 1) * n)
    return MatrixPattern(
        start.astype(np.int32), (entries % n).astype(np.int32), inverse.astype(np.int32).reshape(-1)
    )


def pivot_order(pattern: MatrixPattern, values: Array) -> PivotOrder | None:
    """Choose an order of pivots for a matrix.

    Parameters
    ----------
    pattern : MatrixPattern
    values : (entries,) array

    Returns
    -------
    PivotOrder or None
        None if the matrix is singular, or has entries that are not finite.
    """
    n = len(pattern.start) - 1
    if not np.isfinite(values).all():
        return None
    rows: Rows = [{} for _ in range(n)]
    balanced = _balance(pattern, values)
    for i, j, x in zip(
        pattern.rows.tolist(), pattern.columns.tolist(), balanced.tolist(), strict=True
    ):
        rows[i][j] = x
    elimination = _Elimination(rows)
    if not elimination.run():
        return None
    return elimination.order(pattern)


def _balance(pattern: MatrixPattern, values: Array) -> Array:
    """Return the entries with rows and columns scaled to order one (Ruiz's iteration)."""
    n = len(pattern.start) - 1
    scaled = np.abs(values)
    sign = np.sign(values)
    for _ in range(4):
        for index in (pattern.rows, pattern.columns):
            largest = np.zeros(n)
            np.maximum.at(largest, index, scaled)
            scaled = scaled / np.sqrt(np.where(largest > 0, largest, 1.0))[index]
    return sign * scaled


class _Elimination:
    """Gaussian elimination with Markowitz's choice of pivots and a numerical threshold."""

    def __init__(self, rows: Rows):
        self.n = len(rows)
        self.rows = rows
        self.columns: list[set[int]] = [set() for _ in rows]
        for i, row in enumerate(rows):
            for j in row:
                self.columns[j].add(i)
        self.pivots: list[tuple[int, int]] = []
        self.lower: list[list[int]] = [[] for _ in rows]  # by row: the eliminated columns
        self.upper: list[list[int]] = []  # by pivot: the columns of its row
        self.active_rows, self.active_columns = set(range(self.n)), set(range(self.n))
        # rows and columns by their number of entries
        self.row_counts: list[set[int]] = [set() for _ in range(self.n + 1)]
        self.column_counts: list[set[int]] = [set() for _ in range(self.n + 1)]
        for i, row in enumerate(rows):
            self.row_counts[len(row)].add(i)
        for j, column in enumerate(self.columns):
            self.column_counts[len(column)].add(j)
        self.entries = sum(map(len, rows))

    def run(self) -> bool:
        """Eliminate all rows; return whether the matrix is regular."""
        while self.active_rows:
            left = len(self.active_rows)
            if left > 1 and self.entries > _FULL * left * left:
                return self.finish()
            pivot = self.choose()
            if pivot is None:
                return self.finish()
            self.eliminate(*pivot)
        return True

    def choose(self) -> tuple[int, int] | None:
        """Return the pivot of least Markowitz cost among the shortest rows and columns."""
        best: tuple[int, int] | None = None
        least, size = self.n * self.n, 0.0
        searched = 0
        for count in range(1, self.n + 1):
            if best is not None and (searched >= _SEARCHED or least <= (count - 1) ** 2):
                break
            for line in chain(
                ([(i, j) for i in self.columns[j]] for j in self.column_counts[count]),
                ([(i, j) for j in self.rows[i]] for i in self.row_counts[count]),
            ):
                for i, j in line:
                    cost = (len(self.rows[i]) - 1) * (len(self.columns[j]) - 1)
                    x = abs(self.rows[i][j])
                    if (cost < least or (cost == least and x > size)) and self.suits(i, j, x):
                        best, least, size = (i, j), cost, x
                searched += 1
                if searched >= _SEARCHED and best is not None:
                    return best
        return best

    def suits(self, i: int, j: int, x: float) -> bool:
        """Return whether an entry is large enough for its row and column."""
        if x == 0.0:
            return False
        bound = x / _THRESHOLD
        return all(abs(y) <= bound for y in self.rows[i].values()) and all(
            abs(self.rows[k][j]) <= bound for k in self.columns[j]
        )

    def eliminate(self, i: int, j: int) -> None:
        rows, columns = self.rows, self.columns
        row = rows[i]
        pivot = row.pop(j)
        self.row_counts[len(row) + 1].discard(i)
        self.column_counts[len(columns[j])].discard(j)
        self.entries -= len(row) + len(columns[j])
        self.active_rows.discard(i)
        self.active_columns.discard(j)
        self.pivots.append((i, j))
        self.upper.append(list(row))
        for c in row:
            self.move(self.column_counts, c, len(columns[c]), len(columns[c]) - 1)
            columns[c].discard(i)
        for k in columns[j]:
            if k == i:
                continue
            other = rows[k]
            before = len(other)
            factor = other.pop(j) / pivot
            self.lower[k].append(j)
            for c, x in row.items():
                if c in other:
                    other[c] -= factor * x
                else:
                    other[c] = -factor * x
                    self.move(self.column_counts, c, len(columns[c]), len(columns[c]) + 1)
                    columns[c].add(k)
                    self.entries += 1
            self.move(self.row_counts, k, before, len(other))
        columns[j] = set()

    @staticmethod
    def move(counts: list[set[int]], item: int, before: int, after: int) -> None:
        if before != after:
            counts[before].discard(item)
            counts[after].add(item)

    def finish(self) -> bool:
        """Eliminate the remaining matrix as dense, with partial pivoting."""
        rest, places = sorted(self.active_rows), sorted(self.active_columns)
        at = {j: k for k, j in enumerate(places)}
        full = np.zeros((len(rest), len(places)))
        for k, i in enumerate(rest):
            for j, x in self.rows[i].items():
                full[k, at[j]] = x
        size = np.abs(full).max(initial=0.0)
        for k in range(len(rest)):
            best = k + int(np.argmax(np.abs(full[k:, k])))
            if not abs(full[best, k]) > 1e-14 * size:
                return False
            full[[k, best]] = full[[best, k]]
            rest[k], rest[best] = rest[best], rest[k]
            full[k + 1 :, k + 1 :] -= np.outer(full[k + 1 :, k] / full[k, k], full[k, k + 1 :])
        for k, i in enumerate(rest):
            self.pivots.append((i, places[k]))
            self.lower[i].extend(places[:k])
            self.upper.append(places[k + 1 :])
        self.active_rows.clear()
        return True

    def order(self, pattern: MatrixPattern) -> PivotOrder:
        row = np.array([i for i, _ in self.pivots], dtype=np.int32)
        column = np.array([j for _, j in self.pivots], dtype=np.int32)
        position = np.empty(self.n, dtype=np.int32)
        position[column] = np.arange(self.n)
        start, diagonal = [0], []
        columns: list[int] = []
        places: dict[tuple[int, int], int] = {}
        for k, (i, j) in enumerate(self.pivots):
            lower = sorted(position[self.lower[i]].tolist())
            upper = sorted(position[self.upper[k]].tolist())
            diagonal.append(start[-1] + len(lower))
            columns += [*lower, int(position[j]), *upper]
            start.append(len(columns))
            places.update(((i, columns[e]), e) for e in range(start[-2], start[-1]))
        where = position[pattern.columns].tolist()
        return PivotOrder(
            row,
            column,
            np.array(start, dtype=np.int32),
            np.array(columns, dtype=np.int32),
            np.array(diagonal, dtype=np.int32),
            np.array(
                [places[i, j] for i, j in zip(pattern.rows.tolist(), where, strict=True)],
                dtype=np.int32,
            ),
        )
