"""Scalar functions of the expression language as SymEngine expressions, and their derivatives.

Functions that SymEngine cannot differentiate (abs, sign, min, max, step) become piecewise
expressions, so that their derivatives are correct wherever they exist.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import symengine as se
from symengine import Basic

from lagcli.functions import FUNCTIONS
from lagcli.model.expression.constants import cases, number, relation, whole

ZERO = se.Integer(0)


class _Symbolic:
    """What the expressions and derivatives of functions are made of: see `lagcli.functions`."""

    zero, one, pi = ZERO, se.Integer(1), se.pi
    cases, relation = staticmethod(cases), staticmethod(relation)

    def __getattr__(self, name: str) -> Any:
        return getattr(se, name)

    def floor(self, x: Basic) -> Basic:
        """Return ⌊x⌋."""
        return se.floor(x) if x.free_symbols else whole(math.floor, x)

    def ceiling(self, x: Basic) -> Basic:
        """Return ⌈x⌉."""
        return se.ceiling(x) if x.free_symbols else whole(math.ceil, x)


_SYMBOLIC = _Symbolic()
#: The names in the grammar of SymEngine's functions that have another name.
_NAMES = {f.symbol: name for name, f in FUNCTIONS.items() if f.symbol not in ("", name)}
_OPAQUE = {name for name, f in FUNCTIONS.items() if f.opaque}


def apply(name: str, *arguments: Basic) -> Basic:
    """Return a function of expressions.

    Raises
    ------
    ValueError
        The value of a constant is undefined.
    """
    function = FUNCTIONS[name]
    if function.expression is not None:
        return function.expression(_SYMBOLIC, *arguments)
    if function.symbol:
        return getattr(se, function.symbol)(*arguments)
    if any(x.free_symbols for x in arguments):
        return se.Function(name)(*arguments)
    assert function.operation is not None
    try:
        return se.RealDouble(function.operation.scalar(*map(number, arguments)))
    except OverflowError:
        return se.oo


def name_of_function(expression: Basic) -> str:
    """Return the name in the grammar of an expression's outermost function."""
    if isinstance(expression, se.FunctionSymbol):
        return str(expression.get_name())
    name = type(expression).__name__.lower()
    return _NAMES.get(name, name)


def is_opaque(expression: Basic) -> bool:
    """Return whether an expression is a function of the grammar that SymEngine does not know."""
    return isinstance(expression, se.FunctionSymbol) and expression.get_name() in _OPAQUE


_JUMPS = (se.floor, se.ceiling, se.sign)
KINKS = (se.Piecewise, *_JUMPS)


def derivative(expression: Basic, symbol: Basic) -> Basic:
    """Return ∂expression/∂symbol.

    SymEngine leaves derivatives of jumps unevaluated, and keeps piecewise derivatives even if they
    are zero in every case. Here the derivative of a jump is zero, as it is wherever it exists, and
    piecewise expressions are differentiated case by case. SymEngine's derivatives of
    ``atan2(y, x)`` and ``(x*y)**n`` divide by x, also where x = 0; those here do not.
    """
    return _chain_rule(expression, symbol, {})


def _chain_rule(expression: Basic, symbol: Basic, known: dict[Basic, Basic]) -> Basic:
    """Differentiate by the chain rule, with a symbol for each piecewise part."""
    parts = differentiated_apart(expression)
    if not parts:
        return expression.diff(symbol)
    held = {part: se.Symbol(f"\ufdd0{i}") for i, part in enumerate(parts)}
    rest = expression.xreplace(held)
    outermost = rest.free_symbols
    slopes = [rest.diff(symbol)]
    for part, name in held.items():
        if name not in outermost:
            continue
        if part not in known:
            known[part] = _slope(part, symbol, known)
        if known[part] != ZERO:
            slopes.append(rest.diff(name) * known[part])
    return se.Add(*slopes).xreplace({name: part for part, name in held.items()})


# one expression is differentiated with respect to several symbols
@lru_cache(maxsize=8)
def kinks_of(expression: Basic) -> frozenset[Basic]:
    """Return the parts that SymEngine does not differentiate."""
    return frozenset(x for x in differentiated_apart(expression) if not isinstance(x, _DIVIDED))


@lru_cache(maxsize=8)
def differentiated_apart(expression: Basic) -> frozenset[Basic]:
    """Return the parts that `derivative` differentiates by rules of its own."""
    found = parts_of(expression, *KINKS, se.FunctionSymbol, *_DIVIDED)
    return frozenset(x for x in found if isinstance(x, KINKS) or is_opaque(x) or _is_divided(x))


#: The kinds of parts whose derivatives by SymEngine may be quotients 0/0.
_DIVIDED = (se.atan2, se.Pow)


def _is_divided(expression: Basic) -> bool:
    """Whether SymEngine's derivative divides by a factor of an argument."""
    if isinstance(expression, se.Pow):
        base, exponent = expression.args
        return isinstance(base, (se.Mul, se.Pow)) and not isinstance(exponent, se.Number)
    return isinstance(expression, se.atan2)


def parts_of(expression: Basic, *kinds: type[Basic]) -> set[Basic]:
    """Return the parts of an expression that are of some kinds.

    Each part is visited once, however often it occurs; SymEngine's `atoms` visits it each time.
    """
    seen, left = {expression}, [expression]
    while left:
        # conditions of cases may be Python's True
        new = {x for x in getattr(left.pop(), "args", ()) if x not in seen}
        seen |= new
        left += new
    return {x for x in seen if isinstance(x, kinds)}


def _slope(part: Basic, symbol: Basic, known: dict[Basic, Basic]) -> Basic:
    if isinstance(part, _JUMPS) or symbol not in part.free_symbols:
        return ZERO
    if isinstance(part, se.atan2):
        y, x = part.args
        dy, dx = (_chain_rule(z, symbol, known) for z in (y, x))
        return (x * dy - y * dx) / (x**2 + y**2)
    if isinstance(part, se.Pow):
        base, exponent = part.args
        slope = exponent * base ** (exponent - 1) * _chain_rule(base, symbol, known)
        rate = _chain_rule(exponent, symbol, known)
        return slope + part * se.log(base) * rate if rate != ZERO else slope
    if isinstance(part, se.FunctionSymbol):
        (x,), operation = part.args, FUNCTIONS[part.get_name()].operation
        assert operation is not None
        assert operation.slope is not None
        return operation.slope(_SYMBOLIC, x, part) * _chain_rule(x, symbol, known)
    values = [_chain_rule(value, symbol, known) for value in part.args[0::2]]
    return pieces(values, part.args[1::2])


def pieces(values: Sequence[Basic], conditions: Sequence[Basic]) -> Basic:
    """Return a piecewise expression, or its value if all cases agree."""
    if all(value == values[0] for value in values[1:]):
        return values[0]
    return se.Piecewise(*zip(values, conditions, strict=True))
