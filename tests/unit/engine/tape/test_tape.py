"""Tapes: what an expression is on a tape, and that both interpreters run it right."""

from __future__ import annotations

import math
import operator
import time
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import symengine as se
from hypothesis import example, given, settings
from hypothesis import strategies as st

from lagcli.engine.tape.compiler import compile_tape
from lagcli.engine.tape.interpreter import ScalarTape, run_arrays
from lagcli.engine.tape.operations import ARITY, Op
from lagcli.engine.tape.tape import Tape
from lagcli.model.expression.constants import cases, relation
from lagcli.model.expression.functions import FUNCTIONS

try:
    from lagcli.engine.core import binding
except ImportError:
    binding = None

X, Y, Z = VARIABLES = se.symbols("x y z")

#: Two ways to evaluate an expression round differently at every operation; a few dozen operations
#: that do not cancel stay within this.
CLOSE = 1e-11


def value(expression: se.Basic, *point: float) -> float:
    """Evaluate by a tape, one state at a time: by Python and by the compiled engine, alike."""
    inputs = (*point, *[0.0] * (3 - len(point)))
    # which inputs stay the same along a run decides the order of the operations
    tapes = [compile_tape([expression], VARIABLES[: 3 - k], VARIABLES[3 - k :]) for k in (0, 2)]
    found = [ScalarTape(tape)(inputs)[0] for tape in tapes]
    if binding is not None:
        for tape, expected in zip(tapes, found, strict=True):
            np.testing.assert_array_equal(binding.run_tape(tape, inputs), [expected])
    return found[0]


def batch(expression: se.Basic, *points: tuple[float, float, float]) -> np.ndarray:
    """Evaluate by a tape, all states at once."""
    columns = np.array(points, dtype=float).T
    return run_arrays(compile_tape([expression], VARIABLES), columns, len(points))[0]


def count(*expressions: se.Basic) -> dict[Op, int]:
    """Return how often each operation occurs."""
    found: dict[Op, int] = {}
    for op, *_ in compile_tape(expressions, VARIABLES).code:
        found[Op(op)] = found.get(Op(op), 0) + 1
    return found


# random expressions, evaluated by SymEngine's own arithmetic (MPFR, 200 bits)

NUMBERS = st.fractions(-5, 5, max_denominator=12).map(lambda f: se.Rational(*f.as_integer_ratio()))
EXPONENTS = st.sampled_from([2, 3, -1, -2, 7, (1, 2), (-1, 2), (3, 2), (-5, 2), (1, 3), (-7, 5)])


def power(base: se.Basic, exponent: int | tuple[int, int]) -> se.Basic:
    return base ** (se.Integer(exponent) if isinstance(exponent, int) else se.Rational(*exponent))


def applied(name: str, *arguments: se.Basic) -> se.Basic:
    function = FUNCTIONS[name]
    most = len(arguments) if function.most is None else function.most
    return function.apply(*arguments[: max(function.fewest, most)])


def either(a: se.Basic, b: se.Basic, c: se.Basic, d: se.Basic) -> se.Basic:
    return cases(se.And(relation("<", a, b), se.Not(relation(">=", c, d))), a * b, c - d)


def any_of(a: se.Basic, b: se.Basic, c: se.Basic, d: se.Basic) -> se.Basic:
    return cases(se.Or(relation("<=", a, b), relation("!=", c, d)), a, d)


def made(function: Callable[..., se.Basic], arguments: Sequence[Any]) -> se.Basic:
    """Return an expression; where numbers folded to none (1/0 < x), a plain one."""
    try:
        return function(*arguments)
    except (RuntimeError, ValueError):  # the loader reports both
        return X + Y


def compound(inner: st.SearchStrategy) -> st.SearchStrategy:
    two = st.lists(inner, min_size=2, max_size=2)
    some = st.lists(inner, min_size=2, max_size=3)
    four = st.lists(inner, min_size=4, max_size=4)
    return st.one_of(
        *(st.builds(made, st.just(f), some) for f in (se.Add, se.Mul)),
        st.builds(made, st.just(operator.sub), two),
        st.builds(made, st.just(power), st.tuples(inner, EXPONENTS)),
        st.builds(
            lambda name, xs: made(applied, [name, *xs]), st.sampled_from(sorted(FUNCTIONS)), some
        ),
        *(st.builds(made, st.just(f), four) for f in (either, any_of)),
    )


EXPRESSIONS = st.recursive(
    st.one_of(st.sampled_from(VARIABLES), NUMBERS, st.just(se.pi)), compound, max_leaves=8
)
POINTS = st.tuples(*[st.integers(-40, 40).map(lambda k: (k + 0.5) / 16)] * 3)


