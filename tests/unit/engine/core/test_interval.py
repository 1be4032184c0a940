"""Interval evaluation of tapes: enclosures of values and derivatives, against mpmath."""

from __future__ import annotations

import math
import random

import mpmath
import numpy as np
import pytest
from core_parts import enclosures

from lagcli.engine.tape.operations import ARITY, Op
from lagcli.engine.tape.tape import Builder, Tape

ORDER = 4
#: Smooth operations on f(t) = a + b t + c t², with the ranges of a, and what mpmath has for them.
ONE = {
    Op.SQRT: (0.5, 3.0, mpmath.sqrt),
    Op.SIN: (-9.0, 9.0, mpmath.sin),
    Op.COS: (-9.0, 9.0, mpmath.cos),
    Op.TAN: (-1.2, 1.2, mpmath.tan),
    Op.ASIN: (-0.8, 0.8, mpmath.asin),
    Op.ACOS: (-0.8, 0.8, mpmath.acos),
    Op.ATAN: (-3.0, 3.0, mpmath.atan),
    Op.SINH: (-3.0, 3.0, mpmath.sinh),
    Op.COSH: (-3.0, 3.0, mpmath.cosh),
    Op.TANH: (-3.0, 3.0, mpmath.tanh),
    Op.ASINH: (-3.0, 3.0, mpmath.asinh),
    Op.ACOSH: (1.3, 4.0, mpmath.acosh),
    Op.ATANH: (-0.8, 0.8, mpmath.atanh),
    Op.EXP: (-3.0, 3.0, mpmath.exp),
    Op.LOG: (0.3, 4.0, mpmath.log),
    Op.EXPM1: (-3.0, 3.0, mpmath.expm1),
    Op.LOG1P: (-0.7, 3.0, mpmath.log1p),
    Op.ERF: (-2.0, 2.0, mpmath.erf),
    Op.ERFC: (-2.0, 2.0, mpmath.erfc),
    Op.NEG: (-3.0, 3.0, lambda x: -x),
}
TWO = {
    Op.ADD: lambda x, y: x + y,
    Op.SUB: lambda x, y: x - y,
    Op.MUL: lambda x, y: x * y,
    Op.DIV: lambda x, y: x / y,
    Op.POW: lambda x, y: x**y,
    Op.ATAN2: mpmath.atan2,
}
#: Operations that jump or have kinks.
SWITCHES = (Op.FLOOR, Op.CEIL, Op.ABS, Op.LT, Op.LE, Op.EQ, Op.NE, Op.AND, Op.OR, Op.NOT, Op.SELECT)


def parabola(builder: Builder, a: float, b: float, c: float) -> int:
    t, one = 0, builder.constant
    linear = builder.emit(Op.ADD, one(a), builder.emit(Op.MUL, one(b), t))
    return builder.emit(Op.ADD, linear, builder.emit(Op.MUL, one(c), builder.emit(Op.MUL, t, t)))


def enclosed(
    tape: Tape, low: float, high: float, order: int = ORDER, *, narrowed: bool = False
) -> np.ndarray:
    found: np.ndarray = enclosures(tape, [low], high, order, narrowed=narrowed)[0]
    return found


def check(bounds: np.ndarray, exact: list[mpmath.mpf], sharp: bool) -> None:
    for k, ((low, high), x) in enumerate(zip(bounds, exact, strict=True)):
        error = 1e-30 * (1 + abs(x))  # of mpmath's derivatives, which are differences
        assert low - error <= x <= high + error, (k, low, x, high)
        if sharp:  # at a point, the enclosure is as wide as rounding errors
            assert high - low <= 1e-11 * (1 + max(map(abs, exact)))


@pytest.mark.parametrize("op", ONE, ids=lambda op: op.name)
def test_enclosures_of_functions_of_one_operand_contain_values_and_derivatives(op: Op) -> None:
    lowest, highest, f = ONE[op]
    rng = random.Random(op.value)
    with mpmath.workdps(40):
        for _ in range(12):
            a, b, c = rng.uniform(lowest, highest), rng.uniform(-0.1, 0.1), rng.uniform(-0.05, 0.05)
            builder = Builder(1)
            tape = builder.finish([builder.emit(op, parabola(builder, a, b, c))])
            wide, narrow = enclosed(tape, 0.0, 1.0), enclosed(tape, 0.0, 1.0, narrowed=True)
            assert (narrow[:, 0] >= wide[:, 0]).all()
            assert (narrow[:, 1] <= wide[:, 1]).all()
            for t in (0.0, rng.random(), 1.0):
                exact = mpmath.taylor(lambda s, a=a, b=b, c=c: f(a + b * s + c * s * s), t, ORDER)
                check(narrow, exact, sharp=False)
                check(enclosed(tape, t, t), exact, sharp=True)


