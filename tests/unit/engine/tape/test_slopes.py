"""Rules of derivatives on registers: constants stay numbers, quotients stay open."""

from __future__ import annotations

from math import exp, isclose

from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.operations import Op
from lagcli.engine.tape.slopes import Slope, SlopeRules
from lagcli.engine.tape.tape import Arithmetic


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
