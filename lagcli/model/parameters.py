"""The parameters: numbers, numbers with a unit, and expressions of other parameters."""

from __future__ import annotations

import numbers
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import symengine as se
from symengine import Basic

from lagcli.errors import SourceLocation
from lagcli.model.declarations import valid_name
from lagcli.model.definitions import report_circle
from lagcli.model.dependencies import in_order
from lagcli.model.draft import Draft, Entry
from lagcli.model.model import Parameter
from lagcli.model.quantities import Quantity, constant, evaluate, read_quantity, unit_of
from lagcli.model.scope import Context, Names
from lagcli.model.source import Mapping as MappingNode
from lagcli.model.source import Node, Scalar, Source
from lagcli.model.spelling import did_you_mean, nearest, shorten
from lagcli.model.trees import Name, walk
from lagcli.model.units import UNIT_HELP, UnknownUnit, to_si


@dataclass(frozen=True)
class _Text:
    """A parameter as it is given, its value still an expression."""

    quantity: Quantity
    description: str | None


def read_parameters(
    draft: Draft, entries: list[Entry], overrides: Mapping[str, object]
) -> tuple[dict[str, Parameter], Names]:
    """Evaluate the parameters, and enter them into the draft's names.

    Returns
    -------
    parameters : dict of str to Parameter
        Those that have a value.
    constants : Names
        The parameters alone, each standing for its value: where a number is wanted. In the draft's
        names a parameter stands for its symbol.
    """
    nodes = {
        name: (key, node)
        for name, key, node in entries
        if valid_name(draft, name, key, "parameter")
    }
    found: dict[str, Parameter] = {}

    def value(name: str) -> Basic:
        return constant(found[name].value)

    constants = replace(draft.names, parameters={name: partial(value, name) for name in nodes})
    texts: dict[str, _Text] = {}
    for name, (_, node) in nodes.items():
        text = _read(draft, name, node, overrides, constants)
        if text is None:
            draft.names.broken.add(name)
        else:
            texts[name] = text
    for name, given in overrides.items():
        if name not in nodes:
            _report_unknown_override(draft, name, given, list(nodes))
    needs = {
        name: [part.text for part in walk(text.quantity.parsed.tree) if isinstance(part, Name)]
        for name, text in texts.items()
    }
    order, circles = in_order(needs)
    for circle in circles:
        keys = {n: texts[n].quantity.parsed.node if n in overrides else nodes[n][0] for n in circle}
        report_circle(draft, "parameter", circle, keys)
    for name in order:
        if name not in draft.names.broken:
            parameter = _evaluated(draft, name, texts[name], constants)
            if parameter is None:
                draft.names.broken.add(name)
            else:
                found[name] = parameter
    draft.names.parameters = {name: partial(se.Symbol, name) for name in nodes}
    return {name: found[name] for name in nodes if name in found}, constants


def _read(
    draft: Draft, name: str, node: Node, overrides: Mapping[str, object], names: Names
) -> _Text | None:
    what = f"the parameter `{name}`"
    description, unit, good = None, None, True
    value: Node | None = node
    if isinstance(node, MappingNode):
        fields = draft.fields(node, what, ("value", "unit", "description"))
        description = draft.text(fields.get("description"), f"`description` of {what}")
        unit, good = _unit(draft, fields.get("unit"), what)
        value = fields.get("value")
        if value is None and name not in overrides:
            draft.report.add(
                "missing-value",
                f"{what} has no `value`",
                node.location,
                f"write `{name}: {{value: 1}}`, or just `{name}: 1`",
            )
    if name in overrides:
        unit = unit or unit_of(value)
        value = override_node("--set", name, overrides[name])
        if not _is_number(value.value):
            unit = None
        elif unit is not None and to_si(unit) != 1:
            draft.report.add(
                "ambiguous-unit",
                f"`{name}` is given in {unit} in the file, and without a unit here",
                value.location,
                f"write the unit: --set '{name}={value.value} {unit}'",
            )
            return None
    if value is None or not good:
        return None
    quantity = read_quantity(draft, value, what, names, unit)
    return None if quantity is None else _Text(quantity, description)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _unit(draft: Draft, node: Node | None, what: str) -> tuple[str | None, bool]:
    """Return the unit that a field gives, and whether it is one."""
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


def _evaluated(draft: Draft, name: str, text: _Text, names: Names) -> Parameter | None:
    context = Context(f"the parameter `{name}`", coordinates=False, definitions=False, time=False)
    value = evaluate(draft, text.quantity, context, names)
    if value is None:
        return None
    node = text.quantity.parsed.node
    return Parameter(name, value, text.quantity.unit, text.description, node.value)


def override_node(option: str, name: str, value: object) -> Scalar:
    """Return a value from the command line, or from Python, as a node."""
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        text = str(value)
    else:
        text = str(int(value)) if isinstance(value, numbers.Integral) else repr(float(value))
    source = Source(text, f"{option} {name}={text}", numbered=False)
    return Scalar(source, (0, 0), (0, len(text)), text)


def _report_unknown_override(draft: Draft, name: str, given: object, known: list[str]) -> None:
    names = draft.names
    where = override_node("--set", name, given).source.path
    base = name.rstrip("'").removesuffix("_ddot").removesuffix("_dot")
    if base in names.coordinates:
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
