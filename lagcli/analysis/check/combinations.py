"""Integrable combinations of velocity constraints: their factors and integrals as formulas."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import symengine as se
from symengine import Basic

from lagcli.analysis.check.derived_system import (
    IntegrablePart,
    PathStart,
    PfaffianSystem,
    Vector,
    covectors,
    independent,
    integrable_part,
    is_zero,
    last_large,
    reduced,
    values_at,
)
from lagcli.analysis.check.power_series import BITS, ONE, NoSeries, fixed
from lagcli.equations.derivation.integrability import FirstIntegral, first_integral
from lagcli.equations.derivation.motion import ZERO
from lagcli.model.expression.functions import derivative

#: Largest denominator of a number among the factors.
_LARGEST_DENOMINATOR = 1000
#: Largest number of operations of a factor; longer ones are not shown as formulas.
_LARGEST = 60
#: Largest number of operations of an entry in the elimination that leads to factors.
_LARGEST_ENTRY = 2000
#: Largest number of operations of coefficients of which a common divisor is looked for.
_LARGEST_FORM = 200
#: Factors with fewer operations are not simplified.
_SHORT = 4


@dataclass(frozen=True, eq=False)
class IntegrableCombination:
    """An integrable combination Σ c_β ψ_β of velocity constraints.

    Parameters
    ----------
    numbers : mapping of str to float
        The factors c_β ≠ 0 by constraint, at a consistent state near the start.
    factors : mapping of str to expression, or None
        The same as expressions in q and t; None if they were not found.
    integral : FirstIntegral or None
        A function that is constant where the combination and the other integrable constraints are
        zero, if it was found.
    value : float or None
        Its value at the initial state.
    """

    numbers: Mapping[str, float]
    factors: Mapping[str, Basic] | None
    integral: FirstIntegral | None
    value: float | None


class FoundCombination(NamedTuple):
    """A combination by rows; see `IntegrableCombination`."""

    numbers: dict[int, float]
    factors: dict[int, Basic] | None
    integral: FirstIntegral | None


class JointPart(NamedTuple):
    """What is integrable of a system.

    Parameters
    ----------
    nonintegrable : int
        The number of independent rows less that of the integrable combinations.
    together : set of int
        Rows in the integrable part.
    combinations : list of FoundCombination
        With the rows that are integrable by themselves, a basis of the integrable part.
    """

    nonintegrable: int
    together: set[int]
    combinations: list[FoundCombination]


class _NoFactors(Exception):
    """The factors are not found as expressions."""


def joint_part(
    system: PfaffianSystem, places: Sequence[PathStart], alone: set[int]
) -> JointPart | None:
    """Return what is integrable of a system.

    Parameters
    ----------
    system : PfaffianSystem
    places : sequence of PathStart
        Points on the position constraints, almost all of them generic.
    alone : set of int
        Rows that are integrable by themselves.

    Returns
    -------
    JointPart or None
        None if no point has finite values.
    """
    found: list[tuple[PathStart, IntegrablePart]] = []
    for place in places:
        try:
            found.append((place, integrable_part(system, place)))
        except NoSeries:
            continue
    if not found:
        return None
    # at points that are not generic, fewer rows are independent and fewer conditions hold
    generic = max((len(part.rows), -len(part.combinations)) for _, part in found)
    rows = next(p.rows for _, p in found if (len(p.rows), -len(p.combinations)) == generic)
    found = [x for x in found if x[1].rows == rows and len(x[1].combinations) == -generic[1]]
    return _Joint(system, found, rows, alone).part()


class _Joint:
    """The integrable part of a system, from that at some points with the same independent rows."""

    def __init__(
        self,
        system: PfaffianSystem,
        found: Sequence[tuple[PathStart, IntegrablePart]],
        rows: tuple[int, ...],
        alone: set[int],
    ):
        self.system = system
        self.places = [place for place, _ in found]
        self.parts = [part.combinations for _, part in found]
        self.rows = rows
        self.matrices = [covectors(system, place) for place in self.places]
        closed = {i for i, x in enumerate(system.positions) if x is not None} | alone
        self.left = [i for i in rows if i not in closed]
        forms = [system.forms[i] for i in closed]
        #: coordinates that other constraints keep constant
        self.held = {j for form in forms if len(form) == 1 for j in form}
        self.constant = self.held
        self.present: set[int] = set()  # variables in the combination that is being examined

    def part(self) -> JointPart:
        count = len(self.system.variables)
        spans = [
            [_combined(dict(zip(self.rows, row, strict=True)), matrix, count) for row in part]
            for part, matrix in zip(self.parts, self.matrices, strict=True)
        ]
        together = {
            i
            for i in range(len(self.system.forms))
            if all(
                len(independent([*span, matrix[i]])) == len(span)
                for span, matrix in zip(spans, self.matrices, strict=True)
            )
        }
        found = self.combinations(self.by_rows())
        if any(x.integral is None for x in found):
            other = self.combinations(self.by_variables())
            found = max(found, other, key=lambda y: sum(x.integral is not None for x in y))
        return JointPart(len(self.rows) - len(self.parts[0]), together, found)

    def combinations(self, basis: Sequence[list[Vector]]) -> list[FoundCombination]:
        """Return combinations, with integrals that may use the coordinates that others keep."""
        found = [self.combination(vectors) for vectors in basis]
        self.constant = self.held
        while True:
            known = len(self.constant)
            for k, x in enumerate(found):
                if x.integral is None and x.factors is not None:
                    self.present = self.variables_in(basis[k])
                    found[k] = x._replace(integral=self.integral(x.factors))
                integral = found[k].integral
                inside = integral.expression.free_symbols if integral is not None else set()
                moving = [j for j, y in enumerate(self.system.variables) if y in inside]
                if len(moving) == 1:
                    self.constant = self.constant | {*moving}
            if len(self.constant) == known:
                return found

    def by_rows(self) -> list[list[Vector]]:
        """Return the combinations of the rows that are not integrable by themselves.

        Each is given by its factors at all points, in the echelon form that is reduced in them.
        """
        columns = [self.rows.index(i) for i in self.left]
        pivots: list[int] | None = None
        forms = []
        for part in self.parts:
            rows = [[row[j] for j in columns] for row in part]
            form = reduced([rows[i] for i, _ in independent(rows)], pivots)
            pivots = pivots or list(form)
            forms.append(form)
        return [[form[pivot] for form in forms] for pivot in sorted(pivots or [])]

    def by_variables(self) -> list[list[Vector]]:
        """Return the same with the echelon form reduced in the coefficients of the variables."""
        count = len(self.system.variables)
        pivots: list[int] | None = None
        forms = []
        for k, matrix in enumerate(self.matrices):
            rows = []
            for (*vectors,) in self.by_rows():
                support = dict(zip(self.left, vectors[k], strict=True))
                rows.append([*_combined(support, matrix, count), *vectors[k]])
            form = reduced(rows, pivots, count)
            pivots = pivots or list(form)
            forms.append(form)
        return [_normalized([form[pivot][count:] for form in forms]) for pivot in pivots or []]

    def combination(self, vectors: Sequence[Vector]) -> FoundCombination:
        """Return a combination with its factors, as far as they are found."""
        columns = list(zip(*vectors, strict=True))
        support = {
            i: list(x) for i, x in zip(self.left, columns, strict=True) if not all(map(is_zero, x))
        }
        numbers = {i: x[0] / ONE for i, x in support.items()}
        self.present = self.variables_in(vectors)
        try:
            return FoundCombination(numbers, self.factors(support), None)
        except (_NoFactors, NoSeries):
            return FoundCombination(numbers, None, None)

    def variables_in(self, vectors: Sequence[Vector]) -> set[int]:
        """Return the variables that a combination contains."""
        count, present = len(self.system.variables), set[int]()
        for vector, matrix in zip(vectors, self.matrices, strict=True):
            form = _combined(dict(zip(self.left, vector, strict=True)), matrix, count)
            present |= {j for j, x in enumerate(form) if not is_zero(x)}
        return present

    # factors

    def factors(self, support: Mapping[int, list[int]]) -> dict[int, Basic]:
        """Return the factors as expressions that have these values at the points."""
        factors = {i: x for i, values in support.items() if (x := _rational(values)) is not None}
        unknown = [i for i in support if i not in factors]
        if unknown:
            factors |= zip(unknown, self.solved(factors, unknown), strict=True)
        for i, values in support.items():
            if factors[i].args and se.count_ops(factors[i]) > _LARGEST:
                raise _NoFactors
            for place, value in zip(self.places, values, strict=True):
                (x,) = values_at(self.system, place, [factors[i]])
                if not is_zero(x - value):
                    raise _NoFactors
        return {i: factors[i] for i in support}

    def solved(self, known: Mapping[int, Basic], unknown: Sequence[int]) -> list[Basic]:
        """Return the unknown factors, from conditions that are linear in all of them."""
        equations: list[Mapping[int, Basic]] = []
        for more in (self.absent, self.closing):
            equations += more([*known, *unknown])
            rows = []
            for row in equations:
                right = se.Add(*(-row[i] * c for i, c in known.items() if i in row))
                rows.append([*(row.get(i, ZERO) for i in unknown), right])
            solution = _solved(rows, len(unknown), self.values)
            if solution is not None:
                return solution
        raise _NoFactors

    def values(self, expressions: Sequence[Basic]) -> Vector:
        return values_at(self.system, self.places[0], expressions)

    def absent(self, rows: Sequence[int]) -> list[Mapping[int, Basic]]:
        """Return the coefficients of the variables that the combination does not contain."""
        forms = {i: self.system.forms[i] for i in rows}
        absent = set().union(*forms.values()) - self.present
        return [{i: form[j] for i, form in forms.items() if j in form} for j in sorted(absent)]

    def closing(self, rows: Sequence[int]) -> list[Mapping[int, Basic]]:
        """Return the values of the differentials dθ on pairs of admissible fields."""
        return [
            {i: x for i in rows if (x := self.turn(i, *pair)) != 0}
            for pair in combinations(self.fields, 2)
        ]

    def turn(self, row: int, x: Mapping[int, Basic], y: Mapping[int, Basic]) -> Basic:
        """Return dθ(x, y)."""
        terms = []
        for (i, j), slope in self.system.slopes[row].items():
            terms.append(slope * x.get(j, ZERO) * y.get(i, ZERO))
            terms.append(-slope * x.get(i, ZERO) * y.get(j, ZERO))
        return se.Add(*terms)

    @cached_property
    def fields(self) -> list[dict[int, Basic]]:
        """A basis of the admissible fields, with their nonzero components."""
        count = len(self.system.variables)
        matrix = [[self.system.forms[i].get(j, ZERO) for j in range(count)] for i in self.rows]
        pivots = _eliminate(matrix, count, self.values)
        fields = []
        for free in range(count):
            if free not in pivots:
                field = {column: -matrix[row][free] for column, row in pivots.items()}
                field = {column: x for column, x in field.items() if x != 0}
                fields.append({free: se.Integer(1), **field})
        return fields

    # integrals

    def integral(self, factors: Mapping[int, Basic]) -> FirstIntegral | None:
        """Search for a function that the combination leaves constant."""
        form: dict[Basic, Basic] = {}
        variables = [x for j, x in enumerate(self.system.variables) if j not in self.constant]
        for j in sorted(self.present - self.constant):
            b = se.Add(*(c * self.system.forms[i].get(j, ZERO) for i, c in factors.items()))
            values = [values_at(self.system, place, [b])[0] for place in self.places]
            exact = _rational(values)
            form[self.system.variables[j]] = se.expand(b) if exact is None else exact
        divisors = [x for c in factors.values() for x in _parts(c) if x.free_symbols]
        integral = first_integral(_primitive(form), variables, list(dict.fromkeys(divisors)))
        return integral if integral is not None and self.is_kept(integral.expression) else None

    def is_kept(self, function: Basic) -> bool:
        """Whether the gradient of a function is a combination of the rows at all points."""
        slopes = [derivative(function, x) for x in self.system.variables]
        rows = [[matrix[i] for i in self.rows] for matrix in self.matrices]
        return all(
            len(independent([*row, values_at(self.system, place, slopes)])) == len(row)
            for row, place in zip(rows, self.places, strict=True)
        )


def _combined(factors: Mapping[int, int], matrix: Sequence[Vector], count: int) -> Vector:
    """Return Σ c_β θ_β at a point."""
    total = [0] * count
    for i, c in factors.items():
        total = [x + (c * y >> BITS) for x, y in zip(total, matrix[i], strict=True)]
    return total


def _normalized(vectors: Sequence[Vector]) -> list[Vector]:
    """Return vectors divided by the same component of each."""
    first = last_large(vectors[0])
    return [[(x << BITS) // vector[first] for x in vector] for vector in vectors]


def _parts(factor: Basic) -> tuple[Basic, Basic]:
    numerator, denominator = factor.as_numer_denom()
    return denominator, numerator


def _primitive(form: dict[Basic, Basic]) -> dict[Basic, Basic]:
    """Return a form without common divisors of its coefficients, unless they are long."""
    if len(form) < 2 or sum(map(se.count_ops, form.values())) > _LARGEST_FORM:
        return form
    import sympy
    from symengine.lib.symengine_wrapper import sympy2symengine

    coefficients = [x._sympy_() for x in form.values()]
    try:
        divisor = sympy.gcd_list(coefficients)
        if not divisor.free_symbols:
            return form
        quotients = [sympy.cancel(x / divisor) for x in coefficients]
    except (sympy.PolynomialError, NotImplementedError):
        return form
    return dict(zip(form, map(sympy2symengine, quotients), strict=True))


def _rational(values: Sequence[int]) -> Basic | None:
    """Return the simple number that all values are; None if there is none."""
    nearest = Fraction(values[0], ONE).limit_denominator(_LARGEST_DENOMINATOR)
    exact = fixed(nearest)
    if any(not is_zero(x - exact) for x in values):
        return None
    return se.Rational(nearest.numerator, nearest.denominator)


# elimination of expressions; which of them are zero is decided by their values at a point

_Values = Callable[[Sequence[Basic]], Vector]


def _solved(rows: Sequence[list[Basic]], count: int, values: _Values) -> list[Basic] | None:
    """Return the solution of equations, of which the shortest are used; None if it is not unique.

    Each row contains the factors of the unknowns, and the right side.
    """
    rows = sorted(rows, key=lambda row: sum(map(se.count_ops, row)))
    chosen = independent([values(row[:count]) for row in rows])
    if len(chosen) < count:
        return None
    matrix = [list(rows[i]) for i, _ in chosen]
    pivots = _eliminate(matrix, count, values)
    return [_simplified(matrix[pivots[column]][count]) for column in range(count)]


def _eliminate(matrix: list[list[Basic]], columns: int, values: _Values) -> dict[int, int]:
    """Bring independent rows to reduced echelon form; return the row of each pivot's column."""
    pivots: dict[int, int] = {}
    for _ in matrix:
        places = [
            (i, j)
            for i in range(len(matrix))
            for j in range(columns)
            if i not in pivots.values() and matrix[i][j] != 0
        ]
        row, column = min(places, key=lambda place: _cost(matrix[place[0]][place[1]]))
        pivot = matrix[row][column]
        pivots[column] = row
        matrix[row] = [x / pivot if x != 0 else x for x in matrix[row]]
        for i, other in enumerate(matrix):
            if i != row and other[column] != 0:
                changed = [
                    x - other[column] * y if y != 0 else x
                    for x, y in zip(other, matrix[row], strict=True)
                ]
                if max(map(se.count_ops, changed)) > _LARGEST_ENTRY:
                    raise _NoFactors
                zeros = map(is_zero, values(changed))
                matrix[i] = [ZERO if no else x for no, x in zip(zeros, changed, strict=True)]
    return pivots


def _cost(entry: Basic) -> tuple[bool, int]:
    """Return how unsuitable a pivot is: numbers are the best ones."""
    return bool(entry.free_symbols), int(se.count_ops(entry))


def _simplified(expression: Basic) -> Basic:
    if not _SHORT < se.count_ops(expression) <= _LARGEST:
        return expression
    import sympy
    from symengine.lib.symengine_wrapper import sympy2symengine

    return sympy2symengine(sympy.simplify(expression._sympy_()))
