"""Builders: equal operations are one, constants come before results, and parts are combined."""

from __future__ import annotations

import math
import random
from fractions import Fraction

import pytest

from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.operations import Op
from lagcli.engine.tape.tape import Arithmetic, Builder, Tape


def test_equal_operations_are_one() -> None:
    builder = Builder(2)
    assert builder.emit(Op.SUB, 0, 1) == builder.emit(Op.SUB, 0, 1)
    assert builder.emit(Op.SUB, 0, 1) != builder.emit(Op.SUB, 1, 0)
    assert len(builder.operations) == 2


def test_operands_of_commutative_operations_have_one_order() -> None:
    builder = Builder(2)
    for op in (Op.ADD, Op.MUL, Op.EQ, Op.NE, Op.AND, Op.OR):
        assert builder.emit(op, 0, 1) == builder.emit(op, 1, 0)
    for op in (Op.DIV, Op.POW, Op.ATAN2, Op.LT, Op.LE):
        assert builder.emit(op, 0, 1) != builder.emit(op, 1, 0)


def test_registers_are_inputs_then_constants_then_results() -> None:
    builder = Builder(2)
    product = builder.emit(Op.MUL, 0, builder.constant(3.0))
    total = builder.emit(Op.ADD, product, builder.constant(5.0))
    tape = builder.finish([total, builder.constant(5.0), 1])
    assert tape == Tape(2, (3.0, 5.0), ((Op.MUL, 4, 2, 0, 0), (Op.ADD, 5, 3, 4, 0)), (5, 3, 1))
    assert tape.registers == 6


def test_constants_are_equal_where_their_values_are() -> None:
    builder = Builder(0)
    assert builder.constant(2) == builder.constant(2.0) != builder.constant(3.0)
    assert builder.constant(0.0) == builder.constant(-0.0)


def test_steady_registers_depend_on_parameters_and_constants_alone() -> None:
    builder = Builder(4, parameters=2, rhs_inputs=1)  # a variable, two parameters, one more
    both = builder.emit(Op.MUL, 1, 2)
    scaled = builder.emit(Op.ADD, both, builder.constant(1.0))
    moving = builder.emit(Op.MUL, both, 0)
    other = builder.emit(Op.MUL, both, 3)
    assert builder.invariant == {1, 2, both, scaled}
    assert not {moving, other} & builder.invariant


def test_a_tape_continues_in_another_builder() -> None:
    given = Builder(2)
    given.constant(7.0)
    one = given.finish([given.emit(Op.SUB, given.constant(2.0), 1), 0])
    builder = Builder(3, parameters=1)
    builder.constant(9.0)
    first, second = builder.extend(one)
    assert second == 0
    assert builder.extend(one) == [first, second]  # nothing is added twice
    tape = builder.finish([builder.emit(Op.MUL, first, 2)])
    assert ScalarTape(tape)((1.0, 5.0, 10.0)) == [(2.0 - 5.0) * 10.0]


def test_a_tape_of_some_outputs_has_no_operation_that_they_do_not_need() -> None:
    builder = Builder(2, parameters=1)
    square = builder.emit(Op.MUL, 0, 0)
    shifted = builder.emit(Op.ADD, square, builder.constant(3.0))
    cube = builder.emit(Op.MUL, square, 1)
    tape = builder.finish([square, shifted, cube])
    found = tape.selected([2, 0])
    assert found.code == ((Op.MUL, 3, 0, 0, 0), (Op.MUL, 4, 1, 3, 0))
    assert found.parameters == 1
    assert ScalarTape(found)((2.0, 5.0)) == [20.0, 4.0]
    assert tape.selected([1, 2, 0]).code is tape.code
    assert tape.selected([]).code == ()
    marked = tape._replace(rhs_inputs=1, deferred=(2,), output_subsets=((0, 2), (1,)))
    assert marked.selected([0, 1, 2]) == marked
    for some in ([1, 2, 0], [2, 0], []):  # the numbers of outputs in the marks are others
        assert marked.selected(some) == tape.selected(some)


def test_results_that_are_used_alike_are_named_by_their_final_registers() -> None:
    builder = Builder(1)
    square = builder.emit(Op.MUL, 0, 0)
    cube = builder.emit(Op.MUL, square, 0)
    tape = builder.finish(
        [cube, builder.constant(4.0)],
        deferred=(1,),
        output_subsets=((0,),),
        isomorphic=[[square, cube]],
    )
    assert (tape.deferred, tape.output_subsets) == ((1,), ((0,),))
    assert tape.isomorphic == (tuple(to for _, to, *_ in tape.code),)


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
