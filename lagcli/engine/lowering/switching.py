"""Lowering of switching: switched rows, and tapes of limits, impacts, conditions, actions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple

import symengine as se
from symengine import Basic

from lagcli.engine.lowering.compiler import compile_tape, input_functions
from lagcli.engine.switching.switching import EventRule, SwitchedRow, Switching, TimeIn
from lagcli.engine.tape.tape import Tape
from lagcli.model.expression.functions import derivative
from lagcli.model.model import TIME, WEIGHT, Constraint, ModelEvent, multiplier
from lagcli.model.sections.contacts import abs_multiplier

if TYPE_CHECKING:
    from lagcli.equations.derivation.lagrange import Equations

ZERO = se.Integer(0)


class LoweredSwitching(NamedTuple):
    """The switching part of the equations, and the tape of the conditions on states:
    System.events."""

    switching: Switching | None = None
    events: Tape | None = None


def lower_switching(equations: Equations) -> LoweredSwitching:
    """Compile contacts, limits, forces with multipliers and events to tapes.

    Parameters
    ----------
    equations : Equations

    Returns
    -------
    LoweredSwitching
    """
    return _Lowering(equations).lowered()


class _Lowering:
    """The parts of one model's Switching."""

    def __init__(self, equations: Equations):
        self.equations, self.model = equations, equations.model
        model = self.model
        self.numbers = {c.name: i for i, c in enumerate(model.constraints)}
        self.coordinates = {name: i for i, name in enumerate(model.coordinate_names)}
        self.multipliers = list(equations.multipliers)
        self.magnitudes = {
            abs_multiplier(c.name): c.sign * multiplier(c.name) for c in model.constraints if c.sign
        }
        acting = (x for e in model.events for x in (*e.action.release, *e.action.engage))
        named = frozenset(acting)
        self.switched = [
            c for c in model.constraints if c.sign or c.limit or not c.active or c.name in named
        ]
        self.limited = [c for c in self.switched if c.limit]
        self.parameters = [se.Symbol(name) for name in model.parameters]
        self.state = [TIME, *equations.q, *equations.v]
        self.functions = input_functions(model)

    def lowered(self) -> LoweredSwitching:
        forces = {i: x for i, x in enumerate(self.equations.reactive_forces) if x != ZERO}
        values = [self.signed(x) for x in forces.values()]
        force_pattern, slopes = self.slopes(values)
        limit_pattern, limits = self.limits()
        events, conditions, times, of_forces, actions = self.events()
        switching = Switching(
            rows=tuple(self.row(c) for c in self.switched),
            limits=self.tape(limits),
            impact=self.on_states(self.impacts()),
            limit_pattern=limit_pattern,
            forces=self.tape([*values, *slopes]) if values else None,
            force_coordinates=tuple(forces),
            force_pattern=force_pattern,
            events=events,
            condition_times=times,
            force_conditions=self.tape(of_forces) if of_forces else None,
            actions=self.tape(actions) if actions else None,
            clocks=self.clocks(),
        )
        return LoweredSwitching(switching, self.on_states(conditions) if conditions else None)

    def tape(self, expressions: Sequence[Basic]) -> Tape:
        """Compile expressions in t, q, v, a, λ and parameters."""
        inputs = [*self.state, *self.equations.a, *self.multipliers]
        return compile_tape(expressions, inputs, self.parameters, self.functions)

    def on_states(self, expressions: Sequence[Basic]) -> Tape:
        """Compile expressions in t, q, v and parameters."""
        return compile_tape(expressions, self.state, self.parameters, self.functions)

    def signed(self, expression: Basic) -> Basic:
        """Return an expression with |λ| of unilateral constraints replaced by the signed λ."""
        return expression.xreplace(self.magnitudes) if self.magnitudes else expression

    def slopes(
        self, expressions: Sequence[Basic]
    ) -> tuple[tuple[tuple[int, int], ...], list[Basic]]:
        """Return the nonzero derivatives with respect to λ, and their pattern."""
        slopes = {
            (i, j): derivative(x, multiplier)
            for i, x in enumerate(expressions)
            for j, multiplier in enumerate(self.multipliers)
            if multiplier in x.free_symbols
        }
        return tuple(slopes), list(slopes.values())

    # rows

    def row(self, c: Constraint) -> SwitchedRow:
        normal, weight = c.limit.normal if c.limit else None, c.name + WEIGHT
        return SwitchedRow(
            row=self.numbers[c.name],
            sign=c.sign,
            limit=self.limited.index(c) if c.limit else None,
            normal=None if normal is None else self.numbers[normal],
            active=c.active,
            closed=c.name in self.model.closed,
            unit=self.model.units.of_residual(c.name, c.kind == "holonomic", rate=False),
            weight=self.target(weight)[1] if weight in self.model.parameters else None,
        )

    def limits(self) -> tuple[tuple[tuple[int, int], ...], list[Basic]]:
        """Return the pattern of the derivatives, and the outputs of the tape of limits."""
        both = [c.limit for c in self.limited if c.limit is not None]
        static = [self.signed(x.static) for x in both]
        kinetic = [self.signed(x.kinetic) for x in both]
        pattern, _ = self.slopes([a + b for a, b in zip(static, kinetic, strict=True)])
        slopes = [
            derivative(values[i], self.multipliers[j])
            for values in (static, kinetic)
            for i, j in pattern
        ]
        return pattern, [*static, *kinetic, *slopes]

    def impacts(self) -> list[Basic]:
        """Return coefficients of restitution, and of friction in impacts."""
        restitution = [c.restitution or ZERO for c in self.switched if c.sign]
        return [*restitution, *map(self.impact_friction, self.limited)]

    def impact_friction(self, c: Constraint) -> Basic:
        """Return the coefficient of kinetic friction; 0 for a row whose limit is a finite force."""
        assert c.limit is not None
        if c.limit.normal is None:
            return ZERO
        size = se.Symbol("|lambda|")
        limit = c.limit.kinetic.xreplace({abs_multiplier(c.limit.normal): size})
        return limit.diff(size)

    # events

    def events(
        self,
    ) -> tuple[tuple[EventRule, ...], list[Basic], tuple[TimeIn, ...], list[Basic], list[Basic]]:
        """Return the rules, the conditions on states and how they depend on time, those on
        forces, and the outputs of the actions' tape.
        """
        forces = {*self.equations.a, *self.multipliers}
        known = {se.Symbol(p) for p in self.model.parameters} | {TIME}
        functions = [e.condition for e in self.model.events if e.condition is not None]
        of_forces = [self.signed(x) for x in functions if not forces.isdisjoint(x.free_symbols)]
        on_states = [x for x in functions if forces.isdisjoint(x.free_symbols)]
        actions: list[Basic] = []
        rules: list[EventRule] = []
        states, others = iter(range(len(on_states))), iter(range(len(on_states), len(functions)))
        for event in self.model.events:
            number: int | None = None
            if event.condition is not None:
                timed = forces.isdisjoint(event.condition.free_symbols)
                number = next(states if timed else others)
            rules.append(self.rule(event, number, len(actions)))
            actions += map(self.signed, self.values_set(event).values())
            actions += map(self.signed, event.action.impulse.values())
        # the roots of an input are not known in advance
        times = tuple(
            TimeIn.ALONE
            if x.free_symbols <= known and not x.atoms(se.FunctionSymbol)
            else TimeIn.WITH_STATE
            if TIME in x.free_symbols
            else TimeIn.NONE
            for x in on_states
        )
        return tuple(rules), on_states, times, of_forces, actions

    def clocks(self) -> Tape | None:
        """Return the tape of the periods and offsets of the clocks."""
        clocks = [event.clock for event in self.model.events if event.clock is not None]
        values = [x for clock in clocks for x in (clock.period, clock.offset)]
        return compile_tape(values, [], self.parameters) if values else None

    def rule(self, event: ModelEvent, condition: int | None, first: int) -> EventRule:
        action = event.action
        clocked = [x.name for x in self.model.events if x.clock is not None]
        return EventRule(
            name=event.name,
            condition=condition,
            either=event.either,
            change=None
            if event.change is None
            else (self.numbers[event.change[0]], event.change[1]),
            times=event.times,
            targets=tuple(map(self.target, self.values_set(event))),
            first=first,
            impulses=tuple(self.coordinates[name] for name in action.impulse),
            release=tuple(self.numbers[name] for name in action.release),
            engage=tuple(self.numbers[name] for name in action.engage),
            stop=action.stop,
            record=action.record,
            clock=None if event.clock is None else clocked.index(event.name),
        )

    def values_set(self, event: ModelEvent) -> dict[str, Basic]:
        """Return what an event sets: as given, and the weights of constraints that it changes."""
        values, action = dict(event.action.set), event.action
        for names, holds in ((action.release, False), (action.engage, True)):
            for name in names:
                weight = self.model.parameters.get(name + WEIGHT)
                if weight is not None and weight.high is not None:
                    values[weight.name] = se.RealDouble(weight.high if holds else 0.0)
        return values

    def target(self, name: str) -> tuple[Literal["q", "v", "p"], int]:
        if name in self.coordinates:
            return "q", self.coordinates[name]
        rate = name.removesuffix("'")
        if rate in self.coordinates:
            return "v", self.coordinates[rate]
        return "p", list(self.model.parameters).index(name)
