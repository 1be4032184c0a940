"""SymEngine expressions as sums of monomials.

A monomial is a product of generators with integer exponents; a generator is a symbol, a function, a
root, or a sum that is not expanded. Formulas are arranged by three classes of generators:
parameters, functions of position and time, and motion (multipliers, accelerations, velocities).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

import symengine as se
from symengine import Basic

from lagcli.model.expression.algebra import constant_value
from lagcli.model.expression.functions import apply, is_opaque, name_of_function
from lagcli.model.model import Model, acceleration, multiplier, velocity

Exact = int | Fraction
Monomial = tuple[tuple[int, int], ...]  # (generator, exponent), by generator
Polynomial = dict[Monomial, Exact]
Place = tuple[tuple[int, ...], int, str]
Head = Literal["symbol", "function", "root", "power", "sum", "cases"]
Class = Literal["parameter", "function", "multiplier", "acceleration", "velocity"]

MAX_TERMS = 500  # longer expansions are not readable
UNIT: Monomial = ()


class TooLarge(Exception):
    """An expansion is too long to be printed."""


@dataclass(frozen=True)
class Generator:
    """A generator of monomials.

    Parameters
    ----------
    head : str
        Kind of the generator.
    name : str
        Name of the symbol or function.
    arguments : tuple of expressions
        Arguments of a function; the base of a root; base and exponent of a power; the sum or the
        cases.
    degree : int
        Degree of a root: the generator is base^(1/degree).
    """

    head: Head
    name: str = ""
    arguments: tuple[Basic, ...] = ()
    degree: int = 1


def exact(value: Basic) -> Exact:
    """Return the value of a SymEngine number."""
    if isinstance(value, se.Integer):
        return int(value)
    if isinstance(value, se.Rational):
        p, q = value.get_num_den()
        return Fraction(int(p), int(q))
    return Fraction(repr(float(value)))  # the decimal from which the double was read


def times(a: Monomial, b: Monomial) -> Monomial:
    """Return the product of two monomials."""
    if not a:
        return b
    if not b:
        return a
    exponents = dict(a)
    for generator, power in b:
        exponents[generator] = exponents.get(generator, 0) + power
    return tuple(sorted((g, n) for g, n in exponents.items() if n))


def add_to(total: Polynomial, monomial: Monomial, coefficient: Exact) -> None:
    """Add a term in place."""
    value = total.get(monomial, 0) + coefficient
    if value:
        total[monomial] = value
    else:
        total.pop(monomial, None)


def product(a: Polynomial, b: Polynomial) -> Polynomial:
    """Return the product of two polynomials."""
    if len(a) * len(b) > 4 * MAX_TERMS:
        raise TooLarge
    total: Polynomial = {}
    for m, x in a.items():
        for n, y in b.items():
            add_to(total, times(m, n), x * y)
    if len(total) > MAX_TERMS:
        raise TooLarge
    return total


class MonomialExpansion:
    """The generators of a model's formulas, and expressions expanded in them.

    Parameters
    ----------
    model : Model
    order : sequence of str
        The parameters, in the order in which they are written.
    values : mapping of str to exact numbers, optional
        Parameters to be replaced by their values.
    open_sums : bool
        Whether sums of parameters are expanded too; otherwise they are kept: (e − e_a).
    """

    def __init__(
        self,
        model: Model,
        order: Iterable[str],
        values: Mapping[str, Exact] | None = None,
        open_sums: bool = False,
    ):
        self.values = dict(values or {})
        self.open_sums = open_sums
        self.generators: list[Generator] = []
        self.classes: list[Class] = []
        self.places: list[Place] = []
        self._index: dict[Generator, int] = {}
        self._known: dict[Basic, Polynomial] = {}
        self._circles: dict[int, int] = {}
        self._class_of: dict[str, Class] = {"pi": "parameter"}
        # the written order of symbols is the order of their indices
        for name in ("pi", *order):
            self._class_of[name] = "parameter"
        coordinates = model.coordinate_names
        self._class_of.update(dict.fromkeys(coordinates, "function"))
        for c in model.constraint_names:
            self._class_of[multiplier(c).name] = "multiplier"
        self._class_of.update({acceleration(q).name: "acceleration" for q in coordinates})
        self._class_of.update({velocity(q).name: "velocity" for q in coordinates})
        for name in self._class_of:
            self.index(Generator("symbol", name))

    def index(self, generator: Generator) -> int:
        """Return the number of a generator."""
        number = self._index.get(generator)
        if number is None:
            number = self._index[generator] = len(self.generators)
            self.generators.append(generator)
            self.classes.append(self._classify(generator))
            self.places.append(((), 0, ""))
            self.places[number] = self._place(generator, number)
        return number

    def circle(self, g: int) -> int:
        """Return the number of cos x for that of sin x, and of sin x for cos x."""
        number = self._circles.get(g)
        if number is None:
            name = "sin" if self.generators[g].name == "cos" else "cos"
            number = self.index(Generator("function", name, self.generators[g].arguments))
            self._circles[g] = number
        return number

    def stand_for(self, name: str, coordinate: str) -> None:
        """Give a symbol that stands for a sum the place of its first coordinate."""
        self._class_of[name] = "function"
        number = self.index(Generator("symbol", name))
        self.places[number] = self.places[self.index(Generator("symbol", coordinate))]

    def order(self, monomial: Monomial) -> tuple[tuple[Place, int], ...]:
        """Return a key that sorts x² before x y before y², sin before cos, in the order of
        writing."""
        return tuple(sorted((self.places[g], -n) for g, n in monomial))

    def ranks(self, symbols: Iterable[Basic]) -> tuple[int, ...]:
        """Return the ranks of symbols in the order of writing."""
        return tuple(sorted(self.index(Generator("symbol", s.name)) for s in symbols))

    def _place(self, generator: Generator, index: int) -> Place:
        """Return the sort key of a generator: by its symbols, then sin before cos."""
        if generator.head == "symbol":
            return (index,), 0, ""
        free = set().union(*(a.free_symbols for a in generator.arguments))
        kind = {"sin": 1, "cos": 2, "tan": 3}.get(generator.name, 4)
        return self.ranks(free), kind, f"{generator.name} {generator.arguments}"

    def _classify(self, generator: Generator) -> Class:
        if generator.head == "symbol":
            return self._class_of.get(generator.name, "function")
        free = set().union(*(a.free_symbols for a in generator.arguments))
        inside = {self._class_of.get(s.name, "function") for s in free}
        return "parameter" if inside <= {"parameter"} else "function"

    def class_of(self, symbol: Basic) -> Class:
        """Return the class of a symbol."""
        return self._class_of.get(symbol.name, "function")

    def is_parameter(self, symbol: Basic) -> bool:
        """Whether a symbol is a parameter."""
        return self.class_of(symbol) == "parameter"

    def polynomial(self, expression: Basic) -> Polynomial:
        """Expand an expression.

        Raises
        ------
        TooLarge
            It has more than `MAX_TERMS` terms.
        """
        known = self._known.get(expression)
        if known is None:
            known = self._known[expression] = self._expand(expression)
        return known

    def _expand(self, e: Basic) -> Polynomial:
        if isinstance(e, se.Number):
            value = exact(e)
            return {UNIT: value} if value else {}
        if isinstance(e, se.Symbol):
            if e.name in self.values:
                value = self.values[e.name]
                return {UNIT: value} if value else {}
            return self._one(Generator("symbol", e.name))
        if isinstance(e, se.Add):
            return self._sum(e)
        if isinstance(e, se.Mul):
            total: Polynomial = {UNIT: 1}
            for factor in e.args:
                total = product(total, self.polynomial(factor))
            return total
        if isinstance(e, se.Pow):
            return self._power(*e.args)
        if isinstance(e, se.Piecewise):
            return self._cases(e)
        if e == se.pi:
            return self._constant(math.pi) or self._one(Generator("symbol", "pi"))
        return self._function(e)

    def _one(self, generator: Generator, exponent: int = 1) -> Polynomial:
        return {((self.index(generator), exponent),): 1}

    def _constant(self, value: float) -> Polynomial | None:
        """Return a number if parameters have values; else constants are kept."""
        return {UNIT: Fraction(repr(value))} if self.values and math.isfinite(value) else None

    def _number(self, e: Basic) -> Fraction | None:
        """Return the value of an expression that is a number after substitution of parameters."""
        if not self.values or any(s.name not in self.values for s in e.free_symbols):
            return None
        terms = self.polynomial(e)
        if not terms:
            return Fraction(0)
        return Fraction(terms[UNIT]) if set(terms) == {UNIT} else None

    def exponent(self, e: Basic) -> Basic:
        """Return an exponent, or its value if the parameters in it have values."""
        number = None if isinstance(e, se.Number) else self._number(e)
        return e if number is None else se.Rational(*number.as_integer_ratio())

    def _sum(self, e: Basic) -> Polynomial:
        if self._of_parameters(e):
            sign, whole = self.oriented(e)
            numbers = whole.as_coefficients_dict()
            content = Fraction(0)
            for c in numbers.values():
                content = _gcd(content, Fraction(exact(c)))
            if content not in (0, 1):
                whole = se.Add(*[x / se.Rational(*content.as_integer_ratio()) for x in whole.args])
            if isinstance(whole, se.Add):
                return {((self.index(Generator("sum", "", (whole,))), 1),): sign * content}
        total: Polynomial = {}
        for term in e.args:
            for monomial, coefficient in self.polynomial(term).items():
                add_to(total, monomial, coefficient)
            if len(total) > MAX_TERMS:
                raise TooLarge
        return total

    def _of_parameters(self, e: Basic) -> bool:
        """Whether a sum contains only parameters and is kept: (e − e_a)."""
        if self.values or self.open_sums:
            return False
        return all(self._class_of.get(s.name) == "parameter" for s in e.free_symbols)

    def oriented(self, e: Basic) -> tuple[int, Basic]:
        """Return ±1 and ±e, such that the first name in writing order has a positive sign."""
        first: tuple[tuple[int, ...], Exact] | None = None
        for term, coefficient in e.as_coefficients_dict().items():
            ranks = tuple(
                sorted(self.index(Generator("symbol", s.name)) for s in term.free_symbols)
            ) or (10**9,)
            if first is None or ranks < first[0]:
                first = ranks, exact(coefficient)
        if first is not None and first[1] < 0:
            return -1, se.expand(-e)
        return 1, e

    def _power(self, base: Basic, exponent: Basic) -> Polynomial:
        exponent = self.exponent(exponent)
        if base == se.E:
            value = self._number(exponent)
            if value is not None:
                return self._constant(math.exp(value)) or {}
            return self._one(Generator("function", "exp", (exponent,)))
        if not isinstance(exponent, se.Integer | se.Rational):
            return self._one(Generator("power", "", (base, exponent)))
        power = Fraction(exact(exponent))
        value = self._number(base)
        if value is None and isinstance(base, se.Add) and (power < 0 or power.denominator > 1):
            hidden = constant_value(base)
            if hidden is not None and exact(hidden) > 0:
                return self.polynomial(hidden**exponent)
        if value is not None:
            if power.denominator == 1 and (value != 0 or power > 0) and abs(power) <= 20:
                return {UNIT: value ** int(power)} if value else {}
            if value > 0:
                return self._constant(float(value) ** float(power)) or {}
        if power.denominator != 1:
            root = Generator("root", "", (base,), power.denominator)
            return self._one(root, power.numerator)
        n = power.numerator
        if isinstance(base, se.Add):
            inside = self.polynomial(base)
            if len(inside) == 1:  # a sum of parameters, or one that collapsed
                ((monomial, coefficient),) = inside.items()
                return {tuple((g, k * n) for g, k in monomial): Fraction(coefficient) ** n}
            if n < 0 or n > 8 or (n > 1 and self._hard(inside)):
                if n % 2 == 0 and all(c < 0 for c in inside.values()):
                    base = -base  # (−a − b)² is (a + b)²
                return self._one(Generator("sum", "", (base,)), n)
            total = inside
            for _ in range(n - 1):
                total = product(total, inside)
            return total
        inside = self.polynomial(base)
        if len(inside) == 1:
            ((monomial, coefficient),) = inside.items()
            return {tuple((g, k * n) for g, k in monomial): Fraction(coefficient) ** n}
        return self._one(Generator("sum", "", (base,)), n)

    def opened(self, terms: Polynomial, below: Monomial) -> Polynomial | None:
        """Return terms with the sums of a denominator expanded; None if there are none.

        Parameters
        ----------
        terms : Polynomial
        below : Monomial
            Monomial whose negative powers are the denominator.
        """
        sums = {g for g, n in below if n < 0 and self.generators[g].head in ("sum", "root")}
        degrees = {g: self.generators[g].degree for g in sums}
        if not any(g in sums and n >= degrees[g] for m in terms for g, n in m):
            return None
        total: Polynomial = {}
        try:
            for monomial, coefficient in terms.items():
                left = [(g, n % degrees[g] if g in sums and n > 0 else n) for g, n in monomial]
                parts: Polynomial = {tuple(x for x in left if x[1]): coefficient}
                for g, n in monomial:
                    for _ in range(n // degrees[g] if g in sums and n > 0 else 0):
                        parts = product(parts, self.polynomial(self.generators[g].arguments[0]))
                for m, c in parts.items():
                    add_to(total, m, c)
        except TooLarge:
            return None
        return total

    def _hard(self, terms: Polynomial) -> bool:
        """Whether a sum contains roots or quotients, which squaring would multiply."""
        return any(
            exponent < 0 or self.generators[g].head in ("root", "cases", "power")
            for monomial in terms
            for g, exponent in monomial
            if self.classes[g] != "parameter"
        )

    def _cases(self, e: Basic) -> Polynomial:
        """Return cases that agree as their common value; otherwise as a generator."""
        first, *others = [self.polynomial(value) for value in e.args[::2]]
        if all(other == first for other in others):
            return first
        return self._one(Generator("cases", "", (e,)))

    def _function(self, e: Basic) -> Polynomial:
        name = name_of_function(e)
        arguments = e.args
        if self.values:
            numbers = [self._number(a) for a in arguments]
            if all(n is not None for n in numbers):
                exact = [float(n) for n in numbers if n is not None]
                value = float(
                    apply(name, *map(se.RealDouble, exact)) if is_opaque(e) else e.func(*exact)
                )
                return self._constant(value) or {}
        if name in ("sin", "cos", "tan") and isinstance(arguments[0], se.Add | se.Mul):
            sign, argument = self.oriented(arguments[0])
            sign = 1 if name == "cos" else sign
            return {((self.index(Generator("function", name, (argument,))), 1),): sign}
        return self._one(Generator("function", name, arguments))


def _gcd(a: Fraction, b: Fraction) -> Fraction:
    """Return the greatest fraction of which both are multiples."""
    return Fraction(
        math.gcd(a.numerator * b.denominator, b.numerator * a.denominator),
        a.denominator * b.denominator,
    )


def content_of(values: Iterable[Exact]) -> Fraction:
    """Return the greatest fraction of which all values are multiples."""
    content = Fraction(0)
    for value in values:
        content = _gcd(content, Fraction(value))
    return content or Fraction(1)


def shorten(terms: Polynomial, expansion: MonomialExpansion) -> Polynomial:
    """Return an equal sum, shortened by

    sin² a + cos² a = 1, cos a cos b ± sin a sin b = cos(a ∓ b),
    sin a cos b ± cos a sin b = sin(a ± b).
    """
    work: Polynomial = dict(terms)
    while _squares(work, expansion) or _products(work, expansion):
        pass
    return work


def _circular(
    monomial: Monomial, expansion: MonomialExpansion
) -> list[tuple[str, se.Basic, int, int]]:
    """Return (name, angle, generator, exponent) of the sines and cosines in a monomial."""
    circular = []
    for g, exponent in monomial:
        generator = expansion.generators[g]
        if generator.name in ("sin", "cos") and generator.head == "function" and exponent > 0:
            circular.append((generator.name, generator.arguments[0], g, exponent))
    return circular


def _squares(terms: Polynomial, expansion: MonomialExpansion) -> bool:
    changed = False
    for monomial in list(terms):
        for _, _, g, exponent in _circular(monomial, expansion):
            if exponent < 2 or monomial not in terms:
                continue
            base = times(monomial, ((g, -2),))
            partner = times(base, ((expansion.circle(g), 2),))
            here: Exact = terms[monomial]
            there: Exact = terms.get(partner, 0)
            if here * there > 0:
                common: Exact = here if here / there <= 1 else there  # the smaller one
                for m in (monomial, partner):
                    add_to(terms, m, -common)
                add_to(terms, base, common)
                changed = True
            elif terms.get(base) == -here:
                del terms[base], terms[monomial]
                add_to(terms, partner, -here)
                changed = True
    return changed


def _products(terms: Polynomial, expansion: MonomialExpansion) -> bool:
    changed = False
    for monomial in list(terms):
        circular = _circular(monomial, expansion)
        for i, (name_a, a, g, _) in enumerate(circular):
            for name_b, b, h, _ in circular[i + 1 :]:
                if monomial in terms and a != b:
                    changed |= _addition(terms, expansion, monomial, (name_a, a, g), (name_b, b, h))
    return changed


def _addition(
    terms: Polynomial,
    expansion: MonomialExpansion,
    monomial: Monomial,
    first: tuple[str, se.Basic, int],
    second: tuple[str, se.Basic, int],
) -> bool:
    (name_a, a, g), (name_b, b, h) = first, second
    p, r = expansion.circle(g), expansion.circle(h)
    partner = times(monomial, ((g, -1), (h, -1), (p, 1), (r, 1)))
    there = terms.get(partner)
    if there is None:
        return False
    here = terms[monomial]
    if abs(here) != abs(there):
        return False
    base = times(monomial, ((g, -1), (h, -1)))
    same = here == there
    if name_a == name_b:  # cos a cos b ± sin a sin b
        value = se.cos(se.expand(a - b) if same else se.expand(a + b))
        coefficient = here if same or name_a == "cos" else there
    else:  # sin a cos b ± cos a sin b
        if name_a == "cos":
            a, b = b, a
        value = se.sin(se.expand(a + b) if same else se.expand(a - b))
        coefficient = here
    del terms[monomial], terms[partner]
    for m, c in expansion.polynomial(value).items():
        add_to(terms, times(base, m), coefficient * c)
    return True
