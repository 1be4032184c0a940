"""What an expression is in some of its symbols: linear or not, zero or not."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence

import symengine as se
from symengine import Basic

from lagcli.model.constants import number

_LARGEST = 20_000  # terms of an expansion


def nonlinear_in(expression: Basic, rates: Sequence[Basic]) -> Basic | None:
    """Return a symbol in which the expression is not affine, or None.

    Only an expression that is affine after all, such as (v + 1)^2 − v^2, needs to be expanded; one
    that would take too many terms counts as not affine.
    """
    free = expression.free_symbols
    present = [v for v in rates if v in free]
    for v in present:
        slope = expression.diff(v)
        if not slope.free_symbols.isdisjoint(present):
            if count_terms(slope) > _LARGEST:
                return v
            left = se.expand(slope).free_symbols
            for w in present:
                if w in left:
                    return w
    return None


def count_terms(expression: Basic) -> float:
    """Return a bound on the number of terms when powers and products are multiplied out."""
    args = expression.args
    if isinstance(expression, se.Add):
        return sum(map(count_terms, args))
    if isinstance(expression, se.Mul):
        return math.prod(map(count_terms, args))
    if isinstance(expression, se.Pow) and isinstance(args[1], se.Integer) and args[1] > 0:
        count, power = count_terms(args[0]), int(args[1])
        return math.comb(int(min(count, 1e6)) + power - 1, power) if count > 1 else 1
    return 1


def is_zero(expression: Basic) -> bool:
    """Whether an expression is zero whatever its symbols: tried at three points."""
    chance = random.Random(8)
    symbols = sorted(expression.free_symbols, key=str)
    for _ in range(3):
        at = {s: se.RealDouble(chance.uniform(0.3, 0.9)) for s in symbols}
        terms = expression.args if isinstance(expression, se.Add) else (expression,)
        try:
            values = [number(term.xreplace(at)) for term in terms]
        except (ValueError, RuntimeError):
            return False
        if abs(math.fsum(values)) > 1e-12 * math.fsum(map(abs, values)):
            return False
    return True
