"""Coordinate projection: onto φ = 0 by the smallest change in the metric of M, then onto ψ = 0.

Hairer & Wanner, Solving Ordinary Differential Equations II, VII.2.
"""

from __future__ import annotations

import numpy as np

from lagcli.arrays import Array, Indices
from lagcli.engine.contract import Stop, Undefined
from lagcli.engine.evaluator import Constraints, Evaluator
from lagcli.engine.linear import dense
from lagcli.engine.scales import coordinate_sizes, least_scales, usable
from lagcli.engine.system import System

#: Largest number of Newton steps: from the drift of one step, two reach rounding errors; a drift of
#: a tenth of the coordinates (rtol = 0.1) needs five.
_ITERATIONS = 10
#: The iteration ends when residuals are below this part of the constraint's scale ...
_RESIDUAL = 2e-15
#: ... and fails if they remain above this: no consistent state is nearby.
_NOT_REACHED = 1e-10


class Projection:
    """Projects states onto the constraints.

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
        # the constraints' largest scales so far, and the largest lengths of the rows of B times
        # sizes: relative to its current length, a vanishing row is rounding error
        self.position_scale = np.zeros(len(self.holonomic))
        self.velocity_scale = np.zeros(len(self.names))
        self.sizes: Array | None = None
        self.lengths = np.zeros(len(self.names))

    def __call__(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Return the nearest consistent state.

        Raises
        ------
        The equations are not finite during the iteration.
            The equations have no finite value on the way.
        Stop
            The constraints cannot be satisfied near the state.
        """
        if not self.names:
            return q, v
        mass = self.evaluator.dynamics(t, q, v).mass_matrix
        if not np.isfinite(mass).all():
            raise Undefined(self.evaluator.state(t, q, v))
        q, c = self._positions(t, q, v, mass)
        for _ in range(2):  # linear: the second removes rounding
            residual = c.velocity(v)
            if (np.abs(residual) <= _RESIDUAL * self.velocity_scale).all():
                break
            v = v + self._change(c.jacobian, residual, mass, self.rank, self.lengths)
        return q, v

    def _positions(
        self, t: float, q: Array, v: Array, mass: Array
    ) -> tuple[Array, Constraints[Array]]:
        """Return q on φ = 0, and the constraints there."""
        best = np.inf
        for _ in range(_ITERATIONS):
            c = self.evaluator.constraints(t, q, v)
            if not c.finite:
                raise Undefined(self.evaluator.state(t, q, v))
            self._measure(t, q, v, c, mass)
            if not self.holonomic:
                return q, c
            jacobian, lengths = c.jacobian[self.holonomic], self.lengths[self.holonomic]
            scale = usable(self.position_scale)
            worst = float((np.abs(c.position) / scale).max())
            if worst <= _RESIDUAL or worst >= 0.5 * best:
                break
            best = worst
            # the rank is that of all rows together; that of the holonomic rows is computed
            rank = self._count_rank(jacobian, lengths) if self.redundant else None
            q = q + self._change(jacobian, c.position, mass, rank, lengths)
        bad = np.abs(c.position) > _NOT_REACHED * scale
        if bad.any():
            raise self._stop(t, np.flatnonzero(bad), c.position, jacobian, lengths)
        return q, c

    def _measure(self, t: float, q: Array, v: Array, c: Constraints[Array], mass: Array) -> None:
        """Record the largest scales and lengths."""
        inertia = self.evaluator.system.inertia(np.diag(mass))
        if self.sizes is None:
            self.sizes = coordinate_sizes(inertia, c.jacobian)
        least = least_scales(inertia, c.jacobian, q)[self.holonomic]
        self.position_scale = np.maximum.reduce([self.position_scale, c.position_scale, least])
        least = least_scales(inertia, c.jacobian, v)
        self.velocity_scale = np.maximum.reduce([self.velocity_scale, c.velocity_scale, least])
        lengths = self.evaluator.row_lengths(t, q, v, c, self.sizes)
        self.lengths = np.maximum(self.lengths, lengths)

    def _count_rank(self, jacobian: Array, lengths: Array) -> int:
        return dense.count_rank(jacobian, scale=lengths, sizes=self.sizes)

    def _change(
        self, jacobian: Array, residual: Array, mass: Array, rank: int | None, lengths: Array
    ) -> Array:
        if not self.redundant:
            return dense.least_change(jacobian, residual, mass, None)
        return dense.least_change(jacobian, residual, mass, rank, lengths, self.sizes)

    def _stop(
        self, t: float, bad: Indices, residual: Array, jacobian: Array, lengths: Array
    ) -> Stop:
        listed = ", ".join(f"`{self.names[self.holonomic[i]]}`" for i in bad)
        parts = dense.decompose(jacobian, scale=lengths, sizes=self.sizes)
        scaled = residual / lengths
        contradiction = parts.dependent.T @ scaled
        # otherwise the coordinates could still reduce the residual
        if np.linalg.norm(contradiction) > 0.5 * np.linalg.norm(scaled):
            return Stop(
                f"the redundant constraints contradict each other at t = {t:.9g} s: {listed} cannot"
                " hold together with the others; correct or remove one of them"
            )
        return Stop(
            f"the motion cannot be brought back onto the constraints {listed} at t = {t:.9g} s;"
            " try a smaller --rtol or --max-step"
        )


def jumped(system: System, t: float, before: Array, after: Array) -> Stop:
    """Return the end of a run whose constraints are satisfied only far from the end of a step."""
    moved = np.abs(after - before)
    i = int(moved.argmax())
    return Stop(
        f"the constraints jump at t = {t:.9g} s: the nearest state that"
        f" satisfies them differs by {moved[i]:.3g} in `{system.coordinates[i]}`, far more than the"
        " error of a step; a holonomic constraint must be continuous: check floor, sign and if in"
        " it"
    )
