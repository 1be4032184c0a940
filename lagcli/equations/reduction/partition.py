"""Coordinate partitioning: independent and dependent coordinates, and the dependent velocities.

The rank of B at a consistent state is the number of dependent coordinates. A choice of independent
coordinates is admissible if the block of B for the dependent ones has a nonzero determinant
(textbook equations 8.80 to 8.84).

References
----------
R. A. Wehage, E. J. Haug, Generalized coordinate partitioning for dimension reduction in analysis of
constrained dynamic systems, Journal of Mechanical Design 104 (1982) 247–255,
doi:10.1115/1.3256318.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import symengine as se
from symengine import Basic

from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.derivation.motion import ONE, ZERO
from lagcli.equations.reduction.small_systems import (
    cancelled,
    determinant,
    operations,
    solutions,
)
from lagcli.errors import UsageError
from lagcli.model import model as symbols
from lagcli.model.model import Model
from lagcli.prose import counted


class CoordinateBlock(NamedTuple):
    """Rows and columns that are solved together; earlier blocks are known."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]


def triangular_blocks(incidence: Sequence[set[int]]) -> list[CoordinateBlock]:
    """Order a structurally nonsingular system so that each block depends only on earlier ones.

    Parameters
    ----------
    incidence : sequence of sets of int
        The columns with nonzero entries, by row; as many columns as rows.

    Returns
    -------
    list of CoordinateBlock
        Rows by position in ``incidence``. The strongly connected components of the directed graph
        of a perfect matching (Dulmage–Mendelsohn decomposition of a square system).

    Raises
    ------
    ValueError
        There is no perfect matching: the system is structurally singular.
    """
    row_of = _matching(incidence)
    column_of = {row: column for column, row in row_of.items()}
    needs = [{row_of[c] for c in columns} | {i} for i, columns in enumerate(incidence)]
    reach = [_reachable(i, needs) for i in range(len(needs))]
    blocks: list[CoordinateBlock] = []
    for i in sorted(range(len(needs)), key=lambda i: (len(reach[i]), i)):
        if any(i in block.rows for block in blocks):
            continue
        rows = tuple(sorted(j for j in reach[i] if i in reach[j]))
        blocks.append(CoordinateBlock(rows, tuple(sorted(column_of[j] for j in rows))))
    return blocks


def _inversions(order: Sequence[int]) -> int:
    """Return the number of pairs that are not in ascending order."""
    return sum(a > b for a, b in combinations(order, 2))


def _matching(incidence: Sequence[set[int]]) -> dict[int, int]:
    """Return a row for each column, by augmenting paths."""
    row_of: dict[int, int] = {}
    for start in range(len(incidence)):
        came_from: dict[int, tuple[int, int | None]] = {}  # column: (row, column before it)
        queue: list[tuple[int, int | None]] = [(start, None)]
        end: int | None = None
        while queue and end is None:
            row, before = queue.pop(0)
            for column in sorted(incidence[row]):
                if column in came_from:
                    continue
                came_from[column] = (row, before)
                if column not in row_of:
                    end = column
                    break
                queue.append((row_of[column], column))
        if end is None:
            raise ValueError("structurally singular")
        while end is not None:
            row, before = came_from[end]
            row_of[end] = row
            end = before
    return row_of


def _reachable(start: int, needs: Sequence[set[int]]) -> set[int]:
    reached, stack = {start}, [start]
    while stack:
        for j in needs[stack.pop()] - reached:
            reached.add(j)
            stack.append(j)
    return reached


Values = Mapping[Basic, float]
Matrix = list[list[float]]

#: Pivots below this part of the largest entry count as zero.
_ZERO_PIVOT = 1e-9
#: Smallest acceptable pivot, relative to the largest entry.
_GOOD_PIVOT = 0.05


def number(expression: Basic, values: Values) -> float:
    """Return the value of an expression; NaN if it is not real."""
    known = {s: se.RealDouble(values[s]) for s in expression.free_symbols}
    try:
        return float(expression.xreplace(known).n(53, real=True))
    except RuntimeError:  # not real, or no value
        return math.nan


