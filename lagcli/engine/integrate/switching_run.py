"""Runs with contacts, friction and events.

The core finds the instants, their impacts and the next modes. It returns if an event of the model
has actions: they are performed here, and the core continues with the instant.

Limits of the motion on both sides of an event that records columns are collected by instant.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.constraints.adjustment import adjusted, held_during, supplied_energy
from lagcli.engine.constraints.initial import NoConsistentState, UndefinedStart
from lagcli.engine.contract import (
    Block,
    IntegrationRequest,
    OneSidedLimits,
    Outcome,
    Stop,
    Undefined,
    breaks_of,
)
from lagcli.engine.core.program import Program
from lagcli.engine.core.start_search import HeldRows
from lagcli.engine.core.status import Status
from lagcli.engine.core.switching import SwitchingIntegrator, rules_fields
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.event_entries import (
    CHANGES,
    OCCURRENCES,
    EventEntries,
    EventEntry,
    Occurrence,
)
from lagcli.engine.integrate.prepared import Prepared, explicit_time, prepare
from lagcli.engine.integrate.run import Integration
from lagcli.engine.linear import dense
from lagcli.engine.linear.elimination import Elimination
from lagcli.engine.switching.kinks import frozen_of, no_switching
from lagcli.engine.switching.splitting import SplitSystem
from lagcli.engine.switching.stops import contradicting_values, nonlinear_impulse
from lagcli.engine.switching.switching import (
    ContactChange,
    EventRule,
    clocks_of,
)
from lagcli.engine.system import ENERGY, State, System
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.ticks import Ticks, ticks_of

#: Capacity of the core's log.
_LOG_ROWS = 512
#: Kinds of entries of model events: "event", "releases", "engages".
_OF_EVENTS = range(OCCURRENCES.index("event"), OCCURRENCES.index("engages") + 1)
#: Statuses that end a run at a contact.
_REFUSED = (
    Status.ENDLESS,
    Status.NO_MODE,
    Status.TWO_MODES,
    Status.NO_IMPACT,
    Status.GAINS,
    Status.VIOLATED,
    Status.JAMMED,
)
#: The method that takes the steps while a row holds or slips, or a force depends on λ.
_ACTING = "DOP853"
_AT_SURFACES = (Status.SURFACES, Status.FORKED, Status.NO_SIDE, Status.CORNER)


def rank_at(system: System, state: State) -> int:
    """Return the rank of B at a state."""
    if not system.constraints:
        return 0
    evaluator = Evaluator(system, state.p)
    dynamics = evaluator.dynamics(state.t, state.q, state.v)
    return dense.count_rank(dynamics.jacobian, sizes=evaluator.sizes(state.t, state.q, state.v))


class _Common:
    """Shared data of the runs of a System: its parts, and the preparation of the rows that always
    hold.

    Parameters
    ----------
    system : System
        With ``switching``.
    """

    def __init__(self, system: System):
        self.split = SplitSystem(system)
        self.prepared: Prepared | None = None


@lru_cache(maxsize=4)
def _common_to(system: System) -> _Common:
    """Return the shared data; cached for many runs."""
    return _Common(system)


class SwitchingIntegration(Integration):
    """One run of a System that switches.

    While a row holds or slips, DOP853 takes the steps, regardless of the method: the power series
    and the derivatives of implicit methods are those of the constraints that always hold.

    Parameters
    ----------
    system, request, sink, progress
        As in the contract.
    """

    def __init__(
        self,
        system: System,
        request: IntegrationRequest,
        sink: Callable[[Block], None],
        progress: Callable[[float], None] | None,
    ):
        self.frozen = frozen_of(system)
        if system.switching is None:
            system = replace(system, switching=no_switching(system))
        self.whole, given = system, request
        if self.frozen is not None:
            system = self.frozen.system
            request = request._replace(state=self.frozen.frozen(request.state))
        self.common = _common_to(system)
        self.split_system = split = self.common.split
        if split.base != system.held_at_start:
            # the rank of all rows is not that of those that hold
            rank = rank_at(split.fixed, request.state)
            request = request._replace(rank=rank, elimination=None)
        self.stopped = ""
        #: Entries of the log up to which the model's events have been asked for.
        self.asked = 0
        #: The entry of an event that engages a constraint, and the work before the velocities
        #: change.
        self.engaging: tuple[int, float] | None = None
        self.core: SwitchingIntegrator
        self.last = math.inf  # the time of the last sample that the run keeps
        super().__init__(split.fixed, request, sink, progress)
        self.log = EventEntries(self.core.entry_counts)
        self.actions = Actions(self.whole, given, self.core)
        self.instants = RecordedInstants(self.split_system.switching.events)

    def ready(self, order: Elimination | None, known: Prepared | None) -> Prepared:
        """Return the programs for an order, or for none; later runs of the System reuse them."""
        self.common.prepared = prepare(self.system, order, self.common.prepared)
        return super().ready(order, self.common.prepared)

    @property
    def crossable(self) -> bool:
        """Whether the run can continue through singular configurations: nothing is searched for on
        the way."""
        return not (self.split_system.rows or self.split_system.switching.events)

    def explicit_time(self) -> Program | None:
        """Return the program of the functions of time that steps resolve, with those of rows."""
        return explicit_time(self.split_system.system)

    def problem(self) -> dict[str, Any]:
        """Return the initial value problem, with the multipliers of rows in samples."""
        problem = super().problem() | {"extra": len(self.split_system.rows)}
        changes = self.start_changes()
        if changes is None:
            return problem
        y = np.concatenate([problem["y"], np.ravel(changes)])
        return problem | {"y": y, "directions": len(changes)}

    def ticks(self) -> list[tuple[Ticks, int]]:
        """Return the clocks, as for `SwitchingIntegrator`; note one that cannot tick."""
        state, switching = self.request.state, self.split_system.switching
        clocks, span = clocks_of(switching, state.p), (state.t, self.settings.t_end)
        self.fault = next(filter(None, (clock.fault(span) for clock in clocks)), "")
        return [] if self.fault else [(ticks_of(x.period, x.offset), x.most) for x in clocks]

    def parts(self, prepared: Prepared) -> dict[str, Any]:
        """Return what runs have in common, with what switches."""
        return super().parts(prepared) | {"rules": rules_fields(self.split_system, self.frozen)}

    def integrator(self, prepared: Prepared) -> SwitchingIntegrator:
        """Return a core whose rows switch."""
        self.clocks = self.ticks()
        return SwitchingIntegrator(
            self.split_system,
            self.model(prepared),
            self.problem(),
            breaks_of(self.system, self.request),
            clocks=self.clocks,
            log_rows=_LOG_ROWS,
        )

    def start_changes(self) -> Array | None:
        """Return the derivatives of q and v at the start, (n, 2 nq), if there are any."""
        return None

    def run(self) -> Outcome:
        """Integrate, once."""
        run = super().run()
        if self.stopped:
            run.status, run.message = "stopped-by-event", self.stopped
        run.events, run.limits = self.log, self.instants.limits
        run.notes = (*run.notes, *self.actions.notes.values())
        first_modes, run.kinks, slid = self.core.course
        run.modes = tuple(first_modes[: len(self.split_system.switching.rows)])
        acted = any(run.modes) or slid or (self.log and self.log.changes.value.any())
        if acted or self.split_system.switching.force_coordinates:
            run.methods = tuple(dict.fromkeys([*(run.methods or (self.settings.method,)), _ACTING]))
        return run

    def integrate(self) -> None:
        """Integrate; a run that cannot be completed raises `Stop`."""
        if self.fault:
            raise Stop(self.fault)
        super().integrate()
        if self.whole.nonlinear:
            self.collect()  # the last impacts may end the run

    def handle_status(self, status: int) -> bool:
        """Handle a status of the core; return whether the run is complete."""
        try:
            return self.handled(status)
        except Undefined:
            cause = self.actions.undetermined(self.core.t)
            if not cause:
                raise
            raise Stop(cause) from None

    def handled(self, status: int) -> bool:
        """Handle a status of the core, as `handle_status`."""
        core = self.core
        if status == Status.BLOCK_FULL and not core.begun:  # in the midst of the first instant
            self.collect()
            return self.handle_status(core.start())
        if status < Status.HAPPENED and self.frozen is None:
            return super().handle_status(status)
        if self.frozen is not None:
            self.evaluator.p = (*self.actions.p, *core.branches)
        if status == Status.HAPPENED:
            return self.happen()
        if status == Status.RESOLVED:
            self.resolve()
            return False
        if status in _REFUSED:
            from lagcli.engine.switching.stops import refusal

            self.collect()
            stop = refusal(
                self.split_system, status, core, self.settings.impacts, self.log, self.branches()
            )
            self.log_end(status)
            raise stop
        if status == Status.UNRESOLVED:
            from lagcli.engine.switching.stops import unresolved

            self.collect()
            raise unresolved(*core.step, self.watched(*core.unresolved))
        if status in _AT_SURFACES:
            from lagcli.engine.switching.stops import at_surfaces

            self.collect()
            raise at_surfaces(status, core.t, self.branches())
        return super().handle_status(status)

    def log_end(self, status: int) -> None:
        """Add an entry on a run that ends where the motion is not unique, or does not exist."""
        from lagcli.engine.switching.stops import ending

        core = self.core
        end = ending(self.split_system, status, core)
        if end is None:
            return
        occurrence, constraint = end
        q, v = np.split(core.state[:-1].copy(), 2)
        modes = np.array(core.modes[: len(self.split_system.switching.rows)], dtype=int)
        nothing = np.zeros(len(self.split_system.system.constraints))
        self.log.append(
            EventEntry(core.t, occurrence, constraint, q, v, v, nothing, 0.0, 0.0, 0.0, modes)
        )

    def watched(self, kind: str, which: int) -> str:
        """Return a phrase for a function that the core watches."""
        if kind == "condition":
            rules = self.split_system.switching.events
            names = [f"`{rule.name}`" for rule in rules if rule.condition == which]
            return f"the condition of {', '.join(names)}"
        if kind == "kink" and self.frozen is not None:
            names = [f"`{name}`" for name in self.frozen.kinks[which].names]
            return f"a branch of {', '.join(names) or 'time'}"
        row = self.split_system.rows[which]
        return f"`{self.split_system.system.constraints[row]}`"

    def branches(self) -> list[tuple[str, ...]]:
        """Return the names on which each branch depends that changes at the instant."""
        kinks = self.frozen.kinks if self.frozen is not None else ()
        return [kinks[i].names for i in self.core.surfaces]

    # events

    def happen(self) -> bool:
        """Handle events of the model; return whether the run is complete."""
        core = self.core
        self.collect()
        changes = self.changes()
        if not self.instants.open:
            y, a, multipliers = core.motion
            if not core.begun:  # before the initial state is complete
                a, multipliers = np.full_like(a, np.nan), np.full_like(multipliers, np.nan)
            left = np.concatenate([[core.t], y[:-1], a, multipliers, y[-1:]])
            self.instants.begin(left, tuple(self.actions.p), len(self.log))
        p = list(self.actions.p)
        entries = self.actions.react(changes)
        if self.actions.p != p and self.request.on_parameters is not None:
            self.request.on_parameters(tuple(self.actions.p))
        self.instants.add(len(self.log), entries)
        if self.engaging is None and any(e.occurrence == "engages" for e in entries):
            first = next(k for k, e in enumerate(entries) if e.occurrence == "engages")
            of_event = max(k for k in range(first) if entries[k].occurrence == "event")
            self.engaging = len(self.log) + of_event, float(core.state[-1])
        for entry in entries:
            self.log.append(entry)
        self.asked = len(self.log)
        self.stopped = self.actions.stopped
        if self.stopped:
            self.settle()
            return True
        if core.begun:
            return False
        # before the first step, `start` continues the instant; otherwise the next slice does
        complete = self.handle_status(core.start())
        if self.instants.open:
            self.resolve()
        return complete

    def changes(self) -> list[tuple[int, ContactChange]]:
        """Return the constraints that have changed since events were last asked for, and how."""
        kinds, which = (self.log.integers(x, self.asked) for x in ("occurrence", "which"))
        pairs = zip(which.tolist(), [OCCURRENCES[k] for k in kinds.tolist()], strict=True)
        return [(row, CHANGES[kind]) for row, kind in pairs if kind in CHANGES]

    def settle(self) -> None:
        """Complete the instant at which the run stops, and sample it."""
        core = self.core
        while (status := core.advance(0) if core.begun else core.start()) == Status.BLOCK_FULL:
            self.collect()
        if status in (Status.RUNNING, Status.RESOLVED, Status.HAPPENED):
            self.resolve()
            while core.sample_until(core.t) == Status.BLOCK_FULL:
                self.collect()
        else:
            self.instants.end(None, tuple(self.actions.p))
        self.collect()

    def resolve(self) -> None:
        """Complete the entries of a finished instant."""
        self.collect()
        modes = np.array(self.core.modes[: len(self.split_system.switching.rows)], dtype=int)
        first = self.instants.first
        kinds = self.log.integers("occurrence", first)
        of_events = (kinds >= _OF_EVENTS.start) & (kinds < _OF_EVENTS.stop)
        self.log.replace_modes(first + np.flatnonzero(of_events), modes)
        self.complete_engagement()
        right = None
        if self.instants.recording:
            status, row = self.core.sample_here()
            right = row[: self.whole.sample_layout.size] if status == Status.RUNNING else None
        self.instants.end(right, tuple(self.actions.p))

    def complete_engagement(self) -> None:
        """Add the energy lost by the velocities to the entry of the event that engages."""
        if self.engaging is None:
            return
        (k, work), self.engaging = self.engaging, None
        state, entry = self.core.state, self.log[k]
        name = self.split_system.switching.events[entry.which].name
        after = state[self.nq : -1].copy()
        self.actions.check_linear(name, entry.time, entry.q, entry.before, after)
        supplied, loss, of_work = (self.log.part(x)[k + 1 :] for x in ("supplied", "loss", "work"))
        others = 0.0
        for change in (supplied - loss + of_work).tolist():
            others += change
        self.log.correct(k, work=entry.work + float(state[-1]) - work - others, after=after)

    # samples

    def collect(self) -> None:
        """Emit the samples in the core's block, and copy its log."""
        rows = self.core.take_log()
        if not self.whole.nonlinear:
            self.log.add(rows)
            super().collect()
            return
        fault: Stop | None = None
        for row in rows:
            self.log.add(row[None])
            e = self.log[-1]
            try:
                name = self.whole.constraints[e.which]
                self.actions.check_linear(name, e.time, e.q, e.before, e.after)
            except Stop as stop:
                fault, self.last = stop, e.time
                break
        super().collect()
        if fault is not None:
            raise fault

    def emit(self, rows: Array) -> None:
        """Emit samples."""
        kept = int(np.searchsorted(rows[:, 0], self.last, "right"))
        self.sink(Block.of_rows(rows[:kept], self.whole.sample_layout))


