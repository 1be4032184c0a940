"""Scalar functions of the expression language as SymEngine expressions.

Functions that SymEngine cannot differentiate (abs, sign, min, max, step) become piecewise
expressions, so that their derivatives are correct wherever they exist.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import symengine as se
from symengine import Basic

from lagcli.model.expression.constants import cases, number, relation, whole

ZERO = se.Integer(0)


def _once(_: int) -> int:
    return 1


class Function(NamedTuple):
    """A scalar function: its arity and its SymEngine expression.

    ``copies`` returns how often the result repeats each argument, given their number; ``smooth`` is
    False for piecewise expressions and functions with jumps.
    """

    fewest: int
    most: int | None
    apply: Callable[..., Basic]
    copies: Callable[[int], int] = _once
    smooth: bool = True


def _abs(x: Basic) -> Basic:
    return cases(relation(">=", x, ZERO), x, -x)


def _sign(x: Basic) -> Basic:
    below = cases(relation("<", x, ZERO), se.Integer(-1), ZERO)
    return cases(relation(">", x, ZERO), se.Integer(1), below)


def _min(*xs: Basic) -> Basic:
    return _chosen("<=", xs)


def _max(*xs: Basic) -> Basic:
    return _chosen(">=", xs)


def _chosen(sign: str, xs: Sequence[Basic]) -> Basic:
    """Return the minimum or maximum by bisection: each level of cases repeats its arguments."""
    if len(xs) == 1:
        return xs[0]
    half = len(xs) // 2
    left, right = _chosen(sign, xs[:half]), _chosen(sign, xs[half:])
    return cases(relation(sign, left, right), left, right)


def _copies_in_halves(count: int) -> int:
    return int(2 ** (count - 1).bit_length())


def _step(x: Basic) -> Basic:
    return cases(relation(">=", x, ZERO), se.Integer(1), ZERO)


def _log(x: Basic, base: Basic | None = None) -> Basic:
    return se.log(x) if base is None else se.log(x) / se.log(base)


def _log10(x: Basic) -> Basic:
    return se.log(x) / se.log(se.Integer(10))


def _log2(x: Basic) -> Basic:
    return se.log(x) / se.log(se.Integer(2))


def _cbrt(x: Basic) -> Basic:
    third = se.Rational(1, 3)
    if x.free_symbols:
        return cases(relation(">=", x, ZERO), x**third, -((-x) ** third))
    return x**third if number(x) >= 0 else -((-x) ** third)


def _hypot(*xs: Basic) -> Basic:
    return se.sqrt(se.Add(*[x**2 for x in xs]))


def _floor(x: Basic) -> Basic:
    return se.floor(x) if x.free_symbols else whole(math.floor, x)


def _ceil(x: Basic) -> Basic:
    return se.ceiling(x) if x.free_symbols else whole(math.ceil, x)


_ONE_ARGUMENT: dict[str, Callable[..., Basic]] = {
    "sin": se.sin,
    "cos": se.cos,
    "tan": se.tan,
    "asin": se.asin,
    "acos": se.acos,
    "atan": se.atan,
    "sinh": se.sinh,
    "cosh": se.cosh,
    "tanh": se.tanh,
    "asinh": se.asinh,
    "acosh": se.acosh,
    "atanh": se.atanh,
    "exp": se.exp,
    "exp2": lambda x: se.Integer(2) ** x,
    "expm1": lambda x: se.exp(x) - 1,
    "log10": _log10,
    "log2": _log2,
    "log1p": lambda x: se.log(1 + x),
    "sqrt": se.sqrt,
    "cbrt": _cbrt,
    "abs": _abs,
    "fabs": _abs,
    "sign": _sign,
    "step": _step,
    "floor": _floor,
    "ceil": _ceil,
    "erf": se.erf,
    "erfc": se.erfc,
    "degrees": lambda x: x * 180 / se.pi,
    "radians": lambda x: x * se.pi / 180,
}

_REPEATING: dict[str, Callable[[int], int]] = {
    **dict.fromkeys(["abs", "fabs", "cbrt"], lambda _: 3),
    "sign": lambda _: 2,
}

_NOT_SMOOTH = {"abs", "fabs", "cbrt", "sign", "step", "floor", "ceil"}

FUNCTIONS: dict[str, Function] = {
    **{
        name: Function(1, 1, apply, _REPEATING.get(name, _once), name not in _NOT_SMOOTH)
        for name, apply in _ONE_ARGUMENT.items()
    },
    "log": Function(1, 2, _log),
    "atan2": Function(2, 2, se.atan2, smooth=False),  # atan2(x, x) is written with sign(x)
    "pow": Function(2, 2, lambda x, y: x**y),
    "hypot": Function(1, None, _hypot),
    "min": Function(1, None, _min, _copies_in_halves, smooth=False),
    "max": Function(1, None, _max, _copies_in_halves, smooth=False),
}


_JUMPS = (se.floor, se.ceiling, se.sign)
KINKS = (se.Piecewise, *_JUMPS)


def derivative(expression: Basic, symbol: Basic) -> Basic:
    """Return ∂expression/∂symbol.

    SymEngine leaves derivatives of jumps unevaluated, and keeps piecewise derivatives even if they
    are zero in every case. Here the derivative of a jump is zero, as it is wherever it exists, and
    piecewise expressions are differentiated case by case.
    """
    return _chain_rule(expression, symbol, {})


def _chain_rule(expression: Basic, symbol: Basic, known: dict[Basic, Basic]) -> Basic:
    """Differentiate by the chain rule, with a symbol for each piecewise part."""
    kinks = expression.atoms(*KINKS)
    if not kinks:
        return expression.diff(symbol)
    held = {kink: se.Symbol(f"\ufdd0{i}") for i, kink in enumerate(kinks)}
    rest = expression.xreplace(held)
    outermost = rest.free_symbols
    slopes = [rest.diff(symbol)]
    for kink, name in held.items():
        if name not in outermost:
            continue
        if kink not in known:
            known[kink] = _slope(kink, symbol, known)
        if known[kink] != ZERO:
            slopes.append(rest.diff(name) * known[kink])
    return se.Add(*slopes).xreplace({name: kink for kink, name in held.items()})


def _slope(kink: Basic, symbol: Basic, known: dict[Basic, Basic]) -> Basic:
    if isinstance(kink, _JUMPS) or symbol not in kink.free_symbols:
        return ZERO
    values = [_chain_rule(value, symbol, known) for value in kink.args[0::2]]
    return pieces(values, kink.args[1::2])


def pieces(values: Sequence[Basic], conditions: Sequence[Basic]) -> Basic:
    """Return a piecewise expression, or its value if all cases agree."""
    if all(value == values[0] for value in values[1:]):
        return values[0]
    return se.Piecewise(*zip(values, conditions, strict=True))