@dataclass(frozen=True, eq=False)
class DependentRate:
    """A dependent velocity, (Σ_j n_j v_j + n_0)/d, and its acceleration.

    Parameters
    ----------
    coordinate : int
    numerators : mapping of int to expression
        n_j by coordinate, independent or earlier dependent ones.
    numerator : expression
        n_0.
    denominator : expression
        d.
    acceleration : expression
        The part of the acceleration without accelerations of other coordinates.
    """

    coordinate: int
    numerators: Mapping[int, Basic]
    numerator: Basic
    denominator: Basic
    acceleration: Basic

    @property
    def coefficients(self) -> dict[int, Basic]:
        """The derivatives with respect to other velocities."""
        return {j: x / self.denominator for j, x in self.numerators.items()}

    @property
    def drift(self) -> Basic:
        """The velocity if all others are zero."""
        return self.numerator / self.denominator

    def over(self, v: Sequence[Basic]) -> tuple[Basic, Basic]:
        """Return numerator and denominator."""
        terms = [x * v[j] for j, x in self.numerators.items()]
        return se.Add(self.numerator, *terms), self.denominator


@dataclass(frozen=True, eq=False)
class CoordinatePartition:
    """Independent and dependent coordinates of a system.

    Indices refer to the coordinates and constraints of the equations.

    Parameters
    ----------
    equations : Equations
    values : mapping of symbol to float
        q, v, t and the parameters at a consistent state.
    independent, dependent : tuples of int
        Independent and dependent coordinates.
    constraints : tuple of int
        Independent constraints, as many as dependent coordinates.
    surplus : tuple of int
        Constraints that depend on the others at that state.
    blocks : tuple of CoordinateBlock
        Blocks of constraints and dependent coordinates, in order of solution.
    """

    equations: Equations
    values: Values
    independent: tuple[int, ...]
    dependent: tuple[int, ...]
    constraints: tuple[int, ...]
    surplus: tuple[int, ...]
    blocks: tuple[CoordinateBlock, ...]

    @cached_property
    def determinants(self) -> tuple[Basic, ...]:
        """Determinants of the diagonal blocks; their product is that of the dependent block."""
        rows = [c.row for c in self.equations.constraints]
        found = [
            determinant([[rows[i].get(j, ZERO) for j in b.columns] for i in b.rows])
            for b in self.blocks
        ]
        orders = (
            [i for b in self.blocks for i in b.rows],
            [j for b in self.blocks for j in b.columns],
        )
        if sum(map(_inversions, orders)) % 2:
            found[0] = -found[0]
        return tuple(found)

    @cached_property
    def rates(self) -> tuple[DependentRate, ...]:
        """The dependent velocities, each in terms of independent and earlier ones."""
        rates: list[DependentRate] = []
        for block in self.blocks:
            rates += self._solved(block)
        return tuple(rates)

    def _solved(self, block: CoordinateBlock) -> list[DependentRate]:
        held = [self.equations.constraints[i] for i in block.rows]
        matrix = [[c.row.get(j, ZERO) for j in block.columns] for c in held]
        others = sorted({j for c in held for j in c.row} - set(block.columns))
        columns = [[-c.row.get(j, ZERO) for c in held] for j in others]
        columns += [[-c.drift for c in held], [c.rhs for c in held]]
        solved, below = solutions(matrix, columns, lambda x: number(x, self.values))
        resolved = []
        for place, i in enumerate(block.columns):
            parts, divisor = [x[place] for x in solved], below
            shorter, common = cancelled(parts, divisor)
            # the formulas may also grow when denominators are cleared
            if operations([*shorter[:-1], common]) < operations([*parts[:-1], divisor]):
                parts, divisor = shorter, common
            *moving, drift, acceleration = parts
            numerators = {j: x for j, x in zip(others, moving, strict=True) if x != 0}
            resolved.append(DependentRate(i, numerators, drift, divisor, acceleration / divisor))
        return resolved

    @cached_property
    def null_space(self) -> tuple[Mapping[int, Basic], ...]:
        """The matrix J of v = J v_independent + J_0, row by row: B J = 0.

        The columns are positions in ``independent``.
        """
        rows: list[dict[int, Basic]] = [{} for _ in self.equations.q]
        for k, i in enumerate(self.independent):
            rows[i] = {k: ONE}
        for rate in self.rates:
            rows[rate.coordinate] = _combined(rate.coefficients, rows)
        return tuple(rows)

    @cached_property
    def drift(self) -> tuple[Basic, ...]:
        """J_0: the velocities if the independent ones are zero."""
        return self._offsets("drift")

    @cached_property
    def acceleration_rhs(self) -> tuple[Basic, ...]:
        """The part of a = J a_independent + … without accelerations."""
        return self._offsets("acceleration")

    def _offsets(self, kind: str) -> tuple[Basic, ...]:
        offsets = [ZERO] * len(self.equations.q)
        for rate in self.rates:
            terms = [x * offsets[j] for j, x in rate.coefficients.items()]
            offsets[rate.coordinate] = se.Add(getattr(rate, kind), *terms)
        return tuple(offsets)


