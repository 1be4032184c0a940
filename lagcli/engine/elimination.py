"""LDLᵀ of [[M, Bᵀ], [B, 0]] with a static order, found once from numbers and unrolled into a tape.

The order is that of least degree among the pivots that are large enough at every sampled state
(Markowitz with a threshold); where no entry of the diagonal is, two unknowns are eliminated at
once (Bunch and Kaufman's pivots of order two: a coordinate without inertia and its constraint). A
static order is only as good as the states that it was found at, so the engine watches the residual
of what it computes.

References
----------
I. S. Duff and J. K. Reid, The multifrontal solution of indefinite sparse symmetric linear systems,
ACM TOMS 9 (1983), doi:10.1145/356044.356047.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from lagcli.engine.system import Pattern
from lagcli.engine.tape import Builder, Op, Tape

Array = NDArray[np.float64]
Rows = list[dict[int, Array]]

#: A pivot is at least this part of the largest entry of its row, at every sampled state.
THRESHOLD = 0.3
#: What is accepted where no pivot reaches the threshold; the engine's check of residuals decides.
_LEAST = 1e-6
#: Updates of entries beyond which the matrix is treated as dense.
MOST_UPDATES = 300_000
#: Updates of entries up to which the factorization is unrolled into the tape.
MOST_UNROLLED = 30_000


class NoElimination(ArithmeticError):
    """There is no static order: the matrix is singular at a sampled state, or fills up."""


@dataclass(frozen=True)
class Elimination:
    """The order of an elimination and the places of the nonzero entries of L.

    n unknowns: the accelerations, then −λ. Places are numbers in the order of elimination.

    Parameters
    ----------
    order : tuple of n int
        The unknown at each place.
    paired : tuple of n bool
        Whether the place begins a pivot of order two.
    columns : tuple of n tuples of int
        Below each place, the places where L is not zero; those of a pair are alike.
    """

    order: tuple[int, ...]
    paired: tuple[bool, ...]
    columns: tuple[tuple[int, ...], ...]

    @property
    def unrolled(self) -> bool:
        """Whether the factorization is short enough to be unrolled into a tape."""
        return sum(len(c) * (len(c) + 1) // 2 for c in self.columns) <= MOST_UNROLLED

    @property
    def starts(self) -> list[int]:
        """Where the entries of each column of L begin, and where the last ends; n + 1."""
        return [0, *accumulate(len(c) for c in self.columns)]

    @property
    def left(self) -> tuple[list[int], list[int], list[int]]:
        """L by rows: where each row begins (n + 1), and the columns and numbers of its entries."""
        rows: list[list[tuple[int, int]]] = [[] for _ in self.order]
        entry = 0
        for k, column in enumerate(self.columns):
            for i in column:
                rows[i].append((k, entry))
                entry += 1
        found = [pair for row in rows for pair in row]
        starts = [0, *accumulate(len(row) for row in rows)]
        return starts, [k for k, _ in found], [e for _, e in found]

    def targets(self, places: Iterable[tuple[int, int]]) -> list[int]:
        """Return where the matrix' entries go among D's diagonal, D's pairs and L.

        Parameters
        ----------
        places : iterable of (row, column)
            −1 is returned for the half of the matrix that is not stored.
        """
        n = len(self.order)
        place = {unknown: k for k, unknown in enumerate(self.order)}
        number = {(i, k): e for e, (k, i) in enumerate(self._entries())}
        found = []
        for row, column in places:
            i, k = place[row], place[column]
            if i == k:
                found.append(i)
            elif i < k:
                found.append(-1)
            else:
                found.append(n + k if self.paired[k] and i == k + 1 else 2 * n + number[i, k])
        return found

    def _entries(self) -> Iterable[tuple[int, int]]:
        return ((k, i) for k, column in enumerate(self.columns) for i in column)


def find_order(
    nq: int,
    nc: int,
    mass: Pattern,
    jacobian: Pattern,
    mass_values: Array,
    jacobian_values: Array,
) -> Elimination:
    """Find a static order of elimination.

    Parameters
    ----------
    nq, nc : int
        Numbers of coordinates and constraints.
    mass, jacobian : patterns of M and B
    mass_values, jacobian_values : (entries, states) arrays
        M and B at the sampled states.

    Raises
    ------
    NoElimination
    """
    size = nq + nc
    rows = _scaled_rows(size, nq, mass, jacobian, mass_values, jacobian_values)
    order: list[int] = []
    paired: list[bool] = []
    below: list[tuple[int, ...]] = []
    updates = 0
    queue = [(len(row), i) for i, row in enumerate(rows)]
    heapq.heapify(queue)
    refused: set[int] = set()
    alive = [True] * size
    while len(order) < size:
        pivots: tuple[int, ...] = ()
        while queue:
            degree, i = heapq.heappop(queue)
            if not alive[i] or degree != len(rows[i]) or i in refused:
                continue
            if _large(rows[i], i) >= THRESHOLD:
                pivots = (i,)
                break
            refused.add(i)
        pivots = pivots or _refuge(rows, refused)
        neighbours = sorted({j for i in pivots for j in rows[i]} - set(pivots))
        updates += len(pivots) * len(neighbours) * (len(neighbours) + 1) // 2
        if updates > MOST_UPDATES:
            raise NoElimination
        _eliminate(rows, pivots, neighbours)
        for i in pivots:
            alive[i] = False
            order.append(i)
            paired.append(False)
            below.append(tuple(neighbours))
        paired[-len(pivots)] = len(pivots) == 2
        for j in neighbours:
            refused.discard(j)
            heapq.heappush(queue, (len(rows[j]), j))
        refused.difference_update(pivots)
    place = {unknown: k for k, unknown in enumerate(order)}
    columns = tuple(tuple(sorted(place[j] for j in column)) for column in below)
    return Elimination(tuple(order), tuple(paired), columns)


def _scaled_rows(
    size: int, nq: int, mass: Pattern, jacobian: Pattern, m: Array, b: Array
) -> Rows:
    """Return the matrix by rows, scaled so that the largest entry of each row is near one."""
    places = [*mass, *((j, nq + i) for i, j in jacobian), *((nq + i, j) for i, j in jacobian)]
    values = np.concatenate([m, b, b])
    if not np.isfinite(values).all():
        raise NoElimination
    row, column = np.array(places, dtype=np.intp).reshape(-1, 2).T
    scale = np.ones(size)
    magnitude = np.abs(values).max(axis=1, initial=0.0)
    for _ in range(4):  # Ruiz: each time the square root of what is left
        largest = np.zeros(size)
        np.maximum.at(largest, row, magnitude * scale[row] * scale[column])
        if not largest.all():
            raise NoElimination
        scale /= np.sqrt(largest)
    values = values * (scale[row] * scale[column])[:, None]
    rows: Rows = [{} for _ in range(size)]
    for (i, j), x in zip(places, values, strict=True):
        rows[i][j] = x
    return rows


def _large(row: dict[int, Array], i: int) -> float:
    """Return the least ratio, over the states, of a diagonal entry to its row's largest other."""
    if i not in row:
        return 0.0
    others = [np.abs(x) for j, x in row.items() if j != i]
    own = np.abs(row[i])
    if not others:
        return float(own.min() > 0.0)
    return float((own / np.maximum(np.maximum.reduce(others), 1e-300)).min())


