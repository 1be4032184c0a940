"""The records of functions: each states what the outputs, dimensions and derivatives need."""

from __future__ import annotations

import math
import subprocess
import sys
from fractions import Fraction

import mpmath
import pytest
import symengine as se

from lagcli.functions import FUNCTIONS, OPERATIONS, DimensionRule, Function
from lagcli.model.expression.functions import apply, derivative

X, Y = se.symbols("x y")
RULES = sorted(
    name for name, f in OPERATIONS.items() if f.operation and f.operation.slope and not f.opaque
)
OPAQUE = sorted(name for name, f in FUNCTIONS.items() if f.opaque)


@pytest.mark.parametrize("name", RULES)
def test_rules_of_derivatives_are_those_of_symengine(name: str) -> None:
    function = apply(name.lower(), X)
    operation = OPERATIONS[name].operation
    assert operation is not None
    assert operation.slope is not None
    rule = operation.slope(se, X, function)
    at = 1.3 if operation.domain.low >= 1.0 else 0.3
    values = [float(e.subs({X: at}).n(53, real=True)) for e in (rule, function.diff(X))]
    assert values[0] == pytest.approx(values[1], rel=1e-14)


@pytest.mark.parametrize("name", OPAQUE)
@pytest.mark.parametrize("at", [0.3, 1e-9])
def test_opaque_functions_and_their_rules(name: str, at: float) -> None:
    operation = FUNCTIONS[name].operation
    assert operation is not None
    assert operation.slope is not None
    value = operation.scalar(at)
    assert value == pytest.approx(float(getattr(mpmath, name)(at)), rel=1e-15)
    slope = float(mpmath.diff(getattr(mpmath, name), at))
    assert operation.slope(math, at, value) == pytest.approx(slope, rel=1e-15)


@pytest.mark.parametrize("name", sorted(OPERATIONS))
def test_ends_of_domains_are_where_values_end(name: str) -> None:
    operation = OPERATIONS[name].operation
    assert operation is not None
    low, high, is_open, _ = operation.domain
    for bound, outwards in ((low, -1), (high, 1)):
        if not math.isfinite(bound):
            continue
        assert math.isfinite(operation.scalar(bound - outwards * 1e-3))
        for x in [bound + outwards * 1e-3, *[bound] * is_open]:
            with pytest.raises(ValueError, match=r"math domain error|expected"):
                operation.scalar(x)


def test_a_function_cannot_be_without_a_rule_of_dimensions() -> None:
    with pytest.raises(TypeError, match="dimension"):
        Function()  # type: ignore[call-arg]
    assert all(isinstance(f.dimension, DimensionRule | Fraction) for f in FUNCTIONS.values())


def test_functions_without_a_symbol_have_an_expression_or_an_operation() -> None:
    assert all(f.symbol or f.expression or f.operation for f in FUNCTIONS.values())
    # opaque ones are differentiated by their rule
    assert all(f.operation and f.operation.slope for f in FUNCTIONS.values() if f.opaque)


def test_aliases_are_no_functions() -> None:
    aliases = [alias for f in FUNCTIONS.values() for alias in f.aliases]
    assert not FUNCTIONS.keys() & aliases
    assert len(set(aliases)) == len(aliases)


def test_derivatives_of_expressions_of_functions() -> None:
    for name in ("abs", "min"):
        value = derivative(apply(name, *(X, Y)[: FUNCTIONS[name].fewest]), X)
        assert value.subs({X: -0.5, Y: 2.0}) == (-1 if name == "abs" else 1)


@pytest.mark.parametrize(
    ("function", "at", "slopes"),
    [
        # d/dx atan2(1 + cos x, sin x) = -1/2
        (apply("atan2", 1 + se.cos(X), se.sin(X)), 0.0, (-0.5, 0.0)),
        ((3 * X) ** Y, 0.0, (0.0, 18.0)),
        ((X**2) ** (Y - 1), 0.0, (0.0, 2.0)),
        ((X / Y) ** Y, 1.0, (0.5, 0.5)),
        ((X * Y) ** (2 * X), 0.5, (2.0, 8.0)),
    ],
)
def test_derivatives_do_not_divide_by_factors_of_arguments(
    function: se.Basic, at: float, slopes: tuple[float, float]
) -> None:
    first = derivative(function, X)
    values = [float(x.subs({X: at, Y: 2})) for x in (first, derivative(first, X))]
    assert values == pytest.approx(slopes, abs=1e-14)


NEW = '''
import math
from lagcli import functions as f

record = f.Function(
    f.DimensionRule.NUMBER,
    operation=f.Operation(
        "1.0 / (1.0 + exp(-A))",
        lambda a: 1.0 / (1.0 + math.exp(-a)),
        "scipy.special.expit",
        lambda f, x, y: y * (1 - y),
        "increasing",
    ),
    spelling=f.Spelling(r"\\sigma"),
)
f.FUNCTIONS["logistic"] = f.OPERATIONS["LOGISTIC"] = record

import symengine as se
import lagcli
from lagcli.engine.core.headers import headers
from lagcli.errors import LagcliError
from lagcli.engine.lowering.compiler import compile_tape
from lagcli.engine.tape.differentiation import directional
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.equations.render import render
from lagcli.model.expression.constants import number
from lagcli.model.expression.functions import apply, derivative

text = """
coordinates: [x]
parameters: {m: {value: 1, unit: kg}, k: {value: 2, unit: J}}
T: m/2*x'^2
V: k*logistic(3*x)
initial: {x: 0, x': 0}
"""
equations = lagcli.derive(lagcli.load_text(text))
assert "logistic(3 x)" in render(equations), render(equations)
assert r"\\sigma" in render(equations, "latex")

x = se.Symbol("x")
value = apply("logistic", 3 * apply("logistic", x))
inner = 1 / (1 + math.exp(-0.4))
outer = 1 / (1 + math.exp(-3 * inner))
slope = 3 * outer * (1 - outer) * inner * (1 - inner)
assert abs(number(value.subs({x: 0.4})) - outer) < 1e-15
assert abs(number(derivative(value, x).subs({x: 0.4})) - slope) < 1e-15
tape = compile_tape([value, derivative(value, x)], (x,))
assert max(abs(a - b) for a, b in zip(ScalarTape(tape)([0.4]), (outer, slope))) < 1e-15
assert abs(ScalarTape(directional(tape))([0.4, 1.0])[0] - slope) < 1e-15

tables = headers()["tables.h"]
assert "X(OP_LOGISTIC, 2, 1.0 / (1.0 + exp(-A)))" in tables
assert "increasing, -INFINITY, INFINITY, mul(C, sub(constant(1), C, n), n))" in tables
try:
    lagcli.load_text(text.replace("[x]", "{x: {unit: m}}"))
except LagcliError as error:
    assert "the argument of `logistic` must be a number or an angle" in str(error), error
else:
    raise AssertionError("an argument in metres is accepted")
'''


def test_a_function_is_one_record() -> None:
    # in a process of its own: operations are numbered when they are imported
    run = subprocess.run([sys.executable, "-c", NEW], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
