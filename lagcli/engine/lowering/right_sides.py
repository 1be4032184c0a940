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

from lagcli.engine.tape.tape import Tape
from lagcli.model.expression.functions import kinks_of, parts_of

if TYPE_CHECKING:
    from lagcli.engine.tape.differentiation import DirectionalBuilder
    from lagcli.equations.derivation.lagrange import ConstraintEquation, Equations

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
    motion = {1 + i: 1 + nq + i for i in range(nq)}
    found = _right_sides(builder, motion, [outputs[i] for i in sources], [*sources.values()])
    for i, register in zip(sources, found, strict=True):
        outputs[i] = register
    return pruned(builder.finish(outputs))


class LongConstraints:
    """The constraints with a long γ: what a tape has of them, and their Γ = γ − B a.

    Parameters
    ----------
    equations : Equations
    """

    def __init__(self, equations: Equations):
        self.numbers = [i for i, c in enumerate(equations.constraints) if is_long(c)]
        self._constraints = [equations.constraints[i] for i in self.numbers]
        self._nq = len(equations.q)

    def __bool__(self) -> bool:
        return bool(self.numbers)

    @property
    def expressions(self) -> list[Basic]:
        """What a tape has of them: φ or ψ of each, and their rows of B."""
        rows = [b for c in self._constraints for b in c.row.values()]
        return [*map(integrated, self._constraints), *rows]

    def defects(
        self,
        builder: DirectionalBuilder,
        registers: Iterator[int],
        velocity: int,
        acceleration: int,
    ) -> list[int]:
        """Append Γ.

        Parameters
        ----------
        builder : DirectionalBuilder
            Of a tape of (t, q, …).
        registers : iterator of int
            Those of the expressions.
        velocity, acceleration : int
            The registers of the first v and a.

        Returns
        -------
        list of int
            The registers of Γ.
        """
        sources = [next(registers) for _ in self._constraints]
        positions = [c.position is not None for c in self._constraints]
        motion = {1 + i: velocity + i for i in range(self._nq)}
        defects = []
        right = _right_sides(builder, motion, sources, positions)
        for register, c in zip(right, self._constraints, strict=True):
            for j in c.row:
                product = builder.times(next(registers), acceleration + j)
                register = builder.minus(register, product)
            defects.append(register)
        return defects


def _right_sides(
    builder: DirectionalBuilder,
    motion: Mapping[int, int],
    sources: Sequence[int],
    positions: Sequence[bool],
) -> list[int]:
    """Return the registers of −φ̈ and −ψ̇ without accelerations; `motion` has those of v by q."""
    along = {0: builder.one, **motion}
    of_positions = [x for x, is_position in zip(sources, positions, strict=True) if is_position]
    rates = iter(builder.along(of_positions, along))
    velocities = [
        next(rates) if is_position else x for x, is_position in zip(sources, positions, strict=True)
    ]
    return [builder.negative(x) for x in builder.along(velocities, along)]
