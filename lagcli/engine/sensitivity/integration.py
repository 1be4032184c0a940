"""Integration of the motion with its derivatives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.contract import Block, IntegrationRequest, Outcome
from lagcli.engine.linear.blocks import Blocks
from lagcli.engine.sensitivity.augmented import with_derivatives
from lagcli.engine.sensitivity.start import StartDerivatives
from lagcli.engine.sensitivity.tangent import TangentTapes
from lagcli.engine.state import State
from lagcli.engine.system import System

if TYPE_CHECKING:
    from lagcli.engine.integrate.prepared import Prepared


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
        found = run.run()
        self._prepared = run.in_use
        return self._of_motion(found)

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
        multipliers, found = parts(block.multipliers, counts.nc)
        own = Block(block.time, q, v, a, multipliers, block.work)
        sink(own, Derivatives(dq, dv, da, self._unique(request, found)))

    def _unique(self, request: IntegrationRequest, found: Array) -> Array:
        """Return λ_θ with NaN for multipliers that are not unique."""
        if request.rank == self.blocks.counts.nc:
            return found
        from lagcli.engine.constraints.redundancy import dependent_sets

        every = range(self.blocks.counts.nc)
        for rows, _ in dependent_sets(self.system, request.state, request.rank, every):
            found[:, rows] = np.nan
        return found

    def _of_motion(self, found: Outcome) -> Outcome:
        """Return the outcome reduced to the motion."""
        nq, all_q = self.blocks.counts.nq, self.blocks.total.nq
        if found.undefined is not None:
            state = found.undefined
            found.undefined = State(state.t, state.q[:nq], state.v[:nq], state.p)
        if found.tolerances is not None:
            y = found.tolerances
            found.tolerances = np.concatenate([y[:nq], y[all_q : all_q + nq], y[-1:]])
        return found