#: Moves of coordinates below this part of the largest coordinate, by inertia, are not noted.
_NOTICED = 1e-9
_LISTED = 4
#: Velocities satisfy a constraint to this part of its terms.
_OFF = 1e-9


class Actions:
    """Performs the actions of events, and counts their occurrences.

    Parameters
    ----------
    system : System
        With ``switching``.
    request : IntegrationRequest
    core : SwitchingIntegrator

    Attributes
    ----------
    stopped : str
        Name of the event that has stopped the run; empty if none has.
    notes : dict of str
        By event: which coordinates it has moved besides those that it sets.
    """

    def __init__(self, system: System, request: IntegrationRequest, core: Any):
        assert system.switching is not None
        self.system, self.switching, self.core = system, system.switching, core
        self.p = list(request.state.p)
        self.times: Counter[int] = Counter()
        self.stopped = ""
        self.nq = len(system.coordinates)
        rows = self.switching.rows
        self.active = [row.active for row in rows]
        switched = {row.row for row in rows}
        self.base = [k for k in range(len(system.constraints)) if k not in switched]
        self.fixed = np.zeros((2, self.nq), dtype=bool)
        self.rows: HeldRows | None = None
        self.notes: dict[str, str] = {}
        #: Time and name of the last event that releases constraints, and these.
        self.released: tuple[float, str, tuple[int, ...]] = (-math.inf, "", ())

    # made when needed: events may never happen

    @cached_property
    def _values(self) -> ScalarTape | None:
        return ScalarTape(self.switching.actions) if self.switching.actions else None

    @cached_property
    def _energies(self) -> ScalarTape:
        return ScalarTape(self.system.report.selected([ENERGY]))

    @cached_property
    def _constraint(self) -> ScalarTape:
        return ScalarTape(self.system.constraint)

    @cached_property
    def _equations(self) -> Evaluator:
        return Evaluator(self.system, tuple(self.p))

    def react(self, changes: Sequence[tuple[int, str]]) -> list[EventEntry]:
        """Perform the actions of the events triggered at this instant, in the order of the file.

        Values that one of them sets hold while the next ones set theirs.

        Parameters
        ----------
        changes : sequence of (int, str)
            Changes of constraints at this instant.
        """
        conditions, clocks = set(self.core.happened()), set(self.core.ticked())
        entries = list[EventEntry]()
        self.fixed = np.zeros((2, self.nq), dtype=bool)
        for number, rule in enumerate(self.switching.events):
            happens = rule.change in changes if rule.change else rule.condition in conditions
            happens = happens or rule.clock in clocks
            if not happens or (rule.times is not None and self.times[number] >= rule.times):
                continue
            self.times[number] += 1
            entries += self._act(number, rule)
            if rule.stop:
                self.stopped = f"`{rule.name}` stopped the run at t = {self.core.t:.9g} s"
        return entries

    def _act(self, number: int, rule: EventRule) -> list[EventEntry]:
        core = self.core
        y, energy = core.state, self._energy(core.state)
        after, impulse = y.copy(), np.zeros(len(self.system.constraints))
        if self._values is not None and (rule.targets or rule.impulses):
            evaluated = self._values(self.inputs(y))
            count = len(rule.targets)
            values = evaluated[rule.first : rule.first + count]
            after, impulse = self.set(rule, y, values)
            if any(what == "p" for what, _ in rule.targets):
                core.set_parameters(self._held)
            core.place(after)
            if rule.impulses:
                first = rule.first + count
                after = self._push(rule, evaluated[first : first + len(rule.impulses)], impulse)
        work = supplied = 0.0
        if rule.targets or rule.impulses:
            change = self._energy(after) - energy
            if impulse.any():
                supplied = supplied_energy(self.evaluator, core.t, after[:-1], impulse)
            work = change - supplied
            after[-1] = y[-1] + change
            core.place(after)
        entries = [self._entry("event", number, y, after, work, supplied, impulse)]
        rows = [row.row for row in self.switching.rows]
        if rule.release:
            self.released = core.t, rule.name, rule.release
        for constraint in rule.release:
            self.activate(rows.index(constraint), False)
            entries.append(self._entry("releases", constraint, after, after))
        for constraint in rule.engage:
            self._check_gap(constraint, after)
            self._check_jump(rule.name, constraint, after)
            self.activate(rows.index(constraint), True)
            entries.append(self._entry("engages", constraint, after, after))
        return entries

    def undetermined(self, t: float) -> str:
        """Return which event has released a constraint that a massless coordinate needs, if any."""
        (time, event, released), system = self.released, self.system
        pairs = system.jacobian_pattern
        massless = {j for i, j in pairs if i in released and (j, j) not in system.mass_pattern}
        if t != time or not massless:
            return ""
        constraints = " and ".join(f"`{system.constraints[i]}`" for i in released)
        names = ", ".join(f"`{system.coordinates[j]}`" for j in sorted(massless))
        has, it = ("has", "it") if len(massless) == 1 else ("have", "them")
        return (
            f"event `{event}` releases {constraints} at t = {t:.9g} s, and no other constraint"
            f" holds that determines the accelerations: {names} {has} no inertia; engage one, or"
            f" give {it} a mass"
        )

    def activate(self, row: int, active: bool) -> None:
        """Release or engage a row."""
        self.core.activate(row, active)
        self.active[row] = active

    def set(self, rule: EventRule, y: Array, values: Sequence[float]) -> tuple[Array, Array]:
        """Return the state with the values that an event sets, and the impulse of constraints.

        The other coordinates and velocities follow on the constraints.
        """
        after = y.copy()
        if not rule.targets:
            return after, np.zeros(len(self.system.constraints))
        q, v = self._split(after)
        for (what, index), value in zip(rule.targets, values, strict=True):
            if what == "p":
                self.p[index] = value
            else:
                (q if what == "q" else v)[index] = value
                self.fixed[int(what == "v"), index] = True
        core, count = self.core, len(self.system.constraints)
        if not rule.displaces(self.system.constraining):
            self.rows = None
            return after, np.zeros(count)
        self.rows = held_during(self.switching, rule, count, self.active, core.modes, core.no_gap)
        try:
            adjustment = adjusted(
                self.evaluator, core.t, q, v, self.fixed, self.rows, self.accuracy
            )
        except UndefinedStart as error:
            raise Undefined(error.state) from None
        except NoConsistentState as error:
            raise contradicting_values(self.system, core.t, rule, values, error) from None
        self._note(rule, q, adjustment.q)
        q[:], v[:] = adjustment.q, adjustment.v
        return after, adjustment.impulse

    def _push(self, rule: EventRule, values: Sequence[float], impulse: Array) -> Array:
        """Apply the generalized impulse of an event; return the state, add that of constraints."""
        core, t, push = self.core, self.core.t, np.zeros(self.nq)
        push[list(rule.impulses)] = values
        before = core.state
        reaction = self.push(push)
        if reaction is None:
            raise Stop(f"{rule.name}: the impulse is not defined at t = {t:.9g} s")
        after: Array = core.state
        q, v = self._split(after)
        self.check_linear(rule.name, t, q, self._split(before)[1], v)
        impulse[list(core.base)] += reaction
        self.fixed[1] = False
        return after

    def push(self, impulse: Array) -> Array | None:
        """Apply a generalized impulse; return the reaction as `SwitchingIntegrator.push`."""
        return self.core.push(impulse)

    def check_linear(self, at: str, t: float, q: Array, before: Array, after: Array) -> None:
        """Stop if an impulse takes velocities off a constraint that is nonlinear in them."""
        rows = sorted(set(self.system.nonlinear).intersection(self.base))
        if not rows:
            return
        old, new = (self.evaluator.constraints(t, q, v) for v in (before, after))
        change = np.abs(new.velocity(after) - old.velocity(before))
        off = [k for k in rows if change[k] > _OFF * new.velocity_scale[k]]
        if off:
            raise nonlinear_impulse(t, [at], [self.system.constraints[k] for k in off])

    def _note(self, rule: EventRule, given: Array, q: Array) -> None:
        """Record the coordinates that an event has moved besides those that it sets."""
        sizes = self.evaluator.sizes(self.core.t, q, np.zeros(self.nq))
        noticed = _NOTICED * np.abs(q / sizes).max(initial=0.0) * sizes
        moved = np.flatnonzero(np.abs(q - given) > noticed)
        if not len(moved) or rule.name in self.notes:
            return
        names = self.system.coordinates
        listed = [f"{names[i]} = {given[i]:.6g} → {q[i]:.6g}" for i in moved[:_LISTED]]
        more = ", …" if len(moved) > _LISTED else ""
        self.notes[rule.name] = (
            f"event `{rule.name}` moved further coordinates onto the constraints at"
            f" t = {self.core.t:.9g} s: {', '.join(listed)}{more}; set them, too, if they are to be"
            " elsewhere"
        )

    @property
    def accuracy(self) -> Array:
        """The absolute tolerances of the velocities, (nq,)."""
        return self._split(self.core.absolute_tolerances)[1]

    def _split(self, y: Array) -> tuple[Array, Array]:
        """Return q and v as views."""
        return y[: self.nq], y[self.nq : 2 * self.nq]

    @property
    def evaluator(self) -> Evaluator:
        """The equations with the present values of the parameters."""
        return self._equations.with_parameters(tuple(self.p))

    @property
    def _held(self) -> list[float]:
        return self.system.held_at(self.core.t, self.p)

    def _entry(
        self,
        what: Occurrence,
        which: int,
        y: Array,
        after: Array,
        work: float = 0.0,
        supplied: float = 0.0,
        impulse: Array | None = None,
    ) -> EventEntry:
        nq, modes = self.nq, self.core.modes[: len(self.switching.rows)]
        return EventEntry(
            time=self.core.t,
            occurrence=what,
            which=which,
            q=after[:nq].copy(),
            before=y[nq:-1].copy(),
            after=after[nq:-1].copy(),
            impulse=np.zeros(len(self.system.constraints)) if impulse is None else impulse,
            loss=0.0,
            supplied=supplied,
            work=work,
            modes=np.array(modes, dtype=int),
        )

    def inputs(self, y: Array) -> tuple[float, ...]:
        """Return (t, q, v, a, λ, p)."""
        _, a, multipliers = self.core.motion
        return (self.core.t, *y[:-1].tolist(), *a.tolist(), *multipliers.tolist(), *self.p)

    def _energy(self, y: Array) -> float:
        """Return v·p − L."""
        nothing = [0.0] * (self.nq + len(self.system.constraints))
        return float(self._energies((self.core.t, *y[:-1].tolist(), *nothing, *self.p))[0])

    def _check_gap(self, constraint: int, y: Array) -> None:
        """Refuse to engage a holonomic constraint that is violated."""
        system = self.system
        if constraint not in system.holonomic:
            return
        from lagcli.engine.switching.stops import check_engagement

        rows = self.switching.rows
        k = next(k for k, row in enumerate(rows) if row.row == constraint)
        out = self._constraint((self.core.t, *y[:-1].tolist(), *self.p))
        gap, name = out[system.holonomic.index(constraint)], system.constraints[constraint]
        check_engagement(self.core.t, name, gap, rows[k], self.core.no_gap(k))

    def _check_jump(self, event: str, constraint: int, y: Array) -> None:
        """Refuse to let velocities jump onto a constraint whose weight is in M."""
        name = self.system.constraints[constraint]
        if not any(x.row == constraint and x.weight is not None for x in self.switching.rows):
            return
        c = self.evaluator.constraints(self.core.t, *self._split(y))
        speed = c.velocity(self._split(y)[1])[constraint]
        if abs(speed) > np.abs(c.jacobian[constraint]) @ self.accuracy:
            raise Stop(
                f"event `{event}` engages `{name}` at t = {self.core.t:.9g} s, where its velocity"
                f" is {speed:.3g} instead of 0: the velocity of a coordinate without inertia would"
                " jump; engage it where it holds, or give the coordinate a mass"
            )


