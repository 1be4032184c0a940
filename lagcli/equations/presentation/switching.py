"""Contacts, friction and events as formulas."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import symengine as se
from symengine import Basic

from lagcli.columns import SLIP
from lagcli.equations.derivation.lagrange import ConstraintEquation
from lagcli.equations.presentation.formulas import Formulas
from lagcli.equations.typesetting.nodes import (
    ZERO,
    Call,
    Line,
    Logical,
    Node,
    Relation,
    Sign,
    Step,
    Symbol,
    product_of,
    sum_of,
)
from lagcli.model.model import Constraint, EventClock, ModelEvent, MultiplierLimit
from lagcli.model.sections.contacts import abs_multiplier
from lagcli.prose import counted

_LAWS = {
    "poisson": "Impacts follow Poisson's law: the impulse of expansion is ε times that of"
    " compression.",
    "newton": "Impacts follow Newton's law: γ⁺ = −ε γ⁻ for the gap velocity γ.",
    "sequential": "Impacts follow Newton's law, one contact after the other.",
}
_INELASTIC = {
    "poisson": "Impacts are inelastic: ε = 0.",
    "newton": "Impacts are inelastic: ε = 0.",
    "sequential": "Impacts are inelastic, ε = 0, and follow one contact after the other.",
}
_MEANING = "A closed contact can only push; an open contact exerts no force."


def is_friction(c: ConstraintEquation) -> bool:
    """Whether a constraint is the friction of another."""
    return c.constraint.name.endswith(SLIP)


def as_inequality(line: Line, c: ConstraintEquation) -> Line:
    """Return the line of a constraint with its relation between the sides."""
    if not c.constraint.sign:
        return line
    left, right = line.sides
    return Line((Relation(left, c.constraint.relation, right),), line.label, line.note)


def contacts_step(f: Formulas) -> Step | None:
    """Return the conditions of unilateral constraints, limits and friction; None if there are
    none."""
    lines = [line for c in f.equations.constraints for line in _laws(f, c)]
    if not lines:
        return None
    unilateral = [c.constraint for c in f.equations.constraints if c.constraint.sign]
    if not unilateral:
        return Step("Friction", tuple(lines))
    return Step("Contact and friction", tuple(lines), f"{_MEANING} {_impact_law(f, unilateral)}")


def _impact_law(f: Formulas, contacts: Sequence[Constraint]) -> str:
    """Return the sentence on impacts, and which coefficients of restitution are zero."""
    law = f.model.settings.impacts or "poisson"
    elastic = [_is_elastic(c) for c in contacts]
    if not any(elastic):
        return _INELASTIC[law]
    return _LAWS[law] if all(elastic) else f"{_LAWS[law]} Where no ε is shown, it is 0."


def _is_elastic(contact: Constraint) -> bool:
    """Whether a contact has a coefficient of restitution other than zero."""
    return contact.restitution is not None and contact.restitution != 0


def _laws(f: Formulas, c: ConstraintEquation) -> Iterator[Line]:
    constraint, multiplier = c.constraint, Symbol(c.constraint.name, kind="multiplier")
    if constraint.sign:
        force: Node = multiplier
        if constraint.sign < 0:
            force = sum_of([(-1, multiplier)])
        gap = _difference(f, c, constraint.sign)
        presses = Relation(ZERO, "<=", force)
        yield Line((Relation(presses, "⊥", Relation(gap, ">=", ZERO)),), constraint.name)
        if constraint.restitution is not None and _is_elastic(constraint):
            note = "coefficient of restitution"
            yield Line((Sign("ε", r"\varepsilon"), f.arrange(constraint.restitution)), note=note)
    if constraint.limit is not None:
        yield from _limit(f, c, constraint.limit, multiplier)


def _difference(f: Formulas, c: ConstraintEquation, sign: int = 1) -> Node:
    """Return a constraint's left side minus its right side, as written; or the opposite."""
    left, right = f.constraint_line(c).sides
    return sum_of([(1, left), (-1, right)] if sign > 0 else [(1, right), (-1, left)])


