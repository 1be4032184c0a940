"""First-order coordinates: those without inertia, whose equations determine their velocities.

With L = ½ vᵀM v + Σ A_i v_i − V, the equation of a coordinate i whose row of M is zero has no
accelerations:

    ψ_i = Σ (∂A_j/∂q_i − ∂A_i/∂q_j) v_j − ∂A_i/∂t + … − ∂V/∂q_i + Q_i − ∂D/∂v_i + Σ λ_β b_βi = 0.

Without constraints on such coordinates, ψ = 0 is a velocity constraint, whose multiplier μ is 0:
the equation itself, ψ + (∂ψ/∂v)ᵀμ = 0, gives μ = 0 where ψ = 0, if ∂ψ/∂v is regular. It is enforced
by consistent initialization and projection, and its derivative determines the accelerations.

With constraints of rows b_β, the combinations Nᵀψ with b N = 0 do not contain their λ and take the
place of ψ; λ follows from the others. Nᵀ(∂ψ/∂v)N must be regular. N is

- one column, of the minors of b, where b leaves one direction free;
- else the projector det(b bᵀ) I − bᵀ adj(b bᵀ) b. Its rows are redundant by the rank of b, and none
  of them vanishes where a chosen minor does: a basis of fewer rows need not exist, as on a sphere.

Constraints in which a coordinate has a number as its coefficient are eliminated before.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import symengine as se
from symengine import Basic

from lagcli.model.expression.algebra import is_zero, kinked_in, nonlinear_in
from lagcli.model.expression.constants import number
from lagcli.model.model import (
    RATE,
    TIME,
    WEIGHT,
    Constraint,
    Coordinate,
    Kind,
    Model,
    Parameter,
    coordinate,
    velocity,
)
from lagcli.model.names.draft import Draft

_ZERO = se.Integer(0)
_Row = dict[int, Basic]  # nonzero entries by column
#: Largest number of constraints that are projected out together: minors grow with its factorial.
_MOST = 5
#: Pivots below this part of their row's largest entry are rounding errors of generic numbers.
_INDEPENDENT = 1e-9


class _Group(NamedTuple):
    """Coordinates that share constraints, and their equations without constraint forces.

    Parameters
    ----------
    members : list of int
    equations : dict of int to expression
        By coordinate.
    projected : bool
        Whether they are combinations that do not contain λ.
    """

    members: list[int]
    equations: dict[int, Basic]
    projected: bool


def first_order_constraints(
    draft: Draft,
    coordinates: Iterable[Coordinate],
    lagrangian: Basic,
    dissipation: Basic | None,
    forces: Mapping[str, Basic],
    constraints: Sequence[Constraint],
) -> tuple[Constraint, ...]:
    """Return the equations of the first-order coordinates as constraints, with λ = 0.

    Coordinates in constraints that do not last, such as contacts, are left out, and so are those
    that share constraints with them; constraints alone may determine them.

    Parameters
    ----------
    draft : Draft
    coordinates : iterable of Coordinate
    lagrangian : expression
        L = T − V.
    dissipation : expression or None
        D.
    forces : mapping of str to expression
        Q by coordinate.
    constraints : sequence of Constraint
    """
    coordinates = tuple(coordinates)
    moving = {velocity(c.name): c for c in coordinates}
    inertial = _with_inertia(lagrangian, moving)
    without = [c for v, c in moving.items() if v not in inertial]
    if not without:
        return ()
    found = _FirstOrder(draft, without, lagrangian, dissipation, forces)
    return tuple(found.constraints(constraints))


def _with_inertia(lagrangian: Basic, velocities: Mapping[Basic, Coordinate]) -> set[Basic]:
    """Return the velocities in which L is not affine."""
    found: set[Basic] = set()
    left = [lagrangian]
    while left:
        part = left.pop()
        present = part.free_symbols & velocities.keys()
        if not present or part in present:
            continue
        if isinstance(part, (se.Add, se.Mul)):
            moving = [x for x in part.args if not x.free_symbols.isdisjoint(present)]
            if isinstance(part, se.Add) or len(moving) == 1:
                left += moving
                continue
        found |= present
    return found


def weights_of_constraints(model: Model) -> dict[str, Parameter]:
    """Return the weights of the constraints that events change and massless coordinates need.

    While such a constraint holds, M + w bᵀb and f + w bᵀγ have the same solutions as M and f, and
    M + w bᵀb is regular where M is not without the constraint. The weight is w, the largest of the
    masses, or 0 while the constraint does not hold.
    """
    changed = {name for e in model.events for name in (*e.action.release, *e.action.engage)}
    if not changed:
        return {}
    kinetic = -model.potential if model.kinetic is None else model.kinetic
    velocities = {velocity(c.name): c for c in model.coordinates}
    inertial = _with_inertia(kinetic, velocities)
    without = {
        x for v, c in velocities.items() if v not in inertial for x in (v, coordinate(c.name))
    }
    weights: dict[str, Parameter] = {}
    for c in model.constraints:
        plain = not c.sign and c.limit is None
        if c.name in changed and plain and not without.isdisjoint(c.expression.free_symbols):
            name = c.name + WEIGHT
            w = _largest_inertia(model, kinetic, inertial)
            weights[name] = Parameter(name, w if c.active else 0.0, high=w)
    return weights


def _largest_inertia(model: Model, kinetic: Basic, inertial: Iterable[Basic]) -> float:
    """Return the largest ∂²L/∂v² at the initial values; 1 if there is none."""
    at = {se.Symbol(name): se.RealDouble(x) for name, x in model.parameter_values.items()}
    at |= {coordinate(q): se.RealDouble(x.value) for q, x in model.initial_positions.items()}
    at |= {velocity(q): se.RealDouble(x.value) for q, x in model.initial_velocities.items()}
    at[TIME] = se.RealDouble(model.settings.t_start or 0.0)
    slope, largest = model.names.slope, 0.0
    for v in inertial:
        try:
            mass = abs(number(slope(slope(kinetic, v), v).xreplace(at)))
        except (ValueError, RuntimeError):
            continue
        largest = max(largest, mass)
    return largest or 1.0


class _FirstOrder:
    """The equations of the coordinates without inertia.

    Parameters
    ----------
    draft : Draft
    coordinates : sequence of Coordinate
        Those without inertia.
    lagrangian, dissipation, forces : see `first_order_constraints`
    """

    def __init__(
        self,
        draft: Draft,
        coordinates: Sequence[Coordinate],
        lagrangian: Basic,
        dissipation: Basic | None,
        forces: Mapping[str, Basic],
    ):
        self.draft, self.coordinates = draft, coordinates
        self.slope = draft.names.slope
        self.dissipation = _ZERO if dissipation is None else dissipation
        self.forces = forces
        self.velocities = [velocity(c.name) for c in coordinates]
        present = lagrangian.free_symbols
        #: The momenta A_i that are not zero.
        self.momenta = {
            i: self.slope(lagrangian, v) for i, v in enumerate(self.velocities) if v in present
        }
        self.rest = lagrangian
        if self.momenta:
            self.rest = lagrangian.xreplace({self.velocities[i]: _ZERO for i in self.momenta})

    def constraints(self, others: Sequence[Constraint]) -> list[Constraint]:
        """Return the equations of all coordinates that have velocities in them."""
        rows, left_out = self._rows(others)
        groups = []
        for members in _sharing(len(self.coordinates), rows):
            if left_out.isdisjoint(members):
                held = [row for row in rows if not row.keys().isdisjoint(members)]
                groups.append(self._group(members, held))
        while True:
            known = [self.velocities[i] for g in groups for i in g.members]
            kept = [g for g in groups if any(self._has(x, known) for x in g.equations.values())]
            if len(kept) == len(groups):
                break
            groups = kept
        equations = {i: (x, g.projected) for g in groups for i, x in g.equations.items()}
        built = [self._constraint(i, *equations[i], known) for i in sorted(equations)]
        return [x for x in built if x is not None]

    def _rows(self, others: Sequence[Constraint]) -> tuple[list[_Row], set[int]]:
        """Return the rows of B by coordinate, and the coordinates in constraints that can end."""
        rows, left_out = [], set[int]()
        for c in others:
            present = c.expression.free_symbols
            row = {}
            for i, v in enumerate(self.velocities):
                x = coordinate(self.coordinates[i].name) if c.kind == "holonomic" else v
                slope = self.slope(c.expression, x) if x in present else _ZERO
                if not is_zero(slope):
                    row[i] = slope
            if c.lasting and c.kind != "nonlinear":
                rows.append(row)
            else:
                left_out |= row.keys()
        return rows, left_out

    def _group(self, members: list[int], held: list[_Row]) -> _Group:
        """Return the equations of coordinates that share constraints."""
        held = _independent(held)
        if len(held) == len(members) or len(held) > _MOST:
            return _Group(members, {}, True)
        balances = {i: self._balance(i) for i in members}
        if not held:
            return _Group(members, balances, False)
        held = _eliminated(held, balances)
        names = list(balances)
        b = [[row.get(i, _ZERO) for i in names] for row in held]
        if not b:
            return _Group(members, balances, True)
        if len(names) > len(b) + 1:
            rows = _projected(b, list(balances.values()))
            return _Group(members, dict(zip(names, rows, strict=True)), True)
        columns = range(len(names))
        minors = [_determinant([row[:k] + row[k + 1 :] for row in b]) for k in columns]
        along = [-x if k % 2 else x for k, x in enumerate(minors)]
        return _Group(members, {names[0]: _product(along, balances.values())}, True)

    def _balance(self, i: int) -> Basic:
        """Return ψ_i without constraint forces."""
        names, name = self.draft.names, self.coordinates[i].name
        q, own = coordinate(name), self.momenta.get(i, _ZERO)
        still = dict.fromkeys(self.velocities, _ZERO)
        terms = [
            self.slope(self.rest, q),
            self.forces.get(name, _ZERO),
            -self.slope(self.dissipation, self.velocities[i]),
            -names.derivative(own).xreplace(still),
        ]
        for j in range(len(self.coordinates)):
            other = self.momenta.get(j, _ZERO)
            by_other = self.slope(own, coordinate(self.coordinates[j].name))
            gyroscopic = self.slope(other, q) - by_other
            if j != i and not is_zero(gyroscopic):
                terms.append(gyroscopic * self.velocities[j])
        return se.Add(*terms)

    def _has(self, equation: Basic, velocities: Sequence[Basic]) -> bool:
        """Whether velocities occur in an equation."""
        present = equation.free_symbols
        return any(v in present and not is_zero(self.slope(equation, v)) for v in velocities)

    def _constraint(
        self, i: int, equation: Basic, projected: bool, velocities: Sequence[Basic]
    ) -> Constraint | None:
        """Return the constraint of an equation; None if it has an error."""
        coordinate_, names = self.coordinates[i], self.draft.names
        rates = sorted((s for s in equation.free_symbols if s.name.endswith("'")), key=str)
        nonlinear = ((nonlinear_in, velocities), (kinked_in, rates))
        if any(s.name.startswith("lambda.") for s in equation.free_symbols):
            wrong, help_ = "depends on multipliers", "give the coordinate a mass"
        elif any(f(equation, x) is not None for f, x in nonlinear):
            wrong = "is not linear in the velocities"
            help_ = "let D be quadratic in the velocities, or give the coordinate a mass"
        else:
            kind: Kind = "nonholonomic" if nonlinear_in(equation, rates) is None else "nonlinear"
            name = coordinate_.name + RATE
            names.constraints[name] = None
            return Constraint(
                name, kind, equation, location=coordinate_.location, projected=projected
            )
        assert coordinate_.location is not None
        self.draft.report.add(
            "first-order",
            f"the coordinate `{coordinate_.name}` has no kinetic energy, and the balance of forces"
            f" that determines `{coordinate_.name}'` {wrong}",
            coordinate_.location,
            help_,
        )
        return None


def _sharing(count: int, rows: Sequence[_Row]) -> list[list[int]]:
    """Return groups of numbers that share rows, in increasing order."""
    groups = [{i} for i in range(count)]
    for row in rows:
        joined = [g for g in groups if not g.isdisjoint(row)]
        if len(joined) > 1:
            groups = [g for g in groups if g.isdisjoint(row)]
            groups.append(set().union(*joined))
    return sorted(sorted(g) for g in groups)


def _independent(rows: Sequence[_Row]) -> list[_Row]:
    """Return rows that are independent at a generic point."""
    symbols = sorted({s for row in rows for x in row.values() for s in x.free_symbols}, key=str)
    at = {s: se.RealDouble(0.6 + 0.3 * math.sin((4 * i + 1) ** 2)) for i, s in enumerate(symbols)}
    chosen: list[_Row] = []
    reduced: list[tuple[int, dict[int, float]]] = []
    for row in rows:
        try:
            values = {i: number(x.xreplace(at)) for i, x in row.items()}
        except (ValueError, RuntimeError):  # outside the domain of a function
            chosen.append(row)
            continue
        least = _INDEPENDENT * max(map(abs, values.values()), default=0.0)
        for pivot, other in reduced:
            factor = values.get(pivot, 0.0) / other[pivot]
            for i, x in other.items():
                values[i] = values.get(i, 0.0) - factor * x
        pivot = max(values, key=lambda i: abs(values[i]), default=-1)
        if values and abs(values[pivot]) > least:
            chosen.append(row)
            reduced.append((pivot, values))
    return chosen


def _eliminated(rows: Sequence[_Row], equations: dict[int, Basic]) -> list[_Row]:
    """Eliminate constraints that have a number as a coefficient, with the equation of its column.

    Returns the others.
    """
    left = list(rows)
    while True:
        found = ((r, j) for r in left for j, x in r.items() if isinstance(x, se.Number))
        row, pivot = next(found, ({}, -1))
        if not row:
            return left
        left = [other for other in left if other is not row]
        balance = equations.pop(pivot)
        for i, x in row.items():
            if i == pivot:
                continue
            ratio = x / row[pivot]
            equations[i] -= ratio * balance
            for other in left:
                if pivot in other:
                    other[i] = other.get(i, _ZERO) - ratio * other[pivot]
        for other in left:
            other.pop(pivot, None)


def _projected(b: Sequence[Sequence[Basic]], psi: Sequence[Basic]) -> list[Basic]:
    """Return (det(b bᵀ) I − bᵀ adj(b bᵀ) b) ψ."""
    gram = [[_product(x, y) for y in b] for x in b]
    forces = [_product(row, psi) for row in b]
    solved = []
    for k in range(len(b)):  # Cramer's rule
        pairs = zip(gram, forces, strict=True)
        solved.append(_determinant([[*row[:k], force, *row[k + 1 :]] for row, force in pairs]))
    whole = _determinant(gram)
    columns = zip(*b, strict=True)
    return [whole * x - _product(c, solved) for x, c in zip(psi, columns, strict=True)]


def _product(one: Iterable[Basic], other: Iterable[Basic]) -> Basic:
    return se.Add(*[x * y for x, y in zip(one, other, strict=True)])


def _determinant(matrix: Sequence[Sequence[Basic]]) -> Basic:
    """Return a determinant by minors."""
    if not matrix:
        return se.Integer(1)
    first, *rest = matrix
    return se.Add(
        *[
            (-x if k % 2 else x) * _determinant([[*row[:k], *row[k + 1 :]] for row in rest])
            for k, x in enumerate(first)
            if x != 0
        ]
    )