def _refuge(rows: Rows, refused: set[int]) -> tuple[int, ...]:
    """Return the best pivot where no diagonal entry is large enough: a pair, or the largest."""
    best: tuple[float, int, tuple[int, ...]] = (-_LEAST, 0, ())
    for i in sorted(refused, key=lambda i: len(rows[i])):
        row = rows[i]
        pair = [(_pair_size(rows, i, j), j) for j in row if j != i]
        options: list[tuple[float, tuple[int, ...]]] = [(_large(row, i), (i,))]
        if pair:
            size, j = max(pair)
            options.append((size, (i, j)))
        for size, pivots in options:
            key = (-min(size, THRESHOLD), len(row), pivots)
            best = min(best, key)
        if best[0] <= -THRESHOLD:
            break
    if not best[2]:
        raise NoElimination
    return best[2]


def _pair_size(rows: Rows, i: int, j: int) -> float:
    """Return 1 over the largest entry of L that a pivot of order two gives."""
    zero = np.zeros_like(rows[i][j])
    a, b, c = rows[i].get(i, zero), rows[i][j], rows[j].get(j, zero)
    others = (rows[i].keys() | rows[j].keys()) - {i, j}
    if not others:
        return float(np.abs(a * c - b * b).min() > 0.0)
    at = np.maximum.reduce([np.abs(rows[i].get(k, zero)) for k in others])
    below = np.maximum.reduce([np.abs(rows[j].get(k, zero)) for k in others])
    determinant = np.abs(a * c - b * b)
    grown = np.maximum(np.abs(c) * at + np.abs(b) * below, np.abs(b) * at + np.abs(a) * below)
    return float((determinant / np.maximum(grown, 1e-300)).min())


