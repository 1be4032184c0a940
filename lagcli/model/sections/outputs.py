"""The outputs: additional columns of a result."""

from __future__ import annotations

from symengine import Basic

from lagcli.columns import SCALARS
from lagcli.model.draft import Draft, Formula
from lagcli.model.keys import OUTPUT, keys_of
from lagcli.model.names.families import by_name, declarations
from lagcli.model.sections.coordinates import expanded, si_unit
from lagcli.model.symbols import DOTS, Context, Symbols

_COLUMNS = {"t", "time", *(quantity.name for quantity in SCALARS)}


def read_outputs(draft: Draft, constants: Symbols) -> tuple[dict[str, Basic], dict[str, str]]:
    """Return the outputs and their units, by name."""
    found: dict[str, Basic] = {}
    units: dict[str, str] = {}
    declared = declarations(draft, draft.entries("outputs") or [], "output")
    members = by_name(draft, expanded(draft, declared, constants))
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
        context = Context(what, accelerations=True, multipliers=True)
        formula = Formula(draft, parsed, context, indices=d.indices)
        draft.trees[f"outputs.{d.title}"] = parsed.tree
        for name in own:
            value = formula.scalar(members[name].indices)
            if value is not None:
                found[name] = value
    return found, units


def _taken(draft: Draft, name: str) -> bool:
    """Whether every result has a column with this name."""
    coordinates = draft.names.coordinates
    stems = [name, *(name.removesuffix(suffix) for suffix, _ in DOTS)]
    return name in _COLUMNS or any(stem in coordinates for stem in stems)
