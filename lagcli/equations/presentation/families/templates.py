"""Formulas that differ by an index only: their common template, and runs of them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

from lagcli.equations.presentation.families.formula_comparison import are_equal
from lagcli.equations.presentation.formulas import Line
from lagcli.equations.presentation.typeset import (
    ONE,
    Node,
    Number,
    Product,
    Symbol,
    children,
    rebuilt,
)

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
    found = []
    for line in item:
        for node in _nodes(line):
            for x in walk(node):
                member = MEMBER.fullmatch(x.name) if isinstance(x, Symbol) else None
                if member:
                    found.append(int(member[2]))
    return found


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
    found = []
    for a, b in zip(one, two, strict=True):
        left, right = _nodes(a), _nodes(b)
        if len(left) != len(right):
            return None
        nodes = [_common(x, y, index) for x, y in zip(left, right, strict=True)]
        known = [x for x in nodes if x is not None]
        if len(known) < len(nodes):
            return None
        found.append(known)
    return found


def _alike(item: Sequence[Line], first: Sequence[Line], template: list[list[Node]]) -> bool:
    """Return whether an item has the same notes as another and as many sides as its template."""
    sides = [len(x.sides) + 1 for x in item]
    return [x.note for x in item] == [x.note for x in first] and sides == list(map(len, template))


def _matches(
    item: Sequence[Line], first: Sequence[Line], template: list[list[Node]], index: int
) -> bool:
    if not _alike(item, first, template):
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
    if not _alike(item, first, template):
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
        found = _common_field(x, y, index)
        if found is None and x is not None:
            return None
        values[name] = found
    return type(a)(**values)


def _common_field(x: object, y: object, index: int) -> object | None:
    if isinstance(x, Node) and isinstance(y, Node):
        return _common(x, y, index)
    if isinstance(x, tuple) and isinstance(y, tuple):
        if len(x) != len(y):
            return None
        found = [_common_field(a, b, index) for a, b in zip(x, y, strict=True)]
        return None if any(item is None for item in found) else tuple(found)
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
