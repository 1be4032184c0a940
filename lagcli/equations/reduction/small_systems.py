"""Linear systems of expressions, in closed form."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction

import symengine as se
from symengine import Basic

from lagcli.equations.derivation.motion import ONE, ZERO
from lagcli.equations.simplification.monomials import content_of

Rows = Sequence[Sequence[Basic]]

#: Largest number of unknowns for Cramer's rule; the number of its terms grows factorially.
CRAMER = 3
#: Number of operations from which fractions are not reduced.
_LONG = 400


def determinant(matrix: Rows) -> Basic:
    """Return the determinant of a square matrix by expansion along its first column."""
    if not matrix:
        return ONE
    terms = []
    for i, row in enumerate(matrix):
        if row[0] != 0:
            minor = determinant([r[1:] for k, r in enumerate(matrix) if k != i])
            terms.append((-1) ** i * row[0] * minor)
    return se.Add(*terms) if terms else ZERO


def solutions(
    matrix: Rows, columns: Rows, value: Callable[[Basic], float]
) -> tuple[list[list[Basic]], Basic]:
    """Solve a square system for several right sides.

    Parameters
    ----------
    matrix : n rows
    columns : sequence of n expressions each
        Right sides.
    value : callable
        Function that evaluates an expression at a state, used to choose pivots.

    Returns
    -------
    numerators : list of n expressions each
        By right side.
    denominator : expression
        Common denominator: the determinant by Cramer's rule, 1 for a large system.
    """
    if len(matrix) > CRAMER:
        return _eliminated(matrix, columns, value), ONE
    size = range(len(matrix))
    adjugate = [[_cofactor(matrix, j, i) for j in size] for i in size]
    return [[_dot(row, column) for row in adjugate] for column in columns], determinant(matrix)


def cancelled(numerators: Sequence[Basic], denominator: Basic) -> tuple[list[Basic], Basic]:
    """Return fractions without the factors that all their terms share, if they are short."""
    if operations([*numerators, denominator]) > _LONG:
        return list(numerators), denominator
    opened = [se.expand(x) for x in (*numerators, denominator)]
    terms = [term for x in opened for term in (x.args if isinstance(x, se.Add) else (x,))]
    factor = shared_factor([term for term in terms if term != 0])
    if factor == 1:
        return list(numerators), denominator
    *above, below = (_divided(x, factor) for x in opened)
    return above, below


def operations(expressions: Sequence[Basic]) -> int:
    """Return the number of operations of several expressions."""
    return sum(map(se.count_ops, expressions))


def _divided(e: Basic, factor: Basic) -> Basic:
    return se.Add(*(x / factor for x in (e.args if isinstance(e, se.Add) else (e,))))


def shared_factor(terms: Sequence[Basic]) -> Basic:
    """Return the product of the number and the powers that all terms share.

    An exponent is the smallest of all terms, with zero for a term without the factor: dividing by
    the result leaves no denominators.
    """
    numbers = []
    powers: list[dict[Basic, Basic]] = []
    for term in terms:
        number, shared = Fraction(1), {}
        for x in term.args if isinstance(term, se.Mul) else (term,):
            base, exponent = x.args if isinstance(x, se.Pow) else (x, ONE)
            if isinstance(x, se.Integer | se.Rational):
                number = Fraction(str(x))
            elif isinstance(exponent, se.Integer | se.Rational):
                shared[base] = exponent
        numbers.append(abs(number))
        powers.append(shared)
    bases = dict.fromkeys(x for shared in powers for x in shared)
    lowest = {x: min(shared.get(x, ZERO) for shared in powers) for x in bases}
    content = content_of(numbers)
    return se.Mul(
        se.Rational(content.numerator, content.denominator),
        *(x**n for x, n in lowest.items() if n != 0),
    )


def _cofactor(matrix: Rows, i: int, j: int) -> Basic:
    minor = [[x for n, x in enumerate(row) if n != j] for m, row in enumerate(matrix) if m != i]
    return (-1) ** (i + j) * determinant(minor)


def _dot(row: Sequence[Basic], column: Sequence[Basic]) -> Basic:
    terms = [a * x for a, x in zip(row, column, strict=True) if a != 0 and x != 0]
    return se.Add(*terms) if terms else ZERO


def _eliminated(matrix: Rows, columns: Rows, value: Callable[[Basic], float]) -> list[list[Basic]]:
    """Solve by Gaussian elimination with the largest pivots at a state."""
    size = len(matrix)
    rows = [[*row, *(c[i] for c in columns)] for i, row in enumerate(matrix)]
    for k in range(size):
        best = max(range(k, size), key=lambda i: abs(value(rows[i][k])))
        rows[k], rows[best] = rows[best], rows[k]
        pivot = rows[k]
        rows[k] = pivot = [ZERO] * k + [x / pivot[k] for x in pivot[k:]]
        for i in range(size):
            factor = rows[i][k]
            if i != k and factor != 0:
                rows[i] = [x - factor * y for x, y in zip(rows[i], pivot, strict=True)]
    return [[rows[i][size + n] for i in range(size)] for n in range(len(columns))]
