"""The parameters: numbers, numbers with a unit, and expressions of other parameters."""

from __future__ import annotations

import numbers
from collections.abc import Mapping
from functools import partial
from types import MappingProxyType
from typing import NamedTuple

import symengine as se
from symengine import Basic

from lagcli.errors import SourceLocation
from lagcli.model.diagnostics import Broken
from lagcli.model.expression.constants import constant
from lagcli.model.expression.tokens import is_number
from lagcli.model.expression.trees import IndexedSumExpr, Name, Tree, walk
from lagcli.model.expression.units import (
    UNIT_HELP,
    UnknownUnit,
    commensurable,
    remedy,
    si_notation,
    to_si,
)
from lagcli.model.keys import PARAMETER, keys_of
from lagcli.model.model import Parameter, Written
from lagcli.model.names.dependencies import Unbuilt, build_on_demand, topological_order
from lagcli.model.names.draft import (
    Draft,
    Quantity,
    QuantityValue,
    read_quantity,
    unit_of,
)
from lagcli.model.names.families import Declaration, Member, bounds, by_name, members_of
from lagcli.model.names.members import family_of, members_clause, names_in
from lagcli.model.sections.definitions import report_cycle
from lagcli.model.spelling import did_you_mean, nearest, shorten
from lagcli.model.yaml.source import Mapping as MappingNode
from lagcli.model.yaml.source import Scalar, Sequence, Source, YamlNode
from lagcli.prose import counted


class _ParameterEntry(NamedTuple):
    """The entry of a parameter."""

    declaration: Declaration
    unit: str | None
    description: str | None
    value: YamlNode | None
    quantities: tuple[Quantity, ...] = ()
    ends: Mapping[str, YamlNode] = MappingProxyType({})


class _Job(NamedTuple):
    """A parameter whose value has not been computed."""

    member: Member
    quantity: Quantity
    description: str | None
    ends: Mapping[str, YamlNode]


def read_parameters(
    draft: Draft, declared: list[Declaration], overrides: Mapping[str, object]
) -> dict[str, Parameter]:
    """Return the parameters that have a value; add their symbols and values to the names."""
    reader = _ParameterReader(draft, overrides)
    names = list(reader.read(declared))
    for name, given in overrides.items():
        if _plain(name) not in reader.jobs and _plain(name) not in reader.broken:
            _report_unknown_override(draft, name, given, names)
    reader.evaluate()
    draft.names.parameters = {name: partial(se.Symbol, name) for name in names}
    draft.names.needs = reader.needs()
    return {name: reader.parameters[name] for name in names if name in reader.parameters}


def _plain(name: str) -> str:
    return "".join(name.split())


