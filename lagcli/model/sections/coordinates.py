"""Coordinates: scalars, points and quaternions; unknown keys; names that are declared twice."""

from __future__ import annotations

import re
from collections.abc import Iterable
from fractions import Fraction
from typing import NamedTuple

from lagcli.errors import SourceLocation
from lagcli.model.expression.tokens import is_name
from lagcli.model.expression.trees import (
    BRACKETS,
    CallExpr,
    Name,
    NumberExpr,
    PowerExpr,
    SumExpr,
    Tree,
    VectorExpr,
)
from lagcli.model.expression.units import UNIT_HELP, UnknownUnit, si_notation, to_si
from lagcli.model.keys import COORDINATE, keys_of
from lagcli.model.model import Coordinate
from lagcli.model.names.draft import Draft
from lagcli.model.names.families import Declaration, Member, by_name, expanded, read_key
from lagcli.model.names.members import family_of, indices_of
from lagcli.model.names.namespace import DOTS
from lagcli.model.spelling import did_you_mean, nearest, shorten
from lagcli.model.yaml.source import Mapping, Scalar, Sequence, YamlNode

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


def check_keys(draft: Draft, keys: tuple[str, ...]) -> None:
    """Report unknown keys of a model file; a key they may stand for is not reported as missing."""
    for name, key, _ in draft.root:
        if name in keys:
            continue
        close = [_OTHER_KEYS[name]] if name in _OTHER_KEYS else nearest(name, keys, 1)
        draft.misspelled_keys.update(close)
        draft.report.add(
            "unknown-key",
            f"there is no key `{shorten(name)}` in a model file",
            key.location,
            did_you_mean(close) or "the keys are " + ", ".join(keys),
        )


class CoordinateEntry(NamedTuple):
    """An entry of `coordinates`: its key and its fields."""

    declaration: Declaration
    coordinate: Coordinate


def read_coordinates(draft: Draft) -> list[CoordinateEntry]:
    """Return the entries of the coordinates; if they cannot be read, any name may be a
    coordinate."""
    node = draft.get("coordinates")
    entries: list[CoordinateEntry] = []
    if node is None and "coordinates" in draft.misspelled_keys:
        pass
    elif node is None or (isinstance(node, Scalar) and node.missing):
        draft.report.add(
            "missing-key",
            "the model declares no `coordinates`",
            node.location if node else draft.source.location(0, 0),
            "add a line such as `coordinates: [x, y]`",
        )
    elif isinstance(node, Sequence):
        entries = _listed(draft, node)
    elif isinstance(node, Mapping):
        for _, key, value in node:
            declaration = read_key(draft, key, value, "coordinate")
            if declaration is not None:
                entries += _entries(draft, declaration)
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
            plain = [Declaration(name, node, node) for name in names]
            return [CoordinateEntry(d, Coordinate(d.name, location=node.location)) for d in plain]
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
    if not entries:
        draft.names.incomplete = True
    return entries


def _listed(draft: Draft, node: Sequence) -> list[CoordinateEntry]:
    entries: dict[str, CoordinateEntry] = {}
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
        elif item.value in entries:
            draft.report.add(
                "duplicate-name",
                f"the coordinate `{item.value}` is listed twice",
                item.location,
                "remove one of the two",
                (("the first one is here", entries[item.value].declaration.key.location),),
            )
        elif (declaration := read_key(draft, item, item, "coordinate")) is not None:
            coordinate = Coordinate(declaration.name, location=item.location)
            entries[item.value] = CoordinateEntry(declaration, coordinate)
    return list(entries.values())


def _entries(draft: Draft, declaration: Declaration) -> list[CoordinateEntry]:
    """Return the coordinates of an entry: the components of a vector or rotation, or one."""
    value = declaration.node
    kind: YamlNode | None = value
    if isinstance(value, Mapping):
        kind = value.entries["kind"][1] if "kind" in value.entries else None
    name = kind.value.strip() if isinstance(kind, Scalar) else ""
    if name not in KINDS:
        if kind is not None and kind is not value:
            draft.report.add(
                "unknown-kind",
                f"the coordinate `{declaration.title}` has the kind {kind.what}",
                kind.location,
                "the kinds are " + " and ".join(f"`{known}`" for known in KINDS),
            )
        return [CoordinateEntry(declaration, _coordinate(draft, declaration))]
    if declaration.name in ("lambda", "Qc"):
        draft.report.add(
            "reserved-name",
            f"`{declaration.name}` cannot be the name of a {name}: names such as"
            f" `{declaration.name}.x` are those of multipliers and forces",
            declaration.key.location,
            "choose another name",
        )
    own = Coordinate(declaration.title, location=declaration.key.location)
    if isinstance(value, Mapping):
        own = _coordinate(draft, declaration)
    return [CoordinateEntry(d, own) for d in components(declaration, name)]


