"""The integrable part of a Pfaffian system, at a point: which combinations of rows are integrable.

The rows θ_β = Σ b_βi dq_i + b_β0 dt span a system I. Its derived systems I ⊃ I¹ ⊃ …, each of the
forms of the one before whose differentials vanish modulo that, end with the largest integrable
part. A form κ of I at a point is in it if and only if it vanishes on all fields that the brackets
of the admissible fields X_a reach. Along a path in an admissible direction u(s), with flow φ_s,

    (d/ds)^j κ·(φ_s^* X_a) = 0  for all a, j  and directions u:

these derivatives are brackets of j + 1 fields, and those up to order j annihilate I^j. They are the
coefficients of power series, which are computed with 60 digits, so that each rank is certain.

References
----------
Bryant et al., *Exterior Differential Systems*, 1991, II.4.
"""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from symengine import Basic

from lagcli.analysis.check.power_series import (
    BITS,
    ONE,
    NoSeries,
    Series,
    SeriesEvaluator,
    constant,
    fixed,
    times,
)

#: Values that count as zero, about 1e-33: rounding is about 1e-57.
_ZERO = 1 << (BITS - 110)
_NEWTON = 10  # iterations, of which each doubles the digits
_PATHS = 2  # without a new condition, after which no further path is tried

Form = Mapping[int, Basic]  # nonzero coefficients by variable
Vector = list[int]
Matrix = npt.NDArray[Any]  # of integers


class PathStart(NamedTuple):
    """A point at which a system is examined.

    Parameters
    ----------
    values : list of int
        The variables' values, q and t, as multiples of 2^−BITS.
    parameters : dict of Basic to int
    """

    values: Vector
    parameters: dict[Basic, int]


class PfaffianSystem(NamedTuple):
    """Rows of constraints as forms.

    Parameters
    ----------
    variables : tuple of symbols
        q and t.
    forms : tuple of Form
    slopes : tuple of mappings of (int, int) to expression
        ∂b_i/∂x_j of each form, without zeros.
    positions : tuple of expressions or None
        φ of the forms that are differentials of position constraints.
    """

    variables: tuple[Basic, ...]
    forms: tuple[Form, ...]
    slopes: tuple[Mapping[tuple[int, int], Basic], ...]
    positions: tuple[Basic | None, ...]


class IntegrablePart(NamedTuple):
    """The integrable part at a point.

    Parameters
    ----------
    rows : tuple of int
        Independent rows, in their order.
    combinations : list of Vector
        A basis of the coefficients c_β, by these rows, of the forms Σ c_β θ_β.
    """

    rows: tuple[int, ...]
    combinations: list[Vector]


def point_at(
    system: PfaffianSystem, values: Sequence[float], parameters: Mapping[Basic, float]
) -> PathStart:
    """Return a point on the position constraints, next to one that satisfies them in doubles.

    Raises
    ------
    NoSeries
        A value is not defined there, or the iteration does not converge.
    """
    place = PathStart(
        [fixed(x) for x in values], {name: fixed(x) for name, x in parameters.items()}
    )
    held = [i for i, position in enumerate(system.positions) if position is not None]
    for _ in range(_NEWTON):
        evaluator = _evaluator(system, place, [[x] for x in place.values])
        residuals = {i: evaluator.value(system.positions[i])[0] for i in held}
        if all(map(is_zero, residuals.values())):
            return place
        rows = [_row(system.forms[i], evaluator, len(place.values)) for i in held]
        for row in rows:
            row[-1] = 0  # the time is kept
        pivots = independent(rows)
        if not pivots:
            break
        columns = [j for _, j in pivots]
        matrix = _matrix([[rows[i][j] for j in columns] for i, _ in pivots])
        residual = _matrix([residuals[held[i]] for i, _ in pivots])
        for j, x in zip(columns, _product(inverse(matrix), residual), strict=True):
            place.values[j] -= x
    raise NoSeries("the position constraints")


def values_at(system: PfaffianSystem, place: PathStart, expressions: Sequence[Basic]) -> Vector:
    """Return the values of expressions at a point.

    Raises
    ------
    NoSeries
        One is not defined there.
    """
    evaluator = _evaluator(system, place, [[x] for x in place.values])
    return [evaluator.value(x)[0] for x in expressions]


def covectors(system: PfaffianSystem, place: PathStart) -> list[Vector]:
    """Return the coefficients of all forms at a point."""
    evaluator = _evaluator(system, place, [[x] for x in place.values])
    return [_row(form, evaluator, len(place.values)) for form in system.forms]


