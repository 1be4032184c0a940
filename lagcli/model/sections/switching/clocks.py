"""Clocks of events: a period and an offset, which are constant during a run."""

from __future__ import annotations

from typing import NamedTuple

import symengine as se
from symengine import Basic

from lagcli.model.draft import Draft, Formula, Indices
from lagcli.model.expression.dimension import SECOND, same
from lagcli.model.expression.quantities import Quantity, formula_of, read_quantity
from lagcli.model.expression.units import read_unit
from lagcli.model.model import EventClock
from lagcli.model.symbols import Context
from lagcli.model.yaml.source import Scalar, YamlNode


class _Time(NamedTuple):
    """A time as read: a number with a unit, or a formula of parameters."""

    quantity: Quantity
    formula: Formula | None

    def value(self, indices: Indices) -> Basic | None:
        """Return its value in s; None if it has an error."""
        factor, written = self.quantity.factor, self.quantity.number
        if self.formula is None:
            assert written is not None
            value: Basic | None = se.Rational(written.numerator, written.denominator)
        else:
            value = self.formula.scalar(indices)
        if value is None or factor == 1:
            return value
        if isinstance(factor, float):
            return value * factor
        return value * se.Rational(factor.numerator, factor.denominator)


class ClockReader:
    """Reads the fields ``every`` and ``offset`` of an event, and builds its clock for each member.

    Parameters
    ----------
    draft : Draft
    title : str
        Key of the event.
    every, offset : Node
        The offset is None without the field.
    indices : tuple of str
        Names of the event's indices.
    """

    def __init__(
        self,
        draft: Draft,
        title: str,
        every: YamlNode,
        offset: YamlNode | None,
        indices: tuple[str, ...],
    ):
        self.draft, self.title, self.indices = draft, title, indices
        self.location = every.location
        self.period = self._time("every", every)
        self.offset = None if offset is None else self._time("offset", offset)
        self.written = tuple(
            " ".join(x.value.split()) for x in (every, offset) if isinstance(x, Scalar)
        )
        self.good = self.period is not None and (offset is None or self.offset is not None)

    def _time(self, field: str, node: YamlNode) -> _Time | None:
        draft, what = self.draft, f"`{field}` of event `{self.title}`"
        quantity = read_quantity(draft, node, what, draft.names)
        if quantity is None:
            return None
        if quantity.unit and not same(read_unit(quantity.unit).dimension, SECOND):
            draft.report.add(
                "units",
                f"{what} is in {quantity.unit}, but must be a time",
                node.location,
                "give it in s, ms, …",
            )
            return None
        draft.trees[f"events.{self.title}.{field}"] = quantity.parsed.tree
        context = Context(what, coordinates=False, definitions=False, time=False)
        formula = formula_of(draft, quantity, context, draft.names, self.indices)
        return _Time(quantity, formula) if formula is None or formula.good else None

    def built(self, indices: Indices) -> EventClock | None:
        """Return the clock for an index; None if it has an error."""
        assert self.period is not None
        period = self.period.value(indices)
        offset = se.Integer(0) if self.offset is None else self.offset.value(indices)
        if period is None or offset is None:
            self.good = False
            return None
        return EventClock(period, offset, self.written, self.location)


def said_clock(clock: EventClock | None) -> str:
    """Return a clock in words, ``every 10 ms``; empty without one."""
    if clock is None:
        return ""
    every, *offset = clock.written
    return f"every {every}" + "".join(f" from {x}" for x in offset)
