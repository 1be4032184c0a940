"""λ and the accelerations in closed form, for systems of few unknowns."""

from __future__ import annotations

from typing import NamedTuple

import symengine as se
from symengine import Basic

from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.derivation.motion import ZERO
from lagcli.equations.reduction.partition import CoordinatePartition, number
from lagcli.equations.reduction.second_kind import Maggi, SecondKind
from lagcli.equations.reduction.small_systems import (
    CRAMER,
    cancelled,
    operations,
    solutions,
)

#: Largest number of operations of a numerator or denominator of a closed form.
LONGEST = 400
#: Factor by which a formula may grow when fractions in it are removed.
_GROWTH = 2
#: Largest number of operations of a fraction that is reduced; longer ones take seconds.
_CANCELLED = 250


class SolvedUnknown(NamedTuple):
    """An acceleration or a multiplier as a fraction."""

    unknown: Basic
    numerator: Basic
    denominator: Basic


Matrix = list[list[Basic]]


def solve_first_kind(partition: CoordinatePartition) -> list[SolvedUnknown]:
    """Solve M a = f + Bᵀλ, B a = γ for a and λ.

    Parameters
    ----------
    partition : CoordinatePartition

    Returns
    -------
    list of SolvedUnknown
        Multipliers, then accelerations. Empty if the closed form would be long: beyond three
        multipliers with a diagonal mass matrix, or three unknowns otherwise; or if constraints are
        redundant, because λ is not unique then.
    """
    e = partition.equations
    if partition.surplus:
        return []
    masses = [row.get(i, ZERO) for i, row in enumerate(e.mass_matrix)]
    diagonal = all(set(row) <= {i} for i, row in enumerate(e.mass_matrix))
    if diagonal and len(e.constraints) <= CRAMER and all(m != 0 for m in masses):
        return _short(_by_multipliers(e, masses, partition))
    k = len(e.q)
    if k + len(e.constraints) > CRAMER:
        return []
    matrix: Matrix = [[row.get(j, ZERO) for j in range(k)] for row in e.mass_matrix]
    for i, row in enumerate(matrix):
        row.extend(-c.row.get(i, ZERO) for c in e.constraints)
    right = [*e.forcing, *(c.rhs for c in e.constraints)]
    for c in e.constraints:
        matrix.append([*(c.row.get(j, ZERO) for j in range(k)), *[ZERO] * len(e.constraints)])
    solved = _solved(matrix, right, [*e.a, *e.multipliers], partition)
    return _short([*solved[k:], *solved[:k]])


def _by_multipliers(
    e: Equations, masses: list[Basic], partition: CoordinatePartition
) -> list[SolvedUnknown]:
    """Solve (B M⁻¹ Bᵀ) λ = γ − B M⁻¹ f first, for a diagonal M."""
    rows = [c.row for c in e.constraints]
    matrix: Matrix = [
        [se.Add(*[x * b.get(j, ZERO) / masses[j] for j, x in a.items()]) for b in rows]
        for a in rows
    ]
    right = [
        c.rhs - se.Add(*[x * e.forcing[j] / masses[j] for j, x in c.row.items()])
        for c in e.constraints
    ]
    solved = _solved(matrix, right, list(e.multipliers), partition)
    for i, a in enumerate(e.a):
        below = solved[0].denominator if solved else se.Integer(1)
        forces = [solved[n].numerator * row[i] for n, row in enumerate(rows) if i in row]
        same = all(x.denominator == below for x in solved)
        if not same:
            forces = [
                solved[n].numerator / solved[n].denominator * row[i]
                for n, row in enumerate(rows)
                if i in row
            ]
            below = se.Integer(1)
        if not forces:
            below = se.Integer(1)
        above = se.Add(e.forcing[i] * below, *forces)
        solved.append(SolvedUnknown(a, *_lowest_terms(above, below * masses[i])))
    return solved


def solve_accelerations(equations: SecondKind | Maggi) -> list[SolvedUnknown]:
    """Solve for up to three independent accelerations; else return none."""
    partition = equations.partition
    if not 0 < len(partition.independent) <= CRAMER:
        return []
    unknowns = [partition.equations.a[i] for i in partition.independent]
    matrix = [list(row) for row in equations.mass_matrix]
    return _short(_solved(matrix, list(equations.forcing), unknowns, partition))


def _solved(
    matrix: Matrix, right: list[Basic], unknowns: list[Basic], partition: CoordinatePartition
) -> list[SolvedUnknown]:
    (above,), below = solutions(matrix, [right], lambda x: number(x, partition.values))
    return [
        SolvedUnknown(unknown, *_lowest_terms(x, below))
        for unknown, x in zip(unknowns, above, strict=True)
    ]


def _lowest_terms(numerator: Basic, denominator: Basic) -> tuple[Basic, Basic]:
    """Return a fraction in lowest terms; a long one without the factors that all terms share."""
    (above,), below = cancelled([numerator], denominator)
    if operations([above, below]) > _GROWTH * operations([numerator, denominator]):
        return numerator, denominator
    if operations([above, below]) > _CANCELLED:
        return above, below
    if above.atoms(se.Piecewise) or below.atoms(se.Piecewise):  # SymPy changes their conditions
        return above, below
    import sympy
    from symengine.lib.symengine_wrapper import sympy2symengine

    value = sympy.cancel(above._sympy_() / below._sympy_())
    reduced = tuple(map(sympy2symengine, sympy.fraction(value)))
    return reduced if operations(reduced) < operations([above, below]) else (above, below)


def _short(unknowns: list[SolvedUnknown]) -> list[SolvedUnknown]:
    longest = max((se.count_ops(x) for s in unknowns for x in s[1:]), default=0)
    return unknowns if longest <= LONGEST else []
