"""The scalar functions of the grammar, as SymEngine expressions.

A function that SymEngine cannot differentiate (abs, sign, min, max, step) is written as cases, so
that its derivative is right wherever it exists.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import symengine as se
from symengine import Basic


@dataclass(frozen=True)
class Function:
    """A scalar function: how many arguments it takes and what it makes of them."""

    fewest: int
    most: int | None
    apply: Callable[..., Basic]


def cases(condition: Basic, when_true: Basic, when_false: Basic) -> Basic:
    """Return ``when_true`` where the condition holds, else ``when_false``."""
    if condition == se.true:
        return when_true
    if condition == se.false:
        return when_false
    return se.Piecewise((when_true, condition), (when_false, se.true))


def _abs(x: Basic) -> Basic:
    return cases(se.Ge(x, 0), x, -x)


def _sign(x: Basic) -> Basic:
    return cases(se.Gt(x, 0), se.Integer(1), cases(se.Lt(x, 0), se.Integer(-1), se.Integer(0)))


def _min(*xs: Basic) -> Basic:
    least = xs[0]
    for x in xs[1:]:
        least = cases(se.Le(least, x), least, x)
    return least


def _max(*xs: Basic) -> Basic:
    most = xs[0]
    for x in xs[1:]:
        most = cases(se.Ge(most, x), most, x)
    return most


def _step(x: Basic) -> Basic:
    return cases(se.Ge(x, 0), se.Integer(1), se.Integer(0))


def _log(x: Basic, base: Basic | None = None) -> Basic:
    return se.log(x) if base is None else se.log(x) / se.log(base)


def _log10(x: Basic) -> Basic:
    return se.log(x) / se.log(se.Integer(10))


def _log2(x: Basic) -> Basic:
    return se.log(x) / se.log(se.Integer(2))


def _cbrt(x: Basic) -> Basic:
    third = se.Rational(1, 3)
    return cases(se.Ge(x, 0), x**third, -((-x) ** third))


def _hypot(*xs: Basic) -> Basic:
    return se.sqrt(se.Add(*[x**2 for x in xs]))


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
    "floor": se.floor,
    "ceil": se.ceiling,
    "erf": se.erf,
    "erfc": se.erfc,
    "degrees": lambda x: x * 180 / se.pi,
    "radians": lambda x: x * se.pi / 180,
}

FUNCTIONS: dict[str, Function] = {
    **{name: Function(1, 1, apply) for name, apply in _ONE_ARGUMENT.items()},
    "log": Function(1, 2, _log),
    "atan2": Function(2, 2, se.atan2),
    "pow": Function(2, 2, lambda x, y: x**y),
    "hypot": Function(1, None, _hypot),
    "min": Function(1, None, _min),
    "max": Function(1, None, _max),
}
