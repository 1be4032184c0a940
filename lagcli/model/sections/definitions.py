"""Named expressions: functions, definitions and outputs."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import partial
from typing import NamedTuple

from symengine import Basic

from lagcli.columns import SCALARS
from lagcli.functions import FUNCTIONS
from lagcli.model.diagnostics import Broken
from lagcli.model.expression.grammar import KEYWORDS
from lagcli.model.expression.tensors import Sized
from lagcli.model.expression.tokens import error_at, is_name
from lagcli.model.expression.trees import Name, Tree, walk
from lagcli.model.keys import DEFINITION, OUTPUT, keys_of
from lagcli.model.model import Definition
from lagcli.model.names.building import TENSOR_FUNCTIONS, name_errors
from lagcli.model.names.dependencies import Unbuilt, build_on_demand, topological_order
from lagcli.model.names.draft import Draft, Formula, Parsed
from lagcli.model.names.expansion import MACROS, expand_function, functions_called
from lagcli.model.names.families import (
    Declaration,
    Member,
    by_name,
    declarations,
    expanded,
    valid_name,
)
from lagcli.model.names.members import family_of
from lagcli.model.names.namespace import DOTS, Allowed, Macro
from lagcli.model.names.scope import Scope
from lagcli.model.sections.coordinates import si_unit, value_of
from lagcli.model.spelling import shorten
from lagcli.model.yaml.source import Scalar, YamlNode


class _DefinitionEntry(NamedTuple):
    parsed: Parsed
    description: str | None


def expand_definitions(draft: Draft, declared: list[Declaration]) -> dict[str, Member]:
    """Return the declared definitions by name; add the names to the draft."""
    members = by_name(draft, expanded(draft, declared))

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
            what = f"the definition `{declaration.title}`"
            formula = Formula(draft, entry.parsed, what, indices=declaration.indices)
            formulas[id(declaration)] = formula
        sized = formula.value(members[name].indices)
        if sized is None:
            draft.names.broken.add(family_of(name))
        else:
            built[name] = sized

    def cycle(names: list[str]) -> None:
        report_cycle(draft, "definition", names, {n: members[n].declaration.key for n in names})

    draft.names.definitions = {name: partial(value, name) for name in members}
    build_on_demand(_order(draft, members, entries), build, cycle)
    definitions = {}
    for name, member in members.items():
        if name in built:
            entry = entries[id(member.declaration)]
            definitions[name] = Definition(
                name, built[name].value, entry.parsed.tree, entry.description, member.indices
            )
    return definitions


def _parsed(draft: Draft, members: Mapping[str, Member]) -> dict[int, _DefinitionEntry]:
    """Return the parsed expressions of the entries, by the identity of their declarations."""
    parsed_entries: dict[int, _DefinitionEntry] = {}
    seen: set[int] = set()
    for member in members.values():
        d = member.declaration
        if id(d) in seen:
            continue
        seen.add(id(d))
        if d.kind:
            parsed_entries[id(d)] = _DefinitionEntry(Parsed(d.key, value_of(d)), None)
            continue
        what = f"the definition `{d.title}`"
        node, fields = draft.expression_node(d.key, d.node, what, keys_of(DEFINITION))
        description = draft.text(fields.get("description"), f"`description` of {what}")
        parsed = draft.parse(node, what) if node is not None else None
        if parsed is None:
            draft.names.broken.add(d.family)
            continue
        parsed_entries[id(d)] = _DefinitionEntry(parsed, description)
        draft.trees[f"definitions.{d.title}"] = parsed.tree
    return parsed_entries


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


def report_cycle(draft: Draft, what: str, cycle: list[str], keys: Mapping[str, YamlNode]) -> None:
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


_KEY = r"\s*([^\s(]+)\s*\(([^()]*)\)\s*"
_RESERVED = {*FUNCTIONS, *TENSOR_FUNCTIONS, *MACROS, *KEYWORDS, "sum"}


def read_functions(draft: Draft) -> list[Declaration]:
    """Return the declarations of the functions, and enter them into the draft's names."""
    declared: list[Declaration] = []
    functions: dict[str, Macro] = {}
    for _, key, node in draft.entries("functions") or []:
        head = _head(draft, key)
        if head is None:
            continue
        name, arguments = head
        if name in functions:
            first = next(d for d in declared if d.name == name)
            draft.report.add(
                "duplicate-name",
                f"the function `{name}` is declared twice",
                key.location,
                "rename one of the two",
                (("the first one is here", first.key.location),),
            )
            continue
        parsed = draft.parse_alone(node, f"the function `{name}`")
        functions[name] = Macro(arguments, None if parsed is None else parsed.tree)
        declared.append(Declaration(name, key, node if parsed is None else parsed.node))
    draft.names.functions = functions
    return declared


