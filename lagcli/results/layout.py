"""The units and the names of terms that result files state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from lagcli.columns import ResultQuantity
from lagcli.trajectory.samples import Terms

#: What `units` says where the model states none.
NOT_STATED = "not stated"

#: What `units` says where the coordinates differ.
MIXED = "mixed: see coordinate_unit"

#: What `units` says of a family of outputs whose members differ.
MIXED_OUTPUTS = "mixed"


def shared_unit(names: Sequence[str], units: Mapping[str, str]) -> str:
    """Return the unit of some outputs; where it differs between them, `MIXED_OUTPUTS`."""
    found = {units.get(name, NOT_STATED) for name in names}
    return found.pop() if len(found) == 1 else MIXED_OUTPUTS


def term_names(
    terms: Terms, coordinates: Sequence[str], constraints: Sequence[str]
) -> list[tuple[str, str]]:
    """Return the names of the constraint and of the coordinate of each term."""
    pairs = zip(terms.constraint.tolist(), terms.coordinate.tolist(), strict=True)
    return [(constraints[i], coordinates[j]) for i, j in pairs]


def unit(quantity: ResultQuantity, coordinates: Sequence[str], units: Mapping[str, str]) -> str:
    """Return what a quantity is measured in.

    Parameters
    ----------
    quantity : ResultQuantity
        Of `lagcli.columns.QUANTITIES`.
    coordinates : sequence of str
        Names.
    units : mapping of str to str
        Their units, by name, where the model states them.

    Returns
    -------
    str
        The unit; `MIXED` where it differs between coordinates; `NOT_STATED` where the model
        states none for them.
    """
    if "{u}" not in quantity.unit:
        return quantity.unit
    found = {units.get(name) for name in coordinates}
    if found <= {None}:
        return NOT_STATED
    if len(found) > 1:
        return MIXED
    symbol = found.pop() or "1"
    if quantity.unit.startswith("J/") and any(sign in symbol for sign in "*/ "):
        symbol = f"({symbol})"
    return quantity.unit.format(u=symbol)
