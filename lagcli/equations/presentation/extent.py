"""How much of a system is printed: written out, as matrices with abbreviations, or a part of it.

What a person asked for must be there within seconds and be short enough to be read, unless the
whole is asked for. Small systems are written out. Where that takes too many lines, the entries of
M, f, B and γ are given with abbreviations, if that is much shorter; and of lists that are still too
long, the first items.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import symengine as se

from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.presentation.formulas import Formulas, Line, Step
from lagcli.equations.presentation.matrices import cut_short, first_part
from lagcli.equations.presentation.typeset import Node, Product, Sign, Sum

#: Lines of text, about, that are printed at most.
ROOM = 380
_LISTS = 340  # of these, for lists that are cut: they are measured less well
#: Operations in M, f and B up to which equations are written out: that takes some seconds.
_OPERATIONS = 12_000
#: Of a model with families, whose formulas are short in index form.
_OPERATIONS_OF_FAMILIES = 60_000
#: Terms of a long sum that stand before and after the dots.
_FIRST_TERMS, _LAST_TERMS = 5, 1
_TITLE = 2.0  # lines: the title and a blank one
#: Letters of a line of text.
_LINE = 80.0


def is_large(equations: Equations) -> bool:
    """Whether it would take long to write the equations out."""
    total, most = 0, _OPERATIONS
    if any(name.endswith("]") for name in equations.model.coordinate_names):
        most = _OPERATIONS_OF_FAMILIES
    for row, f in zip(equations.mass_matrix, equations.forcing, strict=True):
        total += sum(map(se.count_ops, row.values())) + se.count_ops(f)
        if total > most:
            return True
    for c in equations.constraints:
        total += sum(map(se.count_ops, c.row.values()))
        if total > most:
            return True
    return False


class Extent:
    """Measures steps of one system by the lines of text that they take.

    Parameters
    ----------
    formulas : Formulas
    """

    def __init__(self, formulas: Formulas):
        from lagcli.equations.render.formula_text import TextFormula
        from lagcli.equations.render.names import Notation

        self._text = TextFormula(Notation(formulas.model)).text

    def size(self, steps: Iterable[Step]) -> float:
        """Return about how many lines steps take, titles included."""
        return sum(map(self._step, steps))

    def longest(self, steps: Iterable[Step]) -> float:
        """Return about how many lines the longest formula takes."""
        return max((self._line(x, _margin(s)) for s in steps for x in s.lines), default=0.0)

    def shortened(self, steps: list[Step], room: float = _LISTS) -> list[Step]:
        """Return steps that fit into so many lines: of lists that are too long, the first items."""
        sizes = sorted(map(self._step, steps))
        allowed = room
        for i, smallest in enumerate(sizes):
            # what short lists leave is for the long ones
            fair = (room - sum(sizes[:i])) / (len(sizes) - i)
            if smallest > fair:
                allowed = fair
                break
        return [s if self._step(s) <= allowed else self._first(s, allowed) for s in steps]

    def _first(self, step: Step, room: float) -> Step:
        """Return the first items of a step."""
        items = _items(step)
        margin = _margin(step)
        share = (room - _TITLE) / max(self._step(step) - _TITLE, 1.0)
        shown = first_part(items, lambda item: sum(self._line(x, margin) for x in item), share)
        said = cut_short(len(shown), len(items))
        remark = " ".join(x for x in (said, step.remark) if x)
        return replace(step, lines=tuple(x for item in shown for x in item), remark=remark)

    def _step(self, step: Step) -> float:
        remark = math.ceil(len(step.remark or "") / _LINE)
        margin = _margin(step)
        lines = sum(self._line(line, margin) for line in step.lines)
        if step.packed:
            lines = math.ceil(sum(self._letters(line) for line in step.lines) / _LINE)
        return _TITLE + lines + remark + bool(step.lead)

    def _line(self, line: Line, margin: int) -> float:
        return float(math.ceil(self._letters(line) / (_LINE - margin)))

    def _letters(self, line: Line) -> int:
        return sum(len(self._text(side)) + 3 for side in line.sides) + len(line.note or "")


def _margin(step: Step) -> int:
    """Return the columns that the labels of a step take."""
    labels = [line.label for line in step.lines if isinstance(line.label, str)]
    return min(max(map(len, labels), default=0), int(_LINE / 3))


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


def _items(step: Step) -> list[list[Line]]:
    """Return the lines of a step by items: a constraint and what stands below it are one."""
    found: list[list[Line]] = []
    labelled = any(line.label is not None for line in step.lines)
    for line in step.lines:
        if labelled and line.label is None and found:
            found[-1].append(line)
        else:
            found.append([line])
    return found
