"""Static order of the elimination [[M, Bᵀ], [B, 0]] = LDLᵀ, determined from sampled values.

The order is that of least degree among the pivots that are large enough at every sampled state
(Markowitz with a threshold); if no diagonal entry is, two unknowns are eliminated together (Bunch
and Kaufman's pivots of order two: a coordinate without inertia and its constraint). A static order
is only suitable near the sampled states, so the engine monitors the residual of its solutions.

Systems are eliminated in rounds of pivots that are not adjacent (Liu's multiple elimination): a
chain in log N rounds, with somewhat more operations than from one end to the other, but without
dependence between neighbours, so that in long systems many are eliminated together
(`core/program/pack.c`).

`unroll` writes the elimination out as operations of the dynamics tape: one stream of operations
then computes a and λ, structural zeros cost nothing, and values that depend only on parameters (the
inverse of a mass) are computed once for a run.

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
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from functools import lru_cache, reduce
from itertools import accumulate, zip_longest
from typing import NamedTuple

import numpy as np

from lagcli.arrays import Array, Indices
from lagcli.engine.sparse_rows import rows_and_columns
from lagcli.engine.system import Pattern, System
from lagcli.engine.tape.operations import Op
from lagcli.engine.tape.tape import Arithmetic, Tape

Rows = list[dict[int, Array]]

#: Smallest pivot relative to the largest entry of its row, at every sampled state, in a matrix with
#: rows that are equally large ...
THRESHOLD = 0.3
#: ... and in one that is scaled by inertias: pivots of M pass, and the following ones of
#: constraints are definite.
_INERTIAL_THRESHOLD = 0.05
#: Inertia of the coordinates scaled by inertias, beside the entries 1 of B.
_INERTIA = 0.3
#: Part of the largest inertia below which a coordinate has none: squares of rounding errors.
_LEAST_INERTIA = 1e-24
_BALANCING = 6  # iterations
#: Number of unknowns up to which both scales are tried ...
_FEW = 60
#: ... and part of the updates with equally large rows, whose pivots are better away from the
#: sampled states, below which the order by inertias is taken.
_FEWER = 0.8
#: Smallest pivot if none reaches the threshold; the engine's check of residuals decides.
_LEAST = 1e-6
#: Number of updates, in total and per unknown, above which an elimination is not unrolled ...
MOST_UNROLLED, MOST_FOR_EACH = 30_000, 100
#: ... and number of unknowns from which a remaining matrix without zeros is treated as an array.
_FULL = 16
#: Most rows of a column with stored zeros, in parts of its own.
_AMALGAMATED = 1.1
#: Number of pivots whose product is in the range of numbers.
_FACTORS = 8


class NoElimination(ArithmeticError):
    """There is no static order: the matrix is singular at a sampled state."""


class Elimination(NamedTuple):
    """The order of an elimination and the pattern of L.

    n unknowns: the accelerations, then −λ. Positions are numbers in the order of elimination. Rows
    of B that follow from the others have no position.

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

    def in_postorder(self) -> Elimination:
        """Return the same elimination with each pivot directly before what it is updated into."""
        n = len(self.order)
        first = [k - 1 if k and self.paired[k - 1] else k for k in range(n)]  # of the pivot
        into: list[list[int]] = [[] for _ in range(n)]
        stack: list[tuple[int, bool]] = []
        for k in range(n):
            if first[k] == k and self.columns[k]:
                into[first[self.columns[k][0]]].append(k)
            elif first[k] == k:
                stack.append((k, False))
        order: list[int] = []
        while stack:
            k, done = stack.pop()
            if done:
                order += range(k, k + 1 + self.paired[k])
                continue
            stack.append((k, True))
            # the longest column is eliminated last
            stack += [(i, False) for i in sorted(into[k], key=lambda i: -len(self.columns[i]))]
        place = {k: p for p, k in enumerate(order)}
        return Elimination(
            tuple(self.order[k] for k in order),
            tuple(self.paired[k] for k in order),
            tuple(tuple(sorted(place[i] for i in self.columns[k])) for k in order),
            self.smallest,
        )

    def amalgamated(self) -> Elimination:
        """Return the same elimination with some zeros stored, so that more columns have the same
        rows; these are updated together (`lag_supernodes`).

        Ashcraft and Grimes' relaxed supernodes, doi:10.1145/76909.76910.
        """
        columns = list(self.columns)
        starts = [k for k in range(len(columns)) if not (k and self.paired[k - 1])]
        bounds = [*starts, len(columns)]
        for k, after, end in reversed([*zip(bounds, bounds[1:], bounds[2:], strict=False)]):
            own, rows = columns[k], (*range(after, end), *columns[after])
            if own and own[0] < end and len(rows) <= _AMALGAMATED * len(own) + 2:
                columns[k:after] = [rows] * (after - k)
        return self._replace(columns=tuple(columns))

    def left_out(self, system: System) -> list[int]:
        """Return the rows of B without a position, ascending."""
        nq, nc = len(system.coordinates), len(system.constraints)
        return [u - nq for u in sorted({*range(nq, nq + nc)}.difference(self.order))]

    @property
    def starts(self) -> list[int]:
        """Start of each column of L, and the end of the last one; n + 1."""
        return [0, *accumulate(len(c) for c in self.columns)]

    def targets(self, places: Iterable[tuple[int, int]]) -> list[int]:
        """Return the destinations of the matrix' entries in D's diagonal, D's pairs and L.

        Parameters
        ----------
        places : iterable of (row, column)
            −1 is returned for the half of the matrix that is not stored, and for rows without a
            position.
        """
        n = len(self.order)
        place = {unknown: k for k, unknown in enumerate(self.order)}
        entries = ((i, k) for k, column in enumerate(self.columns) for i in column)
        number = {entry: e for e, entry in enumerate(entries)}
        targets = []
        for row, column in places:
            i, k = place.get(row, -1), place.get(column, -1)
            if i < 0 or k < 0:
                targets.append(-1)
            elif i == k:
                targets.append(i)
            elif i < k:
                targets.append(-1)
            else:
                targets.append(n + k if self.paired[k] and i == k + 1 else 2 * n + number[i, k])
        return targets