class _ParameterReader:
    """Evaluates parameters."""

    def __init__(self, draft: Draft, overrides: Mapping[str, object]):
        self.draft = draft
        self.overrides = {_plain(name): value for name, value in overrides.items()}
        self.jobs: dict[str, _Job] = {}
        self.parameters: dict[str, Parameter] = {}
        self.values: dict[int, QuantityValue] = {}
        self.broken: set[str] = set()
        self.expanded = False
        self.known: dict[str, partial[Basic]] = {}
        draft.names.parameters = draft.names.constants = self.known

    # from entries to members

    def read(self, declared: list[Declaration]) -> dict[str, Member]:
        """Read the entries, and determine the members they declare."""
        for d in declared:
            if not d.spans:
                self.known[d.name] = partial(self.value, d.name)
        entries = {id(d): self.entry(d) for d in declared}
        for d in declared:
            if not d.spans:
                self.enter(Member(d.name, d), entries[id(d)], 0)
        members: list[Member] = []
        for d in declared:
            members += self.members(d)
        self.expanded = True
        unique = by_name(self.draft, members, singles_win=True)
        self.known.update({name: partial(self.value, name) for name in unique})
        places: dict[int, int] = {}
        for member in members:
            d = member.declaration
            place = places[id(d)] = places.get(id(d), -1) + 1
            if d.spans and unique.get(member.name) is member:
                self.enter(member, entries[id(d)], place)
        for d in declared:
            count = places.get(id(d), -1) + 1
            self.check_list(d, entries[id(d)], count)
        return unique

    def members(self, d: Declaration) -> list[Member]:
        """Return the members declared by an entry; evaluates the parameters in its range."""
        while True:
            try:
                return members_of(self.draft, d)
            except Unbuilt as need:
                build_on_demand([need.name], self.build, self.cycle)

    def enter(self, member: Member, entry: _ParameterEntry, place: int) -> None:
        quantity: Quantity | None = None
        if member.name in self.overrides:
            quantity = self.overridden(member, entry)
        elif len(entry.quantities) > 1:
            quantity = entry.quantities[min(place, len(entry.quantities) - 1)]
        elif entry.quantities:
            quantity = entry.quantities[0]
        if quantity is None:
            self.broken.add(member.name)
            self.draft.names.broken.add(family_of(member.name))
        else:
            self.jobs[member.name] = _Job(member, quantity, entry.description, entry.ends)

    def check_list(self, d: Declaration, entry: _ParameterEntry, count: int) -> None:
        """Report a list whose length differs from that of the range of its entry."""
        given = len(entry.quantities)
        if isinstance(entry.value, Sequence) and given and d.several and given != count:
            self.draft.report.add(
                "wrong-length",
                f"`{d.title}` has {counted(count, 'member')}, but its list has"
                f" {counted(given, 'value')}",
                entry.value.location,
                "give one value for each member, or one expression for all of them",
            )
            self.draft.names.broken.add(d.family)

    # entries

    def entry(self, d: Declaration) -> _ParameterEntry:
        draft, what = self.draft, f"the parameter `{d.title}`"
        description, unit, good = None, None, True
        value: YamlNode | None = d.node
        ends: Mapping[str, YamlNode] = {}
        if isinstance(d.node, MappingNode):
            fields = draft.fields(d.node, what, keys_of(PARAMETER))
            description = draft.text(fields.get("description"), f"`description` of {what}")
            unit, good = read_unit_field(draft, fields.get("unit"), what)
            value = fields.get("value")
            ends = {end: fields[end] for end in ("min", "max") if end in fields}
            if value is None and d.name not in self.overrides:
                draft.report.add(
                    "missing-value",
                    f"{what} has no `value`",
                    d.node.location,
                    f"write `{d.title}: {{value: 1}}`, or just `{d.title}: 1`",
                )
        entry = _ParameterEntry(d, unit, description, value, ends=ends)
        if value is None or not good or (not d.spans and d.name in self.overrides):
            return entry
        nodes = value.items if isinstance(value, Sequence) and d.several else [value]
        read = [read_quantity(draft, node, what, unit) for node in nodes]
        quantities = tuple(q for q in read if q is not None)
        if len(quantities) == len(read):
            return entry._replace(quantities=quantities)
        return entry

    def overridden(self, member: Member, entry: _ParameterEntry) -> Quantity | None:
        """Return the value from the command line that overrides the file's."""
        name, what = member.name, f"the parameter `{member.name}`"
        given = entry.quantities[0].unit if entry.quantities else unit_of(entry.value)
        unit = stated = entry.unit or given
        value = override_node("--set", name, self.overrides[name])
        if not is_number(value.value):
            unit = None
        elif unit is not None and to_si(unit) != 1:
            written = f"`{name}: {value.value} {unit}`"
            if value is not self.overrides[name]:
                written = f"--set '{name}={value.value} {unit}'"
            report_ambiguous_unit(self.draft, name, unit, value, written)
            return None
        quantity = read_quantity(self.draft, value, what, unit)
        if quantity is None or stated is None:
            return quantity
        if quantity.unit is None:
            plain = not set(names_used(quantity.parsed.tree)) - {"pi"}
            return quantity._replace(unit=si_notation(stated)) if plain else quantity
        if not commensurable(quantity.unit, stated):
            self.draft.report.add(
                "units",
                f"`{name}` is in {stated} in the file, and in {quantity.unit} here",
                value.location,
                remedy(stated, quantity.unit),
            )
            return None
        return quantity

    # values

    def evaluate(self) -> None:
        """Evaluate all parameters in the order of their dependencies."""
        below: dict[str, list[str]] = {}
        for name in self.jobs:
            below.setdefault(family_of(name), []).append(name)
        order, _ = topological_order(self.needs())
        names = [name for family in order for name in below.get(family, ())]
        build_on_demand(names, self.build, self.cycle)

    def needs(self) -> dict[str, list[str]]:
        """Return the dependencies of each parameter and family."""
        needs: dict[str, list[str]] = {}
        seen: set[tuple[int, int]] = set()
        for name, job in self.jobs.items():
            d = job.member.declaration
            if (id(d), id(job.quantity)) not in seen:
                seen.add((id(d), id(job.quantity)))
                used = [*names_used(job.quantity.parsed.tree), *bounds(d)]
                needs.setdefault(family_of(name), []).extend(used)
        return needs

    def value(self, name: str) -> Basic:
        """Return the value of a parameter, if it has been evaluated."""
        if name in self.parameters:
            return constant(self.parameters[name].value)
        if name in self.draft.names.broken or family_of(name) in self.draft.names.broken:
            raise Broken
        raise Unbuilt(name)

    def build(self, name: str) -> None:
        """Evaluate one parameter."""
        job = self.jobs.get(name)
        if job is None or name in self.parameters or family_of(name) in self.draft.names.broken:
            return
        parameter = self.evaluated(name, job)
        if parameter is None:
            self.draft.names.broken.add(family_of(name))
        else:
            self.parameters[name] = parameter

    def evaluated(self, name: str, job: _Job) -> Parameter | None:
        quantity, d = job.quantity, job.member.declaration
        parsed = quantity.parsed
        if not self.expanded and any(isinstance(p, Name) and p.indices for p in walk(parsed.tree)):
            self.draft.report.add(
                "bad-range",
                f"`{name}` is used in a range and cannot depend on the members of a family",
                parsed.node.location,
                "the number of members is a whole number, or an expression of whole numbers",
            )
            return None
        where = f"the parameter `{d.title}`"
        if id(quantity) not in self.values:
            own = QuantityValue(self.draft, quantity, where, indices=d.indices)
            self.values[id(quantity)] = own
        value = self.values[id(quantity)].number(job.member.indices)
        if value is None:
            return None
        low, high = self.ends(job, where)
        written = Written(parsed.tree, quantity.factor, job.member.indices)
        return Parameter(
            name,
            value,
            quantity.unit,
            job.description,
            parsed.node.value,
            written=written,
            location=parsed.node.location,
            low=low,
            high=high,
        )

    def ends(self, job: _Job, where: str) -> tuple[float | None, float | None]:
        """Return the ends of the slider, where the entry has them."""
        low, high = (
            self.end(job, job.ends[end], f"`{end}` of {where}") if end in job.ends else None
            for end in ("min", "max")
        )
        if low is not None and high is not None and low >= high:
            self.draft.report.add(
                "bad-setting",
                f"{where}: `min` {low:g} is not below `max` {high:g}",
                job.ends["max"].location,
                "the slider of `lagcli play` extends from `min` to `max`",
            )
        return low, high

    def end(self, job: _Job, node: YamlNode, what: str) -> float | None:
        """Return an end of the slider, in SI; a number has the unit of the parameter."""
        unit = job.quantity.unit
        if id(node) not in self.values:
            quantity = read_quantity(self.draft, node, what, None)
            if quantity is None:
                return None
            if quantity.unit is None and unit is not None and is_number(quantity.parsed.node.value):
                quantity = quantity._replace(unit=unit, factor=to_si(unit))
            if (quantity.unit is None) != (unit is None) or (
                unit is not None
                and quantity.unit is not None
                and not commensurable(quantity.unit, unit)
            ):
                self.draft.report.add(
                    "units",
                    f"{what} is in {quantity.unit or 'no unit'}, and its value in"
                    f" {unit or 'no unit'}",
                    node.location,
                    f"write a number in {unit or quantity.unit}",
                )
                return None
            indices = job.member.declaration.indices
            self.values[id(node)] = QuantityValue(self.draft, quantity, what, indices=indices)
        return self.values[id(node)].number(job.member.indices)

    def cycle(self, cycle: list[str]) -> None:
        """Report parameters that are defined by each other."""
        keys: dict[str, YamlNode] = {}
        for name in cycle:
            job = self.jobs[name]
            own = name in self.overrides
            keys[name] = job.quantity.parsed.node if own else job.member.declaration.key
        report_cycle(self.draft, "parameter", cycle, keys)


