"""Index form of families: one formula for all members, and indexed sums.

Formulas of consecutive members that differ only by their index become one formula, valid over a
range; likewise, terms of a sum become an indexed sum. Members at the ends of a family are included
if the formula holds for them with empty sums; otherwise they are printed separately. The length of
a derivation then does not depend on the number of members.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import NamedTuple

import symengine as se
from symengine import Basic

from lagcli.equations.presentation.extent import items_of
from lagcli.equations.typesetting.nodes import (
    ONE,
    Call,
    IndexedSum,
    Line,
    Node,
    Number,
    Power,
    Product,
    Quotient,
    Root,
    Sign,
    Step,
    Sum,
    Symbol,
    children,
    product_of,
    quotient_of,
    rebuilt,
    sum_of,
)
from lagcli.model.model import Model

#: Matches the indices of a member: j, N−1, 3.
_INDICES = re.compile(r"\[([^\]]*)\]")
_INDEX = re.compile(r"([A-Za-z]\w*)(?:([+−-])(\d+))?")


class NotCompared(ValueError):
    """A formula contains a part that cannot be compared."""


def are_equal(one: Node, two: Node, numbers: Mapping[str, int]) -> bool:
    """Return whether two formulas are known to be equal; see `formula_value`."""
    try:
        return bool(se.expand(formula_value(one, numbers) - formula_value(two, numbers)) == 0)
    except NotCompared:
        return False


def formula_value(node: Node, numbers: Mapping[str, int]) -> Basic:
    """Return a formula as an expression.

    Parameters
    ----------
    node : Node
    numbers : mapping of str to int
        Numbers of members by name, and the index if it has a value: N = 10, i = 3.

    Raises
    ------
    NotCompared
        The formula contains more than sums, products, powers and functions of names.
    """

    def value(inner: Node) -> Basic:
        return formula_value(inner, numbers)

    match node:
        case Number():
            return se.Rational(node.value.numerator, node.value.denominator)
        case Symbol():
            if node.name in numbers and not node.dots:
                return se.Integer(numbers[node.name])
            indexed = _INDICES.sub(lambda m: f"[{_written(m[1], numbers)}]", node.name)
            return se.Symbol(f"{node.kind} {indexed} {node.dots}")
        case Sum():
            return se.Add(*(sign * value(term) for sign, term in node.terms))
        case Product():
            return se.Mul(*map(value, node.factors))
        case Quotient():
            return value(node.numerator) / value(node.denominator)
        case Power():
            return value(node.base) ** value(node.exponent)
        case Root():
            return value(node.radicand) ** se.Rational(1, node.degree)
        case Call():
            return se.Function(node.function)(*map(value, node.arguments))
        case IndexedSum():
            first, last = _whole(value(node.first)), _whole(value(node.last))
            terms = (
                formula_value(node.term, {**numbers, node.index: at})
                for at in range(first, last + 1)
            )
            return se.Add(se.Integer(0), *terms)
    raise NotCompared(type(node).__name__)


def _whole(value: Basic) -> int:
    if not isinstance(value, se.Integer):
        raise NotCompared("a bound without a value")
    return int(value)


def _written(indices: str, numbers: Mapping[str, int]) -> str:
    """Return indices with values substituted."""
    return ",".join(_index(text, numbers) for text in indices.split(","))


def _index(text: str, numbers: Mapping[str, int]) -> str:
    match = _INDEX.fullmatch(text)
    if match is None or match[1] not in numbers:
        return text
    offset = int(match[3] or 0)
    return str(numbers[match[1]] + (offset if match[2] == "+" else -offset))


Term = tuple[int, Node]


def merged(terms: Sequence[Term]) -> list[Term]:
    """Return the terms of a sum with sums over the same range as one, and without common numbers.

    a Σ x_j + a Σ y_j becomes a Σ (x_j + y_j), and 2 x + 2 Σ y_j becomes 2 (x + Σ y_j).
    """
    by_template: dict[object, list[int]] = {}
    for i, (_, term) in enumerate(terms):
        before, last = _split(term)
        key: object = i
        if isinstance(last, IndexedSum):
            key = before, last.index, last.first, last.last
        by_template.setdefault(key, []).append(i)
    return _without_numbers([_joined([terms[i] for i in group]) for group in by_template.values()])


def _split(term: Node) -> tuple[tuple[Node, ...], Node]:
    """Return the factors of a term before the last, and the last."""
    factors = term.factors if isinstance(term, Product) else (term,)
    return factors[:-1], factors[-1]


def _joined(terms: Sequence[Term]) -> Term:
    """Return sums over one range with the same factors as one sum."""
    (sign, first), *others = terms
    before, last = _split(first)
    if not others or not isinstance(last, IndexedSum):
        return sign, first
    inner = []
    for s, term in terms:
        whole = _split(term)[1]
        if isinstance(whole, IndexedSum):
            inner.append((s * sign, whole.term))
    joined = IndexedSum(_factored(inner), last.index, last.first, last.last)
    return sign, product_of([*before, joined])


def _factored(terms: Sequence[Term]) -> Node:
    """Return a sum with the factors in front that all terms have."""
    listed = [x.factors if isinstance(x, Product) else (x,) for _, x in terms]
    common = [x for x in listed[0] if all(x in others for others in listed[1:])]
    rest = [(s, _without(x, common)) for (s, _), x in zip(terms, listed, strict=True)]
    return product_of([*common, sum_of(rest)])


def _without(factors: Iterable[Node], common: Iterable[Node]) -> Node:
    left = list(factors)
    for x in common:
        left.remove(x)
    return product_of(left)


def _without_numbers(terms: list[Term]) -> list[Term]:
    """Return the terms with a number in front of a Σ and of other terms that have it."""
    others: list[Term] = []
    used: set[int] = set()
    for i, (sign, term) in enumerate(terms):
        number = _number(term)
        same = [j for j in range(i, len(terms)) if number and _number(terms[j][1]) == number]
        same = [j for j in same if j not in used]
        if i in used:
            continue
        if number is None or len(same) < 2 or not any(_sums(terms[j][1]) for j in same):
            others.append((sign, term))
            continue
        used.update(same)
        inside = [(sign * terms[j][0], product_of(_factors(terms[j][1])[1:])) for j in same]
        others.append((sign, Product((number, Sum(tuple(inside))))))
    return others


def _factors(term: Node) -> tuple[Node, ...]:
    return term.factors if isinstance(term, Product) else (term,)


def _number(term: Node) -> Number | None:
    first = _factors(term)[0]
    return first if isinstance(first, Number) and isinstance(term, Product) else None


def _sums(term: Node) -> bool:
    return isinstance(_factors(term)[-1], IndexedSum)


#: Smallest number of consecutive members that are merged.
SHORTEST = 3
#: Matches a member; its last index varies: x[3], r[3].x, u[2,3].
MEMBER = re.compile(r"(.*\[(?:-?\d+,)?)(-?\d+)(\].*)")


@dataclass(frozen=True)
class IndexedMember(Node):
    """A symbol whose index is that of the formula plus an offset, between family and part."""

    family: str
    part: str
    offset: int
    dots: int
    kind: str


@dataclass(frozen=True)
class LinearIndex(Node):
    """An integer that is linear in the index."""

    start: Fraction
    slope: Fraction


def _nodes(line: Line) -> list[Node]:
    """Return label and sides; the label of a constraint as its symbol."""
    label = line.label
    if isinstance(label, str):
        label = Symbol(label, kind="constraint")
    return [label if label is not None else Number(Fraction(0)), *line.sides]


def _base(one: Sequence[Line], two: Sequence[Line]) -> int | None:
    """Return the first index of an item that is larger by one in the next item."""
    here, there = _indices(one), _indices(two)
    if len(here) != len(there):
        return None
    return next((a for a, b in zip(here, there, strict=True) if b == a + 1), None)


def _indices(item: Sequence[Line]) -> list[int]:
    """Return the indices of all members in an item, in order."""
    indices = []
    for line in item:
        for node in _nodes(line):
            for x in walk(node):
                member = MEMBER.fullmatch(x.name) if isinstance(x, Symbol) else None
                if member:
                    indices.append(int(member[2]))
    return indices


def walk(node: Node) -> Iterator[Node]:
    """Yield a node and all nodes below it."""
    stack = [node]
    while stack:
        item = stack.pop()
        yield item
        stack.extend(reversed(children(item)))


class Run(NamedTuple):
    """Consecutive items with one template, and the index of the first."""

    template: list[list[Node]]
    first: int
    length: int


def run_at(items: Sequence[Sequence[Line]], at: int) -> Run | None:
    """Return the run that starts at an item, if it is long enough."""
    if at + SHORTEST > len(items):
        return None
    first = _base(items[at], items[at + 1])
    template = None if first is None else _template(items[at], items[at + 1], first)
    if first is None or template is None:
        return None
    count = 2
    while at + count < len(items) and _matches(
        items[at + count], items[at], template, first + count
    ):
        count += 1
    return Run(template, first, count) if count >= SHORTEST else None


def _template(one: Sequence[Line], two: Sequence[Line], index: int) -> list[list[Node]] | None:
    if len(one) != len(two) or [x.note for x in one] != [x.note for x in two]:
        return None
    parts = []
    for a, b in zip(one, two, strict=True):
        left, right = _nodes(a), _nodes(b)
        if len(left) != len(right):
            return None
        nodes = [_common(x, y, index) for x, y in zip(left, right, strict=True)]
        known = [x for x in nodes if x is not None]
        if len(known) < len(nodes):
            return None
        parts.append(known)
    return parts


def _same_form(item: Sequence[Line], first: Sequence[Line], template: list[list[Node]]) -> bool:
    """Return whether an item has the same notes as another and as many sides as its template."""
    sides = [len(x.sides) + 1 for x in item]
    return [x.note for x in item] == [x.note for x in first] and sides == list(map(len, template))


def _matches(
    item: Sequence[Line], first: Sequence[Line], template: list[list[Node]], index: int
) -> bool:
    if not _same_form(item, first, template):
        return False
    return all(
        at_index(general, index) == node
        for line, nodes in zip(item, template, strict=True)
        for node, general in zip(_nodes(line), nodes, strict=True)
    )


def holds_at(
    item: Sequence[Line],
    first: Sequence[Line],
    template: list[list[Node]],
    index: int,
    numbers: Mapping[str, int],
) -> bool:
    """Return whether a template holds for an item, in any arrangement."""
    if not _same_form(item, first, template):
        return False
    for line, (label, *sides) in zip(item, template, strict=True):
        own, *formulas = _nodes(line)
        if at_index(label, index) != own:
            return False
        written = (at_index(general, index) for general in sides)
        pairs = zip(formulas, written, strict=True)
        if not all(a == b or are_equal(a, b, numbers) for a, b in pairs):
            return False
    return True


def _common(a: Node, b: Node, index: int) -> Node | None:
    """Return the common template of two formulas, for an index and the next one."""
    if a == b:
        return a
    if type(a) is not type(b):
        return None
    if isinstance(a, Number) and isinstance(b, Number):
        slope = b.value - a.value
        return LinearIndex(a.value - slope * index, slope)
    if isinstance(a, Symbol) and isinstance(b, Symbol):
        return _common_symbol(a, b, index)
    values = {}
    for name in a.__dataclass_fields__:
        x, y = getattr(a, name), getattr(b, name)
        template = _common_field(x, y, index)
        if template is None and x is not None:
            return None
        values[name] = template
    return type(a)(**values)


def _common_field(x: object, y: object, index: int) -> object | None:
    if isinstance(x, Node) and isinstance(y, Node):
        return _common(x, y, index)
    if isinstance(x, tuple) and isinstance(y, tuple):
        if len(x) != len(y):
            return None
        items = [_common_field(a, b, index) for a, b in zip(x, y, strict=True)]
        return None if any(item is None for item in items) else tuple(items)
    return x if x == y else None


def _common_symbol(a: Symbol, b: Symbol, index: int) -> Node | None:
    one, two = MEMBER.fullmatch(a.name), MEMBER.fullmatch(b.name)
    same = (a.dots, a.kind) == (b.dots, b.kind)
    if one is None or two is None or (one[1], one[3]) != (two[1], two[3]) or not same:
        return None
    if int(two[2]) - int(one[2]) != 1:
        return None
    return IndexedMember(one[1], one[3], int(one[2]) - index, a.dots, a.kind)


def at_index(template: Node, index: int) -> Node:
    """Return a template for a value of the index."""
    match template:
        case IndexedMember():
            name = f"{template.family}{index + template.offset}{template.part}"
            return Symbol(name, template.dots, template.kind)  # type: ignore[arg-type]
        case LinearIndex():
            return Number(template.start + template.slope * index)
        case Product():  # a factor 1 is omitted
            factors = [at_index(x, index) for x in template.factors]
            left = tuple(x for x in factors if x != ONE)
            return left[0] if len(left) == 1 else Product(left)
    return rebuilt(template, lambda x: at_index(x, index))


#: A bound that differs from the number of members by at most this is written in terms of its name.
_NEAR = 3
_LETTERS = ("i", "j", "k", "n", "p", "s", "u", "w")


def with_hint(steps: Sequence[Step]) -> list[Step]:
    """Return steps; the first one in index form explains how to show all members."""
    hinted = list(steps)
    for i, step in enumerate(hinted):
        if any(map(_in_index_form, step.lines)):
            remark = " ".join(x for x in (step.remark, _HINT) if x)
            hinted[i] = replace(step, remark=remark)
            break
    return hinted


_HINT = "Families are written with an index; --full writes out each member."


def _in_index_form(line: Line) -> bool:
    return line.span is not None or any(
        isinstance(x, IndexedSum) for side in line.sides for x in walk(side)
    )


class IndexForm:
    """Converts the families of one model to index form.

    Parameters
    ----------
    model : Model
    """

    def __init__(self, model: Model):
        names = {*model.coordinate_names, *model.parameters, *model.definitions}
        #: Whether the model has families.
        self.families = any("[" in name for name in (*names, *model.constraint_names))
        self._letters = [x for x in _LETTERS if x not in names]
        self._sizes = [
            (p.name, int(p.value))
            for p in model.parameters.values()
            if p.structural and p.value == int(p.value) and p.value > _NEAR
        ]

    def steps(self, steps: Sequence[Step]) -> list[Step]:
        """Return steps in index form; unchanged if the model has no families."""
        return list(map(self.step, steps)) if self.families else list(steps)

    def step(self, step: Step) -> Step:
        """Return a step in index form."""
        lines = tuple(
            replace(x, sides=tuple(self._with_sums(side) for side in x.sides)) for x in step.lines
        )
        items = items_of(lines)
        indexed: list[Line] = []
        at = begun = 0
        while at < len(items):
            run = run_at(items, at)
            if run is None:
                at += 1
                continue
            first, last = self._extended(run, items, begun, at)
            for item in items[begun:first]:
                indexed += map(self._alone, item)
            whole = Run(run.template, run.first - (at - first), last - first)
            indexed += self._general(whole, items[at])
            at = begun = last
        for item in items[begun:]:
            indexed += map(self._alone, item)
        return replace(step, lines=tuple(indexed))

    def _extended(
        self, run: Run, items: Sequence[Sequence[Line]], begun: int, at: int
    ) -> tuple[int, int]:
        """Return the first item and the end of a run, extended by adjacent members for which it
        holds.

        At the ends of a family, sums have one term or none and are written differently.
        """
        numbers = dict(self._sizes)

        def holds(place: int) -> bool:
            return holds_at(items[place], items[at], run.template, run.first + place - at, numbers)

        first, last = at, at + run.length
        while first > begun and holds(first - 1):
            first -= 1
        while last < len(items) and holds(last):
            last += 1
        return first, last

    def _alone(self, line: Line) -> Line:
        """Return a line in which the last members are named by the number of members: x[N].

        Members have numbers if others of the line do, but the first: not 3 x[2] − x[N−2].
        """
        names = [self._bound(x) for x in _indices([line])]
        if any(x.isdigit() and int(x) > 1 for x in names):
            sides = tuple(self._named(side, members=False) for side in line.sides)
            return replace(line, sides=sides)
        label = line.label
        if isinstance(label, str):
            shown = self._named(Symbol(label, kind="constraint"))
            label = shown.name if isinstance(shown, Symbol) else label
        elif label is not None:
            label = self._named(label)
        return replace(line, sides=tuple(map(self._named, line.sides)), label=label)

    def _named(self, node: Node, members: bool = True) -> Node:
        """Return a formula with bounds, and if wanted members, as distances from the last."""
        if isinstance(node, Symbol):
            member = MEMBER.fullmatch(node.name)
            if member is None or not members:
                return node
            return replace(node, name=f"{member[1]}{self._bound(int(member[2]))}{member[3]}")
        if isinstance(node, IndexedSum):
            bounds = (self._shown_bound(x, "") for x in (node.first, node.last))
            return IndexedSum(self._named(node.term, members), node.index, *bounds)
        return rebuilt(node, lambda x: self._named(x, members))

    def _general(self, run: Run, item: list[Line]) -> list[Line]:
        """Return the lines of one item for all members."""
        letter = self._letters[0]
        bounds = [self._bound(x) for x in (run.first, run.first + run.length - 1)]
        text = f"{letter} = {bounds[0]}, …, {bounds[1]}"
        span = Sign(text, text.replace("−", "-").replace("…", r"\dots"))
        general = []
        for n, (nodes, line) in enumerate(zip(run.template, item, strict=True)):
            label, *sides = (self._shown(x, letter) for x in nodes)
            named: Node | str | None = label if line.label is not None else None
            if isinstance(line.label, str) and isinstance(label, Symbol):
                named = label.name
            general.append(Line(tuple(sides), named, line.note, span if n == 0 else None))
        return general

    # sums

    def sums(self, node: Node) -> Node:
        """Return a formula with indexed sums."""
        return self._named(self._with_sums(node)) if self.families else node

    def _with_sums(self, node: Node) -> Node:
        """Return a formula in which sums are indexed if their terms differ only by the index."""
        node = rebuilt(node, self._with_sums)
        if isinstance(node, Quotient) and isinstance(node.numerator, Product):
            *others, last = node.numerator.factors
            if isinstance(last, IndexedSum):  # (l/N) Σ θ̇ⱼ, not l Σ θ̇ⱼ/N
                return product_of([quotient_of(product_of(others), node.denominator), last])
        if not isinstance(node, Sum) or len(node.terms) < SHORTEST:
            return node
        # Σᵢ Σⱼ: sums whose range depends on an index
        return sum_of(merged(self._indexed(self._indexed(node.terms))))

    def _indexed(self, terms: Sequence[Term]) -> list[Term]:
        """Return terms with a sum in the place of those that differ by an index only."""
        indexed: list[Term] = []
        at = 0
        entries = [[_signed_line(sign, term)] for sign, term in terms]
        while at < len(entries):
            run = run_at(entries, at)
            if run is None:
                indexed.append(terms[at])
                at += 1
                continue
            sign, inner = terms[at]
            template = run.template[0][1]
            first, last = run.first, run.first + run.length - 1
            at += run.length
            # a factor 1 is not written: x₁ + 2 x₂ + 3 x₃
            while indexed and indexed[-1] == (sign, at_index(template, first - 1)):
                indexed.pop()
                first -= 1
            while count := self._continued(terms[at:], sign, at_index(template, last + 1)):
                at += count
                last += 1
            letter = self._letter_for(inner)
            term = self._shown(template, letter)
            bounds = (Number(Fraction(x)) for x in (first, last))
            factor: Node = ONE
            if isinstance(term, Product) and isinstance(term.factors[0], Number):
                factor, *rest = term.factors
                term = product_of(rest)
            indexed.append((sign, product_of([factor, IndexedSum(term, letter, *bounds)])))
        return indexed

    def _continued(self, terms: Sequence[Term], sign: int, sum_: Node) -> int:
        """Return how many of the next terms are a sum too short to have been written as one."""
        if not isinstance(sum_, IndexedSum):
            return 0
        for count in range(1, min(SHORTEST, len(terms) + 1)):
            written = sum_of((sign * s, term) for s, term in terms[:count])
            if are_equal(sum_, written, dict(self._sizes)):
                return count
        return 0

    def _letter_for(self, node: Node) -> str:
        """Return a letter for the index of a sum that does not occur in its terms."""
        used = {x.index for x in walk(node) if isinstance(x, IndexedSum)}
        return next(x for x in self._letters[1:] if x not in used)

    # display

    def _shown(self, node: Node, letter: str) -> Node:
        """Return a template as a formula with its index letter."""
        match node:
            case IndexedMember():
                index = _offset(letter, node.offset)
                name = f"{node.family}{index}{node.part}"
                return Symbol(name, node.dots, node.kind)  # type: ignore[arg-type]
            case LinearIndex():
                return self._number(node, letter)
            case IndexedSum():
                inner = self._shown(node.term, letter)
                bounds = (self._shown_bound(x, letter) for x in (node.first, node.last))
                return IndexedSum(inner, node.index, *bounds)
        return rebuilt(node, lambda x: self._shown(x, letter))

    def _shown_bound(self, node: Node, letter: str) -> Node:
        if isinstance(node, Number) and node.value.denominator == 1:
            bound = self._bound(int(node.value))
            return Sign(bound, bound.replace("−", "-"))
        return self._shown(node, letter)

    def _number(self, node: LinearIndex, letter: str) -> Node:
        start = node.start
        terms: list[tuple[int, Node]] = []
        if start.denominator == 1:
            name = self._bound(int(start))
            if not name.lstrip("-").isdigit():
                known, size = next(x for x in self._sizes if name.startswith(x[0]))
                terms.append((1, Symbol(known)))
                start -= size
        index = Symbol(letter)
        steep = abs(node.slope)
        moved: Node = index if steep == 1 else product_of([Number(steep), index])
        rest = [(1 if start > 0 else -1, Number(abs(start)))] if start else []
        last = (1 if node.slope > 0 else -1, moved)
        ordered = [*terms, last, *rest] if node.slope > 0 else [*terms, *rest, last]
        return sum_of(sorted(ordered, key=lambda x: x[0] < 0 and not terms))

    def _bound(self, value: int) -> str:
        """Return an index, in terms of the number of members if it is close."""
        for name, size in self._sizes:
            if abs(value - size) <= _NEAR and value > _NEAR:
                return _offset(name, value - size)
        return str(value)


def _offset(name: str, offset: int) -> str:
    """Return an index with its offset: i−1, N."""
    return name + (f"+{offset}" if offset > 0 else f"−{-offset}" if offset else "")


def _signed_line(sign: int, term: Node) -> Line:
    return Line((term,), note=str(sign))