def order_at(
    system: System, states: Sequence[Sequence[float]], rows: Sequence[int] | None = None
) -> Elimination:
    """Find a static order of elimination for [[M, Bᵀ], [B, 0]].

    Pivots are judged in a matrix scaled by inertias and, in small systems, in one whose rows are
    equally large; the second order is kept unless the first one has clearly fewer updates or, with
    constraints, as many: their pivots after M are definite in all configurations in which M is.

    In addition to the given states, the order must suit M and B near the first one: an entry that
    vanishes only in a special configuration (a chain that hangs straight) does not count as zero.

    Parameters
    ----------
    system : System
    states : sequence of outputs of ``system.dynamics``
        States with values that are not finite are omitted.
    rows : sequence of int, optional
        The constraints to include, ascending; all by default. The order numbers those alone.

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
    m, b = rows_and_columns(system.mass_pattern), rows_and_columns(pattern)
    if not count and (m[0] == m[1]).all():
        return _of_diagonal(len(system.coordinates), np.abs(mass))
    inertia = np.zeros(len(system.coordinates))
    inertia[m[0][m[0] == m[1]]] = np.abs(mass[m[0] == m[1]]).max(axis=1)
    matrix = _Matrix(m, b, inertia, count, mass, jacobian)
    elimination = matrix.order(
        matrix.scaled_by_inertias(system.inertia(inertia)), _INERTIAL_THRESHOLD
    )
    if elimination is None or len(elimination.order) <= _FEW:
        other = matrix.order(matrix.balanced(), THRESHOLD)
        if elimination is None or (
            other is not None
            and elimination.updates > _FEWER * other.updates
            and not (count and elimination.updates == other.updates)
        ):
            elimination = other
    if elimination is None:
        raise NoElimination
    if elimination.updates > min(MOST_UNROLLED, MOST_FOR_EACH * len(elimination.order)):
        return elimination.in_postorder().amalgamated()
    return elimination


def _of_diagonal(size: int, mass: Array) -> Elimination:
    """Return the only order there is for a diagonal M without constraints, of |M_jj|."""
    least = mass.min(axis=1, initial=math.inf)
    if len(mass) < size or not (least > 0.0).all():
        raise NoElimination
    smallest = float((least / mass.max(axis=1)).min(initial=1.0))
    return Elimination(tuple(range(size)), (False,) * size, ((),) * size, smallest)


class _Matrix(NamedTuple):
    """[[M, Bᵀ], [B, 0]] at sampled states.

    Parameters
    ----------
    m, b : (rows, columns)
        Places of the entries of M and B.
    inertia : (nq,) array
        Largest M_jj.
    nc : int
    mass, jacobian : (entries, states) arrays
    """

    m: tuple[Indices, Indices]
    b: tuple[Indices, Indices]
    inertia: Array
    nc: int
    mass: Array
    jacobian: Array

    def order(self, scaled: tuple[Array, Array], threshold: float) -> Elimination | None:
        """Return the order for scaled entries of M and B; None if there is none."""
        m, b = (tuple(zip(x.tolist(), y.tolist(), strict=True)) for x, y in (self.m, self.b))
        with suppress(NoElimination):
            return find_order(len(self.inertia), self.nc, m, b, *scaled, threshold)
        return None

    def scaled_by_inertias(self, inertia: Array) -> tuple[Array, Array]:
        """Return entries at the states and beside the first one, in a scale independent of units.

        M_jj is `_INERTIA`, and the largest entry of each row of B 1. A coordinate without inertia
        is scaled as if it had the largest, in units in which the columns of B are equally large.

        Parameters
        ----------
        inertia : (nq,) array
            Inertia by which the coordinates are compared.
        """
        (row, column), (of_m, other), nq = self.b, self.m, len(inertia)
        mass, entries = (np.abs(x).max(axis=1, initial=0.0) for x in (self.mass, self.jacobian))
        sizes, weights = np.ones(nq), np.ones(self.nc)
        for _ in range(_BALANCING):
            scaled = entries * weights[row] * sizes[column]
            weights /= np.sqrt(_largest(self.nc, row, scaled))
            sizes /= np.sqrt(_largest(nq, column, scaled))
        inertia = inertia * sizes * sizes
        most = inertia.max(initial=0.0) or 1.0
        sizes *= np.sqrt(_INERTIA / np.where(inertia > _LEAST_INERTIA * most, inertia, most))
        # M_ij where M_ii is zero
        sizes /= np.sqrt(_largest(nq, of_m, mass * sizes[of_m] * sizes[other], 1.0))
        weights = 1.0 / _largest(self.nc, row, entries * sizes[column])
        by_mass, by_rows = sizes[of_m] * sizes[other], weights[row] * sizes[column]
        return self._with_beside(self.mass * by_mass[:, None], self.jacobian * by_rows[:, None])

    def balanced(self) -> tuple[Array, Array]:
        """Return entries at the states and beside the first one, in rows equally large."""
        mass, jacobian = self._with_beside(self.mass, self.jacobian)
        nq = len(self.inertia)
        (of_m, other), (row, column) = self.m, (nq + self.b[0], self.b[1])
        by_mass, by_rows = (np.abs(x).max(axis=1, initial=0.0) for x in (mass, jacobian))
        scale = np.ones(nq + self.nc)
        places = np.concatenate([of_m, column, row])
        for _ in range(4):  # Ruiz: the square root of the remaining imbalance each time
            b = by_rows * scale[row] * scale[column]
            all_entries = np.concatenate([by_mass * scale[of_m] * scale[other], b, b])
            scale /= np.sqrt(_largest(len(scale), places, all_entries))
        return (
            mass * (scale[of_m] * scale[other])[:, None],
            jacobian * (scale[row] * scale[column])[:, None],
        )

    def _with_beside(self, mass: Array, jacobian: Array) -> tuple[Array, Array]:
        """Append entries near those at the first state."""
        (i, j), row, m, b = self.m, self.b[0], mass[:, 0], jacobian[:, 0]
        inertia = np.zeros(len(self.inertia))
        inertia[i[i == j]] = np.abs(m[i == j])
        # symmetric, and small enough that M remains positive in rows with few entries
        change = 0.05 * np.sqrt(inertia[i] * inertia[j]) * np.cos(1.7 * (i + j) + i * j)
        largest = np.zeros(self.nc)
        np.maximum.at(largest, row, np.abs(b))
        turned = 0.5 * largest[row] * np.cos(1.0 + 1.7 * np.arange(len(row)))
        return np.column_stack([mass, m + change]), np.column_stack([jacobian, b + turned])


def _largest(count: int, rows: Indices, values: Array, least: float = 0.0) -> Array:
    """Return the largest value of each row, or `least` if that is larger; 1 for a row of zeros."""
    largest = np.full(count, least)
    np.maximum.at(largest, rows, values)
    return np.where(largest > 0.0, largest, 1.0)


def find_order(
    nq: int,
    nc: int,
    mass: Pattern,
    jacobian: Pattern,
    mass_values: Array,
    jacobian_values: Array,
    threshold: float = THRESHOLD,
) -> Elimination:
    """Find a static order of elimination.

    Parameters
    ----------
    nq, nc : int
        Numbers of coordinates and constraints.
    mass, jacobian : patterns of M and B
    mass_values, jacobian_values : (entries, states) arrays
        M and B at the sampled states, scaled to entries of order one.
    threshold : float
        Smallest pivot relative to the largest entry of its row.

    Raises
    ------
    NoElimination
    """
    size = nq + nc
    rows = _rows(size, nq, mass, jacobian, mass_values, jacobian_values)
    order: list[int] = []
    paired: list[bool] = []
    below: list[tuple[int, ...]] = []
    smallest, entries = 1.0, sum(map(len, rows))
    queue = [(len(row), i) for i, row in enumerate(rows)]
    heapq.heapify(queue)
    refused: set[int] = set()
    alive = [True] * size
    # a round: pivots that are not adjacent, so that their operations can be vectorized
    touched: set[int] = set()
    waiting: list[tuple[int, int]] = []
    most = math.inf
    while len(order) < size:
        left = size - len(order)
        if left >= _FULL and entries == left * left and not touched:
            rest = _Full(rows, [i for i in range(size) if alive[i]])
            for pivot, after in rest.pivots(threshold):
                order += pivot
                paired += [len(pivot) == 2, False][-len(pivot) :]
                below += [after] * len(pivot)
            smallest = min(smallest, rest.smallest)
            break
        pivots: tuple[int, ...] = ()
        while queue and queue[0][0] <= most:
            degree, i = heapq.heappop(queue)
            if not alive[i] or degree != len(rows[i]) or i in refused:
                continue
            if i in touched:
                waiting.append((degree, i))
            elif _large(rows[i], i) >= threshold:
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
        pivots = pivots or _fallback_pivot(rows, refused, threshold)
        neighbours = sorted({j for i in pivots for j in rows[i]} - set(pivots))
        smallest = min(smallest, _pivot_size(rows, pivots))
        entries -= sum(len(rows[i]) for i in (*pivots, *neighbours))
        _eliminate(rows, pivots, neighbours)
        entries += sum(len(rows[i]) for i in neighbours)
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


def _rows(size: int, nq: int, mass: Pattern, jacobian: Pattern, m: Array, b: Array) -> Rows:
    """Return the matrix by rows."""
    if not (np.isfinite(m).all() and np.isfinite(b).all()):
        raise NoElimination
    rows: Rows = [{} for _ in range(size)]
    for (i, j), x in zip(mass, m, strict=True):
        rows[i][j] = x
    for (i, j), x in zip(jacobian, b, strict=True):
        rows[nq + i][j] = rows[j][nq + i] = x
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


def _fallback_pivot(rows: Rows, refused: set[int], threshold: float) -> tuple[int, ...]:
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
            key = (-min(size, threshold), len(row), pivots)
            best = min(best, key)
        if best[0] <= -threshold:
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


class _Full:
    """The elimination of what remains, a matrix without zeros.

    It chooses the pivots that `find_order` would choose among rows of equal length.

    Parameters
    ----------
    rows : Rows
    unknowns : list of int
        Those that remain.
    """

    def __init__(self, rows: Rows, unknowns: list[int]):
        self.unknowns, self.smallest = unknowns, 1.0
        self.matrix = np.array([[rows[i][j] for j in unknowns] for i in unknowns])

    def pivots(self, threshold: float) -> Iterator[tuple[tuple[int, ...], tuple[int, ...]]]:
        """Yield each pivot, and the unknowns after it."""
        while self.unknowns:
            chosen = self._choose(threshold)
            a, rest = self.matrix, [i for i in range(len(self.unknowns)) if i not in chosen]
            pivot = a[np.ix_(chosen, chosen)].transpose(2, 0, 1)
            eigenvalue = pivot[:, 0, 0]
            if len(chosen) == 2:
                largest = np.abs(pivot).max(axis=(1, 2))
                eigenvalue = np.linalg.det(pivot) / (2.0 * np.maximum(largest, 1e-300))
            self.smallest = min(self.smallest, float(np.abs(eigenvalue).min()))
            column = a[np.ix_(rest, chosen)].transpose(2, 0, 1)
            change = column @ np.linalg.solve(pivot, column.transpose(0, 2, 1))
            pivots = tuple(self.unknowns[i] for i in chosen)
            self.unknowns = [self.unknowns[i] for i in rest]
            self.matrix = a[np.ix_(rest, rest)] - change.transpose(1, 2, 0)
            yield pivots, tuple(self.unknowns)

    def _choose(self, threshold: float) -> tuple[int, ...]:
        """Return the place of the first pivot that is large enough, or of the best one."""
        sizes, n = np.abs(self.matrix), len(self.unknowns)
        own = np.einsum("iis->is", sizes).copy()
        if n == 1:
            if not own.min() > 0.0:
                raise NoElimination
            return (0,)
        np.einsum("iis->is", sizes)[:] = 0.0
        others = sizes.max(axis=1)
        single = (own / np.maximum(others, 1e-300)).min(axis=1)
        enough = np.flatnonzero(single >= threshold)
        if len(enough):
            return (int(enough[0]),)
        best: tuple[float, tuple[int, ...]] = (_LEAST, ())
        for i in range(n):
            pair = self._pairs(i, sizes)
            j = int(n - 1 - pair[::-1].argmax())
            for size, chosen in ((float(single[i]), (i,)), (float(pair[j]), (i, j))):
                if min(size, threshold) > best[0]:
                    best = (min(size, threshold), chosen)
            if best[0] >= threshold:
                break
        if not best[1]:
            raise NoElimination
        return best[1]

    def _pairs(self, i: int, sizes: Array) -> Array:
        """Return `_pair_size` of an unknown with each of the others; 0 with itself."""
        a = self.matrix
        own, beside, other = a[i, i], a[i], np.einsum("iis->is", a)
        determinant = np.abs(own * other - beside * beside)
        if len(a) == 2:
            ratio = (determinant.min(axis=1) > 0.0).astype(float)
        else:
            two = np.sort(sizes[i], axis=0)[-2:]
            at = np.where(sizes[i] == two[1], two[0], two[1])  # without the entry of the pair
            elsewhere = sizes.copy()
            elsewhere[:, i] = 0.0
            below = elsewhere.max(axis=1)
            b = np.abs(beside)
            grown = np.maximum(np.abs(other) * at + b * below, b * at + np.abs(own) * below)
            ratio = (determinant / np.maximum(grown, 1e-300)).min(axis=1)
        ratio[i] = 0.0
        return np.asarray(ratio)


@lru_cache(maxsize=1)  # for the program of the dynamics, and that of the series
def unroll(system: System, elimination: Elimination) -> Tape:
    """Append the solution of [[M, Bᵀ], [B, 0]] [a; −λ] = [f; γ] to the dynamics tape.

    Parameters
    ----------
    system : System
    elimination : Elimination

    Returns
    -------
    Tape
        Outputs follow `UnrolledLayout`. There are nq + 2 nc additional inputs at the end: another
        right side, in the order of the unknowns, and one for the constraints only. The determinant
        and the two additional solutions are deferred, and the additional solutions are an output
        subset. With derivatives, the solution
        is that of all blocks, or that of the motion with zeros for the rest (see
        `TangentBlocks.complete`), and the others are those of one block.
    """
    return _Solved(system, elimination).tape()


class Unrolling(Arithmetic):
    """Emits the operations of a factorization and of its solutions.

    Parameters
    ----------
    system : System
    elimination : Elimination
    rhs_inputs : int
        Number of additional inputs.
    """

    def __init__(self, system: System, elimination: Elimination, rhs_inputs: int):
        size, given, motion = len(elimination.order), system.dynamics, system.motion
        mass, jacobian, nq = motion.mass_pattern, motion.jacobian_pattern, len(motion.coordinates)
        nc = len(motion.constraints)
        super().__init__(given.inputs + rhs_inputs, given.parameters, rhs_inputs, given.functions)
        self.outputs = outputs = self.extend(given)
        self.nq, self.nc, self.plan = nq, nc, elimination
        self.blocks = 1 if system.tangent is None else system.tangent.blocks
        place = {unknown: k for k, unknown in enumerate(elimination.order)}
        self.place = place
        layout = system.dynamics_layout
        self.entries: dict[tuple[int, int], int] = {}
        for (i, j), x in zip(mass, outputs[layout.mass_matrix], strict=self.blocks == 1):
            if place[i] >= place[j]:
                self.entries[place[i], place[j]] = x
        for (i, j), x in zip(jacobian, outputs[layout.jacobian], strict=self.blocks == 1):
            if nq + i in place:
                p, q = place[nq + i], place[j]
                self.entries[max(p, q), min(p, q)] = x
        right = [*outputs[layout.forcing][:nq], *outputs[layout.rhs][:nc]]
        self.right = [right[unknown] for unknown in elimination.order]
        self.diagonal, self.beside = [self.zero] * size, [self.zero] * size
        self.lower: list[dict[int, int]] = [{} for _ in range(size)]
        self.inverses: list[int] = []  # of the pivots, or of their determinants
        self.isomorphic: list[list[int]] = []

    def factor(self) -> None:
        """Emit the factorization."""
        for k in self.pivots():
            self.eliminate(k, 2 if self.plan.paired[k] else 1)

    def diagonal_entry(self, k: int) -> int:
        """Return the diagonal entry of the matrix in its current state of reduction."""
        return self.entries.get((k, k), self.zero)

    def pivots(self) -> Iterable[int]:
        """Yield the positions at which pivots begin."""
        return (k for k in range(len(self.place)) if not (k and self.plan.paired[k - 1]))

    def determinant(self) -> int:
        """Return the logarithm of the magnitude of the matrix's determinant, but for a constant: by
        products of pivots, few enough to be in the range of numbers."""
        total, factors = self.zero, [x for x in self.inverses if x not in self.invariant]
        for first in range(0, len(factors), _FACTORS):
            product = reduce(self.times, factors[first : first + _FACTORS])
            total = self.minus(total, self.emit(Op.LOG, self.magnitude(product)))
        return total

    def pivot(self, k: int, width: int) -> list[list[int]]:
        """Return the inverse of a pivot."""
        a = self.diagonal_entry(k)
        if width == 1:
            x = self.inverse(a)
            self.inverses.append(x)
            return [[x]]
        b, c = self.entries[k + 1, k], self.diagonal_entry(k + 1)
        if b == self.one and c == self.zero:
            return [[self.zero, self.one], [self.one, self.negative(a)]]
        if a == self.zero and c == self.zero:
            x = self.inverse(b)
            self.inverses += [x, x]
            return [[self.zero, x], [x, self.zero]]
        determinant = self.minus(self.times(a, c), self.times(b, b))
        x = self.inverse(determinant)
        self.inverses.append(x)
        off = self.negative(self.times(b, x))
        return [[self.times(c, x), off], [off, self.times(a, x)]]

    def eliminate(self, k: int, width: int) -> None:
        """Emit a pivot's part of L and its updates."""
        inverse = self.pivot(k, width)
        self.diagonal[k : k + width] = [inverse[i][i] for i in range(width)]
        if width == 2:
            self.beside[k] = inverse[0][1]
        below = self.in_order(self.plan.columns[k])
        rows: dict[int, list[int]] = {}
        for i in below:
            rows[i] = entries = [self.entries.pop((i, k + p), self.zero) for p in range(width)]
            for p in range(width):
                total = self.times(entries[0], inverse[0][p])
                if width == 2:
                    total = self.plus(total, self.times(entries[1], inverse[1][p]))
                self.lower[k + p][i] = total
        for n, i in enumerate(below):
            for j in below[: n + 1]:
                entry = max(i, j), min(i, j)
                value = self.entries.get(entry, self.zero)
                for p in range(width):
                    value = self.minus(value, self.times(self.lower[k + p][i], rows[j][p]))
                if value != self.zero:
                    self.entries[entry] = value

    def in_order(self, places: Iterable[int]) -> list[int]:
        """Return positions in the order of their unknowns: a chain's bodies then have equal
        operations."""
        return sorted(places, key=self.plan.order.__getitem__)

    def solution(self, right: Sequence[int]) -> list[int]:
        """Emit the substitutions for a right side by place; return a, λ."""
        paired, order, z = self.plan.paired, self.plan.order, list(right)
        for k in self.pivots():
            for p in range(2 if paired[k] else 1):
                for i in self.in_order(self.lower[k + p]):
                    z[i] = self.minus(z[i], self.times(self.lower[k + p][i], z[k + p]))
        x = [self.zero] * len(z)
        multipliers: dict[int, int] = {}  # by position
        for k in reversed(range(len(z))):
            total = self.times(self.diagonal[k], z[k])
            if paired[k]:
                total = self.plus(total, self.times(self.beside[k], z[k + 1]))
            elif k and paired[k - 1]:
                total = self.plus(total, self.times(self.beside[k - 1], z[k - 1]))
            for i in self.in_order(self.lower[k]):
                if order[k] < self.nq and i in multipliers:
                    total = self.plus(total, self.times(self.lower[k][i], multipliers[i]))
                else:
                    total = self.minus(total, self.times(self.lower[k][i], x[i]))
            x[k] = total
            if order[k] >= self.nq:
                multipliers[k] = self.negative(total)
                # the sign is applied here: all entries are then used in the same way
                self.opposite.pop(multipliers[k], None)
        a = [x[self.place[unknown]] for unknown in range(self.nq)]
        unknowns = [
            multipliers[self.place[unknown]] if unknown in self.place else self.zero
            for unknown in range(self.nq, self.nq + self.nc)
        ]
        self.isomorphic.append([y for y in unknowns if y != self.zero])
        return [*a, *unknowns]

    def rates(
        self, system: System, count: int, entries: Iterable[tuple[tuple[int, int], int]]
    ) -> list[int]:
        """Emit B v, of entries by row and column."""
        v = system.sample_layout.v.start
        rates = [self.zero] * count
        for (i, j), x in entries:
            rates[i] = self.plus(rates[i], self.times(x, v + j))
        return rates

    def power(self, others: int, multipliers: Sequence[int], rates: Sequence[int]) -> int:
        """Emit the power of all forces: of others, and of constraints with rates B v."""
        terms = [self.times(x, y) for x, y in zip(multipliers, rates, strict=True)]
        while len(terms) > 1:  # pairwise, which can be vectorized
            pairs = zip_longest(terms[::2], terms[1::2], fillvalue=self.zero)
            terms = [self.plus(a, b) for a, b in pairs]
        return self.plus(others, *(terms or [self.zero]))


