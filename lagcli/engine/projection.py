"""Coordinate projection: back to φ = 0 by the smallest change in the metric of M, then to ψ = 0.

Hairer & Wanner, Solving Ordinary Differential Equations II, VII.2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lagcli.engine import linear
from lagcli.engine.evaluator import Constraints, Evaluator
from lagcli.engine.run import Stop, Undefined

Array = NDArray[np.float64]

#: Newton steps: from the drift of one step, two reach rounding error; a drift of a tenth of the
#: coordinates (rtol = 0.1) needs five.
_ITERATIONS = 10
#: Residuals are brought below this times the constraint's own scale ...
_RESIDUAL = 2e-15
#: ... and must come below this: beyond rounding error, there is no consistent state nearby.
_NOT_REACHED = 1e-10


class Projection:
    """Brings states onto the constraints.

    Parameters
    ----------
    evaluator : Evaluator
    rank : int
        Rank of B.
    """

    def __init__(self, evaluator: Evaluator, rank: int):
        system = evaluator.system
        self.evaluator, self.rank = evaluator, rank
        self.names = system.constraints
        self.holonomic = list(system.holonomic)
        self.redundant = rank < len(self.names)
        # the largest sums of the magnitudes of the constraints' terms so far
        self.position_scale = np.zeros(len(self.holonomic))
        self.velocity_scale = np.zeros(len(self.names))

    def __call__(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Return the consistent state next to a state.

        Raises
        ------
        Undefined
            The equations have no finite value on the way.
        Stop
            The constraints cannot be met near the state.
        """
        if not self.names:
            return q, v
        mass = self.evaluator.dynamics(t, q, v).mass_matrix
        if not np.isfinite(mass).all():
            raise Undefined(t, q, v)
        q, c = self._positions(t, q, v, mass)
        for _ in range(2):  # linear: the second removes rounding
            residual = c.velocity(v)
            if (np.abs(residual) <= _RESIDUAL * self.velocity_scale).all():
                break
            v = v + self._change(c.jacobian, residual, mass, self.rank)
        return q, v

    def _positions(self, t: float, q: Array, v: Array, mass: Array) -> tuple[Array, Constraints]:
        """Return q on φ = 0, and the constraints there."""
        best = np.inf
        for _ in range(_ITERATIONS):
            c = self.evaluator.constraints(t, q, v)
            if not c.finite:
                raise Undefined(t, q, v)
            self.position_scale = np.maximum(self.position_scale, c.position_scale)
            self.velocity_scale = np.maximum(self.velocity_scale, c.velocity_scale)
            if not self.holonomic:
                return q, c
            jacobian = c.jacobian[self.holonomic]
            scale = np.maximum(self.position_scale, np.finfo(float).tiny)
            worst = float((np.abs(c.position) / scale).max())
            if worst <= _RESIDUAL or worst >= 0.5 * best:
                break
            best = worst
            # the rank is that of all rows together; of the holonomic ones alone it is counted
            rank = linear.decompose(jacobian).rank if self.redundant else None
            q = q + self._change(jacobian, c.position, mass, rank)
        # constraints whose terms vanish are judged by the coordinates' size
        size = np.maximum(scale, linear.row_scale(jacobian) * np.abs(q).max())
        bad = np.abs(c.position) > _NOT_REACHED * size
        if bad.any():
            raise self._stop(t, [self.names[self.holonomic[i]] for i in np.flatnonzero(bad)])
        return q, c

    def _change(self, jacobian: Array, residual: Array, mass: Array, rank: int | None) -> Array:
        return linear.least_change(jacobian, residual, mass, rank if self.redundant else None)

    def _stop(self, t: float, names: list[str]) -> Stop:
        listed = ", ".join(f"`{name}`" for name in names)
        if self.redundant:
            return Stop(
                f"the redundant constraints contradict each other at t = {t:.9g} s: {listed} cannot"
                " hold together with the others; mend or drop one of them"
            )
        return Stop(
            f"the motion cannot be brought back onto the constraints {listed} at t = {t:.9g} s;"
            " try a smaller --rtol or --max-step"
        )
