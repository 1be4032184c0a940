"""The motion and its derivatives as one System, which all methods integrate.

The coordinates are q and, for each direction θ, s = ∂q/∂θ; the multipliers λ and λ_θ. M and B of
each block are those of the motion,

    M a = f + Bᵀλ,  B a = γ,
    M s̈ = (G_q s + G_v ṡ + G_θ) + Bᵀλ_θ,  B s̈ = Γ_q s + Γ_v ṡ + Γ_θ,
    φ = 0,  φ_q s + φ_θ = 0,  ψ = 0,  B ṡ + ψ_q s + ψ_θ = 0.

The right sides of the derivatives depend on a and λ, which are computed first; the matrix is
factored once for all blocks. Projection and dense output apply to the derivatives as to the motion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial

import numpy as np

from lagcli.engine.layout import SampleLayout
from lagcli.engine.linear.blocks import Blocks, inputs_of
from lagcli.engine.sensitivity.tangent import TangentTapes
from lagcli.engine.system import JacobianTapes, Pattern, System, TangentBlocks
from lagcli.engine.tape.arithmetic import Arithmetic
from lagcli.engine.tape.tape import Tape


def with_derivatives(system: System, tangent: TangentTapes, names: Sequence[str]) -> System:
    """Return the System of the motion and its derivatives, in blocks that share a matrix.

    Parameters
    ----------
    system : System
        The motion.
    tangent : TangentTapes
        Its variational equations in n directions.
    names : sequence of n str
        Names of the directions.

    Returns
    -------
    System
        Its coordinates, constraints and holonomic constraints are those of the motion followed by
        those of each direction. It has no outputs and no events.
    """
    blocks = Blocks(system.counts, tangent.directions)
    nq, nc, n = blocks.counts.nq, blocks.counts.nc, tangent.directions
    every = range(n + 1)
    labels = [[f"d{x}/d{name}" for x in system.coordinates] for name in names]
    rows = [[f"d{x}/d{name}" for x in system.constraints] for name in names]
    variation = None
    if system.variation is not None:
        variation = partial(_block_diagonal, blocks, system.held, system.variation)
    return System(
        coordinates=(*system.coordinates, *(x for row in labels for x in row)),
        constraints=(*system.constraints, *(x for row in rows for x in row)),
        holonomic=tuple(k * nc + i for k in every for i in system.holonomic),
        parameters=system.parameters,
        functions=system.functions,
        mass_pattern=_repeated(system.mass_pattern, n, nq, nq),
        jacobian_pattern=_repeated(system.jacobian_pattern, n, nc, nq),
        dynamics=_dynamics_in_blocks(system, blocks),
        constraint=_constraint(system, tangent, blocks),
        report=Tape(SampleLayout(blocks.total).size - 1 + system.held, (), (), ()),
        variation=variation,
        same_unit=tuple(tuple(k * nq + j for j in g) for k in every for g in system.same_unit),
        tangent=TangentBlocks(system, n, tangent.dynamics),
    )


def _repeated(pattern: Pattern, n: int, rows: int, columns: int) -> Pattern:
    return tuple((k * rows + i, k * columns + j) for k in range(n + 1) for i, j in pattern)


def _dynamics_in_blocks(system: System, blocks: Blocks) -> Tape:
    """Return the dynamics of the motion with the entries of M and B of all blocks."""
    parameters, n = system.held, blocks.directions
    builder = Arithmetic(
        1 + 2 * blocks.total.nq + parameters, parameters, functions=system.functions
    )
    q, v, p = inputs_of(blocks, parameters)
    nq, nc = blocks.counts.nq, blocks.counts.nc
    out, of = (
        builder.splice(system.dynamics, [0, *q[:nq], *v[:nq], *p]),
        system.dynamics_layout,
    )
    return builder.finish(
        [
            *out[of.mass_matrix] * (n + 1),
            *out[of.forcing],
            *[builder.zero] * (n * nq),
            *out[of.jacobian] * (n + 1),
            *out[of.rhs],
            *[builder.zero] * (n * nc),
            *out[of.power],
        ]
    )


def _constraint(system: System, tangent: TangentTapes, blocks: Blocks) -> Tape:
    """Return the constraint tape of the augmented System."""
    parameters, n = system.held, blocks.directions
    nq, nc, nh = blocks.counts.nq, blocks.counts.nc, blocks.counts.nh
    builder = Arithmetic(
        1 + 2 * blocks.total.nq + parameters, parameters, functions=system.functions
    )
    q, v, p = inputs_of(blocks, parameters)
    own, of = (
        builder.splice(system.constraint, [0, *q[:nq], *v[:nq], *p]),
        system.constraint_layout,
    )
    sides = builder.splice(tangent.constraint, [0, *q, *v, *p])
    sizes = np.cumsum([n * nh, n * nc, n * nh])
    positions, drifts, position_scales, velocity_scales = (
        [*part] for part in _split(sides, sizes.tolist())
    )
    return builder.finish(
        [
            *own[of.position],
            *positions,
            *own[of.jacobian] * (n + 1),
            *own[of.drift],
            *drifts,
            *own[of.position_scale],
            *position_scales,
            *own[of.velocity_scale],
            *velocity_scales,
        ]
    )


def _split(values: list[int], ends: Iterable[int]) -> Iterable[list[int]]:
    first = 0
    for end in (*ends, len(values)):
        yield values[first:end]
        first = end


def _block_diagonal(
    blocks: Blocks, parameters: int, variation: Callable[[], JacobianTapes]
) -> JacobianTapes:
    """Return the Jacobians of each block with respect to itself.

    The derivatives of the right sides with respect to the motion are omitted: the Newton iteration
    of an implicit method converges without them, block by block, as in the simultaneous corrector
    of CVODES.

    References
    ----------
    R. Serban and A. C. Hindmarsh, CVODES: the sensitivity-enabled ODE solver in SUNDIALS (2005),
    doi:10.1115/DETC2005-85597.
    """
    own = variation()
    counts, total, n = blocks.counts, blocks.total, blocks.directions
    nq, nc = counts.nq, counts.nc
    layout = SampleLayout(total)
    builder = Arithmetic(layout.work.start + parameters, parameters, functions=own.tape.functions)
    places = range(builder.inputs)
    first = [
        *places[layout.t],
        *places[layout.q][:nq],
        *places[layout.v][:nq],
        *places[layout.a][:nq],
        *places[layout.multipliers][:nc],
        *places[layout.work.start :],
    ]
    out = builder.splice(own.tape, first)
    patterns = own.force_position, own.force_velocity, own.rhs_position, own.rhs_velocity
    sizes = np.cumsum([*map(len, patterns), len(own.power_position), len(own.power_velocity)])
    *matrices, power_position, power_velocity, times = _split(out, sizes.tolist())
    outputs = [x for part in matrices for x in part * (n + 1)]
    outputs += [*power_position, *power_velocity]
    outputs += [*times[:nq], *[builder.zero] * (n * nq)]
    outputs += [*times[nq : nq + nc], *[builder.zero] * (n * nc), *times[nq + nc :]]
    return JacobianTapes(
        force_position=_repeated(own.force_position, n, nq, nq),
        force_velocity=_repeated(own.force_velocity, n, nq, nq),
        rhs_position=_repeated(own.rhs_position, n, nc, nq),
        rhs_velocity=_repeated(own.rhs_velocity, n, nc, nq),
        power_position=own.power_position,
        power_velocity=own.power_velocity,
        tape=builder.finish(outputs),
        exact=False,
    )
