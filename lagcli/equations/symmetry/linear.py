"""Linear symmetries of a system by linear algebra over the rational numbers.

Along a motion, for any field ξ(q) and number τ, with h = p·v − L,

    d/dt (p·ξ − τ h) = ξ·∂L/∂q + p·ξ̇ + Q·ξ + τ (∂L/∂t − Q·v) + λ·(B ξ + τ b_0).

The λ of the equations of first-order coordinates are 0.

So p·ξ − τ h − F is conserved if B ξ + τ b_0 vanishes on the constraints and the rest is dF/dt:
Noether's theorem for constrained systems, of which Jacobi's integral is the case ξ = 0. With

    ξ = A q + b,  F = c·q + ½ qᵀC q,  B ξ + τ b_0 = μ φ,

A, b, c, C, μ and τ constant, both conditions are linear in the unknowns; the coefficient of each
monomial in q, v and t gives one equation.

References
----------
.. [1] L. Bates, J. Śniatycki, Nonholonomic reduction, Rep. Math. Phys. 32 (1993), 99-115,
   doi:10.1016/0034-4877(93)90073-N.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction
from functools import cached_property
from math import gcd, lcm
from typing import Literal, NamedTuple

import symengine as se
from symengine import Basic

from lagcli.equations.derivation.lagrange import ConstraintEquation, Equations, Row
from lagcli.equations.derivation.motion import ZERO
from lagcli.model.expression.algebra import count_terms, expand_terms
from lagcli.model.expression.functions import parts_of
from lagcli.model.model import TIME

ONE, TWO = se.Integer(1), se.Integer(2)
_SMALL_DENOMINATOR = 10**6
_ROUNDING = 4e-16  # rounding error of a parameter computed from others


def rational(value: float) -> Fraction:
    """Return the simple rational number that a double represents: 3/4000 for 7.5e-4."""
    fraction = Fraction(value).limit_denominator(_SMALL_DENOMINATOR)
    if abs(fraction - Fraction(value)) <= _ROUNDING * abs(Fraction(value)):
        return fraction
    return Fraction(repr(value))


def symbolic(value: Fraction) -> Basic:
    """Return a fraction as an expression."""
    return se.Integer(value.numerator) / se.Integer(value.denominator)


#: A rational number; most are integers, whose arithmetic is ten times as fast.
Exact = int | Fraction
#: A monomial with the real and imaginary parts of its coefficient.
Term = tuple[Basic, Exact, Exact]


class Monomials:
    """Writes expressions as sums of monomials.

    Parameters
    ----------
    values : mapping of str to float
        Parameter values to substitute. Other parameters count as independent symbols, so that a
        result holds for all of their values.
    """

    def __init__(self, values: Mapping[str, float]):
        self._values = {se.Symbol(n): symbolic(rational(x)) for n, x in values.items()}
        self._exponentials: dict[Basic, Basic] = {}

    def exponential(self, expression: Basic) -> Basic:
        """Return an expression with the parameters' values, and exponentials for sin and cos."""
        for x in parts_of(expression, se.RealDouble):
            expression = expression.xreplace({x: symbolic(rational(float(x)))})
        put_in = expression.xreplace(self._values)
        waves = {f: self._wave(f) for f in parts_of(put_in, se.sin, se.cos)}
        return put_in.xreplace(waves) if waves else put_in

    def terms(self, exponential: Basic) -> Iterator[Term]:
        """Yield the monomials of a result of `exponential`, with real and imaginary coefficient."""
        expanded = expand_terms(exponential)
        if isinstance(expanded, se.Number):
            parts = {ONE: expanded}
        else:
            parts = expanded.as_coefficients_dict()
        for monomial, coefficient in parts.items():
            if coefficient != 0:
                yield monomial, *_parts(coefficient)

    def _wave(self, function: Basic) -> Basic:
        """Return sin or cos of a linear combination of terms in terms of their exponentials."""
        angle = expand_terms(function.args[0])
        factors = []
        for term, coefficient in (
            {ONE: angle} if isinstance(angle, se.Number) else angle.as_coefficients_dict()
        ).items():
            if term not in self._exponentials:
                self._exponentials[term] = se.Symbol(f"\ufdd1{len(self._exponentials)}")
            factors.append(self._exponentials[term] ** coefficient)
        wave = se.Mul(*factors)
        if isinstance(function, se.cos):
            return (wave + 1 / wave) / TWO
        return (wave - 1 / wave) / (TWO * se.I)


