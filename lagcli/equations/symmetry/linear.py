"""Linear symmetries of a system by linear algebra over the rational numbers.

Along a motion, for any field ξ(q) and number τ, with h = p·v − L,

    d/dt (p·ξ − τ h) = ξ·∂L/∂q + p·ξ̇ + Q·ξ + τ (∂L/∂t − Q·v) + λ·(B ξ + τ b_0).

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
from typing import Literal, NamedTuple

import symengine as se
from symengine import Basic

from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.derivation.motion import ZERO
from lagcli.equations.symmetry.monomials import ONE, Monomials, Term, term_count
from lagcli.equations.symmetry.nullspace import (
    SparseVector,
    echelon,
    independent,
    null_space,
    remainder,
)
from lagcli.model.model import TIME

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
        self.rows = [{j: write(b) for j, b in c.row.items()} for c in eq.constraints]
        self.drifts = [write(c.drift) for c in eq.constraints]
        self.positions = [write(c.position) for c in eq.constraints if c.position is not None]

    @property
    def size(self) -> float:
        """Approximate number of terms of the conditions."""
        parts = [*self.forces, *self.momenta, self.time, *self.drifts, *self.positions]
        parts += [b for row in self.rows for b in row.values()]
        return sum(map(term_count, parts))

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
        found = {}
        for place, x in vector.items():
            letter, i, j = known[place]
            if letter in ("A", "b"):
                rows[i][j if letter == "A" else k] = x
            elif letter == "tau":
                found[k * (k + 1)] = x
        for i, row in rows.items():
            for j, x in remainder(row, self._linear_constraints).items():
                found[i * (k + 1) + j] = x
        return found

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
        found = [("mu", i, j) for i in range(r) for j in range(rh)]
        found += [("c", i, 0) for i in range(k)]
        if with_rotations:
            found += [("C", i, j) for i, j in both if i <= j]
        found += [("b", i, 0) for i in range(k)]
        if with_rotations:
            found += [("A", i, j) for i, j in both]
        return [*found, ("tau", 0, 0)]

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
    eq, found = equations, []
    inside = eq.lagrangian.free_symbols
    on = {i for c in eq.constraints for i in c.row}
    for i, (x, force) in enumerate(zip(eq.q, eq.applied_forces, strict=True)):
        if x not in inside and i not in on and force == ZERO:
            found.append(Symmetry({}, {i: Fraction(1)}, Fraction(0), {}, {}, {}))
    forces = any(force != ZERO for force in eq.applied_forces)
    if not (forces or TIME in inside or any(c.drift != ZERO for c in eq.constraints)):
        found.append(Symmetry({}, {}, Fraction(1), {}, {}, {}))
    return found
