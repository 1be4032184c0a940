"""Conversion of a trajectory to a dataset of xarray."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from lagcli.arrays import Array
from lagcli.column_units import UNIT_DATASETS, units_along
from lagcli.columns import QUANTITIES
from lagcli.errors import UsageError
from lagcli.trajectory.event_log import MODES, EventLog

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
    names = list(map(".".join, terms.names(trajectory.coordinates, trajectory.constraints)))
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
    if trajectory.events is not None:
        variables |= _events(trajectory.events, trajectory.time)
        axes["row"] = list(trajectory.events.rows)
        if trajectory.events.records.columns:
            axes["column"] = list(trajectory.events.records.columns)
    described = ("status", "message", "model", "model_sha256", "lagcli_version")
    attributes = {name: getattr(trajectory, name) for name in described}
    return xarray.Dataset(variables, axes, attributes)


def _events(log: EventLog, time: Array) -> dict[str, Any]:
    """Return the variables of the event log, and the modes of the switched rows at each sample."""
    records = log.records
    recorded = {
        "recorded_entry": (("recorded",), records.entry),
        "recorded_time": (("recorded",), log.time[records.entry], {"units": "s"}),
        "recorded_name": (("recorded",), [log.names[i] for i in records.entry]),
        "recorded_before": (("recorded", "column"), records.before),
        "recorded_after": (("recorded", "column"), records.after),
    }
    slopes = {"event_dtime": (("event", "parameter"), log.dtime)}
    return (
        (recorded if records.columns else {})
        | (slopes if log.parameters else {})
        | {
            "mode": (("time", "row"), log.modes_at(time), {"flag_meanings": " ".join(MODES)}),
            "event_time": (("event",), log.time, {"units": "s"}),
            "event_name": (("event",), list(log.names)),
            "event_kind": (("event",), list(log.kinds)),
            "event_q": (("event", "coordinate"), log.q),
            "event_velocity_before": (("event", "coordinate"), log.before),
            "event_velocity_after": (("event", "coordinate"), log.after),
            "event_impulse": (("event", "constraint"), log.impulse),
            "event_loss": (("event",), log.loss, {"units": "J"}),
            "event_supplied": (("event",), log.supplied, {"units": "J"}),
            "event_work": (("event",), log.work, {"units": "J"}),
            "event_mode": (("event", "row"), log.modes, {"flag_meanings": " ".join(MODES)}),
        }
    )


def _units(along: Sequence[str | None]) -> dict[str, str]:
    """Return the unit attribute of an array if all columns have the same unit; otherwise none."""
    (unit,) = set(along) if len(set(along)) == 1 else (None,)
    return {"units": unit} if unit else {}