def _combined(
    coefficients: Mapping[int, Basic], rows: Sequence[Mapping[int, Basic]]
) -> dict[int, Basic]:
    terms: dict[int, list[Basic]] = {}
    for j, x in coefficients.items():
        for k, y in rows[j].items():
            terms.setdefault(k, []).append(x * y)
    return {k: se.Add(*parts) for k, parts in sorted(terms.items())}


def partition(
    equations: Equations, values: Values, independent: Sequence[str] | None = None
) -> CoordinatePartition:
    """Divide the coordinates into independent and dependent ones at a consistent state.

    Parameters
    ----------
    equations : Equations
    values : mapping of symbol to float
        q, v, t and the parameters.
    independent : sequence of str, optional
        Names of the independent coordinates. By default, those with fixed initial values, if the
        constraints determine the others.

    Returns
    -------
    CoordinatePartition

    Raises
    ------
    UsageError
        An unknown or repeated name, a wrong number of names, or coordinates that are not
        independent at that state.
    """
    names = equations.model.coordinate_names
    matrix = _jacobian(equations, values)
    preference = [_given(equations.model, name) for name in names]
    free = range(len(names))
    rows, columns = _eliminate(matrix, [[j for j in free if preference[j] <= x] for x in range(3)])
    if independent is not None:
        default = [names[j] for j in free if j not in columns]
        chosen = _chosen(equations.model, independent, default)
        rows, columns = _eliminate(matrix, [[j for j in free if j not in chosen]])
        if len(columns) < len(names) - len(chosen):
            raise _singular(equations, chosen, columns, default)
    rows, columns = sorted(rows), sorted(columns)
    place = {j: k for k, j in enumerate(columns)}
    constraints = equations.constraints
    blocks = triangular_blocks([{place[j] for j in constraints[i].row if j in place} for i in rows])
    return CoordinatePartition(
        equations=equations,
        values=values,
        independent=tuple(j for j in free if j not in place),
        dependent=tuple(columns),
        constraints=tuple(rows),
        surplus=tuple(i for i in range(len(constraints)) if i not in rows),
        blocks=tuple(
            CoordinateBlock(tuple(rows[i] for i in b.rows), tuple(columns[k] for k in b.columns))
            for b in blocks
        ),
    )


def _given(model: Model, name: str) -> int:
    """Return the number of fixed initial values of a coordinate: 0, 1 or 2."""
    return model.initial_positions[name].fixed + model.initial_velocities[name].fixed


def _jacobian(equations: Equations, values: Values) -> Matrix:
    """Return B at a state, each row divided by its largest entry."""
    matrix = []
    for c in equations.constraints:
        row = [0.0] * len(equations.q)
        for j, b in c.row.items():
            row[j] = number(b, values)
        largest = max(map(abs, row), default=0.0)
        matrix.append([x / largest for x in row] if largest else row)
    return matrix


