"""Arithmetic that knows zeros, ones and signs: the same values from fewer operations."""

from __future__ import annotations

import math
import random
from fractions import Fraction

import pytest

from lagcli.engine.tape.arithmetic import Arithmetic
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.operations import Op

VALUES = (3.0, -5.0, 0.25, 7.0)


@pytest.mark.parametrize("seed", range(20))
def test_values_are_those_of_plain_arithmetic(seed: int) -> None:
    """On small whole numbers and halves, whatever is emitted is exact."""
    draw = random.Random(seed)
    builder = Arithmetic(len(VALUES))
    known = [*enumerate(map(Fraction, VALUES)), (builder.zero, Fraction(0))]
    known.append((builder.one, Fraction(1)))
    for _ in range(25):
        (a, x), (b, y) = draw.choice(known), draw.choice(known)
        made = [
            (builder.plus(a, b), x + y),
            (builder.minus(a, b), x - y),
            (builder.negative(a), -x),
            (builder.magnitude(a), abs(x)),
        ]
        if abs(x * y) < 2**20 and max(x.denominator, y.denominator) <= 16:
            made.append((builder.times(a, b), x * y))
        if abs(x) in (Fraction(1), Fraction(1, 4)):
            made.append((builder.inverse(a), 1 / x))
        known += draw.sample(made, 2)
    tape = builder.finish([register for register, _ in known])
    assert ScalarTape(tape)(VALUES) == [float(x) for _, x in known]


def test_neutral_elements_cost_nothing() -> None:
    builder = Arithmetic(1)
    x, zero, one = 0, builder.zero, builder.one
    assert builder.plus(x, zero) == builder.plus(zero, x) == builder.minus(x, zero) == x
    assert builder.times(x, one) == builder.times(one, x) == x
    assert builder.times(x, zero) == builder.times(zero, x) == builder.negative(zero) == zero
    assert builder.inverse(one) == builder.magnitude(one) == one
    assert builder.magnitude(zero) == zero
    assert not builder.operations


def test_signs_end_in_sums() -> None:
    builder = Arithmetic(3)
    x, y, z = range(3)
    minus_x = builder.negative(x)
    assert builder.negative(minus_x) == x
    assert builder.plus(y, minus_x) == builder.minus(y, x) == builder.plus(minus_x, y)
    assert builder.minus(y, minus_x) == builder.plus(y, x)
    assert builder.times(minus_x, builder.negative(y)) == builder.times(x, y)
    product = builder.times(minus_x, y)
    assert builder.plus(z, product) == builder.minus(z, builder.times(x, y))
    assert builder.magnitude(minus_x) == builder.magnitude(x)
    assert builder.inverse(minus_x) == builder.negative(builder.inverse(x))


def test_zero_times_what_may_be_infinite_is_left_out() -> None:
    """A structural zero is one whatever it is multiplied by."""
    builder = Arithmetic(1)
    infinite = builder.emit(Op.DIV, builder.one, 0)
    tape = builder.finish([builder.times(builder.zero, infinite), infinite])
    assert ScalarTape(tape)((0.0,)) == [0.0, math.inf]
