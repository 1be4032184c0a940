"""Factored terms: order of factors, and factorization of sums."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Literal

from lagcli.equations.simplification.monomials import (
    Class,
    Exact,
    Monomial,
    MonomialExpansion,
    Polynomial,
    add_to,
    content_of,
    product,
    times,
)
from lagcli.equations.typesetting.nodes import (
    Call,
    Node,
    Number,
    Power,
    Product,
    Root,
    Sum,
    forward,
    product_of,
    quotient_of,
    signed,
    sum_of,
    weight,
)
from lagcli.equations.typesetting.writer import LARGEST_DENOMINATOR

SortKey = tuple[Any, ...]
ContentStyle = Literal["shortest", "whole", "decimal"]

# order of factors in a term: λ m (a + b) r (φ̇ + ψ̇) φ̇ sin φ (φ̇ + ψ̇)² […]
MULTIPLIER, PARAMETER, POSITION, BRACKET = range(4)
ACCELERATION, VELOCITY, FUNCTION, SQUARE, LAST = range(4, 9)


#: Characters of sums beyond which they are written behind a fraction: there they can be broken.
_LONG_BRACKETS = 28


@dataclass(frozen=True)
class TermFactor:
    """A factor base^exponent with its sort key."""

    node: Node
    exponent: Fraction
    key: SortKey

    @property
    def written(self) -> Node:
        """The factor with the absolute value of its exponent."""
        power = abs(self.exponent)
        if power == 1:
            return self.node
        if power in (Fraction(1, 2), Fraction(1, 3)):
            return Root(self.node, power.denominator)
        return Power(self.node, Number(power))


@dataclass(frozen=True)
class Term:
    """A coefficient times factors."""

    coefficient: Fraction
    factors: tuple[TermFactor, ...]

    def __mul__(self, other: Term) -> Term:
        a, b = self.coefficient, other.coefficient
        return Term(b if a == 1 else a if b == 1 else a * b, self.factors + other.factors)

    def node(self) -> Node:
        """Return the term with sorted factors and negative powers in the denominator."""
        ordered = sorted(_with_tangents(self.factors), key=lambda f: f.key)
        below = [f.written for f in ordered if f.exponent < 0]
        above = [f.written for f in ordered if f.exponent > 0]
        number = Number(self.coefficient)
        if self.coefficient == -1 and len(above) == len(ordered) == 1 and isinstance(above[0], Sum):
            opened = [(-sign, term) for sign, term in above[0].terms]  # −(a − b) is b − a
            return sum_of(sorted(opened, key=lambda x: x[0] < 0))
        if not below:
            return product_of([number, *above])
        brackets: list[Node] = [n for n in above if isinstance(n, Sum)]
        plain: list[Node] = [n for n in above if not isinstance(n, Sum)]
        if sum(map(weight, brackets)) <= _LONG_BRACKETS or (not plain and len(brackets) == 1):
            plain, brackets = above, []
        fraction = quotient_of(product_of([number, *plain]), product_of(below))
        return product_of([fraction, *brackets])


def _with_tangents(factors: Iterable[TermFactor]) -> list[TermFactor]:
    """Return factors with tan x for sin x/cos x."""
    with_tangents = list(factors)
    circular = {x.node: x for x in with_tangents if isinstance(x.node, Call)}
    for node, sine in circular.items():
        if not isinstance(node, Call) or node.function != "sin" or sine.exponent <= 0:
            continue
        cosine = circular.get(Call("cos", node.arguments))
        if cosine is None or cosine.exponent >= 0:
            continue
        common = min(sine.exponent, -cosine.exponent)
        left = [(sine, sine.exponent - common), (cosine, cosine.exponent + common)]
        with_tangents = [x for x in with_tangents if x is not sine and x is not cosine]
        with_tangents += [TermFactor(x.node, power, x.key) for x, power in left if power]
        with_tangents.append(TermFactor(Call("tan", node.arguments), common, sine.key))
    return with_tangents


@dataclass(frozen=True)
class Factored:
    """content · common · rest^exponent."""

    content: Fraction
    common: Monomial
    rest: Polynomial
    exponent: int


def factored(
    terms: Polynomial,
    order: Callable[[Monomial], Any],
    style: ContentStyle,
    over_one: bool = True,
) -> Factored:
    """Factor a sum by inspection: common factors and perfect squares.

    Parameters
    ----------
    terms : polynomial with two or more terms
    order : function of a monomial
        Sort key of the written terms.
    style : str
        See `presentable_content`.
    over_one : bool
        Whether fractions are put over one denominator, as (m R² + J)/R², or stay: m + J/R².
    """
    common = common_part(terms)
    if not over_one:
        whole = {g for m in terms for g in dict(common) if dict(m).get(g, 0) >= 0}
        common = tuple(x for x in common if x[1] > 0 or x[0] not in whole)
    content = presentable_content(terms.values(), style)
    leading = terms[min(terms, key=order)]
    if all(c < 0 for c in terms.values()) or (leading < 0 and common):
        content = -content
    rest: Polynomial = {divide(m, common): c / content for m, c in terms.items()}
    root = square_root(rest)
    if root is not None:
        return Factored(content, common, root, 2)
    return Factored(content, common, rest, 1)


def common_part(terms: Iterable[Monomial]) -> Monomial:
    """Return the greatest common monomial divisor of all terms."""
    shared: dict[int, int] | None = None
    for monomial in terms:
        exponents = dict(monomial)
        if shared is None:
            shared = exponents
            continue
        for g in set(shared) | set(exponents):
            shared[g] = min(shared.get(g, 0), exponents.get(g, 0))
    return tuple(sorted((g, n) for g, n in (shared or {}).items() if n))


def divide(monomial: Monomial, by: Monomial) -> Monomial:
    """Return monomial/by."""
    if not by:
        return monomial
    return times(monomial, tuple((g, -n) for g, n in by))


def presentable_content(values: Iterable[Exact], style: ContentStyle) -> Fraction:
    """Return the number to factor out of a sum.

    ``shortest`` minimizes the written length, ``whole`` leaves integers without a common factor,
    ``decimal`` keeps decimals unless they are all equal.
    """
    listed = [Fraction(v) for v in values]
    if len({abs(v) for v in listed}) == 1:
        return abs(listed[0])
    if style == "decimal" or any(v.denominator > LARGEST_DENOMINATOR for v in listed):
        return Fraction(1)  # 0.0589 x − 0.0076 y, not 0.0001 (589 x − 76 y)
    content = content_of(listed)
    if style == "whole":
        return content
    written = sum(_signs(v) for v in listed)
    taken = _signs(content) + sum(_signs(v / content) for v in listed)
    return content if taken < written or (taken == written and content > 1) else Fraction(1)


def _signs(value: Fraction) -> int:
    """Return the number of characters of a coefficient."""
    if abs(value) == 1:
        return 0
    return len(str(abs(value.numerator))) + (value.denominator > LARGEST_DENOMINATOR) * 2


def square_root(terms: Mapping[Monomial, Exact]) -> Polynomial | None:
    """Return the linear form whose square the sum is, or None."""
    if not 3 <= len(terms) <= 15:
        return None
    roots: dict[int, Fraction] = {}
    for monomial, c in terms.items():
        if sum(n for _, n in monomial) != 2 or any(n < 0 for _, n in monomial):
            return None
        if len(monomial) == 1:
            value = _rational_root(Fraction(c))
            if value is None:
                return None
            roots[monomial[0][0]] = value
    if not roots:
        return None
    first = min(roots)
    form: Polynomial = {}
    for g, value in roots.items():
        cross = terms.get(tuple(sorted(((first, 1), (g, 1)))), 0) if g != first else 1
        form[((g, 1),)] = value if cross > 0 else -value
    squared = product(form, form)
    return form if squared == dict(terms) else None


def squares(
    terms: Mapping[Monomial, Exact],
) -> tuple[list[tuple[Fraction, Polynomial]], Polynomial]:
    """Split perfect squares off a sum: a² − 2 a b + b² + c² is (a − b)² and c².

    Returns
    -------
    list of (Fraction, Polynomial)
        Coefficients of the squares of sums, and the sums.
    Polynomial
        The other terms.
    """
    joined: dict[int, set[int]] = {}
    for monomial in terms:
        if len(monomial) == 2 and all(n == 1 for _, n in monomial):
            group: set[int] = set()
            for g, _ in monomial:
                group |= joined.get(g, {g})
            joined.update(dict.fromkeys(group, group))
    forms: list[tuple[Fraction, Polynomial]] = []
    rest: Polynomial = dict(terms)
    for group in {id(x): x for x in joined.values()}.values():
        part = {m: c for m, c in terms.items() if any(g in group for g, _ in m)}
        content = presentable_content(part.values(), "whole")
        content *= -1 if any(c < 0 for m, c in part.items() if len(m) == 1) else 1
        root = square_root({m: c / content for m, c in part.items()})
        if root is not None:
            forms.append((content, root))
            rest = {m: c for m, c in rest.items() if m not in part}
    return forms, rest


def _rational_root(value: Fraction) -> Fraction | None:
    if value < 0:
        return None
    root = Fraction(math.isqrt(value.numerator), math.isqrt(value.denominator))
    return root if root * root == value else None


MOVING = ("multiplier", "acceleration", "velocity")


@dataclass(frozen=True)
class Pair:
    """A sum of functions of position times a sum of motion variables."""

    functions: Polynomial
    motion: Polynomial
    motion_class: int  # 0: with accelerations, 1: with velocities, 2: neither
    complexity: int  # number of factors of the simplest function


@dataclass(frozen=True)
class TermGroup:
    """A sum of parameter monomials times a sum of the remaining factors."""

    parameters: Polynomial
    rest: Polynomial


def groups(terms: Polynomial, expansion: MonomialExpansion) -> list[TermGroup]:
    """Collect terms by parameters, and merge groups whose remaining factors are equal.

    m₁ l² θ̈ + m₂ l² θ̈ becomes (m₁ l² + m₂ l²) · θ̈.
    """
    sums: dict[Monomial, Polynomial] = {}
    for monomial, c in terms.items():
        outer, inner = _split(monomial, expansion, ("parameter",))
        add_to(sums.setdefault(outer, {}), inner, c)
    return [TermGroup(a, b) for a, b in _merged(sums, expansion)]


def pairs(terms: Polynomial, expansion: MonomialExpansion) -> list[Pair]:
    """Collect terms by functions of position, and merge groups with the same motion."""
    sums: dict[Monomial, Polynomial] = {}
    for monomial, c in terms.items():
        motion, function = _split(monomial, expansion, MOVING)
        add_to(sums.setdefault(function, {}), motion, c)
    return [
        Pair(a, b, _motion_class(b, expansion), min(_complexity(m, expansion) for m in a))
        for a, b in _merged(sums, expansion)
    ]


def shared_by(parts: list[Pair], expansion: MonomialExpansion) -> Monomial:
    """Return the common factor of terms: common symbols, and functions with equal exponents.

    sin² φ and sin φ cos φ keep their sines, as in the textbook.
    """
    functions = [m for p in parts for m in p.functions]
    motions = [m for p in parts for m in p.motion]
    common = []
    for g, n in common_part(functions):
        is_symbol = expansion.generators[g].head == "symbol"
        if is_symbol or all(dict(m).get(g) == n for m in functions):
            common.append((g, n))
    return times(tuple(common), common_part(motions))


def _split(
    monomial: Monomial, expansion: MonomialExpansion, classes: tuple[Class | str, ...]
) -> tuple[Monomial, Monomial]:
    inside = tuple(x for x in monomial if expansion.classes[x[0]] in classes)
    outside = tuple(x for x in monomial if expansion.classes[x[0]] not in classes)
    return inside, outside


def _merged(
    sums: Mapping[Monomial, Polynomial], expansion: MonomialExpansion
) -> list[tuple[Polynomial, Polynomial]]:
    """Merge the monomials whose sums are proportional."""
    joined: dict[frozenset[tuple[Monomial, Exact]], tuple[Polynomial, Polynomial]] = {}
    for outer, inner in sums.items():
        if not inner:
            continue
        scale = Fraction(inner[min(inner, key=expansion.order)])
        normal: Polynomial = inner if scale == 1 else {m: c / scale for m, c in inner.items()}
        signature = frozenset(normal.items())
        outers, _ = joined.setdefault(signature, ({}, normal))
        add_to(outers, outer, scale)
    return list(joined.values())


def _motion_class(motion: Polynomial, expansion: MonomialExpansion) -> int:
    kinds = {expansion.classes[g] for m in motion for g, _ in m}
    return 0 if "acceleration" in kinds else 1 if "velocity" in kinds else 2


def _complexity(monomial: Monomial, expansion: MonomialExpansion) -> int:
    return sum(abs(n) for g, n in monomial if expansion.generators[g].head != "symbol")


Key = tuple[object, ...]


def ordered(terms: Iterable[tuple[Key, Node]], follows: bool = False) -> Node:
    """Return a sorted sum.

    Parameters
    ----------
    terms : iterable of (key, node)
        The terms with their sort keys, whose first entry is the class of a term.
    follows : bool
        Whether the sum follows other terms. If not, a leading class with a positive term starts
        with it: b − a, not −a + b.
    """
    in_order = _sorted(terms)
    if in_order and in_order[0][1] < 0 and not follows:
        kind = in_order[0][0][0]
        for i, (key, sign, _) in enumerate(in_order):
            if sign > 0 and (key[0] == kind or kind != 0):
                in_order.insert(0, in_order.pop(i))
                break
    return sum_of((sign, term) for _, sign, term in in_order)


def oriented(terms: Iterable[tuple[Key, Node]]) -> tuple[int, Node]:
    """Return ±1 and ±sum, so that the first term is positive.

    The order does not depend on signs: sums that differ only in signs are arranged equally.
    """
    return forward(sum_of((sign, term) for _, sign, term in _sorted(terms)))


def _sorted(terms: Iterable[tuple[Key, Node]]) -> list[tuple[Key, int, Node]]:
    """Return the terms of a sum in order, with nested sums flattened."""
    return [
        (key, sign, term)
        for key, node in sorted(terms, key=lambda t: t[0])
        for sign, term in (node.terms if isinstance(node, Sum) else (signed(node),))
    ]


def without_content(node: Node) -> tuple[Fraction, Node]:
    """Factor a number out of a sum if all terms share it."""
    if not isinstance(node, Sum):
        return Fraction(1), node
    numbers = []
    for _, term in node.terms:
        first = term.factors[0] if isinstance(term, Product) else term
        numbers.append(first.value if isinstance(first, Number) else Fraction(1))
    content = presentable_content(numbers, "whole")
    if content == 1:
        return content, node
    scale = Number(1 / content)
    return content, sum_of((sign, product_of([scale, term])) for sign, term in node.terms)
