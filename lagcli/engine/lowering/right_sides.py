"""Right sides γ of constraints, by differentiation of their tapes.

γ = −(∂ψ/∂q) v − ∂ψ/∂t consists of second derivatives of φ. Written out, those of norms and
rotations have many times the operations of φ; differentiated operation by operation along the
motion, twice from φ or once from ψ, they have a few times as many, some of which are those of B.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import symengine as se
from symengine import Basic

from lagcli.engine.tape.differentiation import DirectionalBuilder, pruned
from lagcli.engine.tape.tape import Tape
from lagcli.model.expression.functions import kinks_of, parts_of

if TYPE_CHECKING:
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


def with_right_sides(tape: Tape, nq: int, twice: Iterable[int], once: Iterable[int]) -> Tape:
    """Return a tape with γ in place of φ and ψ.

    Parameters
    ----------
    tape : Tape
        (t, q, v, parameters) → φ, ψ and other outputs.
    nq : int
    twice, once : iterables of int
        The outputs φ, which are replaced by −φ̈ without accelerations, and ψ, which are replaced by
        −ψ̇ without them.

    Returns
    -------
    Tape
    """
    builder = DirectionalBuilder(tape.inputs, tape.parameters, 0, tape.functions)
    outputs = builder.extend(tape)
    motion = {0: builder.one} | {1 + i: 1 + nq + i for i in range(nq)}
    positions = [*twice]
    places = [*positions, *once]
    rates = builder.along([outputs[i] for i in positions], motion)
    rates += [outputs[i] for i in places[len(positions) :]]
    for i, rate in zip(places, builder.along(rates, motion), strict=True):
        outputs[i] = builder.negative(rate)
    return pruned(builder.finish(outputs))
