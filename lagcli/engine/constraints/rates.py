"""ψ = B v + b_0 as operations of the constraint tape."""

from __future__ import annotations

from lagcli.engine.system import System
from lagcli.engine.tape.arithmetic import Arithmetic
from lagcli.engine.tape.tape import Tape


def with_rates(system: System) -> Tape:
    """Append ψ (nc) to the constraint tape.

    Asked for alone are φ with its scale, and B, ψ and its scale.
    """
    given, nq, nc = system.constraint, len(system.coordinates), len(system.constraints)
    nh, nb = len(system.holonomic), len(system.jacobian_pattern)
    builder = Arithmetic(given.inputs, given.parameters)
    outputs = builder.extend(given)
    drift, scales = nh + nb, nh + nb + nc
    rates = outputs[drift:scales]
    for (i, j), x in zip(system.jacobian_pattern, outputs[nh:], strict=False):
        rates[i] = builder.plus(rates[i], builder.times(x, 1 + nq + j))
    positions = *range(nh), *range(scales, scales + nh)
    velocities = *range(nh, drift), *range(scales + nh, scales + nh + 2 * nc)
    return builder.finish([*outputs, *rates], alone=(positions, velocities))
