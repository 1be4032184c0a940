"""Geometry → M a = f + Bᵀλ, B a = γ in the expressions of any algebra, and its elimination.

An algebra has ``diff(expression, variable)`` and ``variables(expression)``, the indices of the
states (q, v) that an expression holds. Only entries that are not zero by structure are kept.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from comparison.mechanisms import Geometry

Expression = Any
Entries = dict[tuple[int, int], Expression]


@dataclass(frozen=True)
class Kinetics:
    """The index-1 form: M (both triangles) and B by entry, f and γ as lists."""

    mass: Entries
    forcing: list[Expression]
    jacobian: Entries
    rhs: list[Expression]

    def kkt(self) -> tuple[Entries, list[Expression]]:
        """Return K and r of K (a, −λ) = r, both triangles."""
        nq = len(self.forcing)
        entries = dict(self.mass)
        for (i, j), value in self.jacobian.items():
            entries[nq + i, j] = entries[j, nq + i] = value
        return entries, [*self.forcing, *self.rhs]


def derive(
    algebra: Any, geometry: Geometry, q: Sequence[Expression], v: Sequence[Expression]
) -> Kinetics:
    """Derive Lagrange's equations of the first kind, inertia by inertia."""
    diff = algebra.diff
    nq = len(q)
    mass: Entries = defaultdict(lambda: 0)
    forcing: list[Expression] = [0] * nq

    def rate(expression: Expression, among: list[int]) -> Expression:
        return sum((diff(expression, q[k]) * v[k] for k in among), 0)

    for inertia in geometry.inertias:
        known = sorted({i for x in inertia.coordinates for i in algebra.variables(x)})
        kinetic = sum((rate(x, known) ** 2 for x in inertia.coordinates), 0) * (inertia.factor / 2)
        for i in known:
            momentum = diff(kinetic, v[i])
            for j in known:
                mass[i, j] = mass[i, j] + diff(momentum, v[j])
            forcing[i] = forcing[i] + diff(kinetic, q[i]) - rate(momentum, known)
    for term in geometry.potential:
        for i in algebra.variables(term):
            forcing[i] = forcing[i] - diff(term, q[i])
    for damper in geometry.dampers:
        known = algebra.variables(damper.length)
        speed = rate(damper.length, known)
        for i in known:
            forcing[i] = forcing[i] - damper.factor * speed * diff(damper.length, q[i])
    for i, force in geometry.forces.items():
        forcing[i] = forcing[i] + force

    jacobian: Entries = {}
    rhs = []
    for row, constraint in enumerate(geometry.constraints):
        known = algebra.variables(constraint)
        for i in known:
            jacobian[row, i] = diff(constraint, q[i])
        rhs.append(-rate(rate(constraint, known), known))
    nonzero = {k: x for k, x in mass.items() if not algebra.is_zero(x)}
    return Kinetics(nonzero, forcing, jacobian, rhs)


def solve_symmetric(entries: Entries, rhs: Sequence[Expression]) -> list[Expression]:
    """Solve K x = r by LDLᵀ without pivoting, in the given order, with zeros left out.

    Up to three unknowns by Cramer's rule, which needs no pivot to be nonzero.
    """
    n = len(rhs)
    if n <= 3:
        return _cramer(entries, rhs)
    lower = {k: x for k, x in entries.items() if k[0] >= k[1]}
    x = list(rhs)
    columns: list[list[tuple[int, Expression]]] = []
    for k in range(n):
        pivot = lower[k, k]
        column = [(i, lower[i, k]) for i in range(k + 1, n) if (i, k) in lower]
        factors = [(i, value / pivot) for i, value in column]
        for i, factor in factors:
            for j, value in column:
                if j <= i:
                    old = lower.get((i, j))
                    lower[i, j] = -factor * value if old is None else old - factor * value
            x[i] = x[i] - factor * x[k]
        columns.append(factors)
    for k in reversed(range(n)):
        x[k] = x[k] / lower[k, k]
        for i, factor in columns[k]:
            x[k] = x[k] - factor * x[i]
    return x


def _cramer(entries: Entries, rhs: Sequence[Expression]) -> list[Expression]:
    n = len(rhs)
    rows = [[entries.get((i, j), 0) for j in range(n)] for i in range(n)]

    def determinant(a: list[list[Expression]]) -> Expression:
        if len(a) == 1:
            return a[0][0]
        total = 0
        for j, head in enumerate(a[0]):
            if isinstance(head, int) and head == 0:
                continue
            minor = determinant([[*row[:j], *row[j + 1 :]] for row in a[1:]])
            total = total + (-1) ** j * head * minor
        return total

    whole = determinant(rows)
    replaced = ([[*row[:k], rhs[i], *row[k + 1 :]] for i, row in enumerate(rows)] for k in range(n))
    return [determinant(a) / whole for a in replaced]
