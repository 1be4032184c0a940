"""Derivatives of an instant: its actions and impacts, differentiated in order.

The state at the instant, whose time also depends on the parameters, changes by

    δt = dt*/dθ,  δx⁻ = S⁻ + f⁻ δt;

each action and impact maps this change, and S⁺ = δx⁺ − f⁺ δt.

References: Hiskens & Pai, Trajectory sensitivity analysis of hybrid systems, IEEE Trans. Circuits
Syst. I 47 (2000), doi:10.1109/81.828574; Leine & Nijmeijer, Dynamics and Bifurcations of
Non-Smooth Mechanical Systems, 2004, chapter 7.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from lagcli.arrays import Array, Indices
from lagcli.engine.constraints.adjustment import adjusted
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.integrate.instants import InstantResolution
from lagcli.engine.integrate.phases import Phases
from lagcli.engine.sensitivity.changes import Change, DirectionalSystem, PerturbedState
from lagcli.engine.sensitivity.impulsive import ImpulsiveRow, Jump, JumpMatrices, jump
from lagcli.engine.sensitivity.linearized_constraints import positions_on
from lagcli.engine.sensitivity.modal_tangent import motion_change
from lagcli.engine.switching.impacts import ImpactStage
from lagcli.engine.switching.reference.instant import ImpactOutcome
from lagcli.engine.switching.switching import EventRule, RowMode

#: Changes of a gap at an impact below this part of its terms, or its scale, are rounding errors.
_APART, _NO_GAP = 1e-6, 1e-9
#: Largest relative difference of velocities between an impact here and in the engine.
_ALIKE = 1e-6
#: Moves onto constraints below this part of the coordinates are rounding errors.
_MOVES = 1e-9
#: Weights and step of central differences of sixth order.
_WEIGHTS, _STEP = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}, 1e-4


class DifferentiatedResolution(InstantResolution):
    """Resolves one instant, and propagates the changes of the state through it.

    Parameters
    ----------
    run, t, y
        See `InstantResolution`.
    system : DirectionalSystem
    change : Change
        Change of the state before the instant, and of its time.

    Attributes
    ----------
    change : Change
        Change of the current state; NaN in directions without a derivative.
    jumped : bool
        Whether an action or an impact has changed the state, the parameters, or the active rows.
    reasons : list of str
        Why directions have no derivative.
    """

    def __init__(self, run: Phases, t: float, y: Array, system: DirectionalSystem, change: Change):
        super().__init__(run, t, y)
        self.system, self.change = system, change
        self.jumped, self.reasons = False, list[str]()

    def lose(self, directions: Array, reason: str) -> None:
        """End the derivatives in some directions."""
        if directions.any():
            self.change = self.change._replace(
                q=np.where(directions, np.nan, self.change.q),
                v=np.where(directions, np.nan, self.change.v),
            )
            self.reasons.append(reason)

    # impacts

    def _impact(self, contacts: list[int]) -> set[int]:
        q, v = self.q.copy(), self.v.copy()
        taking = super()._impact(contacts)
        self.jumped = True
        assert self.struck is not None
        self._check_order(contacts, q, v)
        self._differentiate_impact(self.struck, q, v)
        return taking

    def _check_order(self, contacts: Sequence[int], q: Array, v: Array) -> None:
        """End derivatives in directions in which the contacts of an impact would not close
        simultaneously."""
        gaps = self._at(q, v).constraints().position
        jacobian = self.run.full.constraints(self.t, q, v).jacobian
        scale = self.problems.position_scale
        for k in contacts:
            row = self.rows[k].row
            place = self.run.system.holonomic.index(row)
            gap = gaps[place]
            terms = np.abs(jacobian[row]) @ np.abs(self.change.q)
            terms = terms + np.abs(jacobian[row] @ v * self.change.t)
            apart = np.abs(gap) > np.maximum(_APART * terms, _NO_GAP * scale[place])
            self.lose(
                apart,
                f"contacts close simultaneously there, `{self.names[row]}` among them, and their"
                " order decides",
            )

    def _differentiate_impact(self, found: ImpactOutcome, q: Array, v: Array) -> None:
        state = self._at(q, v)
        coefficients, slopes = self.run.tapes.impact(state.inputs), state.along("impact")
        unilateral = self.run.tapes.unilateral
        restitution = {
            row.row: (coefficients[0][k], slopes[k])
            for k, row in enumerate(x for x in self.rows if x.sign)
        }
        friction = {
            row.row: (coefficients[1][row.limit], slopes[unilateral + row.limit], row.normal)
            for row in self.rows
            if row.limit is not None
        }
        at = self._matrices(q, v)
        nothing = np.zeros(self.change.directions)
        now, before = v, Jump(v, np.zeros(0), self.change.v, np.zeros((0, 0)))
        for stage in found.stages:
            rows = [ImpulsiveRow(row, True, 0.0, nothing) for row in found.bilateral]
            for i, row in enumerate(stage.rows.tolist()):
                mode, unit = RowMode(int(stage.modes[i])), (0.0, nothing)
                e, de = restitution.get(row, unit)
                if mode == RowMode.HOLDS:
                    some = (e, de) if stage.part == "newton" else unit
                    rows.append(ImpulsiveRow(row, True, *some))
                elif mode.slips:
                    mu, dmu, normal = friction[row]
                    assert normal is not None
                    side = self._side(mode, normal, stage)
                    rows.append(ImpulsiveRow(row, False, side * mu, side * dmu, normal))
                elif stage.part == "expansion":
                    returned, change = before.impulse[row], before.dimpulse[row]
                    rows.append(ImpulsiveRow(row, False, e * returned, de * returned + e * change))
                else:
                    rows.append(ImpulsiveRow(row, False, 0.0, nothing))
            before = jump(at, now, before.dv, rows)
            now = before.v
        size = float(np.abs([now, v]).max())
        self.change = self.change._replace(v=before.dv)
        if not (np.abs(now - found.v).max() <= _ALIKE * size):
            everywhere = np.ones(self.change.directions, dtype=bool)
            self.lose(everywhere, "what the impact does there is not determined by its modes")

    def _side(self, mode: RowMode, normal: int, stage: ImpactStage) -> float:
        """Return the sign of a slipping row's impulse relative to that of its normal."""
        row = next((x for x in self.rows if x.row == normal), None)
        sign = float(row.sign) if row is not None and row.sign else 0.0
        if not sign:
            sign = float(np.sign(stage.impulse[stage.rows.tolist().index(normal)]))
        return -sign if mode == RowMode.FORWARD else sign

    # actions

    def _act(self, number: int) -> None:
        rule, run, t = self.run.switching.events[number], self.run, self.t
        if not self._interferes(number):
            super()._act(number)
            return
        self.jumped = True
        q, v, p = self.q.copy(), self.v.copy(), run.full.p
        reached = motion_change(self._at(q, v))
        inputs = run.motion.inputs(t, q, v, reached.a, reached.multipliers)
        values = run.tapes.actions(inputs)[rule.first :]
        changes = self.change.inputs([reached.da, reached.dmultipliers])
        slopes = self.system.along("actions", inputs, changes)[rule.first :]
        super()._act(number)
        new, own = (q, v, list(p)), tuple(np.array(x) for x in self.change[1:])
        for (kind, index), x, dx in zip(rule.targets, values, slopes, strict=False):
            which = "qvp".index(kind)
            new[which][index], own[which][index] = x, dx
        self.change = Change(self.change.t, *own)
        if rule.targets:
            self._differences_of_adjustment(q, v)
            found = adjusted(run.full, t, q, v, self.fixed, self.held)
            q, v = found.q, found.v
        if rule.impulses:
            v = self._differentiate_impulse(rule, q, v, len(rule.targets), values, slopes)
        if rule.engage or rule.targets:
            self._differentiate_projection(q, v)

    def _differentiate_impulse(
        self, rule: EventRule, q: Array, v: Array, first: int, values: Sequence[float], dx: Array
    ) -> Array:
        """Propagate the changes through a generalized impulse; return the velocities after it."""
        places, count = list(rule.impulses), len(rule.impulses)
        given, changes = np.zeros(len(q)), np.zeros((len(q), self.change.directions))
        given[places] = values[first : first + count]
        changes[places] = dx[first : first + count]
        nothing = np.zeros(self.change.directions)
        # the velocity of each row is unchanged
        bilateral = self._bilateral_before(rule)
        rows = [ImpulsiveRow(row, True, -1.0, nothing) for row in bilateral]
        found = jump(self._matrices(q, v), v, self.change.v, rows, (given, changes))
        self.change = self.change._replace(v=found.dv)
        return found.v

    def _bilateral_before(self, rule: EventRule) -> list[int]:
        """Return the constraints that were active before the event's own changes."""
        now = set(self.problems.bilateral()) - set(rule.engage)
        released = {
            r.row for r in self.rows if r.row in rule.release and not r.sign and r.limit is None
        }
        return sorted(now | released)

    def _differentiate_projection(self, q: Array, v: Array) -> None:
        """Propagate the changes through the projection after an action."""
        held = self.problems.held(self._modes_of_projection())
        size = float(np.abs(q).max(initial=0.0))
        if np.abs(self.q - q).max(initial=0.0) > _MOVES * size:
            self._differences_of_projection(q, v)
            return
        self.change = positions_on(self._at(q, v), held)
        nothing = np.zeros(self.change.directions)
        rows = [ImpulsiveRow(row, True, 0.0, nothing) for row in held]
        found = jump(self._matrices(q, v), v, self.change.v, rows)
        self.change = self.change._replace(v=found.dv)

    def _modes_of_projection(self) -> Indices:
        held = np.full(len(self.rows), int(RowMode.OPEN))
        for k, row in enumerate(self.rows):
            if not row.sign and row.limit is None and self.problems.active[k]:
                held[k] = RowMode.HOLDS
        return held

    def _differences_of_adjustment(self, q: Array, v: Array) -> None:
        """Differentiate how the values that an event does not set follow."""

        def adjust(evaluator: Evaluator, t: float, q: Array, v: Array) -> tuple[Array, Array]:
            found = adjusted(evaluator, t, q, v, self.fixed, self.held)
            return found.q, found.v

        if self.held.velocities or self.held.contacts:
            self._differences(adjust, q, v)

    def _differences_of_projection(self, q: Array, v: Array) -> None:
        """Differentiate a projection that moves the coordinates."""
        held, problems = self._modes_of_projection(), self.problems

        def project(evaluator: Evaluator, t: float, q: Array, v: Array) -> tuple[Array, Array]:
            problems.evaluator = evaluator
            return problems.projected(t, q, v, held)

        evaluator = problems.evaluator
        self._differences(project, q, v)
        problems.evaluator = evaluator

    def _differences(
        self,
        function: Callable[[Evaluator, float, Array, Array], tuple[Array, Array]],
        q: Array,
        v: Array,
    ) -> None:
        """Propagate the changes through a function of the state, by central differences."""
        evaluator, given = self.problems.evaluator, self.change
        parts = given.q.copy(), given.v.copy()
        for k in range(given.directions):
            q_k, v_k = np.zeros(len(q)), np.zeros(len(v))
            size = max(1.0, *(float(np.abs(x[..., k]).max(initial=0.0)) for x in given))
            for step, weight in _WEIGHTS.items():
                for side in (1, -1):
                    d = side * step * _STEP / size
                    p = (np.array(evaluator.p) + d * given.p[:, k]).tolist()
                    found = function(
                        evaluator.with_parameters(tuple(p)),
                        self.t + d * given.t[k],
                        q + d * given.q[:, k],
                        v + d * given.v[:, k],
                    )
                    q_k += side * weight * found[0] * size / _STEP
                    v_k += side * weight * found[1] * size / _STEP
            parts[0][:, k], parts[1][:, k] = q_k, v_k
        self.change = given._replace(q=parts[0], v=parts[1])

    # matrices

    def _at(self, q: Array, v: Array) -> PerturbedState:
        """Return a state at the instant with the current change."""
        return PerturbedState(self.system, self.run.motion, self.t, q, v, self.change)

    def _matrices(self, q: Array, v: Array) -> JumpMatrices:
        state, full = self._at(q, v), self.run.full
        return JumpMatrices(
            full.dynamics(self.t, q, v),
            full.constraints(self.t, q, v),
            state.dynamics(),
            state.constraints(),
        )
