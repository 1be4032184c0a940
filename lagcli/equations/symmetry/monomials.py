"""Expressions as sums of independent monomials with rational coefficients.

A sum vanishes identically if and only if all of its coefficients vanish, once sines and cosines are
written as exponentials: cos θ = (E + 1/E)/2, sin θ = (E − 1/E)/(2i) with E = exp(iθ). Trigonometric
identities then hold without further rules. Other functions, roots and denominators count as
independent: a relation between them may be missed, but no false one is found.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction

import symengine as se
from symengine import Basic

from lagcli.model.expression.algebra import count_terms, expand_terms

ONE, TWO = se.Integer(1), se.Integer(2)
_SMALL_DENOMINATOR = 10**6
_ROUNDING = 4e-16  # rounding error of a parameter computed from others


def rational(value: float) -> Fraction:
    """Return the simple rational number that a double represents: 3/4000 for 7.5e-4."""
    found = Fraction(value).limit_denominator(_SMALL_DENOMINATOR)
    if abs(found - Fraction(value)) <= _ROUNDING * abs(Fraction(value)):
        return found
    return Fraction(repr(value))


def symbolic(value: Fraction) -> Basic:
    """Return a fraction as an expression."""
    return se.Integer(value.numerator) / se.Integer(value.denominator)


#: A rational number; most are integers, whose arithmetic is ten times as fast.
Exact = int | Fraction
#: A monomial with the real and imaginary parts of its coefficient.
Term = tuple[Basic, Exact, Exact]


class Monomials:
    """Writes expressions as sums of monomials.

    Parameters
    ----------
    values : mapping of str to float
        Parameter values to substitute. Other parameters count as independent symbols, so that a
        result holds for all of their values.
    """

    def __init__(self, values: Mapping[str, float]):
        self._values = {se.Symbol(n): symbolic(rational(x)) for n, x in values.items()}
        self._exponentials: dict[Basic, Basic] = {}

    def exponential(self, expression: Basic) -> Basic:
        """Return an expression with the parameters' values, and exponentials for sin and cos."""
        for x in expression.atoms(se.RealDouble):
            expression = expression.xreplace({x: symbolic(rational(float(x)))})
        put_in = expression.xreplace(self._values)
        waves = {f: self._wave(f) for f in put_in.atoms(se.sin, se.cos)}
        return put_in.xreplace(waves) if waves else put_in

    def terms(self, exponential: Basic) -> Iterator[Term]:
        """Yield the monomials of a result of `exponential`, with real and imaginary coefficient."""
        expanded = expand_terms(exponential)
        if isinstance(expanded, se.Number):
            parts = {ONE: expanded}
        else:
            parts = expanded.as_coefficients_dict()
        for monomial, coefficient in parts.items():
            if coefficient != 0:
                yield monomial, *_parts(coefficient)

    def _wave(self, function: Basic) -> Basic:
        """Return sin or cos of a linear combination of terms in terms of their exponentials."""
        angle = expand_terms(function.args[0])
        factors = []
        for term, coefficient in (
            {ONE: angle} if isinstance(angle, se.Number) else angle.as_coefficients_dict()
        ).items():
            if term not in self._exponentials:
                self._exponentials[term] = se.Symbol(f"\ufdd1{len(self._exponentials)}")
            factors.append(self._exponentials[term] ** coefficient)
        wave = se.Mul(*factors)
        if isinstance(function, se.cos):
            return (wave + 1 / wave) / TWO
        return (wave - 1 / wave) / (TWO * se.I)


def term_count(exponential: Basic) -> float:
    """Return an upper bound of the number of monomials."""
    return count_terms(exponential)


def _number(coefficient: Basic | int) -> Basic:
    """Return a coefficient as a SymEngine number; coefficients of single terms are Python
    numbers."""
    return se.Integer(coefficient) if isinstance(coefficient, int) else coefficient


def _parts(coefficient: Basic | int) -> tuple[Exact, Exact]:
    if isinstance(coefficient, int):
        return coefficient, 0
    if isinstance(coefficient, se.Rational):
        return _exact(coefficient), 0
    return _exact(coefficient.real_part()), _exact(coefficient.imaginary_part())


def _exact(number: Basic) -> Exact:
    if isinstance(number, se.Integer):
        return int(number)
    numerator, denominator = number.get_num_den()
    return Fraction(int(numerator), int(denominator))


def coefficients(expression: Basic) -> dict[Basic, Basic]:
    """Return the terms of a sum, without their numerical coefficients, with these."""
    if isinstance(expression, se.Number):
        return {ONE: expression} if expression != 0 else {}
    found = expression.as_coefficients_dict().items()
    return {term: _number(x) for term, x in found if x != 0}
