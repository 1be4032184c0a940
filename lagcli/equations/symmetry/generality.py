"""Whether a quantity is conserved for all values of the parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from itertools import combinations, product

import symengine as se
from symengine import Basic

from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.symmetry.conserved import ConservedQuantity, quantity_of
from lagcli.equations.symmetry.monomials import coefficients, rational, symbolic
from lagcli.equations.symmetry.proof import Proof

#: Number of candidate expressions of a symmetry's numbers in terms of parameters.
_MOST_NAMINGS = 32
#: Numbers tried as factors of parameters.
_PLAIN = (Fraction(1), Fraction(1, 2), Fraction(2))


def generalized(equations: Equations, quantity: ConservedQuantity) -> ConservedQuantity:
    """Return a quantity with its numbers expressed by parameters, if it then holds for all values.

    Parameters
    ----------
    equations : Equations
    quantity : ConservedQuantity
        Quantity from `conserved_quantities`.
    """
    if Proof(equations, quantity).holds_generally():
        return quantity._replace(general=True)
    for numbers in _namings(equations, quantity):
        other = quantity_of(
            equations,
            {i: _renamed(x, numbers) for i, x in quantity.field.items()},
            quantity.time,
            _renamed(quantity.gauge, numbers),
            {place: _renamed(x, numbers) for place, x in quantity.multiples.items()},
        )
        if Proof(equations, other).holds_generally():
            return other._replace(name=quantity.name, general=True)
    return quantity


def _namings(equations: Equations, quantity: ConservedQuantity) -> Iterator[dict[Fraction, Basic]]:
    """Yield parameters and simple combinations of them for the numbers of a symmetry."""
    given = {n: rational(x) for n, x in equations.model.parameter_values.items()}
    powers = {se.Symbol(n) ** e: x**e for n, x in given.items() if x for e in (1, -1)}
    pairs = {a * b: x * y for (a, x), (b, y) in combinations(powers.items(), 2)}
    parts = [*quantity.field.values(), quantity.gauge, *quantity.multiples.values()]
    used = sorted({abs(x) for part in parts for x in _numbers(part)})
    choices: list[list[Basic]] = []
    for number in used:
        found = _equal(number, powers if number in _PLAIN else {**powers, **pairs})
        choices.append([symbolic(number), *found][:_MOST_NAMINGS])
    for tried, chosen in enumerate(product(*choices)):
        if tried >= _MOST_NAMINGS:
            return
        yield dict(zip(used, chosen, strict=True))


def _equal(number: Fraction, known: Mapping[Basic, Fraction]) -> list[Basic]:
    """Return the products of parameters and a plain number that have a given value, factor 1
    first."""
    factors = {symbol: number / x for symbol, x in known.items() if abs(number / x) in _PLAIN}
    exact = sorted(factors, key=lambda symbol: abs(factors[symbol]) != 1)
    return [symbolic(factors[symbol]) * symbol for symbol in exact]


def _numbers(expression: Basic) -> Iterator[Fraction]:
    """Yield the coefficients of an expression that is a sum of terms."""
    for coefficient in coefficients(expression).values():
        numerator, denominator = coefficient.get_num_den()
        yield Fraction(int(numerator), int(denominator))


def _renamed(expression: Basic, numbers: Mapping[Fraction, Basic]) -> Basic:
    terms = []
    for term, coefficient in coefficients(expression).items():
        numerator, denominator = coefficient.get_num_den()
        value = Fraction(int(numerator), int(denominator))
        named = numbers[abs(value)]
        terms.append(term * (named if value > 0 else -named))
    return se.Add(*terms)