def _eliminate(matrix: Matrix, groups: Sequence[Sequence[int]]) -> tuple[list[int], list[int]]:
    """Return pivot rows and columns of Gaussian elimination with complete pivoting.

    Pivots are taken from the first group of columns that has an acceptable one; the last group
    contains all permitted columns.
    """
    left = [list(row) for row in matrix]
    rows: list[int] = []
    columns: list[int] = []
    free = set(range(len(left)))
    while free:
        largest = max((abs(left[i][j]) for i in free for j in groups[-1]), default=0.0)
        if not largest > _ZERO_PIVOT:
            break
        i, j = next(
            pivot
            for pivot in (_pivot(left, free, group, columns, largest) for group in groups)
            if pivot is not None
        )
        rows.append(i)
        columns.append(j)
        free.remove(i)
        for other in free:
            factor = left[other][j] / left[i][j]
            if factor:
                left[other] = [x - factor * y for x, y in zip(left[other], left[i], strict=True)]
                left[other][j] = 0.0
    return rows, columns


def _pivot(
    left: Matrix, free: set[int], group: Sequence[int], done: Sequence[int], largest: float
) -> tuple[int, int] | None:
    """Return the position of a pivot whose row and column have few other entries (Markowitz)."""
    columns = [j for j in group if j not in done]
    good = [(i, j) for i in free for j in columns if abs(left[i][j]) > _GOOD_PIVOT * largest]
    if not good:
        return None
    among = [j for j in range(len(left[0])) if j not in done]
    in_row = {i: sum(abs(left[i][j]) > _ZERO_PIVOT for j in among) - 1 for i in free}
    in_column = {j: sum(abs(left[i][j]) > _ZERO_PIVOT for i in free) - 1 for j in columns}
    return min(good, key=lambda x: (in_row[x[0]] * in_column[x[1]], -abs(left[x[0]][x[1]]), x))


def _chosen(model: Model, independent: Sequence[str], default: list[str]) -> list[int]:
    """Return the indices of the named coordinates, or raise an error on the choice."""
    names = model.coordinate_names
    for name in independent:
        if name not in names:
            raise UsageError(
                f"--independent: there is no coordinate `{name}`; the coordinates are"
                f" {_listed(names)}"
            )
        if independent.count(name) > 1:
            raise UsageError(f"--independent names `{name}` twice; keep one of them")
    if len(independent) != len(default):
        count, given = len(default), len(independent)
        named = f"{counted(given, 'coordinate')}: {_listed(independent)}"
        raise UsageError(
            f"--independent names {named if given else 'no coordinates'}; the model has"
            f" {counted(count, 'degree')} of freedom at its start{_remedy(default)}"
        )
    return [names.index(name) for name in independent]


def _singular(
    equations: Equations, chosen: list[int], columns: list[int], default: list[str]
) -> UsageError:
    """Return the error that the constraints do not determine the dependent coordinates."""
    names = equations.model.coordinate_names
    dependent = [names[j] for j in range(len(names)) if j not in chosen]
    stuck = [name for name in dependent if names.index(name) not in columns]
    return UsageError(
        f"--independent {','.join(names[j] for j in chosen)}: at the start the constraints do not"
        f" determine {_listed(stuck)}: the determinant of ∂ψ/∂q̇ for the dependent coordinates"
        f" {_listed(dependent)} is zero there{_remedy(default)}"
    )


def _remedy(default: list[str]) -> str:
    if not default:
        return "; leave the option out, because all coordinates depend on time"
    return f"; use for instance --independent {','.join(default)}"


def _listed(names: Sequence[str]) -> str:
    shown = [f"`{name}`" for name in names[:12]]
    return ", ".join(shown) + (", …" if len(names) > 12 else "")


def values_at(
    model: Model, t: float, q: Sequence[float], v: Sequence[float], p: Sequence[float]
) -> dict[Basic, float]:
    """Return the values of all symbols of a model at a state."""
    names = model.coordinate_names
    values = {symbols.TIME: t}
    values |= {symbols.coordinate(name): float(x) for name, x in zip(names, q, strict=True)}
    values |= {symbols.velocity(name): float(x) for name, x in zip(names, v, strict=True)}
    values |= {se.Symbol(name): float(x) for name, x in zip(model.parameters, p, strict=True)}
    return values
