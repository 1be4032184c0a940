"""Operations of one kind on registers at equal distances → one operation on vectors.

Long models repeat themselves: what is done for one body is done for all. The operations of a level
(those whose operands are ready together) and of one kind are searched for operands in arithmetic
progression; such a set becomes one operation on vectors, its results side by side. Which operations
there are and what they give does not change, only their order.

References
----------
S. Larsen and S. Amarasinghe, Exploiting superword level parallelism with multimedia instruction
sets, PLDI 2000, doi:10.1145/349299.349320.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lagcli.engine.nodes import END, INDEXED, MOVE, MULADD, MULSUB, PLACES, SUBMUL, VECTOR, Node
from lagcli.engine.tape import Op

#: What the core does on vectors.
_ON_VECTORS = {Op.ADD, Op.SUB, Op.MUL, Op.DIV, Op.NEG, Op.SQRT, Op.ABS, MULADD, MULSUB, SUBMUL}
#: Operations from which vectors are looked for, and the part of them that is to be in vectors.
LONG, WORTH = 1500, 0.5
#: Operations that a vector is worth: a shorter one takes as long as its parts; and the most, as in
#: core/tape.h.
SHORTEST, LONGEST = 8, 256
#: What an element of a vector saves, with all operands in progression or one indexed; vectors.
_SAVED, _SAVED_INDEXED = 0.1, 0.06
#: How far apart, in order of operands, the first two of a progression are looked for.
_REACH = 4
#: Places in a line of the cache.
LINE = 8
#: The most common differences, of which the best is taken.
_CANDIDATES = 4
#: Odd numbers without a pattern.
_MIXED = np.array(
    [0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9, 0xD6E8FEB86659FD93],
    dtype=np.uint64,
)
#: Progressions that are looked for in one set, at most.
_MOST = 60


class Unit(NamedTuple):
    """Operations of one kind that are done together, as a vector or one after the other."""

    op: int
    vector: bool
    nodes: list[Node]

    @property
    def results(self) -> list[int]:
        """What they give."""
        return [x for _, results, _ in self.nodes for x in results]

    @property
    def values(self) -> Iterator[int]:
        """Results and operands."""
        return chain.from_iterable((*results, *operands) for _, results, operands in self.nodes)


class Packing:
    """Gives results places and puts operations in vectors.

    Parameters
    ----------
    place : dict of int to int
        What has a place keeps it; the others are added.
    count : int
        The first free place.
    families : sequence of str or None
        Labels of the inputs: those of the same family are treated alike, so they are brought side
        by side first.
    alike : sequence of sequences of int
        Results that are brought side by side when they are all there.
    """

    def __init__(
        self,
        place: dict[int, int],
        count: int,
        families: Sequence[str | None] = (),
        alike: Sequence[Sequence[int]] = (),
    ):
        self.place, self.memory, self.alike = place, Memory(count), alike
        self.packed = 0
        self.families: dict[str, list[int]] = {}
        for x, family in enumerate(families):
            if family is not None:
                self.families.setdefault(family, []).append(x)

    @property
    def count(self) -> int:
        """The first place after all."""
        return self.memory.end

    def streams(
        self, parts: Sequence[Sequence[Node]], needed: Sequence[set[int]]
    ) -> list[NDArray[np.int32]]:
        """Return the streams of parts: all but the first are run only where they are asked for.

        Parameters
        ----------
        parts : sequence of sequences of Node
            Each in an order in which every operand is ready.
        needed : sequence of sets of int
            Results needed after each part.
        """
        main = self._stream(parts[0], needed[0])
        families, inputs = self.families, dict(self.place)
        later = []
        for nodes, kept in zip(parts[1:], needed[1:], strict=True):
            # what one of them moves is not there for the others
            self.families = dict(families)
            later.append(self._stream(nodes, kept))
            self.place.update(inputs)
        return [main, *later]

    def _stream(self, nodes: Sequence[Node], kept: set[int]) -> NDArray[np.int32]:
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
                self.memory.give_back(self.place[x])
        return np.array([*numbers, END, 0], dtype=np.int32)

    def _units(self, nodes: Sequence[Node]) -> list[Unit]:
        """Return operations in vectors and runs, in an order in which every operand is ready."""
        place, free = dict(self.place), self.memory.end  # as if no place were used again

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
        """Return the numbers of operations in a stream; their results get places."""
        op, vector, nodes = unit
        if not vector:
            numbers = [op, len(nodes)]
            for _, results, operands in nodes:
                for x in results:
                    self._side_by_side([x])
                numbers += [self.place[x] for x in (*results, *operands)]
            return numbers
        places = [
            steps([self.place[x] for x in operands])
            for operands in zip(*[operands for _, _, operands in nodes], strict=True)
        ]
        before = [self.place[x] for x in unit.results] if op == MOVE else []
        first = self._side_by_side(unit.results)
        for place in before:
            self.memory.give_back(place)
        return [VECTOR + op, len(nodes), first, *chain.from_iterable(places)]

    def _side_by_side(self, values: Iterable[int]) -> int:
        """Give values places side by side; return the first."""
        values = list(values)
        first = self.memory.take(len(values))
        self.place.update(zip(values, range(first, first + len(values)), strict=True))
        return first

    def _inputs_side_by_side(self, nodes: Sequence[Node]) -> list[Unit]:
        """Return the operations that bring the inputs of families side by side."""
        used = {x for _, _, operands in nodes for x in operands}
        found: list[Unit] = []
        for family, members in list(self.families.items()):
            if used.isdisjoint(members):
                continue
            del self.families[family]
            if len(members) >= SHORTEST:
                found += _moves(members)
        return found

    def _complete(
        self, nodes: Sequence[Node], sets: Sequence[list[int]]
    ) -> dict[int, list[list[int]]]:
        """Return the results that are used alike, by the number of the set after which they are all
        there.
        """
        made = {x: at for at, group in enumerate(sets) for i in group for x in nodes[i][1]}
        found: dict[int, list[list[int]]] = {}
        for values in self.alike:
            own = [x for x in values if x in made]
            if len(own) >= SHORTEST:
                found.setdefault(max(made[x] for x in own), []).append(own)
        return found


def _vectors(
    nodes: Sequence[Node], op: int, group: list[int], place: Mapping[int, int]
) -> tuple[list[Sequence[int]], list[int]]:
    """Return the operations of each vector, and what is in none."""
    if op not in _ON_VECTORS or len(group) < SHORTEST:
        return [], group
    found, rest = progressions([[place[x] for x in nodes[i][2]] for i in group])
    vectors = [piece for run in found for piece in pieces([group[i] for i in run])]
    return vectors, [group[i] for i in rest]


def _moves(values: Sequence[int]) -> Iterator[Unit]:
    """Yield the operations that bring values side by side."""
    for piece in pieces(values):
        yield Unit(MOVE, True, [(MOVE, (x,), (x,)) for x in piece])


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
            before.update(maker[x] for x in operands if x in maker)
            for x in operands:
                readers.setdefault(x, []).append(i)
            for x in results:  # a move is waited for by those that come after it alone
                before.update(readers.pop(x, ()))
        before.discard(i)
        for _, results, _ in unit.nodes:
            maker.update(dict.fromkeys(results, i))
        waiting[i] = len(before)
        for j in before:
            users[j].append(i)
    ready = [i for i in reversed(range(len(units))) if not waiting[i]]
    found: list[Unit] = []
    while ready:
        i = ready.pop()
        found.append(units[i])
        for j in users[i]:
            waiting[j] -= 1
        ready += [j for j in reversed(users[i]) if not waiting[j]]
    return found


def progressions(points: ArrayLike) -> tuple[list[list[int]], list[int]]:
    """Find points in arithmetic progression.

    Parameters
    ----------
    points : (n, k) array of integers
        The places of k operands.

    Returns
    -------
    found : list of lists of int
        Numbers of points; in some, one of the coordinates is in no progression.
    rest : list of int
        Numbers of the points that are in none.
    """
    places = np.array(points, dtype=np.int64)
    left, again = _sorted(places)
    found: list[list[int]] = []
    while len(left) >= SHORTEST and len(found) < _MOST:
        best = _best_progressions(places[left])
        if not best:
            break
        found += [left[run].tolist() for run in best]
        left = np.delete(left, np.concatenate(best))
    if len(again) >= SHORTEST and found:
        more, rest = progressions(places[again])
        found += [again[run].tolist() for run in more]
        again = again[rest]
    return found, [*left.tolist(), *again.tolist()]


def _sorted(points: NDArray[np.int64]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the order of points, and of those that are there already."""
    order = np.lexsort(points.T[::-1])
    new = np.append(True, (points[order][1:] != points[order][:-1]).any(axis=1))
    return order[new], order[~new]


