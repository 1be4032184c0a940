"""The units of a model's quantities."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from lagcli.errors import SourceLocation
from lagcli.model.dimensions.evaluation import Disagreement, FreeNumber
from lagcli.model.expression.dimension import (
    ENERGY,
    NUMBER,
    ONE,
    POWER,
    SECOND,
    UNKNOWN,
    Dimension,
    Scalar,
    TensorDimension,
    Value,
    product,
    unit_of,
)
from lagcli.model.names.members import family_of


class UnitFinding(NamedTuple):
    """A disagreement of dimensions, and its entry in the model file.

    Parameters
    ----------
    disagreement : Disagreement
    block : str
        Key of the model file: ``T``, ``definitions``, ….
    name : str or None
        Name of the entry.
    location : SourceLocation, optional
        Location of the value, if only this can be underlined: a number with a unit, or the value of
        an option.
    certain : bool
        Whether it is between two stated units, so that it remains whatever other units are missing.
    """

    disagreement: Disagreement
    block: str
    name: str | None = None
    location: SourceLocation | None = None
    certain: bool = False


class ModelUnits(NamedTuple):
    """Dimensions of a model's quantities, derived units, and disagreements.

    A family whose members have one dimension has one entry, ``x[]``.

    Parameters
    ----------
    stated : bool
        Whether the model gives any unit; if not, nothing is derived.
    throughout : bool
        Whether all coordinates and parameters have a unit, at least one of them. Then a number in
        an expression is pure or takes the unit that its place needs, and disagreements are errors.
    missing : tuple of str
        Coordinates and parameters without a unit.
    names : mapping of str to dimension
        Dimensions of coordinates, parameters and definitions, by name.
    constraints : mapping of str to dimension
        Dimensions of φ, or of ψ for nonholonomic constraints, by name.
    multipliers : mapping of str to dimension
        Dimensions of λ, by constraint.
    outputs : mapping of str to dimension
    written : mapping of str to str
        Units given by the model for coordinates, parameters and outputs, in SI.
    findings : tuple of UnitFinding
        Disagreements, in the order of the blocks.
    numbers : tuple of FreeNumber
        Numbers in expressions that have taken a unit.
    """

    stated: bool = False
    throughout: bool = False
    missing: tuple[str, ...] = ()
    names: Mapping[str, Value] = MappingProxyType({})
    constraints: Mapping[str, Value] = MappingProxyType({})
    multipliers: Mapping[str, Value] = MappingProxyType({})
    outputs: Mapping[str, Value] = MappingProxyType({})
    written: Mapping[str, str] = MappingProxyType({})
    findings: tuple[UnitFinding, ...] = ()
    numbers: tuple[FreeNumber, ...] = ()

    @property
    def errors(self) -> tuple[UnitFinding, ...]:
        """The disagreements that are errors: without all units, those that no unit could remove."""
        return self.findings if self.throughout else tuple(x for x in self.findings if x.certain)

    @property
    def warnings(self) -> tuple[str, ...]:
        """The warning of runs if numbers have taken a unit."""
        count = len(self.numbers)
        if not count:
            return ()
        taken = f"{count} numbers took a unit" if count > 1 else "a number took a unit"
        return (f"{taken} (lagcli check)",)

    def of(self, name: str) -> str | None:
        """Return the SI unit of a coordinate, parameter or definition; None if it is unknown.

        The entries of a vector have one unit, or None.
        """
        return self.written.get(name) or text_of(find(self.names, name))

    def of_output(self, name: str) -> str | None:
        """Return the SI unit of an output."""
        return self.written.get(f"outputs.{name}") or text_of(find(self.outputs, name))

    def of_multiplier(self, constraint: str) -> str | None:
        """Return the SI unit of λ."""
        return text_of(find(self.multipliers, constraint))

    def of_residual(self, constraint: str, holonomic: bool, rate: bool) -> str | None:
        """Return the SI unit of φ, or of ψ = φ' (``rate``)."""
        value = find(self.constraints, constraint)
        if isinstance(value, Dimension) and holonomic and rate:
            return text_of(product(value, SECOND, -1))
        return text_of(value)

    def of_force(self, coordinate: str) -> str | None:
        """Return the SI unit of the generalized force on a coordinate."""
        value = find(self.names, coordinate)
        return text_of(conjugate(value)) if isinstance(value, Dimension) else None


#: Units of a model without units.
NO_UNITS = ModelUnits()


def find(table: Mapping[str, Value], name: str) -> Value:
    """Return the dimension of a name, or of its family."""
    value = table.get(name)
    return table.get(family_of(name), UNKNOWN) if value is None else value


def text_of(value: Value) -> str | None:
    """Return the unit of a dimension; None if there is none, or several."""
    if isinstance(value, TensorDimension):
        units = {text_of(x) for x in value.flat if x is UNKNOWN or isinstance(x, Dimension)}
        return units.pop() if len(units) == 1 else None
    return unit_of(value) if isinstance(value, Dimension) else None


def conjugate(coordinate: Scalar) -> Scalar:
    """Return the dimension of the generalized force on a coordinate: energy over coordinate."""
    return product(ENERGY, _plain(coordinate), -1)


def multiplier_dimension(residual: Scalar, holonomic: bool) -> Scalar:
    """Return the dimension of λ: energy over φ, or power over ψ."""
    return product(ENERGY if holonomic else POWER, _plain(residual), -1)


def _plain(value: Scalar) -> Scalar:
    return ONE if value is NUMBER else value
