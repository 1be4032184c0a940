"""Null space of a sparse matrix of rational numbers."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from math import gcd, lcm

from lagcli.equations.symmetry.monomials import Exact

SparseVector = dict[int, Exact]
_Integers = dict[int, int]


def null_space(rows: Iterable[SparseVector], columns: int) -> list[SparseVector]:
    """Return a basis of the vectors x with A x = 0.

    Fraction-free Gaussian elimination: rows are integers without a common divisor.

    Parameters
    ----------
    rows : iterable of sparse vectors
        The nonzero entries of each row by column.
    columns : int

    Returns
    -------
    list of sparse vectors
        In reduced form: each has an entry 1 in a column where the others have 0. Of linearly
        dependent columns, the later ones are used for that.
    """
    left, vanishing = _without_single_entries(rows)
    pivots: dict[int, _Integers] = {column: {column: 1} for column in vanishing}
    distinct = {tuple(sorted(_integers(row).items())) for row in left}
    for entries in sorted(distinct, key=lambda entries: (len(entries), entries)):
        _add(dict(entries), pivots)
    solved = sorted(pivots, reverse=True)
    return [_solution(free, pivots, solved) for free in range(columns) if free not in pivots]


def _without_single_entries(rows: Iterable[SparseVector]) -> tuple[list[SparseVector], set[int]]:
    """Return rows without the unknowns that must vanish, which are the majority, and these
    unknowns."""
    left, vanishing = [row for row in rows if row], set[int]()
    while found := {column for row in left if len(row) == 1 for column in row}:
        vanishing |= found
        left = [
            row if found.isdisjoint(row) else {c: x for c, x in row.items() if c not in found}
            for row in left
        ]
        left = [row for row in left if row]
    return left, vanishing


def independent(vectors: Iterable[SparseVector]) -> list[int]:
    """Return the indices of the vectors that are linearly independent of the previous ones."""
    pivots: dict[int, _Integers] = {}
    return [place for place, vector in enumerate(vectors) if _add(_integers(vector), pivots)]


def echelon(vectors: Iterable[SparseVector]) -> list[SparseVector]:
    """Return a basis of the span of some vectors, by their first entries, which are 1."""
    pivots: dict[int, _Integers] = {}
    for vector in vectors:
        _add(_integers(vector), pivots)
    return [{c: Fraction(x, pivots[i][i]) for c, x in pivots[i].items()} for i in sorted(pivots)]


def remainder(vector: SparseVector, basis: Iterable[SparseVector]) -> SparseVector:
    """Return a vector reduced by those of `echelon`."""
    found = dict(vector)
    for row in basis:
        factor = found.get(min(row))
        if factor:
            for c, x in row.items():
                found[c] = found.get(c, 0) - factor * x
    return {c: x for c, x in found.items() if x}


def _add(row: _Integers, pivots: dict[int, _Integers]) -> bool:
    """Add a row to a basis if it is linearly independent."""
    while row:
        lead = min(row)
        if lead not in pivots:
            pivots[lead] = row
            return True
        row = _without(row, lead, pivots[lead])
    return False


def _integers(row: SparseVector) -> _Integers:
    """Return a multiple of a row with coprime integers, the first one positive."""
    common = lcm(*(x.denominator for x in row.values()))
    return _primitive({c: x.numerator * (common // x.denominator) for c, x in row.items()})


def _primitive(row: _Integers) -> _Integers:
    divisor = gcd(*row.values())
    if row and row[min(row)] < 0:
        divisor = -divisor
    return {c: x // divisor for c, x in row.items()} if divisor not in (0, 1) else row


def _without(row: _Integers, lead: int, pivot: _Integers) -> _Integers:
    """Return a combination of a row and a pivot row that eliminates the pivot column."""
    divisor = gcd(row[lead], pivot[lead])
    own, other = pivot[lead] // divisor, row[lead] // divisor
    found = {c: own * x for c, x in row.items()}
    for c, x in pivot.items():
        found[c] = found.get(c, 0) - other * x
    return _primitive({c: x for c, x in found.items() if x})


def _solution(free: int, pivots: dict[int, _Integers], solved: list[int]) -> SparseVector:
    """Return the solution with one free unknown equal to 1 and the others 0, by back
    substitution."""
    found: SparseVector = {free: 1}
    for lead in solved:
        row = pivots[lead]
        if lead > free or found.keys().isdisjoint(row):
            continue
        value = sum(x * found[c] for c, x in row.items() if c in found)
        if value:
            found[lead] = Fraction(-value) / row[lead]
    return found
