"""Contacts and events in plots: marks at their instants, and curves that jump there."""

from __future__ import annotations

from typing import Any

import numpy as np

from lagcli.arrays import Array
from lagcli.columns import read_column_name
from lagcli.pictures.run_file import RunFile
from lagcli.trajectory.event_log import EventLog

_LOOK = {"color": "#808080", "linewidth": 0.6, "zorder": 0.5}
#: Columns of pixels of which one has a mark at most, so that the curves remain visible.
_APART = 3
#: Quantities that jump with the modes, and hold their value between samples and the instant.
_HELD = ("a", "multipliers", "constraint_force", "constraint_force_by")


def draw_marks(ax: Any, run: RunFile, span: tuple[float, float], columns: int) -> None:
    """Draw a thin line at each instant of a run at which something happened.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Over the time.
    run : RunFile
    span : (float, float)
        The first and the last time that are drawn, s.
    columns : int
        Pixels along the axis.
    """
    log = run.record.events
    if log is None:
        return
    first, last = span
    times = log.time[(log.time >= first) & (log.time <= last)]
    if not len(times):
        return
    column = np.floor((times - first) / ((last - first) or 1.0) * columns / _APART)
    times = times[np.unique(column, return_index=True)[1]]
    ax.vlines(times, 0.0, 1.0, transform=ax.get_xaxis_transform(), **_LOOK)


def with_jumps(run: RunFile, name: str, time: Array, values: Array) -> tuple[Array, Array]:
    """Return a curve with its values right before and after each instant of the log.

    Coordinates and velocities are those of the log. Accelerations and forces hold the values of
    the samples beside the last instant between them, lest they be drawn as a slope. Any other
    curve is as it was.

    Parameters
    ----------
    run : RunFile
    name : str
        Of the column.
    time, values : (nt,) arrays
    """
    log = run.record.events
    column = read_column_name(name, run.coordinates, run.constraints)
    if log is None or column is None or not len(time):
        return time, values
    inside = np.flatnonzero((log.time >= time[0]) & (log.time <= time[-1]))
    at = log.time[inside]
    if column.quantity in ("q", "v"):
        before, after = _logged(log, column.quantity, run.coordinates.index(column.coordinate))
        before, after = before[inside], after[inside]
    elif column.quantity in _HELD:
        place = np.searchsorted(time, at, side="left")
        last = np.append(place[1:] != place[:-1], True)[: len(at)]  # between two samples
        at, place = at[last], place[last]
        before = values[np.maximum(place - 1, 0)]
        after = values[np.minimum(np.searchsorted(time, at, side="right"), len(time) - 1)]
    else:
        return time, values
    # a sample at an instant has the value after it
    places = np.repeat(np.searchsorted(time, at, side="left"), 2)
    both = np.column_stack([before, after]).ravel()
    return np.insert(time, places, np.repeat(at, 2)), np.insert(values, places, both)


def _logged(log: EventLog, quantity: str, coordinate: int) -> tuple[Array, Array]:
    if quantity == "q":
        return log.q[:, coordinate], log.q[:, coordinate]
    return log.before[:, coordinate], log.after[:, coordinate]
