"""Integration of the motion with its derivatives, in either engine."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.contract import Block, IntegrationRequest, Outcome
from lagcli.engine.evaluator import Batch, Evaluator
from lagcli.engine.integrate.engines import engine_named
from lagcli.engine.linear.elimination import Elimination, NoElimination, order_at
from lagcli.engine.sensitivity.augmented import (
    Blocks,
    augmented,
    independent_constraints,
    repeated_elimination,
    with_constraints,
)
from lagcli.engine.sensitivity.start import StartDerivatives
from lagcli.engine.sensitivity.tangent import TangentTapes
from lagcli.engine.state import State
from lagcli.engine.system import System
from lagcli.engine.tape.interpreter import run_arrays
from lagcli.settings.resolve import compiled_available

if TYPE_CHECKING:
    from lagcli.engine.integrate.prepared import Prepared


#: Samples of a block at which the reference engine's solution is checked, and the part of its terms
#: by which the equations of the derivatives may be missed there.
_CHECKED, _ALLOWED = 64, 1e-6
#: Times that a run may go on with another order of elimination.
_ORDERS = 20


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


class NoOrder(Exception):
    """No order of elimination suits the equations of the derivatives."""


@dataclass(frozen=True, eq=False)
class _Ready:
    """An augmented System, its elimination, and what a run made ready of it."""

    system: System
    elimination: Elimination
    prepared: Prepared | None = None


class TangentProblem:
    """A System and its variational equations, for many runs.

    Parameters
    ----------
    system : System
    tangent : TangentTapes
    names : sequence of str
        Of the directions.
    scales : (n,) array
        The tapes' derivatives are those with respect to θ / scale.
    many_runs : bool
        Whether to spend time on making runs fast, and to let the motion alone choose their steps:
        the derivatives are then those of the numerical solution, as exact as it is.
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
        self._states: list[State] = []
        self._kept: tuple[int, ...] | None = None
        self._ready: _Ready | None = None

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
            Of the motion. Absolute tolerances of derivatives follow their size.
        start : StartDerivatives
            With respect to θ / scale.
        sink : callable
            Takes the samples in blocks, in order.
        progress : callable, optional
            As in `lagcli.engine.contract.Engine`.

        Returns
        -------
        Outcome
            Of the motion: ``undefined`` and ``tolerances`` are its own.

        Raises
        ------
        NoOrder
        """
        ready = self._at(request)
        full = self._augmented_request(request, start, ready)
        emit = partial(self._emit, request, sink)
        if request.settings.engine != "compiled":
            found = engine_named("scipy")(ready.system, full, emit, progress)
            return self._of_motion(found)
        return self._compiled(full, emit, progress)

    def _compiled(
        self,
        full: IntegrationRequest,
        emit: Callable[[Block], None],
        progress: Callable[[float], None] | None,
    ) -> Outcome:
        """Run the compiled engine, and go on with another order where one does not suit."""
        from lagcli.engine.integrate.compiled_run import Integration

        class AugmentedTangent(Integration):
            """A run that stops where the order of elimination in the tape does not suit."""

            def reorder(self) -> None:
                self.collect()
                raise _Unsuited

        counts, work, rows = np.zeros(3, dtype=int), 0.0, 0
        methods: dict[str, None] = {}

        def take(block: Block) -> None:
            nonlocal rows
            rows += len(block.time)
            emit(block._replace(work=block.work + work) if work else block)

        for _ in range(_ORDERS):
            assert self._ready is not None
            run = AugmentedTangent(self._ready.system, full, take, progress)
            try:
                found = run.run()
            except _Unsuited:
                core, nq = run.core, self.blocks.total.nq
                counts += core.counts
                methods.update(dict.fromkeys(run.methods.used))
                y, work = core.state, work + core.state[-1]
                self._learn(run.evaluator, core.t, y)
                self._learn(run.evaluator, core.t_bad, core.y_bad)
                full = replace(
                    full,
                    state=State(core.t, y[:nq], y[nq : 2 * nq], full.state.p),
                    times=full.times[rows:],
                    settings=full.settings.replace(t_start=core.t),
                    elimination=self._order(full.rank),
                    prepared=self._ready.prepared,
                )
                rows = 0
                continue
            self._ready = replace(self._ready, prepared=run.in_use)
            counts += (found.steps, found.rejected, found.evaluations)
            found.steps, found.rejected, found.evaluations = counts.tolist()
            found.methods = (*dict.fromkeys((*methods, *found.methods)),)
            return self._of_motion(found)
        raise NoOrder

    def _learn(self, evaluator: Evaluator, t: float, y: Array) -> None:
        nq, all_q = self.blocks.counts.nq, self.blocks.total.nq
        self._states.append(State(t, y[:nq].copy(), y[all_q : all_q + nq].copy(), evaluator.p))

    def _at(self, request: IntegrationRequest) -> _Ready:
        """Return the augmented System for a start."""
        kept = independent_constraints(self.system, request.state, request.rank)
        if self._ready is None or kept != self._kept:
            self._kept, self._states = kept, [request.state]
            self._order(request.rank)
        assert self._ready is not None
        return self._ready

    def _order(self, rank: int) -> Elimination:
        """Find an order of elimination that suits all known states; make the System with it."""
        assert self._kept is not None
        inner = with_constraints(self.system, self._kept)
        evaluator = Evaluator(inner, self._states[0].p)
        try:
            found = order_at(inner, [evaluator.entries(s.t, s.q, s.v) for s in self._states])
        except NoElimination:
            raise NoOrder from None
        system = augmented(self.system, self.tangent, self.names, found, self._kept)
        full = repeated_elimination(found, self.blocks)
        prepared = None
        if self._many_runs and rank == self.blocks.counts.nc and compiled_available():
            from lagcli.engine.integrate.prepared import prepare, unrolled

            prepared = unrolled(system, prepare(system, full))
        self._ready = _Ready(system, full, prepared)
        return full

    def _augmented_request(
        self, request: IntegrationRequest, start: StartDerivatives, ready: _Ready
    ) -> IntegrationRequest:
        n, nq, state = self.blocks.directions, self.blocks.counts.nq, request.state
        given = request.tolerances
        # 0: by their size; of many runs, the steps are those of the motion alone
        followed = np.full(n * nq, np.inf if self._many_runs else 0.0)
        regular = request.rank == self.blocks.counts.nc
        return replace(
            request,
            state=State(
                state.t,
                np.concatenate([state.q, start.q.ravel()]),
                np.concatenate([state.v, start.v.ravel()]),
                state.p,
            ),
            rank=request.rank * (n + 1),
            atol=np.concatenate([given[:nq], followed, given[nq:-1], followed, given[-1:]]),
            # with respect to θ / scale, the derivative of a coordinate has its unit and its size
            kinds=request.kind_of * (n + 1),
            elimination=ready.elimination if regular else None,
            prepared=ready.prepared,
        )

    def _emit(self, request: IntegrationRequest, sink: Sink, block: Block) -> None:
        """Pass on a block of samples of the augmented System."""
        counts, n = self.blocks.counts, self.blocks.directions

        def parts(values: Array, size: int) -> tuple[Array, Array]:
            rest = values[:, size:].reshape(len(values), n, size).transpose(0, 2, 1)
            return np.ascontiguousarray(values[:, :size]), rest / self.scales

        q, dq = parts(block.q, counts.nq)
        v, dv = parts(block.v, counts.nq)
        a, da = parts(block.a, counts.nq)
        multipliers, found = parts(block.multipliers, counts.nc)
        own = Block(block.time, q, v, a, multipliers, block.work)
        if request.settings.engine != "compiled" and len(q):
            self._check(request, block)
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

    def _check(self, request: IntegrationRequest, block: Block) -> None:
        """Raise NoOrder where the tape's elimination has failed at a sample."""
        counts, n = self.blocks.counts, self.blocks.directions
        if request.rank < counts.nc:
            return
        nq, nc = counts.nq, counts.nc
        at = np.unique(np.linspace(0, len(block.time) - 1, _CHECKED).astype(int))
        t, q, v, a, x = (y[at] for y in (block.time, block.q, block.v, block.a, block.multipliers))
        p = request.state.p
        inputs: list[Any] = [
            t, *q.T[:nq], *v.T[:nq], *a.T[:nq], *x.T[:nc], *q.T[nq:], *v.T[nq:], *p
        ]  # fmt: skip
        sides = run_arrays(self.tangent.dynamics, inputs, len(at)).reshape(n, nq + nc, len(at))
        d = Batch(self.system, p, t, q[:, :nq], v[:, :nq]).dynamics()
        for k in range(n):
            inertial = np.einsum("ijt,tj->it", d.mass_matrix, a[:, self.blocks.coordinates(k + 1)])
            reaction = np.einsum("ijt,ti->jt", d.jacobian, x[:, self.blocks.constraints(k + 1)])
            size = sum(np.abs(y).max() for y in (inertial, reaction, sides[k, :nq]))
            if np.abs(inertial - reaction - sides[k, :nq]).max() > _ALLOWED * size:
                raise NoOrder

    def _of_motion(self, found: Outcome) -> Outcome:
        """Return an outcome with the parts that are of the motion."""
        nq, all_q = self.blocks.counts.nq, self.blocks.total.nq
        if found.undefined is not None:
            state = found.undefined
            found.undefined = State(state.t, state.q[:nq], state.v[:nq], state.p)
        if found.tolerances is not None:
            y = found.tolerances
            found.tolerances = np.concatenate([y[:nq], y[all_q : all_q + nq], y[-1:]])
        return found


class _Unsuited(Exception):
    """Ends a run whose order of elimination does not suit the state reached."""
