"""Right sides γ of constraints, by differentiation of their tapes.

γ = −(∂ψ/∂q) v − ∂ψ/∂t consists of second derivatives of φ. Written out, those of norms and
rotations have many times the operations of φ; differentiated operation by operation along the
motion, twice from φ or once from ψ, they have a few times as many, some of which are those of B.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import symengine as se
from symengine import Basic

from lagcli.engine.tape.tape import Tape
from lagcli.model.expression.functions import kinks_of, parts_of

if TYPE_CHECKING:
    from lagcli.engine.tape.differentiation import DirectionalBuilder
    from lagcli.equations.derivation.lagrange import ConstraintEquation

#: How many times the operations of φ or ψ a γ has at least that is not compiled as it is written.
_LONGER = 5


def is_long(constraint: ConstraintEquation) -> bool:
    """Return whether γ is found by differentiating the tape.

    Not where jumps and kinks are, whose derivatives are those of branches.
    """
    source = integrated(constraint)
    if se.count_ops(constraint.rhs) <= _LONGER * se.count_ops(source):
        return False
    return not kinks_of(source) and not parts_of(source, se.Abs)


def integrated(constraint: ConstraintEquation) -> Basic:
    """Return φ of a holonomic constraint, ψ of another one."""
    return constraint.velocity if constraint.position is None else constraint.position


def with_right_sides(tape: Tape, nq: int, sources: Mapping[int, bool]) -> Tape:
    """Return a tape with γ in place of φ and ψ.

    Parameters
    ----------
    tape : Tape
        (t, q, v, parameters) → φ, ψ and other outputs.
    nq : int
    sources : mapping of int to bool
        The outputs that are replaced, and whether each is φ; otherwise it is ψ.

    Returns
    -------
    Tape
    """
    from lagcli.engine.tape.differentiation import DirectionalBuilder, pruned

    builder = DirectionalBuilder(tape.inputs, tape.parameters, 0, tape.functions)
    outputs = builder.extend(tape)
    found = _right_sides(builder, nq, [outputs[i] for i in sources], [*sources.values()])
    for i, register in zip(sources, found, strict=True):
        outputs[i] = register
    return pruned(builder.finish(outputs))


def gradients(
    builder: DirectionalBuilder,
    nq: int,
    sources: Sequence[int],
    positions: Sequence[bool],
    rows: Sequence[Mapping[int, int]],
) -> list[dict[int, int]]:
    """Return the gradients of Γ = γ − B a of some constraints at fixed a.

    Parameters
    ----------
    builder : DirectionalBuilder
        Of a tape of (t, q, v, a, …).
    nq : int
    sources : sequence of int
        The registers of φ or ψ.
    positions : sequence of bool
        Which of them are φ.
    rows : sequence of mappings of int to int
        The registers of the rows of B by coordinate.

    Returns
    -------
    list of dicts of int to int
        The registers of the nonzero derivatives with respect to t, q and v, by their registers.
    """
    defects = []
    right = _right_sides(builder, nq, sources, positions)
    for register, row in zip(right, rows, strict=True):
        for j, b in row.items():
            register = builder.minus(register, builder.times(b, 1 + 2 * nq + j))
        defects.append(register)
    return builder.gradients(defects, range(1 + 2 * nq))


def _right_sides(
    builder: DirectionalBuilder, nq: int, sources: Sequence[int], positions: Sequence[bool]
) -> list[int]:
    """Return the registers of −φ̈ and −ψ̇ without accelerations."""
    motion = {0: builder.one} | {1 + i: 1 + nq + i for i in range(nq)}
    of_positions = [x for x, is_position in zip(sources, positions, strict=True) if is_position]
    rates = iter(builder.along(of_positions, motion))
    velocities = [
        next(rates) if is_position else x for x, is_position in zip(sources, positions, strict=True)
    ]
    return [builder.negative(x) for x in builder.along(velocities, motion)]
