"""Expressions → tapes: which operations, and that their values are those of the expressions."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from fractions import Fraction

import pytest
import symengine as se
from growth import assert_growth
from hypothesis import given, settings
from hypothesis import strategies as st
from tape_values import VARIABLES, applied, batch, exactly, value

from lagcli.engine.lowering import compiler
from lagcli.engine.lowering.compiler import compile_tape
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.operations import ARITY, Op
from lagcli.functions import FUNCTIONS
from lagcli.model.expression.constants import cases

X, Y, Z = VARIABLES


def count(*expressions: se.Basic) -> dict[Op, int]:
    """Return how often each operation occurs."""
    found: dict[Op, int] = {}
    for op, *_ in compile_tape(expressions, VARIABLES).code:
        found[Op(op)] = found.get(Op(op), 0) + 1
    return found


@pytest.mark.parametrize("name", sorted(FUNCTIONS))
@pytest.mark.parametrize("x", [0.3, 1.7, -0.6, -2.5])
def test_every_function_of_the_grammar(name: str, x: float) -> None:
    function = FUNCTIONS[name]
    expression = applied(name, X, Y)
    expected = exactly(expression, (x, 0.8, 0.0))
    found = value(expression, x, 0.8)
    assert batch(expression, (x, 0.8, 0))[0] == pytest.approx(found, nan_ok=True)
    if math.isnan(expected):
        assert math.isnan(found)
    else:
        # erf, erfc and the hyperbolic functions of libm are good to a few units in the last place
        assert found == pytest.approx(expected, rel=1e-14)
    assert function.fewest <= 2


# what the tape is


def test_equal_subexpressions_share_a_register() -> None:
    shared = se.sin(X * Y + 1)
    assert count(shared, shared**2, shared + Z, se.cos(X * Y + 1)) == {
        Op.MUL: 2,  # x y, and the square
        Op.ADD: 2,  # + 1, and + z
        Op.SIN: 1,
        Op.COS: 1,
    }


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        (X**2, {Op.MUL: 1}),
        (X**8, {Op.MUL: 3}),
        (X**-1, {Op.DIV: 1}),
        (Y / X**2, {Op.MUL: 1, Op.DIV: 1}),
        (se.sqrt(X), {Op.SQRT: 1}),
        (1 / se.sqrt(X), {Op.SQRT: 1, Op.DIV: 1}),
        (X ** se.Rational(3, 2), {Op.SQRT: 1, Op.MUL: 1}),
        (X ** se.Rational(1, 3), {Op.POW: 1}),
        (X**Y, {Op.POW: 1}),
        (X**1000, {Op.POW: 1}),
        (se.exp(X), {Op.EXP: 1}),
        (se.exp(-X), {Op.NEG: 1, Op.EXP: 1}),
        (X - Y, {Op.SUB: 1}),
        (-X - Y, {Op.NEG: 1, Op.SUB: 1}),
        (-X * Y, {Op.MUL: 1, Op.NEG: 1}),
        (X - 2 * Y, {Op.MUL: 1, Op.SUB: 1}),
        (X / (Y * Z), {Op.MUL: 1, Op.DIV: 1}),
        (X, {}),
        (se.Integer(3), {}),
    ],
)
def test_operations(expression: se.Basic, expected: dict[Op, int]) -> None:
    assert count(expression) == expected
    assert value(expression, 1.3, 0.7, 2.1) == pytest.approx(
        exactly(expression, (1.3, 0.7, 2.1)), rel=1e-14
    )


def test_operands_are_ready_before_they_are_used() -> None:
    tape = compile_tape([se.sin(X) * Y + se.cos(X) ** 3, cases(se.Lt(X, Y), X, Z**2)], VARIABLES)
    ready = set(range(tape.inputs + len(tape.constants)))
    for op, to, *operands in tape.code:
        assert set(operands[: ARITY[op]]) <= ready
        assert to not in ready
        ready.add(to)
    assert set(tape.outputs) <= ready
    assert tape.registers == len(ready)


def test_constants_that_are_not_needed_are_not_there() -> None:
    assert compile_tape([X**2 + X**4], VARIABLES).constants == ()


def test_unknown_symbol_is_rejected() -> None:
    with pytest.raises(KeyError, match="w"):
        compile_tape([se.Symbol("w") + 1], VARIABLES)


@settings(max_examples=100, deadline=None)
@given(st.integers(-(10**25), 10**25), st.integers(0, 25))
def test_decimals_are_the_nearest_doubles(digits: int, places: int) -> None:
    tape = compile_tape([se.Rational(digits, 10**places)], VARIABLES)
    assert tape.constants == (float(Fraction(digits, 10**places)),)


def test_named_and_large_constants() -> None:
    assert value(se.pi) == math.pi
    assert value(se.E) == math.e
    assert value(se.Integer(10) ** 400) == math.inf
    assert value(-(se.Integer(10) ** 400)) == -math.inf
    assert value(se.oo) == math.inf
    assert value(-se.oo) == -math.inf
    assert math.isnan(value(se.zoo))
    assert math.isnan(value(se.I))
    assert math.isnan(value(se.sqrt(se.Integer(-2)) * X, 1.0))
    assert math.isnan(value(se.nan))


# size


def test_sum_of_many_terms() -> None:
    terms = [se.Rational(k, 7) * se.sin(k * X) for k in range(1, 1001)]
    x = 0.37
    expected = math.fsum(k / 7 * math.sin(k * x) for k in range(1, 1001))
    size = sum(k / 7 for k in range(1, 1001))
    # 1000 additions, each rounded
    assert value(se.Add(*terms), x) == pytest.approx(expected, abs=1e-12 * size)


def test_deep_nesting_needs_no_recursion() -> None:
    expression, expected = X, 0.5
    for k in range(2000):
        expression = se.sin(expression + 1) if k % 2 else se.cos(expression)
        expected = math.sin(expected + 1) if k % 2 else math.cos(expected)
    assert value(expression, 0.5) == pytest.approx(expected, rel=1e-12)


def test_time_grows_like_the_size() -> None:
    def seconds(n: int) -> float:
        total = se.Add(*[se.sin(k * X) * se.cos(k * Y) for k in range(1, n)])
        began = time.process_time()
        compile_tape([total], VARIABLES)
        return time.process_time() - began

    # eight times as long; square growth would be sixty-four
    assert_growth(seconds, (250, 2000), factor=24)


def test_powers_of_shared_factors_stay_small() -> None:
    expression = X
    for _ in range(60):  # doubles in size as text, grows by two operations as a tape
        expression = expression * expression + 1
    assert len(compile_tape([expression], VARIABLES).code) <= 120


# undefined values


@pytest.mark.parametrize(
    ("expression", "x", "expected"),
    [
        (se.sqrt(X), -1.0, math.nan),
        (se.log(X), -1.0, math.nan),
        (se.log(X), 0.0, -math.inf),
        (1 / X, 0.0, math.inf),
        (-1 / X, 0.0, -math.inf),
        (X / X**2 * Y, 0.0, math.nan),  # y = 0
        (se.acos(X), 1.5, math.nan),
        (se.acosh(X), 0.5, math.nan),
        (se.atanh(X), 1.0, math.inf),
        (X ** se.Rational(1, 3), -8.0, math.nan),
        (X ** se.Rational(-1, 3), 0.0, math.inf),
        (se.exp(X), 1000.0, math.inf),
        (se.sinh(X), -1000.0, -math.inf),
        (se.cosh(X), -1000.0, math.inf),
        (se.sin(X), math.inf, math.nan),
        (se.floor(X), -math.inf, -math.inf),
        (se.ceiling(X), math.nan, math.nan),
        (X**1001, -1e10, -math.inf),
        (se.exp(-1 / X**2), 0.0, 0.0),  # an infinity on the way is no harm
        (se.atan(1 / X), 0.0, math.pi / 2),
    ],
)
def test_undefined_values_are_those_of_ieee_754(
    expression: se.Basic, x: float, expected: float
) -> None:
    assert value(expression, x) == pytest.approx(expected, nan_ok=True)
    assert batch(expression, (x, 0, 0))[0] == pytest.approx(expected, nan_ok=True)


@pytest.mark.parametrize("x", [-1.3, 0.7])
@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        (se.tan(X + se.pi / 2), lambda x: -1 / math.tan(x)),
        (se.atan2(X, X), lambda x: math.atan2(x, x)),
        (se.atan2(-2 * X, X), lambda x: math.atan2(-2 * x, x)),
        (se.sign(X), lambda x: math.copysign(1, x)),
        (se.sec(X) + se.csc(X), lambda x: 1 / math.cos(x) + 1 / math.sin(x)),
        (se.coth(X) + se.sech(X), lambda x: 1 / math.tanh(x) + 1 / math.cosh(x)),
        (se.csch(X), lambda x: 1 / math.sinh(x)),
    ],
)
def test_functions_that_symengine_brings_in(
    expression: se.Basic, expected: Callable[[float], float], x: float
) -> None:
    assert value(expression, x) == pytest.approx(expected(x), rel=1e-14)
    assert batch(expression, (x, 0, 0))[0] == pytest.approx(expected(x), rel=1e-14)


def test_sign_of_zero_and_of_nothing() -> None:
    assert value(se.sign(X), 0.0) == 0.0
    assert math.isnan(value(se.sign(X), math.nan))


def test_branch_that_is_not_taken_may_be_undefined() -> None:
    expression = cases(se.Gt(X, 0), se.log(X) + se.sqrt(X), 1 / (X - 1))
    for x, expected in ((2.0, math.log(2) + math.sqrt(2)), (-1.0, -0.5)):
        assert value(expression, x) == pytest.approx(expected, rel=1e-15)
        assert batch(expression, (x, 0, 0))[0] == pytest.approx(expected, rel=1e-15)


def test_cases_without_a_match_are_undefined() -> None:
    expression = se.Piecewise((X, se.Lt(X, 1)), (2 * X, se.Lt(X, 2)))
    assert [value(expression, x) for x in (0.5, 1.5)] == [0.5, 3.0]
    assert math.isnan(value(expression, 2.5))


@pytest.mark.parametrize("x", [0.0, 1.0, 2.0])
def test_truth_and_numbers_do_not_mix(x: float) -> None:
    # the truth value 1 and the number 1 are different keys
    condition = se.Or(se.Eq(X, 1), se.And(se.Gt(X, 1), se.Ne(Y, 1)))
    expression = cases(condition, se.Integer(1), se.Integer(0)) + X
    assert value(expression, x) == x + (x >= 1)
    assert batch(expression, (x, 0, 0))[0] == x + (x >= 1)
    assert value(se.true) == 1.0
    assert value(se.false) == 0.0
    assert value(se.Integer(1)) == 1.0


# expressions that differ only in names


def members(n: int, terms: bool) -> tuple[list[se.Basic], list[se.Basic], list[se.Basic]]:
    """Return expressions of bodies and their neighbours, a long sum, variables and parameters."""
    x, m = se.symbols([f"x[{i}]" for i in range(n)]), se.symbols([f"m[{i}]" for i in range(n)])
    found: list[se.Basic] = []
    for i in range(1, n):
        bend = (x[i] - x[i - 1]) ** 2 / m[i - 1] + se.sin(m[i] * x[i])
        found += [bend, se.sqrt(1 + bend**2), -x[i], m[i] * x[i], 2 * m[i], se.Integer(i)]
    return [*found, *([se.Add(*found)] if terms else [])], x, m


@pytest.mark.parametrize("terms", [False, True])
def test_expressions_that_differ_only_in_names_have_the_values_of_single_ones(
    terms: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    expressions, x, m = members(30, terms)
    single = compile_tape(expressions, x, m)
    monkeypatch.setattr(compiler, "_MANY", 1)
    alike = compile_tape(expressions, x, m)
    assert len(alike.code) == pytest.approx(len(single.code), rel=0.02)
    given = [math.sin(1 + k) + 1.5 for k in range(len(x) + len(m))]
    assert ScalarTape(alike)(given) == pytest.approx(ScalarTape(single)(given), rel=1e-13)


def test_templates_distinguish_variables_from_parameters() -> None:
    x, m, y = se.symbols("x m y")
    rest = [se.sin(k * x) for k in range(600)]
    tape = compile_tape([x * y, x * m, m * x, se.exp(m), se.exp(x), *rest], [x, y], [m])
    assert ScalarTape(tape)([2.0, 3.0, 5.0])[:5] == [6, 10, 10, math.exp(5), math.exp(2)]


def test_an_unknown_name_among_many_expressions_is_reported() -> None:
    x, z = se.symbols("x z")
    with pytest.raises(KeyError, match="z"):
        compile_tape([*(se.sin(k * x) for k in range(600)), x + z], [x])
