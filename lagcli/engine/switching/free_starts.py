"""Runs of Systems that switch that start at their given values, found for many runs together.

Where no constraint holds at the start (contacts are open, or touch), nothing is to be solved: what
`lagcli.simulations.start.find_start` checks for one run is checked here for all.
"""

from __future__ import annotations

import numpy as np

from lagcli.arrays import Array, Flags
from lagcli.engine.core.batch import BatchTable
from lagcli.engine.system import System

#: Least eigenvalue of M, scaled to a diagonal of ones, that is clearly not zero.
_INERTIA = 1e-9


class FreeStarts:
    """Finds the runs of a System that start at their given values; not thread-safe.

    Parameters
    ----------
    system : System
        With ``switching``.
    """

    def __init__(self, system: System):
        assert system.switching is not None
        self.system, self.switching = system, system.switching
        #: Whether there are such runs.
        self.any = not (system.held_at_start or system.nonlinear or system.functions.functions)
        self._tables = {
            name: BatchTable.of_rows(tape)
            for name, tape in (
                ("constraint", system.constraint),
                ("dynamics", system.dynamics),
                ("impact", self.switching.impact),
                ("limits", self.switching.limits),
            )
            if self.any
        }

    def __call__(self, t: float, parameters: Array, q: Array, v: Array) -> Flags:
        """Return which of n runs start at their values: valid, and with inertia.

        Parameters
        ----------
        t : float
            s.
        parameters : (n, np) array
        q, v : (n, nq) arrays
        """
        count = len(q)
        if not self.any:
            return np.zeros(count, dtype=bool)
        state = np.hstack([np.full((count, 1), t), q, v])
        nothing = np.zeros((count, q.shape[1] + len(self.system.constraints)))
        with np.errstate(all="ignore"):
            plain, with_forces = np.hstack([state, parameters]), [state, nothing, parameters]
            valid = np.isfinite(plain).all(axis=1)
            valid &= self._no_gap_is_violated(self._values("constraint", plain))
            valid &= self._has_inertia(self._values("dynamics", plain))
            impact = self._values("impact", plain)
            limits = self._values("limits", np.hstack(with_forces))
        rows = self.switching.rows
        unilateral = sum(bool(row.sign) for row in rows)
        limited = sum(row.limit is not None for row in rows)
        valid &= (impact >= 0.0).all(axis=1) & (impact[:, :unilateral] <= 1.0).all(axis=1)
        valid &= (limits[:, : 2 * limited] >= 0.0).all(axis=1)
        return valid

    def _values(self, name: str, inputs: Array) -> Array:
        """Return the outputs of a tape, (n, outputs)."""
        out: Array = self._tables[name](inputs[None], np.empty((1, 0)))[0].T
        return out

    def _no_gap_is_violated(self, out: Array) -> Flags:
        """Return where all gaps of active contacts are open or zero."""
        position = self.system.constraint_layout.split(out.T)["position"]
        valid: Flags = np.all(np.isfinite(out), axis=1)
        for row in self.switching.rows:
            if row.sign and row.active:
                gap: Array = row.sign * position[self.system.holonomic.index(row.row)]
                valid &= np.asarray(gap >= 0.0)
        return valid

    def _has_inertia(self, out: Array) -> Flags:
        """Return where M is clearly regular."""
        count, nq = len(out), len(self.system.coordinates)
        mass = np.zeros((count, nq, nq))
        for (i, j), x in zip(self.system.mass_pattern, out.T, strict=False):
            mass[:, i, j] = x
        size = np.sqrt(np.abs(np.einsum("nii->ni", mass)))
        valid: Flags = np.isfinite(out).all(axis=1) & (size > 0.0).all(axis=1)
        size[~valid], mass[~valid] = 1.0, np.eye(nq)
        scaled = mass / (size[:, :, None] * size[:, None, :])
        values = np.linalg.eigvalsh((scaled + scaled.swapaxes(1, 2)) / 2)
        valid &= np.abs(values).min(axis=1, initial=np.inf) > _INERTIA
        return valid
