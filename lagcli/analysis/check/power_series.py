"""Values of expressions along a path, as truncated power series with 60 digits.

A series Σ x_k s^k is the list of its coefficients, which are integers: multiples of 2^−BITS. Sums
and products of series cost little, and a coefficient that is zero but for rounding is told from any
other.
"""

from __future__ import annotations

import math
import random
from collections.abc import Mapping
from fractions import Fraction

import symengine as se
from symengine import Basic

from lagcli.model.expression.functions import derivative, is_opaque

BITS = 200
ONE = 1 << BITS
#: Bits of values of functions, of which the first are those before the point.
_PRECISION = BITS + 120

Series = list[int]


class NoSeries(Exception):
    """An expression has no value, no power series, or a function that is not supported."""


def fixed(value: Fraction | float) -> int:
    """Return a number as a multiple of 2^−BITS."""
    exact = Fraction(value)
    return (exact.numerator << BITS) // exact.denominator


def constant(value: int, order: int) -> Series:
    """Return the series of a constant."""
    return [value] + [0] * order


def times(a: Series, b: Series) -> Series:
    """Return a product."""
    return [
        sum(map(int.__mul__, a[: k + 1], reversed(b[: k + 1]))) >> BITS
        for k in range(min(len(a), len(b)))
    ]


def plus(a: Series, b: Series) -> Series:
    """Return a sum."""
    return [x + y for x, y in zip(a, b, strict=True)]


class SeriesEvaluator:
    """Evaluates expressions at power series of their symbols.

    Parameters
    ----------
    symbols : mapping of symbol to Series
        All of one length.
    slopes : dict of expression to list of int, optional
        Values and derivatives of functions at the start, which evaluators at the same point share.
    """

    def __init__(
        self, symbols: Mapping[Basic, Series], slopes: dict[Basic, list[int]] | None = None
    ):
        self._slopes: dict[Basic, list[int]] = {} if slopes is None else slopes
        self._known: dict[Basic, Series] = dict(symbols)
        self._order = max((len(x) for x in symbols.values()), default=1) - 1

    def value(self, expression: Basic) -> Series:
        """Return the series of an expression.

        Raises
        ------
        NoSeries
            See there.
        """
        found = self._known.get(expression)
        if found is None:
            found = self._known[expression] = self._made(expression)
        return found

    def _made(self, expression: Basic) -> Series:
        if not expression.free_symbols:
            return constant(_number(expression), self._order)
        args = expression.args
        if isinstance(expression, se.Add):
            total = self.value(args[0])
            for x in args[1:]:
                total = plus(total, self.value(x))
            return total
        if isinstance(expression, se.Mul):
            product = self.value(args[0])
            for x in args[1:]:
                product = times(product, self.value(x))
            return product
        if isinstance(expression, se.Pow):
            return self._power(expression)
        if isinstance(expression, se.atan2):
            y, x = map(self.value, args)
            return self._angle(y, x, expression)
        if isinstance(expression, se.Derivative) or _is_input(expression):
            return self._input(expression)
        if isinstance(expression, se.Function) and len(args) == 1:
            return self._composed(expression.func(_X), args[0], expression)
        raise NoSeries(str(expression))

    def _input(self, expression: Basic) -> Series:
        """Return the series of a function of time, or of its derivative, with random values."""
        times_differentiated = 0
        while isinstance(expression, se.Derivative):
            times_differentiated += len(expression.args) - 1
            expression = expression.args[0]
        if not _is_input(expression):
            raise NoSeries(str(expression))
        source = random.Random(str(expression.get_name()))  # reproducible
        values = [source.uniform(-1, 1) for _ in range(times_differentiated + self._order + 1)]
        return self._polynomial(
            [fixed(x) for x in values[times_differentiated:]], self.value(expression.args[0])
        )

    def _power(self, expression: Basic) -> Series:
        base, exponent = expression.args
        if isinstance(exponent, se.Integer) and 0 < int(exponent) <= _LARGEST_POWER:
            value = power = self.value(base)
            for _ in range(int(exponent) - 1):
                power = times(power, value)
            return power
        if not exponent.free_symbols:
            return self._composed(_X**exponent, base, expression)
        if not base.free_symbols:
            return self._composed(base**_X, exponent, expression)
        return self.value(se.exp(exponent * se.log(base)))

    def _angle(self, y: Series, x: Series, expression: Basic) -> Series:
        """Return the series of atan2(y, x), whose slope is (x y' − y x')/(x² + y²)."""
        inner = SeriesEvaluator({_X: x, _Y: y})
        rates = {_DX: _rate(x), _DY: _rate(y)}
        inner._known |= rates
        slope = inner.value((_X * _DY - _Y * _DX) / (_X**2 + _Y**2))
        at_start = expression.func(_exact(y[0]), _exact(x[0]))
        return [_number(at_start), *(slope[k] // (k + 1) for k in range(self._order))]

    def _composed(self, function: Basic, argument: Basic, expression: Basic) -> Series:
        """Return the series of an expression, a function of the symbol _X at an argument."""
        inner = self.value(argument)
        slopes = self._slopes.get(expression, [])
        if len(slopes) <= self._order:
            place, slope, slopes = {_X: _exact(inner[0])}, function, []
            for _ in range(self._order + 1):
                slopes.append(_number(slope.xreplace(place)))
                slope = derivative(slope, _X)
            self._slopes[expression] = slopes
        return self._polynomial(slopes[: self._order + 1], inner)

    def _polynomial(self, slopes: list[int], argument: Series) -> Series:
        """Return the series of a function with these derivatives at the start."""
        change, total = [0, *argument[1:]], constant(0, self._order)
        for k, slope in reversed(list(enumerate(slopes))):
            total = times(total, change)
            total[0] += slope // math.factorial(k)
        return total


def _is_input(expression: Basic) -> bool:
    """Whether an expression is a known function of time."""
    return isinstance(expression, se.FunctionSymbol) and not is_opaque(expression)


_X, _Y, _DX, _DY = (se.Symbol(f"\ufdd0{name}") for name in ("x", "y", "dx", "dy"))
_LARGEST_POWER = 8


def _rate(x: Series) -> Series:
    """Return the derivative; its last coefficient, which is unknown, is 0."""
    return [*((k + 1) * x[k + 1] for k in range(len(x) - 1)), 0]


def _exact(value: int) -> Basic:
    return se.Rational(value, ONE)


def _number(expression: Basic) -> int:
    """Return the value of an expression without symbols."""
    if isinstance(expression, se.RealDouble):
        return fixed(float(expression))
    if isinstance(expression, se.Rational):
        p, q = expression.get_num_den()
        return fixed(Fraction(int(p), int(q)))
    try:
        return fixed(Fraction(str(_known_functions(expression).n(_PRECISION, real=True))))
    except (RuntimeError, ValueError, ZeroDivisionError, OverflowError):
        raise NoSeries(str(expression)) from None


def _known_functions(expression: Basic) -> Basic:
    """Return an expression with the functions that SymEngine has no values of by others."""
    if not expression.args:
        return expression
    args = [_known_functions(x) for x in expression.args]
    if is_opaque(expression):
        (x,) = args
        if str(expression.get_name()) == "expm1":
            return se.exp(x) - 1
        if str(expression.get_name()) == "log1p":
            return se.log(1 + x)
        raise NoSeries(str(expression))
    return expression.func(*args)