def _best_progressions(points: NDArray[np.int64]) -> list[NDArray[np.intp]]:
    """Return the progressions with the step by which they save most, as numbers of points."""
    best: list[NDArray[np.intp]] = []
    most, operands = 0.0, points.shape[1]
    for indexed in range(-1, operands if operands > 1 else 0):
        kept = points if indexed < 0 else np.delete(points, indexed, axis=1)
        order, _ = _sorted(kept)
        # numbers whose differences tell the steps apart
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
    """Yield parts that are no longer than a vector may be, of equal lengths."""
    count = -(-len(values) // longest)
    ends = [len(values) * i // count for i in range(count + 1)]
    return (values[a:b] for a, b in pairwise(ends))


def steps(places: Sequence[int]) -> Sequence[int]:
    """Return the first place and the step, or the places."""
    found = {b - a for a, b in pairwise(places)} or {1}
    return (places[0], *found) if len(found) == 1 else (0, INDEXED, *places)


def together(nodes: Sequence[Node]) -> list[list[int]]:
    """Return sets of operations of one kind that can be done together, in order.

    What is nearer to the beginning is done as early as it can be, what is nearer to the end as
    late as it can be.
    """
    producer = {x: i for i, (_, destinations, _) in enumerate(nodes) for x in destinations}
    depth, height = [1] * len(nodes), [1] * len(nodes)
    for i, (_, _, operands) in enumerate(nodes):
        depth[i] = 1 + max([depth[producer[x]] for x in operands if x in producer], default=0)
    for i in reversed(range(len(nodes))):
        for x in nodes[i][2]:
            if x in producer:
                height[producer[x]] = max(height[producer[x]], 1 + height[i])
    end = max(height, default=0) + 1
    levels: dict[tuple[int, int], list[int]] = {}
    for i, (op, _, _) in enumerate(nodes):
        level = depth[i] if depth[i] <= height[i] else end - height[i]
        levels.setdefault((level, op), []).append(i)
    return [levels[key] for key in sorted(levels)]


def last_uses(nodes: Sequence[Node], sets: Sequence[list[int]], kept: set[int]) -> list[list[int]]:
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


class Memory:
    """Free places, by intervals; a vector's places become free together."""

    def __init__(self, end: int):
        self.end = end
        self.starts: list[int] = []
        self.stops: list[int] = []
        self.vector: dict[int, tuple[int, int]] = {}  # of each place in use
        self.alive: Counter[int] = Counter()

    def take(self, size: int) -> int:
        """Return the first of as many places side by side."""
        values = size
        if size > 1:  # whole lines of the cache
            size = -(-size // LINE) * LINE
        for i, (start, stop) in enumerate(zip(self.starts, self.stops, strict=True)):
            if stop - start >= size and (size == 1 or not start % LINE):
                self.starts[i] += size
                if self.starts[i] == stop:
                    del self.starts[i], self.stops[i]
                break
        else:
            start = self.end if size == 1 else -(-self.end // LINE) * LINE
            self.end = start + size
        self.vector.update(dict.fromkeys(range(start, start + size), (start, size)))
        self.alive[start] = values
        return start

    def give_back(self, at: int) -> None:
        """Free a place, with its vector when that has no other in use."""
        if at not in self.vector:  # nobody took it from here
            return
        first, size = self.vector[at]
        self.alive[first] -= 1
        if self.alive[first]:
            return
        i = bisect_left(self.starts, first)
        self.starts.insert(i, first)
        self.stops.insert(i, first + size)
        for k in (i, i - 1):  # with its neighbours
            if 0 <= k < len(self.starts) - 1 and self.stops[k] == self.starts[k + 1]:
                self.stops[k] = self.stops.pop(k + 1)
                del self.starts[k + 1]


def unpacked(stream: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return a stream with the same operations one by one."""
    numbers = stream.tolist()
    found: list[int] = []
    at = 0
    while numbers[at] != END:
        op, n = numbers[at : at + 2]
        at += 2
        if op < VECTOR:
            size = n * PLACES[op]
            found += (op, n, *numbers[at : at + size])
            at += size
            continue
        op -= VECTOR
        found += (op, n)
        columns = [list(range(numbers[at], numbers[at] + n))]
        at += 1
        for _ in range(PLACES[op] - 1):
            first, step = numbers[at : at + 2]
            at += 2
            if step == INDEXED:
                columns.append(numbers[at : at + n])
                at += n
            else:
                columns.append([first + i * step for i in range(n)])
        found += [x for operation in zip(*columns, strict=True) for x in operation]
    return np.array([*found, END, 0], dtype=np.int32)
