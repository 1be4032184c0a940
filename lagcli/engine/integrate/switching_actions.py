"""Actions of model events at an instant of the compiled engine."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.contract import EventEntry, IntegrationRequest, Occurrence, Stop
from lagcli.engine.core.status import Status
from lagcli.engine.switching.switching import EventRule
from lagcli.engine.system import System
from lagcli.engine.tape.interpreter import ScalarTape


class Actions:
    """Performs the actions of events, and counts their occurrences.

    Parameters
    ----------
    system : System
        With ``switching``.
    request : IntegrationRequest
    core : binding.SwitchingIntegrator

    Attributes
    ----------
    first_modes : tuple of int
        Modes of the switched rows at the start.
    stopped : str
        Name of the event that has stopped the run; empty if none has.
    """

    def __init__(self, system: System, request: IntegrationRequest, core: Any):
        assert system.switching is not None
        self.system, self.switching, self.core = system, system.switching, core
        self.p = list(request.state.p)
        self.times: Counter[int] = Counter()
        self.stopped = ""
        self.nq = len(system.coordinates)

    # made when needed: events may never happen

    @cached_property
    def _values(self) -> ScalarTape | None:
        return ScalarTape(self.switching.actions) if self.switching.actions else None

    @cached_property
    def _report(self) -> ScalarTape:
        return ScalarTape(self.system.report)

    @cached_property
    def _constraint(self) -> ScalarTape:
        return ScalarTape(self.system.constraint)

    @property
    def first_modes(self) -> tuple[int, ...]:
        """Modes of the switched rows at the start."""
        return tuple(self.core.first_modes[: len(self.switching.rows)])

    def react(self, changes: Sequence[tuple[int, str]]) -> list[EventEntry]:
        """Perform the actions of the events triggered at this instant, in the order of the file.

        Parameters
        ----------
        changes : sequence of (int, str)
            Changes of constraints at this instant.
        """
        conditions, entries = set(self.core.happened()), list[EventEntry]()
        for number, rule in enumerate(self.switching.events):
            happens = rule.change in changes if rule.change else rule.condition in conditions
            if not happens or (rule.times is not None and self.times[number] >= rule.times):
                continue
            self.times[number] += 1
            entries += self._act(number, rule)
            if rule.stop:
                self.stopped = f"`{rule.name}` stopped the run at t = {self.core.t:.9g} s"
        return entries

    def _act(self, number: int, rule: EventRule) -> list[EventEntry]:
        core, nq = self.core, self.nq
        y, energy = core.state, self._energy(core.state)
        after = y.copy()
        if self._values is not None and (rule.targets or rule.impulses):
            found = self._values(self._inputs(y))
            values = found[rule.first : rule.first + len(rule.targets)]
            for (what, index), value in zip(rule.targets, values, strict=True):
                if what == "p":
                    self.p[index] = value
                else:
                    after[index + (nq if what == "v" else 0)] = value
            if any(what == "p" for what, _ in rule.targets):
                core.set_parameters(self._held)
            core.place(after)
            if rule.impulses:
                push = np.zeros(nq)
                start = rule.first + len(rule.targets)
                push[list(rule.impulses)] = found[start : start + len(rule.impulses)]
                core.place(after)
                if core.push(push) != Status.RUNNING:
                    raise Stop(f"{rule.name}: the impulse is not defined at t = {core.t:.9g} s")
                after = core.state
        work = 0.0
        if rule.targets or rule.impulses:
            work = self._energy(after) - energy
            after[-1] = y[-1] + work
            core.place(after)
        entries = [self._entry("event", number, y, after, work)]
        rows = [row.row for row in self.switching.rows]
        for constraint in rule.release:
            core.activate(rows.index(constraint), False)
            entries.append(self._entry("releases", constraint, after, after))
        for constraint in rule.engage:
            self._check_gap(constraint, after)
            core.activate(rows.index(constraint), True)
            entries.append(self._entry("engages", constraint, after, after))
        return entries

    @property
    def _held(self) -> list[float]:
        return self.system.held_at(self.core.t, self.p)

    def _entry(
        self, what: Occurrence, which: int, y: Array, after: Array, work: float = 0.0
    ) -> EventEntry:
        nq, modes = self.nq, self.core.modes[: len(self.switching.rows)]
        return EventEntry(
            time=self.core.t,
            occurrence=what,
            which=which,
            q=after[:nq].copy(),
            before=y[nq:-1].copy(),
            after=after[nq:-1].copy(),
            impulse=np.zeros(len(self.system.constraints)),
            loss=0.0,
            supplied=0.0,
            work=work,
            modes=np.array(modes, dtype=int),
        )

    def _inputs(self, y: Array) -> tuple[float, ...]:
        """Return (t, q, v, a, λ, p)."""
        _, a, multipliers = self.core.motion
        return (self.core.t, *y[:-1].tolist(), *a.tolist(), *multipliers.tolist(), *self.p)

    def _energy(self, y: Array) -> float:
        """Return T + V."""
        nothing = [0.0] * (self.nq + len(self.system.constraints))
        kinetic, potential = self._report((self.core.t, *y[:-1].tolist(), *nothing, *self.p))[:2]
        return float(kinetic + potential)

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
