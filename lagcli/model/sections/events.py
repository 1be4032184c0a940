"""The events: conditions, clocks and actions."""

from __future__ import annotations

import re
from collections.abc import Iterator, Set
from typing import NamedTuple, get_args

import symengine as se
from symengine import Basic

from lagcli.columns import SLIP, read_column_name
from lagcli.model.expression.functions import apply, derivative, kinks_of
from lagcli.model.expression.grammar import parse_equation
from lagcli.model.expression.tokens import ExpressionError, error_at
from lagcli.model.expression.trees import Comparison, LogicalExpr, Tree
from lagcli.model.expression.units import commensurable
from lagcli.model.keys import EVENT, keys_of
from lagcli.model.model import (
    ContactChange,
    EventAction,
    EventClock,
    ModelEvent,
    as_symbols,
)
from lagcli.model.names.draft import Draft, Formula, Indices, Parsed, QuantityValue, read_quantity
from lagcli.model.names.expansion import expand
from lagcli.model.names.families import Declaration, by_name, declarations, expanded
from lagcli.model.names.members import IndexEvaluator, family_of, with_indices
from lagcli.model.names.namespace import Allowed
from lagcli.model.sections.energies import read_forces
from lagcli.model.sections.initial import canonical_name
from lagcli.model.spelling import did_you_mean, nearest, shorten
from lagcli.model.yaml.source import Mapping as MappingNode
from lagcli.model.yaml.source import Scalar, Sequence, YamlNode

_CHANGES: tuple[ContactChange, ...] = get_args(ContactChange)
_WORDS = re.compile(r"\s*(?P<row>[^\W\d]\w*(?:\[[^\]]*\])?(?:\.\w+)?)\s+(?P<change>[^\W\d]\w*)\s*")
_HELP = "write a condition, as in `t >= 2` or `floor closes`"


class ReadCondition(NamedTuple):
    """A condition for one value of the index; see `ModelEvent`."""

    function: Basic | None
    either: bool = False
    change: tuple[str, ContactChange] | None = None


