"""ψ = B v + b_0 as operations of the constraint tape."""

from __future__ import annotations

from lagcli.engine.arithmetic import Arithmetic
from lagcli.engine.system import System
from lagcli.engine.tape import Tape


def with_rates(system: System) -> Tape:
    """Append ψ (nc) to the constraint tape.

    Asked for alone are φ with its scale, and B, ψ and its scale.
    """
    given, nq, nc = system.constraint, len(system.coordinates), len(system.constraints)
    builder = Arithmetic(given.inputs, given.parameters)
    outputs = builder.extend(given)
    drift = len(system.holonomic) + len(system.jacobian_pattern)
    scale = drift + nc
    velocity_scale = scale + len(system.holonomic)
    rates = outputs[drift:scale]
    for (i, j), x in zip(system.jacobian_pattern, outputs[len(system.holonomic) :], strict=False):
        rates[i] = builder.plus(rates[i], builder.times(x, 1 + nq + j))
    end = velocity_scale + nc
    positions = [*range(len(system.holonomic)), *range(scale, velocity_scale)]
    velocities = [*range(len(system.holonomic), drift), *range(velocity_scale, end + nc)]
    return builder.finish([*outputs, *rates], alone=(tuple(positions), tuple(velocities)))
