"""Runs of the core that differentiate a motion with contacts, friction, events and kinks.

`DirectionalPrograms` are the directional derivatives of a System's tapes, for the core, and
`why_lost` states why a motion has no derivatives from an instant on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from enum import IntEnum
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.constraints.adjustment import adjusted
from lagcli.engine.constraints.initial import NoConsistentState
from lagcli.engine.contract import Block, IntegrationRequest, Outcome
from lagcli.engine.core.program import Program, assemble
from lagcli.engine.core.start_search import HeldRows
from lagcli.engine.core.switching import DirectionalPrograms, SwitchingIntegrator
from lagcli.engine.event_entries import EventEntry
from lagcli.engine.integrate.prepared import Prepared
from lagcli.engine.integrate.switching_run import Actions, SwitchingIntegration
from lagcli.engine.sensitivity.integration import Derivatives, Sink
from lagcli.engine.sensitivity.start import StartDerivatives
from lagcli.engine.switching.kinks import FrozenSystem
from lagcli.engine.switching.splitting import SplitSystem
from lagcli.engine.switching.switching import EventRule
from lagcli.engine.system import System
from lagcli.engine.tape.differentiation import directional
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.tape import Builder, Tape

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
        request = request._replace(settings=request.settings.replace(method=METHOD))
        super().__init__(system, request, self._nowhere, progress)
        count = len(self.split_system.system.parameters)
        self.actions = DifferentiatedActions(self.whole, request, self.core, count)

    @staticmethod
    def _nowhere(block: Block) -> None:
        """Receive samples of the motion without derivatives, which do not occur."""

    def start_changes(self) -> Array | None:
        """Return the derivatives of q and v at the start, (n, 2 nq)."""
        return np.hstack([self._start.q, self._start.v])

    def integrator(self, prepared: Prepared) -> SwitchingIntegrator:
        """Return a core that differentiates."""
        given, system = self._parameters, self.split_system.system
        branches = np.zeros((len(given), len(system.parameters) - given.shape[1]))
        parameters = np.hstack([given, branches])
        core = super().integrator(prepared)
        core.use_directions(directional_programs(self.split_system, self.frozen, parameters))
        return core

    def run(self) -> Outcome:
        """Integrate, once."""
        outcome = super().run()
        self.log.part("dtime")[:] /= self._scales
        outcome.notes = (*outcome.notes, *self._notes())
        return outcome

    def _notes(self) -> list[str]:
        """Say which directions have lost their derivatives, where and why."""
        lost: dict[tuple[float, str], list[str]] = {}
        for direction, t, reason, culprits in self.core.losses:
            why = why_lost(self.split_system, self.frozen, reason, culprits)
            lost.setdefault((t, why), []).append(f"`{self._names[direction]}`")
        return [
            f"derivatives by {', '.join(names)} end at t = {t:.9g} s: {why}"
            for (t, why), names in sorted(lost.items())
        ]

    # samples

    def emit(self, rows: Array) -> None:
        """Emit samples and their derivatives."""
        nq, nc, n = self.nq, len(self.whole.constraints), len(self._scales)
        plain = rows.shape[1] - n * (3 * nq + nc)
        derivatives = (
            rows[:, plain:].reshape(len(rows), n, 3 * nq + nc).transpose(0, 2, 1) / self._scales
        )
        parts = np.split(derivatives, [nq, 2 * nq, 3 * nq], axis=1)
        block = Block.of_rows(rows, self.whole.sample_layout)
        self._emit_both(block, Derivatives(*map(np.ascontiguousarray, parts)))


class DifferentiatedActions(Actions):
    """Performs the actions of events, and differentiates them.

    Parameters
    ----------
    system, request, core
        See `Actions`.
    parameters : int
        Number of the core's parameters.
    """

    def __init__(
        self,
        system: System,
        request: IntegrationRequest,
        core: Any,
        parameters: int,
    ):
        super().__init__(system, request, core)
        self._parameters = parameters
        self._pushed: Array | None = None

    @cached_property
    def _slopes(self) -> ScalarTape:
        assert self.switching.actions is not None
        return ScalarTape(directional(self.switching.actions))

    def react(self, changes: Sequence[tuple[int, str]]) -> list[EventEntry]:
        """Perform the actions of the events triggered at this instant; see the base class."""
        entries = []
        for entry in super().react(changes):
            is_event = entry.occurrence == "event"
            condition = self.switching.events[entry.which].condition if is_event else None
            entries.append(entry._replace(dtime=self.core.change_of_time(condition)))
        return entries

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
        rows = self.rows
        if count and rows is not None and (rows.velocities.any() or rows.sign.any()):
            given = y[:-1].copy()
            for (what, index), value in zip(rule.targets, values, strict=True):
                if what != "p":
                    given[index + (nq if what == "v" else 0)] = value
            state = self._adjusted(rows, given, times, state, p[:, : len(self.p)])
        core.set_changes(state, p)
        self._pushed = np.zeros((len(state), nq))
        self._pushed[:, list(rule.impulses)] = slopes[:, count:]
        return after, impulse

    def _adjusted(
        self, rows: HeldRows, given: Array, times: Array, state: Array, p: Array
    ) -> Array:
        """Differentiate how the values that an event does not set follow, by central differences.

        Parameters
        ----------
        rows : HeldRows
        given : (2 nq,) array
            The state with the values that the event sets.
        times, state, p : (n,), (n, 2 nq) and (n, np) arrays
            Derivatives of the time, of that state and of the parameters.
        """
        derivatives = state.copy()
        for k, (time, change, of_p) in enumerate(zip(times, state, p, strict=True)):
            if np.isfinite(change).all() and np.isfinite(time):
                # values that leave nothing free are on the constraints to first order only
                with suppress(NoConsistentState):
                    derivatives[k] = self._difference(rows, given, float(time), change, of_p)
        return derivatives

    def _difference(
        self, rows: HeldRows, given: Array, time: float, change: Array, of_p: Array
    ) -> Array:
        difference = np.zeros_like(given)
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
                    rows,
                    self.accuracy,
                )
                difference += side * weight * size / _STEP * np.concatenate([near.q, near.v])
        return difference

    def push(self, impulse: Array) -> Array | None:
        """Apply a generalized impulse; see the base class."""
        return self.core.push(impulse, self._pushed)

    def activate(self, row: int, active: bool) -> None:
        """Release or engage a row."""
        state, p, _ = self.core.changes(self._parameters)
        self.core.set_changes(state, p)  # the motion after it is another one
        super().activate(row, active)


@lru_cache(maxsize=4)
def _programs(split: SplitSystem, frozen: FrozenSystem | None) -> tuple[Program, ...]:
    """Return the programs from ``dynamics`` on; cached for many runs."""
    fixed, switching, system = split.fixed, split.switching, split.system
    d, c, rows = fixed.dynamics_layout, fixed.constraint_layout, len(split.rows)
    holonomic = sum(place >= 0 for place in split.places)
    of_rows = range(holonomic + len(split.pattern) + 2 * rows)
    limited = 2 * sum(row.limit is not None for row in switching.rows)
    state, forces = 1 + 2 * len(system.coordinates), len(system.constraints)
    forces += state + len(system.coordinates) + split.laws.signs
    held = system.dynamics.parameters
    # with the inputs of any other
    nothing = Tape(2 * (forces + held) + state, (), (), (), held)

    def along(tape: Tape | None, inputs: int) -> Program:
        if tape is None or not tape.outputs:
            return assemble(nothing)
        return assemble(arranged(directional(tape), inputs))

    matrices = [
        *range(d.mass_matrix.start, d.mass_matrix.stop),
        *range(d.forcing.start, d.forcing.stop),
        *range(d.jacobian.start, d.jacobian.stop),
        *range(d.rhs.start, d.rhs.stop),
    ]
    constraints = [
        *range(c.position.start, c.position.stop),
        *range(c.jacobian.start, c.jacobian.stop),
        *range(c.drift.start, c.drift.stop),
    ]
    laws, kinks = split.laws, None
    some = laws.forces
    if some is not None:
        some = some.selected(range(len(switching.force_coordinates)))
    if frozen is not None:
        kinks = frozen.functions.selected(range(len(frozen.kinks)))
    return (
        along(fixed.dynamics.selected(matrices), state),
        along(fixed.constraint.selected(constraints), state),
        along(split.functions.selected(of_rows) if rows else None, state),
        along(laws.limits.selected(range(limited)), forces),
        along(switching.impact, state),
        along(some, forces),
        along(laws.functions.selected(range(laws.signs)), forces),
        along(system.events, state),
        along(laws.force_conditions, forces),
        along(kinks, state),
        assemble(_rates(kinks, state)) if kinks is not None else assemble(nothing),
    )


def directional_programs(
    split: SplitSystem, frozen: FrozenSystem | None, parameters: Array
) -> DirectionalPrograms:
    """Return the programs of a System.

    Parameters
    ----------
    split : SplitSystem
    frozen : FrozenSystem or None
        If the System has branches.
    parameters : (n, np) array
        Derivatives of the System's parameters.
    """
    rules = split.switching.events
    acting = {
        rule.condition
        for rule in rules
        if rule.targets or rule.impulses or rule.release or rule.engage or rule.stop
    }
    tapes = split.system.events, split.switching.force_conditions
    count = sum(len(tape.outputs) for tape in tapes if tape is not None)
    decides = tuple(k in acting for k in range(count))
    return DirectionalPrograms(parameters, decides, *_programs(split, frozen))


def arranged(tape: Tape, state: int) -> Tape:
    """Return the derivative of a tape with other inputs: the parameters after all else.

    Parameters
    ----------
    tape : Tape
        Of (x, p, their changes), p the parameters: the result of `directional`.
    state : int
        Number of x.

    Returns
    -------
    Tape
        Of (x, its changes, those of p, p).
    """
    pieces = tape.functions.size
    given = (tape.inputs - pieces) // 2
    p = given - state
    builder = Builder(2 * given + pieces, p + pieces, functions=tape.functions)
    last = 2 * state + p
    return builder.finish(
        builder.splice(
            tape,
            [
                *range(state),
                *range(last, last + p),
                *range(state, 2 * state),
                *range(2 * state, last),
                *range(last + p, builder.inputs),
            ],
        )
    )


def _rates(tape: Tape, state: int) -> Tape:
    """Return the rates of a tape's outputs along a motion, and the changes of these.

    Returns
    -------
    Tape
        Of (t, q, v; their rates; their changes; the changes of p; those of the rates of q and v;
        p).
    """
    first = directional(tape)
    second = directional(first)
    pieces = tape.functions.size
    p = tape.inputs - pieces - state
    parts = (state, state, state, p, state - 1, p, pieces)
    builder = Builder(sum(parts), p + pieces, functions=tape.functions)
    places, start = [], 0
    for count in parts:
        places.append([*range(start, start + count)])
        start += count
    x, rates, changes, of_p, of_rates, parameters, rest = places
    zero = builder.constant(0.0)
    along = [*x, *parameters, *rates, *[zero] * p]
    of_along = [*changes, *of_p, zero, *of_rates, *[zero] * p]
    return builder.finish(
        [
            *builder.splice(first, [*along, *rest]),
            *builder.splice(second, [*along, *of_along, *rest]),
        ]
    )


class Loss(IntEnum):
    """The reasons why a derivative ends: ``lag_reason`` in core/derivatives/derivatives.h."""

    UNKNOWN = 0
    GRAZES = 1
    SHARES = 2
    COINCIDE = 3
    CLOSE_TOGETHER = 4
    RESTS = 5
    ONLY_HERE = 6
    WITHIN_TOLERANCE = 7


#: Sentences on them, with the first of the functions concerned, or all.
_SENTENCES = {
    Loss.UNKNOWN: "they have no finite value",
    Loss.GRAZES: "{first} is only touched, without a rate, and the time has no derivative",
    Loss.SHARES: "{first} shares its force with others, so that the time has no derivative",
    Loss.COINCIDE: "{all} occur simultaneously, and their order decides what follows",
    Loss.CLOSE_TOGETHER: "contacts close simultaneously there, {first} among them, and their order"
    " decides",
    Loss.RESTS: "infinitely many impacts of {first} end there",
    Loss.ONLY_HERE: "{first} holds there only for this value",
    Loss.WITHIN_TOLERANCE: "{first} holds from there on within a tolerance, and not exactly",
}


#: Kinds of watched functions that are not of rows: ``lag_watched`` in core/switching/switching.h.
_KINKS, _FIRST_CONDITION = (6, 7), 8


def why_lost(
    split: SplitSystem,
    frozen: FrozenSystem | None,
    reason: int,
    culprits: Sequence[tuple[int, int]],
) -> str:
    """Return why there is no derivative.

    Parameters
    ----------
    split : SplitSystem
    frozen : FrozenSystem or None
        With the kinks, if there are any.
    reason : int
        `Loss`.
    culprits : sequence of (int, int)
        Kinds and numbers of the functions that it is about.
    """
    names = [*dict.fromkeys(_name(split, frozen, what, which) for what, which in culprits)]
    return _SENTENCES[Loss(reason)].format(first="".join(names[:1]), all=" and ".join(names))


def _name(split: SplitSystem, frozen: FrozenSystem | None, what: int, which: int) -> str:
    if what in _KINKS:
        assert frozen is not None
        names = frozen.kinks[which].names or ("t",)
        return "the kink of a function of " + ", ".join(f"`{name}`" for name in names)
    if what < _FIRST_CONDITION:
        return f"`{split.system.constraints[split.rows[which]]}`"
    rules = split.switching.events
    return f"`{next(rule.name for rule in rules if rule.condition == which)}`"


class SwitchedProblem:
    """A System and the directions in which its motion is differentiated, for many runs.

    DOP853 takes the steps, regardless of the settings.

    Parameters
    ----------
    system : System
    names : sequence of n str
        Names of the directions.
    scales : (n,) array
        Derivatives are carried with respect to θ / scale.
    """

    def __init__(self, system: System, names: Sequence[str], scales: Array):
        self.system, self.names, self.scales = system, tuple(names), scales

    def integrate(
        self,
        request: IntegrationRequest,
        start: StartDerivatives,
        parameters: Array,
        sink: Sink,
        progress: Callable[[float], None] | None = None,
    ) -> Outcome:
        """Integrate the motion with its derivatives.

        Parameters
        ----------
        request : IntegrationRequest
        start : StartDerivatives
            With respect to θ / scale.
        parameters : (n, np) array
            Derivatives of the parameters with respect to θ / scale.
        sink : callable
            Takes the samples in blocks, in order.
        progress : callable, optional
            As in `lagcli.engine.integrate.engine.integrate`.
        """

        return DifferentiatedIntegration(
            self.system, request, start, parameters, self.names, self.scales, sink, progress
        ).run()