def _coordinate(draft: Draft, declaration: Declaration) -> Coordinate:
    name, key, value = declaration.title, declaration.key, declaration.node
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
    fields = draft.fields(value, what, keys_of(COORDINATE))
    texts = {f: draft.text(n, f"`{f}` of {what}") for f, n in fields.items()}
    unit = si_unit(draft, texts.get("unit"), fields["unit"]) if texts.get("unit") else None
    latex = fields["latex"].location if "latex" in fields else None
    return Coordinate(name, unit, texts.get("description"), texts.get("latex"), key.location, latex)


def si_unit(draft: Draft, unit: str | None, node: YamlNode) -> str | None:
    """Return a unit of results in the notation of SI; report one that is not coherent SI."""
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
            f"coordinates, outputs and vectors are in SI, but `{shorten(unit)}` is not",
            node.location,
            "write m, rad, N, …; parameters and initial values may have any unit",
        )
        return None
    return si_notation(unit)


def declare(
    draft: Draft,
    coordinates: list[CoordinateEntry],
    parameters: list[Declaration],
    definitions: list[Declaration],
    functions: list[Declaration],
    inputs: list[Declaration],
) -> None:
    """Declare the names, and report duplicates. Members of families are declared later."""
    names, report = draft.names, draft.report
    places: dict[str, tuple[str, SourceLocation]] = {}

    def enter(name: str, what: str, location: SourceLocation) -> None:
        other, place = places.setdefault(name, (what, location))
        if place is location or ("[" in name and " " not in what + other):
            return  # members may be declared in several places
        shown = name.partition("[")[0]
        report.add(
            "duplicate-name",
            f"`{shorten(shown)}` is declared twice: as {other} and as {what}",
            location,
            "rename one of the two",
            ((f"the {other.split()[0]} is declared here", place),),
        )
        names.broken.add(name)

    located = [(entry.declaration, "coordinate") for entry in coordinates]
    plain = {d.family for d, _ in located if not d.kind}
    for d, _ in sorted(located, key=lambda item: bool(item[0].kind)):
        enter(d.family, "coordinate", d.key.location)
        whole = d.family.rpartition(".")[0]
        if d.kind and whole not in places:
            enter(whole, "coordinate", d.key.location)
        elif d.kind and whole in plain:
            report.add(
                "duplicate-name",
                f"`{d.name}` is declared twice: as a {d.kind} and as a coordinate",
                d.key.location,
                "rename one of the two",
                (("the coordinate is declared here", places[whole][1]),),
                subject=whole,
            )
    for family in dict.fromkeys(d.family for d, _ in located):
        stem = family.partition("[")[0]
        for suffix, order in DOTS:
            primed = stem + "'" * order
            what = f"coordinate (`{stem}{suffix}` is `{primed}`)"
            enter(family.replace(stem, stem + suffix), what, places[family][1])
    located += [(d, "parameter") for d in parameters] + [(d, "definition") for d in definitions]
    located += [(d, "function") for d in functions]
    located += [(d, "input") for d in inputs]
    for d, what in located:
        if what != "coordinate" and not d.kind:
            enter(d.family, what, d.key.location)
        if d.spans:
            names.families.setdefault(d.family, set()).add(what)
    for family in names.families:
        base = family.partition("[")[0]
        if base in places:
            enter(base, "family", places[family][1])
            names.broken.add(family)
    single = [d.family for d, what in located if what == "coordinate" and not d.spans]
    names.coordinates = dict.fromkeys(single)
    names.lines = {
        name: (what, place.line) for name, (what, place) in places.items() if " " not in what
    }
    names.locations = {name: place for name, (_, place) in places.items()}


def expand_coordinates(
    draft: Draft, entries: list[CoordinateEntry], with_units: bool
) -> tuple[Coordinate, ...]:
    """Return the coordinates, and add them to the draft's names.

    Parameters
    ----------
    draft, entries : Draft, list of CoordinateEntry
    with_units : bool
        Whether the model has units; points are then in m.
    """
    given = {id(entry.declaration): entry.coordinate for entry in entries}
    members = expanded(draft, (entry.declaration for entry in entries))
    by_names = by_name(draft, members)
    draft.names.coordinates = dict.fromkeys(by_names)
    with_units = with_units or any(entry.coordinate.unit for entry in entries)
    return tuple(
        _named(given[id(member.declaration)], member, with_units) for member in by_names.values()
    )


