"""Modes of a model's contacts, limits and friction, in which its constraints do not change."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import symengine as se

from lagcli.analysis.local.contacts import (
    ZERO,
    Acting,
    ContactEnd,
    ContactState,
    ContactStatus,
)
from lagcli.analysis.local.gradients import Point, point_tape
from lagcli.analysis.local.local_equations import DerivedModel, LocalEquations
from lagcli.analysis.local.operating_point import Tangent, tangent_of
from lagcli.arrays import Array
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.linear.dense import decompose
from lagcli.engine.switching.switching import SwitchedRow
from lagcli.engine.system import State
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.equations.derivation.lagrange import ConstraintEquation, Equations
from lagcli.model.model import Constraint, Model, multiplier
from lagcli.model.sections.contacts import abs_multiplier

if TYPE_CHECKING:
    from symengine import Basic

    from lagcli.engine.constraints.initial import ConsistentState
    from lagcli.engine.system import System

#: How each switched row acts, in their order.
Modes = tuple[Acting, ...]


class RowValues(NamedTuple):
    """What decides on the modes, by switched row; NaN where a row has no such value.

    Parameters
    ----------
    gap : (ns,) array
        φ of contacts, by their sign.
    rate : (ns,) array
        ψ.
    multiplier : (ns,) array
        λ, of contacts by their sign.
    static : (ns,) array
        The static limit.
    gap_scale, rate_scale, multiplier_scale : (ns,) arrays
        What they are compared with.
    """

    gap: Array
    rate: Array
    multiplier: Array
    static: Array
    gap_scale: Array
    rate_scale: Array
    multiplier_scale: Array


class SwitchedModel(DerivedModel):
    """A model whose constraints come and go, and its equations in each mode."""

    def __init__(self, model: Model):
        super().__init__(model)
        assert self.system.switching is not None
        self.rows: tuple[SwitchedRow, ...] = self.system.switching.rows
        self.names = tuple(self.system.constraints[row.row] for row in self.rows)
        self._modes = lru_cache(maxsize=None)(self._in_mode)

    def local(self, modes: Modes, near: State) -> ModeEquations:
        """Return the equations in a mode, started from the state of the mode next to another."""
        model, values = self._modes(modes)
        return ModeEquations(self, modes, model, values, near)

    def with_friction(self, modes: Modes) -> Modes:
        """Return modes in which friction is open with the contact that it belongs to."""
        normal = {self.rows[k].row: mode for k, mode in enumerate(modes) if self.rows[k].sign}
        return tuple(
            Acting.OPEN
            if row.normal is not None and normal.get(row.normal) == Acting.OPEN
            else mode
            for row, mode in zip(self.rows, modes, strict=True)
        )

    def first_modes(self) -> Modes:
        """Return the modes at the start: contacts that touch are closed, friction sticks."""
        state = self.start.state
        evaluator = Evaluator(self.system, state.p)
        c = evaluator.constraints(state.t, state.q, state.v)
        closed = self.model.settings.closed or ZERO
        modes = []
        for row in self.rows:
            mode = Acting.HOLDS if row.active else Acting.OPEN
            if row.sign and row.active and not row.closed:
                place = self.system.holonomic.index(row.row)
                if abs(c.position[place]) > closed * c.position_scale[place]:
                    mode = Acting.OPEN
            modes.append(mode)
        return self.with_friction(tuple(modes))

    def _in_mode(self, modes: Modes) -> tuple[Model, Mapping[Basic, Basic]]:
        """Return the model in a mode, and expressions for the λ of constraints that it lacks."""
        return model_in_mode(self.equations, dict(zip(self.names, modes, strict=True)))


class ModeEquations(LocalEquations):
    """The equations of a model in one mode of its contacts.

    Rows that hold are constraints, rows that slip are forces; λ of rows that are open is zero.

    Parameters
    ----------
    switched : SwitchedModel
    modes : Modes
    model : Model
        In this mode.
    values : mapping of symbols to expressions
        What stands for the λ that it does not have.
    near : State
        Next to which the constraints hold at the start of iterations; its velocities do not count.
    """

    def __init__(
        self,
        switched: SwitchedModel,
        modes: Modes,
        model: Model,
        values: Mapping[Basic, Basic],
        near: State,
    ):
        super().__init__(model)
        self.switched, self.modes, self._values, self._near = switched, modes, values, near
        self.p = near.p
        self.whole = switched.equations

    @cached_property
    def start(self) -> ConsistentState:
        """The consistent state next to the given one."""
        from lagcli.engine.constraints.initial import consistent_state

        free = np.zeros(len(self._near.q), bool)
        return consistent_state(self.system, self._near, free, free)

    def express(self, expression: Basic) -> Basic:
        """Return an expression of the whole model in the multipliers of this mode."""
        return expression.xreplace(self._values)

    def reached(self, point: Point, tangent: Tangent) -> Tangent:
        """Return the tangent space of motions from rest: sticking rows require B δq = 0 too."""
        if np.any(point.v):
            return tangent
        limited = {row.row for row in self.switched.rows if row.limit is not None}
        names = [self.switched.system.constraints[i] for i in limited]
        sticking = [i for i, name in enumerate(self.system.constraints) if name in names]
        d, rows = tangent.decomposition, sorted({*self.system.holonomic, *sticking})
        jacobian = self.evaluator(point.p).constraints(point.t, point.q, point.v).jacobian
        held = decompose(jacobian[rows], scale=d.scale[rows], sizes=d.sizes)
        return tangent_of(d, held, self.velocity_gradient(point), tangent.velocities)

    # what decides on the mode

    def values(self, point: Point) -> RowValues:
        """Return gaps, sliding velocities, multipliers and limits of the switched rows."""
        rows, n = self.switched.rows, len(self.switched.rows)
        evaluator = Evaluator(self.switched.system, point.p)
        c = evaluator.constraints(point.t, point.q, point.v)
        places = [row.row for row in rows]
        numbers = np.array(self._tape(point.inputs()))
        multipliers, static = numbers[places], numbers[len(c.jacobian) :]
        signs = np.array([float(row.sign or 1) for row in rows])
        sizes = evaluator.sizes(point.t, point.q, point.v)
        slopes = np.abs(c.jacobian[places])
        lengths = (slopes * sizes).max(axis=1, initial=0.0)
        force = float((self.force_scale(point) * sizes).max(initial=0.0))
        gaps = np.full((2, n), np.nan)
        for k, row in enumerate(rows):
            if row.sign:
                place = self.switched.system.holonomic.index(row.row)
                gaps[0, k] = row.sign * c.position[place]
                gaps[1, k] = max(c.position_scale[place], slopes[k] @ self.lengths)
        return RowValues(
            gaps[0],
            signs * c.velocity(point.v)[places],
            signs * multipliers,
            static,
            gaps[1],
            np.maximum(c.velocity_scale[places], slopes @ np.abs(point.v)),
            (force or 1.0) / np.where(lengths > 0.0, lengths, 1.0),
        )

    def margins(self, point: Point) -> Array:
        """Return by how much each row is within its mode, of its scale, (ns,)."""
        values, margins = self.values(point), np.full(len(self.modes), np.inf)
        for k, (row, mode) in enumerate(zip(self.switched.rows, self.modes, strict=True)):
            if row.sign and mode == Acting.HOLDS:
                margins[k] = values.multiplier[k] / values.multiplier_scale[k]
            elif row.sign and row.active:
                margins[k] = values.gap[k] / values.gap_scale[k]
            elif row.limit is not None and mode == Acting.HOLDS:
                slack = values.static[k] - abs(values.multiplier[k])
                margins[k] = slack / values.multiplier_scale[k]
            elif mode in (Acting.FORWARD, Acting.BACKWARD):
                rate = values.rate[k] if mode == Acting.FORWARD else -values.rate[k]
                margins[k] = rate / (values.rate_scale[k] or 1.0)
        return margins

    def contact_end(self, row: int) -> tuple[ContactEnd, str]:
        """Return the kind of change of a row that leaves its mode, and its name."""
        name, mode = self.switched.names[row], self.modes[row]
        if self.switched.rows[row].sign:
            return "contact opens" if mode == Acting.HOLDS else "contact closes", name
        return "limit reached" if mode == Acting.HOLDS else "sliding stops", name

    @property
    def whole_system(self) -> System:
        """The System of all modes."""
        return self.switched.system

    def all_multipliers(self, point: Point) -> Array:
        """Return λ of all constraints of the model, (nc,)."""
        return np.array(self._tape(point.inputs())[: len(self.switched.system.constraints)])

    def contacts(self, point: Point) -> tuple[ContactStatus, ...]:
        """Return the state of each switched row at a point."""
        values = self.values(point)
        contacts = []
        for k, (row, name, mode) in enumerate(
            zip(self.switched.rows, self.switched.names, self.modes, strict=True)
        ):
            gap = float(values.gap[k]) if row.sign else None
            limit = float(values.static[k]) if row.limit is not None else None
            contacts.append(
                ContactStatus(
                    name,
                    _state(row, mode, k, values),
                    gap,
                    (row.sign or 1) * float(values.multiplier[k]) + 0.0,
                    limit,
                )
            )
        return tuple(contacts)

    @cached_property
    def _tape(self) -> ScalarTape:
        """λ of all constraints, and the static limit of each switched row."""
        eq, switched = self.equations, self.switched
        limits = {c.name: c.limit for c in switched.model.constraints}
        expressions = [multiplier(name) for name in limits]
        row_limits = (limits[name] for name in switched.names)
        expressions += [se.Integer(0) if x is None else x.static for x in row_limits]
        return ScalarTape(point_tape(eq, [self.express(x) for x in expressions]))


def _state(row: SwitchedRow, mode: Acting, k: int, values: RowValues) -> ContactState:
    """Return the state of a row in its mode, as messages name it."""
    if row.sign:
        if mode == Acting.OPEN:
            near = row.active and abs(values.gap[k]) <= ZERO * values.gap_scale[k]
            return "touches" if near else "open"
        return "touches" if values.multiplier[k] <= ZERO * values.multiplier_scale[k] else "closed"
    if mode == Acting.OPEN:
        return "released" if row.limit is None or not row.active else "open"
    if row.limit is None:
        return "holds"
    if mode in (Acting.FORWARD, Acting.BACKWARD):
        if row.normal is not None and values.static[k] <= ZERO * values.multiplier_scale[k]:
            return "touches"
        return "slips" if abs(values.rate[k]) > ZERO * values.rate_scale[k] else "at its limit"
    slack = values.static[k] - abs(values.multiplier[k])
    edge = mode.at_limit or slack <= ZERO * values.multiplier_scale[k]
    return "at its limit" if edge else "sticks"


def model_in_mode(
    equations: Equations, modes: Mapping[str, Acting]
) -> tuple[Model, Mapping[Basic, Basic]]:
    """Return a model in which the constraints of one mode hold at all times.

    Parameters
    ----------
    equations : Equations
        Of a model that switches.
    modes : mapping of str to Acting
        By the names of the constraints that switch.

    Returns
    -------
    model : Model
        Rows that hold are equations; a row that slips, or is at its limit, is a generalized force.
    values : mapping of symbols to expressions
        λ of all other rows in its multipliers, and |λ| of contacts.
    """
    model = equations.model
    values: dict[Basic, Basic] = {}
    for c in model.constraints:
        mode = modes.get(c.name, Acting.HOLDS)
        own, size = multiplier(c.name), abs_multiplier(c.name)
        if mode == Acting.OPEN:
            values[own] = values[size] = se.Integer(0)
        elif mode != Acting.HOLDS:
            assert c.limit is not None
            limit = c.limit.static if mode.at_limit else c.limit.kinetic
            sign = -1 if mode in (Acting.FORWARD, Acting.AT_LOWER) else 1
            values[own], values[size] = sign * limit, limit
        elif c.sign:
            values[size] = c.sign * own
    for _ in modes:  # limits of rows that slip may have the λ of others that slip
        values = {name: x.xreplace(values) for name, x in values.items()}
    forces = [x.xreplace(values) for x in equations.applied_forces]
    for row in equations.constraints:
        if modes.get(row.constraint.name, Acting.HOLDS) > Acting.HOLDS:
            _add_force(forces, row, values[multiplier(row.constraint.name)])
    held = (c for c in model.constraints if modes.get(c.name, Acting.HOLDS) == Acting.HOLDS)
    return replace(
        model,
        constraints=tuple(_lasting(c) for c in held),
        applied_forces=dict(zip(model.coordinate_names, forces, strict=True)),
        dissipation=None,
        events=(),
        closed=frozenset(),
        outputs={name: x.xreplace(values) for name, x in equations.outputs.items()},
    ), values


def _lasting(c: Constraint) -> Constraint:
    return c._replace(relation="=", limit=None, active=True, restitution=None)


def _add_force(forces: list[Basic], c: ConstraintEquation, size: Basic) -> None:
    for j, b in c.row.items():
        forces[j] = forces[j] + size * b
