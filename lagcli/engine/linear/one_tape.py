"""The motion and its derivatives in one tape, for power series.

A run computes a and λ before the right sides of the derivatives, which depend on them. A power
series needs all of it in one tape: a and λ are computed there by an unrolled elimination; equal
operations are merged, so that the matrix is factored once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from lagcli.engine.layout import Blocks, UnrolledLayout, inputs_of
from lagcli.engine.linear.elimination import Elimination, unroll
from lagcli.engine.system import System, TangentBlocks
from lagcli.engine.tape.tape import Arithmetic, Tape


def in_one_tape(system: System, elimination: Elimination) -> tuple[System, Tape]:
    """Return a System with derivatives as one without, and its tape with the elimination.

    Parameters
    ----------
    system : System
        System from `lagcli.engine.sensitivity.integration.with_derivatives`.
    elimination : Elimination
        Elimination of the motion.

    Returns
    -------
    System
        A System whose dynamics include f and γ of the derivatives.
    Tape
        Result of `unroll`.
    """
    assert system.tangent is not None
    blocks = Blocks(system.motion.counts, system.tangent.directions)
    dynamics = _WholeDynamics(system.tangent, elimination, blocks).tape()
    whole = replace(system, dynamics=dynamics, tangent=None)
    return whole, unroll(whole, repeated_elimination(elimination, blocks))


def repeated_elimination(elimination: Elimination, blocks: Blocks) -> Elimination:
    """Return the elimination of all blocks, in the order of a single one."""
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


class _WholeDynamics(Arithmetic):
    """Emits the dynamics of the motion and its derivatives."""

    def __init__(self, tangent: TangentBlocks, elimination: Elimination, blocks: Blocks):
        system = tangent.motion
        parameters = system.held
        super().__init__(
            1 + 2 * blocks.total.nq + parameters, parameters, functions=system.functions
        )
        self.system, self.tangent, self.blocks = system, tangent, blocks
        self.solved = unroll(system, elimination)

    def tape(self) -> Tape:
        system, blocks = self.system, self.blocks
        nq, nc, n = blocks.counts.nq, blocks.counts.nc, blocks.directions
        q, v, p = inputs_of(blocks, self.parameters)
        state = [0, *q[:nq], *v[:nq]]
        out = self.splice(system.dynamics, [*state, *p])
        of = system.dynamics_layout
        solution = self.solve([*state, *p])
        sides = self.splice(
            self.tangent.tape,
            [0, *q, *v, *solution[:nq], *solution[nq:], *p],
        )
        force, rhs = out[of.forcing], out[of.rhs]
        power = out[of.power][0]
        entries = list(zip(system.jacobian_pattern, out[of.jacobian], strict=True))
        for k in range(n):
            first = k * (nq + nc)
            own_force, own_rhs = sides[first : first + nq], sides[first + nq : first + nq + nc]
            force, rhs = force + own_force, rhs + own_rhs
            # the engine adds the power λ_θ·(B ṡ), which is not part of the motion's power
            multipliers = self.solve([*state, *p], own_force, own_rhs)[nq:]
            for (i, j), b in entries:
                speed = self.times(b, v[(k + 1) * nq + j])
                power = self.minus(power, self.times(multipliers[i], speed))
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
        """Emit a and λ of the motion, or the solution for another right side."""
        counts = self.system.counts
        if not force:
            places = UnrolledLayout(counts).solution.indices(len(self.solved.outputs))
            return self.splice(self.solved, inputs, range(*places))
        first = len(self.solved.outputs) - self.solved.deferred[1] - self.solved.deferred[2]
        outputs = range(first, first + counts.unknowns)
        return self.splice(self.solved, [*inputs, *force, *rhs], outputs)