def _named(coordinate: Coordinate, member: Member, with_units: bool) -> Coordinate:
    """Return a coordinate as the member of its family, or the component of a vector."""
    latex, kind, unit = coordinate.latex, member.declaration.kind, coordinate.unit
    own = member.declaration.part.rpartition(".")[2]
    below = [*map(str, indices_of(member.name)), *([own] if kind else [])]
    if below and latex:
        base = f"{{{latex}}}" if set("_^") & set(latex) else latex
        latex = f"{base}_{{{','.join(below)}}}"
    if kind and unit is None and with_units:
        unit = KINDS[kind].unit
    return coordinate._replace(name=member.name, latex=latex, unit=unit)


def report_overlaps(draft: Draft) -> None:
    """Report members that are declared in several blocks."""
    names = draft.names
    kinds = {
        "coordinate": names.coordinates,
        "definition": names.definitions,
        "parameter": names.constants,
    }
    for family, declared in names.families.items():
        if len(declared) < 2 or family in names.broken:
            continue
        seen: dict[str, str] = {}
        for kind, known in kinds.items():
            if kind not in declared:
                continue
            for name in (n for n in known if family_of(n) == family):
                other = seen.setdefault(name, kind)
                if other != kind:
                    draft.report.add(
                        "duplicate-name",
                        f"`{name}` is declared twice: as {other} and as {kind}",
                        names.locations[family],
                        "use ranges that do not overlap",
                    )
                    names.broken.add(family)
                    break


class VectorKind(NamedTuple):
    """A kind of coordinates.

    Parameters
    ----------
    parts : tuple of str
        The names of the components.
    unit : str
        Unit of each component, in a model with units.
    """

    parts: tuple[str, ...]
    unit: str


#: The kinds by their names in model files.
KINDS = {
    "point": VectorKind(("x", "y", "z"), "m"),
    "quaternion": VectorKind(("0", "1", "2", "3"), "1"),
}
_INDICES = ("#i", "#j")  # no name of the grammar begins with #


def components(declared: Declaration, kind: str) -> list[Declaration]:
    """Return the coordinates of a vector or rotation."""
    stem = declared.part
    return [declared._replace(part=f"{stem}.{part}", kind=kind) for part in KINDS[kind].parts]


def definitions_of(declared: Iterable[Declaration]) -> list[Declaration]:
    """Return the definitions of the vectors and rotations whose components are declared.

    A point denotes the vector of its components, a quaternion its rotation.
    """
    definitions: dict[int, Declaration] = {}
    for d in declared:
        if d.kind:
            spans = (span for _, span in d.spans)
            named = tuple(zip(_INDICES, spans, strict=False))
            stem = d.part.rpartition(".")[0]
            definitions.setdefault(id(d.key), d._replace(part=stem, node=d.key, spans=named))
    return list(definitions.values())


def constraints_of(definitions: Iterable[Declaration]) -> list[Declaration]:
    """Return the declarations of the constraints that normalize quaternions."""
    return [d._replace(part=f"{d.part}.unit") for d in definitions if d.kind == "quaternion"]


def value_of(definition: Declaration) -> Tree:
    """Return the vector or rotation that a name denotes, as an expression of its components."""
    parts = tuple(_components(definition))
    place = (0, len(definition.key.value))
    if definition.kind == "quaternion":
        return CallExpr(*place, "quat", parts)
    return VectorExpr(*place, parts)


def unit_length(constraint: Declaration) -> tuple[Tree, Tree]:
    """Return the sides of ``e.0^2 + e.1^2 + e.2^2 + e.3^2 = 1``."""
    place = (0, len(constraint.key.value))
    two = NumberExpr(*place, Fraction(2))
    own = constraint._replace(part=constraint.part.removesuffix(".unit"))
    squares = tuple((1, PowerExpr(*place, part, two)) for part in _components(own))
    return SumExpr(*place, squares), NumberExpr(*place, Fraction(1))


def _components(d: Declaration) -> Iterable[Tree]:
    place = (0, len(d.key.value))
    indices = tuple(Name(*place, index, 0) for index in d.indices)
    brackets = BRACKETS.get(len(d.spans), "")
    for part in KINDS[d.kind].parts:
        yield Name(*place, f"{d.name}{brackets}{d.part}.{part}", 0, indices)
