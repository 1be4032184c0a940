"""A trajectory as a dataset of xarray."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

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
    axes = {
        "time": ("time", trajectory.time, {"units": "s"}),
        "coordinate": list(trajectory.coordinates),
        "constraint": list(trajectory.constraints),
        "term": names,
        "coordinate_unit": ("coordinate", [units.get(q, "") for q in trajectory.coordinates]),
    }
    variables = {
        quantity.name: (
            quantity.axes,
            getattr(trajectory, quantity.name),
            {"long_name": quantity.description}
            | ({} if quantity.along else {"units": quantity.unit}),
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