def _head(draft: Draft, key: Scalar) -> tuple[str, tuple[str, ...]] | None:
    """Return name and arguments of a function; report an invalid key."""
    match = re.fullmatch(_KEY, key.value)
    if match is None:
        draft.report.add(
            "bad-name",
            f"`{shorten(key.value)}` is not a function with its arguments",
            key.location,
            "write `f(x): x^2`, or `f(x, y): …`; a name without arguments belongs under"
            " `definitions`",
        )
        return None
    name, arguments = match[1], tuple(x.strip() for x in match[2].split(","))
    if name in _RESERVED:
        draft.report.add(
            "reserved-name",
            f"`{name}` cannot be the name of a function: it is built in",
            key.location,
            "choose another name",
        )
        return None
    if not valid_name(draft, name, key, "function"):
        return None
    for argument in arguments:
        if not is_name(argument) or argument in (*KEYWORDS, "t", "pi"):
            draft.report.add(
                "bad-name",
                f"`{shorten(argument)}` cannot be an argument of the function `{name}`",
                key.location,
                "an argument is a name: a letter followed by letters, digits and _",
            )
            return None
    if len(set(arguments)) < len(arguments):
        draft.report.add(
            "duplicate-name",
            f"the function `{name}` has two arguments of the same name",
            key.location,
            "rename one of the two",
        )
        return None
    return name, arguments


def check_functions(draft: Draft, declared: list[Declaration]) -> None:
    """Expand the functions that others call, and report errors.

    Reported are unknown names, functions that call themselves, and those that are too large.
    """
    names = draft.names
    functions = names.functions = dict(names.functions)
    nodes = {d.name: d.node for d in declared}
    written = {name: functions[name].tree for name in nodes}
    calls = {
        name: {} if tree is None else functions_called(tree, names)
        for name, tree in written.items()
    }
    order, cycles = topological_order(calls)
    for cycle in cycles:
        if all(functions[name].tree is not None for name in cycle):
            _report_recursion(draft, cycle, calls, nodes)
        functions.update({name: functions[name]._replace(tree=None) for name in cycle})
    for name in order:
        macro, node = functions[name], nodes[name]
        if macro.tree is None:
            continue
        assert isinstance(node, Scalar)
        functions[name] = macro._replace(tree=None)
        with draft.report.expression(node):
            expanded = expand_function(macro, names)
            assert expanded.tree is not None
            errors, broken = name_errors(expanded.tree, _FunctionScope(draft, name, macro))
            for error in errors:
                draft.report.add_expression_error(error, node)
            if not (errors or broken):
                functions[name] = expanded


def _report_recursion(
    draft: Draft,
    cycle: list[str],
    calls: Mapping[str, Mapping[str, Tree]],
    nodes: Mapping[str, YamlNode],
) -> None:
    """Report functions that call each other, at the first call."""
    name, node = cycle[0], nodes[cycle[0]]
    assert isinstance(node, Scalar)
    shown = cycle if len(cycle) <= _SHOWN else [*cycle[:_SHOWN], "…"]
    chain = " → ".join(f"`{x}`" for x in (*shown, name))
    error = error_at(
        "circular",
        f"the function `{name}` calls itself: {chain}",
        calls[name][cycle[1 % len(cycle)]],
        "a function cannot be recursive; a recursive definition of a family can",
    )
    draft.report.add_expression_error(error, node)


class _FunctionScope(Scope):
    """Scope of a function's expression, in which its arguments may have any value."""

    def __init__(self, draft: Draft, name: str, macro: Macro):
        where = f"the function `{name}`"
        super().__init__(draft.names, where, Allowed.ACCELERATIONS, macro.arguments)

    def check(self, name: Name) -> None:
        """Check a name that is not an argument."""
        if re.split(r"[.\[]", name.text)[0] in self.bound:
            for index in name.indices:
                self.check_index(index)
            return
        super().check(name)


_COLUMNS = {"t", "time", *(quantity.name for quantity in SCALARS)}


def read_outputs(draft: Draft) -> tuple[dict[str, Basic], dict[str, str]]:
    """Return the outputs and their units, by name."""
    outputs: dict[str, Basic] = {}
    units: dict[str, str] = {}
    declared = declarations(draft, draft.entries("outputs") or [], "output")
    members = by_name(draft, expanded(draft, declared))
    named: dict[int, list[str]] = {}
    for name, member in members.items():
        named.setdefault(id(member.declaration), []).append(name)
    for d in declared:
        own = named.get(id(d), [])
        taken = next((name for name in own if _taken(draft, name)), None)
        if taken is not None:
            draft.report.add(
                "duplicate-name",
                f"the output `{taken}` has the name of a column that every result has",
                d.key.location,
                "choose another name, or remove the output: results contain this column anyway",
            )
            continue
        what = f"the output `{d.title}`"
        node, fields = draft.expression_node(d.key, d.node, what, keys_of(OUTPUT))
        draft.text(fields.get("description"), f"`description` of {what}")
        unit = draft.text(fields.get("unit"), f"`unit` of {what}")
        if unit is not None and (si := si_unit(draft, unit, fields["unit"])):
            units.update(dict.fromkeys(own, si))
        parsed = draft.parse(node, what) if node is not None else None
        if parsed is None:
            continue
        formula = Formula(draft, parsed, what, Allowed.ACCELERATIONS, d.indices)
        draft.trees[f"outputs.{d.title}"] = parsed.tree
        for name in own:
            value = formula.scalar(members[name].indices)
            if value is not None:
                outputs[name] = value
    draft.names.broken.update(family_of(name) for name in members if name not in outputs)
    return outputs, units


def _taken(draft: Draft, name: str) -> bool:
    """Whether every result has a column with this name."""
    coordinates = draft.names.coordinates
    stems = [name, *(name.removesuffix(suffix) for suffix, _ in DOTS)]
    return name in _COLUMNS or any(stem in coordinates for stem in stems)
