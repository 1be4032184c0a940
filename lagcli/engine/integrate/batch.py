"""Batches: many runs of one System, eight at a time.

The core integrates eight runs through one stream of operations, each in a lane (one slot of the
vector registers) with its own parameters, state, time and step size; a lane whose run ends takes
the next. A run that requires a decision (undefined values, a singular configuration ahead,
stiffness, an inaccurate elimination, limits) leaves its lane;
`lagcli.engine.integrate.engine` then repeats it from its initial state. The results of a
run do not depend on the other runs of the batch, to the last bit.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from lagcli.arrays import Array, Indices
from lagcli.engine.contract import Block, IntegrationRequest, Interrupted, Outcome
from lagcli.engine.core.batch import LANES, BatchIntegrator, BatchTable
from lagcli.engine.core.program import assemble
from lagcli.engine.core.status import LaneStatus, Status
from lagcli.engine.integrate.engine import integrate, switches
from lagcli.engine.integrate.prepared import Prepared, unrolled
from lagcli.engine.integrate.run import Integration
from lagcli.engine.system import State, System
from lagcli.engine.tape.tape import Tape

#: Time after which the core returns, s, and the number of step attempts of the first call.
_SLICE = 0.03
_FIRST_SLICE = 16
_GROWTH = 4
#: Largest number of runs with samples in memory besides those in the lanes, and of their values.
_HELD = 24
_MOST_NUMBERS = 1 << 25


class Finished(NamedTuple):
    """Completed runs.

    Parameters
    ----------
    rows : (k,) array of int
        Indices of the runs.
    samples : (k, nt, width) array
        Sample rows, as in `SampleLayout`: all of ``request.times``; for a failed run, if k is 1,
        those up to its end.
    runs : list of k Run
        Outcome of each run.
    """

    rows: Indices
    samples: Array
    runs: list[Outcome]


def prepare_batch(
    system: System, request: IntegrationRequest, progress: Callable[[], None] | None = None
) -> Prepared:
    """Return the preparation of batches: an order of elimination that suits one complete run.

    Parameters
    ----------
    system, request
        A representative run. It is integrated for this, without samples.
    progress : callable, optional
        As for `run_batch`.
    """
    check_cancelled = progress or (lambda: None)
    request = request._replace(times=np.empty(0))
    integration = Integration(
        system, request, lambda block: None, lambda t: check_cancelled(), for_batch=True
    )
    if integration.run().status == "interrupted":
        raise Interrupted
    prepared = unrolled(system, integration.in_use)
    if integration.redundant and prepared.plain is None:
        # for the runs that leave: single runs of small systems solve densely
        prepared = prepared._replace(plain=assemble(system.dynamics, system.families))
    return prepared


def run_batch(
    system: System,
    request: IntegrationRequest,
    parameters: Array,
    q: Array,
    v: Array,
    sink: Callable[[Finished], None],
    progress: Callable[[], None] | None = None,
) -> None:
    """Integrate many runs; each is emitted once, in any order.

    May be called by several threads: the core releases the interpreter's lock.

    Parameters
    ----------
    system : System
    request : Request
        Common part of all runs; of its ``state``, only the time is used. Its ``rank`` must be that
        of all runs. Without ``prepared``, from `prepare_batch`, batches are not used: with a given
        order of elimination, the result of a run depends only on itself.
    parameters : (n, np) array
        Parameters of each run.
    q, v : (n, nq) arrays
        Consistent initial states; see `lagcli.engine.constraints.initial_batch`.
    sink : callable
        Takes the completed runs, at most a few dozen at a time. An exception raised here ends all
        runs and propagates to the caller.
    progress : callable, optional
        Called at least every 0.05 s, as far as single steps allow. May raise `Interrupted`, which
        propagates to the caller; active runs are lost.
    """
    rest: Iterable[int] = range(len(parameters))
    check_cancelled = progress or (lambda: None)
    if len(parameters) and suits_batch(system, request):
        batch = _BatchRuns(system, request, parameters, q, v)
        batch.run(sink, check_cancelled)
        rest = batch.left()
    for row in rest:
        sink(_singly(system, request, parameters, q, v, row, check_cancelled))


def suits_batch(system: System, request: IntegrationRequest) -> bool:
    """Return whether runs can be integrated in batches; otherwise they are integrated one by one.

    Not supported are implicit methods, Baumgarte's stabilization, contacts, events, kinks, breaks,
    functions of time, constraints nonlinear in the velocities, an elimination that is not unrolled,
    or that is of another rank, or samples that would fill the memory.
    """
    width = system.sample_layout.size
    prepared = request.prepared
    return (
        prepared is not None
        and prepared.unrolled
        and prepared.elimination is not None
        and len(prepared.elimination.order) == len(system.coordinates) + request.rank
        and request.settings.method in ("auto", "DOP853")
        and request.settings.formulation == "projection"
        and not len(request.breaks)
        and not (switches(system) or system.nonlinear)
        and not system.functions.functions
        and width * len(request.times) * (LANES + 1) <= _MOST_NUMBERS
    )


class _BatchRuns:
    """The core with the runs of a batch."""

    def __init__(
        self, system: System, request: IntegrationRequest, parameters: Array, q: Array, v: Array
    ):
        prepared = request.prepared
        assert prepared is not None
        self.request, self.steps = request, ("DOP853",) if request.settings.method == "auto" else ()
        first = _of_row(request, parameters, q, v, 0)
        # in the common order, whatever that of the first one is
        first = first._replace(elimination=prepared.elimination)
        single = Integration(system, first, lambda block: None, None, for_batch=True)
        width = system.sample_layout.size
        held = min(_HELD, _MOST_NUMBERS // (width * max(1, len(request.times))) - LANES)
        self.core = BatchIntegrator(
            single.core,
            prepared.dynamics,
            prepared.constraint,
            request.times,
            parameters,
            np.hstack([q, v]),
            LANES + held,
        )
        self.began: dict[int, float] = {}

    def run(self, sink: Callable[[Finished], None], check_cancelled: Callable[[], None]) -> None:
        """Integrate the runs, except for those that leave."""
        core, tries = self.core, _FIRST_SLICE
        status: int = Status.RUNNING
        while status != Status.DONE:
            check_cancelled()
            started = time.monotonic()
            status = core.advance(tries)
            taken = time.monotonic() - started
            if status == Status.RUNNING:
                tries = max(1, min(_GROWTH * tries, int(tries * _SLICE / max(taken, 1e-6))))
            rows, samples = core.take()
            if len(rows):
                sink(Finished(rows, samples, [self.record(row) for row in rows]))
            if self.request.settings.timeout < math.inf:
                self.let_leave(self.request.settings.timeout)

    def record(self, row: int) -> Outcome:
        """Return the statistics of a run."""
        steps, rejected, evaluations = self.core.counts[row].tolist()
        return Outcome("completed", "", steps, rejected, evaluations, methods=self.steps)

    def let_leave(self, timeout: float) -> None:
        """Remove runs that have been active for too long."""
        now = time.monotonic()
        under_way = self.core.under_way()
        self.began = {row: self.began.get(row, now) for row in under_way if row >= 0}
        for lane, row in enumerate(under_way):
            if row >= 0 and now - self.began[row] > timeout:
                self.core.leave(lane)

    def left(self) -> list[int]:
        """Return the runs that have left the lanes."""
        runs: list[int] = np.flatnonzero(self.core.status == LaneStatus.LEFT).tolist()
        return runs


def _of_row(
    request: IntegrationRequest, parameters: Array, q: Array, v: Array, row: int
) -> IntegrationRequest:
    """Return the request of one run."""
    state = State(request.state.t, q[row].copy(), v[row].copy(), tuple(parameters[row].tolist()))
    return request._replace(state=state, elimination=None)


def _singly(
    system: System,
    request: IntegrationRequest,
    parameters: Array,
    q: Array,
    v: Array,
    row: int,
    check_cancelled: Callable[[], None],
) -> Finished:
    """Integrate a single run."""
    blocks: list[Block] = []
    run = integrate(
        system, _of_row(request, parameters, q, v, row), blocks.append, lambda t: check_cancelled()
    )
    if run.status == "interrupted":
        raise Interrupted
    width = system.sample_layout.size
    rows = np.concatenate([np.empty((0, width)), *map(np.column_stack, blocks)])
    return Finished(np.array([row]), rows[None], [run])


class SampleTape:
    """A tape evaluated at the samples of many runs, eight at a time; not thread-safe.

    Parameters
    ----------
    tape : Tape
        Tape whose inputs are the first entries of a sample (of t, q, v, a, λ, W, as many as it has
        inputs), then the parameters.
    """

    def __init__(self, tape: Tape):
        self._table = BatchTable(assemble(tape, long=None), tape.inputs, tape.parameters)

    def __call__(self, samples: Array, parameters: Array) -> Array:
        """Return the outputs, (runs, outputs, nt).

        Parameters
        ----------
        samples : (runs, nt, width) array
        parameters : (runs, np) array
        """
        out: Array = self._table(samples, parameters)
        return out
