"""Dependent coordinates in closed form, on the branch of given values.

An equation with one unknown u is solved if it is linear or quadratic in u, or has the form A cos w
+ B sin w + C = 0 with w = ± u + …: then A sin w − B cos w = ± √(A² + B² − C²), where the given
values determine the sign. Two equations with two unknowns are solved if one unknown can be
eliminated such that an equation of this kind remains: by cos² + sin² = 1, as in a loop of two bars,
or by a difference without squares, as for the intersection of two circles. Any number of linear
equations is solved.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import symengine as se
from symengine import Basic

from lagcli.equations.derivation.motion import ONE, TWO, ZERO, addends
from lagcli.equations.reduction.small_systems import (
    cancelled,
    determinant,
    shared_factor,
    solutions,
)

_SINE, _COSINE = se.Symbol("\ufdd0s"), se.Symbol("\ufdd0c")


@dataclass(frozen=True, eq=False)
class Angle:
    """An angle w = ± u + … that contains an unknown u.

    Parameters
    ----------
    unknown : symbol
    expression : expression
        w.
    """

    unknown: Basic
    expression: Basic

    @property
    def _slope(self) -> Basic:
        return self.expression.diff(self.unknown)

    def solved(self, angle: Basic) -> Basic:
        """Return u for a value of w."""
        return (angle - self.expression.subs({self.unknown: ZERO})) / self._slope

    def linear_parts(self, equation: Basic) -> tuple[Basic, Basic, Basic] | None:
        """Return a, b, c of a cos w + b sin w + c; None if the equation has another form."""
        e = se.expand(self.replaced(equation, _SINE, _COSINE))
        if self.unknown in e.free_symbols:
            return None
        a, b = e.diff(_COSINE), e.diff(_SINE)
        if {_SINE, _COSINE} & (a.free_symbols | b.free_symbols):
            squares = se.expand(e.subs({_COSINE**TWO: ONE - _SINE**TWO}))
            a, b = squares.diff(_COSINE), squares.diff(_SINE)
            if {_SINE, _COSINE} & (a.free_symbols | b.free_symbols):
                return None
            e = squares
        return a, b, e.subs({_SINE: ZERO, _COSINE: ZERO})

    def replaced(self, expression: Basic, sine: Basic, cosine: Basic) -> Basic:
        """Return an expression with values for sin w and cos w, by the addition theorems."""
        values = {}
        for kind in (se.sin, se.cos):
            for x in expression.atoms(kind):
                if self.unknown in x.args[0].free_symbols:
                    values[x] = self._opened(x, sine, cosine)
        return expression.xreplace({x: y for x, y in values.items() if y is not None})

    def _opened(self, function: Basic, sine: Basic, cosine: Basic) -> Basic | None:
        """Return sin or cos of n w + … in terms of sin w and cos w; None unless n is ±1 or ±2."""
        count = function.args[0].diff(self.unknown) / self._slope
        if count not in (-2, -1, 1, 2):
            return None
        rest = se.expand(function.args[0] - count * self.expression)
        if abs(int(count)) == 2:
            sine, cosine = TWO * sine * cosine, ONE - TWO * sine**2
        if int(count) < 0:
            sine = -sine
        if isinstance(function, se.sin):
            return sine * se.cos(rest) + cosine * se.sin(rest)
        return cosine * se.cos(rest) - sine * se.sin(rest)


def angle_of(equations: Sequence[Basic], unknown: Basic) -> Angle | None:
    """Return the angle that contains an unknown in equations: the unknown, or the only argument."""
    arguments = {
        x.args[0]
        for e in equations
        for kind in (se.sin, se.cos)
        for x in e.atoms(kind)
        if unknown in x.args[0].free_symbols
    }
    if not arguments or any(a.diff(unknown) not in (-2, -1, 1, 2) for a in arguments):
        return None
    if len(arguments) == 1 and (only := next(iter(arguments))).diff(unknown) in (-1, 1):
        return Angle(unknown, only)
    return Angle(unknown, unknown)


Value = Callable[[Basic], float]
#: Coefficients or radicands below this, relative to values of order one, do not determine a branch.
_SMALL = 1e-9


@dataclass(frozen=True, eq=False)
class Solution:
    """A coordinate as a function of others.

    Parameters
    ----------
    unknown : symbol
    value : expression
        Expression in symbols that are independent or solved earlier.
    angle : expression or None
        Angle w that contains the unknown, for a solution by sine and cosine.
    sine, cosine : expressions or None
        sin w and cos w.
    sign : int
        Sign of the root on this branch; 0 if the solution is unique.
    """

    unknown: Basic
    value: Basic
    angle: Basic | None = None
    sine: Basic | None = None
    cosine: Basic | None = None
    sign: int = 0

    def put_into(self, expression: Basic) -> Basic:
        """Return an expression with the unknown substituted."""
        if self.unknown not in expression.free_symbols:
            return expression
        if self.angle is not None:
            angle = Angle(self.unknown, self.angle)
            expression = angle.replaced(expression, self.sine, self.cosine)
        return expression.subs({self.unknown: self.value})


def solve(equations: Sequence[Basic], unknowns: Sequence[Basic], value: Value) -> list[Solution]:
    """Solve equations e = 0 for as many unknowns.

    Parameters
    ----------
    equations : sequence of expressions
    unknowns : sequence of symbols
    value : callable
        Function that evaluates an expression at the state that determines the branch.

    Returns
    -------
    list of Solution
        In order of dependence; empty if no closed form was found.
    """
    linear = _linear(equations, unknowns, value)
    if linear:
        return linear
    if len(unknowns) == 1:
        solutions = _one(equations[0], unknowns[0], value)
        return [solutions] if solutions is not None else []
    if len(unknowns) == 2:
        for attempt in (_loop, _circles):
            for first, second in (unknowns, unknowns[::-1]):
                pair = attempt(equations, first, second, value)
                if pair:
                    return pair
    return []


def _linear(equations: Sequence[Basic], unknowns: Sequence[Basic], value: Value) -> list[Solution]:
    zeros = dict.fromkeys(unknowns, ZERO)
    matrix = [[se.expand(e.diff(u)) for u in unknowns] for e in equations]
    if any(x.free_symbols & set(unknowns) for row in matrix for x in row):
        return []
    right = [-_contracted(e.subs(zeros)) for e in equations]
    (solved,), below = solutions(matrix, [right], value)
    return [Solution(u, x / below) for u, x in zip(unknowns, solved, strict=True)]


def _one(equation: Basic, unknown: Basic, value: Value) -> Solution | None:
    return _square(equation, unknown, value) or (
        _circular(equation, unknown, value) or _quadratic(equation, unknown, value)
    )


def _square(equation: Basic, unknown: Basic, value: Value) -> Solution | None:
    """Solve n (c u + w)² + C = 0, keeping w and C as they are written."""
    terms = addends(equation)
    holding = [x for x in terms if unknown in x.free_symbols]
    if len(holding) != 1:
        return None
    factors = holding[0].args if isinstance(holding[0], se.Mul) else (holding[0],)
    moving = [x for x in factors if unknown in x.free_symbols]
    if len(moving) != 1 or not isinstance(moving[0], se.Pow) or moving[0].args[1] != TWO:
        return None
    base = moving[0].args[0]
    slope = base.diff(unknown)
    if slope == 0 or unknown in slope.free_symbols:
        return None
    scale = se.Mul(*(x for x in factors if unknown not in x.free_symbols))
    rest = se.Add(*(x for x in terms if unknown not in x.free_symbols))
    sign = _sign(value(base))
    root = sign * se.sqrt(se.Add(*(-x / scale for x in addends(rest))))
    shift = base.subs({unknown: ZERO})
    return Solution(unknown, (root - shift) / slope, sign=sign)


def _quadratic(equation: Basic, unknown: Basic, value: Value) -> Solution | None:
    e = se.expand(equation)
    second = e.diff(unknown).diff(unknown) / TWO
    if unknown in second.free_symbols or _contracted(second) == 0:
        return None
    first = e.diff(unknown).subs({unknown: ZERO})
    rest = e.subs({unknown: ZERO})
    sign = _sign(value(TWO * second * unknown + first))
    below = se.expand(first**2 / 4 - second * rest)
    return Solution(unknown, (-first / TWO + sign * se.sqrt(below)) / second, sign=sign)


def _circular(equation: Basic, unknown: Basic, value: Value) -> Solution | None:
    angle = angle_of([equation], unknown)
    if angle is None:
        return None
    parts = angle.linear_parts(equation)
    if parts is None:
        return None
    a, b, c = (_contracted(x) for x in parts)
    w = angle.expression
    if a == 0:
        return _from_one(angle, c, b, value(b * se.cos(w)), "sine", value)
    if b == 0:
        return _from_one(angle, c, a, value(a * se.sin(w)), "cosine", value)
    squares = _contracted(se.expand(a**2 + b**2))
    sign = _sign(value(a * se.sin(w) - b * se.cos(w)))
    root = sign * se.sqrt(squares - c**2)
    sine, cosine = (a * root - b * c) / squares, (-a * c - b * root) / squares
    return _of_angle(angle, sine, cosine, sign, value)


def _from_one(
    angle: Angle, c: Basic, factor: Basic, other: float, kind: str, value: Value
) -> Solution | None:
    """Solve factor · sin w + c = 0, or with cos w; ``other`` is factor times the other function."""
    sign = _sign(other)
    known, root = -c / factor, sign * se.sqrt(factor**2 - c**2) / factor
    sine, cosine = (known, root) if kind == "sine" else (root, known)
    inverse = se.asin(known) if kind == "sine" else se.acos(known)
    if kind == "sine" and value(se.cos(angle.expression)) < 0:
        inverse = se.pi - inverse
    if kind == "cosine" and value(se.sin(angle.expression)) < 0:
        inverse = -inverse
    return _of_angle(angle, sine, cosine, sign, value, inverse)


def _of_angle(
    angle: Angle,
    sine: Basic,
    cosine: Basic,
    sign: int,
    value: Value,
    inverse: Basic | None = None,
) -> Solution | None:
    solution = se.atan2(sine, cosine) if inverse is None else inverse
    turns = (value(angle.expression) - value(solution)) / (2 * math.pi)
    if not math.isfinite(turns) or abs(turns - round(turns)) > 1e-6:
        return None
    solution += 2 * round(turns) * se.pi
    return Solution(angle.unknown, angle.solved(solution), angle.expression, sine, cosine, sign)


def _loop(equations: Sequence[Basic], unknown: Basic, other: Basic, value: Value) -> list[Solution]:
    """Eliminate an angle from two equations by cos² + sin² = 1."""
    angle = angle_of(equations, unknown)
    if angle is None:
        return []
    rows = []
    for equation in equations:
        parts = angle.linear_parts(equation)
        if parts is None:
            return []
        rows.append(parts)
    matrix = [[a, b] for a, b, _ in rows]
    below = _contracted(se.expand(determinant(matrix)))
    if other in below.free_symbols or abs(value(below)) < _SMALL:
        return []
    (solved,), _ = solutions(matrix, [[-c for _, _, c in rows]], value)
    left = _contracted(se.expand(solved[0] ** 2 + solved[1] ** 2 - below**2))
    terms = left.args if isinstance(left, se.Add) else (left,)
    first = _one(se.expand(left / shared_factor(terms)), other, value)
    if first is None:
        return []
    (cosine, sine), below = cancelled([_contracted(se.expand(x)) for x in solved], below)
    cosine, sine = cosine / below, sine / below
    second = _of_angle(angle, sine, cosine, 0, value)
    return [first, second] if second is not None else []


def _circles(
    equations: Sequence[Basic], unknown: Basic, other: Basic, value: Value
) -> list[Solution]:
    """Eliminate an unknown from two quadratic equations by their difference without squares."""
    one, two = map(se.expand, equations)
    squares = [e.diff(unknown).diff(unknown) for e in (one, two)]
    difference = se.expand(squares[1] * one - squares[0] * two)
    slope = difference.diff(unknown)
    if unknown in slope.free_symbols or abs(value(slope)) < _SMALL:
        return []
    solved = -difference.subs({unknown: ZERO}) / slope
    first = _one(se.expand(one.subs({unknown: solved}) * slope**2), other, value)
    return [first, Solution(unknown, solved)] if first is not None else []


def _contracted(e: Basic) -> Basic:
    """Return a sum with cos² + sin² replaced by 1 where that is complete."""
    for angle in {x.args[0] for x in e.atoms(se.sin)} & {x.args[0] for x in e.atoms(se.cos)}:
        without = se.expand(_without_cosine_squares(e, angle))
        if se.count_ops(without) < se.count_ops(e):
            e = without
    return e


def _without_cosine_squares(e: Basic, angle: Basic) -> Basic:
    """Return an expanded expression with cos² of an angle written as 1 − sin²."""
    square = se.Symbol("\ufdd0")
    replaced = se.expand(e).xreplace({se.cos(angle) ** 2: square})
    return replaced.xreplace({square: ONE - se.sin(angle) ** 2})


def _sign(x: float) -> int:
    return -1 if x < 0 else 1