@pytest.mark.parametrize("op", TWO, ids=lambda op: op.name)
def test_enclosures_of_functions_of_two_operands_contain_values_and_derivatives(op: Op) -> None:
    f, rng = TWO[op], random.Random(op.value)
    with mpmath.workdps(40):
        for _ in range(12):
            first = rng.uniform(0.6, 2.0), rng.uniform(-0.2, 0.2), rng.uniform(-0.1, 0.1)
            second = rng.uniform(0.6, 2.0), rng.uniform(-0.2, 0.2), rng.uniform(-0.1, 0.1)
            builder = Builder(1)
            operands = parabola(builder, *first), parabola(builder, *second)
            tape = builder.finish([builder.emit(op, *operands)])

            def exactly(s: mpmath.mpf, x: tuple = first, y: tuple = second) -> mpmath.mpf:
                return f(x[0] + x[1] * s + x[2] * s * s, y[0] + y[1] * s + y[2] * s * s)

            wide, narrow = enclosed(tape, 0.0, 1.0), enclosed(tape, 0.0, 1.0, narrowed=True)
            assert (narrow[:, 0] >= wide[:, 0]).all()
            assert (narrow[:, 1] <= wide[:, 1]).all()
            for t in (0.0, rng.random(), 1.0):
                exact = mpmath.taylor(exactly, t, ORDER)
                check(narrow, exact, sharp=False)
                check(enclosed(tape, t, t), exact, sharp=True)


@pytest.mark.parametrize("length", [0.3, 0.1, 0.03])
def test_what_moves_together_cancels_where_it_is_narrowed(length: float) -> None:
    """sin t − (t − t³/6) is t⁵/120, in a tanh of width 1e-3; ranges of its parts are wide."""
    builder, one = Builder(1), Builder.constant
    cube = builder.emit(Op.MUL, 0, builder.emit(Op.MUL, 0, 0))
    series = builder.emit(Op.SUB, 0, builder.emit(Op.DIV, cube, one(builder, 6.0)))
    rest = builder.emit(Op.SUB, builder.emit(Op.SIN, 0), series)
    stiff = builder.emit(Op.TANH, builder.emit(Op.MUL, rest, one(builder, 1e3)))
    wide, narrow = (
        enclosed(builder.finish([stiff]), 0.0, length, narrowed=narrowed)[0]
        for narrowed in (False, True)
    )
    largest = math.tanh(1e3 * length**5 / 120)
    assert narrow[0] <= 0
    assert largest <= narrow[1]
    # the rest of order 4 of each part, over the width: a few times the function itself
    assert narrow[1] - narrow[0] <= 1e3 * length**5 + 1e-9
    assert wide[1] - wide[0] > 0.9


@pytest.mark.parametrize("power", [2.0, 3.0, -1.0, -2.0, 0.5, 2.5, 0.0])
@pytest.mark.parametrize("base", [(-2.0, -1.0), (-1.0, 2.0), (0.0, 2.0), (0.5, 1.5)])
def test_constant_powers_of_any_base(power: float, base: tuple[float, float]) -> None:
    builder = Builder(1)
    tape = builder.finish([builder.emit(Op.POW, 0, builder.constant(power))])
    low, high = enclosed(tape, *base, order=0)[0]
    for t in np.linspace(*base, 41).tolist():
        try:
            value = math.pow(t, power)
        except (ValueError, ZeroDivisionError):
            continue
        assert low <= value <= high


@pytest.mark.parametrize("op", SWITCHES, ids=lambda op: op.name)
def test_operations_that_switch_enclose_all_their_values(op: Op) -> None:
    rng = random.Random(op.value)
    logical = op in (Op.AND, Op.OR, Op.NOT)
    for _ in range(30):
        builder = Builder(1)
        operands = [
            parabola(builder, *(rng.uniform(-2, 2) for _ in range(3))) for _ in range(ARITY[op])
        ]
        if logical or op == Op.SELECT:
            zero = builder.constant(0.0)
            changed = [builder.emit(Op.LT, zero, x) for x in operands]
            operands = changed if logical else [changed[0], *operands[1:]]
        tape = builder.finish([builder.emit(op, *operands)])
        low, high = sorted((rng.uniform(-1, 1), rng.uniform(-1, 1)))
        bounds = enclosed(tape, low, high)
        values = [enclosed(tape, t, t)[0].mean() for t in np.linspace(low, high, 25).tolist()]
        assert bounds[0, 0] <= min(values)
        assert max(values) <= bounds[0, 1]
        if op != Op.SELECT and op != Op.ABS and len({*values}) > 1:  # it jumps
            assert math.isinf(bounds[1, 1])


def test_every_operation_of_tapes_has_a_rule() -> None:
    tapes = {op for op in Op if op.scalar is not None}
    assert tapes == {*ONE, *TWO, *SWITCHES, Op.CLIP}


@pytest.mark.parametrize("op", [Op.TAN, Op.DIV, Op.LOG, Op.ATAN2])
def test_nothing_is_said_of_derivatives_across_a_pole_or_a_jump(op: Op) -> None:
    builder = Builder(1)
    centre = {Op.TAN: math.pi / 2, Op.DIV: 0.0, Op.LOG: 0.0, Op.ATAN2: 0.0}[op]
    x = builder.emit(Op.ADD, 0, builder.constant(centre))
    operands = {Op.DIV: (builder.constant(1.0), x), Op.ATAN2: (x, builder.constant(-1.0))}
    tape = builder.finish([builder.emit(op, *operands.get(op, (x,)))])
    assert np.isinf(enclosed(tape, -0.1, 0.1)[1]).all()
