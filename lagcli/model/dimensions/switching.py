"""Dimensions in contacts and events: coefficients are numbers, limits are forces."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from lagcli.model.dimensions.evaluation import Disagreement, TensorDimension, Value, rate_of
from lagcli.model.dimensions.free_numbers import is_constant
from lagcli.model.dimensions.model_units import UnitFinding, conjugate, find
from lagcli.model.expression.dimension import ONE, SECOND, UNKNOWN, Dimension, product
from lagcli.model.expression.trees import Comparison, Tree, walk
from lagcli.model.model import Model, ModelEvent

if TYPE_CHECKING:
    from lagcli.model.dimensions.named import NamedDimensions

#: Function that checks the dimensions of the terms of an expression: tree, dimension, block, entry,
#: role.
Terms = Callable[[Tree, Value, str, str, str], None]

_FIELD = re.compile(
    r"(?P<entry>.+?)\.(?P<field>restitution|friction|limit)(?:\.(?:static|kinetic))?"
)
_CLOCK = re.compile(r"(?P<entry>.+?)\.(?P<field>every|offset)")
_ACTION = re.compile(r"(?P<entry>.+?)\.(?P<field>set|impulse)\.(?P<target>.+)")


def _fields(model: Model) -> Iterator[tuple[str, str, str, Tree]]:
    """Yield entry, field, key and tree of the fields of constraints."""
    for key, tree in model.trees.items():
        block, _, name = key.partition(".")
        if block == "constraints" and (found := _FIELD.fullmatch(name)):
            yield found["entry"], found["field"], name, tree


def check_switching(model: Model, known: NamedDimensions, terms: Terms) -> None:
    """Check the fields of constraints, and conditions and actions of events.

    Parameters
    ----------
    model : Model
    known : NamedDimensions
        Dimensions including the multipliers; disagreements are added to it.
    terms : callable
        See `Terms`.
    """
    for entry, field, name, tree in _fields(model):
        expected: Value = find(known.multipliers, entry) if field == "limit" else ONE
        if not is_constant(tree):  # a number alone is in SI
            terms(tree, expected, "constraints", name, f"`{field}` of `{entry}`")
    _conditions(model, known)
    for key, tree in model.trees.items():
        block, _, name = key.partition(".")
        if is_constant(tree):
            continue
        if block == "events" and (found := _ACTION.fullmatch(name)):
            target = found["target"]
            expected = _of_target(known, target, found["field"])
            role = "the new value of" if found["field"] == "set" else "the impulse on"
            terms(tree, expected, "events", name, f"{role} `{target}`")
        elif block == "events" and (found := _CLOCK.fullmatch(name)):
            terms(tree, SECOND, "events", name, f"`{found['field']}` of `{found['entry']}`")


def _of_target(known: NamedDimensions, target: str, field: str) -> Value:
    """Return the dimension of a quantity set by an event, or of an impulse."""
    base = target.rstrip("'")
    value = find(known.names, base)
    if isinstance(value, TensorDimension):
        return UNKNOWN
    if field == "set":
        return rate_of(value, len(target) - len(base))
    return product(conjugate(value), SECOND)


def _conditions(model: Model, known: NamedDimensions) -> None:
    """Check that the sides of comparisons agree."""
    seen: set[int] = set()
    for event in model.events:
        if not event.sides or id(event.sides[0]) in seen:
            continue
        seen.add(id(event.sides[0]))
        compared = list(_compared(event.sides))
        for sides, reason in compared:
            _alike(known, sides, reason, event)


def _compared(sides: tuple[Tree, ...]) -> Iterator[tuple[tuple[Tree, ...], str]]:
    """Yield the sides of the comparisons in a condition."""
    if len(sides) > 1:
        yield sides, "sides"
        return
    for part in walk(sides[0]):
        if isinstance(part, Comparison):
            yield part.operands, "comparison"


def _alike(known: NamedDimensions, sides: tuple[Tree, ...], reason: str, event: ModelEvent) -> None:
    name = f"{event.name}.when"
    values = [known.evaluated(x, "events", name, event.indices) for x in sides]
    first: tuple[Tree, Dimension] | None = None
    for side, value in zip(sides, values, strict=True):
        if not isinstance(value, Dimension):
            continue
        if first is None:
            first = side, value
        elif known.evaluator.join(first[1], value) is None:
            wrong = Disagreement(reason, side, value, first[1], first[0])
            known.findings.append(UnitFinding(wrong, "events", name))
