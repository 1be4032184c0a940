"""A trajectory as a dataset of xarray."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from lagcli.column_units import UNIT_DATASETS, units_along
from lagcli.columns import QUANTITIES
from lagcli.errors import UsageError

if TYPE_CHECKING:
    from lagcli.trajectory.trajectory import Trajectory


def to_dataset(trajectory: Trajectory) -> Any:
    """Return a trajectory as an `xarray.Dataset`; see `Trajectory.to_xarray`."""
    try:
        import xarray
    except ImportError:
        raise UsageError(
            "datasets need xarray, which is not installed: pip install xarray"
        ) from None
    terms = trajectory.terms
    names = [
        f"{trajectory.constraints[c]}.{trajectory.coordinates[q]}"
        for c, q in zip(terms.constraint, terms.coordinate, strict=True)
    ]
    units = trajectory.units
    axes: dict[str, Any] = {
        "time": ("time", trajectory.time, {"units": "s"}),
        "coordinate": list(trajectory.coordinates),
        "constraint": list(trajectory.constraints),
        "term": names,
        "conserved_quantity": list(trajectory.conserved_names),
    }
    along = {
        q.name: units_along(
            *(q, trajectory.coordinates, trajectory.constraints, units),
            trajectory.conserved_names,
        )
        for q in QUANTITIES
    }
    for name, axis, quantity in UNIT_DATASETS:
        axes[name] = (axis, [unit or "" for unit in along[quantity]])
    variables = {
        quantity.name: (
            quantity.axes,
            getattr(trajectory, quantity.name),
            {"long_name": quantity.description} | _units(along[quantity.name]),
        )
        for quantity in QUANTITIES
        if quantity.name != "time"
    }
    for name, values in trajectory.outputs.items():
        unit = {"units": units[name]} if name in units else {}
        variables[name] = (("time",), values, unit)
    described = ("status", "message", "model", "model_sha256", "lagcli_version")
    attributes = {name: getattr(trajectory, name) for name in described}
    return xarray.Dataset(variables, axes, attributes)


def _units(along: Sequence[str | None]) -> dict[str, str]:
    """Return the attribute of an array whose columns have one unit; nothing of any other."""
    (unit,) = set(along) if len(set(along)) == 1 else (None,)
    return {"units": unit} if unit else {}
