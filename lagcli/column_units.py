"""Units along the axes of results: one for each coordinate or constraint."""

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
    found = [unit_of_column(name, units) for name in names]
    return [unit if unit is None else unit or "1" for unit in found]
