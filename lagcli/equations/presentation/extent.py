"""How much of a system is printed: written out, as matrices with abbreviations, or a part of it.

What a person requested must be there within seconds and be short enough to be read, unless the
whole is requested. Small systems are written out. Where that takes too many lines, the entries of
M, f, B and γ are given with abbreviations, if that is much shorter; and of lists that are still too
long, the first items.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import accumulate, chain

import symengine as se
from symengine import Basic

from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.presentation.formulas import Formulas, Line, Step
from lagcli.equations.presentation.matrices import cut_short, first_part
from lagcli.equations.presentation.typeset import Node, Product, Sign, Sum
from lagcli.model.model import Model

#: Lines of text, about, that are printed at most.
ROOM = 380
_LISTS = 340  # of these, for lists that are cut: each then says so
#: Operations in M, f and B up to which equations are written out: that takes some seconds.
_OPERATIONS = 12_000
#: Of a model with families, whose formulas are short in index form.
_OPERATIONS_OF_FAMILIES = 60_000
#: Terms of a long sum that stand before and after the dots.
_FIRST_TERMS, _LAST_TERMS = 5, 1
_TITLE = 2  # lines: the title and a blank one
_WIDTH = 100  # columns of the text that is measured


def is_large(equations: Equations) -> bool:
    """Whether it would take long to write the equations out."""
    rows = (*equations.mass_matrix, *(c.row for c in equations.constraints))
    entries = (x for row in rows for x in row.values())
    return _take_long(equations.model, chain(entries, equations.forcing))


def accelerations_are_large(equations: Equations) -> bool:
    """Whether it would take long to write out the constraints at acceleration level."""
    return _take_long(equations.model, (c.rhs for c in equations.constraints))


def _take_long(model: Model, expressions: Iterable[Basic]) -> bool:
    families = any("[" in name for name in model.coordinate_names)
    most = _OPERATIONS_OF_FAMILIES if families else _OPERATIONS
    return any(total > most for total in accumulate(map(se.count_ops, expressions)))


class Extent:
    """Measures steps of one system by the lines of text that they take.

    Parameters
    ----------
    formulas : Formulas
    """

    def __init__(self, formulas: Formulas):
        from lagcli.equations.render.formula_text import TextFormula
        from lagcli.equations.render.names import Notation

        self._formula = TextFormula(Notation(formulas.model))

    def size(self, steps: Iterable[Step]) -> int:
        """Return how many lines steps take, titles included."""
        return sum(map(self._height, steps))

    def longest(self, steps: Iterable[Step]) -> int:
        """Return how many lines the longest formula takes."""
        return max((x for s in steps for x in self._heights(s)), default=0)

    def shortened(self, steps: list[Step], room: float = _LISTS) -> list[Step]:
        """Return steps that fit into so many lines: of lists that are too long, the first items."""
        heights = list(map(self._height, steps))
        sizes = sorted(heights)
        allowed = room
        for i, smallest in enumerate(sizes):
            # what short lists leave is for the long ones
            fair = (room - sum(sizes[:i])) / (len(sizes) - i)
            if smallest > fair:
                allowed = fair
                break
        return [
            s if height <= allowed else self._first(s, height, allowed)
            for s, height in zip(steps, heights, strict=True)
        ]

    def _first(self, step: Step, height: int, room: float) -> Step:
        """Return the first items of a step."""
        costs = iter(self._heights(step))
        items = [(item, sum(next(costs) for _ in item)) for item in items_of(step.lines)]
        other = height - sum(cost for _, cost in items)
        if step.packed:  # side by side
            other = _TITLE
        share = (room - other) / max(height - other, 1)
        shown = first_part(items, lambda item: item[1], share)
        said = cut_short(len(shown), len(items))
        remark = " ".join(x for x in (said, step.remark) if x)
        return replace(step, lines=tuple(x for item, _ in shown for x in item), remark=remark)

    def _height(self, step: Step) -> int:
        from lagcli.equations.render.text import height

        return height(step, self._formula, _WIDTH)

    def _heights(self, step: Step) -> list[int]:
        from lagcli.equations.render.text import heights

        return heights(step, self._formula, _WIDTH)


def abridged(node: Node) -> Node:
    """Return a formula whose long sums have dots in their middle, and a count of their terms."""
    if isinstance(node, Product):
        return Product(tuple(map(abridged, node.factors)))
    if not isinstance(node, Sum):
        return node
    terms = tuple((sign, abridged(term)) for sign, term in node.terms)
    if len(terms) <= _FIRST_TERMS + _LAST_TERMS + 2:
        return Sum(terms)
    dots = Sign(f"⋯ ({len(terms)} terms)", rf"\cdots_{{\text{{{len(terms)} terms}}}}")
    return Sum((*terms[:_FIRST_TERMS], (1, dots), *terms[-_LAST_TERMS:]))


def items_of(lines: Sequence[Line]) -> list[list[Line]]:
    """Return lines by items: a labelled line and those below it are one."""
    found: list[list[Line]] = []
    labelled = any(line.label is not None for line in lines)
    for line in lines:
        if labelled and line.label is None and found:
            found[-1].append(line)
        else:
            found.append([line])
    return found