def _eliminate(rows: Rows, pivots: tuple[int, ...], neighbours: list[int]) -> None:
    """Take the pivots' part off the rows of their neighbours."""
    zero = np.zeros_like(next(iter(rows[pivots[0]].values())))
    columns = [[rows[i].get(j, zero) for j in neighbours] for i in pivots]
    if len(pivots) == 1:
        parts = [[x / rows[pivots[0]][pivots[0]] for x in columns[0]]]
    else:
        i, k = pivots
        a, b, c = rows[i].get(i, zero), rows[i][k], rows[k].get(k, zero)
        determinant = a * c - b * b
        parts = [
            [(c * x - b * y) / determinant for x, y in zip(*columns, strict=True)],
            [(a * y - b * x) / determinant for x, y in zip(*columns, strict=True)],
        ]
    for x, j in enumerate(neighbours):
        for y in range(x + 1):
            k = neighbours[y]
            change = sum(part[x] * column[y] for part, column in zip(parts, columns, strict=True))
            value = rows[j].get(k, zero) - change
            rows[j][k] = rows[k][j] = value
    for j in neighbours:
        for i in pivots:
            rows[j].pop(i, None)


def unroll(
    dynamics: Tape, nq: int, mass: Pattern, jacobian: Pattern, elimination: Elimination
) -> Tape:
    """Append the solution of [[M, Bᵀ], [B, 0]] [a; −λ] = [f; γ] to a dynamics tape.

    Parameters
    ----------
    dynamics : Tape
        As in System.
    nq : int
    mass, jacobian : patterns of M and B
    elimination : Elimination

    Returns
    -------
    Tape
        With the outputs of ``dynamics``, then a, λ, then the factors: by place, the inverse of D
        (its diagonal; right of the diagonal where a pair begins, else 0), then L by columns.
    """
    builder, outputs = Builder.extending(dynamics)
    return _Unrolling(builder, outputs, nq, mass, jacobian, elimination).tape()


