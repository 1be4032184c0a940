"""Units of a model: given, derived, missing and inconsistent ones."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from lagcli.errors import Diagnostic, SourceLocation
from lagcli.model.dimensions.reporting import TakenUnit, taken_units, unit_diagnostics
from lagcli.model.expression.units import si_notation
from lagcli.model.model import Model
from lagcli.model.names.members import families, family_of
from lagcli.model.result_units import given_units

_LISTED = 12  # names per line


class Conversion(NamedTuple):
    """A value in the unit in which it is given, and in SI."""

    value: float
    unit: str
    si_value: float
    si_unit: str

    def __str__(self) -> str:
        return f"{self.value:.6g} {self.unit} = {self.si_value:.6g} {self.si_unit}"


@dataclass(frozen=True)
class UnitReport:
    """Units of a model's quantities.

    Parameters
    ----------
    stated : bool
        Whether the model states any unit.
    checked : bool
        Whether it states all, so that units are checked whenever it is loaded.
    missing : tuple of str
        Coordinates and parameters without a unit.
    coordinates, parameters, definitions, multipliers, constraints, forces, outputs : mappings
        Units by name, None where they are not known. ``constraints`` are those of φ, and of ψ for
        nonholonomic constraints; ``forces`` are generalized forces by coordinate.
    converted : mapping of str to Conversion
        Parameters and initial values that are given in a unit other than SI: both values.
    numbers : tuple of TakenUnit
        Numbers in expressions that have taken a unit.
    findings : tuple of Diagnostic
        What disagrees as far as units are known; warnings, because a model with all units and a
        mistake cannot be loaded.
    """

    stated: bool
    checked: bool
    missing: tuple[str, ...]
    coordinates: Mapping[str, str | None]
    parameters: Mapping[str, str | None]
    definitions: Mapping[str, str | None]
    multipliers: Mapping[str, str | None]
    constraints: Mapping[str, str | None]
    forces: Mapping[str, str | None]
    outputs: Mapping[str, str | None]
    converted: Mapping[str, Conversion]
    numbers: tuple[TakenUnit, ...]
    findings: tuple[Diagnostic, ...]

    @property
    def summary(self) -> str:
        """One sentence: whether units are checked, and which are missing."""
        if not self.stated:
            return "none given"
        if self.checked:
            return "given throughout and consistent"
        if not self.missing:
            return "given for coordinates only; not checked"
        missing = list(dict.fromkeys(map(family_of, self.missing)))
        shown = ", ".join(f"`{name.removesuffix('[]')}`" for name in missing[:_LISTED])
        return f"not checked: no unit for {shown}" + (", …" if len(missing) > _LISTED else "")

    def to_mapping(self) -> dict[str, Any]:
        """Return the report as JSON values."""
        groups = ("coordinates", "parameters", "definitions", "multipliers", "constraints")
        return {
            "stated": self.stated,
            "checked": self.checked,
            "missing": list(self.missing),
            **{group: dict(getattr(self, group)) for group in (*groups, "forces", "outputs")},
            "converted": {name: str(x) for name, x in self.converted.items()},
            "numbers": [
                {"text": x.text, "unit": x.unit, "place": place_of(x.location)}
                for x in self.numbers
            ],
            "findings": [_json(d) for d in self.findings],
        }

    def sentences(self) -> Iterator[str]:
        """Yield the report as text: the summary, and the derived units by group."""
        yield f"{self.summary[0].upper()}{self.summary[1:]}."
        for title, units in (
            ("Multipliers", self.multipliers),
            ("Generalized forces", self.forces),
            ("Outputs", self.outputs),
            ("Definitions", self.definitions),
        ):
            by_unit: dict[str, list[str]] = {}
            for name, unit in units.items():
                if unit is not None:
                    by_unit.setdefault(unit, []).append(name)
            if by_unit:
                listed = (f"{_names(names)} in {unit}" for unit, names in by_unit.items())
                yield f"{title}: {'; '.join(listed)}."
        if self.numbers:
            shown = [f"`{x.text}` in {x.unit} ({where(x.location)})" for x in self.numbers]
            yield f"Numbers that took a unit: {'; '.join(shown)}."
        if self.converted:
            shown = list(_conversions(self.converted))
            yield f"Converted to SI: {'; '.join(shown[:_LISTED])}{'; …' * (len(shown) > _LISTED)}."


def report_units(model: Model) -> UnitReport:
    """Derive the units of all quantities of a model.

    Parameters
    ----------
    model : Model

    Returns
    -------
    UnitReport
    """
    units = model.units
    return UnitReport(
        stated=units.stated,
        checked=units.throughout,
        missing=units.missing,
        coordinates={name: units.of(name) for name in model.coordinate_names},
        parameters={name: units.of(name) for name in model.parameters},
        definitions={name: units.of(name) for name in model.definitions},
        multipliers={name: units.of_multiplier(name) for name in model.constraint_names},
        constraints={
            c.name: units.of_residual(c.name, c.kind == "holonomic", False)
            for c in model.constraints
        },
        forces={name: units.of_force(name) for name in model.coordinate_names},
        outputs={name: units.of_output(name) for name in model.outputs},
        converted=dict(_converted(model)),
        numbers=tuple(taken_units(model)),
        findings=tuple(unit_diagnostics(model, units, "warning")),
    )


def _converted(model: Model) -> Iterator[tuple[str, Conversion]]:
    """Yield the quantities in units other than SI: name, and value in both units."""
    for name, (unit, factor) in given_units(model).items():
        value = (model.parameters.get(name) or model.initial[name]).value
        yield name, Conversion(value / factor, unit, value, si_notation(unit))


def _names(names: Iterable[str]) -> str:
    shown = families(names)
    return ", ".join(shown[:_LISTED]) + (", …" if len(shown) > _LISTED else "")


def _conversions(converted: Mapping[str, Conversion]) -> Iterator[str]:
    """Yield values in both units; members of a family together, those that differ as a range."""
    groups: dict[tuple[str, str], list[str]] = {}
    for name, x in converted.items():
        groups.setdefault((family_of(name), x.unit), []).append(name)
    for names in groups.values():
        low = min((converted[name] for name in names), key=lambda x: x.value)
        high = max((converted[name] for name in names), key=lambda x: x.value)
        label = ", ".join(families(names))
        if low == high:
            yield f"{label} = {low}"
            continue
        yield (
            f"{label} from {low.value:.6g} to {high.value:.6g} {low.unit}"
            f" = {low.si_value:.6g} to {high.si_value:.6g} {low.si_unit}"
        )


def _json(d: Diagnostic) -> dict[str, Any]:
    places = [d.location, *(place for _, place in d.notes)]
    return {
        "message": d.message,
        "help": d.help,
        "places": [place_of(x) for x in places if x is not None],
    }


def place_of(x: SourceLocation | None) -> dict[str, Any] | None:
    """Return a location as JSON values."""
    if x is None:
        return None
    return {"file": x.path, "line": x.line, "column": x.column, "length": x.length}


def where(x: SourceLocation | None) -> str:
    """Return a location in words."""
    if x is None:
        return "not in the file"
    return f"line {x.line}, column {x.column}" if x.line else x.path
