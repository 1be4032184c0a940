"""Equations that contain an unknown in sines and cosines of one angle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import symengine as se
from symengine import Basic

from lagcli.equations.derivation.motion import ONE, TWO, ZERO

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
