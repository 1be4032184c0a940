"""Algebra of SymEngine expressions: expansion, identities, linearity, size."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import symengine as se
from symengine import Basic

from lagcli.model.expression.constants import number
from lagcli.model.expression.functions import KINKS, derivative, kinks_of, parts_of, pieces

_LARGEST = 20_000  # maximum number of terms of an expansion


def nonlinear_in(expression: Basic, rates: Sequence[Basic]) -> Basic | None:
    """Return a symbol in which the expression is not affine, or None.

    An expression that becomes affine only by cancellation, such as (v + 1)^2 − v^2, is expanded; if
    the expansion is too large, the expression counts as not affine.
    """
    free = expression.free_symbols
    present = [v for v in rates if v in free]
    if present and (kinked := kinked_in(expression, present)) is not None:
        return kinked
    for v in present:
        slope = derivative(expression, v)
        if not slope.free_symbols.isdisjoint(present):
            if count_terms(slope) > _LARGEST:
                return v
            left = expand_terms(slope).free_symbols
            for w in present:
                if w in left:
                    return w
    return None


def kinked_in(expression: Basic, symbols: Sequence[Basic]) -> Basic | None:
    """Return a symbol in which the expression has kinks or jumps, or None.

    The derivative does not show it: that of floor(v) and of if(v > 0, 1, 2) is zero.
    """
    for kink in kinks_of(expression):
        if not isinstance(kink, KINKS):
            continue
        deciding = kink.args[1::2] if isinstance(kink, se.Piecewise) else kink.args
        for symbol in symbols:
            if any(symbol in part.free_symbols for part in deciding):
                return symbol
    return None


def expand_terms(expression: Basic) -> Basic:
    """Expand products and powers of sums, also inside piecewise expressions."""
    # SymEngine expands only some denominators, which then differ from equal ones
    parts = parts_of(expression, se.Pow, se.Piecewise)
    apart = {x if isinstance(x, se.Piecewise) else x.args[0] for x in parts if _is_apart(x)}
    if not apart:
        return se.expand(expression)
    held = {part: se.Symbol(f"\ufdd0{i}") for i, part in enumerate(apart)}
    rest = se.expand(expression.xreplace(held))
    inside = rest.free_symbols
    shown = {name: _cases_expanded(part) for part, name in held.items() if name in inside}
    return rest.xreplace(shown) if shown else rest


def _is_apart(part: Basic) -> bool:
    """Whether a part is piecewise or a denominator."""
    if isinstance(part, se.Piecewise):
        return True
    exponent = part.args[1]
    return isinstance(exponent, se.Number) and bool(exponent.is_negative)


def _cases_expanded(part: Basic) -> Basic:
    if not isinstance(part, se.Piecewise):
        return part
    values = [expand_terms(value) for value in part.args[0::2]]
    return pieces(values, part.args[1::2])


def count_terms(expression: Basic, known: dict[Basic, float] | None = None) -> float:
    """Return an upper bound of the number of terms after expansion.

    Parameters
    ----------
    expression : SymEngine expression
    known : dict of expression to float, optional
        Counts of the sums, products and powers met before; it is extended.
    """
    if not isinstance(expression, se.Add | se.Mul | se.Pow | se.Piecewise):
        return 1
    known = {} if known is None else known
    count = known.get(expression)
    if count is None:
        count = known[expression] = _count_terms(expression, known)
    return count


def _count_terms(expression: Basic, known: dict[Basic, float]) -> float:
    args = expression.args
    if isinstance(expression, se.Pow):
        if not (isinstance(args[1], se.Integer) and args[1] > 0):
            return 1
        count, power = count_terms(args[0], known), int(args[1])
        return math.comb(int(min(count, 1e6)) + power - 1, power) if count > 1 else 1
    values = args[0::2] if isinstance(expression, se.Piecewise) else args
    counts = [count_terms(x, known) for x in values]
    return math.prod(counts) if isinstance(expression, se.Mul) else sum(counts)


def count_operations(expressions: Iterable[Basic]) -> int:
    """Return the number of operations of expressions without shared subexpressions."""
    sizes: dict[Basic, int] = {}
    total = 0
    for expression in expressions:
        stack = [expression]
        while stack:
            top = stack[-1]
            if top in sizes:
                stack.pop()
                continue
            parts = getattr(top, "args", ())  # a condition may be Python's True
            missing = [part for part in parts if part not in sizes]
            if missing:
                stack.extend(missing)
                continue
            sizes[top] = 1 + sum(sizes[part] for part in parts)
            stack.pop()
        total += sizes[expression]
    return total


def is_zero(expression: Basic) -> bool:
    """Whether an expression is identically zero, tested at three scattered points.

    A piecewise expression may vanish at the points and not elsewhere; it is expanded instead.
    """
    if any(isinstance(x, KINKS) for x in kinks_of(expression)):
        return count_terms(expression) <= _LARGEST and bool(expand_terms(expression) == 0)
    return terms_cancel(expression.args if isinstance(expression, se.Add) else (expression,))


def terms_cancel(terms: Sequence[Basic]) -> bool:
    """Whether the sum of terms is zero within rounding of the terms, at three scattered points."""
    symbols = sorted(set().union(*(x.free_symbols for x in terms)), key=str)
    for k in range(1, 4):
        scattered = (math.sin((4 * i + k) ** 2) for i in range(len(symbols)))
        at = {s: se.RealDouble(0.6 + 0.3 * x) for s, x in zip(symbols, scattered, strict=True)}
        try:
            # with the symbols of each term alone: a substitution costs as much as it has entries
            values = [number(x.xreplace({s: at[s] for s in x.free_symbols})) for x in terms]
        except (ValueError, RuntimeError):
            return False
        if not cancel(values, 1e-12):
            return False
    return True


def cancel(values: Sequence[float], tolerance: float) -> bool:
    """Whether the sum of values is zero within a tolerance relative to that of their magnitudes.

    Values that are not finite do not cancel.
    """
    largest = max(map(abs, values), default=0.0)
    if largest == 0:
        return True
    shares = [value / largest for value in values]  # the sum of the values may overflow
    return abs(math.fsum(shares)) <= tolerance * math.fsum(map(abs, shares))


_MOST = 400  # maximum number of terms of an expansion


def constant_value(expression: Basic) -> Basic | None:
    """Return the value of an expression that is constant by sin² a + cos² a = 1, else None.

    Every cos² a is replaced by 1 − sin² a and the result is expanded; in a constant, all other
    terms cancel.

    Parameters
    ----------
    expression : SymEngine expression

    Returns
    -------
    SymEngine number or None
    """
    if isinstance(expression, se.Number):
        return expression
    angles = {x.args[0] for x in expression.atoms(se.sin)} & {
        x.args[0] for x in expression.atoms(se.cos)
    }
    if not angles:
        return None
    expanded = se.expand(expression)
    for angle in angles:
        if isinstance(expanded, se.Add) and len(expanded.args) > _MOST:
            return None
        expanded = se.expand(_without_squares(expanded, angle))
    return expanded if isinstance(expanded, se.Number) else None


def _without_squares(expression: Basic, angle: Basic) -> Basic:
    """Replace each cos² a of a sum by 1 − sin² a."""
    cosine, rest = se.cos(angle), 1 - se.sin(angle) ** 2
    powers = {
        p: rest ** (int(p.args[1]) // 2) * cosine ** (int(p.args[1]) % 2)
        for p in expression.atoms(se.Pow)
        if p.args[0] == cosine and isinstance(p.args[1], se.Integer) and int(p.args[1]) > 1
    }
    return expression.xreplace(powers)
