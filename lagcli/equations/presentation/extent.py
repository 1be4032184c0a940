"""Length of a printed derivation: written out, as matrices with abbreviations, or shortened.

Without ``full``, printing must take seconds and the output must be short enough to read. Small
systems are written out. If that takes too many lines, the entries of M, f, B and γ are printed with
abbreviations, if that is much shorter; lists that are still too long are cut.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import accumulate, chain

import symengine as se
from symengine import Basic

from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.presentation.formulas import Formulas
from lagcli.equations.presentation.matrices import cut_short, first_part
from lagcli.equations.typesetting.nodes import Line, Node, Product, Sign, Step, Sum
from lagcli.model.model import Model

#: Approximate maximum number of printed lines.
ROOM = 380
_LISTS = 340  # maximum for lists that are cut, with a remark each
#: Largest number of operations in M, f and B that are written out, which takes some seconds.
_OPERATIONS = 12_000
#: The same for a model with families, whose formulas are short in index form.
_OPERATIONS_OF_FAMILIES = 60_000
#: The same for one formula of such a model: the index form has fewer formulas, not shorter ones.
#: Five joints of a spatial mechanism have 3900, the pendulum of 19 links 3100.
_OPERATIONS_OF_ONE = 3_200
#: Number of terms of a long sum before and after the ellipsis.
_FIRST_TERMS, _LAST_TERMS = 5, 1
_TITLE = 2  # lines: the title and a blank one
_WIDTH = 100  # columns of the text whose lines are counted


def is_large(equations: Equations) -> bool:
    """Whether writing the equations out would take long."""
    rows = (*equations.mass_matrix, *(c.row for c in equations.constraints))
    entries = (x for row in rows for x in row.values())
    return _take_long(equations.model, chain(entries, equations.forcing))


def accelerations_are_large(equations: Equations) -> bool:
    """Whether writing out the constraints at acceleration level would take long."""
    return _take_long(equations.model, (c.rhs for c in equations.constraints))


def _take_long(model: Model, expressions: Iterable[Basic]) -> bool:
    families = any("[" in name for name in model.coordinate_names)
    if not families:
        return any(x > _OPERATIONS for x in accumulate(map(se.count_ops, expressions)))
    counts = list(map(se.count_ops, expressions))
    return sum(counts) > _OPERATIONS_OF_FAMILIES or any(x > _OPERATIONS_OF_ONE for x in counts)


class Extent:
    """Counts the lines of text of a system's steps.

    Parameters
    ----------
    formulas : Formulas
    """

    def __init__(self, formulas: Formulas):
        from lagcli.equations.typesetting.notation import Notation
        from lagcli.equations.typesetting.text import TextFormula

        self._formula = TextFormula(Notation(formulas.model))

    def size(self, steps: Iterable[Step]) -> int:
        """Return the number of lines of steps, including titles."""
        return sum(map(self._height, steps))

    def longest(self, steps: Iterable[Step]) -> int:
        """Return the number of lines of the longest formula."""
        return max((x for s in steps for x in self._heights(s)), default=0)

    def shortened(self, steps: list[Step], room: float = _LISTS) -> list[Step]:
        """Return steps shortened to a number of lines: lists that are too long are cut."""
        heights = list(map(self._height, steps))
        sizes = sorted(heights)
        allowed = room
        for i, smallest in enumerate(sizes):
            # long lists get the lines that short ones do not need
            fair = (room - sum(sizes[:i])) / (len(sizes) - i)
            if smallest > fair:
                allowed = fair
                break
        return [
            s if height <= allowed else self._first(s, height, allowed)
            for s, height in zip(steps, heights, strict=True)
        ]

    def _first(self, step: Step, height: int, room: float) -> Step:
        """Return a step with only its first items."""
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
        from lagcli.equations.typesetting.text import height

        return height(step, self._formula, _WIDTH)

    def _heights(self, step: Step) -> list[int]:
        from lagcli.equations.typesetting.text import heights

        return heights(step, self._formula, _WIDTH)


def abridged(node: Node) -> Node:
    """Return a formula with ellipses in its long sums, and a remark with their numbers of terms."""
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
    """Return lines grouped by item: a labelled line and the unlabelled ones after it."""
    items: list[list[Line]] = []
    labelled = any(line.label is not None for line in lines)
    for line in lines:
        if labelled and line.label is None and items:
            items[-1].append(line)
        else:
            items.append([line])
    return items