class RecordedInstants:
    """Collects the limits of a run, instant by instant.

    Parameters
    ----------
    rules : sequence of EventRule

    Attributes
    ----------
    records : bool
        Whether there is such an event.
    limits : list of OneSidedLimits
        One-sided limits of the completed instants.
    open : bool
        Whether an instant is in progress.
    first : int
        Index of the first log entry that actions of this instant may have added.
    """

    def __init__(self, rules: Sequence[EventRule]):
        self.rules = rules
        self.records = any(rule.record != () for rule in rules)
        self.limits: list[OneSidedLimits] = []
        self.open, self.first = False, 0
        self._entries: list[int] = []

    @property
    def recording(self) -> bool:
        """Whether an event at this instant records columns."""
        return bool(self._entries)

    def begin(self, left: Array, p: tuple[float, ...], first: int) -> None:
        """Begin an instant, with its limit from the left."""
        self.open, self._left, self._p, self.first, self._entries = True, left, p, first, []

    def add(self, count: int, entries: Sequence[EventEntry]) -> None:
        """Add entries to the first ``count`` ones of the log."""
        self._entries += [
            k
            for k, entry in enumerate(entries, count)
            if entry.occurrence == "event" and self.rules[entry.which].record != ()
        ]

    def end(self, right: Array | None, p: tuple[float, ...]) -> None:
        """End the instant, with its limit from the right; None if there is none."""
        if right is None:
            right = np.full_like(self._left, np.nan)
            right[0] = self._left[0]
        self.limits += [OneSidedLimits(k, self._left, right, self._p, p) for k in self._entries]
        self.open = False
