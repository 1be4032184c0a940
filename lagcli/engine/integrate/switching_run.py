"""Runs with contacts, friction and events.

The core finds the instants, their impacts and the next modes. It returns if an event of the model
has actions: they are performed here, and the core continues with the instant.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.contract import (
    CHANGES,
    Block,
    EventEntry,
    IntegrationRequest,
    Occurrence,
    Outcome,
    Stop,
)
from lagcli.engine.core.status import Status
from lagcli.engine.core.switching import SwitchingIntegrator
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.integrate.prepared import Prepared, explicit_time, prepare
from lagcli.engine.integrate.run import Integration
from lagcli.engine.integrate.switching_actions import Actions
from lagcli.engine.linear import dense
from lagcli.engine.linear.elimination import Elimination
from lagcli.engine.program.program import Program
from lagcli.engine.state import State
from lagcli.engine.switching.clocks import clocks_of, ticks_of
from lagcli.engine.switching.kinks import frozen_of, no_switching
from lagcli.engine.switching.recorded_instants import RecordedInstants
from lagcli.engine.switching.splitting import SplitSystem
from lagcli.engine.system import System

#: Capacity of the core's log.
_LOG_ROWS = 512
_OCCURRENCES: tuple[Occurrence, ...] = (
    *("closes", "opens", "slips", "sticks", "impact", "rest", "not unique", "redundant"),
)
#: Statuses of model events.
_OF_EVENTS: tuple[Occurrence, ...] = ("event", "releases", "engages")
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
_AT_SURFACES = (Status.SURFACES, Status.FORKED, Status.CORNER)
_IMPACTS = ("poisson", "newton", "sequential")


def rank_at(system: System, state: State) -> int:
    """Return the rank of B at a state."""
    if not system.constraints:
        return 0
    evaluator = Evaluator(system, state.p)
    found = evaluator.dynamics(state.t, state.q, state.v)
    return dense.count_rank(found.jacobian, sizes=evaluator.sizes(state.t, state.q, state.v))


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
        if split.base != system.held_at_start:  # a rank of all rows says nothing here
            rank = rank_at(split.fixed, request.state)
            request = request._replace(rank=rank, elimination=None)
        self.log: list[EventEntry] = []
        self.waiting: list[EventEntry] = []
        self.stopped, self.acted = "", False
        #: The entry of an event that engages a constraint, and the work before the velocities
        #: change.
        self.engaging: tuple[int, float] | None = None
        self.core: SwitchingIntegrator
        super().__init__(split.fixed, request, sink, progress)
        self.actions = Actions(self.whole, given, self.core)
        self.instants = RecordedInstants(self.split_system.switching.events)

    def ready(self, order: Elimination | None, known: Prepared | None) -> Prepared:
        """Return the programs for an order, or for none; later runs of the System reuse them."""
        self.common.prepared = prepare(self.system, order, self.common.prepared)
        return super().ready(order, self.common.prepared)

    def explicit_time(self) -> Program | None:
        """Return the program of the functions of time that steps resolve, with those of rows."""
        return explicit_time(self.split_system.system)

    def integrator(self, constraint: Program, settings: dict[str, Any]) -> SwitchingIntegrator:
        """Return a core whose rows switch."""
        chosen, changes = self.settings, self.start_changes()
        settings = settings | {"extra": len(self.split_system.rows)}
        if changes is not None:
            y = np.concatenate([settings["y"], np.ravel(changes)])
            settings |= {"y": y, "directions": len(changes)}
        state, switching = self.request.state, self.split_system.switching
        clocks, span = clocks_of(switching, state.p), (state.t, chosen.t_end)
        self.fault = next(filter(None, (clock.fault(span) for clock in clocks)), "")
        ticks = [] if self.fault else [(ticks_of(x.period, x.offset), x.most) for x in clocks]
        return SwitchingIntegrator(
            self.split_system,
            self.frozen,
            constraint,
            settings,
            impacts=_IMPACTS.index(chosen.impacts),
            closed=chosen.closed,
            log_rows=_LOG_ROWS,
            clocks=ticks,
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
        run.modes = self.actions.first_modes
        run.kinks, slid = self.core.crossings
        acted = any(run.modes) or self.acted or slid
        if acted or self.split_system.switching.force_coordinates:
            run.methods = tuple(dict.fromkeys([*(run.methods or (self.settings.method,)), _ACTING]))
        return run

    def integrate(self) -> None:
        """Integrate; a run that cannot be completed raises `Stop`."""
        if self.fault:
            raise Stop(self.fault)
        super().integrate()

    def handle_status(self, status: int) -> bool:
        """Handle a status of the core; return whether the run is complete."""
        core = self.core
        if self.frozen is not None:
            self.evaluator.p = (*self.actions.p, *core.branches)
        if status == Status.HAPPENED:
            return self.happen()
        if status == Status.RESOLVED:
            self.resolve()
            return False
        if status in _REFUSED or status == Status.FLOOR:
            from lagcli.engine.switching.messages import refusal

            self.collect()
            stop = refusal(
                self.split_system, status, core, self.settings.impacts, self.log, self.branches()
            )
            if stop is not None:
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
        from lagcli.engine.switching.messages import ending

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
        since, self.waiting = self.waiting, []
        changes = [(e.which, CHANGES[e.occurrence]) for e in since if e.occurrence in CHANGES]
        if not self.instants.open:
            y, a, multipliers = core.motion
            if not core.begun:  # before the initial state is complete
                a, multipliers = np.full_like(a, np.nan), np.full_like(multipliers, np.nan)
            left = np.concatenate([[core.t], y[:-1], a, multipliers, y[-1:]])
            self.instants.begin(left, tuple(self.actions.p))
        p = list(self.actions.p)
        entries = self.actions.react(changes)
        if self.actions.p != p and self.request.on_parameters is not None:
            self.request.on_parameters(tuple(self.actions.p))
        self.instants.add(len(self.log), entries)
        if self.engaging is None and any(e.occurrence == "engages" for e in entries):
            first = next(k for k, e in enumerate(entries) if e.occurrence == "engages")
            of_event = max(k for k in range(first) if entries[k].occurrence == "event")
            self.engaging = len(self.log) + of_event, float(core.state[-1])
        self.log += entries
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
        for entry in range(self.instants.first, len(self.log)):
            if self.log[entry].occurrence in _OF_EVENTS:
                self.log[entry] = self.log[entry]._replace(modes=modes)
        self.complete_engagement()
        status, row = self.core.sample_here()
        right = self.whole_rows(row[None])[0] if status == Status.RUNNING else None
        self.instants.end(right, tuple(self.actions.p))

    def complete_engagement(self) -> None:
        """Add the energy lost by the velocities to the entry of the event that engages."""
        if self.engaging is None:
            return
        (k, work), self.engaging = self.engaging, None
        state, entry = self.core.state, self.log[k]
        others = sum(e.supplied - e.loss + e.work for e in self.log[k + 1 :])
        self.log[k] = entry._replace(
            work=entry.work + float(state[-1]) - work - others, after=state[self.nq : -1].copy()
        )

    # samples

    def collect(self) -> None:
        """Emit the samples in the core's block, and copy its log."""
        entries = self.entries(self.core.take_log())
        self.log += entries
        self.waiting += entries
        super().collect()

    def entries(self, rows: Array) -> list[EventEntry]:
        """Return entries of the core's log, one for each row."""
        if not len(rows):
            return []
        ns, nq = len(self.split_system.switching.rows), self.nq
        first = 6 + ns
        places = [first, first + nq, first + 2 * nq, first + 3 * nq]
        modes = rows[:, 6:first].astype(int)
        self.acted = self.acted or bool(modes.any())
        columns = (
            rows[:, 0].tolist(),
            [_OCCURRENCES[k] for k in rows[:, 1].astype(int).tolist()],
            rows[:, 2].astype(int).tolist(),
            *(rows[:, i : i + nq] for i in places[:3]),
            rows[:, places[3] :],
            *rows[:, 3:6].T.tolist(),
            modes,
        )
        return [EventEntry._make(x) for x in zip(*columns, strict=True)]

    def emit(self, rows: Array) -> None:
        """Emit samples."""
        self.sink(Block.of_rows(self.whole_rows(rows), self.whole.sample_layout))

    def whole_rows(self, rows: Array) -> Array:
        """Return sample rows of the System, with λ of the core's constraints and of the switched
        rows."""
        if not self.split_system.rows:
            return rows
        return rows[:, self.split_system.sample_columns]
