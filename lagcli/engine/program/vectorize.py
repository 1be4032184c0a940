"""Vectorization: operations of one kind on equidistant registers become one vector operation.

Long models repeat the same operations for each body. Operations of one level (those whose operands
are ready at the same time) and of one kind are searched for operands in arithmetic progression;
such a set becomes one vector operation with contiguous results. The operations and their results do
not change, only their order.

References
----------
S. Larsen and S. Amarasinghe, Exploiting superword level parallelism with multimedia instruction
sets, PLDI 2000, doi:10.1145/349299.349320.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import chain, pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from lagcli.arrays import Indices, Int32, Numbers
from lagcli.engine.program.nodes import INDEXED, LINE, LONGEST, VECTOR, Node, Slots
from lagcli.engine.tape.operations import Kind, Op
from lagcli.named_tuples import NamedTuple

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

#: Operations that the core can vectorize.
_ON_VECTORS = {op for op in Op if op.kind is Kind.VECTOR}
#: Required fraction of the operations of a tape in vectors.
WORTH = 0.5
#: Fraction of operations that are repeated often enough for a vector, below which none are sought.
#: On models whose programs gain from vectors it is 0.63 to 1, on others 0.18 to 0.58.
REPEATED = 0.6


class Unit(NamedTuple):
    """Operations of one kind that are executed together, as a vector or one after the other."""

    op: int
    vector: bool
    nodes: list[Node]

    @property
    def results(self) -> list[int]:
        """Results of the operations."""
        return [x for _, results, _ in self.nodes for x in results]

    @property
    def values(self) -> Iterator[int]:
        """Results and operands."""
        return chain.from_iterable((*results, *operands) for _, results, operands in self.nodes)


class Packing:
    """Allocates results and forms vectors.

    Parameters
    ----------
    place : dict of int to int
        Registers of values; existing ones are kept, the others are added.
    count : int
        The first free register.
    families : sequence of str or None
        Labels of the inputs: those of the same family are used in the same way, so they are made
        contiguous first.
    isomorphic : sequence of sequences of int
        Results that are made contiguous once all are computed.
    """

    def __init__(
        self,
        place: dict[int, int],
        count: int,
        families: Sequence[str | None] = (),
        isomorphic: Sequence[Sequence[int]] = (),
    ):
        self.place, self.slots, self.isomorphic = place, Slots(count), isomorphic
        self.packed = 0
        self.families: dict[str, list[int]] = {}
        for x, family in enumerate(families):
            if family is not None:
                self.families.setdefault(family, []).append(x)

    @property
    def count(self) -> int:
        """The number of registers used."""
        return self.slots.end

    def streams(self, parts: Sequence[Sequence[Node]], needed: Sequence[set[int]]) -> list[Int32]:
        """Return the streams of the parts: all but the first run only on request.

        Parameters
        ----------
        parts : sequence of sequences of Node
            Each in an order in which every operand is ready.
        needed : sequence of sets of int
            Results needed after each part.
        """
        main = self._stream(parts[0], needed[0])
        families, inputs = self.families, dict(self.place)
        deferred = []
        for nodes, kept in zip(parts[1:], needed[1:], strict=True):
            # values moved by one of them are not available to the others
            self.families = dict(families)
            deferred.append(self._stream(nodes, kept))
            self.place.update(inputs)
        return [main, *deferred]

    def _stream(self, nodes: Sequence[Node], kept: set[int]) -> Int32:
        """Return the stream of operations.

        Parameters
        ----------
        nodes : sequence of Node
            In an order in which every operand is ready.
        kept : set of int
            Results needed later.
        """
        own = {x for _, results, _ in nodes for x in results}
        units = depth_first(self._units(nodes))
        last = {x: at for at, unit in enumerate(units) for x in unit.values if x in own}
        dying: list[list[int]] = [[] for _ in units]
        for x, at in last.items():
            if x not in kept:
                dying[at].append(x)
        numbers: list[int] = []
        for unit, ends in zip(units, dying, strict=True):
            numbers += self._emitted(unit)
            for x in ends:
                self.slots.release(self.place[x])
        return np.array([*numbers, Op.END, 0], dtype=np.int32)

    def _units(self, nodes: Sequence[Node]) -> list[Unit]:
        """Return operations in vectors and runs, in an order in which every operand is ready."""
        place, free = dict(self.place), self.slots.end  # as if no register were reused

        def side_by_side(values: Sequence[int]) -> None:
            nonlocal free
            place.update(zip(values, range(free, free + len(values)), strict=True))
            free += (-(-len(values) // LINE) + 1) * LINE

        units = self._inputs_side_by_side(nodes)
        for unit in units:
            side_by_side(unit.results)
        sets = together(nodes)
        complete = self._complete(nodes, sets)
        for at, group in enumerate(sets):
            op = nodes[group[0]][0]
            vectors, rest = _vectors(nodes, op, group, place)
            self.packed += sum(map(len, vectors))
            new = [Unit(op, True, [nodes[i] for i in members]) for members in vectors]
            if rest:
                new.append(Unit(op, False, [nodes[i] for i in rest]))
            for values in complete.get(at, ()):
                new += _moves(values)
            for unit in new:
                side_by_side(unit.results)
            units += new
        return units

    def _emitted(self, unit: Unit) -> list[int]:
        """Return the numbers of operations in a stream; allocates their results."""
        op, vector, nodes = unit
        if not vector:
            self._side_by_side(unit.results)
            return [op, len(nodes), *(self.place[x] for _, r, o in nodes for x in (*r, *o))]
        places = [
            steps([self.place[x] for x in operands])
            for operands in zip(*[operands for _, _, operands in nodes], strict=True)
        ]
        before = [self.place[x] for x in unit.results] if op == Op.MOVE else []
        first = self._side_by_side(unit.results)
        for place in before:
            if place in self.slots.vector:  # else it is an input's own
                self.slots.release(place)
        return [VECTOR + op, len(nodes), first, *chain.from_iterable(places)]

    def _side_by_side(self, values: Sequence[int]) -> int:
        """Make values contiguous; return the first register."""
        first = self.slots.take(len(values))
        self.place.update(zip(values, range(first, first + len(values)), strict=True))
        return first

    def _inputs_side_by_side(self, nodes: Sequence[Node]) -> list[Unit]:
        """Return the operations that make the inputs of families contiguous."""
        used = {x for _, _, operands in nodes for x in operands}
        moves: list[Unit] = []
        for family, members in list(self.families.items()):
            if used.isdisjoint(members):
                continue
            del self.families[family]
            if len(members) >= SHORTEST:
                moves += _moves(members)
        return moves

    def _complete(
        self, nodes: Sequence[Node], sets: Sequence[list[int]]
    ) -> dict[int, list[list[int]]]:
        """Return the results with equal uses, by the number of the set after which they are all
        there.
        """
        made = {x: at for at, group in enumerate(sets) for i in group for x in nodes[i][1]}
        complete: dict[int, list[list[int]]] = {}
        for values in self.isomorphic:
            own = [x for x in values if x in made]
            if len(own) >= SHORTEST:
                complete.setdefault(max(made[x] for x in own), []).append(own)
        return complete


def repeated(parts: Sequence[Sequence[Node]]) -> int:
    """Return how many operations compute the same function of inputs as at least seven others do.

    Inputs and constants are not distinguished. Each operation comes after its operands.
    """
    functions: dict[tuple[int, ...], int] = {}
    of: dict[int, int] = {}  # the number of each result's function
    for nodes in parts:
        for op, results, operands in nodes:
            key = (op, *[of.get(x, -1) for x in operands])
            number = functions.setdefault(key, len(functions))
            for place, x in enumerate(results):
                of[x] = 2 * number + place
    counts = Counter([of[results[0]] for nodes in parts for _, results, _ in nodes])
    return sum(count for count in counts.values() if count >= SHORTEST)


def _vectors(
    nodes: Sequence[Node], op: int, group: list[int], place: Mapping[int, int]
) -> tuple[list[Sequence[int]], list[int]]:
    """Return the operations of each vector, and the remaining ones."""
    if op not in _ON_VECTORS or len(group) < SHORTEST:
        return [], group
    runs, rest = progressions([[place[x] for x in nodes[i][2]] for i in group])
    vectors = [piece for run in runs for piece in pieces([group[i] for i in run])]
    return vectors, [group[i] for i in rest]


def _moves(values: Sequence[int]) -> Iterator[Unit]:
    """Yield the operations that make values contiguous."""
    for piece in pieces(values):
        yield Unit(Op.MOVE, True, [(Op.MOVE, (x,), (x,)) for x in piece])


def depth_first(units: Sequence[Unit]) -> list[Unit]:
    """Return units in an order in which results are used soon, while they are in the cache.

    They come in an order in which every operand is ready.
    """
    maker: dict[int, int] = {}
    readers: dict[int, list[int]] = {}
    users: list[list[int]] = [[] for _ in units]
    waiting = [0] * len(units)
    for i, unit in enumerate(units):
        before: set[int] = set()
        for _, results, operands in unit.nodes:
            for x in operands:
                if x in maker:
                    before.add(maker[x])
                if x in readers:
                    readers[x].append(i)
                else:
                    readers[x] = [i]
            for x in results:  # only units after a move wait for it
                if x in readers:
                    before.update(readers.pop(x))
        before.discard(i)
        for _, results, _ in unit.nodes:
            maker.update(dict.fromkeys(results, i))
        waiting[i] = len(before)
        for j in before:
            users[j].append(i)
    ready = [i for i in reversed(range(len(units))) if not waiting[i]]
    ordered: list[Unit] = []
    while ready:
        i = ready.pop()
        ordered.append(units[i])
        for j in users[i]:
            waiting[j] -= 1
        ready += [j for j in reversed(users[i]) if not waiting[j]]
    return ordered


def together(nodes: Sequence[Node]) -> list[list[int]]:
    """Return sets of operations of one kind that can be executed together, in order.

    Operations near the beginning are scheduled as early as possible, those near the end as late as
    possible.
    """
    producer = {x: i for i, (_, destinations, _) in enumerate(nodes) for x in destinations}
    depth, height = [1] * len(nodes), [1] * len(nodes)
    for i, (_, _, operands) in enumerate(nodes):
        for x in operands:
            if x in producer and depth[producer[x]] >= depth[i]:
                depth[i] = 1 + depth[producer[x]]
    for i in reversed(range(len(nodes))):
        for x in nodes[i][2]:
            if x in producer and height[producer[x]] <= height[i]:
                height[producer[x]] = 1 + height[i]
    end = max(height, default=0) + 1
    levels: dict[tuple[int, int], list[int]] = {}
    for i, (op, _, _) in enumerate(nodes):
        level = depth[i] if depth[i] <= height[i] else end - height[i]
        levels.setdefault((level, op), []).append(i)
    return [levels[key] for key in sorted(levels)]


def last_uses(
    nodes: Sequence[Node], sets: Sequence[list[int]], kept: Collection[Any]
) -> list[list[int]]:
    """Return, for each set of operations, the results that are not needed after it."""
    last: dict[int, int] = {}
    for at, group in enumerate(sets):
        for node in group:
            _, destinations, _ = nodes[node]
            last.update(dict.fromkeys(destinations, at))
    for at, group in enumerate(sets):
        for node in group:
            for x in nodes[node][2]:
                if x in last:
                    last[x] = max(last[x], at)
    ends: list[list[int]] = [[] for _ in sets]
    for x, at in last.items():
        if x not in kept:
            ends[at].append(x)
    return ends


#: Minimum length of a vector, in operations: a shorter one takes as long as its parts.
SHORTEST = 8
#: Gain per element of a vector, with all operands in progression or one indexed; cost of a vector.
_SAVED, _SAVED_INDEXED = 0.1, 0.06
#: Largest distance, in the order of operands, of the first two elements of a progression.
_REACH = 4
#: Number of most common differences of which the best is used.
_CANDIDATES = 4
#: Odd numbers without a pattern, for hashing.
_MIXED = np.array(
    [0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9, 0xD6E8FEB86659FD93],
    dtype=np.uint64,
)
#: Largest number of progressions searched in one set.
_MOST = 60


def progressions(points: ArrayLike) -> tuple[list[list[int]], list[int]]:
    """Find points in arithmetic progression.

    Parameters
    ----------
    points : (n, k) array of integers
        The registers of k operands.

    Returns
    -------
    runs : list of lists of int
        Indices of points; in some progressions, one of the coordinates is arbitrary.
    rest : list of int
        Indices of the points in no progression.
    """
    places = np.array(points, dtype=np.int64)
    left, again = _sorted(places)
    runs: list[list[int]] = []
    while len(left) >= SHORTEST and len(runs) < _MOST:
        best = _best_progressions(places[left])
        if not best:
            break
        runs += [left[run].tolist() for run in best]
        left = np.delete(left, np.concatenate(best))
    if len(again) >= SHORTEST and runs:
        more, rest = progressions(places[again])
        runs += [again[run].tolist() for run in more]
        again = again[rest]
    return runs, [*left.tolist(), *again.tolist()]


def _sorted(points: Numbers) -> tuple[Indices, Indices]:
    """Return the order of points, and of those already sorted."""
    order = np.lexsort(points.T[::-1])
    new = np.append(True, (points[order][1:] != points[order][:-1]).any(axis=1))
    return order[new], order[~new]


def _best_progressions(points: Numbers) -> list[Indices]:
    """Return the progressions with the most profitable step, as indices of points."""
    best: list[Indices] = []
    most, operands = 0.0, points.shape[1]
    for indexed in range(-1, operands if operands > 1 else 0):
        kept = points if indexed < 0 else np.delete(points, indexed, axis=1)
        order, _ = _sorted(kept)
        # numbers whose differences distinguish the steps
        keys = (kept[order].astype(np.uint64) * _MIXED[: kept.shape[1]]).sum(axis=1)
        for step in _commonsteps(keys):
            runs = [run for run in _runs(keys, step) if len(run) >= SHORTEST]
            covered = sum(map(len, runs))
            saved = (_SAVED if indexed < 0 else _SAVED_INDEXED) * covered - len(runs)
            if saved > most:
                best, most = [order[run] for run in runs], saved
                if indexed < 0 and 8 * covered > 7 * len(points):
                    return best
    return best


def _commonsteps(keys: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Return the most common differences of points that are not far apart."""
    gaps = [keys[reach:] - keys[:-reach] for reach in range(1, _REACH + 1)]
    steps, counts = np.unique(np.concatenate(gaps), return_counts=True)
    first = np.argsort(-counts, kind="stable")[:_CANDIDATES]
    return np.asarray(steps[first[counts[first] >= SHORTEST - 1]])


def _runs(keys: NDArray[np.uint64], step: np.uint64) -> Iterator[list[int]]:
    """Yield the longest progressions with a step, of two points at least."""
    order = np.argsort(keys)
    at = np.searchsorted(keys, keys + step, sorter=order) % len(keys)
    following = order[at]
    there = keys[following] == keys + step
    begins = there.copy()
    begins[following[there]] = False
    after = np.where(there, following, -1).tolist()
    for point in np.flatnonzero(begins).tolist():
        run = [point]
        while (point := after[point]) >= 0:
            run.append(point)
        yield run


def pieces(values: Sequence[int], longest: int = LONGEST) -> Iterator[Sequence[int]]:
    """Yield parts of equal lengths that are at most as long as a vector."""
    count = -(-len(values) // longest)
    ends = [len(values) * i // count for i in range(count + 1)]
    return (values[a:b] for a, b in pairwise(ends))


def steps(places: Sequence[int]) -> Sequence[int]:
    """Return the first register and the step, or the list of registers."""
    distances = {b - a for a, b in pairwise(places)} or {1}
    return (places[0], *distances) if len(distances) == 1 else (0, INDEXED, *places)