class _Unrolling:
    """Emits the operations of a factorization and of its use."""

    def __init__(
        self,
        builder: Builder,
        outputs: list[int],
        nq: int,
        mass: Pattern,
        jacobian: Pattern,
        elimination: Elimination,
    ):
        self.builder, self.outputs, self.nq, self.plan = builder, outputs, nq, elimination
        self.zero, self.one = builder.constant(0.0), builder.constant(1.0)
        place = {unknown: k for k, unknown in enumerate(elimination.order)}
        self.place = place
        nm, nb = len(mass), len(jacobian)
        self.entries: dict[tuple[int, int], int] = {}
        for (i, j), x in zip(mass, outputs, strict=False):
            if place[i] >= place[j]:
                self.entries[place[i], place[j]] = x
        for (i, j), x in zip(jacobian, outputs[nm + nq :], strict=False):
            p, q = place[nq + i], place[j]
            self.entries[max(p, q), min(p, q)] = x
        size = len(elimination.order)
        right = [*outputs[nm : nm + nq], *outputs[nm + nq + nb : nm + nb + size]]
        self.right = [right[unknown] for unknown in elimination.order]

    # arithmetic that knows zeros and ones

    def times(self, a: int, b: int) -> int:
        if self.zero in (a, b):
            return self.zero
        if a == self.one:
            return b
        return a if b == self.one else self.builder.emit(Op.MUL, a, b)

    def minus(self, a: int, b: int) -> int:
        if b == self.zero:
            return a
        if a == self.zero:
            return self.builder.emit(Op.NEG, b)
        return self.builder.emit(Op.SUB, a, b)

    def inverse(self, a: int) -> int:
        return a if a == self.one else self.builder.emit(Op.DIV, self.one, a)

    def tape(self) -> Tape:
        plan, size = self.plan, len(self.plan.order)
        diagonal, beside = [self.zero] * size, [self.zero] * size
        lower: list[list[int]] = [[] for _ in range(size)]
        k = 0
        while k < size:
            width = 2 if plan.paired[k] else 1
            inverse = self.pivot(k, width)
            diagonal[k : k + width] = [inverse[i][i] for i in range(width)]
            if width == 2:
                beside[k] = inverse[0][1]
            self.column(k, width, inverse, lower)
            k += width
        x = self.backward(diagonal, beside, lower)
        solution = [x[self.place[i]] for i in range(size)]
        solution[self.nq :] = [self.minus(self.zero, y) for y in solution[self.nq :]]
        factors = [*diagonal, *beside, *(y for column in lower for y in column)]
        return self.builder.finish([*self.outputs, *solution, *factors])

    def pivot(self, k: int, width: int) -> list[list[int]]:
        """Return the inverse of a pivot."""
        a = self.entries.get((k, k), self.zero)
        if width == 1:
            return [[self.inverse(a)]]
        b, c = self.entries[k + 1, k], self.entries.get((k + 1, k + 1), self.zero)
        if a == self.zero and c == self.zero:
            x = self.inverse(b)
            return [[self.zero, x], [x, self.zero]]
        determinant = self.minus(self.times(a, c), self.times(b, b))
        x = self.inverse(determinant)
        off = self.minus(self.zero, self.times(b, x))
        return [[self.times(c, x), off], [off, self.times(a, x)]]

    def column(self, k: int, width: int, inverse: list[list[int]], lower: list[list[int]]) -> None:
        """Emit a pivot's part of L, its updates, and its part of the forward substitution."""
        below = self.plan.columns[k]
        rows: dict[int, list[int]] = {}
        for i in below:
            entries = [self.entries.pop((i, k + p), self.zero) for p in range(width)]
            factors = []
            for p in range(width):
                total = self.times(entries[0], inverse[0][p])
                if width == 2:
                    total = self.plus(total, self.times(entries[1], inverse[1][p]))
                factors.append(total)
                lower[k + p].append(total)
            for p in range(width):
                self.right[i] = self.minus(
                    self.right[i], self.times(factors[p], self.right[k + p])
                )
            rows[i] = entries
        for n, i in enumerate(below):
            for j in below[: n + 1]:
                value = self.entries.get((i, j), self.zero)
                for p in range(width):
                    value = self.minus(value, self.times(lower[k + p][n], rows[j][p]))
                if value != self.zero:
                    self.entries[i, j] = value

    def plus(self, a: int, b: int) -> int:
        if a == self.zero:
            return b
        return a if b == self.zero else self.builder.emit(Op.ADD, a, b)

    def backward(
        self, diagonal: list[int], beside: list[int], lower: list[list[int]]
    ) -> list[int]:
        """Emit the division by D and the backward substitution."""
        plan, z = self.plan, self.right
        x = [self.zero] * len(z)
        for k in reversed(range(len(z))):
            total = self.times(diagonal[k], z[k])
            if plan.paired[k]:
                total = self.plus(total, self.times(beside[k], z[k + 1]))
            elif k and plan.paired[k - 1]:
                total = self.plus(total, self.times(beside[k - 1], z[k - 1]))
            for i, factor in zip(plan.columns[k], lower[k], strict=True):
                total = self.minus(total, self.times(factor, x[i]))
            x[k] = total
        return x
