"""Units and names of terms in result files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from lagcli.column_units import UNIT_DATASETS, units_along
from lagcli.columns import BY_NAME, ResultQuantity
from lagcli.trajectory.samples import Terms

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
    found = [units.get(name, NOT_STATED) for name in names]
    return found[0] if len(set(found)) == 1 else ", ".join(found)


def term_names(
    terms: Terms, coordinates: Sequence[str], constraints: Sequence[str]
) -> list[tuple[str, str]]:
    """Return the names of the constraint and of the coordinate of each term."""
    pairs = zip(terms.constraint.tolist(), terms.coordinate.tolist(), strict=True)
    return [(constraints[i], coordinates[j]) for i, j in pairs]


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
        found = set(units_along(among, coordinates, constraints, units))
        return (found.pop() or NOT_STATED) if len(found) == 1 else NOT_STATED
    found = set(units_along(quantity, coordinates, constraints, units, conserved))
    if found <= {None}:
        return NOT_STATED
    return found.pop() or "" if len(found) == 1 else f"see {_SEE[quantity.name]}"
