"""Check that the columns of a run are finite."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lagcli.arrays import Array
from lagcli.columns import RESIDUALS, SAMPLED, column_names
from lagcli.trajectory.samples import Samples

#: Columns that are not checked: the residuals of inactive constraints are NaN, and the constraint
#: force is a sum of others.
_EXCEPT = {"time", "constraint_force", *(x.name for x in RESIDUALS)}
_CHECKED = tuple(x for x in SAMPLED if x.name not in _EXCEPT)
_LISTED = 5  # largest number of columns with a warning each


class _Found:
    """The samples at which a column is not finite."""

    def __init__(self, first: float):
        self.first, self.count, self.infinite = first, 0, True


class FiniteColumns:
    """Finds the columns that are NaN or infinite at some samples of a run, block by block."""

    def __init__(self) -> None:
        self.samples = 0
        self._found: dict[str, _Found] = {}

    def add(self, samples: Samples) -> None:
        """Take the next samples."""
        self.samples += len(samples.time)
        for name, values in samples.outputs.items():
            self._column(name, samples.time, values)
        for quantity in _CHECKED:
            table: Array = getattr(samples, quantity.name)
            if np.isfinite(table.sum()):
                continue
            names = column_names(
                quantity,
                samples.coordinates,
                samples.constraints,
                [
                    (samples.constraints[i], samples.coordinates[j])
                    for i, j in zip(samples.terms.constraint, samples.terms.coordinate, strict=True)
                ],
                samples.conserved_names,
            )
            columns = table.reshape(len(samples.time), -1).T
            for which, column in zip(names, columns, strict=True):
                self._column(str(which), samples.time, column)

    def _column(self, name: str, time: Array, values: Array) -> None:
        bad = ~np.isfinite(values)
        if not bad.any():
            return
        found = self._found.setdefault(name, _Found(float(time[np.argmax(bad)])))
        found.count += int(bad.sum())
        found.infinite = found.infinite and not np.isnan(values).any()

    def warnings(self) -> tuple[str, ...]:
        """Return a sentence for each of the first columns, and one for the rest."""
        found = [
            undefined_at(name, x.infinite, x.count, self.samples, x.first)
            for name, x in self._found.items()
        ]
        rest = len(found) - _LISTED
        if rest > 1:
            found[_LISTED:] = [f"{rest} more columns are not finite at some samples"]
        return tuple(found)


def undefined_at(name: str, infinite: bool, count: int, samples: int, first: float) -> str:
    """Return the warning of values that are not finite.

    Parameters
    ----------
    name : str
        A column, or an expression.
    infinite : bool
        Whether all of them are infinite; otherwise some are NaN.
    count, samples : int
        Number of such samples, and of all.
    first : float
        Time of the first one, s.
    """
    what = "infinite" if infinite else "NaN"
    return f"`{name}` is {what} at {count} of {samples} samples, first at t = {first:.6g}"


def undefined_rows(names: Sequence[str], time: Array, signals: Array) -> dict[int, str]:
    """Return the warnings of runs with signals that are not finite.

    Parameters
    ----------
    names : sequence of n str
    time : (nt,) array
    signals : (runs, n, nt) array

    Returns
    -------
    dict of int to str
        Warning of its first such signal, by the index of a run.
    """
    bad = ~np.isfinite(signals)
    found = {}
    for i in np.flatnonzero(bad.any(axis=(1, 2))).tolist():
        k = int(np.argmax(bad[i].any(axis=1)))
        infinite = not np.isnan(signals[i, k]).any()
        at = float(time[np.argmax(bad[i, k])])
        found[i] = undefined_at(names[k], infinite, int(bad[i, k].sum()), len(time), at)
    return found
