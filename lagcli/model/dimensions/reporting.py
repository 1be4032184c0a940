"""Messages on inconsistent units: both parts underlined, and a unit that would fit."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import NamedTuple

from lagcli.errors import Diagnostic, SourceLocation
from lagcli.model.dimensions.deriving import derive_units
from lagcli.model.dimensions.evaluation import Disagreement
from lagcli.model.dimensions.model_units import ModelUnits, UnitFinding
from lagcli.model.expression.dimension import (
    NUMBER,
    ONE,
    UNKNOWN,
    Dimension,
    Scalar,
    product,
    same,
    unit_of,
)
from lagcli.model.expression.trees import Name, NumberExpr, ProductExpr, Tree, walk
from lagcli.model.expression.units import read_unit, si_notation
from lagcli.model.locations import ExpressionLocations
from lagcli.model.model import Model
from lagcli.model.names.draft import unit_of as unit_of_node
from lagcli.model.names.members import family_of
from lagcli.model.yaml.source import Mapping, Sequence, YamlNode
from lagcli.model.yaml.source import Scalar as ScalarNode

KIND = "units"
_SHOWN = 6  # largest number of names whose units a message lists
_USUAL = (1, 2, 3, 4, 6)  # factors that are hardly quantities
_TRIED = 60  # largest number of names whose units are varied to find the error
_REASONS = {
    "sum": "cannot be added",
    "comparison": "cannot be compared",
    "arguments": "cannot be arguments of one function",
    "cases": "cannot be cases of one `if`",
    "sides": "cannot be equal",
}


class Suspect(NamedTuple):
    """A name for which another unit would remove all disagreements.

    Parameters
    ----------
    name : str
    stated, fitting : str
        Units that would fit.
    location : SourceLocation, optional
        Location of its declaration.
    """

    name: str
    stated: str
    fitting: str
    location: SourceLocation | None


#: What else may be the cause where a factor seems to be missing.
_OR_A_UNIT = "a unit under `parameters` is wrong"


def unit_diagnostics(model: Model, units: ModelUnits, severity: str = "error") -> list[Diagnostic]:
    """Return the disagreements in a model as diagnostics, in the order of the file.

    Where another unit of one name removes all of them, the first one stands for all: it has a note
    with the lines of the others.

    Parameters
    ----------
    model : Model
    units : ModelUnits
        Units from `derive_units`.
    severity : str
        ``error``, or ``warning``.
    """
    if not units.findings:
        return []
    places = ExpressionLocations(model)
    suspects = list(_suspects(model, units))
    diagnostics: dict[tuple[str, SourceLocation | None], Diagnostic] = {}
    for finding in units.findings:
        diagnostic = _Message(model, units, places, finding).diagnostic(suspects, severity)
        diagnostics.setdefault((diagnostic.message, diagnostic.location), diagnostic)
    first, *others = sorted(diagnostics.values(), key=_position)
    if not suspects or not others:
        return [first, *others]
    lines = dict.fromkeys(_position(x)[0] for x in others)
    where = f"line{'s' * (len(lines) > 1)} {', '.join(map(str, lines))}"
    note = f"{len(others)} more for the same reason in {where}"
    return [first._replace(notes=(*first.notes, (note, None)))]


class TakenUnit(NamedTuple):
    """A number without a unit, as written, the unit that it takes, and its location."""

    text: str
    unit: str
    location: SourceLocation | None


def taken_units(model: Model) -> list[TakenUnit]:
    """Return the numbers of a model that take a unit, in the order of the file."""
    if not model.units.numbers:
        return []
    places = ExpressionLocations(model)
    units: dict[tuple[str, str, SourceLocation | None], TakenUnit] = {}
    for number in model.units.numbers:
        node = _entry(places, *number.place)
        where = places.location(node, number.tree) or number.place.location
        unit = unit_of(number.dimension)
        taken = TakenUnit(places.text(node, number.tree) or "a number", unit, where)
        units.setdefault((taken.text, unit, where), taken)
    return sorted(
        units.values(), key=lambda x: (x.location.line, x.location.column) if x.location else (0, 0)
    )


def _position(diagnostic: Diagnostic) -> tuple[int, int]:
    where = diagnostic.location
    return (where.line, where.column) if where else (0, 0)


class _Message:
    """The message on one disagreement."""

    def __init__(
        self, model: Model, units: ModelUnits, places: ExpressionLocations, finding: UnitFinding
    ):
        self.model, self.units, self.places, self.finding = model, units, places, finding
        self.node = _node(places, finding)
        where = finding.location
        #: The text of an option that gives a parameter its value.
        self.option = where.text if where and not where.line and finding.name in model.set else ""

    def diagnostic(self, suspects: list[Suspect], severity: str) -> Diagnostic:
        d = self.finding.disagreement
        if d.reason in _REASONS and d.other is not None and d.other.start < d.part.start:
            d = d._replace(part=d.other, dimension=d.expected, expected=d.dimension, other=d.part)
        where = self.location(d.part)
        notes: list[tuple[str, SourceLocation | None]] = []
        if d.other is not None:
            rest = ", as it must be" if d.reason == "required" else ""
            said = f"{self.quoted(d.other)} is {_in(d.expected)}{rest}"
            notes.append((said, self.location(d.other)))
        if used := self.used(d):
            notes.append((used, None))
        help_ = self.help(d)
        if suspects:
            first = suspects[0]
            fitting = [f"`{s.name}` in {s.fitting}" for s in suspects]
            fit = "all units fit with " + ", or with ".join(fitting)
            # a unit that is wrong disagrees wherever it is used, a factor is missing in one place
            single = len(self.units.findings) == 1
            help_ = help_.replace(_OR_A_UNIT, fit) if single and _OR_A_UNIT in help_ else fit
            if first.location != where:
                notes.append((f"`{first.name}` is given in {first.stated}", first.location))
        return Diagnostic(KIND, self.text(d), where, help_, tuple(notes), severity)

    def text(self, d: Disagreement) -> str:
        part = self.quoted(d.part)
        if d.reason in _REASONS and d.other is not None:
            other = self.quoted(d.other)
            return (
                f"{part}, {_in(d.dimension)}, and {other}, {_in(d.expected)}, {_REASONS[d.reason]}"
            )
        if d.reason in _REASONS:
            both = f"some are {_in(d.expected)}, some {_in(d.dimension)}"
            return f"the terms of {part} cannot be added: {both}"
        if d.reason == "number":
            return f"{d.role} must be a number or an angle, but {part} is {_in(d.dimension)}"
        if d.reason == "exponent":
            return f"{part} is {_in(d.dimension)}, and its exponent must be a constant number"
        if d.reason == "entries":
            both = f"some are {_in(d.expected)}, some {_in(d.dimension)}"
            return f"the products that {part} adds differ: {both}"
        if d.reason == "scaled":
            return f"{part} is {_in(d.dimension)} already, and is given another unit"
        if self.whole(d):
            return f"{d.role} must be {self.required(d)}, not {_in(d.dimension)}"
        return f"{d.role} must be {self.required(d)}, but {part} is {_in(d.dimension)}"

    def required(self, d: Disagreement) -> str:
        block = self.finding.block
        what = {"T": "an energy, ", "V": "an energy, ", "L": "an energy, ", "D": "a power, "}
        return what.get(block, "") + _in(d.expected)

    def help(self, d: Disagreement) -> str:
        if NUMBER in (d.dimension, d.expected):
            number = d.part if d.dimension is NUMBER else d.other
            known = d.expected if d.dimension is NUMBER else d.dimension
            shown = self.places.text(self.node, number) if number is not None else None
            unit = unit_of(known) if isinstance(known, Dimension) else "m"
            return (
                "a number in an expression has no unit; give it a name and a unit under"
                f" `parameters`: `name: {shown or 1} {unit}`"
            )
        if d.reason == "number":
            return "divide it by a quantity with the same unit"
        if d.reason == "exponent":
            return "divide the base by a quantity with the same unit"
        if d.reason == "scaled":
            return "parameters in expressions are in SI: remove the unit, or write that of SI"
        if not (isinstance(d.dimension, Dimension) and isinstance(d.expected, Dimension)):
            return "check the units under `parameters` and `coordinates`"
        ratio = product(d.expected, d.dimension, -1)
        assert isinstance(ratio, Dimension)
        if d.reason in _REASONS:
            return f"they differ by a factor in {unit_of(ratio)}"
        if self.finding.block == "initial":
            return f"give it in {_unit(d.expected)}, or in another unit of that dimension"
        number = next((x for x in _factors(d.part) if x.value not in _USUAL), None)
        shown = self.places.text(self.node, number) if number is not None else None
        if shown:
            return (
                f"`{shown}` counts as a pure number; if it is a quantity, give it a name and a unit"
                f" under `parameters`: `name: {shown} {unit_of(ratio)}`"
            )
        missing = f"a factor in {unit_of(ratio)} is missing"
        moving = self.finding.block in ("T", "L", "D") and unit_of(ratio) in ("1/s", "1/s^2")
        if moving and (position := self.position(d)):
            missing += f", as where `{position}` is written for its velocity `{position}'`"
        return f"{missing}, or {_OR_A_UNIT}"

    def position(self, d: Disagreement) -> str | None:
        """Return the first coordinate in the part, if it contains no velocity."""
        found = [self.model.names.resolve(x) for x in walk(d.part) if isinstance(x, Name)]
        known = self.model.coordinate_names
        used = [(name, dots) for name, dots in found if name in known]
        return used[0][0] if used and not any(dots for _, dots in used) else None

    def used(self, d: Disagreement) -> str:
        """Return a sentence with the units of the names in the parts."""
        names: dict[str, str] = {}
        for tree in (d.part, d.other):
            if tree is None or (tree is d.other and d.reason == "required"):
                continue
            for part in walk(tree):
                if isinstance(part, Name) and part is not d.part and part is not d.other:
                    unit = self.units.of(self.model.names.resolve(part)[0])
                    if unit is not None:
                        names[part.text.removesuffix("[]")] = unit
        listed = list(names.items())[:_SHOWN]
        shown = [f"`{x}` is " + ("a number" if unit == "1" else f"in {unit}") for x, unit in listed]
        return ", ".join(shown)

    def quoted(self, tree: Tree) -> str:
        text = self.option[tree.start : tree.end] or self.places.text(self.node, tree)
        return f"`{text}`" if text else "it"

    def whole(self, d: Disagreement) -> bool:
        """Whether a disagreement concerns a value with its unit instead of an expression."""
        if self.node is None:
            return not self.option
        stated = self.finding.block in ("initial", "parameters") and d.reason == "required"
        return stated and unit_of_node(self.node) is not None

    def location(self, tree: Tree) -> SourceLocation | None:
        where = self.finding.location
        if self.option and where is not None and not self.whole(self.finding.disagreement):
            return where._replace(column=1 + tree.start, length=tree.end - tree.start)
        if self.node is None:
            return where
        if self.whole(self.finding.disagreement):
            return self.node.location
        return self.places.location(self.node, tree)


def _node(places: ExpressionLocations, finding: UnitFinding) -> YamlNode | None:
    """Return the node of the expression; None if it is not in the file."""
    return _entry(places, finding.block, finding.name, finding.location)


def _entry(
    places: ExpressionLocations, block: str, name: str | None, location: SourceLocation | None
) -> YamlNode | None:
    node = places.entry(block, name)
    if location is not None:
        node = places.at(block, location)
    if isinstance(node, Mapping) and "guess" in node.entries:
        node = node.entries["guess"][1]
    return node if isinstance(node, (ScalarNode, Sequence)) else None


def _factors(tree: Tree) -> Iterator[NumberExpr]:
    """Yield the numbers among the factors of a tree."""
    for part in tree.parts if isinstance(tree, ProductExpr) else (tree,):
        if isinstance(part, NumberExpr):
            yield part


def _suspects(model: Model, units: ModelUnits) -> Iterator[Suspect]:
    """Yield the names for which another unit would remove all disagreements."""
    first = units.findings[0].disagreement
    if not (isinstance(first.dimension, Dimension) and isinstance(first.expected, Dimension)):
        return
    ratio = product(first.expected, first.dimension, -1)
    stated: dict[str, tuple[str, SourceLocation | None]] = {}
    for p in model.parameters.values():
        if p.unit:
            stated.setdefault(family_of(p.name), (p.unit, p.location))
    for c in model.coordinates:
        if c.unit:
            stated.setdefault(family_of(c.name), (c.unit, c.location))
    for name, (unit, location) in list(stated.items())[:_TRIED]:
        if derive_units(model, {name: UNKNOWN}).findings:
            continue
        given = read_unit(unit).dimension
        for exponent in (1, -1, Fraction(1, 2), Fraction(-1, 2)):
            other = product(given, ratio, exponent)
            assert isinstance(other, Dimension)
            if not derive_units(model, {name: other}).findings:
                angle = given.rad == 1 or (first.reason == "number" and same(other, ONE))
                fitting = unit_of(other._replace(rad=1) if angle else other)
                yield Suspect(name.removesuffix("[]"), si_notation(unit), fitting, location)
                break


def _in(dimension: Scalar) -> str:
    """Return a phrase with the unit of a value."""
    if dimension is NUMBER or _unit(dimension) == "1":
        return "a number"
    return f"in {_unit(dimension)}"


def _unit(dimension: Scalar) -> str:
    return unit_of(dimension) if isinstance(dimension, Dimension) else "no unit"
