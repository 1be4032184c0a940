"""Jumps of functions of the state, looked for where their branches change."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator, Mapping
from itertools import pairwise

import symengine as se
from symengine import Basic

from lagcli.model.expression.functions import KINKS, kinks_of, parts_of
from lagcli.model.model import as_symbols

_RELATIONS = (se.StrictLessThan, se.LessThan, se.Equality, se.Unequality)
#: Numbers of random points, and of intervals of the lines through them, in which branches may end.
_POINTS, _INTERVALS = 3, 24
#: Number of symbols of a boundary along which there are lines: one crosses it nearly everywhere.
_SYMBOLS = 2
#: Half the length of the lines.
_REACH = 3.0
#: Distances from the end of a branch: one where the function has its size, and two; a continuous
#: function changes less over the smaller one.
_FAR, _NEAR, _NEARER = 0.1, 1e-7, 1e-10
#: Changes below this part of the function's size are rounding errors.
_ROUNDING = 1e-12
_BISECTIONS = 60


def jumps(expression: Basic, parameters: Mapping[str, float]) -> bool:
    """Whether a function of the state is found to jump where one of its branches ends.

    Its values on both sides are compared on lines along the symbols, through some random points.
    The derivatives do not show jumps: that of ``floor(t)`` is zero.

    Parameters
    ----------
    expression : Basic
        Function of t, q, v, the inputs and the parameters.
    parameters : mapping of str to float
    """
    if not any(isinstance(x, KINKS) for x in kinks_of(expression)):
        return False
    values = {se.Symbol(n): se.RealDouble(x) for n, x in parameters.items()}
    expression = as_symbols(expression).xreplace(values)
    moving = sorted(expression.free_symbols, key=str)
    for boundary in set(_boundaries(expression)):
        chance = random.Random(1)
        for symbol in [x for x in moving if x in boundary.free_symbols][:_SYMBOLS]:
            for _ in range(_POINTS):
                point = {x: se.RealDouble(chance.uniform(-1.5, 1.5)) for x in moving}
                del point[symbol]
                if _jumps_along(expression.xreplace(point), boundary.xreplace(point), symbol):
                    return True
    return False


def _boundaries(expression: Basic) -> Iterator[Basic]:
    """Yield functions that change their sign where branches of the expression change."""
    for kink in kinks_of(expression):
        if isinstance(kink, se.Piecewise):
            for condition in kink.args[1::2]:
                for relation in {condition, *parts_of(condition, *_RELATIONS)}:
                    if isinstance(relation, _RELATIONS):
                        yield relation.args[0] - relation.args[1]
        elif isinstance(kink, KINKS):
            yield se.sin(se.pi * kink.args[0])


def _jumps_along(expression: Basic, boundary: Basic, symbol: Basic) -> bool:
    """Whether a function of one symbol jumps where another one changes its sign."""
    for low, high in _brackets(boundary, symbol):
        place = _end(boundary, symbol, low, high)
        beside = [
            (_value(expression, symbol, place - d), _value(expression, symbol, place + d))
            for d in (x * max(1.0, abs(place)) for x in (_FAR, _NEAR, _NEARER))
        ]
        size = max(map(abs, beside[0]))
        _, near, nearer = (abs(after - before) for before, after in beside)
        if nearer > 0.5 * near and nearer > _ROUNDING * size:
            return True
    return False


def _brackets(function: Basic, symbol: Basic) -> Iterator[tuple[float, float]]:
    """Yield intervals in which a function changes its sign: near 0, and of linear ones anywhere."""
    ends = [_REACH * (2 * i / _INTERVALS - 1) + 0.01 for i in range(_INTERVALS + 1)]
    intervals = list(pairwise(ends))
    first, second = (_value(function, symbol, x) for x in (0.0, 1.0))
    if first != second:
        root = first / (first - second)
        intervals.append((root - 0.1 * max(1.0, abs(root)), root + 0.1 * max(1.0, abs(root))))
    for low, high in intervals:
        if _value(function, symbol, low) * _value(function, symbol, high) < 0:
            yield low, high


def _end(function: Basic, symbol: Basic, low: float, high: float) -> float:
    """Return where a function changes its sign, by bisection."""
    at_low = _value(function, symbol, low)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        if _value(function, symbol, middle) * at_low > 0:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def _value(expression: Basic, symbol: Basic, x: float) -> float:
    """Return a function's value, or NaN."""
    value = expression.xreplace({symbol: se.RealDouble(x)})
    try:
        return float(value.n(53, real=True))
    except (AttributeError, RuntimeError, TypeError, ValueError):
        return math.nan
