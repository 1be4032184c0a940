"""Index form of families: one formula for all members, and indexed sums.

Formulas of consecutive members that differ only by their index become one formula, valid over a
range; likewise, terms of a sum become an indexed sum. Members at the ends of a family are included
if the formula holds for them with empty sums; otherwise they are printed separately. The length of
a derivation then does not depend on the number of members.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

from lagcli.equations.presentation.extent import items_of
from lagcli.equations.presentation.families.formula_comparison import are_equal
from lagcli.equations.presentation.families.indexed_sums import Term, merged
from lagcli.equations.presentation.families.templates import (
    MEMBER,
    SHORTEST,
    IndexedMember,
    LinearIndex,
    Run,
    at_index,
    holds_at,
    run_at,
    walk,
)
from lagcli.equations.presentation.formulas import Line, Step
from lagcli.equations.presentation.typeset import (
    ONE,
    IndexedSum,
    Node,
    Number,
    Product,
    Quotient,
    Sign,
    Sum,
    Symbol,
    product_of,
    quotient_of,
    rebuilt,
    sum_of,
)
from lagcli.model.model import Model

#: A bound that differs from the number of members by at most this is written in terms of its name.
_NEAR = 3
_LETTERS = ("i", "j", "k", "n", "p", "s", "u", "w")


def with_hint(steps: Sequence[Step]) -> list[Step]:
    """Return steps; the first one in index form explains how to show all members."""
    found = list(steps)
    for i, step in enumerate(found):
        if any(map(_in_index_form, step.lines)):
            remark = " ".join(x for x in (step.remark, _HINT) if x)
            found[i] = replace(step, remark=remark)
            break
    return found


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
        found: list[Line] = []
        at = begun = 0
        while at < len(items):
            run = run_at(items, at)
            if run is None:
                at += 1
                continue
            first, last = self._extended(run, items, begun, at)
            for item in items[begun:first]:
                found += map(self._alone, item)
            whole = Run(run.template, run.first - (at - first), last - first)
            found += self._general(whole, items[at])
            at = begun = last
        for item in items[begun:]:
            found += map(self._alone, item)
        return replace(step, lines=tuple(found))

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
        """Return a line in which the last members are named by the number of members: x[N]."""
        label = line.label
        if isinstance(label, str):
            shown = self._named(Symbol(label, kind="constraint"))
            label = shown.name if isinstance(shown, Symbol) else label
        elif label is not None:
            label = self._named(label)
        return replace(line, sides=tuple(map(self._named, line.sides)), label=label)

    def _named(self, node: Node) -> Node:
        if isinstance(node, Symbol):
            member = MEMBER.fullmatch(node.name)
            if member is None:
                return node
            return replace(node, name=f"{member[1]}{self._bound(int(member[2]))}{member[3]}")
        if isinstance(node, IndexedSum):
            bounds = (self._shown_bound(x, "") for x in (node.first, node.last))
            return IndexedSum(self._named(node.term), node.index, *bounds)
        return rebuilt(node, self._named)

    def _general(self, run: Run, item: list[Line]) -> list[Line]:
        """Return the lines of one item for all members."""
        letter = self._letters[0]
        bounds = [self._bound(x) for x in (run.first, run.first + run.length - 1)]
        text = f"{letter} = {bounds[0]}, …, {bounds[1]}"
        span = Sign(text, text.replace("−", "-").replace("…", r"\dots"))
        found = []
        for n, (nodes, line) in enumerate(zip(run.template, item, strict=True)):
            label, *sides = (self._shown(x, letter) for x in nodes)
            named: Node | str | None = label if line.label is not None else None
            if isinstance(line.label, str) and isinstance(label, Symbol):
                named = label.name
            found.append(Line(tuple(sides), named, line.note, span if n == 0 else None))
        return found

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
        found: list[Term] = []
        at = 0
        entries = [[_signed_line(sign, term)] for sign, term in terms]
        while at < len(entries):
            run = run_at(entries, at)
            if run is None:
                found.append(terms[at])
                at += 1
                continue
            sign, inner = terms[at]
            template = run.template[0][1]
            at += run.length
            last = run.first + run.length - 1
            while count := self._continued(terms[at:], sign, at_index(template, last + 1)):
                at += count
                last += 1
            letter = self._letter_for(inner)
            term = self._shown(template, letter)
            bounds = (Number(Fraction(x)) for x in (run.first, last))
            factor: Node = ONE
            if isinstance(term, Product) and isinstance(term.factors[0], Number):
                factor, *rest = term.factors
                term = product_of(rest)
            found.append((sign, product_of([factor, IndexedSum(term, letter, *bounds)])))
        return found

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
        """Return start + slope · index; with the number of members where it is near."""
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
