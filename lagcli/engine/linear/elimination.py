"""Static order of the elimination [[M, Bᵀ], [B, 0]] = LDLᵀ, determined from sampled values.

The order is that of least degree among the pivots that are large enough at every sampled state
(Markowitz with a threshold); if no diagonal entry is, two unknowns are eliminated together (Bunch
and Kaufman's pivots of order two: a coordinate without inertia and its constraint). A static order
is only suitable near the sampled states, so the engine monitors the residual of its solutions.

Systems are eliminated in rounds of pivots that are not adjacent (Liu's multiple elimination): a
chain in log N rounds, with somewhat more operations than from one end to the other, but without
dependence between neighbours, so that in long systems many are eliminated together
(`vectorize.py`).

References
----------
I. S. Duff and J. K. Reid, The multifrontal solution of indefinite sparse symmetric linear systems,
ACM TOMS 9 (1983), doi:10.1145/356044.356047.

J. W. H. Liu, Modification of the minimum-degree algorithm by multiple elimination, ACM TOMS 11
(1985), doi:10.1145/214392.214398.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Sequence
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.system import Pattern, System

Rows = list[dict[int, Array]]

#: Smallest pivot relative to the largest entry of its row, at every sampled state.
THRESHOLD = 0.3
#: Smallest pivot if none reaches the threshold; the engine's check of residuals decides.
_LEAST = 1e-6
#: Number of updates above which the matrix is treated as dense.
MOST_UPDATES = 60_000


class NoElimination(ArithmeticError):
    """There is no static order: the matrix is singular at a sampled state, or has large fill."""


class Elimination(NamedTuple):
    """The order of an elimination and the pattern of L.

    n unknowns: the accelerations, then −λ. Positions are numbers in the order of elimination.

    Parameters
    ----------
    order : tuple of n int
        The unknown at each position.
    paired : tuple of n bool
        Whether a pivot of order two begins at the position.
    columns : tuple of n tuples of int
        For each position, the later positions at which L is not zero; the same for both of a pair.
    smallest : float
        The smallest pivot at the sampled states, of the matrix scaled to entries of order one; near
        0 if the matrix is nearly singular. Ignored in comparisons of orders.
    """

    order: tuple[int, ...]
    paired: tuple[bool, ...]
    columns: tuple[tuple[int, ...], ...]
    smallest: float

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Elimination) and self[:3] == other[:3]

    def __hash__(self) -> int:
        return hash(self[:3])

    @property
    def updates(self) -> int:
        """Number of updates of the factorization."""
        return sum(len(c) * (len(c) + 1) // 2 for c in self.columns)

    @property
    def starts(self) -> list[int]:
        """Start of each column of L, and the end of the last one; n + 1."""
        return [0, *accumulate(len(c) for c in self.columns)]

    @property
    def left(self) -> tuple[list[int], list[int], list[int]]:
        """L by rows: the start of each row (n + 1), and the columns and indices of its entries."""
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
        """Return the destinations of the matrix' entries in D's diagonal, D's pairs and L.

        Parameters
        ----------
        places : iterable of (row, column)
            −1 is returned for the half of the matrix that is not stored.
        """
        n = len(self.order)
        place = {unknown: k for k, unknown in enumerate(self.order)}
        entries = ((i, k) for k, column in enumerate(self.columns) for i in column)
        number = {entry: e for e, entry in enumerate(entries)}
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


def order_at(
    system: System, states: Sequence[Sequence[float]], rows: Sequence[int] | None = None
) -> Elimination:
    """Find a static order of elimination for [[M, Bᵀ], [B, 0]].

    In addition to the given states, the order must suit M and B near the first one: an entry that
    vanishes only in a special configuration (a chain that hangs straight) does not count as zero.

    Parameters
    ----------
    system : System
    states : sequence of outputs of ``system.dynamics``
        States with values that are not finite are omitted.
    rows : sequence of int, optional
        The constraints to include; all by default.

    Raises
    ------
    NoElimination
    """
    finite = [x for x in states if math.isfinite(sum(x))]
    if not finite:
        raise NoElimination
    values = np.array(finite).T
    layout = system.dynamics_layout
    mass, jacobian = values[layout.mass_matrix], values[layout.jacobian]
    pattern, count = system.jacobian_pattern, len(system.constraints)
    if rows is not None and len(rows) < count:
        number = {row: k for k, row in enumerate(rows)}
        kept = [n for n, (i, _) in enumerate(pattern) if i in number]
        jacobian, count = jacobian[kept], len(rows)
        pattern = tuple((number[i], j) for i, j in (pattern[n] for n in kept))
    return find_order(
        len(system.coordinates),
        count,
        system.mass_pattern,
        pattern,
        np.column_stack([mass, _mass_beside(system, mass[:, 0])]),
        np.column_stack([jacobian, _jacobian_beside(pattern, count, jacobian[:, 0])]),
    )


def _mass_beside(system: System, mass: Array) -> Array:
    """Return entries of M near given ones: changed by a fraction of the entries in their rows."""
    m = np.array(system.mass_pattern, dtype=np.intp).reshape(-1, 2)
    inertia = np.zeros(len(system.coordinates))
    diagonal = m[:, 0] == m[:, 1]
    inertia[m[diagonal, 0]] = np.abs(mass[diagonal])
    # symmetric, and small enough that M remains positive in rows with few entries
    size = np.sqrt(inertia[m[:, 0]] * inertia[m[:, 1]])
    changed: Array = mass + 0.05 * size * np.cos(1.7 * (m[:, 0] + m[:, 1]) + m[:, 0] * m[:, 1])
    return changed


def _jacobian_beside(pattern: Pattern, count: int, jacobian: Array) -> Array:
    """Return entries of B near given ones, in the same way."""
    row = np.array([i for i, _ in pattern], dtype=np.intp)
    largest = np.zeros(count)
    np.maximum.at(largest, row, np.abs(jacobian))
    change: Array = 0.5 * largest[row] * np.cos(1.0 + 1.7 * np.arange(len(row)))
    return jacobian + change


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
    updates, smallest = 0, 1.0
    queue = [(len(row), i) for i, row in enumerate(rows)]
    heapq.heapify(queue)
    refused: set[int] = set()
    alive = [True] * size
    # a round: pivots that are not adjacent, so that their operations can be vectorized
    touched: set[int] = set()
    waiting: list[tuple[int, int]] = []
    most = math.inf
    while len(order) < size:
        pivots: tuple[int, ...] = ()
        while queue and queue[0][0] <= most:
            degree, i = heapq.heappop(queue)
            if not alive[i] or degree != len(rows[i]) or i in refused:
                continue
            if i in touched:
                waiting.append((degree, i))
            elif _large(rows[i], i) >= THRESHOLD:
                pivots = (i,)
                most = min(most, degree + 1)
                break
            else:
                refused.add(i)
        if not pivots and (waiting or most < math.inf):
            for entry in waiting:
                heapq.heappush(queue, entry)
            touched, waiting, most = set(), [], math.inf
            continue
        pivots = pivots or _fallback_pivot(rows, refused)
        neighbours = sorted({j for i in pivots for j in rows[i]} - set(pivots))
        updates += len(pivots) * len(neighbours) * (len(neighbours) + 1) // 2
        if updates > MOST_UPDATES:
            raise NoElimination
        smallest = min(smallest, _pivot_size(rows, pivots))
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
        touched.update(neighbours)
        refused.difference_update(pivots)
    place = {unknown: k for k, unknown in enumerate(order)}
    columns = tuple(tuple(sorted(place[j] for j in column)) for column in below)
    return Elimination(tuple(order), tuple(paired), columns, smallest)


def _scaled_rows(size: int, nq: int, mass: Pattern, jacobian: Pattern, m: Array, b: Array) -> Rows:
    """Return the matrix by rows, scaled so that the largest entry of each row is of order one."""
    places = [*mass, *((j, nq + i) for i, j in jacobian), *((nq + i, j) for i, j in jacobian)]
    values = np.concatenate([m, b, b])
    if not np.isfinite(values).all():
        raise NoElimination
    row, column = np.array(places, dtype=np.intp).reshape(-1, 2).T
    scale = np.ones(size)
    magnitude = np.abs(values).max(axis=1, initial=0.0)
    for _ in range(4):  # Ruiz: the square root of the remaining imbalance each time
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
    """Return the smallest ratio, over the states, of a diagonal entry to the largest other in its
    row."""
    if i not in row:
        return 0.0
    others = [np.abs(x) for j, x in row.items() if j != i]
    own = np.abs(row[i])
    if not others:
        return float(own.min() > 0.0)
    return float((own / np.maximum(np.maximum.reduce(others), 1e-300)).min())


def _fallback_pivot(rows: Rows, refused: set[int]) -> tuple[int, ...]:
    """Return the best pivot if no diagonal entry is large enough: a pair, or the largest entry."""
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
    """Return 1 over the largest entry of L for a pivot of order two."""
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


def _pivot_size(rows: Rows, pivots: tuple[int, ...]) -> float:
    """Return the smallest magnitude of a pivot; for a pair, a bound on its smallest eigenvalue."""
    i, j = pivots[0], pivots[-1]
    if i == j:
        return float(np.abs(rows[i][i]).min())
    zero = np.zeros_like(rows[i][j])
    a, b, c = rows[i].get(i, zero), rows[i][j], rows[j].get(j, zero)
    largest = np.maximum(np.maximum(np.abs(a), np.abs(c)), np.abs(b))
    return float((np.abs(a * c - b * b) / (2.0 * np.maximum(largest, 1e-300))).min())


def _eliminate(rows: Rows, pivots: tuple[int, ...], neighbours: list[int]) -> None:
    """Subtract the contribution of the pivots from the rows of their neighbours."""
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
