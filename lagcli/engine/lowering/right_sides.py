"""Right sides γ of constraints, by differentiation of their tapes.

γ = −(∂ψ/∂q) v − ∂ψ/∂t consists of second derivatives of φ. Written out, those of norms and
rotations have many times the operations of φ; differentiated operation by operation along the
motion, twice from φ or once from ψ, they have a few times as many, some of which are those of B.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import symengine as se
from symengine import Basic

from lagcli.model.expression.functions import kinks_of, parts_of

if TYPE_CHECKING:
    from lagcli.engine.tape.differentiation import DerivativeBuilder
    from lagcli.equations.derivation.lagrange import ConstraintEquation, Equations

#: How many times the operations of φ or ψ a γ has at least that is not compiled as it is written.
_LONGER = 5


def long_constraints(equations: Equations) -> dict[int, ConstraintEquation]:
    """Return the constraints with a long γ, by their numbers.

    Not those with jumps and kinks, whose derivatives are those of branches.
    """
    return {i: c for i, c in enumerate(equations.constraints) if _is_long(c)}


def _is_long(constraint: ConstraintEquation) -> bool:
    """Return whether γ has many times the operations of φ or ψ, and no kinks."""
    source = _source(constraint)
    if se.count_ops(constraint.rhs) <= _LONGER * se.count_ops(source):
        return False
    return not kinks_of(source) and not parts_of(source, se.Abs)


def _source(constraint: ConstraintEquation) -> Basic:
    """Return φ of a holonomic constraint, ψ of another one."""
    return constraint.velocity if constraint.position is None else constraint.position


def sources_of(constraints: Mapping[int, ConstraintEquation]) -> list[Basic]:
    """Return φ of holonomic constraints, ψ of others."""
    return [_source(c) for c in constraints.values()]


def rows_of(constraints: Mapping[int, ConstraintEquation]) -> list[Basic]:
    """Return the entries of B, by rows."""
    return [b for c in constraints.values() for b in c.row.values()]


def right_sides(
    builder: DerivativeBuilder,
    constraints: Mapping[int, ConstraintEquation],
    registers: Iterator[int],
    velocities: Sequence[int],
) -> list[int]:
    """Append γ of constraints.

    Parameters
    ----------
    builder : DerivativeBuilder
        Of a tape of (t, q, …).
    constraints : mapping of int to ConstraintEquation
    registers : iterator of int
        Those of `sources_of`.
    velocities : sequence of int
        The registers of v.

    Returns
    -------
    list of int
        The registers of −φ̈ and −ψ̇ without accelerations.
    """
    along = {0: builder.one, **dict(enumerate(velocities, 1))}
    given = [next(registers) for _ in constraints]
    positions = [c.position is not None for c in constraints.values()]
    rates = iter(builder.along([x for x, of in zip(given, positions, strict=True) if of], along))
    velocities = [next(rates) if of else x for x, of in zip(given, positions, strict=True)]
    return [builder.negative(x) for x in builder.along(velocities, along)]


def residuals(
    builder: DerivativeBuilder,
    constraints: Mapping[int, ConstraintEquation],
    registers: Iterator[int],
    velocities: Sequence[int],
    accelerations: Sequence[int],
) -> list[int]:
    """Append Γ = γ − B a of constraints.

    Parameters
    ----------
    builder, constraints, velocities
        As for `right_sides`.
    registers : iterator of int
        Those of `sources_of` and `rows_of`.
    accelerations : sequence of int
        The registers of a.

    Returns
    -------
    list of int
        The registers of Γ.
    """
    found = right_sides(builder, constraints, registers, velocities)
    for k, c in enumerate(constraints.values()):
        for j in c.row:
            product = builder.times(next(registers), accelerations[j])
            found[k] = builder.minus(found[k], product)
    return found
