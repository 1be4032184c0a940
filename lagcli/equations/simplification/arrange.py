"""Arrangement of SymEngine expressions for reading.

An expression is expanded to monomials and shortened. Then common parameters are factored out, terms
are collected by functions of position, and accelerations are written before velocities before the
rest:

    m r² [φ̈ + (φ̈ + ψ̈) sin² φ + (φ̇² − ψ̇²) sin φ cos φ] + m g r cos φ

If the result is longer than the original expression, the original structure is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from fractions import Fraction
from typing import NamedTuple

import symengine as se
from symengine import Basic

from lagcli.columns import read_dotted_name
from lagcli.equations.simplification import factors as position
from lagcli.equations.simplification import monomials as trigonometry
from lagcli.equations.simplification.factors import (
    ContentStyle,
    Key,
    Pair,
    Term,
    TermFactor,
    TermGroup,
    divide,
    factored,
    groups,
    ordered,
    oriented,
    pairs,
    presentable_content,
    shared_by,
    squares,
    without_content,
)
from lagcli.equations.simplification.monomials import (
    Exact,
    Monomial,
    MonomialExpansion,
    Polynomial,
    TooLarge,
    times,
)
from lagcli.equations.typesetting.nodes import (
    Call,
    Cases,
    Logical,
    Node,
    Number,
    Power,
    Relation,
    Symbol,
    forward,
    sum_of,
    weight,
)
from lagcli.model.expression.trees import (
    CallExpr,
    IndexedSumExpr,
    Name,
    PowerExpr,
    ProductExpr,
    SumExpr,
    Tree,
)
from lagcli.model.model import TIME, Model, as_symbols
from lagcli.model.names.members import family_of


def writing_order(model: Model) -> tuple[str, ...]:
    """Return the parameters in the order in which the model writes them in products.

    m*g*r is displayed as m g r regardless of the order of declaration, which is used only for
    parameters that no product orders.
    """
    families: dict[str, list[str]] = {}
    for name in model.parameters:
        families.setdefault(family_of(name), []).append(name)
    before: dict[str, list[str]] = {family: [] for family in families}
    seen: set[tuple[str, str]] = set()
    trees: dict[str, dict[int, Tree]] = {}
    for name, definition in model.definitions.items():
        trees.setdefault(family_of(name), {})[id(definition.tree)] = definition.tree
    known = Known(families.keys(), {name: [*by_id.values()] for name, by_id in trees.items()})
    for tree in model.trees.values():
        for left, right in _pairs(tree, known):
            if (left, right) not in seen and (right, left) not in seen:
                seen.add((left, right))
                before[right].append(left)
    rank = {family: i for i, family in enumerate(families)}
    order: list[str] = []
    done: set[str] = set()
    for start in families:
        stack = [(start, False)]
        while stack:  # depth first: predecessors of a name come first
            name, ready = stack.pop()
            if ready:
                order += families[name]
            elif name not in done:
                done.add(name)
                stack.append((name, True))
                needed = sorted(before[name], key=rank.__getitem__, reverse=True)
                stack.extend((b, False) for b in needed)
    return tuple(order)


class Known(NamedTuple):
    """The parameters and definitions of a model; families as ``m[]``."""

    parameters: Collection[str]
    definitions: Mapping[str, list[Tree]]


def _pairs(tree: Tree, known: Known) -> Iterator[tuple[str, str]]:
    """Yield (a, b) if a factor a is written to the left of a factor b."""
    stack = [tree]
    while stack:
        item = stack.pop()
        match item:
            case SumExpr():
                stack.extend(term for _, term in reversed(item.terms))
            case PowerExpr():
                stack.append(item.base)
            case IndexedSumExpr():
                stack.append(item.term)
            case CallExpr():
                stack.extend(reversed(item.arguments))
            case ProductExpr():
                factors = [factor for exponent, factor in item.factors if exponent > 0]
                stack.extend(reversed(factors))
                passed: list[str] = []
                for factor in factors:
                    inside = _names(factor, known)
                    yield from ((a, b) for a in passed for b in inside if a != b)
                    if isinstance(factor, Name | PowerExpr):
                        passed.extend(name for name in inside if name not in passed)


def _names(tree: Tree, known: Known) -> list[str]:
    """Return the parameters that are factors in a tree, with definitions expanded."""
    names: dict[str, None] = {}
    opened: set[str] = set()
    stack = [tree]
    while stack:
        item = stack.pop()
        match item:
            case Name() if item.text in known.parameters:
                names[item.text] = None
            case Name() if item.text in known.definitions and item.text not in opened:
                opened.add(item.text)
                stack.extend(known.definitions[item.text])
            case IndexedSumExpr():
                stack.append(item.term)
            case SumExpr():
                stack.extend(term for _, term in reversed(item.terms))
            case PowerExpr():
                stack.append(item.base)
            case ProductExpr():
                above = [factor for exponent, factor in item.factors if exponent > 0]
                stack.extend(reversed(above))
    return list(names)


class PrescribedNames:
    """Writes products that are definitions of time alone by their names.

    Parameters
    ----------
    model : Model
    """

    def __init__(self, model: Model):
        fixed = {TIME, *map(se.Symbol, model.parameters)}
        self._known: dict[Basic, Basic] = {}
        self._factors: list[tuple[Basic, dict[Basic, int]]] = []
        for name, definition in model.definitions.items():
            value = definition.value
            if not isinstance(value, se.Mul) or "[" in name:
                continue
            used, factors = value.free_symbols, _whole_powers(value)
            if TIME in used and used <= fixed and factors:
                self._factors.append((se.Symbol(name), factors))

    def __call__(self, e: Basic) -> Basic:
        """Return an expression in which such products are names."""
        if not self._factors or TIME not in e.free_symbols or isinstance(e, se.Symbol):
            return e
        known = self._known.get(e)
        if known is None:
            known = self._known[e] = self._named(e.func(*map(self, e.args)))
        return known

    def _named(self, e: Basic) -> Basic:
        if not isinstance(e, se.Mul):
            return e
        for name, factors in self._factors:
            powers = {base: int(n) for base, n in map(_power, e.args) if isinstance(n, se.Integer)}
            count = min(powers.get(base, 0) // n for base, n in factors.items())
            if count > 0:
                e = e * name**count / se.Mul(*(base ** (n * count) for base, n in factors.items()))
        return e


def _power(e: Basic) -> tuple[Basic, Basic]:
    return e.args if isinstance(e, se.Pow) else (e, se.Integer(1))


def _whole_powers(product: se.Mul) -> dict[Basic, int]:
    """Return the factors of a product with their exponents; none if one is not a whole power."""
    powers: dict[Basic, int] = {}
    for base, n in map(_power, product.args):
        if isinstance(base, se.Number) or not isinstance(n, se.Integer) or int(n) < 1:
            return {}
        powers[base] = int(n)
    return powers


Arrange = Callable[[Basic], Node]

_RELATIONS = {
    "LessThan": "<=",
    "StrictLessThan": "<",
    "Equality": "==",
    "Unequality": "!=",
}
_MIRRORED = {"<=": ">=", "<": ">", "==": "==", "!=": "!="}


def cases_node(piecewise: Basic, arrange: Arrange) -> Node:
    """Return the function that a Piecewise represents (see `lagcli.model.expression.functions`)."""
    args = piecewise.args
    value, condition = args[0], args[1]
    rest = (
        args[2]
        if len(args) == 4 and args[3] == se.true
        else se.Piecewise(*zip(args[2::2], args[3::2], strict=True))
    )
    named = _named(value, condition, rest)
    if named is not None:
        name, arguments = named
        return Call(name, tuple(arrange(a) for a in arguments))
    return Cases(condition_node(condition, arrange), arrange(value), arrange(rest))


def _named(value: Basic, condition: Basic, rest: Basic) -> tuple[str, list[Basic]] | None:
    """Return the name and arguments of the function that a Piecewise represents."""
    if not isinstance(condition, se.LessThan | se.StrictLessThan):
        return None
    low, high = condition.args
    strict = isinstance(condition, se.StrictLessThan)
    if low == 0 and not strict and value == high and se.expand(value + rest) == 0:
        return "abs", [value]
    if low == 0 and strict and value == 1 and isinstance(rest, se.Piecewise):
        negative = se.Piecewise((se.Integer(-1), se.Lt(high, 0)), (se.Integer(0), se.true))
        if rest == negative:
            return "sign", [high]
    if strict:
        return None
    if (value, rest) == (low, high):
        return "min", [*_chain("min", low), *_chain("min", high)]
    if (value, rest) == (high, low):
        return "max", [*_chain("max", high), *_chain("max", low)]
    if low == 0 and value == 1 and rest == 0:
        return "step", [high]
    third = se.Rational(1, 3)
    if low == 0 and value == high**third and rest == -((-high) ** third):
        return "cbrt", [high]
    return None


def _chain(name: str, e: Basic) -> list[Basic]:
    """Return the arguments of min(min(a, b), c) as a flat list."""
    if isinstance(e, se.Piecewise) and len(e.args) == 4 and e.args[3] == se.true:
        named = _named(e.args[0], e.args[1], e.args[2])
        if named is not None and named[0] == name:
            return named[1]
    return [e]


def condition_node(condition: Basic, arrange: Arrange) -> Node:
    """Return a condition with its variable side on the left."""
    name = type(condition).__name__
    if name in ("And", "Or"):
        operands = sorted(condition.args, key=str)
        return Logical(name.lower(), tuple(condition_node(c, arrange) for c in operands))
    if name == "Not":
        return Logical("not", (condition_node(condition.args[0], arrange),))
    left, right = (arrange(side) for side in condition.args)
    operator = _RELATIONS[name]
    if isinstance(left, Number) and not isinstance(right, Number):
        return Relation(right, _MIRRORED[operator], left)
    return Relation(left, operator, right)


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
        Whether roots and prescribed functions of time are replaced by the names of definitions with
        the same value.
    """

    def __init__(
        self, model: Model, values: Mapping[str, Exact] | None = None, named: bool = False
    ):
        order = writing_order(model)
        self._named = PrescribedNames(model) if named and not values else None
        self._roots = self._defined_roots(model) if named else {}
        self._whole = MonomialExpansion(model, order, values)
        self._opened = MonomialExpansion(model, order, values, open_sums=True)
        self._inputs = bool(model.inputs)
        self._sums: dict[str, Node] = {}  # by the symbols that stand for them
        self._own: Basic | None = None
        self._follows = False
        self._known: dict[tuple[Basic, Basic | None, bool], Node] = {}

    def arrange(self, expression: Basic, own: Basic | None = None, follows: bool = False) -> Node:
        """Return the arranged expression.

        Parameters
        ----------
        expression : SymEngine expression
            In the model's symbols.
        own : SymEngine symbol, optional
            Symbol whose terms come first among those with accelerations, or velocities: q̈ᵢ in the
            equation of qᵢ, so that the equations of similar coordinates are arranged equally.
        follows : bool
            Whether the expression follows other terms and so may begin with a minus sign.

        Returns
        -------
        Node
        """
        manner = expression, own, follows
        known = self._known.get(manner)
        if known is None:
            shown = as_symbols(expression) if self._inputs else expression
            shown = self._named(shown) if self._named else shown
            before = self._own, self._follows
            self._own, self._follows = own, follows
            known = self._known[manner] = self._best(shown)
            self._own, self._follows = before
        return known

    def in_order(self, names: Iterable[str]) -> None:
        """Write abbreviations in sums and products in this order, after the model's symbols."""
        for name in names:
            symbol = (se.Symbol(name),)
            self._whole.ranks(symbol)
            self._opened.ranks(symbol)

    def _best(self, e: Basic) -> Node:
        """Return the shorter of the arrangements with and without differences as y − R opened."""
        arranged = self._arranged(e)
        shifted = self._shifted(e)
        if shifted is None:
            return arranged
        kept = self._arranged(shifted)
        return kept if weight(kept) <= weight(arranged) else arranged

    def _shifted(self, e: Basic) -> Basic | None:
        """Return an expression in which a symbol stands for each sum of coordinates and parameters.

        y is replaced by s + R, where s stands for y − R; only if y has no other such sum. None
        without such sums.
        """
        if self._whole.values or not isinstance(e, se.Add | se.Mul):
            return None
        found: dict[Basic, set[Basic]] = {}
        for part in e.atoms(se.Add):
            shift = self._shift(part)
            if shift is not None and part != e:
                found.setdefault(shift[0], set()).add(shift[1])
        opened: dict[Basic, Basic] = {}
        for y, sums in found.items():
            if len(sums) == 1:
                (whole,) = sums
                symbol = se.Symbol(f"({whole})")
                if symbol.name not in self._sums:
                    self._sums[symbol.name] = self.arrange(whole)
                    self._whole.stand_for(symbol.name, y.name)
                    self._opened.stand_for(symbol.name, y.name)
                opened[y] = se.expand(symbol + y - whole)
        return e.subs(opened) if opened else None

    def _shift(self, e: Basic) -> tuple[Basic, Basic] | None:
        """Return the first coordinate of a sum of coordinates and parameters, and the sum in which
        its factor is 1; None for other sums."""
        factors = {}
        constant = False
        for term, factor in e.as_coefficients_dict().items():
            if all(map(self._whole.is_parameter, term.free_symbols)):
                constant |= bool(term.free_symbols)
            elif self._is_coordinate(term):
                factors[term] = factor
            else:
                return None
        if not constant or not factors:
            return None
        y = min(factors, key=lambda x: self._whole.ranks([x]))
        return y, se.expand(e / factors[y])

    def _is_coordinate(self, e: Basic) -> bool:
        symbol = isinstance(e, se.Symbol) and e.name not in self._sums
        return symbol and self._whole.class_of(e) == "function"

    def _arranged(self, e: Basic) -> Node:
        whole = self._expanded(e, self._whole)
        operations = se.count_ops(e)
        if whole is not None and operations > _LARGE and weight(whole) < _SHORTER * operations:
            return whole
        candidates = [whole, self._multiplied_out(e)]
        if isinstance(e, se.Add | se.Mul | se.Pow):
            first = 0 if _has_roots(e) else len(candidates)  # (s − s₀)/s, even if it is not shorter
            candidates.insert(first, self._structured(e))
        best = min((c for c in candidates if c is not None), key=weight)
        collected = self._collected(e)
        if collected is not None and weight(collected) < 1.5 * weight(best):
            return collected  # collected accelerations may take a few more characters
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
        if self._is_collected(moving):
            first = min(self._structured(se.Add(*moving)), first, key=weight)
        return sum_of([(1, first), (1, self.arrange(se.Add(*resting), follows=True))])

    def _is_collected(self, terms: Iterable[Basic]) -> bool:
        """Whether each acceleration is in one term, without functions: (x − a) ẍ."""
        of_terms = [s for x in terms for s in x.free_symbols]
        accelerations = [s for s in of_terms if self._whole.class_of(s) == "acceleration"]
        used = {g for x in terms for m in self._whole.polynomial(x) for g, _ in m}
        plain = all(self._whole.generators[g].head == "symbol" for g in used)
        return plain and len(set(accelerations)) == len(accelerations)

    def _defined_roots(self, model: Model) -> dict[tuple[Basic, int], str]:
        """Return definitions that are roots, by radicand and degree: s = √(x² + y²)."""
        roots: dict[tuple[Basic, int], str] = {}
        for name, definition in model.definitions.items():
            value = definition.value
            if isinstance(value, se.Pow) and isinstance(value.args[1], se.Rational):
                p, q = value.args[1].get_num_den()
                if int(p) == 1 and int(q) > 1:
                    radicand = value.args[0]
                    radicand = self._named(radicand) if self._named else radicand
                    roots.setdefault((radicand, int(q)), name)
        return roots

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
        return ordered((self._group(g, expansion) for g in groups(terms, expansion)), self._follows)

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
            min(not self._is_own(p, expansion) for p in parts),
            min(p.complexity for p in parts),
            min(map(order, group.parameters)),
            min(map(order, group.rest)),
        )
        return key, self._parts(outer, parts, expansion, style).node()

    def _parts(
        self, outer: Term, parts: list[Pair], expansion: MonomialExpansion, style: ContentStyle
    ) -> Term:
        """Return a factor times a sum, with the common factors of its terms in front of the
        bracket."""
        if len(parts) == 1:
            return outer * self._pair(parts[0].functions, parts[0].motion, expansion)
        common = shared_by(parts, expansion)
        numbers = [outer.coefficient * c for p in parts for c in self._coefficients(p, expansion)]
        content = presentable_content(numbers, style)
        scale = outer.coefficient / content
        outer = Term(content, outer.factors)
        moving = tuple(x for x in common if expansion.classes[x[0]] != "function")
        still = tuple(x for x in common if expansion.classes[x[0]] == "function")
        inner = [
            replace(
                part,
                functions={divide(m, still): c * scale for m, c in part.functions.items()},
                motion={divide(m, moving): c for m, c in part.motion.items()},
            )
            for part in parts
        ]
        terms: list[tuple[Key, Node]] = []
        for motion_class in sorted({part.motion_class for part in inner}):
            of_class = [part for part in inner if part.motion_class == motion_class]
            terms += self._terms(of_class, len(of_class) < len(inner), expansion, style)
        sign, bracket = oriented(terms)
        shared = self._monomial(common, expansion)
        last = TermFactor(bracket, Fraction(1), (position.LAST,))
        return outer * Term(Fraction(sign), (*shared, last))

    def _terms(
        self,
        parts: list[Pair],
        together: bool,
        expansion: MonomialExpansion,
        style: ContentStyle,
    ) -> list[tuple[Key, Node]]:
        """Return the terms of a bracket, factored if that is shorter."""
        terms = [
            (self._place(p, expansion), self._pair(p.functions, p.motion, expansion).node())
            for p in parts
        ]
        if together and len(parts) > 1:
            whole = self._parts(Term(Fraction(1), ()), parts, expansion, style).node()
            if weight(whole) < weight(sum_of((1, node) for _, node in terms)):
                return [(min(place for place, _ in terms), whole)]
        return terms

    def _place(self, part: Pair, expansion: MonomialExpansion) -> Key:
        """Return the sort key of a term in a bracket."""
        own = not self._is_own(part, expansion)
        simplest = (min(map(expansion.order, x)) for x in (part.functions, part.motion))
        return part.motion_class, own, part.complexity, *simplest

    def _is_own(self, pair: Pair, expansion: MonomialExpansion) -> bool:
        """Whether a pair contains the symbol whose terms come first."""
        return self._own is not None and any(
            expansion.generators[g].name == self._own.name for m in pair.motion for g, _ in m
        )

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
        constant = all(expansion.classes[g] == "parameter" for m in terms for g, _ in m)
        style = "decimal" if expansion.values else style
        split = factored(terms, expansion.order, style, over_one=not constant)
        opened = expansion.opened(split.rest, split.common) if split.exponent == 1 else None
        if opened:  # (s + y²)/s with s = l² − y² is l²/s
            opened = trigonometry.shorten(opened, expansion)
            inner = self._sum_factors(opened, expansion, style)
            return Term(split.content, self._monomial(split.common, expansion)) * inner
        sign, bracket = oriented(self._summands(split.rest, split.exponent == 1, expansion))
        key = position.SQUARE if split.exponent > 1 else position.BRACKET
        key = position.PARAMETER if constant else key
        rank = min(expansion.order(m) for m in split.rest if m)
        factor = TermFactor(bracket, Fraction(split.exponent), (key, rank))
        return Term(
            split.content * sign**split.exponent,
            (*self._monomial(split.common, expansion), factor),
        )

    def _summands(
        self, terms: Polynomial, squared: bool, expansion: MonomialExpansion
    ) -> Iterator[tuple[Key, Node]]:
        """Yield the terms of a sum with their sort keys, and its squares of sums as such."""
        forms, others = squares(terms) if squared else ([], terms)
        for m, c in others.items():
            yield (expansion.order(m),), Term(Fraction(c), self._monomial(m, expansion)).node()
        for c, form in forms:
            _, base = oriented(self._summands(form, False, expansion))
            square = TermFactor(base, Fraction(2), (position.SQUARE,))
            yield (min(expansion.order(times(m, m)) for m in form),), Term(c, (square,)).node()

    def _monomial(self, monomial: Monomial, expansion: MonomialExpansion) -> tuple[TermFactor, ...]:
        return tuple(self._generator(g, exponent, expansion) for g, exponent in monomial)

    # generators

    def _generator(self, g: int, exponent: int, expansion: MonomialExpansion) -> TermFactor:
        """Return a power of a generator as a factor."""
        generator, kind = expansion.generators[g], expansion.classes[g]
        power = Fraction(exponent, generator.degree)
        first, *rest = generator.arguments or (None,)
        match generator.head:
            case "symbol" if generator.name in self._sums:
                node: Node = self._sums[generator.name]
                key = position.BRACKET if power == 1 else position.SQUARE
                return TermFactor(node, power, (key, ((expansion.places[g], 0),)))
            case "symbol":
                rank = ((expansion.places[g], 0),)
                return TermFactor(_symbol(generator.name), power, (_SYMBOL_PLACES[kind], rank))
            case "function":
                node = Call(generator.name, tuple(map(self.arrange, generator.arguments)))
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
        known = expansion.exponent(exponent)
        if known is not exponent:
            return self._structured_term(base**known)
        if isinstance(base, se.Add) and isinstance(exponent, se.Integer):
            n = int(exponent)
            sign, node = forward(self.arrange(base))
            content, node = without_content(node)
            constant = all(expansion.is_parameter(s) for s in base.free_symbols)
            key = position.BRACKET if n == 1 else position.SQUARE
            key = position.PARAMETER if constant else key
            rank = (((expansion.ranks(base.free_symbols), 0, ""), 0),)
            factor = TermFactor(node, Fraction(n), (key, rank))
            return Term((sign * content) ** n, (factor,))
        try:
            terms = expansion.polynomial(e)
        except TooLarge:
            terms = None
        if terms == {}:
            return Term(Fraction(0), ())
        if terms is not None and len(terms) == 1:
            ((monomial, coefficient),) = terms.items()
            return Term(Fraction(coefficient), self._monomial(monomial, expansion))
        # expressions that expand to a sum without being a sum or a product
        return Term(Fraction(1), (TermFactor(self.arrange(e), Fraction(1), (position.LAST,)),))

    def _structured_sum(self, e: Basic) -> Node:
        """Return a sum with each term arranged and common parameters factored out."""
        inner_of: dict[Basic, list[Basic]] = {}
        for term in e.args:
            outer, inner = self._split(term)
            inner_of.setdefault(outer, []).append(inner)
        terms: list[tuple[Key, Node]] = []
        for outer, inners in inner_of.items():
            if outer == 1 or len(inners) == 1:
                terms.extend((self._key(i), self.arrange(outer * i, self._own)) for i in inners)
                continue
            sign, inside = oriented((self._key(i), self.arrange(i, self._own)) for i in inners)
            content, inside = without_content(inside)
            last = TermFactor(inside, Fraction(1), (position.LAST,))
            whole = self._structured_term(outer) * Term(sign * content, (last,))
            terms.append((min(map(self._key, inners)), whole.node()))
        return ordered(terms, self._follows)

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
        own = self._own not in free
        constants = {s for s in free if expansion.is_parameter(s)}
        others = expansion.ranks(free - constants)
        return motion, own, expansion.ranks(constants), len(others), others, str(e)


def _has_roots(e: Basic) -> bool:
    return any(not x.args[1].is_Integer for x in e.atoms(se.Pow))


def _symbol(name: str) -> Node:
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