def names_used(tree: Tree) -> list[str]:
    """Return the names in an expression, including indices and ranges."""
    names: list[str] = []
    for part in walk(tree):
        if isinstance(part, Name):
            names.append(part.text)
            names += [name.text for index in part.indices for name in names_in(index)]
        elif isinstance(part, IndexedSumExpr):
            names += [name.text for name in names_in(part.range)]
    return names


def structural(draft: Draft) -> dict[str, Parameter]:
    """Return the parameters, marked as structural if the number of members depends on them."""
    marked = {family_of(name) for name in draft.names.structural}
    stack = list(marked)
    while stack:
        for name in draft.names.needs.get(stack.pop(), ()):
            if name not in marked:
                marked.add(name)
                stack.append(name)
    return {
        name: p._replace(structural=True) if family_of(name) in marked else p
        for name, p in draft.parameters.items()
    }


def read_unit_field(draft: Draft, node: YamlNode | None, what: str) -> tuple[str | None, bool]:
    """Return the unit in a field, and whether it is valid."""
    if node is None:
        return None, True
    unit = draft.text(node, f"`unit` of {what}")
    if unit is None:
        return None, isinstance(node, Scalar)
    try:
        to_si(unit)
    except UnknownUnit as error:
        draft.report.add("unknown-unit", f"{what}: {error}", node.location, UNIT_HELP)
        return None, False
    return unit, True


