"""Vectorization of a long program for power series.

As in the core's programs, operations of one level and kind with equidistant operands become vector
operations. Series are stored in layers: a layer contains the coefficients of one
order of all stored series, so that a vector's coefficients are contiguous, and a convolution is
computed for many series at once. The remaining operations are executed one by one; operands of
their convolutions are copied to rows, as in short programs.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

from lagcli.engine.core.program import progressions, series_levels
from lagcli.engine.tape.operations import INDEXED, LINE, SHORTEST, VECTOR
from lagcli.engine.tape.series_operations import LONGEST, SeriesOp
from lagcli.engine.taylor.series_nodes import (
    Delayed,
    Name,
    NextCoefficient,
    Operand,
    SeriesNode,
    numbered,
)

#: Start of temporary places until the number of the others is known.
_TEMPORARY = 1 << 24
#: Required fraction of the operations of a program in vectors.
WORTH = 0.5
#: An operation's kind, its results, and the series that must be computed before it.
_Needs = tuple[SeriesOp, tuple[Any, ...], tuple[Any, ...]]


class SeriesVector(NamedTuple):
    """A vector operation: the places of its results and, for each operand, its elements."""

    op: SeriesOp
    results: list[int]
    operands: list[list[Any]]

    @property
    def numbers(self) -> list[tuple[int, ...]]:
        """The registers of the operands that are numbers; one if all elements have the same."""
        numbers = [tuple(self.operands[n]) for n in self.op.numbers]
        return [x[:1] if len(set(x)) == 1 else x for x in numbers]


class Layers(NamedTuple):
    """A partly vectorized program.

    Parameters
    ----------
    parts : list
        In order: vectors, and lists of nodes.
    place : dict of names to int
        Places of series in a layer. Temporary ones are beyond it, in the space of later layers.
    size : int
        Size of a layer.
    end : int
        Number of places.
    kept : dict of int to names
        Places in the layer → their series, except those of the state.
    """

    parts: list[SeriesVector | list[SeriesNode]]
    place: dict[Operand, int]
    size: int
    end: int
    kept: dict[int, Operand]


def layered(
    nodes: Sequence[SeriesNode],
    kept: Collection[Name],
    state: Sequence[Sequence[Name]],
    results: Sequence[Sequence[Name]],
) -> Layers | None:
    """Vectorize operations on series; None if too few are vectorizable.

    Parameters
    ----------
    nodes : sequence of SeriesNode
        In an order in which every operand is ready.
    kept : collection of names
        Series whose coefficients of all orders are needed.
    state, results : sequences of sequences of names
        Families: series to be stored contiguously.
    """
    layering = _Layering(nodes, kept, state, results)
    layering.go()
    return layering.finished() if layering.packed >= WORTH * len(nodes) else None


def _needs(node: SeriesNode) -> tuple[Name, ...]:
    """Return the series that must be computed before an operation."""
    op, _, operands = node
    return tuple(
        [x for i, x in enumerate(operands) if i not in op.numbers and not isinstance(x, Delayed)]
    )


def _last_uses(
    nodes: Sequence[_Needs], sets: Sequence[list[int]], kept: Collection[Any]
) -> list[list[Any]]:
    """Return, for each set of operations, the results that are not needed after it."""
    last: dict[Any, int] = {}
    for at, group in enumerate(sets):
        for node in group:
            last.update(dict.fromkeys(nodes[node][1], at))
    for at, group in enumerate(sets):
        for node in group:
            for x in nodes[node][2]:
                if x in last:
                    last[x] = max(last[x], at)
    ends: list[list[Any]] = [[] for _ in sets]
    for x, at in last.items():
        if x not in kept:
            ends[at].append(x)
    return ends


class _Temporaries:
    """Places of results that are not kept; those of a vector are released together."""

    def __init__(self) -> None:
        self.end = _TEMPORARY
        self.free: dict[int, list[int]] = {}  # by size
        self.size: dict[int, int] = {}  # of intervals, by their first places
        self.first: dict[int, int] = {}  # of the interval of a place
        self.alive: dict[int, int] = {}  # places in use, by the first one

    def take(self, count: int) -> int:
        """Return the first of a number of contiguous places."""
        size = count if count == 1 else -(-count // LINE) * LINE
        if self.free.get(size):
            start = self.free[size].pop()
        else:
            start = self.end if size == 1 else -(-self.end // LINE) * LINE
            self.end = start + size
            self.size[start] = size
            self.first.update(dict.fromkeys(range(start, start + size), start))
        self.alive[start] = count
        return start

    def release(self, at: int) -> None:
        """Release a place, with its interval when no other place of it is in use."""
        start = self.first[at]
        self.alive[start] -= 1
        if not self.alive[start]:
            self.free.setdefault(self.size[start], []).append(start)


def pieces(values: Sequence[int]) -> list[Sequence[int]]:
    """Return parts of equal lengths that are at most as long as a vector."""
    count = -(-len(values) // LONGEST)
    ends = [len(values) * i // count for i in range(count + 1)]
    return [values[a:b] for a, b in pairwise(ends)]


def steps(places: Sequence[int]) -> Sequence[int]:
    """Return the first place and the step, or the list of places."""
    distances = {b - a for a, b in pairwise(places)} or {1}
    return (places[0], *distances) if len(distances) == 1 else (0, INDEXED, *places)


class _Layering:
    """Finds vectors and allocates places for results."""

    def __init__(
        self,
        nodes: Sequence[SeriesNode],
        kept: Collection[Name],
        state: Sequence[Sequence[Name]],
        results: Sequence[Sequence[Name]],
    ):
        self.nodes, self.kept = nodes, set(kept)
        self.place: dict[Operand, int] = {}
        self.size = 0
        self.slots = _Temporaries()
        self.vectors: list[Sequence[int] | None] = []  # the nodes of each, or None
        self.singles: list[list[int]] = []  # the nodes of each None
        self.packed = 0
        self.copies: dict[tuple[Name, ...], list[int]] = {}  # contiguous copies of series
        self.copied: dict[int, Operand] = {}  # places in the layer → their series
        for family in state:
            first = self.keep(len(family))
            self.put(family, first)
            self.put([NextCoefficient(x) for x in family], first)
        self.state = self.size
        for family in results:
            self.take(family)

    def put(self, names: Sequence[Operand], first: int) -> None:
        """Record contiguous places."""
        self.place.update(zip(names, range(first, first + len(names)), strict=True))

    def copy(
        self, names: Sequence[Name], copies: dict[tuple[Name, ...], list[int]]
    ) -> SeriesVector:
        """Return the operation that copies series to contiguous places, and record these."""
        first, places = self.keep(len(names)), [self.place[x] for x in names]
        side_by_side = list(range(first, first + len(names)))
        copies[tuple(names)] = side_by_side
        self.copied.update(zip(side_by_side, names, strict=True))
        return SeriesVector(SeriesOp.COPY, side_by_side, [places])

    def go(self) -> None:
        """Process the levels."""
        needs = [(node[0], node[1], _needs(node)) for node in self.nodes]
        sets = series_levels(*numbered(needs))
        for group, dying in zip(sets, _last_uses(needs, sets, self.kept), strict=True):
            there = [self.nodes[i][1][0] in self.place for i in group]
            for placed in (True, False):
                part = [i for i, known in zip(group, there, strict=True) if known == placed]
                self.put_in_vectors(part, needs, placed)
            for x in dying:
                if self.place[x] >= _TEMPORARY:
                    self.slots.release(self.place[x])

    def put_in_vectors(self, group: list[int], needs: Sequence[_Needs], placed: bool) -> None:
        """Find the vectors of a level, whose results have places or get them side by side."""
        points = [
            [self.place[x] for x in (*needs[i][2], *(needs[i][1] if placed else ()))] for i in group
        ]
        runs, rest = progressions(points) if len(group) >= SHORTEST else ([], range(len(group)))
        for run in runs:
            for members in pieces([group[i] for i in run]):
                if not placed:
                    self.take([self.nodes[i][1][0] for i in members])
                self.vectors.append(members)
                self.packed += len(members)
        if rest:
            singles = [group[i] for i in rest]
            if not placed:
                for i in singles:
                    self.take(list(self.nodes[i][1]))
            self.vectors.append(None)
            self.singles.append(singles)

    def take(self, names: Sequence[Operand]) -> None:
        """Allocate contiguous places for results."""
        if self.kept.isdisjoint(names):
            self.put(names, self.slots.take(len(names)))
        else:
            self.put(names, self.keep(len(names)))

    def keep(self, size: int) -> int:
        """Return the first of a number of places in the layer, within cache lines if possible."""
        if size > 1:
            self.size = -(-self.size // LINE) * LINE
        self.size += size
        return self.size - size

    # once all have places

    def finished(self) -> Layers:
        """Return the parts, including copies from layers to rows."""
        kept = {at: x for x, at in self.place.items() if self.state <= at < _TEMPORARY}
        parts: list[SeriesVector | list[SeriesNode]] = []
        later: list[SeriesVector | list[SeriesNode]] = []
        late: dict[tuple[Name, ...], list[int]] = {}
        entered: set[Name] = set()
        entering: dict[Name, None] = {}
        singles = iter(self.singles)
        for members in self.vectors:
            if members is None:
                batch = [self.nodes[i] for i in next(singles)]
                enter: list[SeriesNode] = []
                for op, _, operands in batch:
                    entering.update((x.series, None) for x in operands if isinstance(x, Delayed))
                    needed = dict.fromkeys(operands[n] for n in op.convolved)
                    enter += [_enters(x) for x in needed if x not in entered]
                    entered.update(needed)
                parts += [enter, batch] if enter else [batch]
                continue
            nodes = [self.nodes[i] for i in members]
            op = nodes[0][0]
            columns = [list(column) for column in zip(*[o for _, _, o in nodes], strict=True)]
            for n in range(len(columns)):
                if n in op.numbers:
                    continue
                before = isinstance(columns[n][0], Delayed)
                names = tuple([x.series if before else x for x in columns[n]])
                columns[n] = [self.place[x] for x in names]
                if (before or n in op.convolved) and steps(columns[n])[1] != 1:
                    # operands that are computed afterwards are copied at the end
                    known = late if before and names not in self.copies else self.copies
                    if names not in known:
                        (later if before else parts).append(self.copy(names, known))
                    columns[n] = known[names]
            parts.append(SeriesVector(op, [self.place[to] for _, (to,), _ in nodes], columns))
        enter = [_enters(x) for x in entering if x not in entered]
        parts += [*later, *([enter] if enter else [])]
        return self.moved(parts, {**kept, **self.copied})

    def moved(
        self, parts: list[SeriesVector | list[SeriesNode]], kept: dict[int, Operand]
    ) -> Layers:
        """Move temporary places beyond the layer and the next one's state."""
        # and not as far as the state after that, in which t and zeros are not written again
        state = -(-self.state // LINE) * LINE
        size = -(-max(self.size, state + self.slots.end - _TEMPORARY) // LINE) * LINE
        # an odd number of cache lines, so that layers do not compete for the same ones
        size += 0 if size // LINE % 2 else LINE
        offset = size + state - _TEMPORARY

        def to(places: list[int]) -> list[int]:
            return [at + offset if at >= _TEMPORARY else at for at in places]

        layers: list[SeriesVector | list[SeriesNode]] = []
        for part in parts:
            if isinstance(part, SeriesVector):
                operands = [
                    x if n in part.op.numbers else to(x) for n, x in enumerate(part.operands)
                ]
                part = SeriesVector(part.op, to(part.results), operands)
            layers.append(part)
        place = dict(zip(self.place, to(list(self.place.values())), strict=True))
        return Layers(layers, place, size, to([self.slots.end])[0], kept)


def vector_stream(vector: SeriesVector, place: Mapping[Any, int]) -> list[int]:
    """Return the stream of a vector operation.

    Parameters
    ----------
    vector : SeriesVector
    place : mapping
        Places of its numbers; see `SeriesVector.numbers`.
    """
    numbers = iter(vector.numbers)
    stream = [VECTOR + vector.op, len(vector.results), *steps(vector.results)]
    for n, x in enumerate(vector.operands):
        if n in vector.op.numbers:
            part = next(numbers)
            stream += (place[part], int(len(part) > 1))
        else:
            stream += steps(x)
    return stream


def _enters(x: Name) -> SeriesNode:
    """Return the operation that copies a series' coefficient to its row."""
    return SeriesOp.TO_ROW, (x,), (x,)
