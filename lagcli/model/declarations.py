"""Names: the keys of a model, its coordinates, and what is declared twice."""

from __future__ import annotations

import re

from lagcli.errors import SourceLocation
from lagcli.model.draft import Draft, Entry
from lagcli.model.grammar import KEYWORDS
from lagcli.model.model import Coordinate
from lagcli.model.scope import DOTS
from lagcli.model.source import Mapping, Node, Scalar, Sequence
from lagcli.model.spelling import did_you_mean, nearest, shorten
from lagcli.model.tokens import is_name
from lagcli.model.units import UNIT_HELP, UnknownUnit, to_si

_OTHER_KEYS = {
    **dict.fromkeys(["forces", "generalized_forces", "F"], "Q"),
    **dict.fromkeys(["kinetic", "kinetic_energy", "kinetic energy"], "T"),
    **dict.fromkeys(["potential", "potential_energy", "potential energy", "U"], "V"),
    **dict.fromkeys(["lagrangian", "Lagrangian"], "L"),
    **dict.fromkeys(["dissipation", "R"], "D"),
    **dict.fromkeys(["variables", "q", "dof"], "coordinates"),
    **dict.fromkeys(["constants", "params"], "parameters"),
    **dict.fromkeys(["title", "model"], "name"),
    **dict.fromkeys(["ic", "initial_conditions", "start", "init"], "initial"),
    **dict.fromkeys(["settings", "solver", "options"], "simulation"),
}
_WORD = re.compile(r"[^\W\d]\w*")


def check_keys(draft: Draft, keys: tuple[str, ...], later: tuple[str, ...]) -> None:
    """Report the keys that a model file does not have; what they are meant for is not missing."""
    for name, key, _ in draft.root:
        if name in keys:
            continue
        if name in later:
            draft.report.add(
                "not-yet",
                f"the key `{name}` is not part of this version",
                key.location,
                "remove it; see docs/model-file.md for the keys of this version",
            )
            continue
        close = [_OTHER_KEYS[name]] if name in _OTHER_KEYS else nearest(name, keys, 1)
        draft.meant.update(close)
        draft.report.add(
            "unknown-key",
            f"there is no key `{shorten(name)}` in a model file",
            key.location,
            did_you_mean(close) or "the keys are " + ", ".join(keys),
        )


def valid_name(draft: Draft, name: str, key: Node, what: str) -> bool:
    """Report a name that nothing can have; its words may have been meant as names."""
    report = draft.report
    if "[" in name:
        report.add(
            "not-yet",
            f"families such as `{shorten(name)}` are not part of this version",
            key.location,
            "give each member a name of its own: `x_1`, `x_2`",
            subject="family",
        )
    elif not is_name(name):
        help_ = "a name is a letter followed by letters, digits and _"
        if "," in name or " " in name.strip():
            help_ += ";\nnames in a list are separated by commas: `[x, y]`"
        report.add(
            "bad-name",
            f"`{shorten(name)}` cannot be the name of {_a(what)}",
            key.location,
            help_,
        )
    elif name in KEYWORDS or (name in ("t", "pi") and what not in ("constraint", "output")):
        meaning = {"t": "the time", "pi": "the number π"}.get(name, "a word of the grammar")
        report.add(
            "reserved-name",
            f"`{name}` cannot be the name of {_a(what)}: it is {meaning}",
            key.location,
            "choose another name",
        )
    else:
        return True
    draft.names.suspects.update(_WORD.findall(name[:200]))
    return False


def _a(what: str) -> str:
    return f"an {what}" if what[0] in "aeiou" else f"a {what}"


def read_coordinates(draft: Draft) -> tuple[Coordinate, ...]:
    """Return the coordinates; where they cannot be read, any name may be one."""
    node = draft.get("coordinates")
    found: list[Coordinate] = []
    if node is None and "coordinates" in draft.meant:
        pass
    elif node is None or (isinstance(node, Scalar) and node.missing):
        draft.report.add(
            "missing-key",
            "the model declares no `coordinates`",
            node.location if node else draft.source.location(0, 0),
            "add a line such as `coordinates: [x, y]`",
        )
    elif isinstance(node, Sequence):
        found = _listed(draft, node)
    elif isinstance(node, Mapping):
        found = [
            _coordinate(draft, name, key, value)
            for name, key, value in node
            if valid_name(draft, name, key, "coordinate")
        ]
    elif isinstance(node, Scalar):
        names = [n for n in re.split(r"[\s,;]+", node.value.strip(" []()")) if n]
        good = all(map(is_name, names)) and len(set(names)) == len(names)
        draft.report.add(
            "wrong-type",
            f"`coordinates` must be a list of names, not {node.what}",
            node.location,
            f"write `coordinates: [{shorten(', '.join(names))}]`"
            if good
            else "write `coordinates: [x, y]`",
        )
        if good:
            return tuple(Coordinate(name, location=node.location) for name in names)
    empty = isinstance(node, (Sequence, Mapping)) and not (
        node.items if isinstance(node, Sequence) else node.entries
    )
    if node is not None and empty:
        draft.report.add(
            "missing-key",
            "the model has no coordinates",
            node.location,
            "name them, as in `coordinates: [x, y]`",
        )
    if not found:
        draft.names.incomplete = True
    return tuple(found)


