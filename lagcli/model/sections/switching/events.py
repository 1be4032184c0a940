"""The events: conditions and actions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from symengine import Basic

from lagcli.columns import SLIP, read_column_name
from lagcli.model.draft import Draft, Formula, Indices
from lagcli.model.keys import EVENT, keys_of
from lagcli.model.model import (
    Constraint,
    ContactChange,
    Definition,
    EventAction,
    ModelEvent,
    Parameter,
)
from lagcli.model.names.families import Declaration, by_name, declarations
from lagcli.model.sections.coordinates import expanded
from lagcli.model.sections.energies import read_forces
from lagcli.model.sections.initial import canonical_name
from lagcli.model.sections.switching.clocks import ClockReader, said_clock
from lagcli.model.sections.switching.conditions import (
    ConditionReader,
    ReadCondition,
    watched_row,
)
from lagcli.model.spelling import did_you_mean, nearest, shorten
from lagcli.model.symbols import Context, Symbols
from lagcli.model.yaml.source import Mapping as MappingNode
from lagcli.model.yaml.source import Scalar, Sequence, YamlNode

_EXAMPLE = "flat: {when: theta <= 0, stop: true}"
_CLOCKED = "tick: {every: 10 ms, set: {u: -k*x}}"


class EventNames(NamedTuple):
    """Names for events in addition to those of the draft.

    Parameters
    ----------
    constants : Symbols
        The parameters with their values.
    parameters : mapping of str to Parameter
    definitions : mapping of str to Definition
    constraints : tuple of Constraint
    outputs : mapping of str to expression
    """

    constants: Symbols
    parameters: Mapping[str, Parameter]
    definitions: Mapping[str, Definition]
    constraints: tuple[Constraint, ...]
    outputs: Mapping[str, Basic]


def read_events(draft: Draft, known: EventNames) -> tuple[ModelEvent, ...]:
    """Return the valid events; report constraints that no event engages."""
    declared = declarations(draft, draft.entries("events") or [], "event")
    members = by_name(draft, expanded(draft, declared, known.constants))
    readers = {id(d): _EventReader(draft, d, known) for d in declared}
    found = []
    for name, member in members.items():
        event = readers[id(member.declaration)].event(name, member.indices)
        if event is not None:
            found.append(event)
    if all(reader.good for reader in readers.values()):
        _report_changed_clocks(draft, found)
        _report_never_engaged(draft, known.constraints, found)
    return tuple(found)


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


def _report_never_engaged(
    draft: Draft, constraints: tuple[Constraint, ...], events: list[ModelEvent]
) -> None:
    engaged = {name for event in events for name in event.action.engage}
    for c in constraints:
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

    def __init__(self, draft: Draft, d: Declaration, known: EventNames):
        self.draft, self.declaration, self.known = draft, d, known
        self.what = f"event `{d.title}`"
        self.good = False
        if not isinstance(d.node, MappingNode):
            draft.report.add(
                "wrong-type",
                f"{self.what} must be a mapping, not {d.node.what}",
                d.node.location,
                f"say when it happens and what it does, as in `{_EXAMPLE}`",
            )
            return
        self.fields = draft.fields(d.node, self.what, keys_of(EVENT))
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

    def _flag(self, field: str) -> bool:
        node = self.fields.get(field)
        if node is None:
            return False
        if isinstance(node, Scalar) and node.value.strip() in ("true", "false"):
            return node.value.strip() == "true"
        self.fault(
            node,
            "wrong-type",
            f"`{field}` of {self.what} must be true or false, not {node.what}",
            f"write `{field}: true`",
        )
        return False

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
        found: list[tuple[str, YamlNode]] = []
        for item in items:
            if isinstance(item, Scalar) and not item.missing:
                found.append((item.value.strip(), item))
            else:
                self.fault(
                    item,
                    "wrong-type",
                    f"`{field}` of {self.what} must be a name or a list of names, not {item.what}",
                )
        return found

    def _record(self) -> tuple[str, ...] | None:
        words = self._words("record")
        if len(words) == 1 and words[0][0] in ("true", "false"):
            return None if words[0][0] == "true" else ()
        names = self.draft.names
        known = (names.coordinates, names.constraints)
        found = []
        for text, node in words:
            name = canonical_name(self.draft, text) or text
            rate = name.removesuffix("'")
            column = f"{rate}_dot" if rate != name else name
            every = [*names.coordinates, *(f"{q}'" for q in names.coordinates), *self.known.outputs]
            if name in every or read_column_name(column, *known) is not None:
                found.append(column)
            elif not names.incomplete:
                self.fault(
                    node,
                    "unknown-name",
                    f"{self.what} records `{shorten(text)}`, which is not a column of the result",
                    did_you_mean(nearest(text, every))
                    or "columns are coordinates, velocities, `lambda.NAME` and outputs",
                )
        return tuple(found) or None

    def _targets(self) -> Iterator[tuple[str, Formula]]:
        """Yield the targets of assignments, with the formulas of their values."""
        node = self.fields.get("set")
        if node is None:
            return
        if not isinstance(node, MappingNode):
            self.fault(
                node,
                "wrong-type",
                f"`set` of {self.what} must be a mapping, not {node.what}",
                "write what is set and its new value: `set: {x': 0.9*x'}`",
            )
            return
        for text, key, value in node:
            target = self._target(text, key)
            parsed = self.draft.parse(value, f"the value of `{shorten(text)}` in {self.what}")
            if target is None or parsed is None:
                self.good = False
                continue
            context = Context(f"`set` of {self.what}", accelerations=True, multipliers=True)
            self.draft.trees[f"events.{self.declaration.title}.set.{target}"] = parsed.tree
            yield target, Formula(self.draft, parsed, context, indices=self.declaration.indices)

    def _target(self, text: str, key: Scalar) -> str | None:
        names = self.draft.names
        motion = canonical_name(self.draft, text)
        if motion is not None:
            return motion
        parameter = self.known.parameters.get(text)
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
        needs = self.draft.parameter_needs
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
        node = self.fields.get("impulse")
        if node is None:
            return {}
        if not isinstance(node, MappingNode):
            self.fault(
                node,
                "wrong-type",
                f"`impulse` of {self.what} must be a mapping, not {node.what}",
                "write it as forces are written under `Q`: `impulse: {x: 0.5}`",
            )
            return {}
        where = f"events.{self.declaration.title}.impulse"
        known = self.known
        entries = list(node)
        return read_forces(self.draft, known.definitions, known.constants, entries, where)

    # of one member

    def event(self, name: str, indices: Indices) -> ModelEvent | None:
        """Return the event of a member; None if it has an error."""
        if not self.good:
            return None
        condition = ReadCondition(None) if self.condition is None else self.condition.built(indices)
        clock = None if self.clock is None else self.clock.built(indices)
        values = {target: formula.scalar(indices) for target, formula in self.set.items()}
        release, engage = (tuple(self._rows(x)) for x in ("release", "engage"))
        change = condition.change if condition else None
        if change is not None:
            change = self._change(*change)
            self.good = self.good and change is not None
        if self.clock is not None and clock is None:
            self.good = False
        if condition is None or None in values.values() or not self.good:
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
        found = next((c for c in self.known.constraints if c.name == row), None)
        if found is None:
            return None  # the row's own error has been reported
        if change in ("slips", "sticks") and found.limit is None:
            self.fault(
                self.fields["when"],
                "no-friction",
                f"`when` of {self.what} waits until `{name}` {change}, but it has no friction and"
                " no limit",
                "add `friction` and `slip`, or a `limit`",
            )
        elif change not in ("slips", "sticks") and not found.sign:
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
