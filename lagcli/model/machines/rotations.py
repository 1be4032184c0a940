"""Rotations as matrices of numbers, and principal moments of inertia."""

from __future__ import annotations

import math
from collections.abc import Sequence

from lagcli.model.machines.frames import Vector, dot

Matrix = tuple[Vector, Vector, Vector]
IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def applied(R: Matrix, vector: Sequence[float]) -> Vector:
    """Return the product of a matrix and a vector."""
    x, y, z = vector
    one, two, three = (dot(row, (x, y, z)) for row in R)
    return one, two, three


def transposed(R: Matrix) -> Matrix:
    """Return the transpose: the inverse of a rotation."""
    one, two, three = zip(*R, strict=True)
    return one, two, three


def product(A: Matrix, B: Matrix) -> Matrix:
    """Return the product of two matrices."""
    one, two, three = (applied(transposed(B), row) for row in A)
    return one, two, three


def plus(one: Sequence[float], two: Sequence[float], factor: float = 1.0) -> Vector:
    """Return one + factor·two."""
    x, y, z = (a + factor * b for a, b in zip(one, two, strict=True))
    return x, y, z


def about_x(angle: float) -> Matrix:
    """Return the rotation about the first axis."""
    c, s = math.cos(angle), math.sin(angle)
    return (1.0, 0.0, 0.0), (0.0, c, -s), (0.0, s, c)


def quaternion(R: Matrix) -> tuple[float, ...]:
    """Return the unit quaternion of a rotation, its largest component positive."""
    (a, b, c), (d, e, f), (g, h, i) = R
    outer = (
        (1 + a + e + i, h - f, c - g, d - b),
        (h - f, 1 + a - e - i, b + d, c + g),
        (c - g, b + d, 1 - a + e - i, f + h),
        (d - b, c + g, f + h, 1 - a - e + i),
    )  # 4 e eᵀ: the row with the largest diagonal entry is the most exact
    row = outer[max(range(4), key=lambda k: outer[k][k])]
    norm = math.hypot(*row)
    return tuple(x / norm for x in row)


def matrix(e: Sequence[float]) -> Matrix:
    """Return the rotation of a quaternion of any length but 0."""
    norm = math.hypot(*e)
    a, b, c, d = (x / norm for x in e)
    return (
        (a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)),
        (2 * (b * c + a * d), a * a - b * b + c * c - d * d, 2 * (c * d - a * b)),
        (2 * (b * d - a * c), 2 * (c * d + a * b), a * a - b * b - c * c + d * d),
    )


def principal_moments(J: Matrix) -> tuple[float, float, float]:
    """Return the eigenvalues of a symmetric matrix, ascending.

    O. K. Smith, Eigenvalues of a symmetric 3 × 3 matrix, Comm. ACM 4 (1961) 168.
    """
    mean = (J[0][0] + J[1][1] + J[2][2]) / 3
    shifted = [[x - mean * (i == j) for j, x in enumerate(row)] for i, row in enumerate(J)]
    p = math.sqrt(math.fsum(x * x for row in shifted for x in row) / 6)
    if p == 0:
        return mean, mean, mean
    (a, b, c), (_, d, e), (_, _, f) = ([x / p for x in row] for row in shifted)
    half = (a * (d * f - e * e) - b * (b * f - e * c) + c * (b * e - d * c)) / 2
    angle = math.acos(max(-1.0, min(1.0, half))) / 3
    most = mean + 2 * p * math.cos(angle)
    least = mean + 2 * p * math.cos(angle + math.tau / 3)
    return least, 3 * mean - most - least, most