def term_count(exponential: Basic, known: dict[Basic, float] | None = None) -> float:
    """Return an upper bound of the number of monomials; see `count_terms`."""
    return count_terms(exponential, known)


def _number(coefficient: Basic | int) -> Basic:
    """Return a coefficient as a SymEngine number; coefficients of single terms are Python
    numbers."""
    return se.Integer(coefficient) if isinstance(coefficient, int) else coefficient


def _parts(coefficient: Basic | int) -> tuple[Exact, Exact]:
    if isinstance(coefficient, int):
        return coefficient, 0
    if isinstance(coefficient, se.Rational):
        return _exact(coefficient), 0
    return _exact(coefficient.real_part()), _exact(coefficient.imaginary_part())


def _exact(number: Basic) -> Exact:
    if isinstance(number, se.Integer):
        return int(number)
    numerator, denominator = number.get_num_den()
    return Fraction(int(numerator), int(denominator))


def coefficients(expression: Basic) -> dict[Basic, Basic]:
    """Return the terms of a sum, without their numerical coefficients, with these."""
    if isinstance(expression, se.Number):
        return {ONE: expression} if expression != 0 else {}
    items = expression.as_coefficients_dict().items()
    return {term: _number(x) for term, x in items if x != 0}


SparseVector = dict[int, Exact]
_Integers = dict[int, int]


def null_space(rows: Iterable[SparseVector], columns: int) -> list[SparseVector]:
    """Return a basis of the vectors x with A x = 0.

    Fraction-free Gaussian elimination: rows are integers without a common divisor.

    Parameters
    ----------
    rows : iterable of sparse vectors
        The nonzero entries of each row by column.
    columns : int

    Returns
    -------
    list of sparse vectors
        In reduced form: each has an entry 1 in a column where the others have 0. Of linearly
        dependent columns, the later ones are used for that.
    """
    left, vanishing = _without_single_entries(rows)
    pivots: dict[int, _Integers] = {column: {column: 1} for column in vanishing}
    distinct = {tuple(sorted(_integers(row).items())) for row in left}
    for entries in sorted(distinct, key=lambda entries: (len(entries), entries)):
        _add(dict(entries), pivots)
    solved = sorted(pivots, reverse=True)
    return [_solution(free, pivots, solved) for free in range(columns) if free not in pivots]


def _without_single_entries(rows: Iterable[SparseVector]) -> tuple[list[SparseVector], set[int]]:
    """Return rows without the unknowns that must vanish, which are the majority, and these
    unknowns."""
    listed, vanishing = list(rows), set[int]()
    containing: dict[int, list[int]] = defaultdict(list)
    for place, row in enumerate(listed):
        for column in row:
            containing[column].append(place)
    left = list(map(len, listed))  # entries that need not vanish
    stack = [column for row in listed if len(row) == 1 for column in row]
    while stack:
        column = stack.pop()
        if column in vanishing:
            continue
        vanishing.add(column)
        for place in containing[column]:
            left[place] -= 1
            if left[place] == 1:
                stack += [c for c in listed[place] if c not in vanishing]
    reduced = [
        row if count == len(row) else {c: x for c, x in row.items() if c not in vanishing}
        for row, count in zip(listed, left, strict=True)
        if count
    ]
    return reduced, vanishing


def independent(vectors: Iterable[SparseVector]) -> list[int]:
    """Return the indices of the vectors that are linearly independent of the previous ones."""
    pivots: dict[int, _Integers] = {}
    return [place for place, vector in enumerate(vectors) if _add(_integers(vector), pivots)]


def echelon(vectors: Iterable[SparseVector]) -> list[SparseVector]:
    """Return a basis of the span of some vectors, by their first entries, which are 1."""
    pivots: dict[int, _Integers] = {}
    for vector in vectors:
        _add(_integers(vector), pivots)
    return [{c: Fraction(x, pivots[i][i]) for c, x in pivots[i].items()} for i in sorted(pivots)]


def remainder(vector: SparseVector, basis: Iterable[SparseVector]) -> SparseVector:
    """Return a vector reduced by those of `echelon`."""
    rest = dict(vector)
    for row in basis:
        factor = rest.get(min(row))
        if factor:
            for c, x in row.items():
                rest[c] = rest.get(c, 0) - factor * x
    return {c: x for c, x in rest.items() if x}


def _add(row: _Integers, pivots: dict[int, _Integers]) -> bool:
    """Add a row to a basis if it is linearly independent."""
    while row:
        lead = min(row)
        if lead not in pivots:
            pivots[lead] = row
            return True
        row = _without(row, lead, pivots[lead])
    return False


