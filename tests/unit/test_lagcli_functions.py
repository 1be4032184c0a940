"""The records of functions: each states what the outputs, dimensions and derivatives need."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest
import symengine as se

from lagcli.functions import FUNCTIONS, OPERATIONS, DimensionRule, Function
from lagcli.model.expression.functions import apply, derivative

X, Y = se.symbols("x y")
RULES = sorted(name for name, f in OPERATIONS.items() if f.operation and f.operation.slope)


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
