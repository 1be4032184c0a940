"""Dimensions: products, powers, and the units that are written for them."""

from __future__ import annotations

import pickle
from fractions import Fraction

import pytest

from lagcli.model.expression.dimension import (
    ENERGY,
    NUMBER,
    ONE,
    ROTATION,
    SECOND,
    UNKNOWN,
    ZERO,
    Dimension,
    TensorDimension,
    differing,
    power,
    product,
    rate_of,
    same,
    scalar_rate,
    unit_of,
)
from lagcli.model.expression.units import read_unit, to_si


@pytest.mark.parametrize(
    "unit",
    [
        *("kg", "m", "s", "m/s^2", "N", "N*m", "N/m", "N/m^2", "N*s/m", "J", "W", "rad", "rad/s"),
        *("kg*m/s", "kg*m^2", "kg*m^2/s", "N*m^2", "C", "V", "ohm", "T", "H", "F", "Wb", "1"),
        *("1/s", "kg/m", "rad/s^2", "N/m^1.5", "N/m^(1/3)", "mol", "cd", "K", "m^3/s", "N*m/K"),
    ],
)
def test_a_unit_is_written_as_it_is_read(unit: str) -> None:
    assert unit_of(read_unit(unit).dimension) == unit
    assert to_si(unit) == 1


@pytest.mark.parametrize(
    ("unit", "coherent"),
    [
        *(("Pa", "N/m^2"), ("deg/s", "rad/s"), ("rpm", "rad/s"), ("kN*mm", "N*m"), ("Hz", "1/s")),
        *(("lbf", "N"), ("kg*m^2/s^2", "J"), ("kg*m/s^2", "N"), ("g*cm^2", "kg*m^2")),
        *(("V*A", "W"), ("J/C", "V"), ("N*s^2/m", "kg"), ("ft^2", "m^2"), ("N*m*rad", "J")),
    ],
)
def test_the_coherent_unit_of_a_unit(unit: str, coherent: str) -> None:
    assert unit_of(read_unit(unit).dimension) == coherent


def test_a_radian_is_a_number() -> None:
    assert same(read_unit("rad/s").dimension, read_unit("1/s").dimension)
    assert same(read_unit("N*m").dimension, ENERGY)
    assert not same(read_unit("N").dimension, ENERGY)


def test_products_and_powers() -> None:
    length = Dimension(m=1)
    assert product(length, length) == power(length, 2) == Dimension(m=2)
    assert power(Dimension(m=2), Fraction(1, 2)) == length
    assert product(length, length, -1) == ONE
    assert product(ZERO, length) is ZERO
    assert product(UNKNOWN, length) is UNKNOWN
    assert product(NUMBER, length) == length
    assert product(NUMBER, length, -1) == Dimension(m=-1)
    assert power(NUMBER, 2) is NUMBER


def test_there_is_one_of_each_special_value_in_other_processes_too() -> None:
    assert pickle.loads(pickle.dumps([ZERO, NUMBER, UNKNOWN])) == [ZERO, NUMBER, UNKNOWN]


def test_fractional_powers_keep_the_factor() -> None:
    assert float(to_si("N/mm^1.5")) == pytest.approx(1000**1.5, rel=1e-15)
    assert float(to_si("m^(2/3)")) == 1


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
