"""Dimensions of vectors: their rates, and entries that differ."""

from lagcli.model.expression.dimension import (
    NUMBER,
    ONE,
    ROTATION,
    SECOND,
    UNKNOWN,
    ZERO,
    TensorDimension,
    differing,
    product,
    rate_of,
    scalar_rate,
)


def column(*entries: object) -> TensorDimension:
    return TensorDimension(tuple((x,) for x in entries))  # type: ignore[arg-type]


def test_a_rate_is_per_second_and_that_of_a_number_vanishes() -> None:
    assert scalar_rate(SECOND, 1) == ONE
    assert scalar_rate(ONE, 2) == product(ONE, SECOND, -2)
    assert scalar_rate(NUMBER, 1) is ZERO
    assert scalar_rate(UNKNOWN, 1) is UNKNOWN


def test_rates_of_vectors_are_those_of_their_entries() -> None:
    vector = column(SECOND, NUMBER)
    assert rate_of(vector, 0) is vector
    assert rate_of(vector, 1) == column(ONE, ZERO)
    assert rate_of(ROTATION, 1).flat == (product(ONE, SECOND, -1),) * 9  # type: ignore[union-attr]
    assert (vector.shape, ROTATION.shape) == ((1, 1), (3, 3, 3))


def test_zeros_and_unknown_entries_differ_from_nothing() -> None:
    one, other = column(ZERO, UNKNOWN, SECOND), column(ONE, ONE, ONE)
    assert differing(one, other) == (SECOND, ONE)
    assert differing(SECOND, ONE) == (SECOND, ONE)
