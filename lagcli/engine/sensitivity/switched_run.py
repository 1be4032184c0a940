"""Runs of the core that differentiate a motion with contacts, friction, events and kinks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cached_property
from typing import Any

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.constraints.adjustment import adjusted
from lagcli.engine.constraints.initial import NoConsistentState
from lagcli.engine.contract import Block, EventEntry, IntegrationRequest, Outcome
from lagcli.engine.core.switching import SwitchingIntegrator
from lagcli.engine.integrate.switching_actions import Actions
from lagcli.engine.integrate.switching_run import SwitchingIntegration
from lagcli.engine.program.program import Program
from lagcli.engine.sensitivity.directional_programs import directional_programs
from lagcli.engine.sensitivity.integration import Derivatives, Sink
from lagcli.engine.sensitivity.losses import why_lost
from lagcli.engine.sensitivity.start import StartDerivatives
from lagcli.engine.switching.switching import EventRule
from lagcli.engine.system import System
from lagcli.engine.tape.differentiation import directional
from lagcli.engine.tape.interpreter import ScalarTape

#: The method that takes the steps: others have no derivatives of rows that hold or slip.
METHOD = "DOP853"
#: Weights and step of central differences of sixth order.
_WEIGHTS, _STEP = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}, 1e-4


class DifferentiatedIntegration(SwitchingIntegration):
    """A run with its derivatives.

    Parameters
    ----------
    system : System
    request : IntegrationRequest
    start : StartDerivatives
        Derivatives of the initial q and v, (n, nq).
    parameters : (n, np) array
        Derivatives of the parameters.
    names : sequence of n str
        Names of the directions, for messages.
    scales : (n,) array
        Emitted derivatives are divided by these.
    sink : callable
        Receives blocks of samples, with their derivatives.
    progress : callable, optional
    """

    def __init__(
        self,
        system: System,
        request: IntegrationRequest,
        start: StartDerivatives,
        parameters: Array,
        names: Sequence[str],
        scales: Array,
        sink: Sink,
        progress: Callable[[float], None] | None,
    ):
        self._start, self._parameters = start, parameters
        self._names, self._scales, self._emit_both = tuple(names), scales, sink
        #: Derivatives of the times of the log's entries.
        self._times: list[Array] = []
        request = request._replace(settings=request.settings.replace(method=METHOD))
        super().__init__(system, request, self._nowhere, progress)
        count = len(self.split_system.system.parameters)
        self.actions = DifferentiatedActions(self.whole, request, self.core, count, self._times)

    @staticmethod
    def _nowhere(block: Block) -> None:
        """Receive samples without derivatives: there are none."""

    def start_changes(self) -> Array | None:
        """Return the derivatives of q and v at the start, (n, 2 nq)."""
        return np.hstack([self._start.q, self._start.v])

    def integrator(self, constraint: Program, settings: dict[str, Any]) -> SwitchingIntegrator:
        """Return a core that differentiates."""
        given, system = self._parameters, self.split_system.system
        branches = np.zeros((len(given), len(system.parameters) - given.shape[1]))
        parameters = np.hstack([given, branches])
        core = super().integrator(constraint, settings)
        core.use_directions(directional_programs(self.split_system, self.frozen, parameters))
        return core

    def run(self) -> Outcome:
        """Integrate, once."""
        found = super().run()
        n = len(self._scales)
        found.event_changes = np.array(self._times).reshape(len(self._times), n) / self._scales
        found.notes = (*found.notes, *self._notes())
        return found

    def _notes(self) -> list[str]:
        """Say which directions have lost their derivatives, where and why."""
        told: dict[tuple[float, str], list[str]] = {}
        for direction, t, reason, culprits in self.core.losses:
            why = why_lost(self.split_system, self.frozen, reason, culprits)
            told.setdefault((t, why), []).append(f"`{self._names[direction]}`")
        return [
            f"derivatives by {', '.join(names)} end at t = {t:.9g} s: {why}"
            for (t, why), names in sorted(told.items())
        ]

    # samples

    def emit(self, rows: Array) -> None:
        """Emit samples and their derivatives."""
        nq, nc, n = self.nq, len(self.whole.constraints), len(self._scales)
        plain = rows.shape[1] - n * (3 * nq + nc)
        found = rows[:, plain:].reshape(len(rows), n, 3 * nq + nc).transpose(0, 2, 1) / self._scales
        parts = np.split(found, [nq, 2 * nq, 3 * nq], axis=1)
        block = Block.of_rows(self.whole_rows(rows), self.whole.sample_layout)
        self._emit_both(block, Derivatives(*map(np.ascontiguousarray, parts)))

    def whole_rows(self, rows: Array) -> Array:
        """Return sample rows of the System; see the base class."""
        n = len(self._scales)
        plain = rows.shape[1] - n * (3 * self.nq + len(self.whole.constraints))
        return super().whole_rows(rows[:, :plain])

    def entries(self, rows: Array) -> list[EventEntry]:
        """Return entries of the core's log, one for each row."""
        if not len(rows):
            return []
        n = len(self._scales)
        self._times += [*rows[:, -n:]]
        return super().entries(rows[:, :-n])

    def log_end(self, status: int) -> None:
        """Add an entry on a run that ends at a contact; see the base class."""
        super().log_end(status)
        self._times += [np.full(len(self._scales), np.nan)] * (len(self.log) - len(self._times))