def _size(f: Formulas, limit: MultiplierLimit, value: Basic) -> Node:
    """Return a limit; friction as its coefficient times |λ|, or times λ if λ ≥ 0."""
    if limit.normal is None:
        return f.arrange(value)
    size = se.Symbol("|lambda|")
    coefficient = value.xreplace({abs_multiplier(limit.normal): size}).diff(size)
    pressing: Node = Symbol(limit.normal, kind="multiplier")
    sign = next(c.sign for c in f.model.constraints if c.name == limit.normal)
    if sign <= 0:
        pressing = Call("abs", (pressing,))
    return product_of([f.arrange(coefficient), pressing])


def _limit(
    f: Formulas, c: ConstraintEquation, limit: MultiplierLimit, multiplier: Symbol
) -> Iterator[Line]:
    """Yield the law of a row that sticks up to a limit and slips beyond it."""
    slip = _difference(f, c)
    static, kinetic = (_size(f, limit, x) for x in (limit.static, limit.kinetic))
    borne = Relation(Call("abs", (multiplier,)), "<=", static)
    label = c.constraint.name
    yield Line((Logical("and", (Relation(slip, "==", ZERO), borne)),), label, "sticks")
    law = sum_of([(-1, product_of([kinetic, Call("sign", (slip,))]))])
    yield Line((multiplier, law), note="slips")
    if not c.constraint.active:
        yield Line((multiplier, ZERO), note="until an event engages it")


def events_step(f: Formulas) -> Step | None:
    """Return the conditions and actions of the events; None if there are none."""
    lines = [line for event in f.model.events for line in _lines(f, event)]
    if not lines:
        return None
    sets = any(e.action.set for e in f.model.events)
    remark = "Right sides of assignments use the values before the event." if sets else None
    return Step("Events", tuple(lines), remark)


def _lines(f: Formulas, event: ModelEvent) -> Iterator[Line]:
    """Yield the condition of an event with its actions, then its assignments."""
    sides = tuple(f.written(tree, event.indices) for tree in event.sides)
    if event.clock is not None:
        yield _ticks(f, event, event.clock)
    else:
        if not sides:
            sides = (Sign(event.when, rf"\text{{{event.when}}}"),)
        yield Line(sides, event.name, said_actions(event) or None)
    names = f.model.coordinate_names
    for target, value in event.action.set.items():
        base = target.removesuffix("'")
        symbol = Symbol(base, 1) if base != target and base in names else Symbol(target)
        yield Line((symbol, f.arrange(value)), note="set")
    for coordinate, value in event.action.impulse.items():
        yield Line((_impulse(coordinate), f.arrange(value)), note=f"impulse on {coordinate}")


def _ticks(f: Formulas, event: ModelEvent, clock: EventClock) -> Line:
    """Return the times of a clock, t = offset + k period."""

    def time(value: Basic, said: str) -> Node:
        return f.arrange(value) if value.free_symbols else Sign(said, rf"\text{{{said}}}")

    terms = [(1, product_of([Sign("k", "k"), time(clock.period, clock.written[0])]))]
    if clock.offset != 0:
        terms.insert(0, (1, time(clock.offset, clock.written[-1])))
    note = ", ".join(filter(None, ["k = 0, 1, 2, …", said_actions(event)]))
    return Line((Sign("t", "t"), sum_of(terms)), event.name, note)


def _impulse(coordinate: str) -> Node:
    plain = coordinate.replace("_", r"\_")
    return Sign(f"Λ_{coordinate}", rf"\Lambda_{{\mathrm{{{plain}}}}}")


def said_actions(event: ModelEvent) -> str:
    """Return the actions of an event other than assignments, in words."""
    action = event.action
    said = [f"releases {x}" for x in action.release if not x.endswith(".slip")]
    said += [f"engages {x}" for x in action.engage if not x.endswith(".slip")]
    if action.stop:
        said.append("stops the run")
    if event.times is not None:
        said.append(f"at most {counted(event.times, 'time')}")
    return ", ".join(said)