def _row(form: Form, evaluator: SeriesEvaluator, count: int) -> Vector:
    row = [0] * count
    for j, b in form.items():
        row[j] = evaluator.value(b)[0]
    return row


def integrable_part(system: PfaffianSystem, place: PathStart) -> IntegrablePart:
    """Return the integrable part of a system at a point, which is generic.

    Raises
    ------
    NoSeries
        A coefficient or its derivative is not defined there.
    """
    pivots = independent(covectors(system, place))
    chosen = tuple(i for i, _ in pivots)
    path = _Path(system, place, chosen, [j for _, j in pivots])
    conditions: list[Vector] = []
    order, more = 1, True
    while more and len(conditions) < len(chosen):
        source, below, idle = random.Random(order), conditions, 0  # reproducible
        while idle < _PATHS and len(conditions) < len(chosen):
            before = len(conditions)
            lower, last = path.conditions(order, source)
            below = _independent_rows([*below, *lower])
            conditions = _independent_rows([*below, *conditions, *last])
            idle = 0 if len(conditions) > before else idle + 1
        # the flag ends where one order adds nothing
        more = len(conditions) > len(below)
        order = min(2 * order, len(chosen))
    return IntegrablePart(chosen, null_space(conditions, len(chosen)))


def _independent_rows(rows: Sequence[Vector]) -> list[Vector]:
    return [rows[i] for i, _ in independent(rows)]