class DifferentiatedActions(Actions):
    """Performs the actions of events, and differentiates them.

    Parameters
    ----------
    system, request, core
        See `Actions`.
    parameters : int
        Number of the core's parameters.
    times : list of (n,) arrays
        Receives the derivatives of the times of the entries.
    """

    def __init__(
        self,
        system: System,
        request: IntegrationRequest,
        core: Any,
        parameters: int,
        times: list[Array],
    ):
        super().__init__(system, request, core)
        self._parameters, self._times = parameters, times
        self._pushed: Array | None = None

    @cached_property
    def _slopes(self) -> ScalarTape:
        assert self.switching.actions is not None
        return ScalarTape(directional(self.switching.actions))

    def react(self, changes: Sequence[tuple[int, str]]) -> list[EventEntry]:
        """Perform the actions of the events triggered at this instant; see the base class."""
        found = super().react(changes)
        for entry in found:
            is_event = entry.occurrence == "event"
            condition = self.switching.events[entry.which].condition if is_event else None
            self._times.append(self.core.change_of_time(condition))
        return found

    def set(self, rule: EventRule, y: Array, values: Sequence[float]) -> tuple[Array, Array]:
        """Return the state with the values that an event sets; see the base class."""
        core, nq, count = self.core, self.nq, len(rule.targets)
        state, p, forces = core.changes(self._parameters)
        inputs, own = self.inputs(y), slice(rule.first, rule.first + count + len(rule.impulses))
        times = core.change_of_time()
        slopes = np.array(
            [
                self._slopes((*inputs, *np.concatenate(x).tolist()))[own]
                for x in zip(times[:, None], state, forces, p[:, : len(self.p)], strict=True)
            ]
        )
        for k, (what, index) in enumerate(rule.targets):
            if what == "p":
                p[:, index] = slopes[:, k]
            else:
                state[:, index + (nq if what == "v" else 0)] = slopes[:, k]
        after, impulse = super().set(rule, y, values)
        if count and (self.rows.velocities or self.rows.contacts):
            given = y[:-1].copy()
            for (what, index), value in zip(rule.targets, values, strict=True):
                if what != "p":
                    given[index + (nq if what == "v" else 0)] = value
            state = self._adjusted(given, times, state, p[:, : len(self.p)])
        core.set_changes(state, p)
        self._pushed = np.zeros((len(state), nq))
        self._pushed[:, list(rule.impulses)] = slopes[:, count:]
        return after, impulse

    def _adjusted(self, given: Array, times: Array, state: Array, p: Array) -> Array:
        """Differentiate how the values that an event does not set follow, by central differences.

        Parameters
        ----------
        given : (2 nq,) array
            The state with the values that the event sets.
        times, state, p : (n,), (n, 2 nq) and (n, np) arrays
            Derivatives of the time, of that state and of the parameters.
        """
        found = state.copy()
        for k, (time, change, of_p) in enumerate(zip(times, state, p, strict=True)):
            if np.isfinite(change).all() and np.isfinite(time):
                # values that leave nothing free are on the constraints to first order only
                with suppress(NoConsistentState):
                    found[k] = self._difference(given, float(time), change, of_p)
        return found

    def _difference(self, given: Array, time: float, change: Array, of_p: Array) -> Array:
        found = np.zeros_like(given)
        size = max(1.0, *(float(np.abs(x).max(initial=0.0)) for x in (time, change, of_p)))
        for step, weight in _WEIGHTS.items():
            for side in (1, -1):
                d = side * step * _STEP / size
                at = given + d * change
                near = adjusted(
                    self.evaluator.with_parameters(tuple((self.p + d * of_p).tolist())),
                    self.core.t + d * time,
                    at[: self.nq],
                    at[self.nq :],
                    self.fixed,
                    self.rows,
                )
                found += side * weight * size / _STEP * np.concatenate([near.q, near.v])
        return found

    def push(self, impulse: Array) -> int:
        """Apply a generalized impulse; return a status of the core."""
        return int(self.core.push(impulse, self._pushed))

    def activate(self, row: int, active: bool) -> None:
        """Release or engage a row."""
        state, p, _ = self.core.changes(self._parameters)
        self.core.set_changes(state, p)  # the motion after it is another one
        super().activate(row, active)
