"""Units of result quantities, and of the entries along their axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from lagcli.columns import BY_NAME, ResultQuantity, column_names, unit_of_column


class UnitDataset(NamedTuple):
    """A dataset with the unit of each entry along an axis.

    Parameters
    ----------
    name, axis : str
    quantity : str
        Name of the array whose units these are.
    """

    name: str
    axis: str
    quantity: str


#: Units of entries along axes, if results contain them.
UNIT_DATASETS = (
    UnitDataset("coordinate_unit", "coordinate", "q"),
    UnitDataset("force_unit", "coordinate", "constraint_force"),
    UnitDataset("multiplier_unit", "constraint", "multipliers"),
    UnitDataset("position_unit", "constraint", "residual_position"),
    UnitDataset("velocity_unit", "constraint", "residual_velocity"),
    UnitDataset("conserved_unit", "conserved_quantity", "conserved"),
)


def units_along(
    quantity: ResultQuantity,
    coordinates: Sequence[str],
    constraints: Sequence[str],
    units: Mapping[str, str],
    conserved: Sequence[str] = (),
) -> list[str | None]:
    """Return the unit of each column of a quantity, None if unknown.

    Terms of constraint forces have the units of forces on the coordinates.
    """
    if quantity.along == "term":
        quantity = BY_NAME["constraint_force"]
    names = column_names(quantity, coordinates, constraints, (), conserved)
    column_units = [unit_of_column(name, units) for name in names]
    return [unit if unit is None else unit or "1" for unit in column_units]


#: Text of `units` if the model has none.
NOT_STATED = "not stated"


#: Dataset with the units of the entries of an array.
_SEE = {
    **{x.quantity: x.name for x in UNIT_DATASETS},
    **{"v": "coordinate_unit", "a": "coordinate_unit", "constraint_force_by": "force_unit"},
    **{"scale_position": "position_unit", "scale_velocity": "velocity_unit"},
}


def shared_unit(names: Sequence[str], units: Mapping[str, str]) -> str:
    """Return the unit of some outputs; all units if they differ."""
    output_units = [units.get(name, NOT_STATED) for name in names]
    return output_units[0] if len(set(output_units)) == 1 else ", ".join(output_units)


def unit(
    quantity: ResultQuantity,
    coordinates: Sequence[str],
    constraints: Sequence[str],
    units: Mapping[str, str],
    conserved: Sequence[str] = (),
) -> str:
    """Return the unit of a quantity.

    Parameters
    ----------
    quantity : ResultQuantity
        Quantity of `lagcli.columns.QUANTITIES`.
    coordinates, constraints, conserved : sequence of str
        Names.
    units : mapping of str to str
        Units, as in ``Record.units``.

    Returns
    -------
    str
        The unit; if it differs between columns, the name in `UNIT_DATASETS`; `NOT_STATED` if it is
        unknown.
    """
    if "{" not in quantity.unit:
        return quantity.unit
    if not quantity.along:  # the largest of residuals in different units
        among = BY_NAME["constraint_force"]
        distinct = set(units_along(among, coordinates, constraints, units))
        return (distinct.pop() or NOT_STATED) if len(distinct) == 1 else NOT_STATED
    distinct = set(units_along(quantity, coordinates, constraints, units, conserved))
    if distinct <= {None}:
        return NOT_STATED
    return distinct.pop() or "" if len(distinct) == 1 else f"see {_SEE[quantity.name]}"
