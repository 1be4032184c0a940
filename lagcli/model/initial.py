"""The initial values: fixed or guessed, one for every coordinate and velocity."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from lagcli.errors import SourceLocation
from lagcli.model.draft import Draft
from lagcli.model.model import InitialValue
from lagcli.model.parameters import override_node
from lagcli.model.quantities import evaluate, read_quantity
from lagcli.model.scope import Context, Names
from lagcli.model.source import Mapping as MappingNode
from lagcli.model.source import Node, Scalar
from lagcli.model.spelling import did_you_mean, nearest, shorten

_SHOWN = 12  # missing entries written out

Values = dict[str, InitialValue]


def read_initial(
    draft: Draft, constants: Names, overrides: Mapping[str, object]
) -> tuple[Values, Values]:
    """Return the initial coordinates and velocities, by coordinate."""
    names = draft.names
    values: Values = {}
    attempted: dict[str, Scalar | None] = {}
    replaced = {_canonical(draft, name) for name in overrides}
    entries = draft.entries("initial")
    for name, key, node in entries or []:
        canonical = _canonical(draft, name)
        if canonical is None:
            _report_unknown(draft, name, key)
            continue
        first = attempted.get(canonical)
        if first is not None:
            draft.report.add(
                "duplicate-key",
                f"`{canonical}` has two initial values",
                key.location,
                "`x_dot` and `x'` are the same thing; keep one of them",
                (("the first one is here", first.location),),
            )
            continue
        attempted[canonical] = key
        if canonical not in replaced:
            _read(draft, canonical, node, values, constants)
    given: dict[str, str] = {}
    for name, value in overrides.items():
        canonical = _canonical(draft, name)
        if canonical is None:
            _report_unknown_override(draft, name, value)
            continue
        if canonical in given:
            place = override_node("--set-initial", name, value).location
            message = f"`{canonical}` is given twice, as {given[canonical]} and {name}"
            draft.report.add("duplicate-key", message, place, "keep one of them")
            continue
        given[canonical] = name
        attempted.setdefault(canonical, None)
        node = override_node("--set-initial", name, value)
        _read(draft, canonical, node, values, constants)
    if entries is not None and not names.incomplete and "initial" not in draft.meant:
        _report_missing(draft, set(attempted))
    positions = {q: values[q] for q in names.coordinates if q in values}
    velocities = {q: values[f"{q}'"] for q in names.coordinates if f"{q}'" in values}
    return positions, velocities


def _canonical(draft: Draft, name: str) -> str | None:
    """Return the coordinate or velocity (x') that an entry names."""
    if name in draft.names.coordinates:
        return name
    for ending in ("'", "_dot"):
        base = name.removesuffix(ending)
        if base != name and base in draft.names.coordinates:
            return f"{base}'"
    return None


def _every(draft: Draft) -> list[str]:
    return [name for q in draft.names.coordinates for name in (q, f"{q}'")]


def _report_unknown(draft: Draft, name: str, key: Scalar) -> None:
    names = draft.names
    base = name.rstrip("'").removesuffix("_ddot").removesuffix("_dot")
    if names.incomplete or base in names.suspects:
        return
    what, line = names.lines.get(base, ("", 0))
    if base in names.coordinates:
        message = f"`{shorten(name)}` has no initial value: accelerations are computed"
        help_: str | None = "remove the entry"
    else:
        message = f"`initial` names `{shorten(name)}`, which is not a coordinate or a velocity"
        help_ = did_you_mean(nearest(name, _every(draft)))
        if what:
            help_ = f"`{base}` is a {what} (line {line}); remove the entry"
    draft.report.add(
        "unknown-name",
        message,
        key.location,
        help_
        or "the coordinates are " + ", ".join(f"`{q}`" for q in list(names.coordinates)[:_SHOWN]),
    )


def _report_unknown_override(draft: Draft, name: str, value: object) -> None:
    names = draft.names
    if names.incomplete:
        return
    where = override_node("--set-initial", name, value).source.path
    every = _every(draft)
    help_ = did_you_mean(nearest(name, every))
    if name in names.parameters:
        help_ = f"`{name}` is a parameter: give --set {name}={value}"
    draft.report.add(
        "unknown-name",
        f"the model has no initial value `{shorten(name)}`",
        SourceLocation(where, 0, 0),
        help_ or f"its initial values are {', '.join(every[: 2 * _SHOWN])}",
    )


def _read(draft: Draft, name: str, node: Node, values: Values, constants: Names) -> None:
    what = f"the initial value of `{name}`"
    fixed = True
    location = node.location
    if isinstance(node, MappingNode):
        fields = draft.fields(node, what, ("guess",))
        if "guess" not in fields:
            if not node.entries:
                draft.report.add(
                    "missing-value", f"{what} is empty", location, "write a number, or {guess: 0}"
                )
            return
        fixed, node = False, fields["guess"]
    context = Context(what, coordinates=False, definitions=False, time=False)
    names = replace(
        constants, coordinates=draft.names.coordinates, definitions=draft.names.definitions
    )
    quantity = read_quantity(draft, node, what, names)
    if quantity is not None:
        value = evaluate(draft, quantity, context, names)
        if value is not None:
            values[name] = InitialValue(value, fixed, location)


def _report_missing(draft: Draft, attempted: set[str]) -> None:
    missing = [n for n in _every(draft) if n not in attempted]
    missing = [n for n in missing if n.rstrip("'") not in draft.names.broken]
    if not missing:
        return
    entry = draft.root.entries.get("initial")
    shown = missing[:_SHOWN]
    rest = f" and {len(missing) - _SHOWN} more" if len(missing) > _SHOWN else ""
    draft.report.add(
        "missing-initial",
        "no initial value for " + ", ".join(f"`{n}`" for n in shown) + rest,
        entry[0].location if entry else draft.source.location(0, 0),
        "every coordinate and velocity needs a number, or {guess: …} where the constraints"
        " decide:\ninitial:\n" + "\n".join(f"  {n}: 0" for n in shown),
    )
