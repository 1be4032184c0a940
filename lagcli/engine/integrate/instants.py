"""Resolution of one instant: actions, impacts, modes, projections, in order."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lagcli.arrays import Array, Flags, Indices
from lagcli.engine.constraints.adjustment import adjusted, held_during
from lagcli.engine.constraints.initial import NoConsistentState, UndefinedStart
from lagcli.engine.constraints.projection import jumped
from lagcli.engine.contract import CHANGES, EventEntry, Occurrence, Undefined
from lagcli.engine.integrate.phases import Phases
from lagcli.engine.switching.problem import ContactLaw
from lagcli.engine.switching.reference.coupling import Coupling
from lagcli.engine.switching.reference.instant import ImpactOutcome, NextModes
from lagcli.engine.switching.stops import (
    check_engagement,
    contradicting_values,
    endless,
    jams,
    sets_violation,
)
from lagcli.engine.switching.switching import EventRule, RowMode

#: Largest number of rounds at one instant.
_ROUNDS = 100
#: Multiple of the rounding error of a sliding velocity below which a velocity that changes its sign
#: counts as zero. That of a redundant row at its limit may be larger.
_AT_REST = 1e3
#: Residuals above this part of a constraint's scale are caused by a jump.
_JUMPS = 1e-6


class Resolved(NamedTuple):
    """The state and the modes after an instant; the event that stops the run, if any."""

    y: Array
    modes: Indices
    stop: str | None


class InstantResolution:
    """Resolves one instant of a run.

    Parameters
    ----------
    run : Phases
        Receives the entries of the log.
    t : float
        s.
    y : (2 nq + 1,) array
        The state before the instant, on the active rows.
    """

    def __init__(self, run: Phases, t: float, y: Array):
        self.run, self.problems, self.rows, self.t = run, run.problems, run.rows, t
        q, v = run.motion.split(y)
        self.q, self.v, self.work = q.copy(), v.copy(), float(y[-1])
        self.modes = run.modes.copy()
        _, guess, _ = run.motion.accelerations(t, self.q, self.v)
        self.guess = np.nan_to_num(guess)
        self.names = run.system.constraints
        self.fixed = np.zeros((2, len(self.q)), dtype=bool)  # values set by events of this round
        self.stop: str | None = None
        self.entries: list[EventEntry] = []
        self.struck: ImpactOutcome | None = None  # the last impact

    def resolve(self, numbers: Sequence[int], started: bool) -> Resolved:
        """Handle the functions that fell through zero."""
        before = self._energy()
        ended, pinned, touched, fired = self._causes(numbers)
        for k in range(_ROUNDS):
            previous, first = self.modes.copy(), len(self.entries)
            self.fixed[:] = False
            for rule in sorted(fired):
                self._act(rule)
            if not k or any(map(self._interferes, fired)):
                self._settle(touched, ended, pinned)
            if started:
                self._log_changes(previous)
            self.entries[first:] = [x._replace(modes=self.modes) for x in self.entries[first:]]
            touched, ended, pinned = set(), set(), {}
            fired = self._following(self.entries[first:], started)
            if not fired or self.stop is not None:
                break
        else:
            raise endless(self.t, self.run.system, self.entries)
        self.work += self._energy() - before
        self.run.entries += self.entries
        return Resolved(np.concatenate([self.q, self.v, [self.work]]), self.modes, self.stop)

    def _causes(
        self, numbers: Sequence[int]
    ) -> tuple[set[int], dict[int, ContactLaw], set[int], list[int]]:
        """Return the causes: rows that open, laws of limited rows, contacts, and event rules."""
        run = self.run
        ended: set[int] = set()
        pinned: dict[int, ContactLaw] = {}
        touched: set[int] = set()
        fired = []
        rates, zero = self.problems.rates(self.t, self.q, self.v)
        for number in numbers:
            if number >= len(run.watched):
                fired.append(run.conditions.numbers[number - len(run.watched)])
                continue
            kind, k = run.watched[number]
            if kind in ("above", "below"):
                assert run.branches is not None
                run.branches.reach(k, kind == "above")
                continue
            row = self.rows[k]
            if kind == "jam":
                raise jams(self.t, run.system, [row])
            if kind == "force":
                ended.add(k)
            elif kind == "gap":
                touched.add(k)
            elif kind == "stick":
                forward = self.guess[row.row] < 0
                pinned[k] = ContactLaw.FORWARD if forward else ContactLaw.BACKWARD
            elif kind == "slip" and abs(rates[k]) <= _AT_REST * zero[k]:
                pinned[k] = ContactLaw.LIMITED  # at rest, except for rounding errors
        return ended, pinned, touched, fired

    # actions

    def _interferes(self, number: int) -> bool:
        """Return whether the actions of an event change the state or the active rows."""
        rule = self.run.switching.events[number]
        return bool(rule.targets or rule.impulses or rule.release or rule.engage)

    def _act(self, number: int) -> None:
        """Do the actions of an event."""
        run, rule = self.run, self.run.switching.events[number]
        run.conditions.fired(number)
        before, energy = self.v.copy(), self._energy()
        a, multipliers, _ = run.motion.accelerations(self.t, self.q, self.v)
        inputs = (self.t, *self.q.tolist(), *self.v.tolist(), *a.tolist(), *multipliers.tolist())
        values = iter(run.tapes.actions((*inputs, *run.full.p))[rule.first :])
        p = list(run.full.p)
        given = [next(values) for _ in rule.targets]
        for (kind, index), value in zip(rule.targets, given, strict=True):
            target = {"q": self.q, "v": self.v, "p": p}[kind]
            target[index] = value  # type: ignore[index]
            if kind != "p":
                self.fixed[int(kind == "v"), index] = True
        if tuple(p) != run.full.p:
            run.set_parameters(tuple(p))
        answer = np.zeros(len(self.names))
        if rule.targets:
            answer = self._adjust(rule, given)
        if rule.impulses:
            impulse = np.zeros(len(self.q))
            impulse[list(rule.impulses)] = [next(values) for _ in rule.impulses]
            d = self.problems.dynamics(self.t, self.q, self.v)
            bilateral = self.problems.bilateral()
            sizes = self.problems.sizes(self.t, self.q, self.v)
            coupling = Coupling(d, bilateral, [], sizes, self.problems.lengths)
            change, _ = coupling.answer(impulse, np.zeros(len(bilateral)))
            self.v = self.v + change
        for row in rule.release:
            self._set_active(row, False)
        for row in rule.engage:
            self._set_active(row, True)
            self._check_gap(row)
        if rule.engage or rule.targets:
            held = self.modes.copy()
            for k, switched in enumerate(self.rows):
                if switched.sign or switched.limit is not None:
                    held[k] = RowMode.OPEN  # the state of contacts is determined afterwards
                else:
                    held[k] = RowMode.HOLDS if self.problems.active[k] else RowMode.OPEN
            self.q, self.v = self.problems.projected(self.t, self.q, self.v, held)
        work = self._energy() - energy
        drift = run.full.constraints(self.t, self.q, self.v).drift
        supplied = -float(answer @ drift)
        self._log("event", number, before, work=work - supplied, supplied=supplied)
        self.entries[-1] = self.entries[-1]._replace(impulse=answer)
        for row in rule.release:
            self._log("releases", row, self.v)
        for row in rule.engage:
            self._log("engages", row, before)
        if rule.stop:
            self.stop = rule.name

    def _adjust(self, rule: EventRule, given: Sequence[float]) -> Array:
        """Move the values that an event does not set onto the constraints; return the impulse."""
        run, problems = self.run, self.problems
        self.held = held_during(
            run.switching,
            rule,
            len(self.names),
            problems.active.tolist(),
            self.modes.tolist(),
            lambda k: float(problems.gaps(self.t, self.q, self.v)[1][k]),
        )
        try:
            found = adjusted(run.full, self.t, self.q, self.v, self.fixed, self.held)
        except UndefinedStart as error:
            raise Undefined(error.state) from None
        except NoConsistentState as error:
            raise contradicting_values(run.system, self.t, rule, given, error) from None
        self.q, self.v = found.q, found.v
        return found.impulse

    def _set_active(self, row: int, active: bool) -> None:
        """Engage or release a constraint, with its friction."""
        for k, other in enumerate(self.rows):
            if row in (other.row, other.normal):
                self.problems.active[k] = active
                if not active:
                    self.modes[k] = RowMode.OPEN

    def _check_gap(self, row: int) -> None:
        """Stop if a holonomic constraint is engaged while it is violated."""
        system = self.run.system
        if row not in system.holonomic:
            return
        c = self.run.full.constraints(self.t, self.q, self.v)
        place = system.holonomic.index(row)
        engaged = next(r for r in self.rows if r.row == row)
        none = self.problems.closed * float(self.problems.position_scale[place])
        check_engagement(self.t, self.names[row], float(c.position[place]), engaged, none)

    # contacts

    def _settle(self, touched: set[int], ended: set[int], pinned: dict[int, ContactLaw]) -> None:
        """Resolve impacts, and determine the next modes."""
        zero_set: set[int] = set()
        for _ in range(_ROUNDS):
            touching = self._touching(touched)
            rates, zero = self.problems.rates(self.t, self.q, self.v)
            if not (touching & (rates < -zero)).any():
                break
            taking = np.flatnonzero(touching & (rates <= zero)).tolist()
            zero_set = self._impact(taking)
            ended = ended - set(taking)
        else:
            raise endless(self.t, self.run.system, self.entries)
        if self.run.branches is not None:
            self.run.branches.choose(self.t, self.q, self.v, self.run.motion.on_branches)
        resting = set(np.flatnonzero(touching & (np.abs(rates) <= zero)).tolist()) - ended
        fallen = self._fallen(touching & (rates > zero), resting, pinned) if zero_set else set()
        found = self._modes(resting | fallen, pinned)
        slow = {k for k in fallen if found.modes[k] != RowMode.HOLDS}
        if slow:
            fallen = fallen - slow
            found = self._modes(resting | fallen, pinned)
        for k in fallen:
            self._log("rest", self.rows[k].row, self.v, time=self._rest_time(k))
        self.modes, self.guess = found.modes, found.multipliers
        self._check_jump()
        before = self.v
        self.q, self.v = self.problems.projected(self.t, self.q, self.v, self.modes)
        if self.run.branches is not None:
            self.run.branches.check_corner(self.t, before, self.v)

    def _check_jump(self) -> None:
        """Stop if the constraints on a new branch change the positions."""
        branches, run = self.run.branches, self.run
        if branches is None or not branches.surfaces:
            return
        c, held = run.full.constraints(self.t, self.q, self.v), self.problems.held(self.modes)
        places = [k for k, row in enumerate(run.system.holonomic) if row in held]
        rows = c.jacobian[[run.system.holonomic[k] for k in places]]
        gaps, scales = c.position[places], self.problems.position_scale[places]
        if (np.abs(gaps) > _JUMPS * scales).any():
            change = np.linalg.lstsq(rows, gaps, rcond=None)[0]
            raise jumped(run.system, self.t, self.q, self.q - change)

    def _modes(self, resting: set[int], pinned: dict[int, ContactLaw]) -> NextModes:
        return self.problems.modes(
            self.t, self.q, self.v, sorted(resting), self.modes, pinned, self.guess
        )

    def _touching(self, touched: set[int]) -> Flags:
        gaps, allowed = self.problems.gaps(self.t, self.q, self.v)
        deep = self.problems.active & (gaps < -10 * allowed)
        if deep.any() and not touched.issuperset(np.flatnonzero(deep).tolist()):
            k = int(np.flatnonzero(deep)[0])
            row = self.rows[k]
            raise sets_violation(self.t, self.names[row.row], -float(gaps[k]), row)
        touching: Flags = self.problems.active & (gaps <= allowed)
        for k in touched:
            touching[k] = self.problems.active[k]
        return touching

    def _impact(self, contacts: list[int]) -> set[int]:
        """Compute the impact of contacts; return them."""
        before = self.v
        self.struck = found = self.problems.impact(self.t, self.q, before, contacts)
        drift = self.run.full.constraints(self.t, self.q, before).drift
        supplied = -float(found.impulse @ drift)
        losses = self._losses(found, contacts)
        for k in (k for k in contacts if found.impulse[self.rows[k].row]):
            self.run.impact_times.setdefault(k, []).append(self.t)
            row = self.rows[k].row
            self._log("impact", row, before, found, loss=losses[k], supplied=supplied)
            supplied = 0.0
        self.v = found.v
        return set(contacts)

    def _losses(self, found: ImpactOutcome, contacts: Sequence[int]) -> dict[int, float]:
        """Return the loss of each contact including its friction; other losses are assigned to the
        first one."""
        losses = {k: float(found.loss[self.rows[k].row]) for k in contacts}
        own = {self.rows[k].row: k for k in contacts}
        first = next((k for k in contacts if found.impulse[self.rows[k].row]), contacts[0])
        for row in self.rows:
            if row.limit is not None:
                losses[own.get(row.normal if row.normal is not None else -1, first)] += float(
                    found.loss[row.row]
                )
        return losses

    def _fallen(self, leaving: Flags, resting: set[int], pinned: dict[int, ContactLaw]) -> set[int]:
        """Return contacts whose bounce would remain within the gap that counts as closed."""
        if not leaving.any():
            return set()
        a = self._modes(resting, pinned).a
        d = self.problems.dynamics(self.t, self.q, self.v)
        rates, _ = self.problems.rates(self.t, self.q, self.v)
        _, allowed = self.problems.gaps(self.t, self.q, self.v)
        found = set()
        for k in np.flatnonzero(leaving).tolist():
            row = self.rows[k]
            fall = -row.sign * float(d.jacobian[row.row] @ a - d.rhs[row.row])
            if fall > 0 and rates[k] ** 2 <= 2 * fall * allowed[k]:
                found.add(k)
        return found

    def _rest_time(self, k: int) -> float:
        """Return the limit of a contact's impact times, by Aitken's extrapolation."""
        times = self.run.impact_times.get(k, [])
        if len(times) < 3:
            return self.t
        first, second = times[-2] - times[-3], times[-1] - times[-2]
        return times[-1] + (second**2 / (first - second) if first > second else 0.0)

    # the log

    def _log_changes(self, previous: Indices) -> None:
        """Log the changes of the modes."""
        rest = {x.which for x in self.entries if x.occurrence == "rest"}
        for k, row in enumerate(self.rows):
            was, now = RowMode(int(previous[k])), RowMode(int(self.modes[k]))
            if was == now or not self.problems.active[k]:
                continue
            if row.sign:
                if row.row not in rest:
                    self._log("opens" if now == RowMode.OPEN else "closes", row.row, self.v)
            elif row.limit is not None and RowMode.OPEN not in (was, now):
                self._log("sticks" if now == RowMode.HOLDS else "slips", row.row, self.v)

    def _log(
        self,
        occurrence: Occurrence,
        which: int,
        before: Array,
        impact: ImpactOutcome | None = None,
        loss: float = 0.0,
        supplied: float = 0.0,
        work: float = 0.0,
        time: float | None = None,
    ) -> None:
        self.entries.append(
            EventEntry(
                time=self.t if time is None else time,
                occurrence=occurrence,
                which=which,
                q=self.q.copy(),
                before=before.copy(),
                after=(self.v if impact is None else impact.v).copy(),
                impulse=np.zeros(len(self.names)) if impact is None else impact.impulse,
                loss=loss,
                supplied=supplied,
                work=work,
                modes=self.modes,
            )
        )

    def _following(self, entries: Sequence[EventEntry], started: bool) -> list[int]:
        """Return the event rules triggered by the changes of this round."""
        run = self.run
        happened = {(x.which, CHANGES[x.occurrence]) for x in entries if x.occurrence in CHANGES}
        fired = [
            k
            for k, rule in enumerate(run.switching.events)
            if rule.change in happened and not run.conditions.exhausted(k)
        ]
        if started and entries:
            run.enter(self.modes, self.t, self.q, self.v)
            y = np.concatenate([self.q, self.v, [0.0]])
            fired += run.conditions.jumped(run.condition_values(self.t, y))
        return fired

    def _energy(self) -> float:
        return self.run.energy(self.t, self.q, self.v)
