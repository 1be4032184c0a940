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
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.contract import Block, IntegrationRequest, Outcome
from lagcli.engine.layout import Blocks, SampleLayout, inputs_of
from lagcli.engine.lowering.tangent import TangentTapes
from lagcli.engine.sensitivity.start import StartDerivatives
from lagcli.engine.system import JacobianTapes, Pattern, State, System, TangentBlocks
from lagcli.engine.tape.tape import Arithmetic, Tape

if TYPE_CHECKING:
    from lagcli.engine.integrate.prepared import Prepared


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


class Derivatives(NamedTuple):
    """Derivatives of consecutive samples with respect to n directions.

    Parameters
    ----------
    q, v, a : (nt, nq, n) arrays
    multipliers : (nt, nc, n) array
    """

    q: Array
    v: Array
    a: Array
    multipliers: Array


Sink = Callable[[Block, Derivatives], None]


class TangentProblem:
    """A System and its variational equations, for many runs.

    Parameters
    ----------
    system : System
    tangent : TangentTapes
    names : sequence of str
        Names of the directions.
    scales : (n,) array
        The tapes' derivatives are those with respect to θ / scale.
    many_runs : bool
        Whether to optimize for many runs, and to control the steps by the motion only: the
        derivatives are then those of the numerical solution, and as accurate as it is.
    """

    def __init__(
        self,
        system: System,
        tangent: TangentTapes,
        names: Sequence[str],
        scales: Array,
        *,
        many_runs: bool = False,
    ):
        self.system, self.tangent = system, tangent
        self.names, self.scales = tuple(names), scales
        self._many_runs = many_runs
        self.blocks = Blocks(system.counts, tangent.directions)
        self.whole = with_derivatives(system, tangent, names)
        self._prepared: Prepared | None = None

    def integrate(
        self,
        request: IntegrationRequest,
        start: StartDerivatives,
        sink: Sink,
        progress: Callable[[float], None] | None = None,
    ) -> Outcome:
        """Integrate the motion with its derivatives.

        Parameters
        ----------
        request : IntegrationRequest
            Request of the motion. Absolute tolerances of derivatives follow their size.
        start : StartDerivatives
            With respect to θ / scale.
        sink : callable
            Takes the samples in blocks, in order.
        progress : callable, optional
            As in `lagcli.engine.integrate.engine.integrate`.

        Returns
        -------
        Outcome
            For the motion only, including ``undefined`` and ``tolerances``.
        """
        full = self._whole_request(request, start)
        emit = partial(self._emit, request, sink)
        from lagcli.engine.integrate.prepared import unrolled
        from lagcli.engine.integrate.run import Integration

        run = Integration(self.whole, full, emit, progress)
        if self._many_runs and run.in_use.worth_unrolling:
            run.use(unrolled(self.whole, run.in_use))
        outcome = run.run()
        self._prepared = run.in_use
        return self._of_motion(outcome)

    def _whole_request(
        self, request: IntegrationRequest, start: StartDerivatives
    ) -> IntegrationRequest:
        n, nq, state = self.blocks.directions, self.blocks.counts.nq, request.state
        given, own = request.tolerances, request.kind_of
        # 0: by their size; with many runs, the steps are those of the motion
        followed = np.full(n * nq, np.inf if self._many_runs else 0.0)
        return request._replace(
            state=State(
                state.t,
                np.concatenate([state.q, start.q.ravel()]),
                np.concatenate([state.v, start.v.ravel()]),
                state.p,
            ),
            rank=request.rank * (n + 1),
            atol=np.concatenate([given[:nq], followed, given[nq:-1], followed, given[-1:]]),
            # with respect to θ / scale, the derivative of a coordinate has its unit and its size
            kinds=(*own, *[max(own, default=0) + 1 + kind for kind in own] * n),
            # another order is determined if that of the last run is not suitable
            elimination=self._prepared.elimination if self._prepared else None,
            prepared=self._prepared,
        )

    def _emit(self, request: IntegrationRequest, sink: Sink, block: Block) -> None:
        """Forward a block of samples of the augmented System."""
        counts, n = self.blocks.counts, self.blocks.directions

        def parts(values: Array, size: int) -> tuple[Array, Array]:
            rest = values[:, size:].reshape(len(values), n, size).transpose(0, 2, 1)
            return np.ascontiguousarray(values[:, :size]), rest / self.scales

        q, dq = parts(block.q, counts.nq)
        v, dv = parts(block.v, counts.nq)
        a, da = parts(block.a, counts.nq)
        multipliers, derivatives = parts(block.multipliers, counts.nc)
        own = Block(block.time, q, v, a, multipliers, block.work)
        sink(own, Derivatives(dq, dv, da, self._unique(request, derivatives)))

    def _unique(self, request: IntegrationRequest, multipliers: Array) -> Array:
        """Return λ_θ with NaN for multipliers that are not unique."""
        if request.rank == self.blocks.counts.nc:
            return multipliers
        from lagcli.engine.constraints.initial import dependent_sets

        every = range(self.blocks.counts.nc)
        for rows, _ in dependent_sets(self.system, request.state, request.rank, every):
            multipliers[:, rows] = np.nan
        return multipliers

    def _of_motion(self, outcome: Outcome) -> Outcome:
        """Return the outcome reduced to the motion."""
        nq, all_q = self.blocks.counts.nq, self.blocks.total.nq
        if outcome.undefined is not None:
            state = outcome.undefined
            outcome.undefined = State(state.t, state.q[:nq], state.v[:nq], state.p)
        if outcome.tolerances is not None:
            y = outcome.tolerances
            outcome.tolerances = np.concatenate([y[:nq], y[all_q : all_q + nq], y[-1:]])
        return outcome