def _integers(row: SparseVector) -> _Integers:
    """Return a multiple of a row with coprime integers, the first one positive."""
    common = lcm(*(x.denominator for x in row.values()))
    return _primitive({c: x.numerator * (common // x.denominator) for c, x in row.items()})


def _primitive(row: _Integers) -> _Integers:
    divisor = gcd(*row.values())
    if row and row[min(row)] < 0:
        divisor = -divisor
    return {c: x // divisor for c, x in row.items()} if divisor not in (0, 1) else row


def _without(row: _Integers, lead: int, pivot: _Integers) -> _Integers:
    """Return a combination of a row and a pivot row that eliminates the pivot column."""
    divisor = gcd(row[lead], pivot[lead])
    own, other = pivot[lead] // divisor, row[lead] // divisor
    combined = {c: own * x for c, x in row.items()}
    for c, x in pivot.items():
        combined[c] = combined.get(c, 0) - other * x
    return _primitive({c: x for c, x in combined.items() if x})


def _solution(free: int, pivots: dict[int, _Integers], solved: list[int]) -> SparseVector:
    """Return the solution with one free unknown equal to 1 and the others 0, by back
    substitution."""
    solution: SparseVector = {free: 1}
    for lead in solved:
        row = pivots[lead]
        if lead > free or solution.keys().isdisjoint(row):
            continue
        value = sum(x * solution[c] for c, x in row.items() if c in solution)
        if value:
            solution[lead] = Fraction(-value) / row[lead]
    return solution


#: Limits of the number of terms, which is an upper bound and often ten times the actual number:
#: `lagcli check` may take some seconds, a run some 20 ms.
THOROUGH, QUICK = 3e6, 1e3

#: What was searched: A, b and τ; b and τ; or coordinates that do not occur, and the time.
Extent = Literal["linear", "translations", "absent coordinates"]

#: An unknown: its letter and its indices.
Unknown = tuple[str, int, int]
#: Numerators of numbers that are not given by parameters.
_SMALL = (-2, -1, 1, 2)
#: An unknown with a factor of its coefficient.
_Use = tuple[Unknown, Basic]


class Symmetry(NamedTuple):
    """A field ξ = A q + b with a shift τ of time, and the gauge F = c·q + ½ qᵀC q.

    Parameters
    ----------
    linear : mapping of (int, int) to Fraction
        The nonzero entries of A.
    shift : mapping of int to Fraction
        The nonzero entries of b.
    time : Fraction
        τ.
    gauge_linear, gauge_quadratic : mappings to Fraction
        The nonzero entries of c, and of C on and above the diagonal.
    multiples : mapping of (int, int) to Fraction
        The nonzero entries of μ, by constraint and by holonomic constraint.
    """

    linear: Mapping[tuple[int, int], Fraction]
    shift: Mapping[int, Fraction]
    time: Fraction
    gauge_linear: Mapping[int, Fraction]
    gauge_quadratic: Mapping[tuple[int, int], Fraction]
    multiples: Mapping[tuple[int, int], Fraction]

    @property
    def is_energy(self) -> bool:
        """Whether it is a pure shift of time, which conserves h."""
        return not (self.linear or self.shift or self.gauge_linear or self.gauge_quadratic)


def lasting_symmetries(equations: Equations, effort: float) -> tuple[list[Symmetry], Extent]:
    """Find the linear symmetries whose quantities remain constant when constraints switch.

    Impacts and friction conserve momenta as constraints do, since B ξ = 0 for all rows. They
    dissipate energy, and assignments by events change any quantity.

    Parameters
    ----------
    equations : Equations
    effort : float
        `THOROUGH` or `QUICK`.

    Returns
    -------
    list of Symmetry, Extent
        As `linear_symmetries`, for the model's parameter values.
    """
    model = equations.model
    symmetries, extent = linear_symmetries(equations, model.parameter_values, effort)
    if any(e.action.set or e.action.impulse for e in model.events):
        return [], extent
    if model.switches or any(x != ZERO for x in equations.reactive_forces):
        return [s for s in symmetries if not s.time], extent
    return symmetries, extent


def monitored_symmetries(equations: Equations) -> list[Symmetry]:
    """Find the symmetries of lasting quantities besides the energy, within some 20 ms."""
    return [s for s in lasting_symmetries(equations, QUICK)[0] if not s.is_energy]


def linear_symmetries(
    equations: Equations, parameters: Mapping[str, float], effort: float
) -> tuple[list[Symmetry], Extent]:
    """Find all linear symmetries of a system.

    Parameters
    ----------
    equations : Equations
    parameters : mapping of str to float
        Parameter values to substitute; symmetries may hold only for these.
    effort : float
        Approximate limit of the number of terms. If there are more, the search is restricted.

    Returns
    -------
    list of Symmetry
        A basis of the linear space of symmetries.
    Extent
        Extent of the search.
    """
    if 2 * term_count(equations.lagrangian) * len(equations.q) > effort:
        return _absent(equations), "absent coordinates"
    system = _Conditions(equations, Monomials(parameters))
    extent: Extent = "linear"
    if system.size > effort:
        return _absent(equations), "absent coordinates"
    if system.size * len(equations.q) > effort:
        extent = "translations"
    vectors = system.solutions(extent == "linear")
    if any(x.numerator not in _SMALL or x.denominator > 2 for v in vectors for x in v.values()):
        # prefer unknowns whose numbers do not come from parameters
        general = _Conditions(equations, Monomials({})).solutions(extent == "linear")
        vectors = [*general, *vectors]
    known = system.unknowns(extent == "linear")
    kept = independent([system.on_constraints(vector, known) for vector in vectors])
    return [_symmetry(vectors[place], known) for place in kept], extent


def conditions_of(c: ConstraintEquation) -> tuple[Row, Basic]:
    """Return b and b_0 of a constraint; zeros if its λ is 0, so that it does no work."""
    return ({}, ZERO) if c.constraint.of_coordinate else (c.row, c.drift)


class _Conditions:
    """The two conditions as equations for the unknowns."""

    def __init__(self, equations: Equations, monomials: Monomials):
        self.equations, self.monomials = equations, monomials
        eq, write = equations, monomials.exponential
        applied = eq.applied_forces
        self.forces = [write(g + f) for g, f in zip(eq.gradient, applied, strict=True)]
        self.momenta = [write(p) for p in eq.momenta]
        power = se.Add(*[f * v for f, v in zip(applied, eq.v, strict=True)])
        self.time = write(-eq.time_power - power)
        conditions = [conditions_of(c) for c in eq.constraints]
        self.rows = [{j: write(b) for j, b in row.items()} for row, _ in conditions]
        self.drifts = [write(drift) for _, drift in conditions]
        self.positions = [write(c.position) for c in eq.constraints if c.position is not None]

    @cached_property
    def size(self) -> float:
        """Approximate number of terms of the conditions."""
        parts = [*self.forces, *self.momenta, self.time, *self.drifts, *self.positions]
        parts += [b for row in self.rows for b in row.values()]
        known: dict[Basic, float] = {}
        return sum(term_count(x, known) for x in parts)

    def solutions(self, with_rotations: bool) -> list[SparseVector]:
        """Return a basis of the symmetries, with A or with A = 0, in terms of the unknowns."""
        known = self.unknowns(with_rotations)
        places = {unknown: place for place, unknown in enumerate(known)}
        rows: dict[tuple[int, Basic, int], SparseVector] = defaultdict(dict)
        for condition, terms, uses in self._entries(with_rotations):
            for monomial, *parts in terms:
                for unknown, factor in uses:
                    key, place = monomial if factor is ONE else monomial * factor, places[unknown]
                    for part, x in enumerate(parts):
                        if x:
                            row = rows[condition, key, part]
                            row[place] = row[place] + x if place in row else x
        equations = (
            row if all(row.values()) else {c: x for c, x in row.items() if x}
            for row in rows.values()
        )
        return null_space([row for row in equations if row], len(known))

    def on_constraints(self, vector: SparseVector, known: list[Unknown]) -> SparseVector:
        """Return ξ and τ, with ξ reduced by linear functions of q that vanish on the constraints.

        The momentum of a field that vanishes on the constraints is identically zero.
        """
        k = len(self.momenta)
        rows: dict[int, SparseVector] = defaultdict(dict)
        conditions = {}
        for place, x in vector.items():
            letter, i, j = known[place]
            if letter in ("A", "b"):
                rows[i][j if letter == "A" else k] = x
            elif letter == "tau":
                conditions[k * (k + 1)] = x
        for i, row in rows.items():
            for j, x in remainder(row, self._linear_constraints).items():
                conditions[i * (k + 1) + j] = x
        return conditions

    @cached_property
    def _linear_constraints(self) -> list[SparseVector]:
        """The sums of position constraints that are linear in q with constant coefficients.

        In a chain of bars, the constraints of the joints contain the sines and cosines of angles,
        which drop out of some of their sums.
        """
        places: dict[Basic | tuple[Basic, int], int] = {
            x: j for j, x in enumerate((*self.equations.q, ONE))
        }
        rows = []
        for position in self.positions:
            row: SparseVector = {}
            for monomial, *parts in self.monomials.terms(position):
                if monomial in places:
                    row[places[monomial]] = parts[0]
                    continue
                for part, x in enumerate(parts):
                    if x:  # eliminated first
                        row[places.setdefault((monomial, part), -len(places))] = x
            rows.append(row)
        return [row for row in echelon(rows) if min(row) >= 0]

    def unknowns(self, with_rotations: bool) -> list[Unknown]:
        """Return the unknowns; of linearly dependent ones, the last ones are free."""
        k, r, rh = len(self.momenta), len(self.rows), len(self.positions)
        both = [(i, j) for i in range(k) for j in range(k)]
        unknowns = [("mu", i, j) for i in range(r) for j in range(rh)]
        unknowns += [("c", i, 0) for i in range(k)]
        if with_rotations:
            unknowns += [("C", i, j) for i, j in both if i <= j]
        unknowns += [("b", i, 0) for i in range(k)]
        if with_rotations:
            unknowns += [("A", i, j) for i, j in both]
        return [*unknowns, ("tau", 0, 0)]

    def _entries(self, with_rotations: bool) -> Iterator[tuple[int, Iterable[Term], list[_Use]]]:
        """Yield the number of a condition, the terms of a sum, and the unknowns multiplied by it.

        Condition −1 is that of L, condition β that of constraint β.
        """
        eq, terms = self.equations, self.monomials.terms
        q = list(enumerate(eq.q)) if with_rotations else []
        for i, (force, p) in enumerate(zip(self.forces, self.momenta, strict=True)):
            yield -1, terms(force), [(("b", i, 0), ONE), *((("A", i, j), x) for j, x in q)]
            yield -1, terms(p), [(("A", i, j), eq.v[j]) for j, _ in q]
            yield -1, [(eq.v[i], -1, 0)], [(("c", i, 0), ONE)]
            for j, x in q[i:]:
                rate = {eq.v[i] * x, eq.q[i] * eq.v[j]}
                yield -1, [(monomial, -1, 0) for monomial in rate], [(("C", i, j), ONE)]
        yield -1, terms(self.time), [(("tau", 0, 0), ONE)]
        positions = [[*terms(-position)] for position in self.positions]
        for beta, (row, drift) in enumerate(zip(self.rows, self.drifts, strict=True)):
            for i, b in row.items():
                yield beta, terms(b), [(("b", i, 0), ONE), *((("A", i, j), x) for j, x in q)]
            yield beta, terms(drift), [(("tau", 0, 0), ONE)]
            for gamma, position in enumerate(positions):
                yield beta, position, [(("mu", beta, gamma), ONE)]


def _symmetry(vector: SparseVector, unknowns: list[Unknown]) -> Symmetry:
    parts: dict[str, dict[tuple[int, int], Fraction]] = defaultdict(dict)
    for place, x in sorted(vector.items()):
        letter, i, j = unknowns[place]
        parts[letter][i, j] = Fraction(x)
    return Symmetry(
        linear=parts["A"],
        shift={i: x for (i, _), x in parts["b"].items()},
        time=parts["tau"].get((0, 0), Fraction(0)),
        gauge_linear={i: x for (i, _), x in parts["c"].items()},
        gauge_quadratic=parts["C"],
        multiples=parts["mu"],
    )


def _absent(equations: Equations) -> list[Symmetry]:
    """Return the translations along coordinates that do not occur, and that of time."""
    eq, absent = equations, []
    inside = eq.lagrangian.free_symbols
    conditions = [conditions_of(c) for c in eq.constraints]
    on = {i for row, _ in conditions for i in row}
    for i, (x, force) in enumerate(zip(eq.q, eq.applied_forces, strict=True)):
        if x not in inside and i not in on and force == ZERO:
            absent.append(Symmetry({}, {i: Fraction(1)}, Fraction(0), {}, {}, {}))
    forces = any(force != ZERO for force in eq.applied_forces)
    if not (forces or TIME in inside or any(drift != ZERO for _, drift in conditions)):
        absent.append(Symmetry({}, {}, Fraction(1), {}, {}, {}))
    return absent