class ConditionReader:
    """Reads the field ``when`` of an event, and builds it for each member.

    Parameters
    ----------
    draft : Draft
    node : Node
    what : str
        Description of the event, for messages.
    indices : tuple of str
        Names of the event's indices.
    """

    def __init__(self, draft: Draft, node: YamlNode, what: str, indices: tuple[str, ...]):
        self.draft, self.what, self.indices = draft, what, indices
        self.good = False
        self.change: tuple[str, ContactChange] | None = None
        self.tree: Tree | None = None
        self.sides: tuple[Tree, Tree] | None = None
        self.formulas: dict[int, Formula] = {}
        if not isinstance(node, Scalar) or node.missing:
            said = "empty" if isinstance(node, Scalar) else f"a condition, not {node.what}"
            said = (
                f"`when` of {what} is empty" if said == "empty" else f"`when` of {what} is {said}"
            )
            draft.report.add("wrong-type", said, node.location, _HELP)
            return
        self.node = node
        with draft.report.expression(node):
            self._read(node)
            self.good = all(f.good for f in self.formulas.values())

    @property
    def text(self) -> str:
        """The condition as written, on one line."""
        return " ".join(self.node.value.split())

    @property
    def written(self) -> tuple[Tree, ...]:
        """The condition, or the two sides of an equation."""
        if self.sides is not None:
            return self.sides
        return () if self.tree is None else (self.tree,)

    def _read(self, node: Scalar) -> None:
        words = _WORDS.fullmatch(node.value)
        if words and words["row"] not in ("not",) and words["change"] not in ("and", "or"):
            self._contact(words)
            return
        names = self.draft.names
        left, right = parse_equation(node.value)
        left = expand(left, names)
        if right is not None:
            self.sides = left, expand(right, names)
            for side in self.sides:
                self._operand(side)
            return
        self.tree = left
        self._condition(left)

    def _contact(self, words: re.Match[str]) -> None:
        """Parse a change of a contact."""
        change = words["change"]
        if change not in _CHANGES:
            raise ExpressionError(
                "unknown-word",
                f"`when` of {self.what} says `{shorten(change)}`, which happens to no contact",
                *words.span("change"),
                did_you_mean(nearest(change, _CHANGES, 1))
                or "a contact " + ", ".join(f"`{x}`" for x in _CHANGES),
            )
        row = words["row"]
        constraints = self.draft.names.constraints
        family = re.sub(r"\[.*\]", "[]", row)
        if row not in constraints and not (
            self.indices and family in self.draft.names.constraint_families
        ):
            raise ExpressionError(
                "unknown-name",
                f"`when` of {self.what} names `{shorten(row)}`, which is not a constraint",
                *words.span("row"),
                did_you_mean(nearest(row, list(constraints)))
                or "the constraints are " + ", ".join(f"`{c}`" for c in list(constraints)[:12])
                if constraints
                else "the model has no constraints",
            )
        self.change = row, change

    def _condition(self, tree: Tree) -> None:
        """Check a condition, and prepare its operands."""
        if isinstance(tree, LogicalExpr):
            for part in tree.operands:
                self._condition(part)
        elif isinstance(tree, Comparison):
            for sign in tree.operators:
                if sign in ("==", "!="):
                    raise error_at(
                        "not-a-condition",
                        f"`{sign}` in `when` of {self.what} holds at single instants",
                        tree,
                        "write `=`, alone, for an event in both directions, or `>=` or `<=`",
                    )
            for part in tree.operands:
                self._operand(part)
        else:
            raise error_at(
                "not-a-condition",
                f"`when` of {self.what} is not a condition",
                tree,
                _HELP,
            )

    def _operand(self, tree: Tree) -> None:
        what, allowed = f"`when` of {self.what}", Allowed.ACCELERATIONS
        parsed = Parsed(self.node, tree)
        self.formulas[id(tree)] = Formula(self.draft, parsed, what, allowed, self.indices)

    # of one member

    def built(self, indices: Indices, changing: Set[str]) -> ReadCondition | None:
        """Return the condition for an index; None if it has an error.

        `changing`: what events set.
        """
        if not self.good:
            return None
        if self.change is not None:
            return self._changed(indices)
        try:
            if self.sides is not None:
                left, right = map(self._value, self.sides, [indices] * 2)
                condition = ReadCondition(self._rises(left - right, strict=False), either=True)
            else:
                assert self.tree is not None
                condition = ReadCondition(self._function(self.tree, indices, 1))
        except _Wrong:
            self.good = False
            return None
        if condition.function is not None and not self._varies(condition.function, changing):
            self.good = False
            self.draft.report.add(
                "not-a-condition",
                f"`when` of {self.what} does not depend on time, on the motion or on what events"
                " set",
                self.node.location,
                _HELP,
            )
            return None
        return condition

    def _varies(self, function: Basic, changing: Set[str]) -> bool:
        constant = self.draft.names.parameters.keys() - changing
        return any(s.name not in constant for s in function.free_symbols)

    def _function(self, tree: Tree, indices: Indices, sign: int) -> Basic:
        """Return a function that is positive if a condition holds, or if it does not (sign −1)."""
        if isinstance(tree, LogicalExpr):
            if tree.operator == "not":
                return self._function(tree.operands[0], indices, -sign)
            parts = [self._function(part, indices, sign) for part in tree.operands]
            least = (tree.operator == "and") == (sign > 0)
            return apply("min" if least else "max", *parts)
        assert isinstance(tree, Comparison)
        values = [self._value(part, indices) for part in tree.operands]
        parts = [
            sign * self._rises(b - a if operator in ("<", "<=") else a - b, operator in ("<", ">"))
            for a, b, operator in zip(values, values[1:], tree.operators, strict=False)
        ]
        return apply("min" if sign > 0 else "max", *parts)

    def _rises(self, difference: Basic, strict: bool) -> Basic:
        """Return a function that is positive where a difference is, or is zero unless strict.

        A difference that changes only by jumps may jump to zero: the function is ±1.
        """
        if not self._jumps(difference):
            return difference
        return 1 - 2 * apply("step", -difference) if strict else 2 * apply("step", difference) - 1

    def _jumps(self, difference: Basic) -> bool:
        """Return whether a function changes, and only where it jumps."""
        names = self.draft.names
        stepped = names.parameters.keys() | {x for x, n in names.inputs.items() if not n}
        function = as_symbols(difference)
        moving = [s for s in function.free_symbols if s.name not in stepped]
        if moving and not kinks_of(function):
            return False
        return bool(function.free_symbols) and all(derivative(function, s) == 0 for s in moving)

    def _value(self, tree: Tree, indices: Indices) -> Basic:
        value = self.formulas[id(tree)].scalar(indices)
        if value is None:
            raise _Wrong
        return value

    def _changed(self, indices: Indices) -> ReadCondition | None:
        """Return the change of a contact, for an index."""
        assert self.change is not None
        row, change = self.change
        if row not in self.draft.names.constraints:
            row = self._member(row, indices)
            if row not in self.draft.names.constraints:
                self.good = False
                self.draft.report.add(
                    "no-member",
                    f"`when` of {self.what} names `{row}`, which is not a constraint",
                    self.node.location,
                    "use the same ranges",
                )
                return None
        return ReadCondition(None, change=(row, change))

    def _member(self, row: str, indices: Indices) -> str:
        """Return the name of a member, ``hit[2]`` of ``hit[i]``."""
        name, _, index = row.partition("[")
        left, _ = parse_equation(index.removesuffix("]"))
        return with_indices(f"{name}[]", [IndexEvaluator(dict(indices), lambda _: 0).at(left)])