def _listed(draft: Draft, node: Sequence) -> list[Coordinate]:
    found: dict[str, Coordinate] = {}
    for item in node.items:
        if not isinstance(item, Scalar):
            draft.report.add(
                "wrong-type",
                f"a coordinate in a list is a name, not {item.what}",
                item.location,
                "to give units, write a mapping:\ncoordinates:\n  x: {unit: m}",
            )
            if isinstance(item, Mapping):
                draft.names.suspects.update(item.entries)
        elif item.value in found:
            draft.report.add(
                "duplicate-name",
                f"the coordinate `{item.value}` stands twice in the list",
                item.location,
                "remove one of the two",
                (("the first one is here", found[item.value].location),),
            )
        elif valid_name(draft, item.value, item, "coordinate"):
            found[item.value] = Coordinate(item.value, location=item.location)
    return list(found.values())


def _coordinate(draft: Draft, name: str, key: Scalar, value: Node) -> Coordinate:
    if isinstance(value, Scalar):
        unit = si_unit(draft, None if value.missing else value.value.strip(), value)
        return Coordinate(name, unit, location=key.location)
    if not isinstance(value, Mapping):
        draft.report.add(
            "wrong-type",
            f"the coordinate `{name}` must be followed by a unit or a mapping, not {value.what}",
            value.location,
            f"write `{name}: m`, or `{name}: {{unit: m, description: …}}`",
        )
        return Coordinate(name, location=key.location)
    what = f"the coordinate `{name}`"
    fields = draft.fields(value, what, ("unit", "description", "latex"))
    texts = {f: draft.text(n, f"`{f}` of {what}") for f, n in fields.items()}
    unit = si_unit(draft, texts.get("unit"), fields["unit"]) if texts.get("unit") else None
    return Coordinate(name, unit, texts.get("description"), texts.get("latex"), key.location)


def si_unit(draft: Draft, unit: str | None, node: Node) -> str | None:
    """Check a unit in which results are stated: it must be coherent SI."""
    if unit is None:
        return None
    try:
        factor = to_si(unit)
    except UnknownUnit as error:
        draft.report.add("unknown-unit", str(error), node.location, UNIT_HELP)
        return None
    if factor != 1:
        draft.report.add(
            "not-si",
            f"coordinates and outputs are in SI, but `{shorten(unit)}` is not",
            node.location,
            "write m, rad, N, …; parameters and initial values may have any unit",
        )
        return None
    return unit


def declare(
    draft: Draft,
    coordinates: tuple[Coordinate, ...],
    parameters: list[Entry],
    definitions: list[Entry],
) -> None:
    """Enter the names, and report those declared twice."""
    names, report = draft.names, draft.report
    places: dict[str, tuple[str, SourceLocation]] = {}

    def enter(name: str, what: str, location: SourceLocation) -> None:
        if name not in places:
            places[name] = (what, location)
            return
        other, place = places[name]
        report.add(
            "duplicate-name",
            f"`{shorten(name)}` is declared twice: as {other} and as {what}",
            location,
            "rename one of the two",
            ((f"the {other.split()[0]} is declared here", place),),
        )
        names.broken.add(name)

    for c in coordinates:
        assert c.location is not None
        enter(c.name, "coordinate", c.location)
    for c in coordinates:
        assert c.location is not None
        for suffix, order in DOTS:
            primed = c.name + "'" * order
            enter(c.name + suffix, f"coordinate (`{c.name}{suffix}` is `{primed}`)", c.location)
    for what, entries in (("parameter", parameters), ("definition", definitions)):
        for name, key, _ in entries:
            if is_name(name):
                enter(name, what, key.location)
    names.coordinates = dict.fromkeys(c.name for c in coordinates)
    names.lines = {
        name: (what, place.line) for name, (what, place) in places.items() if " " not in what
    }
