"""The motion and its derivatives as one System, which every engine and method integrates.

The coordinates are q and, for each direction θ, s = ∂q/∂θ; the multipliers λ and λ_θ. M and B of
each block are those of the motion,

    M a = f + Bᵀλ,  B a = γ,
    M s̈ = (G_q s + G_v ṡ + G_θ) + Bᵀλ_θ,  B s̈ = Γ_q s + Γ_v ṡ + Γ_θ,
    φ = 0,  φ_q s + φ_θ = 0,  ψ = 0,  B ṡ + ψ_q s + ψ_θ = 0.

The right sides of the derivatives depend on a and λ. They are found in the tape, by an elimination
that is written out there; equal operations are one, so that the matrix is factored once for all
blocks. Projection, error control and dense output apply to the derivatives as to the motion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from lagcli.engine.evaluator import Evaluator
from lagcli.engine.layout import (
    ConstraintLayout,
    Counts,
    DynamicsLayout,
    SampleLayout,
    UnrolledLayout,
)
from lagcli.engine.linear.elimination import Elimination
from lagcli.engine.linear.unrolling import unroll
from lagcli.engine.sensitivity.tangent import TangentTapes
from lagcli.engine.state import State
from lagcli.engine.system import JacobianTapes, Pattern, System
from lagcli.engine.tape.arithmetic import Arithmetic
from lagcli.engine.tape.tape import Tape


@dataclass(frozen=True, eq=False)
class Blocks:
    """Where the numbers of the motion and of each direction stand in an augmented System.

    Parameters
    ----------
    counts : Counts
        Of the motion alone.
    directions : int
    """

    counts: Counts
    directions: int

    @property
    def total(self) -> Counts:
        """The counts of the augmented System."""
        return Counts(*(x * (1 + self.directions) for x in self.counts))

    def coordinates(self, block: int) -> slice:
        """Return the places of a block among the coordinates; block 0 is the motion."""
        return slice(block * self.counts.nq, (block + 1) * self.counts.nq)

    def constraints(self, block: int) -> slice:
        """Return the places of a block among the constraints."""
        return slice(block * self.counts.nc, (block + 1) * self.counts.nc)


def augmented(
    system: System,
    tangent: TangentTapes,
    names: Sequence[str],
    elimination: Elimination,
    independent: Sequence[int],
) -> System:
    """Return the System of the motion and its derivatives.

    Parameters
    ----------
    system : System
        The motion.
    tangent : TangentTapes
        Its variational equations in n directions.
    names : sequence of n str
        Of the directions.
    elimination : Elimination
        Of ``with_constraints(system, independent)``, by which a and λ are found in the tape.
    independent : sequence of int
        Constraints of which none follows from the others: all of them, unless some are redundant.

    Returns
    -------
    System
        Coordinates, constraints and holonomic constraints are those of the motion and then those
        of each direction. It has no outputs and no events.
    """
    blocks = Blocks(system.counts, tangent.directions)
    nq, nc, n = blocks.counts.nq, blocks.counts.nc, tangent.directions
    every = range(n + 1)
    labels = [[f"d{x}/d{name}" for x in system.coordinates] for name in names]
    rows = [[f"d{x}/d{name}" for x in system.constraints] for name in names]
    constraints = (*system.constraints, *(x for row in rows for x in row))
    variation = None
    if system.variation is not None:
        variation = partial(_block_diagonal, blocks, system.held, system.variation)
    return System(
        coordinates=(*system.coordinates, *(x for row in labels for x in row)),
        constraints=constraints,
        holonomic=tuple(k * nc + i for k in every for i in system.holonomic),
        parameters=system.parameters,
        functions=system.functions,
        mass_pattern=_repeated(system.mass_pattern, n, nq, nq),
        jacobian_pattern=_repeated(system.jacobian_pattern, n, nc, nq),
        dynamics=_AugmentedDynamics(system, tangent, elimination, independent, blocks).tape(),
        constraint=_constraint(system, tangent, blocks),
        report=Tape(SampleLayout(blocks.total).size - 1 + system.held, (), (), ()),
        variation=variation,
        same_unit=tuple(tuple(k * nq + j for j in g) for k in every for g in system.same_unit),
    )


def repeated_elimination(elimination: Elimination, blocks: Blocks) -> Elimination:
    """Return the elimination of all blocks in the order of one."""
    n, nq, nc = blocks.directions, blocks.counts.nq, blocks.counts.nc
    size, all_q = nq + nc, blocks.total.nq

    def unknown(k: int, u: int) -> int:
        return k * nq + u if u < nq else all_q + k * nc + u - nq

    every = range(n + 1)
    return Elimination(
        tuple(unknown(k, u) for k in every for u in elimination.order),
        elimination.paired * (n + 1),
        tuple(tuple(k * size + i for i in column) for k in every for column in elimination.columns),
        elimination.smallest,
    )


def with_constraints(system: System, kept: Sequence[int]) -> System:
    """Return a System with some of its constraints alone; it has only dynamics."""
    if len(kept) == len(system.constraints):
        return system
    number = {i: row for row, i in enumerate(kept)}
    outputs, at = system.dynamics.outputs, DynamicsLayout(system.counts)
    entries = [
        (pair, x)
        for pair, x in zip(system.jacobian_pattern, outputs[at.jacobian], strict=True)
        if pair[0] in number
    ]
    rhs = outputs[at.rhs]
    return replace(
        system,
        constraints=tuple(system.constraints[i] for i in kept),
        holonomic=tuple(number[i] for i in system.holonomic if i in number),
        jacobian_pattern=tuple((number[i], j) for (i, j), _ in entries),
        dynamics=system.dynamics._replace(
            outputs=(
                *outputs[at.mass_matrix],
                *outputs[at.forcing],
                *(x for _, x in entries),
                *(rhs[i] for i in kept),
                *outputs[at.power],
            )
        ),
    )


def independent_constraints(system: System, state: State, rank: int) -> tuple[int, ...]:
    """Return constraints whose rows of B are independent at a state, as many as its rank."""
    nc = len(system.constraints)
    if rank == nc:
        return tuple(range(nc))
    from scipy.linalg import qr

    evaluator = Evaluator(system, state.p)
    c = evaluator.constraints(state.t, state.q, state.v)
    sizes = evaluator.sizes(state.t, state.q, state.v)
    lengths = evaluator.row_lengths(c, state.q, state.v, sizes)
    _, order = qr((c.jacobian * sizes / lengths[:, None]).T, mode="r", pivoting=True)
    return tuple(sorted(int(i) for i in order[:rank]))


def _repeated(pattern: Pattern, n: int, rows: int, columns: int) -> Pattern:
    return tuple((k * rows + i, k * columns + j) for k in range(n + 1) for i, j in pattern)


class _AugmentedDynamics(Arithmetic):
    """Emits the dynamics of the augmented System."""

    def __init__(
        self,
        system: System,
        tangent: TangentTapes,
        elimination: Elimination,
        independent: Sequence[int],
        blocks: Blocks,
    ):
        parameters = system.held
        super().__init__(
            1 + 2 * blocks.total.nq + parameters, parameters, functions=system.functions
        )
        self.system, self.tangent, self.blocks = system, tangent, blocks
        self.independent = list(independent)
        self.inner = with_constraints(system, independent)
        self.solved = unroll(self.inner, elimination)
        self.at = UnrolledLayout(self.inner.counts)

    def tape(self) -> Tape:
        system, blocks = self.system, self.blocks
        nq, nc, n = blocks.counts.nq, blocks.counts.nc, blocks.directions
        q, v, p = _inputs(blocks, self.parameters)
        state = [0, *q[:nq], *v[:nq]]
        out = self.splice(system.dynamics, [*state, *p])
        of = DynamicsLayout(system.counts)
        solution = self.solve([*state, *p])
        sides = self.splice(
            self.tangent.dynamics,
            [*state, *solution[:nq], *self.all_multipliers(solution), *q[nq:], *v[nq:], *p],
        )
        force, rhs = out[of.forcing], out[of.rhs]
        power = out[of.power][0]
        entries = list(zip(system.jacobian_pattern, out[of.jacobian], strict=True))
        for k in range(n):
            first = k * (nq + nc)
            own_force, own_rhs = sides[first : first + nq], sides[first + nq : first + nq + nc]
            force, rhs = force + own_force, rhs + own_rhs
            # the engine adds the power λ_θ·(B ṡ), which is none of the motion's
            found = self.all_multipliers(self.solve([*state, *p], own_force, own_rhs))
            for (i, j), b in entries:
                speed = self.times(b, v[(k + 1) * nq + j])
                power = self.minus(power, self.times(found[i], speed))
        return self.finish(
            [
                *out[of.mass_matrix] * (n + 1),
                *force,
                *out[of.jacobian] * (n + 1),
                *rhs,
                power,
            ]
        )

    def solve(
        self, inputs: Sequence[int], force: Sequence[int] = (), rhs: Sequence[int] = ()
    ) -> list[int]:
        """Emit a and λ of the independent constraints, for the motion or for another right side."""
        size = self.inner.counts.unknowns
        if not force:
            return self.splice(self.solved, inputs, range(*self.at.solution.indices(10**9)))
        given = [*inputs, *force, *(rhs[i] for i in self.independent)]
        first = len(self.solved.outputs) - self.solved.deferred[1] - self.solved.deferred[2]
        return self.splice(self.solved, given, range(first, first + size))

    def all_multipliers(self, solution: Sequence[int]) -> list[int]:
        """Return λ of all constraints: redundant ones have none."""
        found = [self.zero] * self.blocks.counts.nc
        for i, x in zip(self.independent, solution[self.blocks.counts.nq :], strict=True):
            found[i] = x
        return found


def _inputs(blocks: Blocks, parameters: int) -> tuple[list[int], list[int], list[int]]:
    """Return the inputs of the augmented System's tapes: q, v and the parameters."""
    nq = blocks.total.nq
    places = range(1 + 2 * nq + parameters)
    return [*places[1 : 1 + nq]], [*places[1 + nq : 1 + 2 * nq]], [*places[1 + 2 * nq :]]


def _constraint(system: System, tangent: TangentTapes, blocks: Blocks) -> Tape:
    """Return the constraint tape of the augmented System."""
    parameters, n = system.held, blocks.directions
    nq, nc, nh = blocks.counts.nq, blocks.counts.nc, blocks.counts.nh
    builder = Arithmetic(
        1 + 2 * blocks.total.nq + parameters, parameters, functions=system.functions
    )
    q, v, p = _inputs(blocks, parameters)
    own, of = (
        builder.splice(system.constraint, [0, *q[:nq], *v[:nq], *p]),
        ConstraintLayout(system.counts),
    )
    sides = builder.splice(tangent.constraint, [0, *q[:nq], *v[:nq], *q[nq:], *v[nq:], *p])
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

    What the derivatives' right sides owe to the motion is left out: the Newton iteration of an
    implicit method converges without it, one block after the other, as in the simultaneous
    corrector of CVODES.

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