class _Wrong(Exception):
    """A part of a condition has an error, which has been reported."""


def watched_row(constraint: str, change: ContactChange, names: dict[str, None]) -> str:
    """Return the row that a contact's change refers to: that of its friction for slip."""
    friction = constraint + SLIP
    return friction if change in ("slips", "sticks") and friction in names else constraint


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

    def _time(self, field: str, node: YamlNode) -> QuantityValue | None:
        draft, what = self.draft, f"`{field}` of event `{self.title}`"
        quantity = read_quantity(draft, node, what)
        if quantity is None:
            return None
        if quantity.unit and not commensurable(quantity.unit, "s"):
            draft.report.add(
                "units",
                f"{what} is in {quantity.unit}, but must be a time",
                node.location,
                "give it in s, ms, …",
            )
            return None
        draft.trees[f"events.{self.title}.{field}"] = quantity.parsed.tree
        value = QuantityValue(draft, quantity, what, Allowed.PARAMETERS, self.indices)
        return value if value.good else None

    def built(self, indices: Indices) -> EventClock | None:
        """Return the clock for an index; None if it has an error."""
        assert self.period is not None
        period = self.period.expression(indices)
        offset = se.Integer(0) if self.offset is None else self.offset.expression(indices)
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


_EXAMPLE = "flat: {when: theta <= 0, stop: true}"
_CLOCKED = "tick: {every: 10 ms, set: {u: -k*x}}"


def read_events(draft: Draft) -> tuple[ModelEvent, ...]:
    """Return the valid events; report constraints that no event engages."""
    declared = declarations(draft, draft.entries("events") or [], "event")
    members = by_name(draft, expanded(draft, declared))
    readers = {id(d): _EventReader(draft, d) for d in declared}
    changing = frozenset(x for reader in readers.values() for x in reader.set)
    events = []
    for name, member in members.items():
        event = readers[id(member.declaration)].event(name, member.indices, changing)
        if event is not None:
            events.append(event)
    if all(reader.good for reader in readers.values()):
        _report_changed_clocks(draft, events)
        _report_never_engaged(draft, events)
    return tuple(events)