class _Solved(Unrolling):
    """Emits the dynamics with an elimination, for `unroll`."""

    def __init__(self, system: System, elimination: Elimination):
        nq, nc = len(system.motion.coordinates), len(system.motion.constraints)
        super().__init__(system, elimination, nq + 2 * nc)
        self.tangent = system.tangent
        given, jacobian = system.dynamics.inputs, system.motion.jacobian_pattern
        entries = self.outputs[system.dynamics_layout.jacobian]
        self.speeds = self.rates(system, nc, zip(jacobian, entries, strict=self.blocks == 1))
        self.other_right = [given + unknown for unknown in elimination.order]
        # for a right side that is zero except for the constraints
        self.other_rhs = [
            given + nc + unknown if unknown >= nq else self.zero for unknown in elimination.order
        ]

    def tape(self) -> Tape:
        self.factor()
        solution = self.solution(self.right)
        a, multipliers = solution[: self.nq], solution[self.nq :]
        further = self.derivatives(solution)
        whole = [
            *a,
            *(x for column in further for x in column[: self.nq]),
            *multipliers,
            *(x for column in further for x in column[self.nq :]),
        ]
        power = self.power(self.outputs[-1], multipliers, self.speeds)
        main = [*self.outputs, *whole, power]
        rhs_inputs, moved = (
            self.solution(self.other_right),
            self.solution(self.other_rhs)[: self.nq],
        )
        outputs = [*main, self.determinant(), *rhs_inputs, *moved]
        return self.finish(
            outputs,
            deferred=(1, len(rhs_inputs), len(moved)),
            output_subsets=(tuple(range(len(main) + 1, len(outputs))),),
            isomorphic=self.isomorphic,
        )

    def derivatives(self, solution: Sequence[int]) -> list[list[int]]:
        """Emit the solutions of the derivatives; zeros if the engine computes them."""
        size = self.nq + self.nc
        if self.tangent is None or not self.tangent.complete:
            return [[self.zero] * size] * (self.blocks - 1)
        first = 1 + 2 * self.nq * self.blocks
        held = range(first, first + self.parameters)
        sides = self.splice(self.tangent.tape, [*range(first), *solution, *held])
        return [
            self.solution([sides[k * size + unknown] for unknown in self.plan.order])
            for k in range(self.blocks - 1)
        ]
