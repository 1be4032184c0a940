"""Directional derivatives of tapes, against closed forms and central differences."""

from __future__ import annotations

import math
from math import exp, isclose
from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.engine.lowering.lower import lower
from lagcli.engine.tape.differentiation import Slope, SlopeRules, directional
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.operations import Op
from lagcli.engine.tape.tape import Arithmetic, Builder, Tape

MODELS = Path(__file__).parents[4] / "models"


def of_operation(op: Op, *, inputs: int) -> Tape:
    builder = Builder(inputs)
    return builder.finish([builder.new((op, *range(inputs)))])


@pytest.mark.parametrize(
    ("op", "slope"),
    [
        (Op.NEG, lambda x: -1.0),
        (Op.SQRT, lambda x: 0.5 / math.sqrt(x)),
        (Op.SIN, math.cos),
        (Op.COS, lambda x: -math.sin(x)),
        (Op.TAN, lambda x: 1 / math.cos(x) ** 2),
        (Op.ASIN, lambda x: 1 / math.sqrt(1 - x * x)),
        (Op.ACOS, lambda x: -1 / math.sqrt(1 - x * x)),
        (Op.ATAN, lambda x: 1 / (1 + x * x)),
        (Op.SINH, math.cosh),
        (Op.COSH, math.sinh),
        (Op.TANH, lambda x: 1 / math.cosh(x) ** 2),
        (Op.ASINH, lambda x: 1 / math.sqrt(x * x + 1)),
        (Op.ATANH, lambda x: 1 / (1 - x * x)),
        (Op.EXP, math.exp),
        (Op.LOG, lambda x: 1 / x),
        (Op.ERF, lambda x: 2 / math.sqrt(math.pi) * math.exp(-x * x)),
        (Op.ERFC, lambda x: -2 / math.sqrt(math.pi) * math.exp(-x * x)),
        (Op.FLOOR, lambda x: 0.0),
    ],
)
def test_functions_of_one_number(op: Op, slope: object) -> None:
    found = ScalarTape(directional(of_operation(op, inputs=1)))((0.3, 2.0))
    assert found == [pytest.approx(2 * slope(0.3), rel=1e-14)]  # type: ignore[operator]


def test_magnitudes_and_an_inverse_cosine() -> None:
    magnitude = ScalarTape(directional(of_operation(Op.ABS, inputs=1)))
    assert [magnitude((x, 3.0))[0] for x in (-2.0, 2.0)] == [-3.0, 3.0]
    found = ScalarTape(directional(of_operation(Op.ACOSH, inputs=1)))((2.0, 1.0))
    assert found == [pytest.approx(1 / math.sqrt(3), rel=1e-14)]


@pytest.mark.parametrize(
    ("op", "slopes"),
    [
        (Op.ADD, (1.0, 1.0)),
        (Op.SUB, (1.0, -1.0)),
        (Op.MUL, (1.5, 0.7)),
        (Op.DIV, (1 / 1.5, -0.7 / 1.5**2)),
        (Op.POW, (1.5 * 0.7**0.5, 0.7**1.5 * math.log(0.7))),
        (Op.CLIP, (1.0, 0.0)),
        (Op.ATAN2, (1.5 / (0.49 + 2.25), -0.7 / (0.49 + 2.25))),
        (Op.LT, (0.0, 0.0)),
    ],
)
def test_functions_of_two_numbers(op: Op, slopes: tuple[float, float]) -> None:
    tape = ScalarTape(directional(of_operation(op, inputs=2)))
    assert tape((0.7, 1.5, 2.0, 3.0)) == [pytest.approx(2 * slopes[0] + 3 * slopes[1], rel=1e-14)]


#: Operations on truth values, which are constant.
LOGICAL = (Op.AND, Op.OR, Op.NOT)


@pytest.mark.parametrize(
    "op", [op for op in Op if op.scalar and op not in LOGICAL], ids=lambda op: op.name
)
def test_every_operation_of_tapes_has_a_derivative(op: Op) -> None:
    least = op.function.domain.low if op.function else -math.inf
    at, along = np.array([max(0.7, 1.3 * least), 1.5, 2.3]), np.array([1.0, -0.4, 0.6])
    at, along = at[: op.arity], along[: op.arity]
    tape = of_operation(op, inputs=op.arity)
    value, step = ScalarTape(tape), 1e-6
    difference = value([*(at + step * along)])[0] - value([*(at - step * along)])[0]
    found = ScalarTape(directional(tape))([*at, *along])
    # second order in the step, and rounding errors over the step
    assert found == [pytest.approx(difference / (2 * step), rel=1e-8, abs=1e-9)]


def test_a_choice_has_the_derivative_of_its_branch() -> None:
    tape = ScalarTape(directional(of_operation(Op.SELECT, inputs=3)))
    assert [tape((c, 5.0, 6.0, 9.0, 2.0, 3.0))[0] for c in (1.0, 0.0)] == [2.0, 3.0]


@pytest.mark.parametrize("name", ["heavy_top", "car_on_road", "contact/woodpecker"])
def test_whole_models(name: str) -> None:
    system = lower(lagcli.derive(lagcli.load(MODELS / f"{name}.yaml")))
    rng = np.random.default_rng(4)
    for tape in (system.dynamics, system.constraint):
        count = tape.inputs - tape.functions.size
        x, change = rng.uniform(0.5, 1, count), rng.uniform(-1, 1, count)
        value, slope = ScalarTape(tape), ScalarTape(directional(tape))
        weights = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}
        expected = sum(
            w * (np.array(value(x + k * 1e-3 * change)) - np.array(value(x - k * 1e-3 * change)))
            for k, w in weights.items()
        )
        scale = np.abs(expected).max() / 1e-3
        found = slope([*x, *change])
        np.testing.assert_allclose(found, np.asarray(expected) / 1e-3, atol=1e-11 * scale)


def test_constants_are_not_multiplied() -> None:
    builder = Arithmetic(2)
    rules = SlopeRules(builder)
    assert rules.of(Op.EXP, 0, 1) == Slope(1.0, 1)
    assert rules.of(Op.LOG, 0, 1) == Slope(1.0, None, 0)
    assert rules.of(Op.SQRT, 0, 1) == Slope(0.5, None, 1)
    assert not builder.operations
    number, register, divisor = rules.of(Op.COS, 0, 1)
    assert (number, divisor) == (-1.0, None)
    assert list(builder.operations) == [(Op.SIN, 0)]
    assert register == 2


def test_operators() -> None:
    builder = Arithmetic(2)
    rules = SlopeRules(builder)
    rule = lambda f, x, y: 2 * (3 - x) / (1 + y) + x / 4 - 0.5 * f.exp(-x) * (1 / y)  # noqa: E731
    number, register, _ = rules.apply(rule, 0, 1)
    assert number == 1.0
    assert register is not None
    tape = ScalarTape(builder.finish([register]))
    x, y = 0.7, 1.9
    expected = 2 * (3 - x) / (1 + y) + x / 4 - 0.5 * exp(-x) / y
    assert isclose(tape((x, y))[0], expected, rel_tol=1e-15)
