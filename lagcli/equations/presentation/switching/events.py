"""The table of events."""

from __future__ import annotations

from collections.abc import Iterator

from symengine import Basic

from lagcli.equations.presentation.formulas import Formulas, Line, Step
from lagcli.equations.presentation.typeset import Node, Sign, Symbol, product_of, sum_of
from lagcli.model.model import EventClock, ModelEvent


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
        said.append(f"at most {event.times} time{'s' * (event.times > 1)}")
    return ", ".join(said)
