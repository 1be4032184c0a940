"""Contacts and events in plots: marks at their instants, and curves that jump there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from lagcli.arrays import Array, Indices
from lagcli.columns import read_column_name
from lagcli.pictures.plots.thinning import evenly
from lagcli.pictures.run_file import RunFile
from lagcli.trajectory.event_log import EventLog

_LOOK = {"color": "#808080", "linewidth": 0.6, "zorder": 0.5}
#: Columns of pixels of which one has a mark at most, so that the curves remain visible.
_APART = 3
#: Quantities that jump with the modes, and hold their value between samples and the instant.
_HELD = ("a", "multipliers", "constraint_force", "constraint_force_by")
#: Energies, which jump by what impacts and events change them by.
_ENERGIES = ("energy_total", "energy_kinetic", "energy_potential")
_SIDES: tuple[Literal["left", "right"], ...] = ("left", "right")
#: Marks on the plots of a page.
_MARKS = 400


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


def marks(log: EventLog | None) -> Array:
    """Return the distinct times of a log that a page marks, s; of many, evenly chosen ones."""
    if log is None or not len(log):
        return np.empty(0)
    times = np.unique(log.time)
    return times[evenly(len(times), _MARKS)]


def with_jumps(run: RunFile, name: str, time: Array, values: Array) -> tuple[Array, Array]:
    """Return a curve with its values right before and after each instant of the log.

    Coordinates and velocities are those of the log, energies jump by its losses. Accelerations and
    forces hold the values of the samples beside the last instant between them, so that no slope is
    drawn there. Any other curve is unchanged.

    Parameters
    ----------
    run : RunFile
    name : str
        Name of the column.
    time, values : (nt,) arrays
    """
    jumps = Jumps(run.record.events, run.coordinates, run.constraints)
    if not jumps.of(name):
        return time, values
    found = jumps.inserted(time, [name], values[:, None])
    return found[0], found[1][:, 0]


class Jumps:
    """Draws the instants of a log into curves, which are straight between samples.

    Parameters
    ----------
    log : EventLog or None
    coordinates, constraints : sequence of str
        Names, in the model's order.
    """

    def __init__(
        self, log: EventLog | None, coordinates: Sequence[str], constraints: Sequence[str]
    ):
        self.log, self.coordinates, self.constraints = log, tuple(coordinates), tuple(constraints)

    def of(self, name: str) -> bool:
        """Return whether a column may jump."""
        column = read_column_name(name, self.coordinates, self.constraints)
        jumping = ("q", "v", *_HELD, *_ENERGIES)
        return self.log is not None and column is not None and column.quantity in jumping

    def inserted(
        self, time: Array, names: Sequence[str], values: Array, carried: bool = False
    ) -> tuple[Array, Array]:
        """Return curves with their values right before and after each instant between samples.

        Parameters
        ----------
        time : (nt,) array
            s, in order.
        names : sequence of n str
            Names of the columns.
        values : (nt, n) array
        carried : bool
            Whether the first sample is the last one of a block before, with what happened there.

        Returns
        -------
        time : (nt + 2 ni,) array
            Each instant stands there twice; a sample at an instant has the value after it.
        values : (nt + 2 ni, n) array
        """
        log = self.log
        if log is None or not len(time):
            return time, values
        begun = log.time > time[0] if carried else log.time >= time[0]
        inside = np.flatnonzero(begun & (log.time <= time[-1]))
        at, first = np.unique(log.time[inside], return_index=True)
        if not len(at):
            return time, values
        last = np.append(first[1:], len(inside)) - 1
        ends = inside[first], inside[last]
        places = np.repeat(np.searchsorted(time, at, side="left"), 2)
        both = np.empty((2 * len(at), values.shape[1]))
        for i, name in enumerate(names):
            both[0::2, i], both[1::2, i] = self._limits(name, time, values[:, i], at, ends)
        times = np.insert(time, places, np.repeat(at, 2))
        return times, np.insert(values, places, both, axis=0)

    def _limits(
        self, name: str, time: Array, values: Array, at: Array, ends: tuple[Indices, Indices]
    ) -> tuple[Array, Array]:
        """Return a curve right before and after instants, of which the ends are entries."""
        log = self.log
        assert log is not None
        column = read_column_name(name, self.coordinates, self.constraints)
        quantity = "" if column is None else column.quantity
        if column is not None and quantity in ("q", "v"):
            place = self.coordinates.index(column.coordinate)
            before, after = (log.q, log.q) if quantity == "q" else (log.before, log.after)
            return before[ends[0], place], after[ends[1], place]
        if quantity in _HELD:
            gap = np.searchsorted(time, at, side="left")
            left = values[np.maximum(gap - 1, 0)]
            right = values[np.minimum(np.searchsorted(time, at, side="right"), len(time) - 1)]
            return left, np.where(np.append(gap[1:] != gap[:-1], True), right, left)
        if quantity in _ENERGIES:
            so_far = np.concatenate([[0.0], np.cumsum(_changes(log, quantity))])
            smooth = values - so_far[np.searchsorted(log.time, time, side="right")]
            rest = np.interp(at, time, smooth)
            first, past = (np.searchsorted(log.time, at, side=side) for side in _SIDES)
            return rest + so_far[first], rest + so_far[past]
        middle = np.interp(at, time, values)
        return middle, middle


def _changes(log: EventLog, quantity: str) -> Array:
    """Return by how much each entry changes an energy.

    Impacts change T. Actions do, where velocities change; else they change V.
    """
    moved = (log.before != log.after).any(axis=1)
    impacts = log.supplied - log.loss
    if quantity == "energy_total":
        return np.asarray(impacts + log.work)
    if quantity == "energy_kinetic":
        return np.asarray(impacts + np.where(moved, log.work, 0.0))
    return np.where(moved, 0.0, log.work)
