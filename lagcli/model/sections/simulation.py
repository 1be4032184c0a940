"""The `simulation` block: settings with the same names as the command line's options."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from lagcli.columns import unit_quotient
from lagcli.model.expression.units import commensurable
from lagcli.model.model import Coordinate, Tolerance
from lagcli.model.names.draft import Draft, Quantity, QuantityValue, read_quantity
from lagcli.model.names.families import members_of, read_key
from lagcli.model.sections.initial import canonical_name
from lagcli.model.sections.parameters import names_used
from lagcli.model.spelling import did_you_mean, nearest, shorten
from lagcli.model.yaml.source import Mapping, Scalar, Sequence, YamlNode
from lagcli.settings.kinds import Choice, Flag, Names, Times, Tolerances, WholeNumber
from lagcli.settings.settings import SettingsOverrides


def read_settings(
    draft: Draft, coordinates: Iterable[Coordinate]
) -> tuple[SettingsOverrides, frozenset[str]]:
    """Return the settings of the file, and the parameters they depend on."""
    needs: set[str] = set()
    units = {c.name: c.unit for c in coordinates if c.unit}
    units |= {f"{name}'": unit_quotient(unit, "s") for name, unit in units.items()}
    return _read(draft, needs, units), frozenset(needs)


def _read(draft: Draft, needs: set[str], units: dict[str, str]) -> SettingsOverrides:
    node = draft.get("simulation")
    if draft.entries("simulation") is None or not isinstance(node, Mapping):
        return SettingsOverrides()
    fields = draft.fields(node, "`simulation`", tuple(SettingsOverrides.DECLARED))
    settings = SettingsOverrides(
        **{name: _value(draft, name, field, needs, units) for name, field in fields.items()}
    )
    for problem in settings.problems():
        place = fields.get(problem.key, node)
        draft.report.add("bad-setting", str(problem), place.location, problem.help)
    return settings


def _value(draft: Draft, name: str, node: YamlNode, needs: set[str], units: dict[str, str]) -> Any:
    """Return the value of a setting; None if it has an error."""
    declared = SettingsOverrides.DECLARED[name]
    match declared:
        case Choice():
            return _word(draft, name, node)
        case Flag():
            return _flag(draft, name, node)
        case Names():
            items = node.items if isinstance(node, Sequence) else [node]
            words = [word for item in items if (word := _word(draft, name, item)) is not None]
            return words if len(words) == len(items) else None
        case WholeNumber():
            return _whole_number(draft, name, node, needs)
        case Times():
            items = node.items if isinstance(node, Sequence) else [node]
            what = f"a time of `{name}`" if isinstance(node, Sequence) else f"`{name}`"
            times = [
                _number(draft, what, item, needs, f"{name}.{k}", declared.unit)
                for k, item in enumerate(items)
            ]
            return None if None in times else times
        case Tolerances() if isinstance(node, Mapping):
            return _tolerances(draft, node, needs, units)
    by_name = "with a unit, it is given by name: `atol: {x: 1 nm}`"
    help_ = by_name if isinstance(declared, Tolerances) else ""
    return _number(draft, f"`{name}`", node, needs, name, declared.unit, help_)


def _word(draft: Draft, name: str, node: YamlNode) -> str | None:
    if isinstance(node, Scalar) and not node.missing:
        return node.value.strip()
    draft.report.add("wrong-type", f"`{name}` must be a word, not {node.what}", node.location)
    return None


def _flag(draft: Draft, name: str, node: YamlNode) -> bool | None:
    text = _word(draft, name, node)
    if text is None or text in ("true", "false"):
        return None if text is None else text == "true"
    draft.report.add(
        "bad-setting",
        f"`{name}` must be true or false, not {node.what}",
        node.location,
        "write `true` or `false`",
    )
    return None


def _whole_number(draft: Draft, name: str, node: YamlNode, needs: set[str]) -> int | None:
    value = _number(draft, f"`{name}`", node, needs, name, "")
    if value is None or value == int(value):
        return None if value is None else int(value)
    draft.report.add(
        "bad-setting",
        f"`{name}` must be a whole number, not {node.what}",
        node.location,
        f"write `{name}: {round(value)}`",
    )
    return None


def _tolerances(
    draft: Draft, node: Mapping, needs: set[str], units: dict[str, str]
) -> dict[str, float] | None:
    """Return the absolute tolerances by coordinate and velocity (``phi'``)."""
    tolerances: dict[str, float] = {}
    for name, (key, entry) in node.entries.items():
        members = _members(draft, name, key)
        what = f"the tolerance of `{shorten(name)}`"
        quantity = read_quantity(draft, entry, what)
        expected = dict.fromkeys(units[x] for x in members if x in units)
        if quantity is None or not all(_fits(draft, what, quantity, x) for x in expected):
            continue
        draft.tolerances.update(dict.fromkeys(members, Tolerance(name, quantity.parsed.tree)))
        value = _in_si(draft, what, quantity, needs)
        if value is not None:
            tolerances.update(dict.fromkeys(members, value))
    return tolerances or None


def _members(draft: Draft, name: str, key: Scalar) -> list[str]:
    """Return the coordinates or velocities that an entry names; report an unknown name."""
    canonical = canonical_name(draft, name)
    if canonical is not None:
        return [canonical]
    names = draft.names
    if "[" in name:
        declaration = read_key(draft, key, key, "tolerance", primed=True)
        if declaration is None:
            return []
        ending = "'" * declaration.primes
        members = [member.name for member in members_of(draft, declaration)]
        if members and all(member in names.coordinates for member in members):
            return [member + ending for member in members]
    if not names.incomplete:
        every = [name for q in names.coordinates for name in (q, f"{q}'")]
        draft.report.add(
            "unknown-name",
            f"`atol` names `{shorten(name)}`, which is not a coordinate or a velocity",
            key.location,
            did_you_mean(nearest(name, every))
            or "the coordinates are " + ", ".join(f"`{q}`" for q in list(names.coordinates)[:12]),
        )
    return []


def _number(
    draft: Draft,
    what: str,
    node: YamlNode,
    needs: set[str],
    place: str,
    expected: str,
    help_: str = "",
) -> float | None:
    """Return the value of a number, whose unit must have the dimension of the expected one.

    Its expression is kept under the name of its place, for the check of dimensions.
    """
    quantity = read_quantity(draft, node, what)
    if quantity is None or not _fits(draft, what, quantity, expected, help_):
        return None
    if quantity.unit is None and quantity.number is None:
        draft.trees[f"simulation.{place}"] = quantity.parsed.tree
    return _in_si(draft, what, quantity, needs)


def _fits(draft: Draft, what: str, quantity: Quantity, expected: str, help_: str = "") -> bool:
    """Whether the unit of a quantity has the dimension of the expected one; report another."""
    if quantity.unit is None or commensurable(quantity.unit, expected or "1"):
        return True
    draft.report.add(
        "units",
        f"{what} is in {quantity.unit}, but must be {f'in {expected}' if expected else 'a number'}",
        quantity.parsed.node.location,
        help_ or (f"give it in {expected}" if expected else "remove the unit"),
    )
    return False


def _in_si(draft: Draft, what: str, quantity: Quantity, needs: set[str]) -> float | None:
    """Return the value of a quantity in SI, and note the parameters that it depends on."""
    needs.update(names_used(quantity.parsed.tree))
    return QuantityValue(draft, quantity, what).number()
