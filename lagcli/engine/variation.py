"""The derivatives of a System's equations, as a tape; compiled when a stiff method needs them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import symengine as se

from lagcli.engine.compilation import compile_tape
from lagcli.engine.system import Pattern
from lagcli.engine.tape import Tape

if TYPE_CHECKING:
    from lagcli.equations.lagrange import Equations, Row


@dataclass(frozen=True, eq=False)
class Variation:
    """G = f − M a + Bᵀλ and Γ = γ − B a, differentiated at fixed a and λ.

    It can be written by hand: only the tape's inputs and outputs, in the order given here, are the
    contract.

    Parameters
    ----------
    force_position, force_velocity : tuples of (row, coordinate)
        Places of the nonzero entries of ∂G/∂q and ∂G/∂v.
    rhs_position, rhs_velocity : tuples of (constraint, coordinate)
        Places of the nonzero entries of ∂Γ/∂q and ∂Γ/∂v.
    power_position, power_velocity : tuples of int
        Coordinates on whose position and velocity the power of all forces depends, at fixed λ.
    tape : Tape
        (t, q, v, a, λ, parameters) → (entries of ∂G/∂q, ∂G/∂v, ∂Γ/∂q, ∂Γ/∂v, ∂power/∂q, ∂power/∂v;
        ∂G/∂t, ∂Γ/∂t, ∂power/∂t).
    """

    force_position: Pattern
    force_velocity: Pattern
    rhs_position: Pattern
    rhs_velocity: Pattern
    power_position: tuple[int, ...]
    power_velocity: tuple[int, ...]
    tape: Tape


def compile_variation(equations: Equations) -> Variation:
    """Turn the derivatives of the equations into a tape.

    Parameters
    ----------
    equations : Equations

    Returns
    -------
    Variation
    """
    from lagcli.equations.variation import vary
    from lagcli.model.model import TIME

    eq, found = equations, vary(equations)
    blocks = [
        [g.position for g in found.force],
        [g.velocity for g in found.force],
        [g.position for g in found.rhs],
        [g.velocity for g in found.rhs],
        [found.power.position],
        [found.power.velocity],
    ]
    parameters = [se.Symbol(name) for name in eq.model.parameters]
    entries = [x for rows in blocks for row in rows for x in row.values()]
    times = [g.time for g in (*found.force, *found.rhs, found.power)]
    tape = compile_tape(
        [*entries, *times], [TIME, *eq.q, *eq.v, *eq.a, *eq.multipliers], parameters
    )
    force_position, force_velocity, rhs_position, rhs_velocity = map(_pattern, blocks[:4])
    return Variation(
        force_position=force_position,
        force_velocity=force_velocity,
        rhs_position=rhs_position,
        rhs_velocity=rhs_velocity,
        power_position=tuple(found.power.position),
        power_velocity=tuple(found.power.velocity),
        tape=tape,
    )


def _pattern(rows: Iterable[Row]) -> Pattern:
    return tuple((i, j) for i, row in enumerate(rows) for j in row)
