"""The layout of result files: which quantity has which axes, unit and description."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from lagcli.trajectory.samples import Terms

#: What `units` says where the model states none.
NOT_STATED = "not stated"

#: What `units` says where the coordinates differ.
MIXED = "mixed: see coordinate_unit"


#: What `units` says of a family of outputs whose members differ.
MIXED_OUTPUTS = "mixed"


class DatasetSpec(NamedTuple):
    """One array of a result file.

    Parameters
    ----------
    name : str
        Its name in the file and in `Trajectory`.
    axes : tuple of str
        Among ``time``, ``coordinate``, ``constraint``, ``term``.
    long_name : str
        What it is, for the reader of a file or a plot.
    unit : str
        ``{u}`` stands for the unit of the coordinate.
    """

    name: str
    axes: tuple[str, ...]
    long_name: str
    unit: str


_CONSTRAINT_UNIT = "mixed: as each constraint"

#: Every array but the model's own outputs, in the order of the file.
QUANTITIES = (
    DatasetSpec("time", ("time",), "time", "s"),
    DatasetSpec("q", ("time", "coordinate"), "generalized coordinates", "{u}"),
    DatasetSpec("v", ("time", "coordinate"), "generalized velocities", "{u}/s"),
    DatasetSpec("a", ("time", "coordinate"), "generalized accelerations", "{u}/s^2"),
    DatasetSpec(
        "multipliers",
        ("time", "constraint"),
        "Lagrange multipliers",
        "mixed: J or W per unit of each position or velocity constraint",
    ),
    DatasetSpec(
        "constraint_force",
        ("time", "coordinate"),
        "generalized constraint force, the sum of lambda_beta b_beta over beta",
        "J/{u}",
    ),
    DatasetSpec(
        "constraint_force_by",
        ("time", "term"),
        "generalized constraint force lambda_beta b_beta of each constraint",
        "J/{u}",
    ),
    DatasetSpec("energy_kinetic", ("time",), "kinetic energy", "J"),
    DatasetSpec("energy_potential", ("time",), "potential energy", "J"),
    DatasetSpec("energy_total", ("time",), "total energy", "J"),
    DatasetSpec("power_applied", ("time",), "power of the applied forces", "W"),
    DatasetSpec("power_constraint", ("time",), "power of the constraint forces", "W"),
    DatasetSpec("power_time", ("time",), "power by the explicit time in T or V", "W"),
    DatasetSpec(
        "energy_balance",
        ("time",),
        "total energy minus its first value minus the integral of the powers",
        "J",
    ),
    DatasetSpec(
        "residual_position",
        ("time", "constraint"),
        "residual of each position constraint",
        _CONSTRAINT_UNIT,
    ),
    DatasetSpec(
        "residual_velocity",
        ("time", "constraint"),
        "residual of each velocity constraint",
        _CONSTRAINT_UNIT,
    ),
    DatasetSpec(
        "residual_equation", ("time",), "max norm of the residual of the equations", "J/{u}"
    ),
    DatasetSpec(
        "scale_position",
        ("constraint",),
        "scale by which the position residual is judged",
        _CONSTRAINT_UNIT,
    ),
    DatasetSpec(
        "scale_velocity",
        ("constraint",),
        "scale by which the velocity residual is judged",
        _CONSTRAINT_UNIT,
    ),
)


def shared_unit(names: Sequence[str], units: Mapping[str, str]) -> str:
    """Return the unit of some outputs; where it differs between them, `MIXED_OUTPUTS`."""
    found = {units.get(name, NOT_STATED) for name in names}
    return found.pop() if len(found) == 1 else MIXED_OUTPUTS


def term_names(terms: Terms, coordinates: Sequence[str], constraints: Sequence[str]) -> list[str]:
    """Return ``CONSTRAINT.COORDINATE`` for each term."""
    pairs = zip(terms.constraint.tolist(), terms.coordinate.tolist(), strict=True)
    return [f"{constraints[i]}.{coordinates[j]}" for i, j in pairs]


def unit(quantity: DatasetSpec, coordinates: Sequence[str], units: Mapping[str, str]) -> str:
    """Return what a quantity is measured in.

    Parameters
    ----------
    quantity : Quantity
        One of `QUANTITIES`.
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
