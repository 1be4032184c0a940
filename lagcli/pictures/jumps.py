"""Jumps of curves at the instants of contacts and events, and the marks of these instants."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from lagcli.arrays import Array, Indices
from lagcli.columns import PANELS, read_column_name
from lagcli.pictures.run_file import RunFile
from lagcli.pictures.selection import evenly
from lagcli.trajectory.event_log import EventLog

#: Quantities that jump with the modes.
_SIDED = (
    *("a", "multipliers", "constraint_force", "constraint_force_by"),
    *(quantity.name for quantity in PANELS["powers"]),
)
#: Energies, which jump by the changes due to impacts and events.
_ENERGIES = ("energy_total", "energy_kinetic", "energy_potential")
_SIDES: tuple[Literal["left", "right"], ...] = ("left", "right")
#: Number of samples on one side from which a curve is continued to an instant.
_BESIDE = 3
#: Largest number of marks on the plots of a page.
_MARKS = 400


def marks(log: EventLog | None) -> Array:
    """Return the distinct times of a log for the marks of a page, s; of many, evenly chosen
    ones."""
    if log is None or not len(log):
        return np.empty(0)
    times = np.unique(log.time)
    return times[evenly(len(times), _MARKS)]


class Jumps:
    """Inserts jumps at the instants of a log into curves, which are straight between samples.

    If an event records the column, its limits are used. Otherwise, coordinates and velocities are
    those of the log, and energies jump by its losses. Accelerations, forces, powers and outputs
    that jump are extrapolated to the instant from the samples on each side. Other curves are
    unchanged.
    """

    def __init__(self, run: RunFile):
        self.log = run.record.events
        self.coordinates, self.constraints = run.coordinates, run.constraints
        self.outputs = run.record.display.get("jumping", ())

    def drawn(self, name: str, time: Array, values: Array) -> tuple[Array, Array]:
        """Return one curve with its values right before and after each instant.

        Parameters
        ----------
        name : str
            Name of the column.
        time, values : (nt,) arrays
        """
        column = read_column_name(name, self.coordinates, self.constraints)
        jumping = ("q", "v", *_SIDED, *_ENERGIES)
        known = column is not None and column.quantity in jumping
        if self.log is None or not (known or name in self.outputs):
            return time, values
        drawn = self.inserted(time, [name], values[:, None])
        return drawn[0], drawn[1][:, 0]

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
            Each instant is contained twice; a sample at an instant has the value after it.
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
        """Return a curve right before and after instants with the given log entries."""
        log = self.log
        assert log is not None
        before, after = self._unrecorded_limits(name, time, values, at, ends)
        if name not in log.records.columns:
            return before, after
        recorded = log.recorded(name)
        sides = [recorded[side][ends[side]] for side in (0, 1)]
        return (
            np.where(np.isnan(sides[0]), before, sides[0]),
            np.where(np.isnan(sides[1]), after, sides[1]),
        )

    def _unrecorded_limits(
        self, name: str, time: Array, values: Array, at: Array, ends: tuple[Indices, Indices]
    ) -> tuple[Array, Array]:
        log = self.log
        assert log is not None
        column = read_column_name(name, self.coordinates, self.constraints)
        quantity = "" if column is None else column.quantity
        if column is not None and quantity in ("q", "v"):
            place = self.coordinates.index(column.coordinate)
            before, after = (log.q, log.q) if quantity == "q" else (log.before, log.after)
            return before[ends[0], place], after[ends[1], place]
        if quantity in _SIDED or name in self.outputs:
            next_ = np.searchsorted(time, at, side="left")
            left = _continued(time, values, at, next_ - 1, -1)
            right = _continued(time, values, at, next_, 1)
            # of several instants between two samples, it jumps at the last one
            early = np.append(next_[1:] == next_[:-1], False)
            held = values[np.maximum(next_ - 1, 0)]
            several = early | np.append(False, early[:-1])
            return np.where(several, held, left), np.where(early, held, right)
        if quantity in _ENERGIES:
            so_far = np.concatenate([[0.0], np.cumsum(_changes(log, quantity))])
            smooth = values - so_far[np.searchsorted(log.time, time, side="right")]
            rest = np.interp(at, time, smooth)
            first, past = (np.searchsorted(log.time, at, side=side) for side in _SIDES)
            return rest + so_far[first], rest + so_far[past]
        middle = np.interp(at, time, values)
        return middle, middle


def _continued(time: Array, values: Array, at: Array, nearest: Indices, away: int) -> Array:
    """Return a curve at instants, extrapolated from the samples on one side.

    Linearly from the last two samples if the curve is consistent with the previous one; otherwise,
    or if only one sample lies between two instants, constant.

    Parameters
    ----------
    time, values : (nt,) arrays
    at : (ni,) array
        Increasing.
    nearest : (ni,) array of int
        Index of the sample next to each instant on this side; beyond the ends, the last one.
    away : {-1, 1}
        Direction: samples before, or after.
    """
    end = len(time) - 1
    places = [np.clip(nearest + away * i, 0, end) for i in range(_BESIDE)]
    (t0, t1, t2), (y0, y1, y2) = ([x[place] for place in places] for x in (time, values))
    # a sample at an instant has the value after it
    first, last = np.append(-np.inf, at[:-1]), np.append(at[1:], np.inf)
    two, three = ((first <= t) & (t < last) & (t != nearer) for t, nearer in ((t1, t0), (t2, t1)))
    with np.errstate(all="ignore"):
        slope = (y0 - y1) / (t0 - t1)
        bent = np.where(three, 2 * slope - (y1 - y2) / (t1 - t2), slope)
        least = np.where(np.abs(bent) < np.abs(slope), bent, slope)
        extrapolated = y0 - away * least * np.minimum(np.abs(at - t0), np.abs(t0 - t1))
        steady = two & (slope * bent > 0) & np.isfinite(extrapolated)
    return np.asarray(np.where(steady, extrapolated, y0))


def _changes(log: EventLog, quantity: str) -> Array:
    """Return the change of an energy by each entry.

    Impacts change T. Actions change T if velocities change; otherwise V.
    """
    moved = (log.before != log.after).any(axis=1)
    impacts = log.supplied - log.loss
    if quantity == "energy_total":
        return np.asarray(impacts + log.work)
    if quantity == "energy_kinetic":
        return np.asarray(impacts + np.where(moved, log.work, 0.0))
    return np.where(moved, 0.0, log.work)