def override_node(option: str, name: str, value: object) -> Scalar:
    """Return a value from the command line or from Python as a node; one in a file is its own."""
    if isinstance(value, Scalar):
        return value
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        text = str(value)
    else:
        text = str(int(value)) if isinstance(value, numbers.Integral) else repr(float(value))
    source = Source(text, f"{option} {name}={text}", numbered=False)
    return Scalar(source, (0, 0), (0, len(text)), text)


def report_ambiguous_unit(draft: Draft, name: str, unit: str, node: Scalar, written: str) -> None:
    """Report a number without a unit in place of one in a unit other than SI.

    Parameters
    ----------
    draft : Draft
    name, unit : str
        The quantity, and its unit in the file.
    node : Scalar
        The number.
    written : str
        The same with the unit, as it is to be written.
    """
    draft.report.add(
        "ambiguous-unit",
        f"`{name}` is given in {unit} in the file, and without a unit here",
        node.location,
        f"write the unit: {written}",
    )


def _report_unknown_override(draft: Draft, name: str, given: object, known: list[str]) -> None:
    names = draft.names
    where = override_node("--set", name, given).source.path
    base = name.rstrip("'").removesuffix("_ddot").removesuffix("_dot")
    if f"{name}[]" in names.families and "parameter" in names.families[f"{name}[]"]:
        members = [k for k in known if k.startswith(f"{name}[")]
        message = f"`{name}` is a family: {members_clause(name, members)}"
        help_ = f"set the members one by one: --set '{name}[1]={given}'"
    elif base in names.coordinates or "coordinate" in names.families.get(
        f"{base.partition('[')[0]}[]", ()
    ):
        message = f"`{name}` is an initial value, not a parameter"
        help_ = f'give --set-initial "{name}={given}"'
    elif name in names.definitions:
        message, help_ = f"`{name}` is a definition, not a parameter", "change it in the file"
    elif known or not names.incomplete:
        message = f"the model has no parameter `{shorten(name)}`"
        close = did_you_mean(nearest(name, known))
        help_ = close or "its parameters are " + (", ".join(known[:30]) or "none")
    else:
        return
    draft.report.add("unknown-name", message, SourceLocation(where, 0, 0), help_)
