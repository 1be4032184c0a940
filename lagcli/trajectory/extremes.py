"""Largest and smallest values along a run, computed block by block."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from lagcli.arrays import Array
from lagcli.columns import ERRORS, PANELS


class Drift:
    """First value of a conserved quantity and largest difference from it; NaN if there is none."""

    def __init__(self) -> None:
        self.first = self.drift = math.nan


class Extreme:
    """Smallest and largest value of a quantity and their times, s; NaN if there is none."""

    def __init__(self) -> None:
        self.low = self.low_time = self.high = self.high_time = math.nan


class Extremes:
    """Extremes for the summary of a run, in constant memory.

    NaN values are ignored.

    Parameters
    ----------
    constraints : sequence of str
        Names, in the model's order.
    conserved : sequence of str
        Names of the conserved quantities.

    Attributes
    ----------
    samples : int
    first, last : float
        Times, s; NaN without samples.
    multipliers : dict of str to Extreme
        Extremes by constraint.
    residual_position, residual_velocity : (nc,) arrays
        Largest magnitude by constraint; NaN if there is none.
    residual_equation, energy_balance : float
        Largest magnitude; NaN if there is none.
    conserved : dict of str to Drift
        Drift by conserved quantity.
    """

    #: The fields of `Samples` that are used.
    COLUMNS = (
        "time",
        "multipliers",
        "conserved",
        *(q.name for q in (*ERRORS, *PANELS["energies"])),
    )

    def __init__(self, constraints: Sequence[str], conserved: Sequence[str]):
        self.samples = 0
        self.first = self.last = math.nan
        self.multipliers = {name: Extreme() for name in constraints}
        self.conserved = {name: Drift() for name in conserved}
        self.residual_position = np.full(len(constraints), math.nan)
        self.residual_velocity = np.full(len(constraints), math.nan)
        self.residual_equation = self.energy_balance = math.nan
        self._energy = math.nan  # the largest |T| and |E|
        self._potential = Extreme()

    @property
    def energy_scale(self) -> float:
        """The energy scale of the balance, J: the largest of |T|, |E| and the range of V."""
        swing = self._potential.high - self._potential.low
        scale = np.fmax(self._energy, swing)
        return 0.0 if math.isnan(scale) else float(scale)

    def add(self, columns: Mapping[str, Array]) -> None:
        """Update with the next samples.

        Parameters
        ----------
        columns : mapping of str to array
            Fields of ``COLUMNS``, by name; others are ignored.
        """
        time = columns["time"]
        if not len(time):
            return
        if not self.samples:
            self.first = float(time[0])
        self.samples += len(time)
        self.last = float(time[-1])
        widen(list(self.multipliers.values()), time, columns["multipliers"])
        for drift, values in zip(self.conserved.values(), columns["conserved"].T, strict=True):
            if math.isnan(drift.first):
                drift.first = float(values[0])
            drift.drift = float(np.fmax(drift.drift, np.fmax.reduce(np.abs(values - drift.first))))
        widen([self._potential], time, columns["energy_potential"][:, None])
        for quantity in ERRORS:
            largest = np.fmax.reduce(np.abs(columns[quantity.name]), axis=0)
            so_far = np.fmax(getattr(self, quantity.name), largest)
            setattr(self, quantity.name, so_far if quantity.along else float(so_far))
        for name in ("energy_kinetic", "energy_total"):
            largest = np.fmax.reduce(np.abs(columns[name]))
            self._energy = float(np.fmax(self._energy, largest))


def known(value: float) -> float | None:
    """Return the number, or None for NaN."""
    return None if math.isnan(value) else float(value)


def widen(extremes: Sequence[Extreme], time: Array, values: Array) -> None:
    """Update with more values of quantities; of equal ones the first counts, NaN never.

    Parameters
    ----------
    extremes : sequence of n Extreme
        Modified in place.
    time : (nt,) array
    values : (nt, n) array
        A column for each.
    """
    some = np.flatnonzero(~np.isnan(values).all(axis=0))
    columns = values[:, some]
    if not columns.size:
        return
    low, high = np.nanargmin(columns, axis=0), np.nanargmax(columns, axis=0)
    every = np.arange(len(some))
    least, most = columns[low, every].tolist(), columns[high, every].tolist()
    found = zip(some.tolist(), least, time[low].tolist(), most, time[high].tolist(), strict=True)
    for which, lowest, low_time, highest, high_time in found:
        extreme = extremes[which]
        if not lowest >= extreme.low:
            extreme.low, extreme.low_time = lowest, low_time
        if not highest <= extreme.high:
            extreme.high, extreme.high_time = highest, high_time