def exactly(expression: se.Basic, point: tuple[float, ...]) -> float:
    """Evaluate by substitution of exact numbers; NaN where that is not a real number."""
    values = {
        s: se.Rational(*Fraction(x).as_integer_ratio())
        for s, x in zip(VARIABLES, point, strict=True)
    }
    try:
        return float(expression.subs(values).n(200, real=True))
    except RuntimeError:  # not a real number
        return math.nan


def shaken(expression: se.Basic, part: float) -> se.Basic:
    """Return an expression whose functions give values that are off by a part of them.

    Cases and conditions stay.
    """
    if (
        not expression.args
        or not hasattr(expression, "func")
        or isinstance(expression, se.Piecewise)
    ):
        return expression
    found = expression.func(*[shaken(x, part) for x in expression.args])
    return found * (1 + part) if isinstance(expression, se.Function) else found


@settings(max_examples=200, deadline=None)
@given(EXPRESSIONS, POINTS)
@example(se.acos(se.erf(se.Integer(5))), (1.0, 1.0, 1.0))  # erf(5) is next to 1
def test_random_expressions_against_symengine(
    expression: se.Basic, point: tuple[float, float, float]
) -> None:
    found = value(expression, *point)
    expected = exactly(expression, point)
    if not (math.isfinite(expected) and math.isfinite(found)):
        return  # what is undefined is the subject of tests of its own
    # a value at a jump may fall on either side, and differences of large terms lose digits:
    # the reach of rounding is seen by moving the point, and the values of functions, by rounding
    near = [value(expression, *(x * (1 + s * 2e-16) for x in point)) for s in (-1, 1)]
    near += [value(shaken(expression, s * 2.3e-16), *point) for s in (-1, 1)]
    wobble = max(abs(found - x) for x in near)
    if not wobble < 1e-6 * (1 + abs(found)):
        return
    assert found == pytest.approx(expected, rel=CLOSE, abs=CLOSE + 1e5 * wobble)


@settings(max_examples=200, deadline=None)
@given(EXPRESSIONS, st.lists(POINTS, min_size=1, max_size=4))
def test_interpreters_agree(expression: se.Basic, points: list[tuple[float, ...]]) -> None:
    many = batch(expression, *points)
    for found, point in zip(many, points, strict=True):
        one = value(expression, *point)
        near = [value(expression, *(x * (1 + s * 2e-16) for x in point)) for s in (-1, 1)]
        wobble = max(abs(one - x) for x in near)
        if math.isfinite(one) and wobble < 1e-6 * (1 + abs(one)):
            # libm and NumPy differ in the last digit of a function
            assert found == pytest.approx(one, rel=CLOSE, abs=CLOSE + 1e5 * wobble)
        elif not math.isfinite(one) and not any(map(math.isfinite, near)):
            assert not math.isfinite(found)


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


def test_unknown_symbol_is_refused() -> None:
    with pytest.raises(KeyError, match="w"):
        compile_tape([se.Symbol("w") + 1], VARIABLES)


@settings(max_examples=300)
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
    terms = [se.Rational(k, 7) * se.sin(k * X) for k in range(1, 20001)]
    x = 0.37
    expected = math.fsum(k / 7 * math.sin(k * x) for k in range(1, 20001))
    size = sum(k / 7 for k in range(1, 20001))
    # 20000 additions, each rounded
    assert value(se.Add(*terms), x) == pytest.approx(expected, abs=1e-12 * size)


def test_deep_nesting_needs_no_recursion() -> None:
    expression, expected = X, 0.5
    for k in range(5000):
        expression = se.sin(expression + 1) if k % 2 else se.cos(expression)
        expected = math.sin(expected + 1) if k % 2 else math.cos(expected)
    assert value(expression, 0.5) == pytest.approx(expected, rel=1e-12)


def test_time_grows_like_the_size() -> None:
    def seconds(n: int) -> float:
        total = se.Add(*[se.sin(k * X) * se.cos(k * Y) for k in range(1, n)])
        began = time.perf_counter()
        compile_tape([total], VARIABLES)
        return time.perf_counter() - began

    small = min(seconds(500) for _ in range(3))
    large = min(seconds(4000) for _ in range(2))
    # eight times as long; square growth would be sixty-four
    assert large < 24 * small


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


def test_tape_is_data() -> None:
    # written by hand: (x + 2) y
    tape = Tape(2, (2.0,), ((Op.ADD, 3, 0, 2, 0), (Op.MUL, 4, 3, 1, 0)), (4, 0))
    assert ScalarTape(tape)((3.0, 4.0)) == [20.0, 3.0]
    np.testing.assert_array_equal(
        run_arrays(tape, (np.array([3.0, 1.0]), 4.0), 2), [[20.0, 12.0], [3.0, 1.0]]
    )
