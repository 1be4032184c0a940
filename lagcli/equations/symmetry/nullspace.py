"""Null space of a sparse matrix of rational numbers."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction

SparseVector = dict[int, Fraction]


def null_space(rows: Iterable[SparseVector], columns: int) -> list[SparseVector]:
    """Return a basis of the vectors x with A x = 0.

    Parameters
    ----------
    rows : iterable of sparse vectors
        The nonzero entries of each row by column; they are changed.
    columns : int

    Returns
    -------
    list of sparse vectors
        In the reduced form: each has an entry 1 in a column where the others have none. Of columns
        that depend on each other, the later ones are chosen for that.
    """
    pivots: dict[int, SparseVector] = {}
    for row in sorted(rows, key=len):
        while row:
            lead = min(row)
            if lead not in pivots:
                scale = row[lead]
                pivots[lead] = {column: x / scale for column, x in row.items()}
                break
            _subtract(row, row[lead], pivots[lead])
    solved = sorted(pivots, reverse=True)
    return [_solution(free, pivots, solved) for free in range(columns) if free not in pivots]


def _subtract(row: SparseVector, factor: Fraction, other: SparseVector) -> None:
    for column, x in other.items():
        left = row.get(column, Fraction(0)) - factor * x
        if left:
            row[column] = left
        else:
            row.pop(column, None)


def _solution(free: int, pivots: dict[int, SparseVector], solved: list[int]) -> SparseVector:
    """Return the solution with one free unknown 1 and the others 0, by back substitution."""
    found = {free: Fraction(1)}
    for lead in solved:
        if lead > free:
            continue
        value = -sum(
            (x * found[c] for c, x in pivots[lead].items() if c in found and c != lead),
            start=Fraction(0),
        )
        if value:
            found[lead] = value
    return found
