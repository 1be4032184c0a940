"""The constraints with their rates ψ = B v + b_0, as the core evaluates them."""

from __future__ import annotations

from functools import lru_cache

from lagcli.engine.core.program import Program, assemble
from lagcli.engine.layout import RatesLayout
from lagcli.engine.system import System
from lagcli.engine.tape.tape import Arithmetic, Tape


def with_rates(system: System) -> Tape:
    """Append ψ (nc) to the constraint tape.

    Output subsets are φ with its scale, and B, ψ and its scale.
    """
    given, layout = system.constraint, system.constraint_layout
    v = system.sample_layout.v.start
    builder = Arithmetic(given.inputs, given.parameters, functions=given.functions)
    outputs = builder.extend(given)
    rates = outputs[layout.drift]
    for (i, j), x in zip(system.jacobian_pattern, outputs[layout.jacobian], strict=True):
        rates[i] = builder.plus(rates[i], builder.times(x, v + j))
    extended, places = RatesLayout(system.counts), range(len(outputs) + len(rates))
    positions = *places[layout.position], *places[layout.position_scale]
    velocities = (
        *places[layout.jacobian],
        *places[layout.velocity_scale],
        *places[extended.velocity],
    )
    return builder.finish([*outputs, *rates], output_subsets=(positions, velocities))


@lru_cache(maxsize=4)
def constraint_program(system: System) -> Program:
    """Return the program of a System's constraints with their rates."""
    return assemble(with_rates(system), system.families)