class _Path:
    """Paths from a point in random admissible directions.

    A matrix along the path is a list of matrices of coefficients, whose entries are integers.
    """

    def __init__(
        self, system: PfaffianSystem, place: PathStart, rows: Sequence[int], pivots: Sequence[int]
    ):
        self.system, self.place = system, place
        self.slopes: dict[Basic, list[int]] = {}  # of functions, at this point
        self.chosen = rows
        self.pivots = list(pivots)
        self.free = [j for j in range(len(system.variables)) if j not in pivots]
        start = self.evaluator([[x] for x in place.values])
        self.start = self.matrix(start, 0)[0]
        self.inverse = inverse(self.start[:, self.pivots])

    def conditions(self, order: int, source: random.Random) -> tuple[list[Vector], list[Vector]]:
        """Return the conditions on c below an order, and those of it, along one path."""
        inputs = _matrix([[fixed(source.uniform(-1, 1)) for _ in self.free] for _ in range(order)])
        path = [[x] for x in self.place.values]
        for k in range(order):
            field = self.field(self.matrix(self.evaluator(path), k), inputs)
            for x, rate in zip(path, field[k], strict=True):
                x.append(rate // (k + 1))
        evaluator = self.evaluator(path)
        rows = self.matrix(evaluator, order)
        turns = self.turns(evaluator, self.field(rows[:order], inputs))
        transported: list[Matrix] = [self.start.T]
        forces: list[Matrix] = []
        found: list[list[Vector]] = []
        for k in range(order + 1):
            rest = transported[k][self.pivots]
            for i in range(1, k + 1):
                rest = rest - _product(rows[i][:, self.pivots].T, forces[k - i])
            forces.append(_product(self.inverse.T, rest))
            values = transported[k][self.free]
            for i in range(k + 1):
                values = values - _product(rows[i][:, self.free].T, forces[k - i])
            found.append(values.tolist())
            if k < order:
                rates = _product(turns[0].T, forces[k])
                for i in range(1, k + 1):
                    rates = rates + _product(turns[i].T, forces[k - i])
                transported.append(rates // (k + 1))
        return [x for rows in found[1:order] for x in rows], found[order]

    def evaluator(self, path: Sequence[Series]) -> SeriesEvaluator:
        return _evaluator(self.system, self.place, path, self.slopes)

    def matrix(self, evaluator: SeriesEvaluator, order: int) -> list[Matrix]:
        """Return B along the path."""
        rows = [_zeros(len(self.chosen), len(self.system.variables)) for _ in range(order + 1)]
        for beta, i in enumerate(self.chosen):
            for j, b in self.system.forms[i].items():
                for k, x in enumerate(evaluator.value(b)):
                    rows[k][beta, j] = x
        return rows

    def field(self, rows: Sequence[Matrix], inputs: Matrix) -> list[Matrix]:
        """Return X with B X = 0, whose free components are given."""
        fields: list[Matrix] = []
        for k in range(len(rows)):
            field = _zeros(len(self.place.values))
            field[self.free] = inputs[k]
            rest = sum(_product(rows[k - i], x) for i, x in enumerate(fields))
            field[self.pivots] = -_product(self.inverse, rest + _product(rows[0], field))
            fields.append(field)
        return fields

    def turns(self, evaluator: SeriesEvaluator, fields: Sequence[Matrix]) -> list[Matrix]:
        """Return Σ_i (∂b_βi/∂x_j) X_i along the path."""
        turns = [_zeros(len(self.chosen), len(self.place.values)) for _ in fields]
        components = [list(x) for x in zip(*fields, strict=True)]
        for beta, row in enumerate(self.chosen):
            for (i, j), slope in self.system.slopes[row].items():
                for k, x in enumerate(times(evaluator.value(slope), components[i])):
                    turns[k][beta, j] += x
        return turns


def _evaluator(
    system: PfaffianSystem,
    place: PathStart,
    path: Sequence[Series],
    slopes: dict[Basic, list[int]] | None = None,
) -> SeriesEvaluator:
    order = len(path[0]) - 1
    given = {name: constant(x, order) for name, x in place.parameters.items()}
    return SeriesEvaluator(given | dict(zip(system.variables, path, strict=True)), slopes)


# linear algebra with integers


def _zeros(*shape: int) -> Matrix:
    return np.full(shape, 0, dtype=object)


def _matrix(rows: Sequence[Any]) -> Matrix:
    return np.array(rows, dtype=object)


def _product(a: Matrix, b: Matrix) -> Matrix:
    return np.asarray(a @ b) >> BITS


def independent(rows: Sequence[Vector]) -> list[tuple[int, int]]:
    """Return independent rows, each with the column of its pivot."""
    form: list[tuple[Vector, int]] = []
    pivots = []
    for i, row in enumerate(rows):
        for other, column in form:
            row = _without(row, other, column)
        column = max(range(len(row)), key=lambda j: abs(row[j]), default=0)
        if row and abs(row[column]) > _ZERO:
            form.append(([(x << BITS) // row[column] for x in row], column))
            pivots.append((i, column))
    return pivots


def inverse(matrix: Matrix) -> Matrix:
    """Return the inverse of a regular matrix."""
    count = len(matrix)
    rows = np.hstack(
        [matrix, _matrix([[ONE * (i == j) for j in range(count)] for i in range(count)])]
    )
    for k in range(count):
        best = max(range(k, count), key=lambda i: abs(rows[i, k]))
        rows[[k, best]] = rows[[best, k]]
        rows[k] = (rows[k] << BITS) // rows[k, k]
        for i in range(count):
            if i != k:
                rows[i] -= (rows[i, k] * rows[k]) >> BITS
    return rows[:, count:]


def reduced(
    rows: Sequence[Vector], pivots: Sequence[int] | None = None, columns: int | None = None
) -> dict[int, Vector]:
    """Return the reduced row echelon form of independent rows, by the columns of their pivots.

    The pivots are chosen unless they are given, among the first ``columns``.
    """
    left, form = [list(row) for row in rows], dict[int, Vector]()
    for k in range(len(left)):
        if pivots is None:
            row = left.pop(0)
            column = last_large(row[:columns])
        else:
            column = pivots[k]
            row = left.pop(max(range(len(left)), key=lambda i: abs(left[i][column])))
        row = [(x << BITS) // row[column] for x in row]
        left = [_without(other, row, column) for other in left]
        form = {j: _without(other, row, column) for j, other in form.items()} | {column: row}
    return form


def last_large(row: Vector) -> int:
    """Return the last component that is at least half as large as the largest one."""
    least = max(map(abs, row)) // 2
    return max(j for j, x in enumerate(row) if abs(x) >= least)


def _without(row: Vector, other: Vector, column: int) -> Vector:
    """Return the row less the multiple of another, in which the column is 1, that it contains."""
    factor = row[column]
    return [x - (factor * y >> BITS) for x, y in zip(row, other, strict=True)]


def null_space(rows: Sequence[Vector], count: int) -> list[Vector]:
    """Return a basis of the vectors that all rows, which are independent, are orthogonal to."""
    form, basis = reduced(rows), []
    for free in range(count):
        if free not in form:
            vector = [0] * count
            vector[free] = ONE
            for column, row in form.items():
                vector[column] = -row[free]
            basis.append(vector)
    return basis


def is_zero(x: int) -> bool:
    """Whether a value is zero but for rounding."""
    return abs(x) <= _ZERO
