"""Dimensions of vectors and matrices, entry by entry."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from lagcli.model.dimensions.dimension import (
    NUMBER,
    ONE,
    SECOND,
    UNKNOWN,
    ZERO,
    Dimension,
    Scalar,
    product,
    same,
)


class TensorDimension(NamedTuple):
    """Dimensions of the entries of a vector (one column) or a matrix."""

    rows: tuple[tuple[Scalar, ...], ...]

    def map(self, function: Callable[[Scalar], Scalar]) -> TensorDimension:
        """Apply a function to each entry."""
        return TensorDimension(tuple(tuple(map(function, row)) for row in self.rows))

    @property
    def shape(self) -> tuple[int, ...]:
        """The number of entries in each row."""
        return tuple(map(len, self.rows))

    @property
    def flat(self) -> tuple[Scalar, ...]:
        """All entries, row by row."""
        return tuple(x for row in self.rows for x in row)


Value = Scalar | TensorDimension


ROTATION = TensorDimension(((ONE,) * 3,) * 3)


def rate_of(value: Value, order: int) -> Value:
    """Return the dimension of a time derivative."""
    if not order:
        return value
    if isinstance(value, TensorDimension):
        return value.map(lambda x: scalar_rate(x, order))
    return scalar_rate(value, order)


def scalar_rate(x: Scalar, order: int) -> Scalar:
    """Return the dimension of the time derivative of a scalar."""
    if isinstance(x, Dimension):
        return product(x, SECOND, -order)
    return ZERO if x is NUMBER else x


def differing(a: Value, b: Value) -> tuple[Scalar, Scalar]:
    """Return the first pair of entries that differ."""
    if not (isinstance(a, TensorDimension) and isinstance(b, TensorDimension)):
        assert not isinstance(a, TensorDimension)
        assert not isinstance(b, TensorDimension)
        return a, b
    for x, y in zip(a.flat, b.flat, strict=True):
        if x is not y and isinstance(x, Dimension) and isinstance(y, Dimension) and same(x, y):
            continue
        if x is not y and x is not ZERO and y is not ZERO and UNKNOWN not in (x, y):
            return x, y
    return a.flat[0], b.flat[0]
