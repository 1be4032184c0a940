"""Arrangement of SymEngine expressions for reading.

An expression is expanded to monomials and shortened. Then common parameters are factored out, terms
are collected by functions of position, and accelerations are written before velocities before the
rest:

    m r² [φ̈ + (φ̈ + ψ̈) sin² φ + (φ̇² − ψ̇²) sin φ cos φ] + m g r cos φ

If the result is longer than the original expression, the original structure is kept.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fractions import Fraction

import symengine as se
from symengine import Basic

from lagcli.columns import read_dotted_name
from lagcli.equations.presentation.typeset import (
    ZERO,
    Call,
    Node,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    forward,
    product_of,
    signed,
    sum_of,
    weight,
)
from lagcli.equations.simplification import factors as position
from lagcli.equations.simplification import trigonometry
from lagcli.equations.simplification.branches import cases_node
from lagcli.equations.simplification.factors import (
    ContentStyle,
    Term,
    TermFactor,
    divide,
    factored,
    presentable_content,
)
from lagcli.equations.simplification.grouping import Pair, TermGroup, groups, pairs, shared_by
from lagcli.equations.simplification.monomials import (
    Exact,
    Monomial,
    MonomialExpansion,
    Polynomial,
    TooLarge,
)
from lagcli.equations.simplification.ordering import writing_order
from lagcli.model.inputs import as_symbols
from lagcli.model.model import Model

Key = tuple[object, ...]

# Keeping the structure of a large expression is expensive because every part is arranged
# separately, and it does not beat an expansion that is shorter than the original by this factor.
_LARGE = 200
_SHORTER = 0.4

_SYMBOL_PLACES = {
    "multiplier": position.MULTIPLIER,
    "parameter": position.PARAMETER,
    "function": position.POSITION,
    "acceleration": position.ACCELERATION,
    "velocity": position.VELOCITY,
}


class Arranger:
    """Arranges the expressions of one model.

    Parameters
    ----------
    model : Model
    values : mapping of str to exact numbers, optional
        Parameters to replace by their values.
    named : bool
        Whether roots are replaced by the names of definitions with the same value.
    """

    def __init__(
        self, model: Model, values: Mapping[str, Exact] | None = None, named: bool = False
    ):
        order = writing_order(model)
        self._roots = _defined_roots(model) if named else {}
        self._whole = MonomialExpansion(model, order, values)
        self._opened = MonomialExpansion(model, order, values, open_sums=True)
        self._inputs = bool(model.inputs)
        self._known: dict[Basic, Node] = {}

    def arrange(self, expression: Basic) -> Node:
        """Return the arranged expression.

        Parameters
        ----------
        expression : SymEngine expression
            In the model's symbols.

        Returns
        -------
        Node
        """
        known = self._known.get(expression)
        if known is None:
            shown = as_symbols(expression) if self._inputs else expression
            known = self._known[expression] = self._best(shown)
        return known

    def _best(self, e: Basic) -> Node:
        whole = self._expanded(e, self._whole)
        operations = se.count_ops(e)
        if whole is not None and operations > _LARGE and weight(whole) < _SHORTER * operations:
            return whole
        candidates = [whole, self._multiplied_out(e)]
        if isinstance(e, se.Add | se.Mul | se.Pow):
            candidates.append(self._structured(e))
        best = min((c for c in candidates if c is not None), key=weight)
        collected = self._collected(e)
        if collected is not None and weight(collected) < 1.5 * weight(best):
            return collected  # collected accelerations may cost some more characters
        return best

    def _collected(self, e: Basic) -> Node | None:
        """Return a sum with its accelerations collected; None without accelerations."""
        if not isinstance(e, se.Add):
            return None
        moving: list[Basic] = []
        resting: list[Basic] = []
        for term in e.args:
            kinds = {self._whole.class_of(s) for s in term.free_symbols}
            (moving if kinds & {"acceleration", "velocity"} else resting).append(term)
        kinds = {self._whole.class_of(s) for s in e.free_symbols}
        if "acceleration" not in kinds:
            return None
        first = self._expanded(se.Add(*moving), self._whole)
        if first is None:
            return None
        return sum_of([(1, first), (1, self.arrange(se.Add(*resting)))])

    # expanded

    def _expanded(self, e: Basic, expansion: MonomialExpansion) -> Node | None:
        """Return the expression expanded and collected; None if the expansion is too large."""
        try:
            terms = expansion.polynomial(e)
        except TooLarge:
            return None
        if isinstance(e, se.Add) and _is_whole(terms, expansion):
            return None
        terms = trigonometry.shorten(terms, expansion)
        return _ordered(self._group(g, expansion) for g in groups(terms, expansion))

    def _multiplied_out(self, e: Basic) -> Node | None:
        """Return the expression with sums of parameters also expanded, if there are any."""
        whole = self._whole
        try:
            used = {g for m in whole.polynomial(e) for g, _ in m}
        except TooLarge:
            return None
        if any(whole.generators[g].head == "sum" and whole.classes[g] == "parameter" for g in used):
            return self._expanded(e, self._opened)
        return None

    def _group(self, group: TermGroup, expansion: MonomialExpansion) -> tuple[Key, Node]:
        """Arrange parameters times a sum over functions and motion."""
        order = expansion.order
        style: ContentStyle = "decimal" if expansion.values else "shortest"
        outer = self._sum_factors(group.parameters, expansion, style)
        parts = pairs(group.rest, expansion)
        key = (
            min(p.motion_class for p in parts),
            min(p.complexity for p in parts),
            min(map(order, group.parameters)),
            min(map(order, group.rest)),
        )
        if len(parts) == 1:
            inner = self._pair(parts[0].functions, parts[0].motion, expansion)
            return key, (outer * inner).node()
        common = shared_by(parts, expansion)
        numbers = [outer.coefficient * c for p in parts for c in self._coefficients(p, expansion)]
        content = presentable_content(numbers, style)
        scale = outer.coefficient / content
        outer = Term(content, outer.factors)
        moving = tuple(x for x in common if expansion.classes[x[0]] != "function")
        still = tuple(x for x in common if expansion.classes[x[0]] == "function")
        terms: list[tuple[Key, Node]] = []
        for part in parts:
            functions: Polynomial = {divide(m, still): c * scale for m, c in part.functions.items()}
            motion = {divide(m, moving): c for m, c in part.motion.items()}
            simplest = min(map(order, functions)), min(map(order, motion))
            key = (part.motion_class, part.complexity, *simplest)
            terms.append((key, self._pair(functions, motion, expansion).node()))
        sign, bracket = _oriented(terms)
        shared = self._monomial(common, expansion)
        last = TermFactor(bracket, Fraction(1), (position.LAST,))
        return key, (outer * Term(Fraction(sign), (*shared, last))).node()

    def _coefficients(self, pair: Pair, expansion: MonomialExpansion) -> list[Fraction]:
        """Return the numeric coefficients of the terms of a pair."""
        inner = self._sum_factors(pair.motion, expansion).coefficient
        if len(pair.functions) > 1:
            return [self._sum_factors(pair.functions, expansion).coefficient * inner]
        return [Fraction(c) * inner for c in pair.functions.values()]

    def _pair(
        self, functions: Polynomial, motion: Polynomial, expansion: MonomialExpansion
    ) -> Term:
        return self._sum_factors(functions, expansion) * self._sum_factors(motion, expansion)

    def _sum_factors(
        self, terms: Polynomial, expansion: MonomialExpansion, style: ContentStyle = "whole"
    ) -> Term:
        """Return a sum of monomials as factors: content, common monomial, remaining sum."""
        if len(terms) == 1:
            ((monomial, coefficient),) = terms.items()
            return Term(Fraction(coefficient), self._monomial(monomial, expansion))
        split = factored(terms, expansion.order, "decimal" if expansion.values else style)
        opened = expansion.opened(split.rest, split.common) if split.exponent == 1 else None
        if opened:  # (s + y²)/s with s = l² − y² is l²/s
            opened = trigonometry.shorten(opened, expansion)
            inner = self._sum_factors(opened, expansion, style)
            return Term(split.content, self._monomial(split.common, expansion)) * inner
        sign, bracket = _oriented(
            ((expansion.order(m),), Term(Fraction(c), self._monomial(m, expansion)).node())
            for m, c in split.rest.items()
        )
        constant = all(expansion.classes[g] == "parameter" for m in terms for g, _ in m)
        key = position.SQUARE if split.exponent > 1 else position.BRACKET
        key = position.PARAMETER if constant else key
        rank = min(expansion.order(m) for m in split.rest if m)
        factor = TermFactor(bracket, Fraction(split.exponent), (key, rank))
        return Term(
            split.content * sign**split.exponent,
            (*self._monomial(split.common, expansion), factor),
        )

    def _monomial(self, monomial: Monomial, expansion: MonomialExpansion) -> tuple[TermFactor, ...]:
        return tuple(self._generator(g, exponent, expansion) for g, exponent in monomial)

    # generators

    def _generator(self, g: int, exponent: int, expansion: MonomialExpansion) -> TermFactor:
        """Return a power of a generator as a factor."""
        generator, kind = expansion.generators[g], expansion.classes[g]
        power = Fraction(exponent, generator.degree)
        first, *rest = generator.arguments or (None,)
        match generator.head:
            case "symbol":
                rank = ((expansion.places[g], 0),)
                return TermFactor(
                    _symbol(generator.name, kind), power, (_SYMBOL_PLACES[kind], rank)
                )
            case "function":
                node: Node = Call(generator.name, tuple(map(self.arrange, generator.arguments)))
            case "cases":
                node = cases_node(first, self.arrange)
            case "power":
                node = Power(self.arrange(first), self.arrange(rest[0]))
            case "root" if (first, generator.degree) in self._roots:
                node = Symbol(self._roots[first, generator.degree])
                power = Fraction(exponent)
            case "root" | "sum":
                node = self.arrange(first)
        key = position.FUNCTION
        if generator.head == "sum":
            key = position.BRACKET if power == 1 else position.SQUARE
            key = position.PARAMETER if kind == "parameter" else key
        return TermFactor(node, power, (key, ((expansion.places[g], 0),)))

    # structured

    def _structured(self, e: Basic) -> Node:
        """Return the expression with its structure kept and its parts arranged."""
        if isinstance(e, se.Add):
            return self._structured_sum(e)
        return self._structured_term(e).node()

    def _structured_term(self, e: Basic) -> Term:
        term = Term(Fraction(1), ())
        for part in e.args if isinstance(e, se.Mul) else (e,):
            term = term * self._structured_factor(part)
        return term

    def _structured_factor(self, e: Basic) -> Term:
        base, exponent = e.args if isinstance(e, se.Pow) else (e, se.Integer(1))
        expansion = self._whole
        if isinstance(base, se.Add) and isinstance(exponent, se.Integer):
            n = int(exponent)
            sign, node = forward(self.arrange(base))
            content, node = _without_content(node)
            constant = all(expansion.is_parameter(s) for s in base.free_symbols)
            key = position.BRACKET if n == 1 else position.SQUARE
            key = position.PARAMETER if constant else key
            rank = (((expansion.ranks(base.free_symbols), 0, ""), 0),)
            factor = TermFactor(node, Fraction(n), (key, rank))
            return Term((sign * content) ** n, (factor,))
        try:
            terms = expansion.polynomial(e)
        except TooLarge:
            terms = {}
        if len(terms) == 1:
            ((monomial, coefficient),) = terms.items()
            return Term(Fraction(coefficient), self._monomial(monomial, expansion))
        # expressions that expand to a sum or to zero without being a sum or a product
        return Term(Fraction(1), (TermFactor(self.arrange(e), Fraction(1), (position.LAST,)),))

    def _structured_sum(self, e: Basic) -> Node:
        """Return a sum with each term arranged and common parameters factored out."""
        found: dict[Basic, list[Basic]] = {}
        for term in e.args:
            outer, inner = self._split(term)
            found.setdefault(outer, []).append(inner)
        terms: list[tuple[Key, Node]] = []
        for outer, inners in found.items():
            if outer == 1 or len(inners) == 1:
                terms.extend((self._key(i), self.arrange(outer * i)) for i in inners)
                continue
            sign, inside = _oriented((self._key(i), self.arrange(i)) for i in inners)
            content, inside = _without_content(inside)
            last = TermFactor(inside, Fraction(1), (position.LAST,))
            whole = self._structured_term(outer) * Term(sign * content, (last,))
            terms.append((min(map(self._key, inners)), whole.node()))
        return _ordered(terms)

    def _split(self, term: Basic) -> tuple[Basic, Basic]:
        """Split a term into parameters and the remaining factors."""
        if not isinstance(term, se.Mul):
            return se.Integer(1), term
        outer: list[Basic] = []
        inner: list[Basic] = []
        for part in term.args:
            constant = all(self._whole.is_parameter(s) for s in part.free_symbols)
            (outer if constant else inner).append(part)
        return se.Mul(*outer), se.Mul(*inner)

    def _key(self, e: Basic) -> Key:
        """Return the sort key of a term in a sum whose structure is kept."""
        expansion = self._whole
        free = e.free_symbols
        kinds = {expansion.class_of(s) for s in free}
        motion = 0 if "acceleration" in kinds else 1 if "velocity" in kinds else 2
        constants = {s for s in free if expansion.is_parameter(s)}
        others = expansion.ranks(free - constants)
        return motion, expansion.ranks(constants), len(others), others, str(e)


def _defined_roots(model: Model) -> dict[tuple[Basic, int], str]:
    """Return definitions that are roots, by radicand and degree: s = √(x² + y²)."""
    found: dict[tuple[Basic, int], str] = {}
    for name, definition in model.definitions.items():
        value = definition.value
        if isinstance(value, se.Pow) and isinstance(value.args[1], se.Rational):
            p, q = value.args[1].get_num_den()
            if int(p) == 1 and int(q) > 1:
                found.setdefault((value.args[0], int(q)), name)
    return found


def _symbol(name: str, kind: str) -> Node:
    column = read_dotted_name(name)
    if column is not None:
        return Symbol(column.constraint, kind="multiplier")
    if name == "pi":
        return Symbol("pi", kind="constant")
    base = name.rstrip("'")
    return Symbol(base, dots=len(name) - len(base))


def _is_whole(terms: Polynomial, expansion: MonomialExpansion) -> bool:
    """Whether a sum is a generator: a sum of parameters that is not expanded."""
    if len(terms) != 1:
        return False
    (monomial,) = terms
    return len(monomial) == 1 and expansion.generators[monomial[0][0]].head == "sum"


def _ordered(terms: Iterable[tuple[Key, Node]]) -> Node:
    """Return a sorted sum, with a positive term first if its leading class has one."""
    ordered = [(key, signed(node)) for key, node in sorted(terms, key=lambda t: t[0])]
    if ordered and ordered[0][1][0] < 0:  # −a + b is b − a
        kind = ordered[0][0][0]
        for i, (key, (sign, _)) in enumerate(ordered):
            if sign > 0 and (key[0] == kind or kind != 0):
                ordered.insert(0, ordered.pop(i))
                break
    return sum_of([term for _, term in ordered]) if ordered else ZERO


def _oriented(terms: Iterable[tuple[Key, Node]]) -> tuple[int, Node]:
    """Return ±1 and ±sum, so that a positive term of the leading class comes first."""
    return forward(_ordered(terms))


def _without_content(node: Node) -> tuple[Fraction, Node]:
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
