"""The reference engine for systems that switch: modes, instants, impacts, events.

Each mode is a phase of the integration with its own right-hand side and projection. In every step
the functions that end the mode are monitored; when one falls through zero, the instant is resolved,
and the integration restarts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.constraints.singular import RankWatch
from lagcli.engine.contract import Block, IntegrationRequest, Stop, Stopped
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.integrate.instants import InstantResolution
from lagcli.engine.integrate.phases import Phases
from lagcli.engine.integrate.scipy_integration import ScipyIntegration
from lagcli.engine.switching.kinks import frozen_of
from lagcli.engine.switching.recorded_instants import RecordedInstants
from lagcli.engine.switching.reference.crossings import Crossings, first_crossings
from lagcli.engine.switching.stops import endless, jamming, jams
from lagcli.engine.switching.switching import RowMode
from lagcli.engine.system import System

#: Largest number of instants at one time; times of one instant, relative to max(|t|, 1).
_ROUNDS, _SAME = 100, 1e-12


class SwitchedIntegration(ScipyIntegration):
    """A run of a system that switches."""

    phases: Phases

    def __init__(
        self,
        system: System,
        request: IntegrationRequest,
        sink: Callable[[Block], None],
        progress: Callable[[float], None] | None,
    ):
        self.frozen = frozen_of(system)
        if self.frozen is not None:
            system = self.frozen.system
            request = request._replace(state=self.frozen.frozen(request.state))
        super().__init__(system, request, sink, progress)
        self.entries = self.phases.entries
        self.start_modes = tuple(int(x) for x in self.phases.modes)
        self.phases.on_parameters = self._tell_parameters
        self.instants = RecordedInstants(self.phases.switching.events)
        self.limits_of_events = self.instants.limits
        self._last, self._rounds = -math.inf, 0
        self._landing: Crossings | None = None

    def row(self, t: float, y: Array, moving: bool = True) -> Array:
        """Return the sample row of a state; a and λ are NaN if they are undefined."""
        q, v = self.motion.split(y)
        a, multipliers, _ = self.motion.accelerations(t, q, v)
        row = np.concatenate([[t], q, v, a, multipliers, y[-1:]])
        if not moving:
            layout = self.system.sample_layout
            row[layout.a] = row[layout.multipliers] = np.nan
        return row

    def _tell_parameters(self, p: tuple[float, ...]) -> None:
        """Emit the samples before parameters change, and report the new values."""
        self.emit()
        if self.request.on_parameters is not None:
            self.request.on_parameters(p)

    def prepare(self, evaluator: Evaluator) -> None:
        """Create the right-hand side, projection and monitor of the initial modes."""
        self.phases = Phases(evaluator, self.request, self.frozen)
        self._take_phase()

    def _take_phase(self) -> None:
        """Use the right-hand side, projection and monitor of the current modes."""
        self.motion = motion = self.phases.motion
        self.projection = self.phases.problems.projection(motion.held, motion.rank)
        self.watch = RankWatch(motion)
        if self.sizes is not None:
            self.sizes.motion = motion

    def project(self, t: float, y: Array) -> Array:
        """Return the nearest consistent state, on the sliding surface if there is one."""
        y = super().project(t, y)
        branches = self.phases.branches
        if branches is None or branches.slides is None:
            return y
        q, v = self.motion.split(y)
        held = branches.held(t, q, v, self.phases.motion.on_branches)
        return y if held is v else np.concatenate([q, held, y[-1:]])

    def begin_run(self, t: float, y: Array) -> Array:
        """Resolve the initial instant."""
        # initial modes, so that forces in conditions are defined
        y = self.resolve(t, y, (), started=False)
        self.start_modes = tuple(int(x) for x in self.phases.modes)
        self.phases.conditions.start(self.phases.condition_values(t, y))
        return self.begin(t, y)

    def next_stop(self, t: float) -> float:
        """Return the next time at which a step must end."""
        stop = super().next_stop(t)
        return stop if self._landing is None or self._landing.time <= t else self._landing.time

    def react(
        self, inside: Callable[[float], Array], t_old: float, t: float, end: float
    ) -> tuple[float, Array] | None:
        """Resolve the first instant of a step; return the state from which to continue."""
        timed = self._timed_rules()

        def functions(at: float) -> Array:
            return self.phases.values(at, inside(at))

        def counted(values: Array) -> Array:
            of_modes = np.arange(len(values)) < len(self.phases.watched)
            # the new function is positive, except for rounding
            return np.where(of_modes & (values <= 0), 0.0, values)

        def seen(at: float) -> bool:
            return self.phases.conditions.follow(self.phases.condition_values(at, inside(at)))

        found = first_crossings(functions, t_old, end, self.phases.noise(), counted, seen)
        landing = self._landing
        if landing is not None and end == landing.time and (found is None or found.time >= end):
            return self.instant(inside, end, landing.numbers)
        if found is None:
            self.phases.measure(end, inside(end))
            return None
        rules = [
            self.phases.conditions.numbers[k - len(self.phases.watched)]
            for k in found.numbers
            if k >= len(self.phases.watched)
        ]
        if found.time < end and any(rule in timed for rule in rules):
            self._landing = found  # a given time is the end of a step
            return t_old, inside(t_old)
        return self.instant(inside, found.time, found.numbers)

    def floor(self, t: float, y: Array, remark: str) -> Stop:
        """Return the end of a run at the minimum step size, by jamming or otherwise."""
        modes = zip(self.phases.rows, self.phases.modes, strict=True)
        slipping = [row for row, mode in modes if RowMode(int(mode)).slips]
        if jamming(self.phases.motion.margin, slipping):
            return jams(t, self.system, slipping)
        return super().floor(t, y, remark)

    def _timed_rules(self) -> set[int]:
        times = self.phases.switching.condition_times
        return {
            k
            for k in self.phases.conditions.numbers
            if (number := self.phases.switching.events[k].condition) is not None
            and number < len(times)
            and times[number]
        }

    def instant(
        self, inside: Callable[[float], Array], t: float, numbers: Sequence[int]
    ) -> tuple[float, Array]:
        """Sample up to an instant, and resolve it."""
        for at in self.due(math.nextafter(t, -math.inf)):
            self.sample(at, inside(at))
        self._landing = None  # the instant may change the time
        step = abs(t - self._last)
        self._rounds = self._rounds + 1 if step <= _SAME * max(abs(t), 1.0) else 0
        self._last = t
        if self._rounds > _ROUNDS:
            raise endless(t, self.system, self.entries)
        y = self.project(t, inside(t))
        y = self.resolve(t, y, numbers, started=True)
        for at in self.due(t):
            self.sample(at, y)
        return t, y

    def resolution(self, t: float, y: Array) -> InstantResolution:
        """Return the resolution of an instant."""
        return InstantResolution(self.phases, t, y)

    def resolve(self, t: float, y: Array, numbers: Sequence[int], started: bool) -> Array:
        """Resolve an instant; return the state afterwards, in its new modes."""
        y, stop = self.pass_instant(t, y, numbers, started)
        if stop is not None:
            for at in self.due(t):
                self.sample(at, y)
            raise Stopped(stop, t)
        return y

    def pass_instant(
        self, t: float, y: Array, numbers: Sequence[int], started: bool
    ) -> tuple[Array, str | None]:
        """Resolve an instant; return the state afterwards, and the event that stops the run, if
        any."""
        logged, records = len(self.phases.entries), self.instants.records
        if records:
            self.instants.begin(self.row(t, y, moving=started), self.phases.parameters)
        if self.phases.branches is not None and self.sizes is not None:
            self.phases.branches.acceleration_terms = self.sizes.acceleration_terms
        found = self.resolution(t, y).resolve(numbers, started)
        if self.phases.branches is not None:
            self.kinks = self.phases.branches.crossed
        self.phases.enter(found.modes, t, *self.motion.split(found.y))
        self._take_phase()
        if records:
            self.instants.add(logged, self.phases.entries[logged:])
            self.instants.end(self.row(t, found.y), self.phases.parameters)
        if self.sizes is not None:
            self.sizes.restart(t, found.y)
        return found.y, found.stop
