"""Evaluation and comparison of constant expressions.

SymEngine computes with complex numbers and infinities, cannot compare irrational constants, and
crashes on the floor of an infinity. Therefore every constant is checked as soon as it is built.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from fractions import Fraction

import symengine as se
from symengine import Basic

from lagcli.functions import FUNCTIONS

_LARGEST_BITS = 1024  # of a double

_RELATIONS: dict[str, Callable[[Basic, Basic], Basic]] = {
    "<": se.Lt,
    "<=": se.Le,
    ">": se.Gt,
    ">=": se.Ge,
    "==": se.Eq,
    "!=": se.Ne,
}
_OF_FLOATS: dict[str, Callable[[float, float], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
}


def number(expression: Basic) -> float:
    """Return the value of a constant expression.

    Raises
    ------
    ValueError
        It has no real, finite value.
    """
    try:
        if isinstance(expression, se.Rational):  # SymEngine truncates, Python rounds
            numerator, denominator = map(int, expression.get_num_den())
            return numerator / denominator
        value = float(_evaluated(expression).n(53, real=True))
    except (RuntimeError, OverflowError):  # SymEngine's error messages for complex results
        value = math.nan
    if not math.isfinite(value):
        raise ValueError("not a real, finite number")
    return value


def _evaluated(expression: Basic) -> Basic:
    """Return a constant with the values of functions that SymEngine does not know."""
    values = {}
    for call in expression.atoms(se.FunctionSymbol):
        function = FUNCTIONS.get(call.get_name())
        if function is not None and function.operation is not None:
            values[call] = se.RealDouble(function.operation.scalar(*map(number, call.args)))
    return expression.xreplace(values) if values else expression


def fault(value: Basic) -> str | None:
    """Return why a constant is not representable as a double, or None."""
    too_large = "is infinite or exceeds the largest number, 1.8e308"
    if isinstance(value, se.Rational):
        p, q = value.get_num_den()
        large = int(p).bit_length() - int(q).bit_length() > _LARGEST_BITS
        return too_large if large else None
    if value in (se.zoo, se.oo, -se.oo):
        return too_large
    try:
        result = float(_evaluated(value).n(53, real=True))
    except OverflowError:
        return too_large
    except RuntimeError:
        result = math.nan
    if math.isfinite(result):
        return None
    return too_large if math.isinf(result) else "is not a real number"


_ROUNDING = 1e-13  # distance to an integer below which a constant may be that integer
_BITS = 300  # precision to distinguish the two
_SAME = 1e-60  # agreement to so many bits counts as equality


def whole(function: Callable[[float | Fraction], int], constant: Basic) -> Basic:
    """Return ``math.floor`` or ``math.ceil`` of a constant as an integer.

    Raises
    ------
    ValueError
        The constant has no real, finite value.
    """
    if isinstance(constant, se.Rational):
        return se.Integer(function(Fraction(*map(int, constant.get_num_den()))))
    value = number(constant)
    near = round(value)
    exact = not isinstance(constant, se.RealDouble) and abs(value) < 2**53
    if not exact or abs(value - near) > _ROUNDING * max(1.0, abs(value)):
        return se.Integer(function(value))
    try:
        apart = float((constant - near).n(_BITS, real=True))
    except (RuntimeError, ValueError):  # SymEngine without MPFR
        apart = 0.0
    return se.Integer(near if abs(apart) < _SAME else near + function(math.copysign(0.5, apart)))


def relation(sign: str, left: Basic, right: Basic) -> Basic:
    """Return ``left sign right``, decided if both are constants."""
    exact = isinstance(left, se.Rational) and isinstance(right, se.Rational)
    if exact or left.free_symbols or right.free_symbols:
        return _RELATIONS[sign](left, right)
    try:
        holds = _OF_FLOATS[sign](number(left), number(right))
    except ValueError:  # an invalid constant is reported at its own location
        return _RELATIONS[sign](left, right)
    return se.true if holds else se.false


def cases(condition: Basic, when_true: Basic, when_false: Basic) -> Basic:
    """Return ``when_true`` if the condition holds, else ``when_false``."""
    if condition == se.true:
        return when_true
    if condition == se.false or when_true == when_false:
        return when_false
    return se.Piecewise((when_true, condition), (when_false, se.true))


def constant(value: float) -> Basic:
    """Return a number as an expression; integers are exact, so that x^n can be an integer power."""
    exact = value.is_integer() and abs(value) < 2**53
    return se.Integer(int(value)) if exact else se.RealDouble(value)
