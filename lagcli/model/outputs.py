"""The outputs: extra columns of a result."""

from __future__ import annotations

from symengine import Basic

from lagcli.model.declarations import si_unit, valid_name
from lagcli.model.draft import Draft
from lagcli.model.scope import DOTS, Context

_COLUMNS = (
    *("t", "time", "energy_kinetic", "energy_potential", "energy_total", "power_applied"),
    *("power_constraint", "power_time", "energy_balance", "residual_equation"),
)


def read_outputs(draft: Draft) -> tuple[dict[str, Basic], dict[str, str]]:
    """Return the outputs and their units, by name."""
    found: dict[str, Basic] = {}
    units: dict[str, str] = {}
    taken = {*_COLUMNS, *draft.names.coordinates}
    taken |= {f"{q}{suffix}" for q in draft.names.coordinates for suffix, _ in DOTS}
    for name, key, given in draft.entries("outputs") or []:
        if not valid_name(draft, name, key, "output"):
            continue
        if name in taken:
            draft.report.add(
                "duplicate-name",
                f"the output `{name}` has the name of a column that every result has",
                key.location,
                "choose another name; the column need not be asked for",
            )
            continue
        what = f"the output `{name}`"
        node, fields = draft.expression_node(
            key, given, what, known=("expr", "unit", "description")
        )
        draft.text(fields.get("description"), f"`description` of {what}")
        unit = draft.text(fields.get("unit"), f"`unit` of {what}")
        if unit is not None and si_unit(draft, unit, fields["unit"]):
            units[name] = unit
        parsed = draft.parse(node, what) if node is not None else None
        if parsed is None:
            continue
        value = draft.scalar(parsed, Context(what, accelerations=True, multipliers=True))
        if value is not None:
            found[name] = value
            draft.trees[f"outputs.{name}"] = parsed.tree
    return found, units
