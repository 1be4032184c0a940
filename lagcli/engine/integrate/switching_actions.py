"""Actions of model events at an instant."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.constraints.adjustment import (
    HeldRows,
    adjusted,
    held_during,
    impulse_of,
)
from lagcli.engine.constraints.initial import NoConsistentState, UndefinedStart
from lagcli.engine.contract import EventEntry, IntegrationRequest, Occurrence, Stop, Undefined
from lagcli.engine.core.status import Status
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.switching.stops import contradicting_values
from lagcli.engine.switching.switching import EventRule
from lagcli.engine.system import System
from lagcli.engine.tape.interpreter import ScalarTape

#: Moves of coordinates below this part of the largest coordinate, by inertia, are not noted.
_NOTICED = 1e-9
_LISTED = 4


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
    first_modes : tuple of int
        Modes of the switched rows at the start.
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
        self.rows = HeldRows((), (), {})
        self.notes: dict[str, str] = {}

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

    @cached_property
    def _equations(self) -> Evaluator:
        return Evaluator(self.system, tuple(self.p))

    @property
    def first_modes(self) -> tuple[int, ...]:
        """Modes of the switched rows at the start."""
        return tuple(self.core.first_modes[: len(self.switching.rows)])

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
            found = self._values(self.inputs(y))
            count = len(rule.targets)
            values = found[rule.first : rule.first + count]
            after, impulse = self.set(rule, y, values)
            if any(what == "p" for what, _ in rule.targets):
                core.set_parameters(self._held)
            core.place(after)
            if rule.impulses:
                first = rule.first + count
                after = self._push(rule, found[first : first + len(rule.impulses)], impulse)
        work = supplied = 0.0
        if rule.targets or rule.impulses:
            change = self._energy(after) - energy
            if impulse.any():
                drift = self.evaluator.constraints(core.t, *self._split(after)).drift
                supplied = -float(impulse @ drift)
            work = change - supplied
            after[-1] = y[-1] + change
            core.place(after)
        entries = [self._entry("event", number, y, after, work, supplied, impulse)]
        rows = [row.row for row in self.switching.rows]
        for constraint in rule.release:
            self.activate(rows.index(constraint), False)
            entries.append(self._entry("releases", constraint, after, after))
        for constraint in rule.engage:
            self._check_gap(constraint, after)
            self.activate(rows.index(constraint), True)
            entries.append(self._entry("engages", constraint, after, after))
        return entries

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
        self.rows = held_during(self.switching, rule, count, self.active, core.modes, core.no_gap)
        try:
            found = adjusted(self.evaluator, core.t, q, v, self.fixed, self.rows)
        except UndefinedStart as error:
            raise Undefined(error.state) from None
        except NoConsistentState as error:
            raise contradicting_values(self.system, core.t, rule, values, error) from None
        self._note(rule, q, found.q)
        q[:], v[:] = found.q, found.v
        return after, found.impulse

    def _push(self, rule: EventRule, values: Sequence[float], impulse: Array) -> Array:
        """Apply the generalized impulse of an event; return the state, add that of constraints."""
        core, t, push = self.core, self.core.t, np.zeros(self.nq)
        push[list(rule.impulses)] = values
        before = core.state
        if self.push(push) != Status.RUNNING:
            raise Stop(f"{rule.name}: the impulse is not defined at t = {t:.9g} s")
        after: Array = core.state
        (q, v), free = self._split(after), np.ones(self.nq, dtype=bool)
        change = v - self._split(before)[1]
        impulse += impulse_of(self.evaluator, t, q, v, change, self.base, free, push)
        self.fixed[1] = False
        return after

    def push(self, impulse: Array) -> int:
        """Apply a generalized impulse; return a status of the core."""
        return int(self.core.push(impulse))

    def _note(self, rule: EventRule, given: Array, q: Array) -> None:
        """Note which coordinates an event has moved besides those that it sets."""
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
