"""Phases of a run that switches: modes, their right-hand side, and the functions that end them."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from lagcli.arrays import Array, Indices
from lagcli.engine.contract import EventEntry, IntegrationRequest
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.switching.kinks import FrozenSystem
from lagcli.engine.switching.reference.branches import Branches
from lagcli.engine.switching.reference.conditions import Conditions
from lagcli.engine.switching.reference.instant import InstantProblems
from lagcli.engine.switching.reference.modal import ModalMotion
from lagcli.engine.switching.reference.tapes import SwitchingTapes
from lagcli.engine.switching.switching import RowMode
from lagcli.engine.tape.interpreter import ScalarTape

#: Gaps, rates and forces below this part of their scale, or of the largest force, are rounding
#: errors.
_GAP_NOISE, _FORCE_NOISE = 4e-15, 1e-13
#: Multipliers of redundant contacts above this part of the largest are not rounding errors.
_SHARED = 1e-9
#: Index of the total energy among the outputs of the report tape.
_ENERGY = 2


class Watched(NamedTuple):
    """A function that ends a mode when it falls through zero, and its row."""

    kind: str  # gap, force, stick, slip, jam, below, above: of a kink
    row: int


class Phases:
    """The modes of a run, and the functions that end them.

    Parameters
    ----------
    evaluator : Evaluator
        Evaluator of a System with ``switching``.
    request : IntegrationRequest

    Attributes
    ----------
    motion : ModalMotion
        The right-hand side in the current modes.
    watched : list of Watched
        Event functions of the modes; the conditions of events follow these in `values`.
    impact_times : dict of int to list of float
        Impact times by switched row, s.
    entries : list of EventEntry
        The log.
    branches : Branches or None
        Branches of the kinks, if the System is frozen.
    on_parameters : callable
        Called with the values of the parameters when they change.
    """

    def __init__(
        self,
        evaluator: Evaluator,
        request: IntegrationRequest,
        frozen: FrozenSystem | None = None,
    ):
        system, settings, state = evaluator.system, request.settings, request.state
        assert system.switching is not None
        self.system, self.switching, self.full = system, system.switching, evaluator
        self.rows = system.switching.rows
        self.tapes = SwitchingTapes(system)
        self.conditions = Conditions(system.switching.events)
        self.problems = InstantProblems(
            evaluator,
            self.tapes,
            settings.closed,
            settings.impacts,  # type: ignore[arg-type]
            settings.t_end - state.t,
        )
        held = [row.holds_at_start for row in self.rows]
        self.modes: Indices = np.where(held, int(RowMode.HOLDS), int(RowMode.OPEN))
        self.impact_times: dict[int, list[float]] = {}
        self.entries: list[EventEntry] = []
        self._forces = np.zeros(len(system.constraints))
        self.on_parameters: Callable[[tuple[float, ...]], None] = lambda p: None
        self._report = ScalarTape(system.report)
        span = settings.t_end - state.t
        self.branches = None if frozen is None else Branches(frozen, evaluator, span)
        self.motion = self._motion(state.t, state.q, state.v)
        self.problems.measure(state.t, state.q, state.v, self.motion)
        self.enter(self.modes, state.t, state.q, state.v)

    def enter(self, modes: Indices, t: float, q: Array, v: Array) -> None:
        """Set the modes from a state on."""
        self.modes = modes
        before, self.motion = self.motion, self._motion(t, q, v)
        self.motion.evaluations, self.motion.damping = before.evaluations, before.damping
        self.watched = self._watched()

    def set_parameters(self, p: tuple[float, ...]) -> None:
        """Continue with other values of the parameters."""
        self.full = self.problems.evaluator = self.full.with_parameters(p)
        self.motion.full = self.motion.held.full = self.full
        if self.branches is not None:
            self.branches.full = self.full
        self.on_parameters(self.parameters)

    @property
    def parameters(self) -> tuple[float, ...]:
        """The parameters of the model, without branches."""
        return self.full.p if self.branches is None else self.branches.given

    def energy(self, t: float, q: Array, v: Array) -> float:
        """Return the total energy."""
        nothing = (0.0,) * (len(q) + len(self.system.constraints))
        return self._report((t, *q.tolist(), *v.tolist(), *nothing, *self.full.p))[_ENERGY]

    def measure(self, t: float, y: Array) -> None:
        """Record the largest scales of the rows."""
        self.problems.measure(t, *self.motion.split(y), self.motion)

    def _motion(self, t: float, q: Array, v: Array) -> ModalMotion:
        rows = self.problems.held(self.modes)
        rank = self.problems.rank(t, q, v, rows)
        motion = ModalMotion(self.full, self.tapes, rows, self.modes, rank)
        motion.branches = self.branches
        motion.measure(t, q, v)
        return motion

    def _watched(self) -> list[Watched]:
        """Return the functions that end the current modes."""
        found: list[Watched] = []
        for k, (row, mode) in enumerate(zip(self.rows, self.modes, strict=True)):
            if row.sign and mode == RowMode.HOLDS:
                found.append(Watched("force", k))
            elif row.sign and self.problems.active[k]:
                found.append(Watched("gap", k))
            elif row.limit is not None and mode == RowMode.HOLDS:
                found.append(Watched("stick", k))
            elif RowMode(int(mode)).slips:
                found.append(Watched("slip", k))
                found.append(Watched("jam", k))
        if self.branches is not None:
            found += [Watched("above" if up else "below", k) for k, up in self.branches.watched()]
        return found

    def values(self, t: float, y: Array) -> Array:
        """Return the event functions of the modes, then those of the events' conditions."""
        q, v = self.motion.split(y)
        motion, branches = self.motion, self.branches
        needs = self.tapes.conditions_on_forces or any(
            w.kind in ("force", "stick", "jam") for w in self.watched
        )
        needs = needs or (branches is not None and branches.slides is not None)
        c = self.full.constraints(t, q, v)
        velocity = c.velocity(v)
        functions = np.zeros(0) if branches is None else branches.values(t, q, v)
        forces, limits = None, None
        if needs:
            a, multipliers, _ = motion.accelerations(t, q, v)
            forces = motion.inputs(t, q, v, a, multipliers)
            limits = self.tapes.limits(forces)
            slack = self._common_slack(t, q, v, a, multipliers)
            self._forces = np.fmax(self._forces, np.abs(multipliers))
        out = []
        for kind, k in self.watched:
            if kind in ("above", "below"):
                assert branches is not None
                out.append(branches.distance(functions, k, kind == "above"))
                continue
            row = self.rows[k]
            if kind == "gap":
                out.append(row.sign * c.position[self.system.holonomic.index(row.row)])
            elif kind == "slip":
                out.append(velocity[row.row] * (1 if self.modes[k] == RowMode.FORWARD else -1))
            elif kind == "jam":
                out.append(motion.margin)
            else:
                margin = row.sign * multipliers[row.row]
                if kind == "stick":
                    assert limits is not None
                    margin = limits.static[row.limit] - abs(multipliers[row.row])
                out.append(slack.get(row.row, margin))
        if not self.conditions.numbers:
            return np.array(out)
        conditions = self.condition_values(t, y, forces)
        return np.concatenate([out, self.conditions.watched(conditions)])

    def condition_values(
        self, t: float, y: Array, forces: tuple[float, ...] | None = None
    ) -> Array:
        """Return the functions of the conditions."""
        if not self.conditions.numbers:
            return np.zeros(0)
        q, v = self.motion.split(y)
        if forces is None and self.tapes.conditions_on_forces:
            a, multipliers, _ = self.motion.accelerations(t, q, v)
            forces = self.motion.inputs(t, q, v, a, multipliers)
        inputs = (t, *q.tolist(), *v.tolist(), *self.full.p)
        return self.conditions.values(self.tapes.conditions(inputs, forces))

    def noise(self) -> Array:
        """Return below which size the functions are rounding, those of conditions 0."""
        problems, places = self.problems, self.system.holonomic
        found = []
        for kind, k in self.watched:
            if kind in ("above", "below"):
                assert self.branches is not None
                found.append(_GAP_NOISE * self.branches.noise(k))
                continue
            row = self.rows[k].row
            if kind == "gap":
                found.append(_GAP_NOISE * problems.position_scale[places.index(row)])
            elif kind == "slip":
                found.append(_GAP_NOISE * problems.velocity_scale[row])
            else:
                found.append(0.0 if kind == "jam" else _FORCE_NOISE * self._forces[row])
        return np.concatenate([found, np.zeros(len(self.conditions.numbers))])

    def size_of(self, number: int) -> float:
        """Return the largest size of a function of `values` so far.

        For a gap, the change at the row's largest rate during the run.
        """
        if number >= len(self.watched):
            return float(self.conditions.largest[number - len(self.watched)])
        kind, k = self.watched[number]
        if kind in ("above", "below"):
            assert self.branches is not None
            return self.branches.noise(k)
        row = self.rows[k].row
        if kind == "gap":
            return float(self.problems.velocity_scale[row]) * self.problems.duration
        return float(self.problems.velocity_scale[row] if kind == "slip" else self._forces[row])

    def _common_slack(
        self, t: float, q: Array, v: Array, a: Array, multipliers: Array
    ) -> dict[int, float]:
        """Return the common slack of redundant contacts in their laws, by constraint.

        The largest s such that some λ with the same forces satisfies each law with slack s.
        """
        motion = self.motion
        if not (motion.redundant and motion.cones):
            return {}
        from scipy.optimize import linprog

        inputs = motion.inputs(t, q, v, a, multipliers)
        free = motion.free_multipliers(self.full.dynamics(t, q, v), inputs)
        if not free.shape[1]:
            return {}
        rows, bounds = motion.cone_rows(t, q, v, a, multipliers)
        along = rows @ free
        shared = np.abs(along).max(axis=1) > _SHARED * np.abs(rows).max(axis=1)
        if not shared.any():
            return {}
        n, large = free.shape[1], float(np.abs(multipliers).max()) or 1.0
        found = linprog(
            np.append(np.zeros(n), -1.0),
            A_ub=np.hstack([-along[shared], np.ones((int(shared.sum()), 1))]),
            b_ub=-bounds[shared],
            bounds=[(None, None)] * n + [(None, large)],
        )
        if found.status != 0:
            return {}
        slack: dict[int, float] = {}
        # a law that is independent of the choice has a larger slack: only the others end the mode
        owners = [
            row for row, is_shared in zip(motion.cone_owners(), shared, strict=True) if is_shared
        ]
        for row, price in zip(owners, found.ineqlin.marginals, strict=True):
            if abs(price) > _SHARED:
                slack[row] = -float(found.fun)
            else:
                slack.setdefault(row, large)
        return slack
