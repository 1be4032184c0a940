"""A long program for power series → operations on vectors of series, and what is left of it.

As in `lagcli.engine.packing`, operations of a level and of one kind whose operands are at equal
distances become one on vectors. Their series lie in layers: a layer holds the coefficients of one
order of all that is kept, so that a vector's coefficients lie side by side, and a convolution is
made for many series at once. What is in no vector has rows of its own, as in short programs;
coefficients go between layers and rows as they are found.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

from lagcli.engine.expansion import BEFORE, CONVOLVED, NUMBERS, SeriesOp
from lagcli.engine.nodes import VECTOR, Node
from lagcli.engine.packing import (
    LINE,
    SHORTEST,
    WORTH,
    Memory,
    last_uses,
    pieces,
    progressions,
    steps,
    together,
)

#: Where temporary places begin until it is known how many others there are.
_TEMPORARY = 1 << 24
#: Added to the name of a series, it is what lies in the layers, beside the row of that name.
LAYERED = 1 << 52


class Vector(NamedTuple):
    """One operation on vectors: where its results begin and, for each operand, its elements."""

    op: int
    size: int
    first: int
    operands: list[list[int]]

    @property
    def numbers(self) -> list[tuple[int, ...]]:
        """The registers of the operands that are numbers; one if all elements have the same."""
        found = [tuple(self.operands[n]) for n in NUMBERS.get(self.op, ())]
        return [x[:1] if len(set(x)) == 1 else x for x in found]


class Layers(NamedTuple):
    """A program in part on vectors.

    Parameters
    ----------
    parts : list
        In order: vectors, and lists of the nodes that have rows.
    place : dict of int to int
        Places of series in a layer. Temporary ones lie beyond it, where later layers will be.
    size : int
        Of a layer.
    end : int
        The first place after all.
    kept : dict of int to int
        Places in the layer → the series there, but for those of the state.
    """

    parts: list[Vector | list[Node]]
    place: dict[int, int]
    size: int
    end: int
    kept: dict[int, int]


def layered(
    nodes: Sequence[Node],
    state: Sequence[int],
    kept: Collection[int],
    results: Sequence[int],
    families: Sequence[object],
) -> Layers | None:
    """Put operations on series in vectors; None where too few of them fit.

    Parameters
    ----------
    nodes : sequence of Node
        In an order in which every operand is ready.
    state : sequence of int
        What is known before each order; these have the first places.
    kept : collection of int
        Series whose coefficients of all orders are needed.
    results : sequence of int
        Series that the next order's state is made of.
    families : sequence
        Of t, q and v: what is alike has the same.
    """
    layering = _Layering(nodes, state, kept, results, families)
    layering.go()
    return layering.finished() if layering.packed >= WORTH * len(nodes) else None


def _needs(node: Node) -> tuple[int, ...]:
    """Return the series that must be there before an operation."""
    op, _, operands = node
    numbers = NUMBERS.get(op, ())
    return tuple([x for i, x in enumerate(operands) if i not in numbers and x < BEFORE])


class _Layering:
    """Finds vectors and gives results their places."""

    def __init__(
        self,
        nodes: Sequence[Node],
        state: Sequence[int],
        kept: Collection[int],
        results: Sequence[int],
        families: Sequence[object],
    ):
        self.nodes, self.results, self.kept = nodes, results, set(kept)
        self.place = {x: i for i, x in enumerate(state)}
        self.state = self.size = len(state)
        self.memory = Memory(_TEMPORARY)
        self.vectors: list[Sequence[int] | None] = []  # the nodes of each, or None: see below
        self.singles: list[list[int]] = []  # the nodes of each None
        self.packed = 0
        self.copies: dict[tuple[int, ...], list[int]] = {}  # side by side, of series that are not
        self.copied: dict[int, int] = {}  # places in the layer → the series there
        members: dict[object, list[int]] = {}
        for x, family in zip(state, families, strict=False):
            members.setdefault(family, []).append(x)
        # families lie side by side: so do most of what is made of them
        self.first: list[Vector] = []
        for names in members.values():
            if len(names) >= SHORTEST and steps([self.place[x] for x in names])[1] != 1:
                for piece in pieces(names):
                    self.first.append(self.copy(piece, self.copies))
                    self.place.update(zip(piece, self.copies[tuple(piece)], strict=True))

    def copy(self, names: Sequence[int], copies: dict[tuple[int, ...], list[int]]) -> Vector:
        """Return the operation that puts series side by side, and note where."""
        first, places = self.keep(len(names)), [self.place[x] for x in names]
        side_by_side = range(first, first + len(names))
        copies[tuple(names)] = list(side_by_side)
        self.copied.update(zip(side_by_side, names, strict=True))
        return Vector(SeriesOp.COPY, len(names), first, [places])

    def go(self) -> None:
        """Go through the levels."""
        needs = [(node[0], node[1], _needs(node)) for node in self.nodes]
        sets = together(needs)
        keep = self.kept.union(self.results)
        for group, dying in zip(sets, last_uses(needs, sets, keep), strict=True):
            found, rest = self.search(group, needs)
            for members in found:
                self.take([self.nodes[i][1][0] for i in members])
                self.vectors.append(members)
                self.packed += len(members)
            if rest:
                for i in rest:
                    self.take(list(self.nodes[i][1]))
                self.vectors.append(None)
                self.singles.append(rest)
            for x in dying:
                if self.place[x] >= _TEMPORARY:
                    self.memory.give_back(self.place[x])

    def search(
        self, group: list[int], needs: Sequence[Node]
    ) -> tuple[list[Sequence[int]], list[int]]:
        """Return the operations of each vector, and what is in none."""
        found, rest = progressions([[self.place[x] for x in needs[i][2]] for i in group])
        vectors = [piece for run in found for piece in pieces([group[i] for i in run])]
        return vectors, [group[i] for i in rest]

    def take(self, names: list[int]) -> None:
        """Give results places side by side."""
        if self.kept.isdisjoint(names):
            first = self.memory.take(len(names))
        else:
            first = self.keep(len(names))
        self.place.update(zip(names, range(first, first + len(names)), strict=True))

    def keep(self, size: int) -> int:
        """Return the first of as many places in the layer, where the cache has no line's end."""
        if size > 1:
            self.size = -(-self.size // LINE) * LINE
        self.size += size
        return self.size - size

    # once all have places

    def finished(self) -> Layers:
        """Return the parts, with what goes between layers and rows."""
        own = {self.nodes[i][1][0] for group in self.singles for i in group}
        wanted = set(self.results)
        for members in self.vectors:
            for i in members or ():
                op, _, operands = self.nodes[i]
                numbers = NUMBERS.get(op, ())
                wanted.update(_series(x) for n, x in enumerate(operands) if n not in numbers)
        kept = {at: x for x, at in self.place.items() if self.state <= at < _TEMPORARY}
        parts: list[Vector | list[Node]] = [*self.first]
        later: list[Vector | list[Node]] = []
        late: dict[tuple[int, ...], list[int]] = {}
        entered, singles = set(own), iter(self.singles)
        entering: dict[int, None] = {}
        for members in self.vectors:
            if members is None:
                batch = next(singles)
                before: list[Node] = []
                for i in batch:
                    needed = _needs(self.nodes[i])
                    entering.update((x - BEFORE, None) for x in self.nodes[i][2] if x >= BEFORE)
                    for x in needed:
                        if x not in entered:
                            entered.add(x)
                            before.append((SeriesOp.ENTER, (x,), (x + LAYERED,)))
                after = [self.nodes[i][1][0] for i in batch]
                parts.append(
                    [
                        *before,
                        *(self.nodes[i] for i in batch),
                        *((SeriesOp.LEAVE, (x + LAYERED,), (x,)) for x in after if x in wanted),
                    ]
                )
                continue
            nodes = [self.nodes[i] for i in members]
            op = nodes[0][0]
            columns = [list(column) for column in zip(*[o for _, _, o in nodes], strict=True)]
            for n in range(len(columns)):
                if n in NUMBERS.get(op, ()):
                    continue
                slopes = columns[n][0] >= BEFORE
                names = tuple([_series(x) for x in columns[n]])
                columns[n] = [self.place[x] for x in names]
                if (slopes or n in CONVOLVED.get(op, ())) and steps(columns[n])[1] != 1:
                    # a slope may not be there before the operation; its copy is made at the end
                    known = late if slopes and names not in self.copies else self.copies
                    if names not in known:
                        (later if slopes else parts).append(self.copy(names, known))
                    columns[n] = known[names]
            parts.append(Vector(op, len(nodes), self.place[nodes[0][1][0]], columns))
        enter: list[Node] = [
            (SeriesOp.ENTER, (x,), (x + LAYERED,)) for x in entering if x not in entered
        ]
        parts += [*later, *([enter] if enter else [])]
        return self.moved(parts, {**kept, **self.copied})

    def moved(self, parts: list[Vector | list[Node]], kept: dict[int, int]) -> Layers:
        """Put temporary places beyond the layer and the next one's state."""
        # an odd number of lines of the cache: those of one place do not get into each other's way
        size = -(-self.size // LINE) * LINE
        size += 0 if size // LINE % 2 else LINE
        offset = size + -(-self.state // LINE) * LINE - _TEMPORARY

        def to(at: int) -> int:
            return at + offset if at >= _TEMPORARY else at

        found: list[Vector | list[Node]] = []
        for part in parts:
            if isinstance(part, Vector):
                numbers = NUMBERS.get(part.op, ())
                operands = [
                    x if n in numbers else [to(at) for at in x] for n, x in enumerate(part.operands)
                ]
                part = part._replace(first=to(part.first), operands=operands)
            found.append(part)
        place = {x: to(at) for x, at in self.place.items()}
        return Layers(found, place, size, to(self.memory.end), kept)


def vector_stream(vector: Vector, place: Mapping[Any, int]) -> list[int]:
    """Return the stream of an operation on vectors.

    Parameters
    ----------
    vector : Vector
    place : mapping
        Places of its numbers; see `Vector.numbers`.
    """
    numbers = iter(vector.numbers)
    found = [VECTOR + vector.op, vector.size, vector.first]
    for n, x in enumerate(vector.operands):
        if n in NUMBERS.get(vector.op, ()):
            part = next(numbers)
            found += (place[part], int(len(part) > 1))
        else:
            found += steps(x)
    return found


def _series(x: int) -> int:
    return x - BEFORE if x >= BEFORE else x
