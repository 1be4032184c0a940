"""Rotations near to matrices of numbers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

Matrix = Sequence[Sequence[float]]

#: Largest deviation of RᵀR from 1 of a matrix whose entries are rounded.
_ROUNDED = 0.05
_STEPS = 20


def quaternion_text(matrix: Matrix) -> str | None:
    """Return the rotation nearest to a matrix as ``quat(…)``; None if it is not near to one."""
    nearest = nearest_rotation(matrix)
    if nearest is None:
        return None
    return f"quat({', '.join(f'{x:.16g}' for x in _quaternion(nearest))})"


def nearest_rotation(matrix: Matrix) -> Matrix | None:
    """Return the rotation nearest to a 3×3 matrix; None if no rounding makes the one the other.

    By Newton's iteration for the polar decomposition, R ← (R + R⁻ᵀ)/2 (Higham 1986,
    doi:10.1137/0907079).
    """
    columns = [*zip(*matrix, strict=True)]
    deviations = (
        abs(_dot(a, b) - (i == j)) for i, a in enumerate(columns) for j, b in enumerate(columns)
    )
    if not max(deviations) <= _ROUNDED or _determinant(matrix) <= 0:
        return None
    for _ in range(_STEPS):
        cofactors, size = _cofactors(matrix), _determinant(matrix)
        pairs = (zip(x, y, strict=True) for x, y in zip(matrix, cofactors, strict=True))
        after = [[(a + b / size) / 2 for a, b in row] for row in pairs]
        if after == matrix:
            break
        matrix = after
    return matrix


def _dot(a: Iterable[float], b: Iterable[float]) -> float:
    return math.fsum(x * y for x, y in zip(a, b, strict=True))


def _cofactors(m: Matrix) -> list[list[float]]:
    """Return the matrix of cofactors, det(m) m⁻ᵀ."""
    return [
        [m[i - 2][j - 2] * m[i - 1][j - 1] - m[i - 2][j - 1] * m[i - 1][j - 2] for j in range(3)]
        for i in range(3)
    ]


def _determinant(m: Matrix) -> float:
    return _dot(m[0], _cofactors(m)[0])


def _quaternion(r: Matrix) -> list[float]:
    """Return the unit quaternion of a rotation, by its largest component (Shepperd 1978)."""
    trace = r[0][0] + r[1][1] + r[2][2]
    squares = [1 + trace, *(1 + 2 * r[i][i] - trace for i in range(3))]
    largest = squares.index(max(squares))
    turning = [r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]]
    if largest == 0:
        e = [squares[0], *turning]
    else:
        k = largest - 1
        e = [turning[k], *(r[i][k] + r[k][i] for i in range(3))]
        e[largest] = squares[largest]
    size = math.copysign(math.hypot(*e), next(x for x in e if x))
    return [x / size + 0.0 for x in e]