def _report_changed_clocks(draft: Draft, events: list[ModelEvent]) -> None:
    """Report events that set a parameter of a clock, whose ticks are counted from the start."""
    for clocked in events:
        if clocked.clock is None:
            continue
        needs = {x.name for x in (clocked.clock.period + clocked.clock.offset).free_symbols}
        for event in events:
            for target in needs.intersection(event.action.set):
                assert event.location is not None
                draft.report.add(
                    "clock-parameter",
                    f"event `{event.name}` sets `{target}`, but the clock of event"
                    f" `{clocked.name}` depends on it",
                    event.location,
                    "the period and the offset of a clock are constant: use another parameter",
                )


def _report_never_engaged(draft: Draft, events: list[ModelEvent]) -> None:
    engaged = {name for event in events for name in event.action.engage}
    for c in draft.constraints:
        if not c.active and c.name not in engaged and not c.name.endswith(SLIP):
            assert c.location is not None
            draft.report.add(
                "never-engaged",
                f"constraint `{c.name}` is not active at the start, and no event engages it",
                c.location,
                f"remove `active: false`, or engage it: `events: {{close: {{when: t >= 1, engage:"
                f" {c.name}}}}}`",
            )


class _EventReader:
    """Reads one entry of `events`."""

    def __init__(self, draft: Draft, d: Declaration):
        self.draft, self.declaration = draft, d
        self.what = f"event `{d.title}`"
        self.good = False
        self.set: dict[str, Formula] = {}
        help_ = f"say when it happens and what it does, as in `{_EXAMPLE}`"
        node = draft.mapping(d.node, self.what, help_)
        if node is None:
            return
        self.fields = draft.fields(node, self.what, keys_of(EVENT))
        if not self._occasion(d):
            return
        self.good = True
        self.description = self._text("description")
        self.stop = self._flag("stop")
        self.times = self._times()
        self.record = self._record()
        self.set = dict(self._targets())
        self.impulses = self._impulses()
        occasion = self.condition or self.clock
        assert occasion is not None
        self.good = self.good and occasion.good

    def _occasion(self, d: Declaration) -> bool:
        """Read when the event happens: `when`, or `every` and `offset`."""
        when, every, offset = (self.fields.get(x) for x in ("when", "every", "offset"))
        self.condition: ConditionReader | None = None
        self.clock: ClockReader | None = None
        if when is None and every is None:
            self.fault(
                d.key,
                "missing-value",
                f"{self.what} has no `when`",
                f"say when it happens, as in `{_EXAMPLE}`, or how often, as in `{_CLOCKED}`",
            )
        elif when is not None and every is not None:
            self.fault(
                every,
                "contradiction",
                f"{self.what} has both `when` and `every`",
                "keep one of them; two events may have the same actions",
            )
        elif when is not None and offset is not None:
            self.fault(
                offset,
                "contradiction",
                f"{self.what} has an `offset`, but no `every`",
                f"`offset` is the time of the first tick of a clock: `{_CLOCKED}`",
            )
        elif when is not None:
            self.condition = ConditionReader(self.draft, when, self.what, d.indices)
            return True
        elif every is not None:
            self.clock = ClockReader(self.draft, d.title, every, offset, d.indices)
            return True
        return False

    def fault(self, node: YamlNode, kind: str, message: str, help_: str | None = None) -> None:
        self.good = False
        self.draft.report.add(kind, message, node.location, help_)

    # fields

    def _text(self, field: str) -> str | None:
        return self.draft.text(self.fields.get(field), f"`{field}` of {self.what}")

    def _mapping(self, field: str, help_: str) -> MappingNode | None:
        node = self.fields.get(field)
        if node is None:
            return None
        entries = self.draft.mapping(node, f"`{field}` of {self.what}", help_)
        self.good = self.good and entries is not None
        return entries

    def _flag(self, field: str) -> bool:
        node = self.fields.get(field)
        if node is None:
            return False
        stated = self.draft.flag(node, f"`{field}` of {self.what}", f"write `{field}: true`")
        self.good = self.good and stated is not None
        return bool(stated)

    def _times(self) -> int | None:
        node = self.fields.get("times")
        if node is None:
            return None
        if isinstance(node, Scalar) and node.value.strip().isdecimal() and int(node.value) > 0:
            return int(node.value)
        self.fault(
            node,
            "wrong-type",
            f"`times` of {self.what} must be a whole number of at least 1, not {node.what}",
            "it is the maximum number of times the event happens: `times: 1`",
        )
        return None

    def _words(self, field: str) -> list[tuple[str, YamlNode]]:
        """Return the words in a field: one, or a list."""
        node = self.fields.get(field)
        if node is None:
            return []
        items = node.items if isinstance(node, Sequence) else [node]
        words: list[tuple[str, YamlNode]] = []
        for item in items:
            if isinstance(item, Scalar) and not item.missing:
                words.append((item.value.strip(), item))
            else:
                self.fault(
                    item,
                    "wrong-type",
                    f"`{field}` of {self.what} must be a name or a list of names, not {item.what}",
                )
        return words

    def _record(self) -> tuple[str, ...] | None:
        words = self._words("record")
        if len(words) == 1 and words[0][0] in ("true", "false"):
            return None if words[0][0] == "true" else ()
        names = self.draft.names
        known = (names.coordinates, names.constraints)
        columns = []
        for text, node in words:
            name = canonical_name(self.draft, text) or text
            rate = name.removesuffix("'")
            column = f"{rate}_dot" if rate != name else name
            every = [*names.coordinates, *(f"{q}'" for q in names.coordinates), *self.draft.outputs]
            if name in every or read_column_name(column, *known) is not None:
                columns.append(column)
            elif not names.incomplete and family_of(name) not in names.broken:
                self.fault(
                    node,
                    "unknown-name",
                    f"{self.what} records `{shorten(text)}`, which is not a column of the result",
                    did_you_mean(nearest(text, every))
                    or "columns are coordinates, velocities, `lambda.NAME` and outputs",
                )
        return tuple(columns) or None

    def _targets(self) -> Iterator[tuple[str, Formula]]:
        """Yield the targets of assignments, with the formulas of their values."""
        help_ = "write what is set and its new value: `set: {x': 0.9*x'}`"
        for text, key, value in self._mapping("set", help_) or ():
            target = self._target(text, key)
            parsed = self.draft.parse(value, f"the value of `{shorten(text)}` in {self.what}")
            if target is None or parsed is None:
                self.good = False
                continue
            what = f"`set` of {self.what}"
            self.draft.trees[f"events.{self.declaration.title}.set.{target}"] = parsed.tree
            indices = self.declaration.indices
            yield target, Formula(self.draft, parsed, what, Allowed.ACCELERATIONS, indices)

    def _target(self, text: str, key: Scalar) -> str | None:
        names = self.draft.names
        motion = canonical_name(self.draft, text)
        if motion is not None:
            return motion
        parameter = self.draft.parameters.get(text)
        if parameter is None:
            if not names.incomplete and text not in names.parameters:
                every = [*names.coordinates, *(f"{q}'" for q in names.coordinates)]
                self.fault(
                    key,
                    "unknown-name",
                    f"{self.what} sets `{shorten(text)}`, which is not a coordinate, a velocity or"
                    " a parameter",
                    did_you_mean(nearest(text, [*every, *names.parameters]))
                    or f"it can set {', '.join(f'`{x}`' for x in every[:6])} and parameters",
                )
            return None
        needs = names.needs
        users = [other for other, used in needs.items() if text in used]
        if text in names.structural:
            self.fault(
                key,
                "structural",
                f"{self.what} sets `{text}`, which determines the number of coordinates or terms",
                "only values can change during a run",
            )
            return None
        if users:
            self.fault(
                key,
                "dependent-parameter",
                f"{self.what} sets `{text}`, but the parameter `{users[0]}` is computed from it"
                " before the run",
                f"declare `{users[0]}` under `definitions`, where it follows `{text}`",
            )
            return None
        return text

    def _impulses(self) -> dict[str, Basic]:
        help_ = "write it as forces are written under `Q`: `impulse: {x: 0.5}`"
        entries = self._mapping("impulse", help_)
        where = f"events.{self.declaration.title}.impulse"
        return {} if entries is None else read_forces(self.draft, list(entries), where)

    # of one member

    def event(self, name: str, indices: Indices, changing: Set[str]) -> ModelEvent | None:
        """Return the event of a member; None if it has an error. `changing`: what events set."""
        if not self.good:
            return None
        condition: ReadCondition | None = ReadCondition(None)
        if self.condition is not None:
            condition = self.condition.built(indices, changing)
        clock = None if self.clock is None else self.clock.built(indices)
        values = {target: formula.scalar(indices) for target, formula in self.set.items()}
        release, engage = (tuple(self._rows(x)) for x in ("release", "engage"))
        change = condition.change if condition else None
        if change is not None:
            change = self._change(*change)
            self.good = self.good and change is not None
        if self.clock is not None and clock is None:
            self.good = False
        if condition is None or any(x is None for x in values.values()) or not self.good:
            self.good = False
            return None
        return ModelEvent(
            name=name,
            when=self.condition.text if self.condition else said_clock(clock),
            condition=condition.function,
            either=condition.either,
            change=change,
            action=EventAction(
                set={target: x for target, x in values.items() if x is not None},
                impulse=self.impulses,
                release=release,
                engage=engage,
                stop=self.stop,
                record=self.record,
            ),
            times=self.times,
            sides=self.condition.written if self.condition else (),
            indices=indices,
            description=self.description,
            location=self.declaration.key.location,
            clock=clock,
        )

    def _rows(self, field: str) -> Iterator[str]:
        """Yield the constraints named in a field, each with its friction."""
        constraints = self.draft.names.constraints
        for text, node in self._words(field):
            if text in constraints:
                yield text
                if text + SLIP in constraints:
                    yield text + SLIP
            elif not self.draft.names.may_be_constraint(text):
                self.fault(
                    node,
                    "unknown-name",
                    f"{self.what} {field}s `{shorten(text)}`, which is not a constraint",
                    did_you_mean(nearest(text, list(constraints)))
                    or (
                        "declare it under `constraints`"
                        + ", with `active: false`" * (field == "engage")
                    ),
                )

    def _change(self, name: str, change: ContactChange) -> tuple[str, ContactChange] | None:
        """Return the row of a change, and the change; report changes that are impossible for the
        row."""
        row = watched_row(name, change, self.draft.names.constraints)
        constraint = next((c for c in self.draft.constraints if c.name == row), None)
        if constraint is None:
            return None  # the row's own error has been reported
        if change in ("slips", "sticks") and constraint.limit is None:
            self.fault(
                self.fields["when"],
                "no-friction",
                f"`when` of {self.what} waits until `{name}` {change}, but it has no friction and"
                " no limit",
                "add `friction` and `slip`, or a `limit`",
            )
        elif change not in ("slips", "sticks") and not constraint.sign:
            self.fault(
                self.fields["when"],
                "not-unilateral",
                f"`when` of {self.what} waits until `{name}` {change}, but it holds in both"
                " directions",
                "only a constraint with `>=` or `<=` opens and closes",
            )
        else:
            return row, change
        return None
