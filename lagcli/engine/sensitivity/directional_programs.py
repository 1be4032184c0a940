"""Programs of directional derivatives of a System that switches, for the core."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

from lagcli.arrays import Array
from lagcli.engine.program.program import Program, assemble
from lagcli.engine.switching.kinks import FrozenSystem
from lagcli.engine.switching.splitting import SplitSystem
from lagcli.engine.tape.differentiation import directional
from lagcli.engine.tape.tape import Builder, Tape


class DirectionalPrograms(NamedTuple):
    """What the core differentiates a motion with; see ``lag_directions`` in core/lagcore.h.

    Parameters
    ----------
    parameters : (n, np) array
        Derivatives of the System's parameters, including branches, which do not change.
    decides : tuple of bool
        For each condition, whether an event with actions depends on it.
    dynamics, constraint, functions, limits, impact, forces, conditions, force_conditions, kinks,
    kink_rates : Program
    """

    parameters: Array
    decides: tuple[bool, ...]
    dynamics: Program
    constraint: Program
    functions: Program
    limits: Program
    impact: Program
    forces: Program
    conditions: Program
    force_conditions: Program
    kinks: Program
    kink_rates: Program


@lru_cache(maxsize=4)
def _programs(split: SplitSystem, frozen: FrozenSystem | None) -> tuple[Program, ...]:
    """Return the programs from ``dynamics`` on; cached for many runs."""
    fixed, switching, system = split.fixed, split.switching, split.system
    d, c, rows = fixed.dynamics_layout, fixed.constraint_layout, len(split.rows)
    holonomic = sum(place >= 0 for place in split.places)
    of_rows = range(holonomic + len(split.pattern) + 2 * rows)
    limited = 2 * sum(row.limit is not None for row in switching.rows)
    state, forces = 1 + 2 * len(system.coordinates), len(system.constraints)
    forces += state + len(system.coordinates)
    held = system.dynamics.parameters
    # with the inputs of any other
    nothing = Tape(2 * (forces + held) + state, (), (), (), held)

    def along(tape: Tape | None, inputs: int) -> Program:
        if tape is None or not tape.outputs:
            return assemble(nothing)
        return assemble(arranged(directional(tape), inputs))

    matrices = [
        *range(d.mass_matrix.start, d.mass_matrix.stop),
        *range(d.forcing.start, d.forcing.stop),
        *range(d.jacobian.start, d.jacobian.stop),
        *range(d.rhs.start, d.rhs.stop),
    ]
    constraints = [
        *range(c.position.start, c.position.stop),
        *range(c.jacobian.start, c.jacobian.stop),
        *range(c.drift.start, c.drift.stop),
    ]
    some, kinks = switching.forces, None
    if some is not None:
        some = some.selected(range(len(switching.force_coordinates)))
    if frozen is not None:
        kinks = frozen.functions.selected(range(len(frozen.kinks)))
    return (
        along(fixed.dynamics.selected(matrices), state),
        along(fixed.constraint.selected(constraints), state),
        along(split.functions.selected(of_rows) if rows else None, state),
        along(switching.limits.selected(range(limited)), forces),
        along(switching.impact, state),
        along(some, forces),
        along(system.events, state),
        along(switching.force_conditions, forces),
        along(kinks, state),
        assemble(_rates(kinks, state)) if kinks is not None else assemble(nothing),
    )


def directional_programs(
    split: SplitSystem, frozen: FrozenSystem | None, parameters: Array
) -> DirectionalPrograms:
    """Return the programs of a System.

    Parameters
    ----------
    split : SplitSystem
    frozen : FrozenSystem or None
        If the System has branches.
    parameters : (n, np) array
        Derivatives of the System's parameters.
    """
    rules = split.switching.events
    acting = {
        rule.condition
        for rule in rules
        if rule.targets or rule.impulses or rule.release or rule.engage or rule.stop
    }
    tapes = split.system.events, split.switching.force_conditions
    count = sum(len(tape.outputs) for tape in tapes if tape is not None)
    decides = tuple(k in acting for k in range(count))
    return DirectionalPrograms(parameters, decides, *_programs(split, frozen))


def arranged(tape: Tape, state: int) -> Tape:
    """Return the derivative of a tape with other inputs: the parameters after all else.

    Parameters
    ----------
    tape : Tape
        Of (x, p, their changes), p the parameters: the result of `directional`.
    state : int
        Number of x.

    Returns
    -------
    Tape
        Of (x, its changes, those of p, p).
    """
    pieces = tape.functions.size
    given = (tape.inputs - pieces) // 2
    p = given - state
    builder = Builder(2 * given + pieces, p + pieces, functions=tape.functions)
    last = 2 * state + p
    return builder.finish(
        builder.splice(
            tape,
            [
                *range(state),
                *range(last, last + p),
                *range(state, 2 * state),
                *range(2 * state, last),
                *range(last + p, builder.inputs),
            ],
        )
    )


def _rates(tape: Tape, state: int) -> Tape:
    """Return the rates of a tape's outputs along a motion, and the changes of these.

    Returns
    -------
    Tape
        Of (t, q, v; their rates; their changes; the changes of p; those of the rates of q and v;
        p).
    """
    first = directional(tape)
    second = directional(first)
    pieces = tape.functions.size
    p = tape.inputs - pieces - state
    parts = (state, state, state, p, state - 1, p, pieces)
    builder = Builder(sum(parts), p + pieces, functions=tape.functions)
    places, start = [], 0
    for count in parts:
        places.append([*range(start, start + count)])
        start += count
    x, rates, changes, of_p, of_rates, parameters, rest = places
    zero = builder.constant(0.0)
    along = [*x, *parameters, *rates, *[zero] * p]
    of_along = [*changes, *of_p, zero, *of_rates, *[zero] * p]
    return builder.finish(
        [
            *builder.splice(first, [*along, *rest]),
            *builder.splice(second, [*along, *of_along, *rest]),
        ]
    )
