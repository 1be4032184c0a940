"""The definitions: named expressions, built in topological order."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import NamedTuple

from lagcli.model.diagnostics import Broken
from lagcli.model.draft import Draft, Formula, Parsed
from lagcli.model.expression.trees import Name, walk
from lagcli.model.keys import DEFINITION, keys_of
from lagcli.model.model import Definition
from lagcli.model.names.dependencies import Unbuilt, build_on_demand, topological_order
from lagcli.model.names.families import Declaration, Member, by_name
from lagcli.model.names.members import family_of
from lagcli.model.names.scoping import Sized
from lagcli.model.sections.coordinates import expanded
from lagcli.model.symbols import Context, Symbols
from lagcli.model.vectors.kinds import value_of
from lagcli.model.yaml.source import YamlNode


class _DefinitionEntry(NamedTuple):
    parsed: Parsed
    description: str | None


def expand_definitions(
    draft: Draft, declared: list[Declaration], constants: Symbols
) -> dict[str, Member]:
    """Return the declared definitions by name; add the names to the draft."""
    members = by_name(draft, expanded(draft, declared, constants))

    def unbuilt(name: str) -> Sized:
        raise Unbuilt(name)

    draft.names.definitions = {name: partial(unbuilt, name) for name in members}
    return members


def read_definitions(draft: Draft, members: Mapping[str, Member]) -> dict[str, Definition]:
    """Build the definitions, and add their values to the draft's names."""
    entries = _parsed(draft, members)
    formulas: dict[int, Formula] = {}
    built: dict[str, Sized] = {}

    def value(name: str) -> Sized:
        if name in built:
            return built[name]
        if family_of(name) in draft.names.broken:
            raise Broken
        raise Unbuilt(name)

    def build(name: str) -> None:
        declaration = members[name].declaration
        entry = entries.get(id(declaration))
        if name in built or entry is None or family_of(name) in draft.names.broken:
            return
        formula = formulas.get(id(declaration))
        if formula is None:
            context = Context(f"the definition `{declaration.title}`")
            formula = Formula(draft, entry.parsed, context, indices=declaration.indices)
            formulas[id(declaration)] = formula
        sized = formula.value(members[name].indices)
        if sized is None:
            draft.names.broken.add(family_of(name))
        else:
            built[name] = sized

    def cycle(names: list[str]) -> None:
        report_circle(draft, "definition", names, {n: members[n].declaration.key for n in names})

    draft.names.definitions = {name: partial(value, name) for name in members}
    build_on_demand(_order(draft, members, entries), build, cycle)
    found = {}
    for name, member in members.items():
        if name in built:
            entry = entries[id(member.declaration)]
            found[name] = Definition(
                name, built[name].value, entry.parsed.tree, entry.description, member.indices
            )
    return found


def _parsed(draft: Draft, members: Mapping[str, Member]) -> dict[int, _DefinitionEntry]:
    """Return the parsed expressions of the entries, by the identity of their declarations."""
    found: dict[int, _DefinitionEntry] = {}
    seen: set[int] = set()
    for member in members.values():
        d = member.declaration
        if id(d) in seen:
            continue
        seen.add(id(d))
        if d.kind:
            found[id(d)] = _DefinitionEntry(Parsed(d.key, value_of(d)), None)
            continue
        what = f"the definition `{d.title}`"
        node, fields = draft.expression_node(d.key, d.node, what, keys_of(DEFINITION))
        description = draft.text(fields.get("description"), f"`description` of {what}")
        parsed = draft.parse(node, what) if node is not None else None
        if parsed is None:
            draft.names.broken.add(d.family)
            continue
        found[id(d)] = _DefinitionEntry(parsed, description)
        draft.trees[d.title] = parsed.tree
    return found


def _order(
    draft: Draft, members: Mapping[str, Member], entries: Mapping[int, _DefinitionEntry]
) -> list[str]:
    """Return the names in an order in which most come after those they depend on."""
    needs: dict[str, list[str]] = {}
    below: dict[str, list[str]] = {}
    for name, member in members.items():
        below.setdefault(member.declaration.family, []).append(name)
    for d in {id(m.declaration): m.declaration for m in members.values()}.values():
        if id(d) in entries:
            tree = entries[id(d)].parsed.tree
            used = [draft.names.resolve(p)[0] for p in walk(tree) if isinstance(p, Name)]
            needs.setdefault(d.family, []).extend(n for n in used if n in below)
    order, _ = topological_order(needs)
    return [name for family in order for name in below[family]]


def report_circle(draft: Draft, what: str, cycle: list[str], keys: Mapping[str, YamlNode]) -> None:
    """Report names that are defined by each other."""
    places = [keys[name].location for name in cycle]
    first = min(range(len(cycle)), key=lambda i: places[i].line)
    cycle = cycle[first:] + cycle[:first]
    shown = [*cycle, cycle[0]]
    if len(shown) > _SHOWN:
        shown = [*shown[: _SHOWN - 1], "…", shown[-1]]
    arrows = " → ".join(f"`{name}`" for name in shown)
    draft.report.add(
        "circular",
        f"the {what} `{cycle[0]}` is defined by itself: {arrows}",
        keys[cycle[0]].location,
        "define one of them without the others" if len(cycle) > 1 else "define it without itself",
        tuple((f"`{name}` is defined here", keys[name].location) for name in cycle[1:4]),
    )
    draft.names.broken.update(map(family_of, cycle))


_SHOWN = 12  # largest number of names of a cycle in a message
