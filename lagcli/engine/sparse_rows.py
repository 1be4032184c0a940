"""Jacobians of large systems, by their nonzero entries."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from lagcli.arrays import Array, Flags, Indices
from lagcli.engine.system import Pattern

#: Number of rows up to which singular values are those of an array.
_FEW = 20
_ROUNDING = 1e-14


def rows_and_columns(pattern: Pattern) -> tuple[Indices, Indices]:
    """Return the rows and columns of entries."""
    row, column = np.array(pattern, dtype=np.intp).reshape(-1, 2).T
    return row, column


def in_turns(rows: Indices) -> list[Indices]:
    """Return the entries of all rows in turns: the first of each row, the second, and so on.

    Sums by turns are those by entries, to the last bit.

    Parameters
    ----------
    rows : (n,) array of int
        The row of each entry.
    """
    order = np.argsort(rows, kind="stable")
    begins = np.flatnonzero(np.diff(rows[order], prepend=-1))
    counts = np.diff(begins, append=len(rows))
    turn = np.arange(len(rows)) - np.repeat(begins, counts)
    ends = np.cumsum(np.bincount(turn))[:-1]
    return np.split(order[np.argsort(turn, kind="stable")], ends)


class SparseRows:
    """A matrix by its nonzero entries, for what is computed row by row.

    NumPy's functions and other indices than those of rows take it as the whole array.

    Parameters
    ----------
    shape : (int, int)
    row, column : (n,) arrays of int
        Places of the entries; no place occurs twice.
    values : (n,) array
    """

    def __init__(self, shape: tuple[int, int], row: Indices, column: Indices, values: Array):
        self.shape, self.row, self.column, self.values = shape, row, column, values

    def with_values(self, values: Array) -> SparseRows:
        """Return a matrix with other entries at the same places."""
        return SparseRows(self.shape, self.row, self.column, values)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        """Return the matrix with its zeros."""
        whole = np.zeros(self.shape)
        whole[self.row, self.column] = self.values
        return whole if dtype is None else whole.astype(dtype)

    def __getitem__(self, key: Any) -> Any:
        """Return some rows, a list of different ones; for other keys, what the array has there."""
        if not isinstance(key, list):
            return np.asarray(self)[key]
        number = np.full(self.shape[0], -1)
        number[key] = np.arange(len(key))
        kept = number[self.row] >= 0
        return SparseRows(
            (len(key), self.shape[1]), number[self.row[kept]], self.column[kept], self.values[kept]
        )

    def __mul__(self, other: Any) -> SparseRows:
        """Multiply by an entry of an (nq,) array in each column, or by the entries of a matrix with
        the same places."""
        if isinstance(other, SparseRows):
            return self.with_values(self.values * other.values)
        by_column = np.broadcast_to(other, self.shape[1:])
        return self.with_values(self.values * by_column[self.column])

    def __matmul__(self, x: Array) -> Array:
        """Multiply by an (nq,) array."""
        return self._sums(self.values * x[self.column])

    def sum(self, axis: int) -> Array:
        """Return the sums of the rows, (n,), for axis 1."""
        assert axis == 1
        return self._sums(self.values)

    def largest_by_column(self, where: Flags, length: Array) -> Array:
        """Return the largest entry of each column over the row's length, 0 for none."""
        kept, most = where[self.row], np.zeros(self.shape[1])
        np.maximum.at(most, self.column[kept], self.values[kept] / length[self.row[kept]])
        return most

    def least_singular_value(self) -> float:
        """Return the smallest singular value if no row depends on the others, else about 0.

        It is found as the root of the smallest eigenvalue of B Bᵀ: below about 1e-7 of the largest
        one, it is nothing but rounding errors.
        """
        if self.shape[0] < _FEW:
            return float(np.linalg.svd(np.asarray(self), compute_uv=False)[-1])
        from scipy.sparse import csr_array
        from scipy.sparse.linalg import eigsh

        rows = csr_array((self.values, (self.row, self.column)), self.shape)
        square = (rows @ rows.T).tocsc()
        start = np.cos(1.0 + np.arange(self.shape[0]))  # the same at every call
        below = -_ROUNDING * float(square.diagonal().max())  # definite even if rows are dependent
        least = eigsh(square, 1, sigma=below, v0=start, return_eigenvectors=False)
        return math.sqrt(max(0.0, float(least[0])))

    def _sums(self, terms: Array) -> Array:
        return np.bincount(self.row, terms, self.shape[0]).astype(float)


def entries_of(matrix: Array | SparseRows) -> Array:
    """Return the entries of a matrix, in any order; zeros may be left out."""
    return matrix.values if isinstance(matrix, SparseRows) else matrix


def magnitudes(matrix: Array | SparseRows) -> Array | SparseRows:
    """Return the magnitudes of a matrix' entries."""
    if isinstance(matrix, SparseRows):
        return matrix.with_values(np.abs(matrix.values))
    return np.abs(matrix)
